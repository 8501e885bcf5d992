"""The characteristic function of the arm and of its closed loop: entire at C = 0, analytic but for s = -1/C.

The free response has an input at the hub, the *drive*.  The law has another one, minus the sum of its gains times their
outputs, the *numerators*.  At an eigenvalue the two are equal:

    D(s) = drive + gains . numerators,     numerators = theta, s theta, M(0)/(1 + C s)

(the gauge at the root measures the moment without its damping part).  So feedback changes one row of the paper's
matrix, and closed-loop poles are zeros of a function as exact as that of the arm.

The characteristic function D over a piece of a contour.  On a wide ball an expression loses the dependence between its
parts.  By Taylor's theorem

    D(s) = D(m) + D'(m) (s - m) + ... + D^(n)(.) (s - m)^n / n!

with only the last term over the wide ball, so that a step may be long.

For a fast segment the two waves are separate and scaled by e^{-t}: in the form of `balls.Sweep` products of a wave with
itself would cancel over a wide s, at any precision.  For a slow one the power series of its transition functions are
used, with a bounded tail.  Where two waves may be one, the form of `balls` is used.
"""

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cached_property, reduce
from operator import mul
from typing import Any, NamedTuple

import flint
import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Law
from tfarm.arrays import Complex, Real
from tfarm.exact.balls import Ball, Sweep, across_waves, in_chain, point, rational, sum_series
from tfarm.exact.layout import Layout, lay_out, readings
from tfarm.exact.outputs import Output
from tfarm.exact.rationals import polynomials
from tfarm.exact.system import Place, Segment, System
from tfarm.exact.values import free_of, free_slopes
from tfarm.exact.waves import SolutionPlane, SolutionRow

# of |s|, or of the way to -1/C, for differences
DIFFERENCE_STEP = 1e-6


class Analytic(NamedTuple):
    """Values f e^{-scale}, their derivatives f' e^{-scale}, and scale, at given points."""

    value: Complex
    slope: Complex
    scale: Complex


class LoopParts(NamedTuple):
    """Drive (n,), numerators (signals, n), and scale (n,) of the free response times e^{-scale}, for s of any shape."""

    drive: Complex
    numerators: Complex
    scale: Complex


def characteristic(k: System, s: Complex, at_zero: int = 0) -> Analytic:
    """Return D(s)/s^at_zero of a system without a law and its derivative at s (1-D, complex), in float64."""
    if at_zero:
        s = off_rest(s)
    here, slopes = free_slopes(k, [], s, 0.0)
    return deflate(here.drive, slopes.drive, here.scale, s, at_zero)


def off_rest(s: Complex) -> Complex:
    """Return s with 0 replaced by a tiny number, for a division by a power of s."""
    # 1/s, for s = 0: there D over a power of s is at its limit, and no power is 0
    next_to_rest = 1e-60
    return np.where(s == 0, next_to_rest, s)


def deflate(value: Complex, slope: Complex, scale: Complex, s: Complex, at_zero: int) -> Analytic:
    """Return D/s^at_zero from D and its slope at s, which is not 0."""
    if at_zero:
        value = value / s**at_zero
        slope = slope / s**at_zero - at_zero * value / s
    return Analytic(value, slope, scale)


def quick_characteristics(k: System, s: Complex, at_zero: int = 0) -> Analytic:
    """Return `characteristic` with slopes from differences, to about 1e-8: thirty times faster for a hundred points."""
    s = off_rest(np.asarray(s, dtype=complex))
    h = difference_steps(k, s)
    at = np.array([s, s + h, s - h])
    D, scale = drive_of(k, at)
    # divided first: next to rest the slope of D is lost in that of its zero there
    here, up, down = D / at**at_zero * np.exp(scale - scale[0])
    return Analytic(here, (up - down) / (2.0 * h), scale[0])


def drive_of(k: System, s: Complex) -> tuple[Complex, Complex]:
    """Return D e^{-scale} of a system without a law, and scale, at s of any shape."""
    free = free_of(readings(k), s.ravel())
    return free.drive.reshape(s.shape), free.scale.reshape(s.shape)


def has_slope(k: System, s: Complex) -> NDArray[np.bool_]:
    """Return where D grows by less than a factor of e over the difference of a slope."""
    growth = drive_of(k, np.array([s, s + difference_steps(k, s)]))[1].real
    # where ln abs(D) changes by more than 1 between two of these points a difference is no slope
    return np.asarray(abs(growth[1] - growth[0]) < 1.0)


def difference_steps(k: System, s: Complex) -> Real:
    """Return h [1/s] for a slope at s from values at s +- h: a share of |s|, or of the way to a -1/C."""
    near = np.min([np.ones(s.shape), *(abs(1.0 - s / each) for each in k.singular)], axis=0)
    return np.asarray(DIFFERENCE_STEP * np.maximum(abs(s) * near, 1e-300))


