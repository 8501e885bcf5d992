"""Zeros of an analytic function in a box of the complex plane, complete by the argument principle.

Newton's method from many starts finds most of them, and the winding number around the box is their number.  Where the
two differ the others are found with the known ones divided out, or the box is cut into halves.  After Kravanja and Van
Barel (2000), with the function as mantissa and exponent, so that it may be of any size.

Where the real axis halves a box the function is real on it: zeros come in conjugate pairs, and the upper half is
searched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import count, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic

# a contour cannot be resolved closer to a zero than this share of |s|
NEAREST_TO_ZERO = 1e-13
# of each edge of a contour, before refinement
FIRST_POINTS = 40
# of its size: a smaller imaginary part is rounding
REAL_SHARE = 1e-11
# of a box, where a zero lies on its edge
TRIED_HEIGHTS = (1.0, 1.0041, 1.0093, 1.0171, 1.0311, 1.0573, 1.113)

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
    def is_symmetric(self) -> bool:
        """Whether the real axis halves it."""
        return self.im_min == -self.im_max

    @property
    def corners(self) -> Complex:
        """The four corners, counter-clockwise."""
        left, right, low, high = self
        return np.array([left + 1j * low, right + 1j * low, right + 1j * high, left + 1j * high])

    @property
    def across(self) -> float:
        """The length of its diagonal."""
        return math.hypot(self.re_max - self.re_min, self.im_max - self.im_min)

    def halves(self) -> tuple[Box, Box]:
        """Return the box cut across its longer side, geometrically where that side spans decades."""
        left, right, low, high = self
        if high - low >= right - left:
            if self.is_symmetric:
                cut = _cut(0.0, high)
                return self._replace(im_min=-cut, im_max=cut), self._replace(im_min=cut)
            cut = _cut(low, high)
            return self._replace(im_max=cut), self._replace(im_min=cut)
        cut = _cut(left, right)
        return self._replace(re_max=cut), self._replace(re_min=cut)


def _cut(low: float, high: float) -> float:
    """Return the point at which a side is cut, near the geometric mean of two uneven edges on one side of 0."""
    # of the side: off the axes, on which zeros often are
    split = 0.4871
    if high > 8 * low > 0 or low < 8 * high < 0:
        return math.copysign(abs(low) ** (1 - split) * abs(high) ** split, low)
    return low + split * (high - low)


def winding_number(function: Function, box: Box, points: int = FIRST_POINTS) -> int:
    """Return the number of zeros in the box, with multiplicity, along its upper half where it is symmetric.

    Raises ConvergenceError where a zero is on the contour, within the resolution of float64.
    """
    corners = np.append(box.corners, box.corners[0])
    turn = 2 * math.pi
    if box.is_symmetric:
        corners = np.array([box.re_max, *box.corners[2:], box.re_min])
        turn = math.pi
    path = [np.linspace(a, b, points, endpoint=False) for a, b in pairwise(corners)]
    return round(argument_change(function, np.append(path, corners[-1]), box.across) / turn)


def argument_change(
    function: Function, path: Complex, across: float, nearest: float = NEAREST_TO_ZERO
) -> float:
    """Return the change of the argument [rad] of a function along a path of points, which is refined.

    A step is halved above 0.6 rad, and where the rate of ln f at either end foresees a change above 1.
    Raises ConvergenceError where a zero is nearer to the path than the share `nearest` of |s|, with |s| between 1e-8
    and 1 times `across`, and for more than 200,000 points.
    """
    phase, rate = _phase(function, path)
    start = np.array([path[:-1], phase[:-1], rate[:-1]])
    end = np.array([path[1:], phase[1:], rate[1:]])
    angle = 0.0
    seen = path.size
    while True:
        length = end[0] - start[0]
        step = np.angle(np.exp(1j * (end[1] - start[1]).real))
        foreseen = abs(length) * np.maximum(abs(start[2]), abs(end[2]))
        # nan is not smooth
        smooth = (abs(step) <= 0.6) & (foreseen <= 1.0)
        angle += float(step[smooth].sum())
        rough = ~smooth
        start = start[:, rough]
        end = end[:, rough]
        length = length[rough]
        step = step[rough]
        if not length.size:
            return angle
        smallest = nearest * np.clip(abs(start[0]), 1e-8 * across, across)
        if seen > 200_000 or (abs(length) < smallest).any():
            raise ConvergenceError(f"a zero lies on the contour near {start[0, 0]:.6g}", start[0, 0], step[0])
        halfway = (start[0] + end[0]) / 2
        middle = np.array([halfway, *_phase(function, halfway)])
        start = np.hstack([start, middle])
        end = np.hstack([middle, end])
        seen += halfway.size


def _phase(function: Function, points: Complex) -> tuple[NDArray[np.float64], Complex]:
    """Return arg f and f'/f, the rate of the first between two points."""
    at = function(points)
    phase: NDArray[np.float64] = np.angle(at.value) + at.scale.imag
    # a zero is a rough step
    with np.errstate(all="ignore"):
        rate = np.where(at.value == 0, 0.0, at.slope / at.value)
    return phase, rate


