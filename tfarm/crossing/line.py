"""Crossings of a curve by zeros of A + g B along one real gain g: place, gain and direction.

At a point of the curve the zero is there for g = -A/B, which is a gain where it is real: where

    h = Im(A conj B)

vanishes.  As g grows the pair of zeros goes to the left of the curve where h rises along it and to the right where h
falls (differentiate A + g B = 0).  Up the imaginary axis right is unstable; around the unit circle, counter-clockwise,
right is outside, unstable too.  (Neimark 1948; Gryazina, Polyak and Tremba 2008.)

Over a plane of two gains the counts beyond the curve follow column by column, from crossings and one count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize.elementwise import find_minimum, find_root

from tfarm.arrays import LEAST_SIZE, Complex, Real, Whole
from tfarm.errors import require
from tfarm.records import frozen

# A and B at places of a curve
Parts = Callable[[Real], tuple[Complex, Complex]]

# two values of a gain, the lower first
Window = tuple[float, float]


class Crossing(NamedTuple):
    """Zeros on the curve at the gain `t`, at the place `at` and its mirror image; `change` more are beyond it after."""

    t: float
    at: float
    change: int


@frozen
class Crossings:
    """Every `Crossing` along one gain: `gain` (n,), ascending, the place `at` (n,) and the `change` (n,) of each."""

    gain: Real
    at: Real
    change: Whole

    @classmethod
    def of(cls, found: Iterable[tuple[float, float, int]]) -> Crossings:
        """Collect crossings, without those at no finite gain."""
        rows = sorted((float(t), float(at), int(change)) for t, at, change in found if np.isfinite(t))
        gain, at, change = np.reshape(rows, (-1, 3)).T.copy()
        return cls(gain, at, change.astype(np.int64))

    def __iter__(self) -> Iterator[Crossing]:
        rows = zip(self.gain.tolist(), self.at.tolist(), self.change.tolist(), strict=True)
        return (Crossing(*row) for row in rows)

    def __len__(self) -> int:
        return self.gain.size

    def within(self, low: float, high: float) -> Crossings:
        """Return the crossings at gains between two."""
        inside = (low < self.gain) & (self.gain < high)
        return Crossings(self.gain[inside], self.at[inside], self.change[inside])

    def spans(self, low: float, high: float) -> list[Window]:
        """Return the intervals between two gains from each crossing to the next."""
        return list(pairwise(np.unique(np.r_[low, self.within(low, high).gain, high]).tolist()))

    def passed(self, gains: Real | float) -> Whole:
        """Return the number of zeros that pass beyond the curve between -infinity and each of the gains, inclusive."""
        return np.r_[0, np.cumsum(self.change)][np.searchsorted(self.gain, gains, side="right")]


def brackets(h: Real) -> tuple[tuple[Whole, ...], Whole]:
    """Return changes of sign of h (..., points) between neighbours: indices of the first, and the change of the count.

    2 more zeros beyond the curve where h falls, 2 fewer where it rises, the mirror image counted.  A point at which h
    is exactly 0 has the sign of the next.
    """
    sign = np.sign(h)
    if (sign == 0).any():
        last = h.shape[-1] - 1
        following = np.where(sign != 0, np.arange(last + 1), last)
        following = np.minimum.accumulate(following[..., ::-1], axis=-1)[..., ::-1]
        sign = np.take_along_axis(sign, following, axis=-1)
    before = np.nonzero(sign[..., 1:] * sign[..., :-1] < 0)
    return before, np.where(sign[before] > 0, 2, -2)


def zeros_between(f: Callable[[Real, Whole], Real], low: Real, high: Real) -> Real:
    """Return the zeros of functions that change sign between `low` and `high` (n,), to the last bit.

    `f` gives the values of some of them, by their numbers, at a place of each.  By SciPy's Chandrupatla (1997); `low`
    of a function that has one sign at both.
    """
    # of a place, and of the narrowest bracket
    last_bit = 2.0**-53
    if not low.size:
        return low
    limits = {
        "xatol": last_bit * float(abs(high - low).min()),
        "xrtol": 2 * last_bit,
        "fatol": 0.0,
        "frtol": 0.0,
    }
    found = find_root(f, (low, high), args=(np.arange(low.size),), tolerances=limits)  # type: ignore[call-overload]
    return np.where(found.success, found.x, low)


class Line(NamedTuple):
    """The loops along one number g of a law, from `low` to `high`: weights `others` + g `alone` (rows,) of terms."""

    others: Real
    alone: Real
    low: float
    high: float

    @classmethod
    def of(cls, weights: Real, unit: Real, value: float, low: float, high: float) -> Line:
        """Build the line of a number with this value in a law: one unit of it adds `unit` to the weights."""
        return cls(weights - value * unit, unit, low, high)


class Steps(NamedTuple):
    """Steps between neighbours of a grid: coordinates `low` and `high` (n,), places from an `origin`, and the terms.

    `terms` gives the rows (rows, m) of some steps, by their numbers, at a coordinate of each.
    """

    low: Real
    high: Real
    terms: Callable[[Real, Whole], Complex]
    origin: Real | float = 0.0


class Curve(Protocol):
    """A curve with a grid that resolves the terms (rows, points) of a loop: D = weights @ terms."""

    @property
    def terms(self) -> Complex:
        """The terms at the points of the grid."""

    def steps(self, number: Whole) -> Steps:
        """The steps from the points of these numbers to the next."""


@frozen
class Grid:
    """A curve with a grid of `places` (n,), and its terms at a place."""

    places: Real
    terms_at: Callable[[Real], Complex]

    @cached_property
    def terms(self) -> Complex:
        """The terms at the points of the grid."""
        return self.terms_at(self.places)

    def steps(self, number: Whole) -> Steps:
        """The steps from the points of these numbers to the next."""
        return Steps(self.places[number], self.places[number + 1], lambda at, _: self.terms_at(at))


def locate_crossings(places: Real, parts: Parts) -> tuple[Real, Real, Whole]:
    """Return gain, place and change of the count (n,) of every crossing between neighbours of a grid of places."""
    curve = Grid(places, lambda at: np.array(parts(at)))
    (found,) = crossings(curve, [Line(np.array([1.0, 0.0]), np.array([0.0, 1.0]), -np.inf, np.inf)])
    gain, at, change = np.reshape(found, (-1, 3)).T
    return gain, at, change.astype(np.int64)


def crossings(curve: Curve, lines: Sequence[Line], *, with_dips: bool = False) -> list[list[Crossing]]:
    """Return the crossings of each line by pairs between neighbours of the curve's grid, all solved for at once.

    `with_dips`, on a `Grid`: those too of which two lie between neighbours, where |h| dips through 0.
    """
    others = np.array([line.others for line in lines])
    alone = np.array([line.alone for line in lines])
    A = others @ curve.terms
    B = alone @ curve.terms
    (line, step), change = brackets((A * B.conj()).imag)
    low, high, terms, origin = curve.steps(step)

    def parts(at: Real, which: Whole, of: Whole) -> tuple[Complex, Complex]:
        rows = terms(at, which)
        return (others[of].T * rows).sum(axis=0), (alone[of].T * rows).sum(axis=0)

    if with_dips:
        dip_line, first, middle, last, sign = _dips(parts, curve, _share(A, B))
        line = np.r_[line, dip_line, dip_line]
        change = np.r_[change, 2 * sign, -2 * sign]
        low = np.r_[low, first, middle]
        high = np.r_[high, middle, last]

    def h(at: Real, which: Whole) -> Real:
        A, B = parts(at, which, line[which])
        return np.asarray((A * B.conj()).imag)

    at = zeros_between(h, low, high)
    A, B = parts(at, np.arange(at.size), line)
    # B vanishes: the gain is infinite
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        gain = -(A * B.conj()).real / abs(B) ** 2
    found: list[list[Crossing]] = [[] for _ in lines]
    rows = zip(line.tolist(), gain.tolist(), (origin + at).tolist(), change.tolist(), strict=True)
    for number, *each in rows:
        found[number].append(Crossing(*each))
    return found


def _dips(
    parts: Callable[[Real, Whole, Whole], tuple[Complex, Complex]], curve: Curve, share: Real
) -> tuple[Whole, Real, Real, Real, Whole]:
    """Return dips of |h| through 0 between three neighbours: line, first place, one beyond 0, last place, and sign.

    Two crossings lie there, as near to each other as a resonance is narrow, and h has one sign at the points of the
    grid.  The least of all dips are found together, by SciPy's Chandrupatla (1998).
    """
    # of |A| |B|: an imaginary part that may be rounding
    rounded = 1e-11
    inner = share[:, 1:-1]
    signs = np.sign(inner)
    # of the neighbours: below 0 where one is across
    lower = np.minimum(signs * share[:, :-2], signs * share[:, 2:])
    line, before = np.nonzero((abs(inner) <= lower) & (abs(inner) > rounded))
    sign = signs[line, before].astype(np.int64)
    first, middle, *_ = curve.steps(before)
    last = curve.steps(before + 1).high
    if not line.size:
        return line, first, first, last, sign

    def depth(at: Real, which: Whole) -> Real:
        return sign[which] * _share(*parts(at, which, line[which]))

    # 14 steps of a golden section leave a thousandth of two steps of the grid, of smooth functions far less
    dip = find_minimum(depth, (first, middle, last), args=(np.arange(line.size),), maxiter=14)
    through = dip.f_x < -rounded
    return line[through], first[through], dip.x[through], last[through], sign[through]


def _share(A: Complex, B: Complex) -> Real:
    """Return h over its largest possible size, -1 to 1."""
    return np.asarray((A * B.conj()).imag / np.maximum(abs(A) * abs(B), LEAST_SIZE))


def check_ascending(name: str, values: Any, least: int, most: int) -> Real:
    """Check the values (n,) of one number of a plane.  Raises ParameterError unless they ascend, `least` to `most`."""
    try:
        values = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        # no numbers
        values = np.empty(0)
    ascends = np.isfinite(values).all() and (np.diff(values) > 0).all()
    is_right = least <= values.size <= most and ascends
    remedy = (
        f"an ascending range of {least} to {most} finite values (give the law as law=, its numbers as vary=)"
    )
    require(is_right, name, f"{values.size} values", remedy)
    return np.asarray(values)


def counts_over(gains: Real, columns: Sequence[Crossings], reference: float, there: NDArray[Any]) -> Whole:
    """Return the number of zeros beyond the curve at each of the gains (n,) in each column: (columns, n).

    `columns` are the crossings of each along the gain, `there` (columns,) the count at the gain `reference`.
    """
    counts = [
        count + each.passed(gains) - each.passed(reference)
        for each, count in zip(columns, there, strict=True)
    ]
    return np.array(counts, dtype=np.int64).reshape(len(columns), gains.size)


def intervals(found: Crossings, low: float, high: float, reference: float, there: int) -> list[Window]:
    """Return the intervals between `low` and `high` without zeros beyond the curve; `there`: at `reference`."""
    pairs = found.spans(low, high)
    counts = there + found.passed(np.mean(pairs, axis=1)) - found.passed(reference)
    return join_neighbours([pair for pair, count in zip(pairs, counts, strict=True) if not count])


def confirm_intervals(
    found: Crossings, low: float, high: float, is_stable: Callable[[float], bool]
) -> list[Window]:
    """Return the intervals between `low` and `high`, which may be infinite, without zeros beyond the curve.

    Between two crossings the count is constant, and may be 0 only where it is least: there `is_stable` is evaluated at
    one gain.  Crossings that differ by rounding are one.  If all of these are unstable, `is_stable` is evaluated
    between all crossings: next to z = 1 rounding may have made a crossing, and the counts are wrong.
    """
    gains = found.within(low, high).gain
    # next to z = 1 one static crossing is read several times, each with an error near 1e-12
    edges = np.r_[low, gains[np.diff(gains, prepend=-np.inf) > 1e-9 * abs(gains)], high]
    # where nothing crosses: any value
    beyond = 2 * (abs(edges[np.isfinite(edges)]).max(initial=0.0) or 1.0)
    inner = np.clip(edges, -beyond, beyond)
    middles = (inner[1:] + inner[:-1]) / 2
    # the same up to a constant
    counts = found.passed(middles)
    for may_be in (counts == counts.min(), counts > counts.min()):
        stable = [i for i in np.flatnonzero(may_be).tolist() if is_stable(float(middles[i]))]
        if stable:
            return join_neighbours([(float(edges[i]), float(edges[i + 1])) for i in stable])
    return []


def join_neighbours(windows: list[Window]) -> list[Window]:
    """Join neighbours with a common edge (two crossings that cancel)."""
    merged: list[Window] = []
    for low, high in windows:
        if merged and merged[-1][1] == low:
            merged[-1] = (merged[-1][0], high)
        else:
            merged.append((low, high))
    return merged
