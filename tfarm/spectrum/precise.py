"""Natural frequencies to any number of digits: ball arithmetic from a float64 start."""

from __future__ import annotations

import flint

from tfarm.errors import ConvergenceError
from tfarm.exact.balls import precision
from tfarm.exact.system import System

from .ball_axis import RealAxis, axis_precisions, secant


def refine(k: System, omega: float, digits: int) -> str:
    """The natural frequency next to omega [rad/s], with that many right digits, as a decimal string.

    The sign of D(i w) is proven to change within a tenth of the last digit of the root that is printed.
    Raises ConvergenceError where it does not: for a double frequency, or a pair closer than float64 can tell.
    """
    for bits in axis_precisions(digits):
        with precision(bits):
            axis = RealAxis(k)
            root = secant(axis, omega, digits)
            if root is None:
                continue
            tenth = root * flint.arb(10) ** -(digits + 1)
            if axis.drive(root - tenth) * axis.drive(root + tenth) < 0:
                return str(root.str(digits, radius=False))
    raise ConvergenceError(
        f"no {digits} digits of the frequency near {omega:.10g} rad/s: no sign change", omega, digits
    )