# flint.fmpq_poly, which comes without types
Polynomial = Any
# flint.acb_series, which comes without types
Series = Any


class InseparableError(Exception):
    """Two waves of a segment may be one over this ball, or a square root is not definite."""


class WideSweep(Sweep):
    """The sweep at a Taylor series s; `phase` is the series of t1 + t2 of all fast segments."""

    def __init__(self, layout: Any, s: Series, shortest: float) -> None:
        self._shortest = shortest
        self.phase = 0 * s
        super().__init__(layout, s)

    def _plane_inside(self, element: Any, p: SolutionPlane) -> SolutionPlane:
        if not isinstance(element, Segment):
            return super()._plane_inside(element, p)
        _, z_sum, z_product = self._sums(element)
        # 6.0: |z1| + |z2| below which power series are used
        if abs(z_sum[0]).mid() + 2 * abs(z_product[0]).mid().sqrt() < 6.0:
            return super()._plane_inside(element, p)
        S = self.S
        d = self.s * element.damping + 1
        pair = _waves(*element[:3], S, d, self._shortest)
        one, two = (in_chain(wave[:5], element.length) for wave in pair)
        d = d * element.stiffness
        gS = S * element.of_chain[2]
        gap = one[2] - two[2]
        unit = _nonzero(gap * gap * d * gS)
        self.phase = self.phase + pair[0][5] + pair[1][5]
        return tuple(part / unit for part in across_waves(one, two, gS, d, p))

    def _plane_at_mark(self, p: SolutionPlane) -> SolutionPlane:
        grown = self.phase.exp()
        return tuple(each * grown for each in p)

    @cached_property
    def states(self) -> dict[Place, SolutionRow]:
        """W, Psi, M and Q at each mark, in the scale of the plane at the axis."""
        shrunk = (-self.phase).exp()
        found: dict[Place, SolutionRow] = {}
        for place, state in super().states.items():
            found[place] = tuple(each * shrunk for each in state)
        return found

    def _functions(self, z_sum: Series, z_product: Series) -> tuple[Series, ...]:
        """Return F0..F3 as truncated power series, with the tail as a ball in every coefficient.

        The sum of the coefficients' magnitudes of h_k in `waves` is at most (k + 1) q^k with q = |z1 + z2| +
        |z1 z2|^(1/2).  The omitted terms below sum to less than twice the first of them.
        """
        q = _size(z_sum) + _size(z_product).sqrt()
        # 40 of them at least: up to twice that argument the tail is below 1e-60; two more for each wave
        count = 40 + 2 * math.isqrt(int(float(q)))
        tail = (count + 1) * q**count * rational(Fraction(2, math.factorial(2 * count)))
        # each term is less than half of the one before
        if not q < count**2:
            raise InseparableError
        part = flint.arb(0, tail.upper())
        ball = flint.acb(part, part)
        terms_kept = z_sum.prec
        rest = flint.acb_series([ball] * terms_kept, prec=terms_kept)
        return tuple(total + rest for total in sum_series(z_sum, z_product, count))


def _size(series: Series) -> Ball:
    """Return the sum of the magnitudes of a series' coefficients."""
    return sum((abs(each) for each in series.coeffs()), flint.arb(0)).upper()


class Feedback(NamedTuple):
    """A law in s, exactly: e^{-s tau} p_i/q times each output `read`; `whole` is q, `entries` p_i, `delay` tau [s]."""

    read: Layout
    whole: Polynomial
    entries: tuple[Polynomial, ...]
    delay: float


def characteristic_ball(k: System, s: Ball, law: Feedback | None = None) -> Ball:
    """Return D(s) enclosed, at the working precision: for points, at any s."""
    return _feed_back(Sweep(_layout(k, law), s), law)


def characteristic_over(k: System, s: Ball, law: Feedback | None = None) -> Ball:
    """Return D enclosed over the wide ball s, up to a positive factor that depends on its middle alone."""
    # |z| below which a wave is not separated from the others
    long_wave = 0.3
    # the power of the last Taylor term, the one over the wide ball
    middle = s.mid()
    last = 3
    if s.real.is_exact() and s.imag.is_exact():
        last = 0
    try:
        here, scale = _by_waves(k, middle, law, None, long_wave, max(last, 1))
        value = here[0]
        if last:
            over, _ = _by_waves(k, s, law, scale, long_wave, last + 1)
            value = over[last]
    except InseparableError:
        return characteristic_ball(k, s, law)
    for order in reversed(range(last)):
        value = value * (s - middle) + here[order]
    return value * flint.acb(0, scale.imag).exp()


