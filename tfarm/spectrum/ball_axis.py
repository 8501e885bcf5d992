"""A system without damping on the imaginary axis in real ball arithmetic: D(i w), the count, and a root finder.

The steps of the count are those of `tfarm.exact.count`, each sign certain or not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import flint

from tfarm.exact.balls import Ball, Sweep, into_own, out_of_own
from tfarm.exact.compiled import python_of
from tfarm.exact.compound import Plane, across_waves
from tfarm.exact.elements import Segment, Spring
from tfarm.exact.layout import Layout
from tfarm.exact.system import System

_across_waves = python_of(across_waves)

MOST_AXIS_BITS = 40_000  # of working precision: a root that needs more is double
BITS_A_DIGIT, SPARE_BITS = 3.33, 80  # log2 10, rounded up; and beyond the digits asked for, for what cancels
SECOND_START = 50  # bits to which the two first points of a secant are one: a few last units of a float64 apart
CLOSE_BY = 36  # bits that a root must share with its start: of a simple root float64 has more
AXIS_STEPS = 40  # of the secant, at most: each has 1.6 times the digits, so that a single root has thousands in twenty


def real_waves(a: Ball, b: Ball, g: Ball, S: Ball) -> tuple[tuple[Ball, ...], tuple[Ball, ...]]:
    """c, sinh t / t, z, v and the scale of both waves at S = -omega^2; real, whether they decay or travel."""
    half, product = S * (a + b) / 2, S * (a * b * S + g)
    spread = (half * half - product).sqrt()
    return _wave(half + spread, b * S), _wave(half - spread, b * S)


def _wave(z: Ball, bS: Ball) -> tuple[Ball, ...]:
    if z < 0:
        k = (-z).sqrt()
        sine, cosine = k.sin_cos()
        return cosine, sine / k, z, z - bS, flint.arb(1)
    t = z.sqrt()
    e = (-t).exp()
    square = e * e
    return (1 + square) / 2, (1 - square) / (2 * t), z, z - bS, e


def pinned_count(squares: Iterable[Ball]) -> int | None:
    """The count for both ends pinned: half waves inside the length, and one above the cut-off; None if not certain."""
    number, travelling = 0, 0
    for z in squares:
        if z < 0:
            whole = ((-z).sqrt() / flint.arb.pi()).floor().unique_fmpz()
            if whole is None:
                return None
            number, travelling = number + int(whole), travelling + 1
        elif not z > 0:
            return None
    return number + (travelling == 2)


class UncertainError(Exception):
    """A sign, or a number of half waves, that these balls do not determine."""


class AxisSweep(Sweep):
    """The sweep at s = i omega, in real balls: its s is 0, its S is -omega^2.  It counts on its way."""

    def __init__(self, system: System, omega: Ball, counting: bool) -> None:
        self._counting, self.number = counting, 0
        self._free = sum(not isinstance(end, float) for end in (system.tip_mass, system.tip_inertia))
        layout = system.kept.setdefault("layout", Layout(system))
        super().__init__(layout, flint.arb(0), -omega * omega)

    @property
    def drive(self) -> Ball:
        """D(i omega)."""
        return self.input + self.S * self.numbers.of_angle[2] * self.theta

    def _inside(self, element: Any, p: Plane) -> Plane:
        if isinstance(element, Segment):
            return self._joined(element, p)
        p = super()._inside(element, p)
        if isinstance(element, Spring):
            self._step(p[0], 1)
        return p

    def _joined(self, element: Any, p: Plane) -> Plane:
        units, (a, b, g), S = element.units, element[:3], self.S
        own, gS, (one, two) = into_own(p, *units), S * g, real_waves(a, b, g, S)
        gap = one[2] - two[2]
        unit = 1 / (gS * gap * gap)
        inside = tuple(part * unit for part in _across_waves(*one, *two, gS, flint.arb(1), S * (a - b), own))
        if self._counting:
            zero = flint.arb(0)
            held = (zero, zero, zero, zero, flint.arb(1))
            r = [part * unit for part in _across_waves(*one, *two, gS, flint.arb(1), S * (a - b), held)]
            self._count_segment([one[2], two[2]], own, inside, r)
        self._free = 2
        return out_of_own(inside, *units)

    def _count_segment(self, z: Sequence[Ball], p: Plane, q: Plane, r: Sequence[Ball]) -> None:
        outside, pinned = self.number, pinned_count(z)
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
        """The count one step on, where the sign of the determinant asks for it."""
        if not self._counting:
            return
        if not (value > 0 or value < 0):
            raise UncertainError
        self.number += step * ((self.number % 2 == 1) != bool(value < 0))

    def released(self) -> int:
        """The count with the hub let go, where it is not held."""
        if self.layout.chain.drive.turns:
            self._step(self.drive, 1)
        return self.number


class RealAxis:
    """A system without its damping on the imaginary axis in real balls, at the working precision."""

    def __init__(self, system: System) -> None:
        self._system = system if system.is_undamped else system.with_damping(0.0)

    def drive(self, omega: Ball) -> Ball:
        """D(i omega) times a positive factor."""
        return AxisSweep(self._system, omega, counting=False).drive

    def count(self, omega: Ball) -> int | None:
        """N(omega), the rigid-body mode included; None if a sign or a half wave is not certain."""
        try:
            return AxisSweep(self._system, omega, counting=True).released()
        except UncertainError:
            return None


def secant(axis: RealAxis, omega: float, digits: int) -> Ball | None:
    """The root next to omega by the secant method on midpoints; None if it does not settle close by."""
    before, now = flint.arb(omega), flint.arb(omega) * (1 + flint.arb(2) ** -SECOND_START)
    value_before = axis.drive(before).mid()
    small, near = now * flint.arb(10) ** -(digits + 2), now * flint.arb(2) ** -CLOSE_BY
    for _ in range(AXIS_STEPS):
        value = axis.drive(now).mid()
        if value == value_before:
            return now
        step = (value * (now - before) / (value - value_before)).mid()
        before, value_before, now = now, value, (now - step).mid()
        if not abs(now - omega) < near:
            return None
        if abs(step) < small:
            return now
    return None


def axis_precisions(digits: int) -> Iterator[int]:
    """Working precisions [bits] worth trying for so many digits, each twice the one before."""
    bits = int(BITS_A_DIGIT * digits) + SPARE_BITS
    while bits < MOST_AXIS_BITS:
        yield bits
        bits *= 2
