"""The plane of both gains as it is drawn: axes, and the exact stability boundary fine enough for a picture.

The boundary of a `Plane` is known at the frequencies of the arm's grid.  Where a segment of it would be seen as one,
the D-decomposition is evaluated between; where the curve leaves the picture, or runs through infinity, it is cut.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, Arm
from tfarm.arrays import Real
from tfarm.spectrum import modes
from tfarm.spectrum.table import default_gains, hub_locked, rate_unit

from .loop import Loop
from .plane import Plane, between, boundary, gain_map
from .windows import static_edge

LOG_BASE = math.log(10.0)
LINEAR_SCALE = 0.5  # decades that the linear part of an axis takes on each side of 0, as matplotlib's `linscale` has it
LINEAR_SHARE = LINEAR_SCALE / (1 - 1 / 10)  # what these are multiplied by there
EVEN_GRID = 1e-9  # of its range: by less may the steps of an even grid differ
LOWEST_MOMENT_GAIN, HIGHEST_MOMENT_GAIN = -4.0, 2.0  # of what balances a torque: the range that is shown
DEEPEST_MOMENT_GAIN = -50.0  # and how deep unstable windows are looked for
DEEP_ROWS = 400  # values between, at which they are looked for
BELOW_DEEPEST = 1.4  # times the deepest of them: how deep the picture goes, so that it is seen to end
HIGHEST_RATE_GAIN = 10  # J w1: with it the hub of a rigid arm slows down within 0.1/w1
SHORT_SEGMENT = 0.008  # of the picture: longer pieces of the boundary are seen as straight, and are cut
LONG_SEGMENT = 0.03  # of the picture: what is longer after all cuts is a jump through infinity, and is not drawn
EDGE_ROUNDS = 30  # of cutting at most: 2^-30 of a step between frequencies is below what a picture shows
SCAN = 32  # columns of the picture in which unstable windows are looked for
ROWS_BESIDE_EDGE = 1.5  # beyond this many rows from the boundary the count must have changed


@dataclass(frozen=True)
class Axis:
    """One axis of the map: linear within +-`linear`, logarithmic beyond (all linear where `linear` is infinite)."""

    low: float
    high: float
    linear: float = math.inf

    @property
    def is_linear(self) -> bool:
        """Whether it is linear throughout."""
        return math.isinf(self.linear)

    def place(self, x: Real) -> Real:
        """Where values are along the axis, 0 to 1."""
        low, high = self._stretched(np.array([self.low, self.high]))
        return np.asarray((self._stretched(np.asarray(x, float)) - low) / (high - low))

    def grid(self, number: int) -> Real:
        """So many values, evenly spaced as seen."""
        low, high = self._stretched(np.array([self.low, self.high]))
        y = between(low, high, number)
        if self.is_linear:
            return y
        beyond = self.linear * np.exp((abs(y) / self.linear - LINEAR_SHARE) * LOG_BASE)
        return np.asarray(np.where(abs(y) <= self.linear * LINEAR_SHARE, y / LINEAR_SHARE, np.sign(y) * beyond))

    def _stretched(self, x: Real) -> Real:
        """Proportional to x up to `linear`, then a decade as long as `linear`: matplotlib's "symlog"."""
        if self.is_linear:
            return x
        decades = np.log(np.maximum(abs(x), self.linear)) / LOG_BASE
        beyond = self.linear * (LINEAR_SHARE - math.log(self.linear) / LOG_BASE + decades)
        return np.asarray(np.where(abs(x) <= self.linear, x * LINEAR_SHARE, np.sign(x) * beyond))

    @classmethod
    def of(cls, values: Real) -> Axis:
        """That on which a grid (n,), ascending, is nearly even: linear, or logarithmic beyond its smallest size."""
        low, high = float(values[0]), float(values[-1])
        if np.ptp(np.diff(values)) <= EVEN_GRID * (high - low):
            return cls(low, high)
        return cls(low, high, float(abs(values[values != 0]).min()))


def rate_axis(arm: Arm) -> Axis:
    """The rate gain from just below 0 to 10 J w1, logarithmic from well below the default gain on."""
    unit = rate_unit(arm)
    linear = 10.0 ** math.floor(math.log10(default_gains(arm)[RATE_GAIN]))
    return Axis(-linear, HIGHEST_RATE_GAIN * unit, linear)


def rate_columns(arm: Arm, x: Axis, number: int) -> Real:
    """Of so many rate gains, evenly spaced as seen, those at which an arm may be stable.

    A free hub whose gain takes more than it loses runs away: 1 + L is below 0 next to s = 0, and above it far right.
    """
    across, least = x.grid(number), -arm.rate_loss
    return across[across > least] if arm.has_rigid_mode else across[across != least]


