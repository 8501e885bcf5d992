"""Natural frequencies from a count, complete, to the last float64 digit or to any number of digits.

Wittrick and Williams (1971) count through the pivots of a dynamic stiffness.  Howson and Williams (1973) start from the
pinned beam, whose frequencies are known in closed form.  For a chain of segments the count proceeds from the payload to
the hub, each step by a sign (`tfarm.exact.count`):

* with both ends of a segment pinned, it is the number of n with n pi < k, and one for W = 0, Psi = const above the
  cut-off;
* a released motion, or more inertia of it, raises the count by 0 or 1, a constraint lowers it by 0 or 1 (Rayleigh);
* the parity of each count is the sign of that system's characteristic function D(i w).

A double root changes no sign but raises the count by two.  Between two close frequencies the sign of D(i w) is lost in
rounding: in float64 a pair with a relative gap of 1e-9 has errors of 1e-11.  Such pairs are bisected with the count in
real balls, in which each sign is either certain or not determined.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import flint
import numpy as np

from tfarm.arrays import Real, Whole
from tfarm.errors import ConvergenceError
from tfarm.exact.balls import Ball, Sweep, across_waves, first_success, in_chain, precision, rational
from tfarm.exact.count import DOUBLINGS, chain_counts, list_steps, rows_to_count
from tfarm.exact.layout import Layout, readings
from tfarm.exact.system import Segment, Spring, System
from tfarm.exact.waves import SolutionPlane
from tfarm.records import read_only


def counts_below(k: System, omega: Real) -> Whole:
    """Return the number of natural frequencies below each omega (1-D, positive) [rad/s], with the rigid-body mode."""
    return np.asarray(
        chain_counts(np.ascontiguousarray(omega, dtype=float), *rows_to_count(Layout(k.undamped)))
    )


def real_waves(a: Ball, b: Ball, g: Ball, S: Ball) -> tuple[tuple[Ball, ...], tuple[Ball, ...]]:
    """Return c, sinh t / t, z, v and the scale of both waves at S = -omega^2, which are real."""
    half = S * (a + b) / 2
    product = S * (a * b * S + g)
    spread = (half * half - product).sqrt()
    return _wave(half + spread, b * S), _wave(half - spread, b * S)


def _wave(z: Ball, bS: Ball) -> tuple[Ball, ...]:
    """Return those of one wave, which travels for z < 0 and decays for z > 0."""
    if z < 0:
        k = (-z).sqrt()
        sine, cosine = k.sin_cos()
        return cosine, sine / k, z, z - bS, flint.arb(1)
    t = z.sqrt()
    e = (-t).exp()
    square = e * e
    return (1 + square) / 2, (1 - square) / (2 * t), z, z - bS, e


def pinned_count(squares: Iterable[Ball]) -> int | None:
    """Return the count for both ends pinned: half waves inside the length, one above the cut-off; None if uncertain."""
    number = 0
    travelling = 0
    for z in squares:
        if z < 0:
            whole = ((-z).sqrt() / flint.arb.pi()).floor().unique_fmpz()
            if whole is None:
                return None
            number += int(whole)
            travelling += 1
        elif not z > 0:
            return None
    return number + (travelling == 2)


class UncertainError(Exception):
    """A sign, or a number of half waves, not determined by these balls."""


class AxisSweep(Sweep):
    """The sweep at s = i omega in real balls, with the count: its s is 0, its S is -omega^2."""

    def __init__(self, system: System, omega: Ball, counting: bool) -> None:
        self._counting = counting
        self.number = 0
        self._free = system.free_motions_of_tip
        super().__init__(readings(system), flint.arb(0), -omega * omega)

    @property
    def drive(self) -> Ball:
        """D(i omega)."""
        return self.input + self.S * self.A[2] * self.theta

    def _plane_inside(self, element: Any, p: SolutionPlane) -> SolutionPlane:
        if isinstance(element, Segment):
            return self._across_segment(element, p)
        p = super()._plane_inside(element, p)
        if isinstance(element, Spring):
            self._step(p[0], 1)
        return p

    def _across_segment(self, element: Any, p: SolutionPlane) -> SolutionPlane:
        a, b, g, *_ = element
        own = real_waves(a, b, g, self.S)
        l = element.length
        EI = element.stiffness
        one, two = (in_chain(wave, l) for wave in own)
        gS = self.S * g * EI / l**4
        gap = one[2] - two[2]
        unit = 1 / (gS * EI * gap * gap)
        inside = tuple(part * unit for part in across_waves(one, two, gS, EI, p))
        if self._counting:
            zero = flint.arb(0)
            clamped = (zero, zero, zero, zero, flint.arb(1))
            r = [part * unit for part in across_waves(one, two, gS, EI, clamped)]
            self._count_segment([wave[2] for wave in own], p, inside, r)
        self._free = 2
        return inside

    def _count_segment(
        self, z: Sequence[Ball], p: SolutionPlane, q: SolutionPlane, r: Sequence[Ball]
    ) -> None:
        outside = self.number
        pinned = pinned_count(z)
        if pinned is None:
            raise UncertainError
        self.number = pinned
        self._step(r[1], -1)
        self._step(-r[0], -1)
        self.number += outside
        if self._free == 2:
            self._step(-r[0] * p[3] - r[3] * p[0], 1)
        if self._free:
            self._step(q[0], 1)

    def _step(self, value: Ball, step: int) -> None:
        """Change the count by `step` where its parity differs from the sign of the determinant."""
        if not self._counting:
            return
        if not (value > 0 or value < 0):
            raise UncertainError
        self.number += step * ((self.number % 2 == 1) != bool(value < 0))

    def count_released(self) -> int:
        """Return the count with the hub released, where it is not locked."""
        if self.layout.chain.drive.turns:
            self._step(self.drive, 1)
        return self.number


class RealAxis:
    """A system without its damping on the imaginary axis, in real balls at the working precision."""

    def __init__(self, system: System) -> None:
        self._system = system.undamped

    def drive(self, omega: Ball) -> Ball:
        """Return D(i omega) times a positive factor."""
        return AxisSweep(self._system, omega, counting=False).drive

    def count(self, omega: Ball) -> int | None:
        """Return N(omega), with the rigid-body mode; None if a sign or a half wave is uncertain."""
        try:
            return AxisSweep(self._system, omega, counting=True).count_released()
        except UncertainError:
            return None


def secant(axis: RealAxis, omega: float, digits: int) -> Ball | None:
    """Return the root next to omega by the secant method on midpoints; None if it does not converge there."""
    # 50: equal bits of the two first points of a secant
    before = flint.arb(omega)
    now = flint.arb(omega) * (1 + flint.arb(2) ** -50)
    value_before = axis.drive(before).mid()
    # 36: equal bits of a root and its start: a simple root in float64 has more
    small = now * flint.arb(10) ** -(digits + 2)
    near = now * flint.arb(2) ** -36
    # 40 of the secant, at most: each has 1.6 times the digits
    for _ in range(40):
        value = axis.drive(now).mid()
        if value == value_before:
            return now
        step = (value * (now - before) / (value - value_before)).mid()
        before = now
        value_before = value
        now = (now - step).mid()
        if not abs(now - omega) < near:
            return None
        if abs(step) < small:
            return now
    return None


def axis_precisions(digits: int) -> Iterator[int]:
    """Yield working precisions [bits] for a number of digits, each twice the one before."""
    # a root that needs more is double
    most_bits = 40_000
    # 3.33 and 80: log2 10, rounded up; and beyond the digits, for cancellation
    bits = int(3.33 * digits) + 80
    while bits < most_bits:
        yield bits
        bits *= 2


# lists of modes in a cache
LISTS_KEPT = 32
# arms whose single numbers are in the cache
ARMS_KEPT = 64


def natural_frequencies(k: System, first: int, last: int) -> Real:
    """Return the natural frequencies [rad/s] number first..last of the undamped arm, from 1, double ones twice.

    Raises ConvergenceError if the count does not reach `last` (see `list_frequencies`).
    """
    if (first, last) not in k.kept:
        list_frequencies([k], first, last)
    if (first, last) not in k.kept:
        end = _estimate(k, last + 1) * 2.0**DOUBLINGS
        raise ConvergenceError(f"the count does not reach {last + 1} below {end:.3g} rad/s", end, last + 1)
    return np.asarray(k.kept[first, last])


def list_frequencies(systems: Sequence[System], first: int, last: int) -> None:
    """Keep with each system its natural frequencies number first..last, by one compiled loop over all of them.

    Each is the step of the count to its number, bisected to neighbouring floats, without a start value or a change of
    sign.  Those close to a neighbour are bisected by the count in balls, or in float64 where that is uncertain.
    A system whose count does not reach `last` is left out.
    """
    rows, ends = zip(*(rows_to_count(Layout(k.undamped)) for k in systems), strict=True)
    starts = np.cumsum([0, *map(len, rows)])
    # with both neighbours: one of them may be close.  The rigid body at zero is left out: bisection would go through
    # all exponents
    lowest = np.array([max(first - 1, min(first, 1 + k.has_rigid_mode)) for k in systems])
    number = np.arange(lowest.min(), last + 2)
    estimate = np.array([_estimate(k, last + 1) for k in systems])
    found = np.full((len(systems), number.size), np.nan)
    stacked = read_only(np.concatenate(rows)), starts, read_only(np.array(ends))
    list_steps(lowest, last + 1, *stacked, estimate, found)
    # 1e-3 of the mean spacing: above it rounding moves neither root by more than a few last units
    close = np.diff(found) * number[1:] < 1e-3 * found[:, 1:]
    near = np.zeros(found.shape, bool)
    near[:, 1:] = close
    near[:, :-1] |= close
    for j, i in np.argwhere(near):
        found[j, i] = _bisect_in_balls(systems[j], float(found[j, i]), int(number[i]))
    for k, own in zip(systems, read_only(found[:, number.size - 2 - last + first : -1]), strict=True):
        if not np.isnan(own).any():
            k.keep((first, last), own.view)


def _bisect_in_balls(k: System, omega: float, number: int) -> float:
    """Return the frequency of that number next to omega, close to another, by the count in balls."""
    # relative width around each of a close pair in float64
    pair_reach = 4e-6
    low = omega * (1 - pair_reach)
    high = omega * (1 + pair_reach)
    # 256 of working precision, for a double frequency to its last float64 digit
    with precision(256):
        axis = RealAxis(k)
        while low < (middle := 0.5 * (low + high)) < high:
            below = axis.count(rational(middle))
            if below is None:
                below = count_below(k, middle)
            if below >= number:
                high = middle
            else:
                low = middle
    return high


def count_below(k: System, omega: float) -> int:
    """Return the number of natural frequencies below omega [rad/s]."""
    return int(counts_below(k, np.array([omega]))[0])


def _estimate(k: System, last: int) -> float:
    """Return the Euler-Bernoulli estimate [rad/s] of a frequency above number `last`."""
    # [s^(1/2)]
    transit = math.fsum(float(each.g) ** 0.25 for each in k.segments)
    return float(((last + 1) * math.pi) ** 2 / transit**2)


def refine(k: System, omega: float, digits: int) -> str:
    """Return the natural frequency next to omega [rad/s] as a decimal string with that many right digits.

    The sign of D(i w) changes within a tenth of the last digit, certified.
    Raises ConvergenceError where it does not: at a double frequency, or a pair that float64 does not separate.
    """
    axis = RealAxis(k)
    text = f"no {digits} digits of the frequency near {omega:.10g} rad/s: no sign change"

    def attempt() -> str | None:
        root = secant(axis, omega, digits)
        if root is None:
            return None
        tenth = root * flint.arb(10) ** -(digits + 1)
        is_bracket = axis.drive(root - tenth) * axis.drive(root + tenth) < 0
        return str(root.str(digits, radius=False)) if is_bracket else None

    return first_success(axis_precisions(digits), attempt, ConvergenceError(text, omega, digits))
