"""Natural frequencies from the count alone: bisection that cannot miss, whatever the spectrum looks like.

Between two close frequencies D(i w) is a small product, whose sign drowns in rounding: float64 alone would leave a pair
with a relative gap of 1e-9 right to 1e-11 only.  Such pairs are bisected again with the count in balls.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tfarm.errors import ConvergenceError
from tfarm.exact.balls import precision, rational
from tfarm.exact.system import System

from .ball_axis import RealAxis
from .counting import Counter

CLOSE_SHARE = 1e-3  # share of the mean spacing; further apart, rounding moves neither by more than a few last units
PAIR_REACH = 4e-6  # relative width in which float64 surely has each of a close pair
PAIR_BITS = 256  # of working precision, for a double frequency to its last float64 digit
HIGHEST_BOUND = 1e12  # times what a slender beam has: a count that has not got there by then never will
LISTS_KEPT = 32  # lists of modes, of arms asked for again and again: memory against time, of no effect on an answer
ARMS_KEPT = 64  # arms whose single numbers are kept, likewise


@lru_cache(maxsize=LISTS_KEPT)  # a table of sampled verdicts asks for the same undamped arm some twenty times
def natural_frequencies(k: System, first: int, last: int) -> NDArray[np.float64]:
    """The natural frequencies [rad/s] number first..last of the undamped arm, counted from 1, double ones twice.

    Each is the point where the count steps from below its number to it, bisected to neighbouring floats: no
    start value, no sign change needed, so close and double roots are like any other.  Those close to a neighbour are
    bisected by the count in balls, or in float64 where a ball cannot tell.
    Raises ConvergenceError if the count does not reach `last` (up to `HIGHEST_BOUND`).
    """
    lowest = min(first, 1 + k.has_rigid_mode)  # not the rigid body at zero: bisection would run down all exponents
    number = np.arange(max(first - 1, lowest), last + 2)  # with both neighbours: one of them may be close
    count = Counter(k)
    omega = count.first_reaching(number, _upper_bound(count, k, int(number[-1])))
    close = np.diff(omega) * number[1:] < CLOSE_SHARE * omega[1:]
    for i in np.nonzero(np.r_[close, False] | np.r_[False, close])[0]:
        low, high = float(omega[i] * (1 - PAIR_REACH)), float(omega[i] * (1 + PAIR_REACH))
        with precision(PAIR_BITS):
            axis = RealAxis(k)
            while low < (middle := 0.5 * (low + high)) < high:
                below = axis.count(rational(middle))
                below = int(count(np.array([middle]))[0]) if below is None else below
                low, high = (low, middle) if below >= number[i] else (middle, high)
        omega[i] = high
    found = omega[(first <= number) & (number <= last)]
    found.flags.writeable = False
    return found


def count_below(k: System, omega: float) -> int:
    """How many natural frequencies lie below omega [rad/s]."""
    return int(Counter(k)(np.array([omega]))[0])


def _upper_bound(count: Counter, k: System, last: int) -> float:
    """A frequency above the last one wanted: the Euler-Bernoulli estimate, doubled until the count says so."""
    omega = unit = ((last + 1) * math.pi) ** 2 / k.transit**2
    while omega < HIGHEST_BOUND * unit:
        if count(np.array([omega]))[0] >= last:
            return omega
        omega *= 2.0
    raise ConvergenceError(f"the count does not reach {last} below {omega:.3g} rad/s", omega, last)
