"""Poles at s = 0 where a law takes off exactly what holds a rig at rest: L(0) = -1, as of Kp = -k on a spring k.

Which terms of D vanish at s = 0 is known from their orders; that they cancel there is seen in their values alone.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tfarm.arrays import Complex

NEAREST_TO_ORIGIN = 1e-12  # of w1: where a function, its zeros at 0 divided out, is taken for its value at 0
CANCELLED = 1e-13  # of the terms of D: less is left by their rounding
READ_AT = (2e-5, 1e-5)  # of w1: where the order of a zero at s = 0 is read off


def resting_zeros(loop_function: Callable[[Complex], Complex], w1: float) -> int:
    """How many zeros 1 + L has at s = 0, L without a pole there; w1 [rad/s] is the rig's first frequency.

    What is odd in s next to 0 is taken off by its mean on both sides.
    """
    s = w1 * np.array([NEAREST_TO_ORIGIN, -NEAREST_TO_ORIGIN, *READ_AT]) + 0j
    with np.errstate(all="ignore"):  # L is infinite at a pole of the rig or of the law: then nothing cancels
        right, left, farther, nearer = 1 + loop_function(s)
        cancels = abs(right + left) <= 2 * CANCELLED
    return round(float(np.log2(abs(farther / nearer)))) if cancels else 0
