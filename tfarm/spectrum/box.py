"""Zeros of an analytic function in a box of the complex plane, complete by the argument principle.

Newton's method from many starts finds most of them, and the winding number around the box is their number.  Where the
two differ the box is cut into halves.  After Kravanja and Van Barel (2000), with the function as mantissa and exponent,
so that it may be of any size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import count, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic

LONGEST_TURN = 0.6  # rad: a longer step of the phase along the contour is halved
FORESEEN = 1.0  # so is one with a larger change of ln f at the rate of either end
NEAREST_TO_ZERO = 1e-13  # a contour cannot be resolved closer to a zero than this share of |s|
NARROW_BOX = 1e-8  # of a box: the least |s| of that resolution
MOST_CONTOUR_POINTS = 200_000  # of a contour
FIRST_POINTS = 40  # of each edge of a contour, before refinement
MOST_CALLS = 30_000  # of the function in one search; the most that 300 random loops took is 4,100
DEAD_ZONE = 1e-8  # of a box: nearer to s = 0 zeros of Newton's method are rejected, and a zero there forces cuts
SAME_BOX_ZERO = 0.1  # of its size: distance within which a zero is a known one
MOST_CUTS = 60  # cuts: then a box is 2^-30 of the first, below the resolution of float64
REAL_SHARE = 1e-11  # of its size: a smaller imaginary part is rounding
TRIED_HEIGHTS = (1.0, 1.0041, 1.0093, 1.0171, 1.0311, 1.0573, 1.113)  # of a box, where a zero lies on its edge
NEWTON_STEPS = 60  # at most, of a start that has not converged
FARTHEST_MOVE = 0.3  # of |s|: the longest step of Newton's method
SETTLED_MOVE, LAST_MOVE = 1e-11, 1e-15  # of |s|: a start with a smaller step has converged; and ends
SAME_POINT = 1e-9  # of its size: distance within which two starts have the same zero
SHRINKING = 0.9  # ratio of two successive steps at a zero of order up to ten
SPLIT = 0.4871  # of a side, where a box is cut: off the axes, on which zeros often are
UNEVEN = 8  # ratio of two edges on one side of 0, above which a box is cut near their geometric mean
OF_CORNER, OF_OPPOSITE = (0.8, 0.55), (0.2, 0.45)  # weights of each corner and of its opposite: eight starts of a box
POINT_BOX = 1e-6  # of |s|: size of a box in which one zero has the multiplicity of the count


Function = Callable[[Complex], Analytic]


class Box(NamedTuple):
    """re_min, re_max, im_min, im_max."""

    re_min: float
    re_max: float
    im_min: float
    im_max: float

    def holds(self, points: Complex) -> NDArray[np.bool_]:
        """Return which points are inside."""
        inside: NDArray[np.bool_] = (self.re_min < points.real) & (points.real < self.re_max)
        return inside & (self.im_min < points.imag) & (points.imag < self.im_max)

    @property
    def corners(self) -> Complex:
        """The four corners, counter-clockwise, and the first again."""
        left, right, low, high = self
        return np.array([left + 1j * low, right + 1j * low, right + 1j * high, left + 1j * high, left + 1j * low])

    def halves(self) -> tuple[Box, Box]:
        """Return the box cut across its longer side, geometrically where that side spans decades."""
        left, right, low, high = self
        if high - low >= right - left:
            cut = _between(low, high)
            return Box(left, right, low, cut), Box(left, right, cut, high)
        cut = _between(left, right)
        return Box(left, cut, low, high), Box(cut, right, low, high)


def _between(low: float, high: float) -> float:
    """Return the point at which a side is cut."""
    if (low > 0 and high > UNEVEN * low) or (high < 0 and low < UNEVEN * high):
        return math.copysign(abs(low) ** (1 - SPLIT) * abs(high) ** SPLIT, low)
    return low + SPLIT * (high - low)


def winding_number(function: Function, box: Box, points: int = FIRST_POINTS) -> int:
    """Return the number of zeros in the box, with multiplicity.

    Raises ConvergenceError where a zero is on the contour, within the resolution of float64.
    """
    corners = box.corners
    path = np.concatenate([np.linspace(a, b, points, endpoint=False) for a, b in pairwise(corners)])
    across = abs(corners[2] - corners[0])
    return round(turned(function, np.append(path, corners[-1]), across) / (2 * math.pi))


def turned(function: Function, path: Complex, across: float, nearest: float = NEAREST_TO_ZERO) -> float:
    """Return the change of the argument [rad] of a function along a path of points, which is refined.

    Raises ConvergenceError where a zero is nearer to the path than the share `nearest` of |s|, with |s| between
    `NARROW_BOX` and 1 times `across`.
    """
    phase, rate = _phase(function, path)
    start, end = np.array([path[:-1], phase[:-1], rate[:-1]]), np.array([path[1:], phase[1:], rate[1:]])
    angle, seen = 0.0, path.size
    while True:
        length, step = end[0] - start[0], np.angle(np.exp(1j * (end[1] - start[1]).real))
        foreseen = abs(length) * np.maximum(abs(start[2]), abs(end[2]))
        smooth = (abs(step) <= LONGEST_TURN) & (foreseen <= FORESEEN)  # nan is not smooth
        angle += float(step[smooth].sum())
        start, end, length, step = start[:, ~smooth], end[:, ~smooth], length[~smooth], step[~smooth]
        if not length.size:
            return angle
        smallest = nearest * np.clip(abs(start[0]), NARROW_BOX * across, across)
        if seen > MOST_CONTOUR_POINTS or (abs(length) < smallest).any():
            raise ConvergenceError(f"a zero lies on the contour near {start[0, 0]:.6g}", start[0, 0], step[0])
        halfway = (start[0] + end[0]) / 2
        middle = np.array([halfway, *_phase(function, halfway)])
        start, end, seen = np.hstack([start, middle]), np.hstack([middle, end]), seen + halfway.size


def _phase(function: Function, points: Complex) -> tuple[NDArray[np.float64], Complex]:
    """Return arg f and f'/f, the rate of the first between two points."""
    at = function(points)
    phase: NDArray[np.float64] = np.angle(at.value) + at.scale.imag
    with np.errstate(all="ignore"):  # a zero is a rough step
        rate = np.where(at.value == 0, 0.0, at.slope / at.value)
    return phase, rate


