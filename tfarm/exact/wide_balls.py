"""The characteristic function D over a whole piece of a contour: balls as wide as a step, and still narrow values.

Evaluated on a wide ball an expression forgets that its parts move together.  By Taylor's theorem

    D(s) = D(m) + D'(m) (s - m) + ... + D^(n)(.) (s - m)^n / n!

where only the last term is taken over the wide ball, so that a step may be long.

A fast segment is crossed by its two waves, kept apart and scaled by e^{-t}: in the form of `balls.Sweep` a wide s would
lose what products of a wave with itself lose by cancelling, at any precision.  A slow one is crossed by the power
series of its transition functions, whose tail is bounded.  Where two waves may be one, the form of `balls` is taken.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import flint

from .balls import Ball, Sweep, into_own, out_of_own, point, rational, summed
from .characteristic import FED, NO_GAINS, Gains, unit_gains
from .compiled import python_of
from .compound import Plane, Row, across_waves
from .elements import Segment
from .layout import Readings, readings
from .system import System

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
