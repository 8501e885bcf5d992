"""The modal model: exact residues, the rigid body, and a static remainder for the modes left out.

    G(s) ~ R2/s^2 + R1/s + static + sum over modes of r1/(s - p1) + r2/(s - p2)

A truncated Mittag-Leffler series, exact at s -> 0.  At C = 0 the poles are exactly imaginary and the model is lossless.
At C > 0 the undamped modes do not diagonalise the damping, so the residues are those of the damped eigenvalues.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arm.checks import whole
from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError
from tfarm.exact.chain import ElementChain
from tfarm.exact.chain_values import beside_slow_pole
from tfarm.exact.coefficients import Coefficients
from tfarm.exact.outputs import OUTPUTS, Output
from tfarm.exact.system import System
from tfarm.response import TransferFunction, Wanted, transfer
from tfarm.spectrum import Modes, modes
from tfarm.spectrum.damped import DampedModes, all_damped_modes, entered, single_zeros

from .partial_fractions import PartialFractions
from .remainder import slow_remainder
from .residues import contour_residues, end_residues, undamped_residues

MOST_MODELLED = 1000  # of a model: its matrices of 2000 states take 32 MB
MOST_PROPER = 2  # power of s: a mode's share r s^2/(s^2 + w^2) is bounded, and one of s^3 is not
NEXT_TO_REST = 1e-3  # of the first frequency: a pole nearer to 0 leaves 1e-15 of itself five terms on


class ModalModel(PartialFractions):
    """The first flexible modes of the arm with their exact eigenvalues and residues (see `PartialFractions`)."""

    def first(self, count: int) -> ModalModel:
        """The model with the first `count` of these modes: those left out leave their static share."""
        gone = (self.residues[:, count:] / self.eigenvalues[count:]).real.sum(axis=(1, 2))
        return replace(
            self,
            index=self.index[:count],
            natural_frequency=self.natural_frequency[:count],
            eigenvalues=self.eigenvalues[:count],
            residues=self.residues[:, :count],
            static=self.static - gone,
            participation=self.participation[:count],
        )


def modal_model(
    arm: Arm,
    outputs: Wanted,
    count: int,
    x: float | None = None,
    *,
    branches: Callable[[Modes], DampedModes] = all_damped_modes,
) -> ModalModel:
    """The modal model of an arm with its first `count` flexible modes (0 to 1000), for one output or several.

    `x` [m] is the place of outputs along the arm.  Where the hub is locked, hub angle is the input and no rigid body is
    left.  At C > 0 the eigenvalues and residues are those of the damped arm, overdamped modes by their two real poles.
    For one arm with many C: `branches`, that remembers where they were.
    Raises ParameterError for an unknown output, a count out of range, and an output that grows with s without bound.
    """
    G = transfer(arm, outputs, x=x)
    count = whole("count", count, 0, MOST_MODELLED, f"a whole number of flexible modes, 0 to {MOST_MODELLED}")
    k, share = G.system, G.share
    wanted = [proper(k, each, share) for each in G.rows]
    table = modes(arm, max(1, int(count)))
    flexible = slice(int(arm.has_rigid_mode), int(arm.has_rigid_mode) + int(count))
    collocated = OUTPUTS["root_moment" if arm.is_locked else "hub_angle"]
    p, r, single, alone = _poles_and_residues(arm, table, k, [*wanted, collocated], share, branches)
    p, r = p[:count], r[:, :count]
    expansion, kept = _beside_slow(G, single, table)
    return ModalModel(
        arm=arm,
        rows=G.rows,
        x=G.x,
        index=table.index[flexible],
        natural_frequency=table.natural_frequency[flexible],
        eigenvalues=p,
        residues=r[:-1],
        rigid=expansion[:, :2],
        static=expansion[:, 2] + (r[:-1] / p).real.sum(axis=(1, 2)) + (alone / single)[:-1, kept].sum(axis=1),
        single=single,
        single_residues=alone[:-1] if single.size else None,
        participation=np.sqrt(abs((r[-1] * p[:, ::-1]).real.sum(axis=-1))),
    )


def relaxed_model(arm: Arm, outputs: Wanted, count: int, x: float | None = None) -> ModalModel:
    """The modal model of a damped arm with one state more, exact to first order at s -> 0.

    At C > 0 the bending modes left out are overdamped and follow as c b/w^2/(1 + C s), not at once as a static
    remainder does: their slow poles gather at -1/C.  So the remainder is D + E/(1 + C s), from G and G' at 0.
    Raises ParameterError at C = 0.
    """
    model, C = modal_model(arm, outputs, count, x), arm.damping
    if C == 0:
        raise ParameterError(key="link.damping", value=C, remedy="without damping nothing relaxes; take modal_model")
    exact, kept = _beside_slow(transfer(arm, model.rows, x=x), model.single, modes(arm, 1))
    slope = exact[:, 3] + (model.residues / model.eigenvalues**2).real.sum(axis=(1, 2))
    if model.single_residues is not None:
        slope = slope + (model.single_residues / model.single**2)[:, kept].sum(axis=1)
    return replace(model, static=model.static + slope / C, relaxation=-slope / C)


def slow_model(arm: Arm, outputs: Wanted, count: int, x: float | None = None) -> ModalModel:
    """The modal model of a damped arm with slow real poles in the place of all modes left out (`remainder`).

    They go in pairs, with the index 0.  Raises ParameterError at C = 0.
    """
    model, C = modal_model(arm, outputs, count, x), arm.damping
    if C == 0:
        raise ParameterError(key="link.damping", value=C, remedy="without damping nothing is slow; take modal_model")
    exact = transfer(arm, outputs, x=x)
    corners, shares = slow_remainder(C, lambda s: exact(s).reshape(-1, s.size) - model(s))
    p, none = -corners.reshape(-1, 2), np.zeros(corners.size // 2, np.int64)
    residues = (shares * corners).reshape(len(shares), -1, 2)
    return replace(
        model,
        index=np.r_[model.index, none],
        natural_frequency=np.r_[model.natural_frequency, np.sqrt(p.prod(axis=1))],
        eigenvalues=np.r_[model.eigenvalues, p],
        residues=np.concatenate([model.residues, residues], axis=1),
        static=model.static - shares.sum(axis=1),
        participation=np.r_[model.participation, 0.0 * none],
    )


def _beside_slow(G: TransferFunction, single: Real, table: Modes) -> tuple[Real, NDArray[np.bool_]]:
    """The expansion of an arm (outputs, 4), and which of its single poles (m,) have their share in it yet.

    The pole of a hub that hardly any friction brings to rest has not: there 1 and s have what is left without it.
    """
    expansion, kept = G.expansion, np.ones(single.size, np.bool_)
    slowest = abs(single).min(initial=math.inf)
    first = table.natural_frequency[table.index > 0][0]
    if isinstance(G.system, ElementChain) and G.arm.has_rigid_mode and slowest < NEXT_TO_REST * first:
        expansion = np.c_[expansion[:, :2], beside_slow_pole(G.system, G.rows, G.share)]
        kept = abs(single) > slowest
    return expansion, kept


def proper(k: System, wanted: Output, share: float) -> Output:
    """The output, if a state space of finite order can have it.  Raises ParameterError if not."""
    if wanted.power and wanted.constant(k, share):
        remedy = "a power of s times the input itself, which no state space has; ask for another output"
        raise ParameterError(key="outputs", value=wanted.name, remedy=remedy)
    if wanted.power > MOST_PROPER:
        remedy = f"s^{wanted.power} makes it grow with s, as no state space does; ask for a lower derivative"
        raise ParameterError(key="outputs", value=wanted.name, remedy=remedy)
    return wanted


def _poles_and_residues(
    arm: Arm,
    table: Modes,
    k: System,
    wanted: list[Output],
    share: float,
    branches: Callable[[Modes], DampedModes],
) -> tuple[Complex, Complex, Real, Real]:
    """Eigenvalues (n, 2) and residues (outputs, n, 2) at them; single real ones (m,) and theirs (outputs, m)."""
    none = np.empty(0), np.empty((len(wanted), 0))
    if arm.is_undamped:
        s = 1j * table.natural_frequency[table.index > 0]
        p = np.stack([s, s.conj()], axis=1)
        if not arm.input_lags:
            powers = np.array([[each.power] for each in wanted])
            upper = undamped_residues(table, wanted, k, share) * s**powers / (2 * s)
            return p, np.stack([upper, upper.conj()], axis=2), *none
        single = np.array(single_zeros(table))  # of the motor's circuit
    else:
        damped = branches(table)
        p, single = damped.eigenvalues[table.index > 0], np.r_[damped.single, entered(damped)]
    residues, doubtful = end_residues(k, wanted, p.ravel(), share)
    doubtful = doubtful | (isinstance(k, Coefficients) and any(not each.is_at_end for each in wanted))
    if doubtful.any():
        residues[:, doubtful] = contour_residues(k, wanted, p.ravel()[doubtful], share)
    residues = residues.reshape(len(wanted), *p.shape)
    pair = p[:, 0].imag > 0
    residues[:, pair, 1] = residues[:, pair, 0].conj()
    residues[:, ~pair] = residues[:, ~pair].real
    if not single.size:
        return p, residues, *none
    apart = arm.is_undamped  # the circuit's pole alone, where the current is 0 over 0
    at = single.astype(complex)
    alone = contour_residues(k, wanted, at, share) if apart else end_residues(k, wanted, at, share)[0]
    return p, residues, single, alone.real.astype(float)
