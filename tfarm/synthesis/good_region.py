"""Gains K1 and K2 with which both loops meet requirements: those of the grade *good* in the map of an arm.

The requirements are measured on a grid of gains on models of few modes (`measures`); on its columns the border is
where the models pass a limit or the exact loop its stability, to a 250th of a cell.  Of the exact loops it is
approximate; a search for the best gains begins there and ends by them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from tfarm.arm import PLANE, Arm, HubFeedback
from tfarm.arm.feedback import OUTPUT_OF, TWO_GAINS
from tfarm.arrays import Real
from tfarm.crossing import Window
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.plane import Plane, gain_map, moment_axis
from tfarm.loop.plane_axes import Axis, rate_axis
from tfarm.records import frozen
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.goals import Goal, measures_of
from tfarm.synthesis.judge import Judge, dominant_time_constant, of_laws
from tfarm.synthesis.models import DesignModel
from tfarm.synthesis.required import RequirementTask
from tfarm.synthesis.requirements import Requirement
from tfarm.synthesis.structures import Entry, structure_of

# columns and rows of the grid over the map, and of the finer one around the region
COARSE_GRID = (40, 50)
FINE_GRID = (60, 24)
# of unstable loops: as without any gain margin
UNSTABLE_EXCESS = 1.0


@frozen
class GoodRegion:
    """The largest violation of the requirements, `excess` (rows, columns), at gains `x` across and `y` up.

    `time_constant` [s] is that of the dominant pole of the sampled loop; inf where a loop is unstable.  The
    `stable_intervals` of y, for each x, are those in which all requirements are met.
    """

    x: Real
    y: Real
    excess: Real
    time_constant: Real
    stable_intervals: list[list[Window]]

    @property
    def met(self) -> Any:
        """Points (rows, columns) at which all requirements are met."""
        return self.excess <= 0

    @property
    def start(self) -> HubFeedback:
        """The gains inside with the fastest poles of the first mode; else those with the least violation."""
        # gains of rate feedback: without it the requirements are met by no controller too
        excess = np.where(self.x > 0, self.excess, np.inf)
        # the exact loops have a little less than the models
        inside = excess <= -0.005
        values = np.where(inside, self.time_constant, np.inf) if inside.any() else excess
        row, column = np.unravel_index(int(values.argmin()), values.shape)
        return HubFeedback(K1=float(self.x[column]), K2=float(self.y[row]))


def _intervals(
    excess_of: Callable[[Sequence[Entry]], tuple[Real, Real]], found: GoodRegion, exact: Plane
) -> list[list[Window]]:
    """Return for each x the intervals of y in which all requirements are met, their ends found by halving.

    No end is beyond an edge of the exact stability intervals of the continuous-time loop.
    """
    met = found.met
    columns, rows = np.nonzero((met[1:] != met[:-1]).T)
    inside = np.where(met[rows, columns], found.y[rows], found.y[rows + 1])
    outside = np.where(met[rows, columns], found.y[rows + 1], found.y[rows])
    for n, (column, y) in enumerate(zip(columns.tolist(), inside.tolist(), strict=True)):
        stable = [each for each in exact.stable_intervals[column] if each[0] <= y <= each[1]]
        if stable:
            outside[n] = np.clip(outside[n], *stable[0])
    # to a 250th of a step of the grid
    for _ in range(8 if rows.size else 0):
        middle = (inside + outside) / 2
        excess, _ = excess_of(_entries(found.x[columns], middle))
        inside = np.where(excess <= 0, middle, inside)
        outside = np.where(excess <= 0, outside, middle)
    intervals = []
    for number, column in enumerate(met.T):
        ends = inside[columns == number].tolist()
        if column[0]:
            ends.insert(0, float(found.y[0]))
        if column[-1]:
            ends.append(float(found.y[-1]))
        intervals.append(list(zip(ends[::2], ends[1::2], strict=True)))
    return intervals


@lru_cache(maxsize=8)
def good_region(
    arm: Arm, x: Axis, y: Axis, chain: Chain, requirements: tuple[Requirement, ...]
) -> GoodRegion | None:
    """Return the region in a picture of these axes; None where it has no stable gains or no models.

    A coarse grid finds it, a finer one around it has its border.
    """
    try:
        form = structure_of(TWO_GAINS, arm, Kp=0.0, modes=2, period=chain.sampling.period, bounds={})
        task = RequirementTask(arm, requirements, "time_constant_s", form, 2, chain, lambda *_: None)
        judge = task.judge(arm, task.goal, 0)
        found = _measured(judge, task.goal, arm, x.grid(COARSE_GRID[0]), _with_zero(y.grid(COARSE_GRID[1])))
        if found.excess.min() >= UNSTABLE_EXCESS:
            return None
        judge = _denser(judge)
        # a region that is thin on a grid may go on beyond, or lie between its rows
        for _ in range(3):
            inside = found.excess <= max(0.0, float(found.excess.min()))
            fine_x = found.x
            if found.met.any():
                fine_x = _around(x, found.x, inside.any(axis=0), FINE_GRID[0])
            fine_y = _with_zero(_around(y, found.y, inside.any(axis=1), FINE_GRID[1]))
            is_coarse = fine_x is found.x
            found = _measured(judge, task.goal, arm, fine_x, fine_y)
            across = found.met.any(axis=0)
            up = found.met.any(axis=1)
            goes_on = is_coarse or _goes_on(x, found.x, across) or _goes_on(y, found.y, up)
            if not goes_on and up.sum() > FINE_GRID[1] // 3:
                break
        exact = gain_map(arm, found.x, found.y)
        intervals = _intervals(partial(_of_laws, judge, task.goal), found, exact)
        return replace(found, stable_intervals=intervals)
    except (ConvergenceError, ParameterError):
        return None


def map_region(arm: Arm, chain: Chain, requirements: tuple[Requirement, ...]) -> GoodRegion | None:
    """Return the region in the map of an arm, of the requirements on its loops; None as above, or of none of these."""
    x = rate_axis(arm)
    of_loops = tuple(each for each in requirements if each.measure.is_of(1))
    return good_region(arm, x, moment_axis(arm, x), chain, of_loops) if of_loops else None


def _around(axis: Axis, values: Real, inside: Any, number: int) -> Real:
    """Return values around those inside, with both ends."""
    every = axis.place(values)
    places = every[inside]
    # more than a step of the grid
    room = 1.2 * np.diff(every).max() + 0.2 * np.ptp(places)
    known = np.r_[axis.low, axis.grid(400), axis.high]
    low, high = np.interp((places.min() - room, places.max() + room), axis.place(known), known).tolist()
    return np.r_[low, Axis(low, high, axis.linear).grid(number), high]


def _with_zero(values: Real) -> Real:
    """Return values with 0, if it is among them: of an arm without damping the region is next to rate feedback."""
    if values[0] < 0 < values[-1]:
        return np.unique(np.r_[values, 0.0])
    return values


def _goes_on(axis: Axis, values: Real, met: Any) -> bool:
    """Whether a region ends at an end of its grid that is none of the axis."""
    return bool((met[0] and values[0] > axis.low) or (met[-1] and values[-1] < axis.high))


def _denser(judge: Judge) -> Judge:
    """Return a judge with denser grids of frequency: its border is that of the result cards within 1 % of a limit."""
    continuous, *others = judge.also
    return replace(judge, model=_cut(judge.model, 2), also=(_cut(continuous, 4), *others))


def _cut(model: DesignModel, parts: int) -> DesignModel:
    """Return a model on a grid with every step cut into parts."""
    q = model.angles
    places = np.arange((q.size - 1) * parts + 1) / parts
    return replace(model, grid=lambda: np.interp(places, np.arange(q.size), q))


def _entries(x: Real, y: Real) -> list[Entry]:
    """Return the entries of gains (laws,)."""
    return [Entry(OUTPUT_OF[name], values[None]) for name, values in zip(PLANE, (x, y), strict=True)]


def _of_laws(judge: Judge, goal: Goal, entries: Sequence[Entry]) -> tuple[Real, Real]:
    """Return largest violation and dominant time constant [s] of laws (laws,) by the models of a judge.

    Those that meet the requirements are stable on all models: for an arm without damping on the large ones too.
    """
    laws = np.arange(entries[0].num.shape[1])
    excess = np.full(laws.size, UNSTABLE_EXCESS)
    time_constant = np.full(laws.size, np.inf)
    # of some laws at once: each has some thousand points of L
    for some in np.array_split(laws, laws.size // 100 + 1):
        poles = judge.model.poles(of_laws(entries, some))
        is_stable = judge.model.growth(poles).max(axis=1, initial=-np.inf) < 0
        stable = some[is_stable]
        if stable.size:
            excess[stable] = np.minimum(_excess(judge, goal, of_laws(entries, stable)), UNSTABLE_EXCESS)
            time_constant[stable] = dominant_time_constant(
                judge.model, poles[is_stable], first_frequency(judge.arm)
            )
    for model in judge.also:
        met = np.flatnonzero(excess <= 0)
        if met.size:
            growth = model.growth(model.poles(of_laws(entries, met))).max(axis=1)
            excess[met[growth >= 0]] = UNSTABLE_EXCESS
    return excess, time_constant


def _excess(judge: Judge, goal: Goal, entries: Sequence[Entry]) -> Real:
    """Return the largest violation of stable laws (laws,); those far from the region without the delays required."""
    # of a limit
    far = 0.2
    loop = measures_of(judge, entries)
    excess = np.max(goal.violations(judge, loop), axis=0)
    near = np.flatnonzero(excess <= max(far, float(excess.min())))
    for late in goal.delay_violations(judge, of_laws(entries, near)):
        excess[near] = np.maximum(excess[near], late)
    return np.asarray(excess)


def _measured(judge: Judge, goal: Goal, arm: Arm, x: Real, y: Real) -> GoodRegion:
    """Return the violations over a grid; the continuous-time loop of the arm is stable by its exact count."""
    across, up = (each.ravel() for each in np.meshgrid(x, y))
    excess = np.full(across.size, UNSTABLE_EXCESS)
    time_constant = np.full(across.size, np.inf)
    known = np.flatnonzero(gain_map(arm, x, y).unstable == 0)
    excess[known], time_constant[known] = _of_laws(judge, goal, _entries(across[known], up[known]))
    shape = (y.size, x.size)
    return GoodRegion(x, y, excess.reshape(shape), time_constant.reshape(shape), [])
