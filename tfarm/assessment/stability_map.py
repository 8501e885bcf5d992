"""The map of both gains of an arm: unstable poles with their exact boundary, least damping, and the sampled region."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tfarm.arm import GAINS, PLANE, Arm, shown_unit
from tfarm.arrays import Real
from tfarm.dsp import Chain
from tfarm.loop.circle_crossings import GainMap
from tfarm.loop.plane import Axis, Plane, edge, gain_map, moment_axis, rate_axis
from tfarm.loop.regions import sampled_region
from tfarm.records import record
from tfarm.schema import Column
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.judge import damping_of
from tfarm.synthesis.models import continuous_model
from tfarm.synthesis.structures import ONE, Entry

DESIGNED_MODES = 2  # flexible modes in the band of the damping that is drawn and designed for, as `tfarm design` has it
GRID_COLUMNS, GRID_ROWS = 240, 200  # of the coloured grid


@dataclass(frozen=True)
@record
class StabilityMap:
    """The numbers of the map.

    `region` is the exact count on the coloured grid, `edge` (n, 3) the exact boundary, both gains and w, within the
    picture with rows of nan where it leaves it; `damping` (rows, columns) the least damping ratio of the first
    `DESIGNED_MODES` modes on the `coarse` grid, of every fourth value of each gain and the frame's.  `sampled` is the
    region of the loop sampled by a chain, None where that is not determined.
    """

    arm: Arm
    x: Axis
    y: Axis
    region: Plane
    edge: Real
    coarse: Plane
    damping: Real
    sampled: GainMap | None

    @property
    def columns(self) -> list[Column]:
        """The coarse grid with counts and damping, then the boundary with its frequencies."""
        values = *np.meshgrid(*self.coarse.axes), self.coarse.unstable, self.damping
        rows: list[tuple[Any, ...]] = [
            ("grid", K1, K2, math.inf if count < 0 else int(count), ratio, "")
            for K1, K2, count, ratio in zip(*map(np.ravel, values), strict=True)
        ]
        rows += [("boundary", K1, K2, "", "", omega) for K1, K2, omega in self.edge.tolist() if not math.isnan(K1)]
        rate = "_".join([PLANE[0], *shown_unit(PLANE[0], self.arm).replace("/", " ").split()])
        keys = "what", rate, PLANE[1], "unstable_poles", "least_damping_ratio", "omega_rad_s"
        return [Column(key, of=of) for key, of in zip(keys, zip(*rows, strict=True), strict=True)]


def stability_map(arm: Arm, chain: Chain) -> StabilityMap:
    """Return the map of an arm, its ranges chosen by J w1 and by its stability intervals."""
    x = rate_axis(arm)
    y = moment_axis(arm, x)
    found = gain_map(arm, x.grid(GRID_COLUMNS), y.grid(GRID_ROWS))
    # damping at one in four of its values
    across, up = (np.r_[axis.low, each[2::4], axis.high] for axis, each in zip((x, y), found.axes, strict=True))
    coarse = gain_map(arm, across, up)
    sampled = sampled_region(arm, x, y, chain)
    return StabilityMap(arm, x, y, found, edge(found, x, y), coarse, least_damping(coarse), sampled)


def least_damping(plane: Plane) -> Real:
    """Return the least damping ratio (rows, columns) of the first modes over both gains.

    It is that of a model of eight modes: right to a few digits, more than a contour shows.
    """
    signals = tuple(each.output for name in PLANE for each in GAINS if each.name == name)
    model = continuous_model(plane.arm, signals, DESIGNED_MODES, 8, first_frequency(plane.arm))
    points = np.reshape(np.meshgrid(*plane.axes), (2, -1))
    found = []
    # five hundred points at a time for memory, whatever the grid
    for part in np.array_split(points, math.ceil(points.shape[1] / 500), axis=1):
        law = [Entry(name, row[None], ONE) for name, row in zip(signals, part, strict=True)]
        found.append(damping_of(model, model.poles(law)))
    return np.concatenate(found).reshape(plane.y.size, plane.x.size)
