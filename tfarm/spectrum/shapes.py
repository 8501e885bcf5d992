"""Mode shapes: the null vector of the end conditions in a basis that neither grows nor becomes parallel.

Where waves travel or decay appreciably each mode is a sum of four of them, two running (or decaying) from the root and
two from the tip.  At low frequency, |z| < 6, it is carried from the root by the transition functions.
A double frequency has two modes: its null space is taken whole and made orthogonal in the modal mass.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import copy
from typing import Any

import numpy as np

from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.exact.closed_form import SERIES_RADIUS, even_functions
from tfarm.exact.coefficients import Coefficients, EndCondition
from tfarm.exact.compiled import python_of
from tfarm.exact.fields import Wave, free_root, from_root, tip_condition, waves

_even = python_of(even_functions)

GAUSS_POINTS = 16  # a panel; exact for the products of waves once a panel holds a few radians
PANEL_WAVES = 4.0  # rad of the fastest wave in a panel: there 16 points integrate products of two to the last digit
LEAST_PANELS = 4  # of a beam, however slow its waves: more than they need
DOUBLE = 4e-15  # relative gap under which two frequencies are one, with two modes
CLOSE_MODES = 1e-5  # relative gap under which rounding would leave two modes not quite orthogonal
QUADRATURE_BLOCK = 2**17  # modes times points that are evaluated at once, each of 256 bytes: memory, whatever the count
FIRST_BLOCK = 4  # modes, of which each next block has twice as many, as their panels differ: time alone
NO_MOTION = 1e-9  # of another motion of the tip or hub: a smaller one is rounding, and has no sign


class Shapes:
    """The modes of an undamped arm at its natural frequencies, dimensionless, of unit modal mass times EI/L.

    Call it with x (shares of the length, 1-D) for W, Psi, M, Q, each of shape (modes, x).
    """

    def __init__(self, k: Coefficients, omega: Real) -> None:
        self.k, self.omega = k, omega
        S, _, gS, one, two = waves(k, 1j * omega)
        self._S, self._gS, self._one, self._two = S.real, gS.real, one, two
        self._low = np.maximum(abs(one.z), abs(two.z)) < SERIES_RADIUS
        self._root = np.array(free_root(k, self._S[self._low], 1.0))
        self._weights = self._null_vectors()
        self._normalise()

    def __call__(self, x: Real) -> Real:
        result = np.empty((4, self.omega.size, x.size))
        low, high = self._low, ~self._low
        if low.any():
            S, root = self._S[low, None], self._root[:, :, None]
            Y, Phi, M, Q = from_root(self.k, S, 1.0, root, x[None, :])
            result[:, low] = Y + x * root[0], Phi + root[0], M, Q
        if high.any():
            result[:, high] = np.einsum("sm,fsmx->fmx", self._weights, self._basis(x)).real
        return result

    def part(self, first: int, last: int) -> Shapes:
        """The same with the modes first..last - 1 alone, as they are normalised here."""
        part = copy(self)
        here = slice(first, last)
        lows = int(self._low[:first].sum()), int(self._low[:last].sum())
        low, high = slice(*lows), slice(first - lows[0], last - lows[1])
        part.omega, part._S, part._gS, part._low = self.omega[here], self._S[here], self._gS[here], self._low[here]
        part._one, part._two = (Wave._make(p[here] for p in wave) for wave in (self._one, self._two))
        part._root, part._weights = self._root[:, low], self._weights[:, high]
        return part

    def blocks(self) -> Iterator[slice]:
        """Neighbouring modes, so few at a time that `quadrature` has `QUADRATURE_BLOCK` points for them in all."""
        first = 0
        while first < self.omega.size:
            last = min(2 * first + FIRST_BLOCK, self.omega.size)
            while last > first + 1 and (last - first) * GAUSS_POINTS * self.part(first, last).panels > QUADRATURE_BLOCK:
                last = (first + last) // 2
            yield slice(first, last)
            first = last

    def tip(self) -> Real:
        """W, Psi, M, Q of each mode at the tip, (4, modes)."""
        return self(np.array([1.0]))[..., 0]

    def theta(self) -> Real:
        """Hub angle of each mode; from the hub's own balance where its inertia leads, so that no digit is lost."""
        root = self(np.zeros(1))[..., 0]
        hub = EndCondition.of(self.k.hub_inertia)
        if self.k.is_locked:
            return np.zeros_like(self.omega)
        inertia, force = float(hub.inertia) * self._S, float(hub.force)
        heavy = abs(inertia) > force
        return np.where(heavy, force * root[2] / np.where(heavy, inertia, 1.0), root[1])

    @property
    def panels(self) -> int:
        """Panels of 0..1 that are short against every wave of these modes."""
        fastest = max(abs(self._one.t).max(), abs(self._two.t).max())
        return LEAST_PANELS + math.ceil(fastest / PANEL_WAVES)

    def quadrature(self) -> tuple[Real, Real]:
        """Gauss points and weights on 0..1 for products of these modes."""
        panels = self.panels
        nodes, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        start = np.arange(panels)[:, None]
        return ((start + (nodes + 1) / 2) / panels).ravel(), np.tile(weights / 2 / panels, panels)

    def mass_matrix(self) -> Real:
        """Modal masses (diagonal) and products of different modes, in EI/L: the identity, if all is well."""
        W, Psi, weight, ends = self._moving()
        mass = float(self.k.g) * (W * weight) @ W.T + float(self.k.a) * (Psi * weight) @ Psi.T
        return mass + sum(inertia * np.outer(motion, motion) for inertia, motion in ends)

    def masses(self) -> Real:
        """The modal masses alone."""
        W, Psi, weight, ends = self._moving()
        mass = float(self.k.g) * W**2 @ weight + float(self.k.a) * Psi**2 @ weight
        return mass + sum(inertia * motion**2 for inertia, motion in ends)

    def _moving(self) -> tuple[Real, Real, Real, list[tuple[float, Real]]]:
        """What moves: W and Psi at the points of `quadrature`, its weights; the ends' finite inertias and motions."""
        x, weight = self.quadrature()
        W, Psi, _, _ = self(x)
        tip, k = self.tip(), self.k
        ends = ((k.tip_mass, tip[0]), (k.tip_inertia, tip[1]), (k.hub_inertia, self.theta()))
        return W, Psi, weight, [(float(inertia), motion) for inertia, motion in ends if math.isfinite(inertia)]

    def _basis(self, x: Real) -> Complex:
        """The four waves of the modes above the low ones, at x: shape (4 fields, 4 waves, modes, x).

        Of each of the two wave numbers two solutions: from the root and from the tip, or even and odd in x.
        """
        high = np.flatnonzero(~self._low)
        found = np.empty((2, 2, 4, high.size, x.size), complex)
        for wave, pair in zip((self._one, self._two), found, strict=True):
            slow = abs(wave.z[high]) < 1.0
            for rows, solutions in ((slow, _even_and_odd), (~slow, _from_the_ends)):
                if rows.any():
                    part = Wave._make(each[high[rows], None] for each in wave)
                    pair[:, :, rows] = solutions(part, self._gS[high[rows], None], x)
        return found.reshape(4, 4, high.size, x.size).transpose(1, 0, 2, 3)

    def _null_vectors(self) -> Complex:
        """Weights of the four waves, (4, modes), that satisfy the four end conditions."""
        high = ~self._low
        S = self._S[high]
        if not S.size:
            return np.empty((4, 0), complex)
        root, tip = self._basis(np.array([0.0, 1.0])).transpose(3, 0, 1, 2)
        hub = EndCondition.of(self.k.hub_inertia)
        tip_mass, shear, tip_inertia, moment = tip_condition(self.k, S)
        drive = float(hub.rest) + float(hub.inertia) * S
        rows = np.array([
            root[0], drive * root[1] - float(hub.force) * root[2],
            tip_mass * tip[0] + shear * tip[3], tip_inertia * tip[1] + moment * tip[2],
        ]).transpose(2, 0, 1)  # fmt: skip
        columns = np.maximum(abs(rows / abs(rows).max(axis=2, keepdims=True)).max(axis=1), LEAST_SIZE)
        rows = rows / columns[:, None, :]
        rows = rows / abs(rows).max(axis=2, keepdims=True)
        _, _, right = np.linalg.svd(rows)
        omega = self.omega[high]
        second = np.r_[False, np.diff(omega) < DOUBLE * omega[1:]]  # the upper one of a double frequency
        vectors = np.where(second[:, None], right[:, 2].conj(), right[:, 3].conj()) / columns
        return vectors.T

    def _normalise(self) -> None:
        """Real phase, modes of a double frequency orthogonal, unit modal mass, tip (else its rotation) positive."""
        parts = [self.part(block.start, block.stop) for block in self.blocks()]
        turned = [part._weights * part._phase() for part in parts]
        self._weights = np.concatenate([self._weights[:, :0], *turned], axis=1)
        parts = [self.part(block.start, block.stop) for block in self.blocks()]
        self._scale(1.0 / np.sqrt(np.concatenate([part.masses() for part in parts])))
        self._orthogonalise()
        tip, theta = self.tip(), self.theta()
        motion = np.where(
            abs(tip[0]) > NO_MOTION * abs(tip[1]), tip[0], np.where(abs(tip[1]) > NO_MOTION * abs(theta), tip[1], theta)
        )
        self._scale(np.where(motion < 0, -1.0, 1.0))

    def _phase(self) -> Complex:
        """The factor of each mode of waves that makes it real."""
        if not self._weights.size:
            return np.empty(0, complex)
        fields = np.einsum("sm,fsmx->fmx", self._weights, self._basis(self.quadrature()[0])[:2])
        W = fields[0] + fields[1] / max(1.0, abs(fields[1]).max())
        peak = np.take_along_axis(W, abs(W).argmax(axis=1)[:, None], axis=1)[:, 0]
        return abs(peak) / peak

    def _scale(self, factor: Real) -> None:
        self._root = self._root * factor[self._low]
        self._weights = self._weights * factor[~self._low]

    def _orthogonalise(self) -> None:
        """Gram-Schmidt in the modal mass within each pair of close or double frequencies."""
        (pairs,) = np.nonzero(np.diff(self.omega) < CLOSE_MODES * self.omega[1:])
        for first in map(int, pairs):
            overlap = self.part(first, first + 2).mass_matrix()[0, 1]
            above = first - int(self._low[: first + 1].sum())
            self._weights[:, above + 1] -= overlap * self._weights[:, above]
            factor = np.ones_like(self.omega)
            factor[first + 1] = 1.0 / math.sqrt(self.part(first + 1, first + 2).masses()[0])
            self._scale(factor)


def _even_and_odd(wave: Wave, gS: Any, x: Real) -> Any:
    """For a wave that hardly turns along the arm."""
    z, v = wave.z, wave.v
    c, s = _even(z * x**2)
    s = x * s
    return (c, v * s, v * c, gS * s), (z * s, v * c, v * z * s, gS * c)


def _from_the_ends(wave: Wave, gS: Any, x: Real) -> Any:
    """e^(-t x) and e^(-t (1 - x)), neither of which grows."""
    v, t = wave.v, wave.t
    from_start, from_end = np.exp(-t * x), np.exp(-t * (1 - x))
    one = (from_start, -v / t * from_start, v * from_start, -gS / t * from_start)
    return one, (from_end, v / t * from_end, v * from_end, gS / t * from_end)
