"""The characteristic function of the arm and of its closed loop: entire at C = 0, analytic but for s = -1/C.

The free response needs an input at the hub, the *drive*; a law asks for another, minus the sum of its gains times the
outputs that they multiply of that response, the *numerators*, and an eigenvalue is where both agree:

    D(s) = drive + gains . numerators,     numerators = theta, s theta, M(0)/(1 + C s)

(the gauge at the root reads the moment without its damping part), so feedback changes one row of the paper's matrix,
and closed-loop poles are zeros of a function as exact as the arm's own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import reduce
from operator import add
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import GAINS, Arm, HubFeedback
from tfarm.arrays import Complex, Real
from tfarm.records import read_only

from .outputs import OUTPUTS, unit_scale
from .system import System, system_of
from .values import free_outputs, free_slopes

Gains = tuple[Fraction, ...]  # of a law without dimensions, in the order of `GAINS`, exact
NO_GAINS: Gains = (Fraction(0),) * len(GAINS)
FED = tuple(OUTPUTS[gain.output] for gain in GAINS)
assert all(each.place != "x" for each in FED)  # a gain is on an output with a place of its own
TURNING = ("theta", "W", "Psi", "centre")  # quantities that follow the hub's angle where the arm turns slowly
NEXT_TO_REST = 1e-60  # 1/s, for s = 0: there D over a power of s is its limit to the last digit, and no power is 0
DIFFERENCE_STEP = 1e-6  # of |s|, or of the way to -1/C, for differences


def loop_system(arm: Arm) -> System:
    """The exact system of an arm under a law."""
    return system_of(arm)


def unit_gains(k: System) -> Gains:
    """What a gain of one SI unit is without dimensions: worked out once for each system."""
    if "unit gains" not in k.kept:
        k.kept["unit gains"] = tuple(unit_scale(OUTPUTS[gain.output], k) for gain in GAINS)
    return cast("Gains", k.kept["unit gains"])


def gains_of(k: System, law: HubFeedback) -> Gains:
    """The gains of a law without dimensions."""
    return tuple(Fraction(gain) * unit for gain, unit in zip(law.row, unit_gains(k), strict=True))


def dimensionless(k: System, laws: Real) -> Real:
    """Rows (gains, ...) of gains in SI units, in the order of `GAINS`, without dimensions, as doubles."""
    units = np.array([float(unit) for unit in unit_gains(k)])
    return np.asarray(units.reshape(-1, *[1] * (laws.ndim - 1)) * laws)


def torque(gains: Iterable[Any], fed_back: Iterable[Any]) -> Any:
    """gains . numerators, for any kind of number; a gain may be an array of one value a point.

    Plain gains of 0 are left out, but for the last: half of most laws.
    """
    *terms, last = zip(gains, fed_back, strict=True)
    used = [each for each in terms if not (isinstance(each[0], float) and each[0] == 0)]
    return reduce(add, (part * gain for gain, part in [*used, last]))


class Analytic(NamedTuple):
    """Values f e^{-scale}, their derivatives f' e^{-scale}, and scale, at given points."""

    value: Complex
    slope: Complex
    scale: Complex


class LoopParts(NamedTuple):
    """Drive (n,), numerators (gains, n), and scale (n,) of the free response times e^{-scale}, for s of any shape."""

    drive: Complex
    numerators: Complex
    scale: Complex


def characteristic(k: System, s: Complex, gains: Gains = NO_GAINS, at_zero: int = 0) -> Analytic:
    """D(s)/s^at_zero and its derivative at s (1-D, complex), in float64."""
    s = off_rest(s) if at_zero else s
    used = [each for each, gain in zip(FED, gains, strict=True) if gain]
    here, slopes = free_slopes(k, used, s, 0.0)
    units = [float(gain / unit) for gain, unit in zip(gains, unit_gains(k), strict=True) if gain]  # outputs are SI
    both = (here, slopes)
    value, slope = (each.drive + np.tensordot(units, each.outputs, 1) if units else each.drive for each in both)
    return deflated(value, slope, here.scale, s, at_zero)


def off_rest(s: Complex) -> Complex:
    """s, and next to 0 for 0: where D is divided by a power of s."""
    return np.where(s == 0, NEXT_TO_REST, s)


def deflated(value: Complex, slope: Complex, scale: Complex, s: Complex, at_zero: int) -> Analytic:
    """D/s^at_zero from D and its slope at s, which is not 0."""
    if at_zero:
        value = value / s**at_zero
        slope = slope / s**at_zero - at_zero * value / s
    return Analytic(value, slope, scale)


def as_column(gains: Gains) -> Real:
    """Gains without dimensions as the one row of them that all points have (gains, 1)."""
    return np.array([[float(gain)] for gain in gains])


def quick_characteristics(k: System, s: Complex, rows: Real, at_zero: int = 0) -> Analytic:
    """`characteristic` with slopes from differences, right to about 1e-8: thirty times as fast for a hundred points.

    With gains of their own at each point, rows (gains, n), or one `as_column` (gains, 1), dimensionless.
    """
    s = off_rest(np.asarray(s, dtype=complex))
    h = difference_steps(k, s)
    at = np.array([s, s + h, s - h])
    parts = loop_parts(k, at)
    values = (parts.drive + (rows[:, None, :] * parts.numerators).sum(axis=0)) / at**at_zero
    up, down = values[1:] * np.exp(parts.scale[1:] - parts.scale[0])
    return Analytic(values[0], (up - down) / (2.0 * h), parts.scale[0])


def float_units(k: System) -> Real:
    """`unit_gains` as a column of doubles: SI outputs per numerator without dimensions."""
    if "float units" not in k.kept:
        k.kept["float units"] = read_only(np.array([[float(unit)] for unit in unit_gains(k)]))
    return cast("Real", k.kept["float units"])


def difference_steps(k: System, s: Complex) -> Real:
    """h [1/s] for a slope at s from values at s +- h: a share of |s|, or of the way to a -1/C."""
    near = np.min([np.ones(s.shape), *(abs(1.0 - s / each) for each in k.singular)], axis=0)
    return np.asarray(DIFFERENCE_STEP * np.maximum(abs(s) * near, 1e-300))


def loop_parts(k: System, s: NDArray[Any]) -> LoopParts:
    """Drive, numerators and scale at s: what a law makes of them is linear, D = drive + torque(gains, numerators)."""
    free = free_outputs(k, FED, np.asarray(s, dtype=complex).ravel(), 0.0)
    numerators = free.outputs / float_units(k)
    return LoopParts(*(part.reshape(*part.shape[:-1], *s.shape) for part in (free.drive, numerators, free.scale)))


def zeros_at_origin(k: System, gains: Sequence[Fraction | float] = NO_GAINS) -> int:
    """How often D vanishes at s = 0: twice where the whole arm turns freely, once where the hub's rate is fed back.

    Not where its angle is, or what turns with it.  (A third time under the moment's gain J/(J - I_h) alone, where gauge
    and inertia cancel: that zero is left in D.)
    """
    used = [each for each, value in zip(FED, gains, strict=True) if value]
    return min(k.at_rest, *(each.power for each in used if each.quantity in TURNING), 2)
