"""Where to look along the imaginary axis, and how far up: the frequencies at which a loop function is steep.

Along s = i w the loop function is steep at the arm's natural frequencies, at those with the hub locked (zeros of the
hub angle) and with the hub free of inertia (zeros of the root moment); at small C these features are as narrow as C
w^2. So a grid has points at geometric distances around each.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from tfarm.arm import Arm
from tfarm.spectrum import flexible_frequencies, modes, modes_below
from tfarm.spectrum.frequencies import ARMS_KEPT

NEAREST_TO_STEEP, FARTHEST_FROM_STEEP = 1e-10, 0.06  # distances from a steep place, as shares of its frequency
POINTS_BESIDE_STEEP = 14  # of a grid on either side of a steep place, one and a half a decade
POINTS_BETWEEN_STEEP = 24  # and between two of them
STEEP_BEYOND = 1.05  # of the end of a grid: the points of steep places up to there reach below it
SLOWEST = 1e-6  # of the first steep place: where a grid begins, as nothing bends there
POINTS_BELOW_STEEP = 60  # from there to that place, ten a decade
QUIET_REACH = 100.0  # bands up to which |L| is looked at beyond a band: two decades of its fall
MOST_RESONANCES = 2000  # looked at in them: 20 ms
MOST_BAND_MODES = 150  # flexible: what is not settled within so many is left open


@lru_cache(maxsize=ARMS_KEPT)
def steep_places(arm: Arm, up_to: float) -> Any:
    """Natural frequencies [rad/s] with the arm's own hub, with a locked one and with none, ascending; read-only."""
    pin = replace(arm, hub=replace(arm.hub, inertia=0.0, friction=0.0, stiffness=0.0), motor=None, input="hub_torque")
    others = (arm, arm.having(hub_inertia=math.inf), pin)
    places = np.unique(np.concatenate([flexible_frequencies(each, up_to) for each in others]))
    places.flags.writeable = False
    return places


@lru_cache(maxsize=ARMS_KEPT)
def grid(arm: Arm, up_to: float) -> Any:
    """Frequencies [rad/s] from a millionth of the first natural one to `up_to`, dense at steep places; read-only."""
    places = np.asarray(steep_places(arm, STEEP_BEYOND * up_to))
    lowest = SLOWEST * min(up_to, places[0] if places.size else up_to)
    away = np.geomspace(NEAREST_TO_STEEP, FARTHEST_FROM_STEEP, POINTS_BESIDE_STEEP)
    close = (places[:, None] * (1 + np.r_[-away[::-1], away])).ravel()
    corners = np.r_[lowest, places[places < up_to], up_to]
    between = np.concatenate(
        [np.linspace(a, b, POINTS_BETWEEN_STEEP, endpoint=False) for a, b in itertools.pairwise(corners)]
    )
    slow = np.geomspace(lowest, corners[1], POINTS_BELOW_STEEP)
    omega = np.unique(np.concatenate([close, between, slow]))
    omega = np.append(omega[(omega >= lowest) & (omega < up_to)], up_to)
    omega.flags.writeable = False
    return omega


@lru_cache(maxsize=ARMS_KEPT)
def band_of(arm: Arm, number: int) -> float:
    """A frequency [rad/s] half-way between two natural ones, with so many flexible modes below."""
    omega = modes(arm, number + 1).natural_frequency
    return float((omega[-1] + omega[-2]) / 2)


@lru_cache(maxsize=ARMS_KEPT)
def quiet_places(arm: Arm, band: float, points: int) -> Any:
    """Frequencies [rad/s] in two decades from a band on, where a damped loop is seen to be quiet or not; read-only.

    So many at equal ratios, and the natural ones, the first `MOST_RESONANCES`, up to where bending is overdamped, 2/C
    of the segment with the least C: a resonance narrower than their spacing would stand between them.
    """
    places = band * np.geomspace(1.0, QUIET_REACH, points)
    if arm.least_damping:
        first, last = (modes_below(arm, min(end, 2 / arm.least_damping)) for end in (band, QUIET_REACH * band))
        many = min(last - first, MOST_RESONANCES)
        if many:
            places = np.unique(np.r_[places, modes(arm, first + many).natural_frequency[-many:]])
    places.flags.writeable = False
    return places
