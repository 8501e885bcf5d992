"""Axes of maps of the gains K1 and K2: ranges, middles of cells, linear and logarithmic scales."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tfarm.arm import RATE_GAIN, Arm
from tfarm.arrays import Real
from tfarm.loop.lines import round_on_line
from tfarm.spectrum.gains import PAPER_GAINS, default_gains, rate_unit


def ranges_of(arm: Arm) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return default ranges of K1 and K2 of a map, in the units of the rig."""
    K1 = 1.0 if arm.is_uniform else default_gains(arm).K1 / PAPER_GAINS.K1
    K2 = arm.input_per_torque
    # the stable region of the paper's arm, and around
    return (-1.0 * K1, 3.0 * K1), (-2.0 * K2, 2.0 * K2)


def cell_middles(low: float, high: float, number: int) -> Real:
    """Return the middles of `number` equal parts from low to high: none of them on a line K1 = 0 unless by chance."""
    values = low + (high - low) * (np.arange(number) + 0.5) / number
    return np.array([round_on_line(value, (low, high)) for value in values.tolist()])


@dataclass(frozen=True)
class Axis:
    """One axis of the map: linear within +-`linear`, logarithmic beyond (all linear where `linear` is infinite)."""

    low: float
    high: float
    linear: float = math.inf

    # decades that the linear part takes on each side of 0, as matplotlib's `linscale` has it
    linear_scale: ClassVar[float] = 0.5
    # factor on values there
    linear_share: ClassVar[float] = linear_scale / (1 - 1 / 10)

    @property
    def is_linear(self) -> bool:
        """Whether it is linear throughout."""
        return math.isinf(self.linear)

    def place(self, x: Real) -> Real:
        """Return places of values along the axis, 0 to 1."""
        low, high = self._stretch(np.array([self.low, self.high]))
        return np.asarray((self._stretch(np.asarray(x, float)) - low) / (high - low))

    def grid(self, number: int) -> Real:
        """Return values at `number` places of even distance."""
        low, high = self._stretch(np.array([self.low, self.high]))
        y = cell_middles(low, high, number)
        if self.is_linear:
            return y
        share = np.minimum(abs(y) / self.linear_share, 1.0)
        decades = np.maximum(abs(y) - self.linear_share, 0.0)
        return np.asarray(self.linear * np.sign(y) * share * 10.0**decades)

    def _stretch(self, x: Real) -> Real:
        """Return x where linear; else x over `linear` up to 1, then decades: matplotlib's "symlog"."""
        if self.is_linear:
            return x
        size = abs(x) / self.linear
        share = np.minimum(size, 1.0)
        decades = np.log10(np.maximum(size, 1.0))
        return np.asarray(np.sign(x) * (self.linear_share * share + decades))

    @classmethod
    def of(cls, values: Real) -> Axis:
        """Return the axis of an ascending grid (n,), nearly even on it: linear, or logarithmic from its least size."""
        low = float(values[0])
        high = float(values[-1])
        # 1e-9 of its range: by less may the steps of an even grid differ
        if np.ptp(np.diff(values)) <= 1e-9 * (high - low):
            return cls(low, high)
        return cls(low, high, float(abs(values[values != 0]).min()))


def rate_axis(arm: Arm) -> Axis:
    """Return the axis of the rate gain, just below 0 to 10 J w1, logarithmic from well below the default gain on."""
    unit = rate_unit(arm)
    linear = 10.0 ** math.floor(math.log10(default_gains(arm)[RATE_GAIN]))
    # at 10 J w1 the hub of a rigid arm slows down within 0.1/w1
    return Axis(-linear, 10 * unit, linear)


def rate_columns(arm: Arm, x: Axis, number: int) -> Real:
    """Return rate gains at `number` even places of an axis, without those unstable for any moment gain.

    A free hub is unstable where its gain exceeds the friction: 1 + L is below 0 next to s = 0, and above it far right.
    """
    across = x.grid(number)
    least = -arm.rate_loss
    if arm.has_rigid_mode:
        return across[across > least]
    return across[across != least]
