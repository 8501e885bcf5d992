"""Curves of zeros as a gain runs: between which of its values they must be known more closely to be drawn round.

A curve through few points has corners where the zeros have none.  Where two of them meet on the real axis and part
there, at a right angle, the corner is true: it is approached until nobody sees what is cut off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real

from .pieces import RegionPiece

STRETCH = 2.0  # how much wider than high, or higher than wide, a picture is at most: so much more a curve turns in it
MOST_TURN = math.radians(5.0) / STRETCH  # from one piece of a curve to the next, where the picture is as high as wide
PIXEL = 2e-3  # of the picture, a pixel: the corners of what is no longer nobody sees
ASIDE = 0.45  # of the way from one column to the next: half way may be the very edge that both were laid around
TOLD_APART = 1e-11  # of a gain: columns nearer to each other are in the rounding of where a region ends


def loose(curves: Complex, width: Real | float, height: Real | float) -> NDArray[np.bool_]:
    """Whether a value is needed between each and the next (n - 1,), for curves (b, n) in pictures of that size.

    `width` and `height` are numbers, or columns (b, 1).  Where a curve is NaN, or stays on the real axis, it is not.
    """
    piece = np.diff(curves.real / width + 1j * (curves.imag / height), axis=1)
    size, is_real = abs(piece), curves.imag == 0
    with np.errstate(all="ignore"):
        turn = abs(np.angle(piece[:, 1:] / piece[:, :-1]))
    parts = is_real[:, 1:] != is_real[:, :-1]
    stays = is_real[:, 2:] & is_real[:, 1:-1] & is_real[:, :-2]
    bent = np.isfinite(turn) & (turn > MOST_TURN) & ~(stays | parts[:, 1:] | parts[:, :-1])
    wanted = parts.copy()
    wanted[:, :-1] |= bent
    wanted[:, 1:] |= bent
    return np.asarray((wanted & (size > PIXEL)).any(axis=0))


def loose_columns(across: Real, parts: Sequence[RegionPiece], drawn: Callable[[Real, Real], Complex]) -> Real:
    """Values of a gain between columns (n,) of a region, next to corners of the outlines of its parts.

    `drawn` says where a point of the plane is in the picture, 1 high and about as wide; corners outside are not seen.
    """
    wanted: set[float] = set()
    for part in parts:
        gain, low, high = np.array(part.points).T
        gain, outline = np.r_[gain, gain[::-1]], drawn(np.r_[gain, gain[::-1]], np.r_[low, high[::-1]])
        for before, here, after in _corners(outline):
            for other in (before, after):
                if abs(outline[other] - outline[here]) > PIXEL:
                    wanted.update(_halves(across, float(gain[here]), float(gain[other])))
    return np.array(sorted(wanted))


def _corners(outline: Complex) -> list[tuple[int, int, int]]:
    """The numbers of points of a closed line at which it turns by more than 5 degrees, with their neighbours."""
    kept = np.flatnonzero(abs(outline - np.roll(outline, 1)) > 0)
    before, after = np.roll(kept, 1), np.roll(kept, -1)
    with np.errstate(all="ignore"):
        turn = abs(np.angle((outline[after] - outline[kept]) / (outline[kept] - outline[before])))
    seen = (outline[kept].real > 0) & (outline[kept].imag > 0) & (outline[kept].imag < 1)
    found = np.flatnonzero(seen & (turn > STRETCH * MOST_TURN))
    return [(int(before[n]), int(kept[n]), int(after[n])) for n in found]


def _halves(across: Real, here: float, other: float) -> list[float]:
    """Nearly half way between two columns; of a side that is upright, to the columns beside it."""
    n = int(np.searchsorted(across, here))
    beside = [float(across[k]) for k in (n - 1, n + 1) if 0 <= k < across.size]
    ends = [each for each in beside if abs(each - here) > TOLD_APART * abs(here)] if here == other else [other]
    return [min(here, each) + ASIDE * abs(each - here) for each in ends]