def moment_axis(arm: Arm, x: Axis) -> Axis:
    """The moment gain from -4 to 2, or as deep as unstable windows go, times what one N m takes of a rig's input."""
    low, high, deepest = (
        each * arm.input_per_torque for each in (LOWEST_MOMENT_GAIN, HIGHEST_MOMENT_GAIN, DEEPEST_MOMENT_GAIN)
    )
    if arm.is_undamped:
        return Axis(low, high)
    across = x.grid(SCAN)
    deep = gain_map(arm, across[across > 0], between(deepest, low, DEEP_ROWS))
    rows = np.nonzero(~deep.stable.all(axis=1))[0]
    if not rows.size:
        return Axis(low, high)
    return Axis(max(deepest, BELOW_DEEPEST * float(deep.axes[1][rows[0]])), high, high)


def edge(found: Plane, x: Axis, y: Axis) -> Real:
    """The boundary in the picture, finer where it is coarse, with a row of nan after each of its parts."""
    points, loop = found.boundary, Loop(found.arm, found.law)
    if not points.size:
        return points
    for _ in range(EDGE_ROUNDS):
        length, is_seen = _segments(points, x, y)
        (coarse,) = np.nonzero((length > SHORT_SEGMENT) & is_seen)
        if not coarse.size:
            break
        middle = np.sqrt(points[coarse, 2] * points[coarse + 1, 2])
        middle = middle[(middle > points[coarse, 2]) & (middle < points[coarse + 1, 2])]
        points = np.concatenate([points, boundary(loop, middle)])
        points = points[np.unique(points[:, 2], return_index=True)[1]]
    length, is_seen = _segments(points, x, y)
    kept = is_seen & (length < LONG_SEGMENT)
    rows: list[Real] = []
    for i in np.nonzero(np.r_[kept, False] | np.r_[False, kept])[0]:  # points of a segment that is kept
        rows.append(points[i])
        if i == len(points) - 1 or not kept[i]:
            rows.append(np.full(3, np.nan))
    return np.array(rows).reshape(-1, 3)


def _segments(points: Real, x: Axis, y: Axis) -> tuple[Real, NDArray[np.bool_]]:
    """How long each segment looks, and whether it may pass through the picture."""
    places = np.stack([axis.place(points[:, i]) for i, axis in enumerate((x, y))])
    low, high = np.minimum(places[:, 1:], places[:, :-1]), np.maximum(places[:, 1:], places[:, :-1])
    return np.hypot(*np.diff(places)), np.asarray(((high >= 0) & (low <= 1)).all(axis=0))


def stable_edge(found: Plane, points: Real, x: Axis, y: Axis) -> Real:
    """Of points (n, 3) of the boundary those in the picture with the stable region on one side, above or below."""
    points = points[~np.isnan(points[:, 0])]
    if not points.size:
        return points
    across, up = x.place(points[:, 0]), y.place(points[:, 1])
    columns, rows = (axis.place(values) for axis, values in zip((x, y), found.axes, strict=True))
    column, row = np.searchsorted(_middles(columns), across), np.interp(up, rows, np.arange(rows.size))
    below, above = (
        np.clip(np.round(row + way).astype(int), 0, rows.size - 1) for way in (-ROWS_BESIDE_EDGE, ROWS_BESIDE_EDGE)
    )
    differ = (found.unstable[below, column] == 0) != (found.unstable[above, column] == 0)
    return np.asarray(points[differ & (up >= 0) & (up <= 1) & (across <= 1) & (points[:, 0] > 0)])


def _middles(values: Real) -> Real:
    return np.asarray((values[1:] + values[:-1]) / 2)


def seen(found: Plane, x: Axis, y: Axis) -> Plane:
    """The counts of a map on a grid that is even as seen: at each of its points those of the nearest one computed."""
    across, up = (axis.grid(values.size) for axis, values in zip((x, y), found.axes, strict=True))
    columns, rows = (np.searchsorted(_middles(old), new) for old, new in zip(found.axes, (across, up), strict=True))
    return found.on(across, up, found.unstable[np.ix_(rows, columns)])


def resting_frequencies(found: Plane, count: int) -> Real:
    """The first frequencies [rad/s] with the hub at rest, which the edge along the gain across is made of."""
    return hub_locked(modes(found.arm, count)).natural_frequency


def static_edges(found: Plane) -> tuple[float | None, float | None]:
    """Where a real pole passes through 0: an upright line of the boundary, and a level one."""
    loop, (across, up) = Loop(found.arm, found.law), (abs(values).max() for values in found.axes)
    upright = static_edge(loop.having(MOMENT_GAIN, 0.0), RATE_GAIN, (-across, across))
    level = static_edge(loop.having(RATE_GAIN, 1.0), MOMENT_GAIN, (-up, up))
    return None if upright is None else upright.t, None if level is None else level.t
