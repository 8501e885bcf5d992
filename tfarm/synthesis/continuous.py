"""Gains judged by the continuous loop of the exact arm: no clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tfarm.arm import Arm, HubFeedback, as_law, law_of, laws_at
from tfarm.arrays import Real
from tfarm.dsp import Slew
from tfarm.errors import ConvergenceError
from tfarm.loop.damping import least_damping
from tfarm.loop.frequencies import band_of, grid
from tfarm.loop.loop import Loop
from tfarm.loop.margins import disk_at
from tfarm.loop.plane import gain_map
from tfarm.loop.residual import residual_moment
from tfarm.loop.stability import stability
from tfarm.records import record
from tfarm.spectrum import modes as natural_modes
from tfarm.synthesis.search import TIE, Bounds, Effort, GainAxis, Score

POINTS_A_BASIN = 6  # points of the grid in each basin of a residual


@dataclass(frozen=True)
@record
class ContinuousJudge:
    """What both gains are worth without a clock, beside those of `held`; the `slew` is made for the arm `known`."""

    arm: Arm
    objective: str
    held: HubFeedback
    modes: int
    known: Arm
    slew: Slew

    def effort(self, up: Bounds) -> Effort:
        """A residual has as many basins along the moment gain as its modes' frequencies run through slews.

        Feeding back a share k of the moment makes of the hub one of inertia I_h/(1 - k); from k = 1 on it stands still.
        """
        if self.objective == "margin":  # the one that is dear
            return Effort(24, 24, 4)
        if self.objective == "damping":  # which has few basins
            return Effort(32, 36, 12)
        starts = max(6, 80 // self.modes)
        shares = (1 - gain / self.arm.input_per_torque for gain in up)
        hubs = (self.arm.hub_inertia / share if share > 0 else math.inf for share in shares)
        ends = [
            natural_modes(self.arm.having(hub_inertia=I), self.modes).natural_frequency[-self.modes :] for I in hubs
        ]
        basins = float(abs(ends[0] - ends[1]).max()) * self.slew.rise_time / (4 * math.pi)
        return Effort(36, int(min(max(60.0, POINTS_A_BASIN * basins), max(60, 1600 // self.modes))), starts)

    def landscape(self, axes: tuple[GainAxis, GainAxis], effort: Effort) -> tuple[Real, Score]:
        """Scores over the grid, rows upwards, inf where not stable; and the score where its nearest point is stable."""
        gains = [axis.gain(axis.middles(number)) for axis, number in zip(axes, effort[:2], strict=True)]
        stable = gain_map(self.arm, gains[0], gains[1], self.held.Kp).stable
        grid = np.array(np.meshgrid(*gains))
        values = np.full(stable.shape, np.inf)
        if stable.any():
            values[stable] = self.score(grid[:, stable])

        def inside(points: Real) -> Real:
            places = [
                np.clip((axis.share(gain) * number).astype(int), 0, number - 1)
                for axis, gain, number in zip(axes, points, stable.shape[::-1], strict=True)
            ]
            good = stable[places[1], places[0]]
            found = np.full(good.size, np.inf)
            if good.any():
                found[good] = self.score(points[:, good])
            return found

        return values, inside

    def score(self, points: Real) -> Real:
        """What is minimised, at points (2, n) of the plane."""
        laws = laws_at(self.held, points)
        if self.objective == "damping":
            return -least_damping(self.arm, laws, self.modes)
        if self.objective == "residual":
            turn = self.slew.travel_of(self.known.reach) / self.known.reach
            return residual_moment(self.arm, laws, self.modes, self.known, rise=self.slew.rise_time, turn=turn)
        size = np.array([self._disk(law_of(law)) for law in laws.T])
        return np.asarray(-size - TIE * least_damping(self.arm, laws, self.modes))

    def holds(self, law: HubFeedback) -> bool:
        """Whether the loop is stable by its own verdict."""
        try:
            return stability(self.arm, law).is_stable
        except ConvergenceError:  # on the edge
            return False

    def value(self, law: HubFeedback, score: float) -> float:
        """The damping ratio, disk margin, or residual moment [N m] of a law of that score."""
        if self.objective == "margin":
            return self._disk(law)
        return score if self.objective == "residual" else -score

    @cached_property
    def _omega(self) -> Real:
        return np.asarray(grid(self.arm, band_of(self.arm, self.modes)))

    def _disk(self, law: HubFeedback) -> float:
        return float(disk_at(Loop(self.arm, as_law(law)), self._omega).min())