def tangent(k: System, m: Ball, r: Ball, law: Feedback | None = None) -> tuple[Ball, Ball, Ball] | None:
    """Return D(m), D'(m) and D''/2 over the disc of radius r around m, up to a factor; None where waves may be one."""
    disc = flint.acb(flint.arb(m.real.mid(), r), flint.arb(m.imag.mid(), r))
    try:
        here, scale = _by_waves(k, m, law, None, 0.0, 2)
        there, _ = _by_waves(k, disc, law, scale, 0.0, 3)
    except InseparableError:
        return None
    return here[0], here[1], there[2]


def _by_waves(
    k: System, at: Ball, law: Feedback | None, scale: Ball | None, shortest: float, terms: int
) -> tuple[Series, Ball]:
    """Return D e^{-scale} as a series of `terms` terms around `at`, and scale, by default t1 + t2 there.

    Raises InseparableError where waves may be one.
    """
    sweep = WideSweep(_layout(k, law), flint.acb_series([at, 1], prec=terms), shortest)
    if scale is None:
        scale = sweep.phase[0]
    return _feed_back(sweep, law) * (sweep.phase - scale).exp(), scale


def _layout(k: System, law: Feedback | None) -> Layout:
    """Return the layout of a system with the signals of a law."""
    if law is None:
        return readings(k)
    return law.read


def _feed_back(sweep: Sweep, law: Feedback | None) -> Any:
    """Return drive q + e^{-s tau} sum of p_i numerator_i of a sweep, for balls and for series."""
    if law is None:
        return sweep.input
    s = sweep.s
    fed = 0 * s
    for p, one in zip(law.entries, law.read.each, strict=True):
        fed = fed + _polynomial_at(p, s) * sweep.output(one)
    delay = (s * rational(-law.delay)).exp()
    return sweep.input * _polynomial_at(law.whole, s) + delay * fed


def _polynomial_at(polynomial: Polynomial, s: Any) -> Any:
    """Return the value of a polynomial at s, by Horner's rule."""
    value = 0 * s
    for each in reversed(polynomial.coeffs()):
        value = value * s + flint.arb(each)
    return value


def feedback(k: System, law: Law, outputs: Sequence[Output], shares: Sequence[float]) -> Feedback:
    """Return a law in s of these outputs, those of its signals, each at a share of the length."""
    blocks = [polynomials(part.block) for part in law.parts]
    entries = dict.fromkeys(law.signals, flint.fmpq_poly([0]))
    for n, (part, (nums, _)) in enumerate(zip(law.parts, blocks, strict=True)):
        others = _product(den for m, (_, den) in enumerate(blocks) if m != n) * -law.sign
        for name, num in zip(part.signals, nums, strict=True):
            if name in entries:
                entries[name] += num * others
    used = [n for n, each in enumerate(entries.values()) if each]
    read = lay_out(k, [outputs[n] for n in used], [shares[n] for n in used])
    whole = _product(den for _, den in blocks)
    return Feedback(read, whole, tuple(filter(None, entries.values())), law.delay)


def _product(factors: Iterable[Polynomial]) -> Polynomial:
    """Return the product of polynomials."""
    return reduce(mul, factors, flint.fmpq_poly([1]))


def _waves(
    a: Ball, b: Ball, g: Ball, S: Series, d: Series, shortest: float
) -> tuple[tuple[Series, ...], tuple[Series, ...]]:
    """Return both waves of a uniform piece (see `_wave`).  Raises InseparableError where they may be one."""
    half = (S * b + S * a / _nonzero(d)) / 2
    spread = _root(half * half - _nonzero(S) * (S * (a * b) + g) / d)
    return _wave(half + spread, S, d, a, b, g, shortest), _wave(half - spread, S, d, a, b, g, shortest)


def _nonzero(series: Series) -> Series:
    """Return the series.  Raises InseparableError where its first term may vanish."""
    if series[0].contains(0):
        raise InseparableError
    return series


def _root(z: Series) -> Series:
    """Return a square root with its cut away from the ball, of either sign.  Raises InseparableError."""
    z = _nonzero(z)
    if z[0].real.mid() >= 0:
        root = z.sqrt()
    else:
        root = (-z).sqrt() * point(1j)
    if root[0].real.mid() >= 0:
        return root
    return -root


def _wave(z: Series, S: Series, d: Series, a: Ball, b: Ball, g: Ball, shortest: float) -> tuple[Series, ...]:
    """Return c, s, z, v, e and t of one wave for `across_waves`, scaled by e^{-t}.  Raises InseparableError."""
    # too long
    if not abs(z[0]).mid() > shortest:
        raise InseparableError
    t = _nonzero(_root(z))
    e = (-t).exp()
    v = z - S * b
    inverse = d * z - S * a
    if not inverse[0].contains(0):
        # the same by the dispersion relation; the narrower of the two
        other = -(S * g) / inverse
        if other[0].rel_accuracy_bits() > v[0].rel_accuracy_bits():
            v = other
    return (e * e + 1) / 2, (-(e * e) + 1) / (t * 2), z, v, e, t