def newton(function: Function, starts: Complex) -> Complex:
    """Return the zeros that Newton's method finds from the starts, each once.

    A converged point continues while its steps shrink, down to rounding.
    """
    s = np.array(starts, dtype=complex)
    settled, moving, last = np.zeros(s.size, bool), np.arange(s.size), np.full(s.size, np.inf)
    for _ in range(NEWTON_STEPS):
        at = function(s[moving])
        with np.errstate(all="ignore"):  # a diverging start, or one at f' = 0, is dropped
            move = at.value / at.slope
        known = np.isfinite(move)
        settled[moving[~known]] = False
        moving, move = moving[known], move[known]
        limit = FARTHEST_MOVE * abs(s[moving])
        move = np.where(abs(move) > limit, limit * (move / np.maximum(abs(move), LEAST_SIZE)), move)
        s[moving] -= move
        away, size = abs(move), abs(s[moving])
        settled[moving] = away < SETTLED_MOVE * size
        ended = (away <= LAST_MOVE * size) | (settled[moving] & (away > SHRINKING * last[moving]))
        last[moving], moving = away, moving[~ended]
        if not moving.size:
            break
    return distinct(s[settled & np.isfinite(s)])


def distinct(points: Complex) -> Complex:
    """Return the points without those next to an earlier one."""
    kept: list[complex] = []
    for point in points:
        if all(abs(point - other) > SAME_POINT * abs(point) for other in kept):
            kept.append(complex(point))
    return np.array(kept, dtype=complex)


NOTHING_KNOWN: Complex = np.empty(0, complex)


def zeros_in_box(function: Function, box: Box, starts: Complex, known: Complex = NOTHING_KNOWN) -> Complex:
    """Return all zeros in the box with multiplicity, by their winding number.

    `known` zeros are not searched, such as those next to s = 0, where Newton's method is not reliable.
    Raises ConvergenceError, with the zeros found, where others are missing.
    """
    calls = count()

    def counted(s: Complex) -> Analytic:
        if next(calls) > MOST_CALLS:
            raise ConvergenceError(
                f"too many cuts below Im s = {box.im_max:.4g}: float64 does not separate the zeros there", s, 0
            )
        return function(s)

    return _search(counted, box, starts, known, depth=0)


def complete(
    function: Function,
    box_of: Callable[[float], Box],
    height: float,
    starts: Complex,
    known: Complex = NOTHING_KNOWN,
    factors: Sequence[float] = TRIED_HEIGHTS,
) -> tuple[Complex, Box]:
    """Return all zeros of a function, real on the real axis, in the box of a height, and that box.

    Zeros that are real to rounding are real.  Where a zero is on the edge of the box the next of the `factors` on the
    height is tried.  Raises ConvergenceError where all fail.
    """
    for factor in factors[:-1]:
        with suppress(ConvergenceError):
            return complete(function, box_of, factor * height, starts, known, (1.0,))
    box = box_of(factors[-1] * height)
    found = zeros_in_box(function, box, starts, known)
    return np.where(abs(found.imag) < REAL_SHARE * abs(found), found.real, found), box


