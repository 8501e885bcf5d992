"""Margins, damping and speed of many laws at once, on a model of few modes: measures of a search.

They are those of the result card, between two points of the grid along straight lines, so that a search is quick; the
law found is examined by the exact loops, which correct what the model leaves out (`tfarm.synthesis.goals`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.records import frozen
from tfarm.synthesis.judge import (
    damping_of,
    delay,
    disk_of,
    dominant_time_constant,
    gain_crossings,
    least_of,
    peak_of,
)
from tfarm.synthesis.models import DesignModel
from tfarm.synthesis.structures import Entry


@frozen
class LoopMeasures:
    """The measures of laws, by their `entries`, on a model at the samples of a `period` [s], or in continuous time."""

    model: DesignModel
    entries: Sequence[Entry]
    period: float

    @cached_property
    def L(self) -> Complex:
        """The loop function (laws, m) on the grid."""
        return self.model.loop(self.entries)

    @cached_property
    def poles(self) -> Complex:
        """The closed-loop poles (laws, n)."""
        return self.model.poles(self.entries)

    @property
    def growth(self) -> Real:
        """The largest growth of a pole (laws,), below 0 where the loop is stable."""
        return np.asarray(self.model.growth(self.poles).max(axis=1))

    def gain_margin_db(self) -> Real:
        """Return the least factor on the loop gain [dB], up or down, that brings L to -1 (laws,)."""
        L = self.L
        is_up = L.imag > 0
        law, place = np.nonzero(is_up[:, 1:] != is_up[:, :-1])
        here = L[law, place]
        there = L[law, place + 1]
        at = here.real - here.imag / (there.imag - here.imag) * (there.real - here.real)
        # through a pole L passes infinity, and the line between the points not the value of L
        passes = (at < 0) & (-at > 0.1 * np.minimum(abs(here), abs(there)))
        least = least_of(law[passes], abs(np.log10(np.maximum(-at[passes], LEAST_SIZE))), len(L), np.inf)
        if self.model.period is not None:
            # at z = -1, the end of the grid, L is real
            end = L.real[:, -1]
            least = np.where(end < 0, np.minimum(least, abs(np.log10(np.maximum(-end, LEAST_SIZE)))), least)
        return 20 * least

    def phase_margin_deg(self) -> Real:
        """Return the least distance [deg] of L from -1 where abs(L) passes 1 (laws,)."""
        law, _, _, lag = gain_crossings(self.L)
        return np.degrees(least_of(law, np.minimum(lag, 2 * np.pi - lag), len(self.L), np.inf))

    def delay_margin_periods(self) -> Real:
        """Return the delay margin in sampling periods (laws,)."""
        return delay(self.model, self.L) / self.period

    def peak_sensitivity(self) -> Real:
        """Return the largest abs(S) on the grid (laws,)."""
        return np.asarray(peak_of(self.model, np.sqrt(((1 + self.L.real) ** 2 + self.L.imag**2).min(axis=1))))

    def disk_margin(self) -> Real:
        """Return the least 2 abs(1 + L)/abs(1 - L) (laws,)."""
        return disk_of(self.L).min(axis=1)

    def least_damping(self) -> Real:
        """Return the least damping ratio of the oscillating poles (laws,)."""
        return damping_of(self.model, self.poles)

    def time_constant_s(self) -> Real:
        """Return the time constant [s] of the slowest pole of stable loops (laws,)."""
        if self.model.period is not None:
            rate = -np.log(np.maximum(abs(self.poles).max(axis=1), LEAST_SIZE)) / self.model.period
        else:
            rate = -self.poles.real.max(axis=1)
        return 1 / np.maximum(rate, LEAST_SIZE)

    def dominant_time_constant(self, first: float) -> Real:
        """Return the time constant [s] of the slowest pole below twice the `first` frequency [rad/s] (laws,)."""
        return dominant_time_constant(self.model, self.poles, first)

    def of(self, name: str) -> Real:
        """Return the measure of that name (laws,)."""
        measure: Callable[[], Real] = getattr(self, name)
        return measure()