def newton(
    function: Function, starts: Complex, listed: Callable[[Complex], Complex] | None = None, expected: int = 0
) -> Complex:
    """Return the zeros that Newton's method finds from the starts, each once.

    A converged point continues while its steps shrink, down to rounding; at a zero of order up to ten by 0.9.  Where
    they are `listed` the others are left out as soon as the list has the `expected` number, or has not grown for 6
    steps.
    """
    s = np.array(starts, dtype=complex)
    settled = np.zeros(s.size, bool)
    moving = np.arange(s.size)
    last = np.full(s.size, np.inf)
    many = 0
    longest = 0
    since = 0
    for step in range(60):
        at = function(s[moving])
        # a diverging start, or one at f' = 0, is dropped
        with np.errstate(all="ignore"):
            move: Complex = at.value / at.slope
        known = np.isfinite(move)
        settled[moving[~known]] = False
        moving = moving[known]
        move = _at_most(0.3 * abs(s[moving]), move[known])
        s[moving] -= move
        away = abs(move)
        size = abs(s[moving])
        settled[moving] = away < 1e-11 * size
        ended = (away <= 1e-15 * size) | (settled[moving] & (away > 0.9 * last[moving]))
        last[moving] = away
        moving = moving[~ended]
        if listed is not None:
            if settled.sum() > many:
                many = settled.sum()
                length = listed(s[settled]).size
                if length > longest:
                    longest = length
                    since = step
            if longest >= expected or step - since > 6:
                moving = moving[settled[moving]]
        if not moving.size:
            break
    return distinct(s[settled & np.isfinite(s)])


def _at_most(length: Any, move: Complex) -> Any:
    """Return the steps (n,), each shortened to a length."""
    return move * np.minimum(1.0, length / np.maximum(abs(move), LEAST_SIZE))


def find_other_zeros(function: Function, starts: Complex, zeros: Complex, box: Box, missing: int) -> Complex:
    """Return points next to zeros in a box that are not known, by Newton's method with the known ones divided out.

    After Ehrlich (1967) and Aberth (1973):  1/step = f'/f - sum of 1/(s - z),  z being the known zeros and the other
    points.  So no two points go to one zero, and those far away do not draw them off: of a characteristic function f'/f
    is large everywhere, as it grows.  Of the starts those with the shortest first step are used, each beyond the steps
    of the others.
    """
    # as points near 0 may have to go far
    farthest = 0.1 * box.across
    points, step, away = _apart(function, starts, zeros, starts[:0], farthest)
    chosen: list[complex] = []
    while points.size and len(chosen) < 2 * missing + 6:
        n = np.argmin(away)
        chosen.append(complex(points[n] - step[n]))
        is_far = abs(points - points[n]) > away[n]
        points = points[is_far]
        step = step[is_far]
        away = away[is_far]
    points = np.array(chosen, complex)
    is_next = np.zeros(len(chosen), bool)
    for _ in range(15):
        points, step, away = _apart(function, points, zeros, points, farthest)
        points = points - step
        is_next = box.holds(points) & (away < 1e-6 * abs(points))
        if is_next.sum() >= missing:
            break
    return points[is_next]


