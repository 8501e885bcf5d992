"""Mode shapes of a chain: the free response at its natural frequencies, in float64, of unit modal mass.

At an eigenvalue the state that the axis allows (W = 0) meets the plane of the payload's states everywhere along the
link, so the sweeps of the response give the shape at any number of places at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import copy
from fractions import Fraction
from functools import cached_property

import numpy as np

from tfarm.arrays import Real
from tfarm.errors import ConvergenceError
from tfarm.exact.chain import ElementChain
from tfarm.exact.chain_values import free_fields
from tfarm.exact.elements import Body, Place, Segment

from .shapes import GAUSS_POINTS, NO_MOTION, PANEL_WAVES


class ChainShapes:
    """The modes of an undamped chain at its natural frequencies, dimensionless, of unit modal mass times EI/L.

    Call it with x (shares of the length, 1-D) for W, Psi, M, Q, each of shape (modes, x); at a joint or a body they are
    those of its outer side.  Raises ConvergenceError for a mode that the hub's axis cannot tell from another one.
    """

    def __init__(self, chain: ElementChain, omega: Real) -> None:
        self.chain, self.omega = chain, omega
        self._factor: Real = np.ones(omega.size)
        self._size = free_fields(chain, 1j * omega, ())[2].real  # a chain that is cut has other scales
        with np.errstate(all="ignore"):
            self._factor = np.asarray(1.0 / np.sqrt(self.masses()))
        self._forget()
        if not np.isfinite(self._factor).all():
            worst = float(omega[~np.isfinite(self._factor)][0])
            raise ConvergenceError(f"the mode at {worst:.10g} rad/s has no shape of its own: a double one", worst, 0.0)
        tip, theta = self.tip(), self.theta()
        motion = np.where(abs(tip[0]) > NO_MOTION * abs(tip[1]), tip[0], np.where(tip[1] != 0, tip[1], theta))
        self._factor = self._factor * np.where(motion < 0, -1.0, 1.0)
        self._forget()

    def __call__(self, x: Real) -> Real:
        return self.states(tuple(Place(Fraction(float(share))) for share in x))[0]

    def part(self, first: int, last: int) -> ChainShapes:
        """The same with the modes first..last - 1 alone."""
        part = copy(self)
        here = slice(first, last)
        part.omega, part._factor, part._size = self.omega[here], self._factor[here], self._size[here]
        part._forget()
        return part

    def _forget(self) -> None:
        """Let go of motions that were found in another scale, or of other modes."""
        self.__dict__.pop("_moving", None)

    def tip(self) -> Real:
        """W, Psi, M, Q of each mode at the tip, (4, modes)."""
        return self.states((Place(Fraction(1)),))[0][..., 0]

    def theta(self) -> Real:
        """Hub angle of each mode, 0 of a hub that is held."""
        return self.states(())[1] if self.chain.drive.turns else np.zeros(self.omega.size)

    def masses(self) -> Real:
        """The modal masses."""
        total = np.zeros(self.omega.size)
        for weight, motion in self._moving:
            total = total + weight @ motion**2
        return total

    def mass_matrix(self) -> Real:
        """Modal masses (diagonal) and products of different modes, in EI/L: the identity, if all is well."""
        return np.asarray(sum((motion.T * weight) @ motion for weight, motion in self._moving))

    def states(self, places: tuple[Place, ...]) -> tuple[Real, Real]:
        """W, Psi, M, Q (fields, modes, places) and the hub angle (modes,)."""
        fields, theta, scale = free_fields(self.chain, 1j * self.omega, places)
        turned = np.exp(scale - self._size) * self._factor  # real, as everything is on the axis without damping
        return (fields * turned[:, None]).real, (theta * turned).real

    @cached_property
    def _moving(self) -> list[tuple[Real, Real]]:
        """Inertias (n,) and the motions (n, modes) that they have: along the segments, of bodies, payload and hub."""
        chain, parts = self.chain, []
        for piece, weights, at in self.panels():
            W, Psi = self.states(at)[0][:2]
            parts.append((float(piece.g * piece.stiffness / piece.length**4) * weights, W.T))
            parts.append((float(piece.a * piece.stiffness / piece.length**2) * weights, Psi.T))
        bodies = list(self._bodies())
        for share, body in bodies:
            W, Psi = self.states((Place(share, "inner"),))[0][:2, :, 0]
            parts += [(np.array([float(body.mass)]), W[None]), (np.array([float(body.inertia)]), Psi[None])]
        W, Psi, *_ = self.tip()
        ends = (
            (chain.tip_mass, W + float(chain.offset) * Psi),
            (chain.tip_inertia, Psi),
            (chain.drive.inertia, self.theta()),
        )
        return parts + [(np.array([float(size)]), motion[None]) for size, motion in ends if math.isfinite(size)]

    def panels(self) -> Iterator[tuple[Segment, Real, tuple[Place, ...]]]:
        """Each segment with Gauss points along it and their weights as shares of the whole length."""
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        position = Fraction(1)
        for each in self.chain.segments:
            S = self.omega.max() ** 2
            waves = (float(each.g) * S) ** 0.25 + math.sqrt(S * float(each.a + each.b))
            panels = 2 + math.ceil(waves / PANEL_WAVES)
            start = position - each.length
            shares = ((np.arange(panels)[:, None] + (nodes + 1) / 2) / panels).ravel()
            at = tuple(Place(start + each.length * Fraction(float(share))) for share in shares)
            yield each, np.tile(weights / 2 / panels, panels) * float(each.length), at
            position = start

    def _bodies(self) -> Iterator[tuple[Fraction, Body]]:
        """Each body with its place."""
        position = Fraction(1)
        for each in self.chain.elements:
            if isinstance(each, Segment):
                position -= each.length
            elif isinstance(each, Body):
                yield position, each
