"""Natural frequencies to any number of digits: ball arithmetic from a float64 start."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import flint

from tfarm.errors import ConvergenceError
from tfarm.exact.balls import State, precision
from tfarm.exact.coefficients import Coefficients

Ball = Any
GUARD_BITS = 24


def refine(k: Coefficients, omega: float, digits: int) -> str:
    """The natural frequency next to omega [rad/s], with that many right digits, as a decimal string.

    The secant method on the real drive D(i omega), at the full precision, from the float64 root; the sign of D is then
    proven to change between the neighbours one unit of the last digit away.
    Raises ConvergenceError where it does not: for a double frequency, or a pair closer than float64 can tell.
    """
    k = replace(k, damping=0.0)
    for bits in (int(3.33 * digits) + 96, int(6.66 * digits) + 256, int(13.3 * digits) + 1024):
        with precision(bits):
            root = _secant(k, flint.arb(omega), flint.arb(2) ** -(int(3.33 * digits) + GUARD_BITS))
            if root is None:
                continue
            unit = root * flint.arb(10) ** -(digits + 1)
            if _drive(k, root - unit) * _drive(k, root + unit) < 0:
                return str(root.str(digits, radius=False))
    raise ConvergenceError(
        f"no {digits} digits of the frequency near {omega:.10g} rad/s: no sign change", omega, digits
    )


def _drive(k: Coefficients, omega: Ball) -> Ball:
    return State(k, flint.acb(0, omega)).input.real


def _secant(k: Coefficients, omega: Ball, tolerance: Ball) -> Ball | None:
    """Midpoints of the secant method until they agree to the tolerance; None if they do not."""
    before, now = omega, omega * (1 + flint.arb(2) ** -48)
    value_before, value = (_drive(k, point).mid() for point in (before, now))
    for _ in range(60):
        if value == 0:
            return now
        step = (value * (now - before) / (value - value_before)).mid()
        if not step.is_finite():
            return None
        before, value_before = now, value
        now = (now - step).mid()
        if abs(step) < tolerance * omega:
            return now if abs(now - omega) < omega * flint.arb(2) ** -36 else None
        value = _drive(k, now).mid()
    return None
