"""The highest box in which listed eigenvalues are all there are, by winding number; no box can hold -1/C."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError

from .box import FIRST_POINTS, Box, Function, winding_number

TOWARD_SINGULAR = 0.8  # how far towards -1/C, where real eigenvalues accumulate, a box may reach
LEFT_EDGES = (TOWARD_SINGULAR, 0.77, 0.74, 0.7)  # likewise: those that are tried, lest a zero lie on the edge
HEIGHTS_LEFT = 1.5  # heights that a box reaches left: zeros further left die out faster than any in it swings
RIGHT_OF_AXIS = 0.1  # heights that a box reaches right at least: its edge is clear of zeros on the axis
ABOVE_LAST = 1.05  # times the last zero known: up to there a box may reach half-way
POINTS_A_ZERO = 8  # of a contour, to begin with, for each zero that it should hold: time alone


def complete_box(f: Function, listed: Complex, others: Complex, C: float) -> tuple[Box, int]:
    """The highest box in which the listed pairs are all the zeros of f, by winding number, and how many they are.

    `others` are zeros known but not listed.  Raises ConvergenceError if a box holds fewer zeros than are listed.
    """
    known = np.concatenate([listed, others])[:, 0]
    heights = _heights(known, np.r_[np.ones(len(listed), bool), np.zeros(len(others), bool)], C)
    low, high = 0, len(heights) - 1
    best: tuple[Box, int] | None = None
    while low <= high:
        middle = high if best is None and high == len(heights) - 1 else (low + high) // 2
        box = _box(float(heights[middle]), known, C)
        inside = int(box.holds(listed.ravel()).sum())
        there = winding_number(f, box, points=FIRST_POINTS + POINTS_A_ZERO * inside)
        if there < inside:
            raise ConvergenceError(
                f"{inside} eigenvalues listed in {tuple(box)}, but only {there} there", listed, there
            )
        if there == inside:
            best, low = (box, inside), middle + 1
        else:
            high = middle - 1
    if best is None:
        raise ConvergenceError("eigenvalues that continue from no listed mode lie below all of them", listed, heights)
    return best


def _heights(known: Complex, is_listed: NDArray[np.bool_], C: float) -> Real:
    """Heights between the zeros to the right of -1/C, ascending, below the first one that is not listed."""
    right = known.real > -TOWARD_SINGULAR / C if C else np.ones(known.size, bool)
    imag, mine = known.imag[right], is_listed[right]
    order = np.argsort(imag)
    imag, mine = imag[order], mine[order]
    stop = int(np.argmin(mine)) if not mine.all() else mine.size
    tops = np.r_[imag, imag[-1] * ABOVE_LAST if imag.size else 1.0 / C]
    bottoms = np.r_[0.0, imag]
    return (0.5 * (bottoms + tops))[: stop + 1]


def _box(height: float, known: Complex, C: float) -> Box:
    """A box of that height, its left edge clear of -1/C and, of a few, the furthest from any known zero."""
    reach = HEIGHTS_LEFT * height
    if C and reach > TOWARD_SINGULAR / C:
        edges = -np.array(LEFT_EDGES) / C
        room = [abs(known.real[abs(known.imag) < height] - edge).min(initial=np.inf) for edge in edges]
        reach = -float(edges[int(np.argmax(room))])
    return Box(-reach, RIGHT_OF_AXIS * height, -height, height)
