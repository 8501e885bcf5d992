"""Natural frequencies from the count alone: bisection that cannot miss, whatever the spectrum looks like."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tfarm.errors import ConvergenceError
from tfarm.exact.coefficients import Coefficients

from .counting import Counter


def natural_frequencies(k: Coefficients, first: int, last: int) -> NDArray[np.float64]:
    """The natural frequencies [rad/s] number first..last of the undamped arm, counted from 1, double ones twice.

    Each is the point where the count steps from below its number to it, bisected to neighbouring floats: no
    start value, no sign change needed, so close and double roots are like any other.
    Raises ConvergenceError if the count does not reach `last` (beyond 1e9 rad/s times the arm's own unit).
    """
    count = Counter(k)
    number = np.arange(first, last + 1)
    low, high = np.zeros(number.size), np.full(number.size, _upper_bound(count, k, last))
    while True:
        middle = 0.5 * (low + high)
        open_ = (low < middle) & (middle < high)
        if not open_.any():
            return high
        above = count(middle) >= number
        high, low = np.where(open_ & above, middle, high), np.where(open_ & ~above, middle, low)


def count_below(k: Coefficients, omega: float) -> int:
    """How many natural frequencies lie below omega [rad/s]."""
    return int(Counter(k)(np.array([omega]))[0])


def _upper_bound(count: Counter, k: Coefficients, last: int) -> float:
    """A frequency above the last one wanted: the Euler-Bernoulli estimate, doubled until the count says so."""
    omega = unit = ((last + 1) * math.pi) ** 2 / math.sqrt(k.g)
    while omega < 1e12 * unit:
        if count(np.array([omega]))[0] >= last:
            return omega
        omega *= 2.0
    raise ConvergenceError(f"the count does not reach {last} below {omega:.3g} rad/s", omega, last)