def _search(function: Function, box: Box, starts: Complex, known: Complex, depth: int) -> Complex:
    """Return all zeros in the box, by halves where some are missing."""
    expected = winding_number(function, box)
    if not expected:
        return np.empty(0, complex)
    grid = np.outer(box.corners[:4], OF_CORNER) + np.outer(box.corners[[2, 3, 0, 1]], OF_OPPOSITE)
    found = newton(function, np.concatenate([starts[box.holds(starts)], grid.ravel()]))
    width = max(box.re_max - box.re_min, box.im_max - box.im_min)
    found = found[
        box.holds(found) & (abs(found) > DEAD_ZONE * width)
    ]  # deflation of zeros at s = 0 leaves noise around it
    again = (abs(found[:, None] - known) < SAME_BOX_ZERO * abs(known)).any(axis=1)
    found = np.concatenate([known[box.holds(known)], found[~again]])
    if found.size == expected:
        return found
    if found.size == 1 and width < POINT_BOX * abs(found[0]):
        return np.repeat(found, expected)
    if depth > MOST_CUTS:
        where = f"{box.re_min:.3g} < Re s < {box.re_max:.3g}, {box.im_min:.3g} < Im s < {box.im_max:.3g}"
        raise ConvergenceError(f"only {found.size} of {expected} zeros with {where} are separable", found, expected)
    return np.concatenate([_search(function, half, starts, known, depth + 1) for half in box.halves()])


TOWARD_SINGULAR = 0.8  # of -1/C, where real eigenvalues accumulate: the farthest left edge of a box
LEFT_EDGES = (TOWARD_SINGULAR, 0.77, 0.74, 0.7)  # likewise: tried in turn, as a zero may be on the edge
HEIGHTS_LEFT = 1.5  # width of a box left of the axis, in heights: zeros beyond are highly damped
RIGHT_OF_AXIS = 0.1  # width of a box right of the axis, in heights: its edge is clear of zeros on the axis
ABOVE_LAST = 1.05  # times the last known zero: a box may end half-way to that
SAME_ZERO = 1e-7  # of its size: distance of one zero in two searches, next to another zero
POINTS_A_ZERO = 8  # first points of a contour for each expected zero: time alone


def is_among(zeros: Complex, others: Complex) -> NDArray[np.bool_]:
    """Return which of the zeros are among the others, of another search."""
    away = abs(zeros[..., None] - others)
    return np.asarray((away < SAME_ZERO * abs(zeros)[..., None]).any(axis=-1))


def complete_box(f: Function, listed: Complex, others: Complex, C: float) -> Box | None:
    """Return the highest box in which the listed pairs are all the zeros of f, by winding number, or None.

    `others` are known zeros that are not listed.
    """
    known, heights = np.concatenate([listed, others])[:, 0], _heights(listed, others, C)
    low, high = 0, len(heights) - 1
    best: Box | None = None
    while low <= high:
        middle = high if best is None and high == len(heights) - 1 else (low + high) // 2
        box = _box(float(heights[middle]), known, C)
        inside = int(box.holds(listed.ravel()).sum())
        try:
            there = winding_number(f, box, points=FIRST_POINTS + POINTS_A_ZERO * inside)
        except ConvergenceError:
            return None
        if there < inside:
            return None
        if there == inside:
            best, low = box, middle + 1
        else:
            high = middle - 1
    return best


def filled_box(
    f: Function, listed: Complex, others: Complex, height: float, starts: Complex, C: float
) -> tuple[Box, Complex]:
    """Return a box above the listed pairs below that height, or of that height without such pairs, and its zeros.

    Raises ConvergenceError where some are missing.
    """
    starts = starts[np.isfinite(starts)]
    first = listed[:, 0]
    top = first.imag[is_right(first, C) & (first.imag < height)].max(initial=0.0)
    if top > 0:
        height = float(top + min(others[:, 0].imag[others[:, 0].imag > top], default=ABOVE_LAST * top)) / 2
    found, box = complete(f, lambda tried: _box(tried, starts, C), height, starts)
    return box, found


def is_right(zeros: Complex, C: float) -> NDArray[np.bool_]:
    """Return which zeros are right of the farthest left edge of a box, without NaN."""
    return np.asarray(zeros.real > (-TOWARD_SINGULAR / C if C else -np.inf))


def _heights(listed: Complex, others: Complex, C: float) -> Real:
    """Return heights between the zeros right of -1/C, ascending, below the first one that is not listed."""
    known, mine = np.concatenate([listed, others])[:, 0], np.arange(len(listed) + len(others)) < len(listed)
    right = is_right(known, C)
    imag, mine = known.imag[right], mine[right]
    order = np.argsort(imag)
    imag, mine = imag[order], mine[order]
    stop = int(np.argmin(mine)) if not mine.all() else mine.size
    tops = np.r_[imag, imag[-1] * ABOVE_LAST if imag.size else 1.0 / C]
    bottoms = np.r_[0.0, imag]
    heights = (0.5 * (bottoms + tops))[: stop + 1]
    return heights[heights > 0]


def _box(height: float, known: Complex, C: float) -> Box:
    """Return a box of that height, its left edge right of -1/C and far from known zeros."""
    reach = HEIGHTS_LEFT * height
    if C and reach > TOWARD_SINGULAR / C:
        edges = -np.array(LEFT_EDGES) / C
        room = [abs(known.real[abs(known.imag) < height] - edge).min(initial=np.inf) for edge in edges]
        reach = -float(edges[int(np.argmax(room))])
    return Box(-reach, RIGHT_OF_AXIS * height, -height, height)
