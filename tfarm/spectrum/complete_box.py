"""The highest box in which listed eigenvalues are all there are, by winding number; no box can hold -1/C."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError

from .box import FIRST_POINTS, Box, Function, complete, winding_number

TOWARD_SINGULAR = 0.8  # how far towards -1/C, where real eigenvalues accumulate, a box may reach
LEFT_EDGES = (TOWARD_SINGULAR, 0.77, 0.74, 0.7)  # likewise: those that are tried, lest a zero lie on the edge
HEIGHTS_LEFT = 1.5  # heights that a box reaches left: zeros further left die out faster than any in it swings
RIGHT_OF_AXIS = 0.1  # heights that a box reaches right at least: its edge is clear of zeros on the axis
ABOVE_LAST = 1.05  # times the last zero known: up to there a box may reach half-way
SAME_ZERO = 1e-7  # of its size: a zero that two searches found, one of them next to another zero
NONE_LEFT: Complex = np.empty(0, complex)
POINTS_A_ZERO = 8  # of a contour, to begin with, for each zero that it should hold: time alone


def complete_box(f: Function, listed: Complex, others: Complex, C: float) -> tuple[Box, int, Complex]:
    """The highest box in which the listed pairs are all the zeros of f, how many there are, and no more zeros.

    By winding number.  `others` are zeros known but not listed.  Where every box has zeros that are not listed it is
    the highest, and those with Im s >= 0 are found in it.  Raises ConvergenceError if a box holds fewer zeros than are
    listed.
    """
    known, mine = np.concatenate([listed, others])[:, 0], np.arange(len(listed) + len(others)) < len(listed)
    known, mine = known[np.isfinite(known)], mine[np.isfinite(known)]
    heights = _heights(known, mine, C)
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
        all_listed = listed[np.isfinite(listed)]
        box, found, more = filled_box(f, float(heights[-1]), all_listed, np.r_[all_listed, others.ravel()], C)
        return box, found.size, more
    return *best, NONE_LEFT


def filled_box(f: Function, height: float, listed: Complex, starts: Complex, C: float) -> tuple[Box, Complex, Complex]:
    """A box of about that height, all zeros of f in it, and those of them with Im s >= 0 that are not `listed`.

    Raises ConvergenceError if they cannot all be found.
    """
    starts = starts[np.isfinite(starts)]
    found, box = complete(f, lambda tried: _box(tried, starts, C), height, starts)
    inside = listed[box.holds(listed)]
    is_listed = (abs(found[:, None] - inside) < SAME_ZERO * abs(found)[:, None]).any(axis=1)
    if is_listed.sum() != inside.size:
        raise ConvergenceError(f"{inside.size} eigenvalues listed in {tuple(box)}, {is_listed.sum()} found", found, 0)
    return box, found, found[~is_listed & (found.imag >= 0)]


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