def _apart(
    function: Function, s: Complex, zeros: Complex, others: Complex, farthest: float
) -> tuple[Complex, Complex, Real]:
    """Return the points s without those whose step is infinite, their steps, and their distance from an unknown zero.

    See `find_other_zeros`; that distance is the step without the other points.
    """
    at = function(s)
    with np.errstate(all="ignore"):
        alone = at.slope / at.value - (1 / (s[:, None] - zeros)).sum(axis=1)
        between = s[:, None] - others
        repelled = np.where(between == 0, 0, 1 / between).sum(axis=1)
        step = 1 / (alone - repelled)
        away = abs(1 / alone)
    known = np.isfinite(step)
    s = s[known]
    step = step[known]
    away = away[known]
    return s, _at_most(farthest, step), away


def distinct(points: Complex) -> Complex:
    """Return the points without those within 1e-9 of an earlier one; each is compared with those of nearly its size."""
    order = np.argsort(abs(points))
    ranked = points[order]
    again = np.zeros(points.size, bool)
    for n in range(1, points.size):
        larger = ranked[n:]
        smaller = ranked[:-n]
        near = 1e-9 * abs(larger)
        if not (abs(larger) - abs(smaller) <= near).any():
            break
        again[np.maximum(order[n:], order[:-n])[abs(larger - smaller) <= near]] = True
    return points[~again]


NOTHING_KNOWN: Complex = np.empty(0, complex)


def zeros_in_box(
    function: Function,
    box: Box,
    starts: Complex,
    known: Complex = NOTHING_KNOWN,
    *,
    most_calls: int = 30_000,
) -> Complex:
    """Return all zeros in the box with multiplicity, by their winding number.

    `known` zeros are not searched, such as those next to s = 0, where Newton's method is not reliable.  The function is
    called at most `most_calls` times; the most that 300 random loops took is 4,100.
    Raises ConvergenceError, with the zeros found, where others are missing.
    """
    calls = count()

    def counted(s: Complex) -> Analytic:
        if next(calls) > most_calls:
            raise ConvergenceError(
                f"too many cuts below Im s = {box.im_max:.4g}: float64 does not separate the zeros there",
                s,
                0,
            )
        return function(s)

    return _search(counted, box, starts, known, NOTHING_KNOWN, depth=0)


