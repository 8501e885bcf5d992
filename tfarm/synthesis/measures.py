"""Margins, damping and speed of many laws at once, on a model of few modes: measures of a search.

They are those of the result card, between two points of the grid along straight lines, so that a search is quick; the
law found is examined by the exact loops, which correct what the model leaves out (`tfarm.synthesis.goals`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.loop.norms import STACKED, weight_sizes, weighted_sizes
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
from tfarm.synthesis.models import DesignModel, controllers
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

    @cached_property
    def gain_factors(self) -> tuple[Real, Real]:
        """The laws (k,) whose L passes the negative real axis, and log10 of -L there (k,)."""
        L = self.L
        is_up = L.imag > 0
        law, place = np.nonzero(is_up[:, 1:] != is_up[:, :-1])
        here = L[law, place]
        there = L[law, place + 1]
        at = here.real - here.imag / (there.imag - here.imag) * (there.real - here.real)
        # through a pole L passes infinity, and the line between the points not the value of L
        passes = (at < 0) & (-at > 0.1 * np.minimum(abs(here), abs(there)))
        law = law[passes]
        at = at[passes]
        if self.model.period is not None:
            # at z = -1, the end of the grid, L is real
            end = L.real[:, -1]
            (last,) = np.nonzero(end < 0)
            law = np.r_[law, last]
            at = np.r_[at, end[last]]
        return law, np.log10(np.maximum(-at, LEAST_SIZE))

    def gain_margin_db(self) -> Real:
        """Return the least factor on the loop gain [dB], up or down, that brings L to -1 (laws,)."""
        law, factors = self.gain_factors
        return 20 * least_of(law, abs(factors), len(self.L), np.inf)

    def gain_reduction_db(self) -> Real:
        """Return the least such factor down (laws,)."""
        law, factors = self.gain_factors
        return 20 * least_of(law[factors >= 0], factors[factors >= 0], len(self.L), np.inf)

    def phase_margin_deg(self) -> Real:
        """Return the least distance [deg] of L from -1 where abs(L) passes 1 (laws,)."""
        law, _, _, lag = gain_crossings(self.L)
        return np.degrees(least_of(law, np.minimum(lag, 2 * np.pi - lag), len(self.L), np.inf))

    def delay_margin_periods(self) -> Real:
        """Return the delay margin in sampling periods (laws,)."""
        return delay(self.model, self.L) / self.period

    def delay_margin_ms(self) -> Real:
        """Return the delay margin [ms] (laws,)."""
        return 1e3 * self.period * self.delay_margin_periods()

    def peak_sensitivity(self) -> Real:
        """Return the largest abs(S) on the grid (laws,)."""
        return np.asarray(peak_of(self.model, np.sqrt(((1 + self.L.real) ** 2 + self.L.imag**2).min(axis=1))))

    def disk_margin(self) -> Real:
        """Return the least 2 abs(1 + L)/abs(1 - L) (laws,)."""
        return disk_of(self.L).min(axis=1)

    def bandwidth_rad_s(self) -> Real:
        """Return the lowest frequency [rad/s] with abs(T) below -3 dB, as `loop_margins.bandwidth` does (laws,)."""
        omega = self.model.angles / (self.model.period or 1.0)
        size = np.log(np.maximum(abs(self.L / (1 + self.L)), LEAST_SIZE) * np.sqrt(2))
        is_below = size < 0
        n = np.where(is_below.any(axis=1), is_below.argmax(axis=1), omega.size - 1)
        before = np.maximum(n - 1, 0)
        rows = np.arange(n.size)
        high = size[rows, before]
        share = np.clip(high / np.maximum(high - size[rows, n], LEAST_SIZE), 0, 1)
        return omega[before] + share * (omega[n] - omega[before])

    def inverse_bandwidth_s(self) -> Real:
        """Return its inverse [s] (laws,)."""
        return 1 / self.bandwidth_rad_s()

    def stacked_norm(self) -> Real:
        """Return the H-infinity norm of the column of all weighted functions (laws,).

        On the grid, about the poles, and between the points of both where a parabola has its peak.
        """
        laws = len(self.poles)
        s = self.model.in_s(self.poles)
        size = abs(s)
        width = np.minimum(abs(s.real), 0.45 * size)
        # one of each pair of poles, below half the sampling rate
        counts = (s.imag >= 0) & (size + 2 * width < np.pi) & (width > 0)
        size = np.where(counts, size, 1.0)
        width = np.where(counts, width, 0.1)
        first = np.argsort(~counts, axis=1)[:, : max(1, counts.sum(axis=1).max())]
        near = size[..., None] + width[..., None] * np.linspace(-2, 2, 9)
        near = np.take_along_axis(near, first[..., None], 1)
        angles = self.model.angles
        on_grid = self.weighted(self.L, angles)
        about = self.weighted(None, near.reshape(laws, -1))
        places = peak_place(about.reshape(-1, 9), near.reshape(-1, 9)).reshape(laws, -1)
        largest = peak_place(on_grid, np.broadcast_to(angles, on_grid.shape))[:, None]
        between = self.weighted(None, np.hstack([largest, places]))
        return np.asarray(np.hstack([on_grid, about, between]).max(axis=1))

    def weighted(self, L: Complex | None, angles: Real) -> Real:
        """Return the size (laws, m) of that column at angles (m,) or (laws, m), of L if known there."""
        model = self.model
        assert model.weights is not None
        s = model.s_at(angles)
        if L is None:
            L = model.loop(self.entries, angles)
        K = dict(controllers(self.entries, s))
        if model.rate is not None:
            # the controller reads the angle in its place
            K["hub_angle"] = K.get("hub_angle", 0.0) + model.rate(np.exp(1j * angles)) * K.pop("hub_rate")
        sizes = weight_sizes(model.weights, angles.ravel() / self.period, self.period)
        own = {name: size.reshape(angles.shape) for name, size in sizes.items()}
        return weighted_sizes(L, np.stack(np.broadcast_arrays(*K.values()), axis=-2), own)[STACKED]

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


def peak_place(sizes: Real, grid: Real) -> Real:
    """Return the place (n,) of the largest of sizes (n, m) at points (n, m), by a parabola of 1/size^2."""
    middle = np.clip(sizes.argmax(axis=1), 1, sizes.shape[1] - 2)[:, None]
    three = middle + np.arange(-1, 2)
    low, at, high = np.take_along_axis(grid, three, 1).T
    before, depth, after = np.maximum(np.take_along_axis(sizes, three, 1).T, LEAST_SIZE) ** -2.0
    fall = (depth - before) / (at - low)
    bend = ((after - depth) / (high - at) - fall) / (high - low)
    slope = fall + bend * (at - low)
    way = -slope / np.where(bend > 0, 2 * bend, np.inf)
    return np.clip(at + way, low, high)
