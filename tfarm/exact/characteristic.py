"""The characteristic function of the arm and of its closed loop: entire at C = 0, analytic but for s = -1/C.

The free response needs an input at the hub, the *drive*; a law asks for another, minus the sum of its gains times the
outputs that they multiply of that response, the *numerators*, and an eigenvalue is where both agree:

    D(s) = drive + gains . numerators,     numerators = theta, s theta, M(0)/(1 + C s)

(the gauge at the root reads the moment without its damping part), so feedback changes one row of the paper's matrix,
and closed-loop poles are zeros of a function as exact as the arm's own.

The characteristic function D over a whole piece of a contour: balls as wide as a step, and still narrow values.

Evaluated on a wide ball an expression forgets that its parts move together.  By Taylor's theorem

    D(s) = D(m) + D'(m) (s - m) + ... + D^(n)(.) (s - m)^n / n!

where only the last term is taken over the wide ball, so that a step may be long.

A fast segment is crossed by its two waves, kept apart and scaled by e^{-t}: in the form of `balls.Sweep` a wide s would
lose what products of a wave with itself lose by cancelling, at any precision.  A slow one is crossed by the power
series of its transition functions, whose tail is bounded.  Where two waves may be one, the form of `balls` is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import reduce
from operator import add
from typing import Any, NamedTuple, cast

import flint
import numpy as np
from numpy.typing import NDArray

from tfarm.arm import GAINS, Arm, HubFeedback
from tfarm.arrays import Complex, Real
from tfarm.records import read_only

from .balls import Ball, Sweep, into_own, out_of_own, point, rational, summed
from .compiled import python_of
from .layout import Readings, readings
from .outputs import OUTPUTS, unit_scale
from .system import Segment, System, system_of
from .values import free_outputs, free_slopes
from .waves import Plane, Row, across_waves

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


Series = Any  # flint.acb_series, which comes without types

_across_waves = python_of(across_waves)

LONG_WAVE = 0.3  # |z| below which a wave is not separated from the others
TAYLOR_TERMS = 4  # of D over a piece of a contour, the last of them over the wide ball
SLOW_WAVES = 6.0  # |z1| + |z2| below which a segment is crossed by power series
WIDE_TERMS = 40  # of them: of arguments up to twice that the tail is below 1e-60


class InseparableError(Exception):
    """Two waves of a segment may be one over this ball, or a wave has no definite square root there."""


class WideSweep(Sweep):
    """The sweep at a Taylor series s; `phase` is the series of t1 + t2 of all segments that waves have crossed."""

    def __init__(self, layout: Any, s: Series, shortest: float) -> None:
        self._shortest, self.phase = shortest, 0 * s
        super().__init__(layout, s)

    def _inside(self, element: Any, p: Plane) -> Plane:
        if not isinstance(element, Segment) or self._is_slow(element):
            return super()._inside(element, p)
        units, (a, b, g) = element.units, element[:3]
        S, d = self.S, self.s * element.damping + 1
        pair = _waves(a, b, g, S, d, self._shortest)
        if pair is None:
            raise InseparableError
        one, two = pair
        gap = one[2] - two[2]
        unit = gap * gap * d * S * g
        if unit[0].contains(0):
            raise InseparableError
        inner = _across_waves(*one[:5], *two[:5], S * g, d, S * (a / d - b), into_own(p, *units))
        self.phase = self.phase + one[5] + two[5]
        return out_of_own([part / unit for part in inner], *units)

    def _is_slow(self, segment: Any) -> bool:
        z_sum, z_product = self._sums(segment)
        return bool(abs(z_sum[0]).mid() + 2 * abs(z_product[0]).mid().sqrt() < SLOW_WAVES)

    def _sums(self, segment: Any) -> tuple[Series, Series]:
        a, b, g = segment[:3]
        over_d = 1 / (self.s * segment.damping + 1)
        return self.S * (over_d * a + b), self.S * (self.S * (a * b) + g) * over_d

    def _transition(self, segment: Any) -> tuple[Row, ...]:
        if not self._is_slow(segment):
            raise InseparableError
        return super()._transition(segment)

    def _functions(self, z_sum: Series, z_product: Series) -> tuple[Series, ...]:
        """F0..F3 as truncated power series, the tail added as a ball to every coefficient.

        In the sum of the sizes of the coefficients, h_k of `waves` is at most (k + 1) q^k with q = |z1 + z2| +
        |z1 z2|^(1/2), and the terms left out below sum to less than twice the first of them.
        """
        q = _size(z_sum) + _size(z_product).sqrt()
        tail = (WIDE_TERMS + 1) * q**WIDE_TERMS * rational(Fraction(2, math.factorial(2 * WIDE_TERMS)))
        if not q < WIDE_TERMS**2:  # then each term is less than half of the one before
            raise InseparableError
        ball = flint.acb(flint.arb(0, tail.upper()), flint.arb(0, tail.upper()))
        terms_kept = z_sum.prec
        rest = flint.acb_series([ball] * terms_kept, prec=terms_kept)
        return tuple(total + rest for total in summed(z_sum, z_product, WIDE_TERMS))


def _size(series: Series) -> Ball:
    """The sum of the sizes of a series' coefficients."""
    total = flint.arb(0)
    for coefficient in series.coeffs():
        total += abs(coefficient)
    return total.upper() if hasattr(total, "upper") else total