def complete_zeros(
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
            return complete_zeros(function, box_of, factor * height, starts, known, (1.0,))
    box = box_of(factors[-1] * height)
    found = zeros_in_box(function, box, starts, known)
    is_real = abs(found.imag) < REAL_SHARE * abs(found)
    return np.where(is_real, found.real, found), box


def _search(
    function: Function, box: Box, starts: Complex, known: Complex, found: Complex, depth: int
) -> Complex:
    """Return all zeros in the box, by halves where some are missing; `found` are zeros of a larger box."""
    # of a box: nearer to s = 0 zeros of Newton's method are rejected, and a zero there forces cuts
    dead_zone = 1e-8
    expected = winding_number(function, box)
    mirrored = box.is_symmetric
    if not expected:
        return NOTHING_KNOWN
    width = max(box.re_max - box.re_min, box.im_max - box.im_min)

    def listed(points: Complex) -> Complex:
        if mirrored:
            points = np.r_[points, points.conj()]
        points = distinct(points)
        # deflation at s = 0 leaves noise there
        points = points[box.holds(points) & (abs(points) > dead_zone * width)]
        again = (abs(points[:, None] - known) < 0.1 * abs(known)).any(axis=1)
        return np.concatenate([known[box.holds(known)], points[~again]])

    inside = listed(found)
    if inside.size != expected:
        # between each corner and its opposite
        grid = np.outer(box.corners, (0.8, 0.55)) + np.outer(np.roll(box.corners, 2), (0.2, 0.45))
        starts_here = np.concatenate([starts[box.holds(starts)], grid.ravel()])
        if mirrored:
            starts_here = starts_here[starts_here.imag >= 0]
        # at first, and where rounding makes several points of one zero
        if not depth or inside.size > expected:
            found = newton(function, starts_here, listed, expected)
            inside = listed(found)
    missing = expected - inside.size - (abs(found) <= dead_zone * width).sum()
    if missing > 0:
        missing = math.ceil(missing / (1 + mirrored))
        mirrors = found.conj() if mirrored else found[:0]
        zeros = distinct(np.r_[known, found, mirrors])
        near = find_other_zeros(function, starts_here, zeros, box, missing)
        if near.size:
            found = np.r_[found, newton(function, near)]
            inside = listed(found)
    if inside.size == expected:
        return inside
    # one zero with the multiplicity of the count
    if inside.size == 1 and width < 1e-6 * abs(inside[0]):
        return np.repeat(inside, expected)
    # a box of 2^-30 of the first is below the resolution of float64
    if depth > 60:
        where = f"{box.re_min:.3g} < Re s < {box.re_max:.3g}, {box.im_min:.3g} < Im s < {box.im_max:.3g}"
        raise ConvergenceError(
            f"only {inside.size} of {expected} zeros with {where} are separable", inside, expected
        )
    first, second = box.halves()
    parts = [_search(function, half, starts, known, found, depth + 1) for half in (first, second)]
    if mirrored and not second.is_symmetric:
        parts.append(parts[1].conj())
    return np.concatenate(parts)


# of -1/C, where real eigenvalues accumulate: the farthest left edge of a box
TOWARD_SINGULAR = 0.8
# width of a box left of the axis, in heights: zeros beyond are highly damped
HEIGHTS_LEFT = 1.5
# width of a box right of the axis, in heights: its edge is clear of zeros on the axis
RIGHT_OF_AXIS = 0.1
# times the last known zero: a box may end half-way to that
ABOVE_LAST = 1.05


def is_among(zeros: Complex, others: Complex) -> NDArray[np.bool_]:
    """Return which of the zeros are among the others, of another search, to 1e-7 of their size."""
    return np.asarray((abs(zeros[..., None] - others) < 1e-7 * abs(zeros)[..., None]).any(axis=-1))


def complete_box(f: Function, listed: Complex, others: Complex, C: float) -> Box | None:
    """Return the highest box in which the listed pairs are all the zeros of f, by winding number, or None.

    `others` are known zeros that are not listed.
    """
    known = np.concatenate([listed, others])[:, 0]
    for height in reversed(_heights(listed, others, C).tolist()):
        box = _box(height, known, C)
        inside = int(box.holds(listed).sum())
        try:
            # time alone
            there = winding_number(f, box, points=FIRST_POINTS + 8 * inside)
        except ConvergenceError:
            return None
        if there <= inside:
            return box if there == inside else None
    return None


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
        beyond = others[:, 0].imag
        height = float(top + min(beyond[beyond > top], default=ABOVE_LAST * top)) / 2
    found, box = complete_zeros(f, lambda tried: _box(tried, starts, C), height, starts)
    return box, found


def is_right(zeros: Complex, C: float) -> NDArray[np.bool_]:
    """Return which zeros are right of the farthest left edge of a box, without NaN."""
    left = -TOWARD_SINGULAR / C if C else -np.inf
    return np.asarray(zeros.real > left)


def _heights(listed: Complex, others: Complex, C: float) -> Real:
    """Return heights between the zeros right of -1/C, ascending, below the first one that is not listed."""
    mine, theirs = (each.imag[is_right(each, C)] for each in (listed[:, 0], others[:, 0]))
    imag = np.sort(np.r_[mine, theirs])
    last = imag[-1] * ABOVE_LAST if imag.size else 1.0 / C
    heights = 0.5 * (np.r_[0.0, imag] + np.r_[imag, last])
    return heights[(heights > 0) & (heights < theirs.min(initial=np.inf))]


def _box(height: float, known: Complex, C: float) -> Box:
    """Return a box of that height, its left edge right of -1/C and far from known zeros."""
    reach = HEIGHTS_LEFT * height
    if C and reach > TOWARD_SINGULAR / C:
        reaches = np.array([TOWARD_SINGULAR, 0.77, 0.74, 0.7]) / C
        room = abs(known.real[abs(known.imag) < height] + reaches[:, None]).min(axis=1, initial=np.inf)
        reach = float(reaches[np.argmax(room)])
    return Box(-reach, RIGHT_OF_AXIS * height, -height, height)
