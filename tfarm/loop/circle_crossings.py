"""Changes of the count of unstable poles of a sampled loop along a number of the law, or over two.

It is `tfarm.crossing` on the unit circle.

On z = e^{iq} the characteristic function is A + g B, g one number of the law, or a factor on all of it, and A the terms
without it.  Each open-loop pole near the circle gives A and B a feature as narrow as its residue.  So the grid in q has
points at geometric distances around each, and A, B are computed without loss from the offset to it.  At z = 1 and
z = -1 a single pole crosses (see also Ackermann, Robust Control, 1993, ch. 4).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import NAMES, PLANE
from tfarm.arm.feedback import ON
from tfarm.arrays import Complex, Real
from tfarm.crossing import (
    Crossing,
    Crossings,
    Line,
    Window,
    check_ascending,
    confirm_intervals,
    counts_over,
    crossings,
    pieces,
)
from tfarm.crossing.shown import PlaneOfCounts
from tfarm.crossing.turning import loose_columns
from tfarm.loop.sampled import OfLoop, Sampled
from tfarm.loop.sampled_poles import SampledPoles
from tfarm.loop.sampled_rig import CircleGrid
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.gains import most_gain

# the name of a factor on the whole law
FACTOR = "gain"
# of K1 in a picture
MOST_COLUMNS = 400


def line_of(loop: Sampled, name: str) -> Line:
    """Return the line of one number of the law, or of `FACTOR`.  A gain at the hub ends at `most_gain`."""
    # with more its gain is beyond any number
    most_factor = 1e9
    unit = np.zeros(loop.row.size)
    if name == FACTOR:
        unit[1:] = loop.weights
        # the least factor on a law that is searched: with less it is none
        return Line.of(loop.row, unit, 1.0, 1e-9, most_factor)
    place = 1 + loop.part(name)
    value = loop.number(name)
    gain = ON.get(name, name)
    most = most_gain(loop.plant.arm, gain) if gain in NAMES else most_factor * (abs(value) or 1.0)
    unit[place] = 1.0
    return Line.of(loop.row, unit, value, -most, most)


def crossings_along(grid: CircleGrid, lines: Sequence[Line]) -> list[Crossings]:
    """Return the crossings of the circle, at angles `at`, along each of some lines, all solved for at once.

    Of A + g B, A are the `terms` under the weights `others`, B those under `alone`.  Each crossing is solved for by its
    angle from the next pole, to the last bit.  At z = 1 and z = -1, where a single pole crosses, h = Im(A conj B)
    vanishes: it falls towards that end where it is positive just before.
    """
    found = []
    first, last = grid.terms[:, [0, -1]].T
    at_end = grid.rig.terms(np.array([-1.0 + 0j]), None, np.ones(1))[:, 0]
    for line, here in zip(lines, crossings(grid, lines), strict=True):
        others, alone, low, high = line
        begins, ends = (((others @ rows) * (alone @ rows).conj()).imag >= 0 for rows in (first, last))
        here.append(Crossing(_real_gain(others @ at_end, alone @ at_end), math.pi, 1 if ends else -1))
        (lowest, at_one), (least, moving) = (_lowest(grid.rig.near_one(each)) for each in (others, alone))
        # A and B are of the same order in x = 1 - 1/z, or A is of a higher one: it crosses at 0
        if least <= lowest:
            static = _real_gain(at_one, moving) if least == lowest else 0.0
            here.append(Crossing(static, 0.0, -1 if begins else 1))
        found.append(Crossings.of(here).within(low, high))
    return found


def _lowest(terms: Sequence[tuple[int, float]]) -> tuple[float, float]:
    """Return the lowest power of x in a sum of c x^n, and its coefficient."""
    lowest = min((order for order, _ in terms), default=math.inf)
    return lowest, sum(value for order, value in terms if order == lowest)


def _real_gain(A: Any, B: Any) -> float:
    """Return the real gain g of A + g B = 0 where A and B are real; inf where there is none."""
    # 1e-12 of the terms without a gain: smaller terms of the gain are rounding
    if abs(B.real) > 1e-12 * abs(A.real):
        return float(-A.real / B.real)
    return math.inf


# ------------------------------------------------------------ windows


def windows_on_circle(loop: Sampled, names: Sequence[str]) -> dict[str, list[Window]]:
    """Return every stability interval of some numbers of the law, the others constant, confirmed by the poles."""
    lines = [line_of(loop, name) for name in names]
    windows = {}
    for name, line, found in zip(names, lines, crossings_along(loop.rig.grid, lines), strict=True):

        def is_stable(value: float, line: Line = line) -> bool:
            return loop.with_weights((line.others + value * line.alone)[1:].tolist()).is_stable

        windows[name] = confirm_intervals(found, 0.0 if name == FACTOR else -math.inf, math.inf, is_stable)
    return windows


def stable_windows(loop: Sampled, name: str) -> list[Window]:
    """Return every stability interval of one number of the law, or of a positive factor on it (`FACTOR`)."""
    return windows_on_circle(loop, [name])[name]


def interval_around(windows: list[Window], gain: float) -> Window | None:
    """Return the interval that contains a gain."""
    return next((window for window in windows if window[0] < gain < window[1]), None)


# ------------------------------------------------------------ planes


@frozen
class GainMap(OfLoop, PlaneOfCounts):
    """`unstable` (len(x), len(y)): number of unstable poles, without z = 1 of a free hub angle; stable where it is 0.

    `vary` names both numbers of the law, `x` and `y` are their values: K1 and K2, by default.  `crossings[i]` are the y
    at which the count changes at x[i], exact and independent of the grid.
    """

    loop: Sampled
    vary: Annotated[
        tuple[str, str],
        Quantity("plane of", help="names of the two numbers of the controller that vary, the first across"),
    ]
    x: Annotated[Real, Quantity(curve=True, help="values of the first number, ascending")]
    y: Annotated[Real, Quantity(curve=True, help="values of the second number, ascending")]
    unstable: NDArray[np.int64]
    crossings: list[Crossings]

    @property
    def finding(
        self,
    ) -> Annotated[str, Quantity("stability region", help="grid points of the plane without unstable poles")]:
        """Number of points of the grid at which the loop is stable."""
        return super().finding

    @property
    def counts(
        self,
    ) -> Annotated[
        NDArray[np.int64],
        Quantity(
            key="unstable_poles", help="unstable poles at each point, without z = 1 of a free hub angle"
        ),
    ]:
        """Unstable poles (len(y), len(x))."""
        return self.unstable.T


def sampled_map(
    loop: Sampled, x: Sequence[float] | Real, y: Sequence[float] | Real, vary: tuple[str, str] = PLANE
) -> GainMap:
    """Return the map over two numbers of the law of a loop, x and y (both ascending), all others constant.

    `vary` names them as `Law.with_number` does, or "K1", "K2" and "Kp" of gains at the hub.  The edges are exact
    (D-decomposition) for two gains of its parts, and along such a gain for each value of any other number.  For two
    others poles are counted at every point.  Raises ConvergenceError where crossings and a count by eigenvalues differ.
    """
    # of a map, along one gain
    most_gains = 4000
    x = check_ascending(vary[0], x, 1, most_gains)
    y = check_ascending(vary[1], y, 1, most_gains)
    column, row = vary
    across, up = (loop.place(name) for name in vary)
    if up is None and across is not None:
        mirrored = sampled_map(loop, y, x, (row, column))
        return GainMap(loop, vary, mirrored.y, mirrored.x, mirrored.unstable.T, [])
    loops = {value: loop.with_number(column, value) for value in x.tolist()}
    columns = loops.values()

    def poles_at(each: Sampled, value: float) -> SampledPoles:
        return each.with_number(row, value).poles

    if up is None:
        counts = [[poles_at(each, value).unstable for value in y.tolist()] for each in columns]
        return GainMap(loop, vary, x, y, np.array(counts), [])
    at = _off_the_edge(y)
    if across is None:
        there = np.array([poles_at(each, at).unstable for each in columns])
        found = [crossings_along(each.rig.grid, [line_of(each, row)])[0] for each in columns]
    else:
        # all loops have one grid, and a count in one column those of the row
        start = loop.with_number(column, _off_the_edge(x)).with_number(row, at)
        lines = [line_of(each, row) for each in columns]
        along, *found = crossings_along(loop.rig.grid, [line_of(start, column), *lines])
        there = start.poles.unstable + along.passed(x) - along.passed(start.number(column))
    plane = GainMap(loop, vary, x, y, counts_over(y, found, at, there), found)

    def count(first: float, second: float) -> int | None:
        poles = poles_at(loops[first], second)
        # 1e-9 of ln|z|: a pole nearer to the circle may be counted on either side
        return poles.unstable if abs(poles.log_radius).min() >= 1e-9 else None

    plane.must_agree(count, "crossings and eigenvalues differ")
    return plane


def refine_map(plane: GainMap, drawn: Callable[[Real, Real], Complex]) -> GainMap:
    """Return the same region at more values of K1, until the corners of its drawn outline are those of the region.

    `drawn` maps points of the plane to the picture, 1 high.
    """
    # rounds of halving where its outline bends
    for _ in range(12):
        more = loose_columns(plane.x, pieces(plane.x, plane.stable_intervals), drawn)
        if not more.size or plane.x.size + more.size > MOST_COLUMNS:
            break
        plane = add_columns(plane, more)
    return plane


def add_columns(plane: GainMap, x: Real) -> GainMap:
    """Return the map of two gains with further values across."""
    fresh = np.setdiff1d(x, plane.x)
    if not fresh.size:
        return plane
    more = sampled_map(plane.loop, fresh, plane.y, plane.vary)
    both = np.r_[plane.x, fresh]
    order = np.argsort(both, kind="stable")
    found = plane.crossings + more.crossings
    unstable = np.concatenate([plane.unstable, more.unstable])
    return replace(plane, x=both[order], unstable=unstable[order], crossings=[found[n] for n in order])


def ends_of_K1(loop: Sampled, shares: Sequence[float] = (-0.9, 0.3, 0.9)) -> Real:
    """Return the ends of stability intervals of K1 at a few K2, without 0: upright edges of the region.

    K2 are `shares` of `input_per_torque`.
    """
    unit = loop.plant.arm.input_per_torque
    windows = (stable_windows(loop.with_number("K2", unit * share), "K1") for share in shares)
    ends = np.unique(np.concatenate([np.ravel(each) for each in windows]))
    return ends[np.isfinite(ends) & (ends != 0)]


def with_both_sides(K1: Real, ends: Real) -> Real:
    """Return values of K1, ascending, with both sides of each upright edge."""
    # relative: distance to either side of such an edge at which a region is cut
    off_edge = 1e-9
    return np.unique(np.r_[K1, ends * (1 - off_edge), ends * (1 + off_edge)])


def _off_the_edge(values: Real) -> float:
    """Return a gain inside the range that is on no rounded edge."""
    # the golden section of a range is on no rounded number and no grid
    return float(values[0] + 0.6180339887498949 * (values[-1] - values[0]))
