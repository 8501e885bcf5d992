"""Curves of zeros as a gain runs: between which of its values they must be known more closely to be drawn round.

A curve through few points has corners where the zeros have none.  Where two of them meet on the real axis and part
there, at a right angle, the corner is true: it is approached until nobody sees what is cut off.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

STRETCH = 2.0  # how much wider than high, or higher than wide, a picture is at most: so much more a curve turns in it
TURN = math.radians(5.0) / STRETCH  # from one piece of a curve to the next, where the picture is as high as wide
SHORT = 2e-3  # of the picture, a pixel: the corners of what is no longer nobody sees


def loose(curves: Complex, width: Real | float, height: Real | float) -> NDArray[np.bool_]:
    """Whether a value is needed between each and the next (n - 1,), for curves (b, n) in pictures of that size.

    `width` and `height` are numbers, or columns (b, 1).  Where a curve is NaN, or stays on the real axis, it is not.
    """
    drawn = curves.real / width + 1j * (curves.imag / height)
    piece = np.diff(drawn, axis=1)
    size, is_real = abs(piece), curves.imag == 0
    with np.errstate(all="ignore"):
        turn = abs(np.angle(piece[:, 1:] / piece[:, :-1]))
    parts = is_real[:, 1:] != is_real[:, :-1]
    stays = is_real[:, 2:] & is_real[:, 1:-1] & is_real[:, :-2]
    bent = np.isfinite(turn) & (turn > TURN) & ~(stays | parts[:, 1:] | parts[:, :-1])
    wanted = parts.copy()
    wanted[:, :-1] |= bent
    wanted[:, 1:] |= bent
    return np.asarray((wanted & (size > SHORT)).any(axis=0))
