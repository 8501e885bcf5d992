"""The plane of both gains at a sample period: how many closed-loop poles lie outside the unit circle at each point."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import PLANE
from tfarm.arrays import Complex, Real
from tfarm.crossing import Crossings, Window, counts_over, intervals, pieces
from tfarm.crossing.turning import loose_columns
from tfarm.dsp.crossings import circle_grid, number_crossings, stable_windows
from tfarm.dsp.sampled import Sampled
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record

MOST_GAINS = 4000  # of a map, along one gain
ENDS_AT = (-0.9, 0.3, 0.9)  # K2 at which upright edges are looked for, of what balances a torque
MOST_COLUMNS = 400  # of K1 in a picture
OUTLINE_ROUNDS = 12  # of halving where its outline bends
BESIDE_EDGE = 1e-9  # relative: so far to either side of such an edge a region is cut
TOLD_FROM_CIRCLE = 1e-9  # of ln|z|: a pole nearer to the circle may be counted on either side
GOLDEN = 0.6180339887498949  # of a range: a place that no rounded number of a person or a grid falls on


@dataclass(frozen=True)
@record
class GainMap:
    """`unstable` (K1, K2): how many poles grow, apart from z = 1 of a free hub angle; stable where it is zero.

    `crossings[i]`: at which K2 the count changes at K1[i], exact and not tied to the grid.
    """

    loop: Sampled
    K1: Real
    K2: Real
    unstable: NDArray[np.int64]
    crossings: list[Crossings]

    @property
    def axes(self) -> tuple[Real, Real]:
        """The values of both gains: across the plane, and up it."""
        return self.K1, self.K2

    @property
    def modes_used(self) -> int:
        """How many flexible modes the loop has."""
        return self.loop.plant.count

    @property
    def stable_intervals(self) -> list[list[Window]]:
        """For each K1 the intervals of K2, cut to the map, in which nothing grows: the region with exact edges."""
        low, high = float(self.K2[0]), float(self.K2[-1])
        return [
            intervals(found, low, high, low, int(unstable))
            for found, unstable in zip(self.crossings, self.unstable[:, 0], strict=True)
        ]


def sampled_map(loop: Sampled, K1: Sequence[float] | Real, K2: Sequence[float] | Real) -> GainMap:
    """The map over the grid K1 x K2 (both ascending), the other settings as those of the loop.

    From the exact crossings of every row (D-decomposition) and one count by eigenvalues; those at three corners must
    agree with what the crossings say, or a ConvergenceError is raised.
    """
    rows, columns = _ascending("K1", K1), _ascending("K2", K2)
    grid, start = circle_grid(loop), loop.having(K1=_off_the_edge(rows), K2=_off_the_edge(columns))
    (across, up), there = (start.number(name) for name in PLANE), np.array([start.poles.unstable])
    (at_start,) = counts_over(rows, [number_crossings(grid, "K1", start.row)], across, there)
    found = [number_crossings(grid, "K2", start.having(K1=float(gain)).row) for gain in rows]
    unstable = counts_over(columns, found, up, at_start)
    for i, j in ((0, 0), (-1, 0), (-1, -1)):
        corner = loop.having(K1=float(rows[i]), K2=float(columns[j]))
        is_told = abs(corner.poles.log_radius).min() >= TOLD_FROM_CIRCLE  # else on an edge, or too close to it
        if is_told and (count := corner.poles.unstable) != unstable[i, j]:
            where = f"at K1 = {corner.number('K1'):g}, K2 = {corner.number('K2'):g}"
            message = f"{where} the crossings count {unstable[i, j]} growing poles, not {count}"
            raise ConvergenceError(message, GainMap(loop, rows, columns, unstable, found), abs(count - unstable[i, j]))
    return GainMap(loop, rows, columns, unstable, found)


def rounded_map(plane: GainMap, drawn: Callable[[Real, Real], Complex]) -> GainMap:
    """The same region at more values of K1, until its outline has no corner in a picture that the region has not.

    `drawn` says where points of the plane are in the picture, 1 high.
    """
    for _ in range(OUTLINE_ROUNDS):
        more = loose_columns(plane.K1, pieces(plane.K1, plane.stable_intervals), drawn)
        if not more.size or plane.K1.size + more.size > MOST_COLUMNS:
            break
        plane = with_more(plane, more)
    return plane


def with_more(plane: GainMap, K1: Real) -> GainMap:
    """The map with further values of K1, of those that it has not."""
    fresh = np.setdiff1d(K1, plane.K1)
    if not fresh.size:
        return plane
    more = sampled_map(plane.loop, fresh, plane.K2)
    both = np.r_[plane.K1, more.K1]
    order = np.argsort(both, kind="stable")
    found = plane.crossings + more.crossings
    return GainMap(
        plane.loop, both[order], plane.K2, np.concatenate([plane.unstable, more.unstable])[order],
        [found[n] for n in order],
    )  # fmt: skip


def ends_of_K1(loop: Sampled) -> Real:
    """Where stable intervals of K1 end, but at 0, at a few K2: there the region has upright edges."""
    unit = loop.plant.arm.input_per_torque
    found = [window for K2 in ENDS_AT for window in stable_windows(loop.having(K2=unit * K2), "K1")]
    return np.array(sorted({end for window in found for end in window if math.isfinite(end) and end}))


def with_both_sides(K1: Real, ends: Real) -> Real:
    """Values of K1 ascending, and among them either side of each upright edge."""
    return np.unique(np.concatenate([K1, ends * (1 - BESIDE_EDGE), ends * (1 + BESIDE_EDGE)]))


def _off_the_edge(values: Real) -> float:
    """A gain inside the range that no rounded edge falls on."""
    return float(values[0] + GOLDEN * (values[-1] - values[0])) if values.size > 1 else float(values[0])


def _ascending(name: str, values: Sequence[float] | Real) -> Real:
    gains = np.array(values, dtype=float)
    if gains.ndim != 1 or not 1 <= gains.size <= MOST_GAINS or not np.isfinite(gains).all():
        raise ParameterError(key=name, value=gains.shape, remedy=f"a list of 1 to {MOST_GAINS} finite gains")
    if (np.diff(gains) <= 0).any():
        raise ParameterError(key=name, value=float(gains[0]), remedy="the gains of a map ascend, each once")
    return gains
