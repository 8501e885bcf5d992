"""The search behind `design`: a grid that sees every basin, its minima refined all together, the best ones polished.

The rate gain is searched on a scale that is logarithmic from a hundred-millionth of J w1 on: what a slew leaves behind
is least where the loop hardly brakes, and there every decade counts.  Along the moment gain the scale is linear, and as
fine as the basins are: a slew of time T leaves a mode of frequency w in proportion to sin^2(w T/4), so that each mode
has a basin wherever its w under that gain grows by 4 pi/T.  A minimum of the grid is then refined on ever smaller grids
of 5 x 5 around it, all minima at once; the best are polished by the downhill simplex of Nelder and Mead (1965).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.records import record
from tfarm.synthesis.simplex import downhill

Bounds = tuple[float, float]
Score = Callable[[Real], Real]  # of points (2, n) of the plane of gains; what is least is best

LINEAR_BELOW = 1e-8  # of the unit of the rate gain: below it the scale is linear, and nothing new is found
AXIS_END = 1e-9  # share of an axis left out at either end: there verdicts are marginal
GRID_ROUNDS = 10  # of the small grids
GRID_SHRINKS = 0.5  # by so much they shrink where their centre is the best
HALVED_AFTER = (4, 7)  # rounds after which the better half of the minima goes on
FEWEST_MINIMA = 6  # minima that go on at least
# of a small grid's 25 points from its centre, in steps of the grid before
OFFSETS = np.array([(i, j) for i in (-1.0, -0.5, 0.0, 0.5, 1.0) for j in (-1.0, -0.5, 0.0, 0.5, 1.0)])
TIE = 0.01  # weight of the damping ratio beside a disk margin: without a clock rate feedback alone has margin 2
POLISHED = 3  # minima that the simplex starts from
SIMPLEX_VALUES = 120  # values of each simplex, at most


class Effort(NamedTuple):
    """Points of the grid across and up the plane of gains, and how many of its minima are refined."""

    across: int
    up: int
    starts: int


@dataclass(frozen=True)
class GainAxis:
    """The range of one gain on its scale, in shares from 0 to 1: g = least sinh(x), or linear where `least` is inf."""

    low: float
    high: float
    least: float = np.inf

    def gain(self, share: Real) -> Real:
        """The gains at these shares of the axis, 0 to 1."""
        if np.isinf(self.least):
            return np.asarray(self.low + (self.high - self.low) * share)
        ends = np.arcsinh(self.low / self.least), np.arcsinh(self.high / self.least)
        return np.asarray(self.least * np.sinh(ends[0] + (ends[1] - ends[0]) * share))

    def share(self, gain: Real) -> Real:
        """Where gains are along the axis."""
        if np.isinf(self.least):
            return np.asarray((gain - self.low) / (self.high - self.low))
        ends = np.arcsinh(self.low / self.least), np.arcsinh(self.high / self.least)
        return np.asarray((np.arcsinh(gain / self.least) - ends[0]) / (ends[1] - ends[0]))

    def middles(self, number: int) -> Real:
        """The middles of so many equal parts."""
        return (np.arange(number) + 0.5) / number


def searched_rates(bounds: Bounds, unit: float) -> GainAxis:
    """The axis of the rate gain for a unit J w1 [N m s/rad]; one that begins at 0 begins at the least told from 0."""
    low, high = bounds
    least = LINEAR_BELOW * min(unit, max(abs(low), abs(high)))
    return GainAxis(least if low == 0 else low, -least if high == 0 else high, least)


@dataclass(frozen=True)
@record
class Found:
    """A minimum: `shares` of both axes and the score there."""

    shares: Real
    score: float


def minima(values: Real, most: int) -> NDArray[np.int64]:
    """Rows and columns (n, 2) of the grid's local minima, the lowest `most`; inf where no value is."""
    padded = np.pad(values, 1, constant_values=np.inf)
    rows, columns = values.shape
    around = [padded[1 + i : 1 + i + rows, 1 + j : 1 + j + columns] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    least = np.isfinite(values) & (values <= np.min(around, axis=0))
    return np.asarray(np.argwhere(least)[np.argsort(values[least], kind="stable")[:most]])


def refined(score: Score, axes: tuple[GainAxis, GainAxis], starts: Real, steps: Real) -> list[Found]:
    """The lowest minima of the basins around the starts (n, 2), in shares; `steps` (2,) are those of the grid."""
    at, size = starts.copy(), np.ones(len(starts))
    best = np.full(len(starts), np.inf)
    for number in range(GRID_ROUNDS):
        if number in HALVED_AFTER:
            kept = np.argsort(best, kind="stable")[: max(FEWEST_MINIMA, len(best) // 2)]
            at, size, best = at[kept], size[kept], best[kept]
        points = np.clip(at[:, None] + size[:, None, None] * OFFSETS * steps, AXIS_END, 1 - AXIS_END)
        gains = np.array([axis.gain(points[..., i].ravel()) for i, axis in enumerate(axes)])
        values = score(gains).reshape(points.shape[:2])
        least = values.argmin(axis=1)
        rows = np.arange(len(at))
        at, best = points[rows, least], values[rows, least]
        size = np.where(abs(OFFSETS[least]).max(axis=1) < 1.0, size * GRID_SHRINKS, size)
    return [Found(*each) for each in zip(at, best.tolist(), strict=True)]


def by_simplex(score: Score, axes: tuple[GainAxis, GainAxis], found: Sequence[Found], size: float) -> list[Found]:
    """The minima by the downhill simplex, each from a triangle of this size in shares."""

    def of_shares(points: Real) -> Real:
        inside = np.clip(points, AXIS_END, 1 - AXIS_END)
        values = score(np.array([axis.gain(inside[:, i]) for i, axis in enumerate(axes)]))
        with np.errstate(invalid="ignore"):  # inf is no number to compare with: such a corner is drawn in
            return np.asarray(values + abs(values) * abs(points - inside).sum(axis=1))

    corners = size * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    ended = downhill(of_shares, [each.shares + corners for each in found], 1e-3 * size, SIMPLEX_VALUES)
    least = [Found(np.clip(end.corners[0], AXIS_END, 1 - AXIS_END), float(end.values.min())) for end in ended]
    return [min(pair, key=lambda each: each.score) for pair in zip(found, least, strict=True)]