def characteristic_ball(k: System, s: Ball, gains: Gains = NO_GAINS) -> Ball:
    """D(s) enclosed, at the working precision: for points, at any s."""
    return _fed_back(k, Sweep(_read(k, gains).layout, s), gains)


def characteristic_over(k: System, s: Ball, gains: Gains = NO_GAINS) -> Ball:
    """D enclosed over the wide ball s, but for a factor that depends on its middle alone and is positive."""
    middle, is_point = s.mid(), s.real.is_exact() and s.imag.is_exact()
    here = _by_waves(k, middle, gains, None, LONG_WAVE, 1 if is_point else TAYLOR_TERMS - 1)
    if here is not None and is_point:
        return here[0][0] * flint.acb(0, here[1].imag).exp()
    there = None if here is None else _by_waves(k, s, gains, here[1], LONG_WAVE, TAYLOR_TERMS)
    if here is None or there is None:
        return characteristic_ball(k, s, gains)
    away, value = s - middle, flint.acb(0)
    for order in range(TAYLOR_TERMS - 1, -1, -1):
        value = value * away + (there if order == TAYLOR_TERMS - 1 else here)[0][order]
    return value * flint.acb(0, here[1].imag).exp()


def tangent(k: System, m: Ball, r: Ball, gains: Gains = NO_GAINS) -> tuple[Ball, Ball, Ball] | None:
    """D(m), D'(m) and D''/2 over the disc of radius r around m, apart from one factor; None where waves may be one."""
    here = _by_waves(k, m, gains, None, 0.0, 2)
    disc = flint.acb(flint.arb(m.real.mid(), r), flint.arb(m.imag.mid(), r))
    there = None if here is None else _by_waves(k, disc, gains, here[1], 0.0, 3)
    return None if here is None or there is None else (here[0][0], here[0][1], there[0][2])


def _by_waves(
    k: System, at: Ball, gains: Gains, scale: Ball | None, shortest: float, terms: int
) -> tuple[Series, Ball] | None:
    """D e^{-scale} as a series of so many terms around `at`, and scale: t1 + t2 there if none is given.

    None where waves may be one.
    """
    try:
        sweep = WideSweep(_read(k, gains).layout, flint.acb_series([at, 1], prec=terms), shortest)
        value = _fed_back(k, sweep, gains)
    except InseparableError:
        return None
    scale = sweep.phase[0] if scale is None else scale
    return value * (sweep.phase - scale).exp(), scale


def _read(k: System, gains: Gains) -> Readings:
    """The outputs with a gain that is not 0."""
    return readings(k, tuple(each for each, gain in zip(FED, gains, strict=True) if gain), 0.0)


def _fed_back(k: System, sweep: Sweep, gains: Gains) -> Any:
    """drive + gains . numerators of a sweep, for balls and for series."""
    value, used = sweep.input, iter(_read(k, gains).each)
    for gain, unit in zip(gains, unit_gains(k), strict=True):
        if gain:
            value = value + sweep.output(next(used)) * rational(gain / unit)  # outputs are in SI
    return value


def _waves(
    a: Ball, b: Ball, g: Ball, S: Series, d: Series, shortest: float
) -> tuple[tuple[Series, ...], tuple[Series, ...]] | None:
    """Both waves of a uniform piece (see `_wave`); None where they may be one, or one is too long."""
    if S[0].contains(0) or d[0].contains(0):
        return None
    half = (S * b + S * a / d) / 2
    spread = _root(half * half - S * (S * (a * b) + g) / d)
    if spread is None:
        return None
    one, two = (_wave(half + sign * spread, S, d, a, b, g, shortest) for sign in (1, -1))
    return None if one is None or two is None else (one, two)


def _root(z: Series) -> Series | None:
    """A square root whose cut lies away from the ball (which of the two does not matter); None if it may vanish."""
    if z[0].contains(0):
        return None
    root = z.sqrt() if z[0].real.mid() >= 0 else (-z).sqrt() * point(1j)
    return root if root[0].real.mid() >= 0 else -root


def _wave(z: Series, S: Series, d: Series, a: Ball, b: Ball, g: Ball, shortest: float) -> tuple[Series, ...] | None:
    """c, s, z, v, e and t of one wave as `across_waves` wants them, scaled by e^{-t}."""
    t = _root(z) if abs(z[0]).mid() > shortest else None
    if t is None or t[0].contains(0):
        return None
    e = (-t).exp()
    v, inverse = z - S * b, d * z - S * a
    if not inverse[0].contains(0):
        other = -(S * g) / inverse  # the same by the dispersion relation; the narrower of the two
        v = other if other[0].rel_accuracy_bits() > v[0].rel_accuracy_bits() else v
    return (e * e + 1) / 2, (-(e * e) + 1) / (t * 2), z, v, e, t
