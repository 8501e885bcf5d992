"""The undamped arm on the imaginary axis in real ball arithmetic: D(i w), the count, and a root finder."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import flint

from tfarm.exact.balls import rational
from tfarm.exact.chain import ElementChain
from tfarm.exact.closed_form import from_waves
from tfarm.exact.coefficients import Coefficients
from tfarm.exact.compiled import python_of
from tfarm.exact.system import System

from .chain_axis import ChainAxis
from .counting import end_row, steps_of
from .half_waves import pinned_count, real_waves

Ball = Any
_minors = python_of(from_waves)

MOST_AXIS_BITS = 40_000  # of working precision: a root that needs more is double


class ArmAxis:
    """The arm on the imaginary axis in real balls, at the working precision at which it is made."""

    def __init__(self, k: Coefficients) -> None:
        self._a, self._b, self._g = rational(k.a), rational(k.b), rational(k.g)
        rows, self._steps = steps_of(k)
        self._rows = [[rational(number) for number in row] for row in rows]
        self._own = [rational(number) for number in end_row(k)]

    def drive(self, omega: Ball) -> Ball:
        """D(i omega) times a positive factor."""
        return self._drive(self._waves(omega), self._own)

    def count(self, omega: Ball) -> int | None:
        """N(omega), the rigid-body mode included; None if a sign or a half wave is not certain."""
        waves = self._waves(omega)
        number = pinned_count(wave[2] for wave in waves[1])
        for row, step in zip(self._rows, self._steps, strict=True):
            value = self._drive(waves, row)
            if number is None or not (value > 0 or value < 0):
                return None
            number += step * ((number % 2 == 1) != bool(value < 0))
        return number

    def _waves(self, omega: Ball) -> tuple[Ball, tuple[tuple[Ball, ...], ...]]:
        S = -omega * omega
        return S, real_waves(self._a, self._b, self._g, S)

    def _drive(self, waves: tuple[Ball, tuple[tuple[Ball, ...], ...]], row: list[Ball]) -> Ball:
        S, (one, two) = waves
        tip = row[0] + row[1] * S, row[2], row[3] + row[4] * S, row[5]
        theta, M0, _, _ = _minors(*one, *two, self._g * S, flint.arb(1), *tip)
        return row[8] * M0 - (row[6] + row[7] * S) * theta  # the sign of g S is minus


def axis_of(k: System) -> ArmAxis | ChainAxis:
    """The system on the imaginary axis, at the working precision."""
    return ChainAxis(k) if isinstance(k, ElementChain) else ArmAxis(k)


def secant(axis: ArmAxis | ChainAxis, omega: float, digits: int) -> Ball | None:
    """The root next to omega by the secant method on midpoints; None if it does not settle close by."""
    before, now = flint.arb(omega), flint.arb(omega) * (1 + flint.arb(2) ** -50)
    value_before = axis.drive(before).mid()
    small, near = now * flint.arb(10) ** -(digits + 2), now * flint.arb(2) ** -36
    for _ in range(40):
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
    bits = int(3.33 * digits) + 80
    while bits < MOST_AXIS_BITS:
        yield bits
        bits *= 2
