"""Gains K1 and K2 with which both loops meet the requirements of the grade *good*, and the fastest of them.

The requirements are measured on a grid of gains on models of few modes (`measures`); between its points the border is
along straight lines.  It is approximate; the gains recommended are examined by the exact loops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from tfarm.arm import PLANE, Arm, HubFeedback
from tfarm.arm.feedback import OUTPUT_OF, TWO_GAINS
from tfarm.arrays import Real
from tfarm.crossing import Window
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.plane import gain_map
from tfarm.loop.plane_axes import Axis
from tfarm.records import frozen
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.goals import Checked, Goal, check
from tfarm.synthesis.judge import Judge, of_laws
from tfarm.synthesis.measures import LoopMeasures
from tfarm.synthesis.models import DesignModel
from tfarm.synthesis.required import RequirementTask
from tfarm.synthesis.requirements import GOOD
from tfarm.synthesis.structures import Entry, structure_of
from tfarm.synthesis.worst_case import NamedArm

# columns and rows of the grid over the map, and of the finer one around the region
COARSE_GRID = (40, 50)
FINE_GRID = (60, 44)
# of unstable loops: as without any gain margin
UNSTABLE_EXCESS = 1.0


@frozen
class RequiredGains:
    """Gains with the requirements and their exact values in both loops."""

    law: HubFeedback
    requirements: tuple[Checked, ...]

    @property
    def is_met(self) -> bool:
        """Whether the exact loops meet all requirements."""
        return all(each.violation <= 0 for each in self.requirements)

    @property
    def missed(self) -> list[Checked]:
        """The requirements that are not met."""
        return [each for each in self.requirements if each.violation > 0]


@frozen
class GoodRegion:
    """The largest violation of the requirements, `excess` (rows, columns), at gains `x` across and `y` up.

    `time_constant` [s] is that of the dominant pole of the sampled loop; inf where a loop is unstable.
    """

    judge: Judge
    goal: Goal
    x: Real
    y: Real
    excess: Real
    time_constant: Real

    @property
    def met(self) -> Any:
        """Points (rows, columns) at which all requirements are met."""
        return self.excess <= 0

    @property
    def stable_intervals(self) -> list[list[Window]]:
        """For each x the intervals of y in which all requirements are met."""
        return [_intervals(self.y, column) for column in self.excess.T]

    @cached_property
    def recommended(self) -> RequiredGains:
        """The gains that meet all requirements, by the exact loops, with the fastest poles of the first mode.

        Where none do, those with the least violation.
        """
        # gains of rate feedback: without it the requirements are met by no controller too
        excess = np.where(self.x > 0, self.excess, np.inf)
        # the exact loops have a little less than the models
        for slack in (0.005, 0.03, 0.1, 0.2):
            inside = excess <= -slack
            if not inside.any():
                break
            chosen = self._checked(int(np.where(inside, self.time_constant, np.inf).argmin()))
            if chosen.is_met:
                return chosen
        return self._checked(int(excess.argmin()))

    def _checked(self, place: int) -> RequiredGains:
        """Return the gains at a place of the grid with exact values."""
        row, column = np.unravel_index(place, self.excess.shape)
        # digits of a gain that is typed
        K1, K2 = (float(f"{value:.4g}") for value in (self.x[column], self.y[row]))
        law = HubFeedback(K1=K1, K2=K2)
        arm = self.judge.known
        rows, _ = check(self.goal, arm, self.judge.chain, NamedArm(arm.name, arm, {}), law)
        return RequiredGains(law, tuple(rows))


def _intervals(y: Real, excess: Real) -> list[Window]:
    """Return the intervals of y (n,) with an excess (n,) of at most 0, along straight lines."""
    met = excess <= 0
    ends = np.flatnonzero(met[1:] != met[:-1])
    share = excess[ends] / (excess[ends] - excess[ends + 1])
    edges = (y[ends] + share * np.diff(y)[ends]).tolist()
    if met[0]:
        edges.insert(0, float(y[0]))
    if met[-1]:
        edges.append(float(y[-1]))
    return list(zip(edges[::2], edges[1::2], strict=True))


@lru_cache(maxsize=8)
def good_region(arm: Arm, x: Axis, y: Axis, chain: Chain) -> GoodRegion | None:
    """Return the region in a picture of these axes; None where it has no stable gains or no models.

    A coarse grid finds it, a finer one around it has its border.
    """
    try:
        form = structure_of(TWO_GAINS, arm, Kp=0.0, modes=2, period=chain.sampling.period, bounds={})
        task = RequirementTask(arm, GOOD, "time_constant_s", form, 2, chain, lambda *_: None)
        judge = task.judge(arm, task.goal, 0)
        found = _measured(judge, task.goal, arm, x.grid(COARSE_GRID[0]), _with_zero(y.grid(COARSE_GRID[1])))
        if found.excess.min() >= UNSTABLE_EXCESS:
            return None
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
            if not is_coarse and not (_goes_on(x, found.x, across) or _goes_on(y, found.y, up)):
                break
        return found
    except (ConvergenceError, ParameterError):
        return None


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


def _entries(x: Real, y: Real) -> list[Entry]:
    """Return the entries of the gains of a grid, row by row."""
    grids = np.meshgrid(x, y)
    return [Entry(OUTPUT_OF[name], grid.reshape(1, -1)) for name, grid in zip(PLANE, grids, strict=True)]


def _stable(entries: Sequence[Entry], laws: Any, models: Sequence[DesignModel]) -> Any:
    """Return those of the laws that are stable on all models."""
    for model in models:
        if laws.size:
            laws = laws[model.growth(model.poles(of_laws(entries, laws))).max(axis=1) < 0]
    return laws


def _measured(judge: Judge, goal: Goal, arm: Arm, x: Real, y: Real) -> GoodRegion:
    """Return the violations over a grid; the continuous-time loop of the arm is stable by its exact count."""
    entries = _entries(x, y)
    known = np.flatnonzero(gain_map(arm, x, y).unstable == 0)
    left = _stable(entries, known, (judge.model, judge.also[0]))
    excess = np.full(x.size * y.size, UNSTABLE_EXCESS)
    time_constant = np.full(x.size * y.size, np.inf)
    # of some laws at once: each has some thousand points of L
    for some in np.array_split(left, left.size // 100 + 1):
        if some.size:
            own = of_laws(entries, some)
            sampled = LoopMeasures(judge.model, own, judge.chain.sampling.period)
            worst = np.max(goal.violations(judge, sampled), axis=0)
            excess[some] = np.minimum(worst, UNSTABLE_EXCESS)
            time_constant[some] = sampled.dominant_time_constant(first_frequency(arm))
    shape = (y.size, x.size)
    return _stable_on_all(GoodRegion(judge, goal, x, y, excess.reshape(shape), time_constant.reshape(shape)))


def _stable_on_all(found: GoodRegion) -> GoodRegion:
    """Return the region without gains that are unstable by the large models of an arm without damping."""
    met = np.flatnonzero(found.met)
    stable = _stable(_entries(found.x, found.y), met, found.judge.also[1:])
    excess = found.excess.copy()
    excess.ravel()[np.setdiff1d(met, stable)] = UNSTABLE_EXCESS
    return replace(found, excess=excess)
