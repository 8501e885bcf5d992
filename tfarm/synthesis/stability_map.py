"""Stability of both gains of an arm: regions of the continuous-time and the sampled loop, and their map.

Each region is a list of intervals of K2 at values of K1, with exact edges (D-decomposition); its outline has as many
values of K1 as its corners in a picture of given axes need.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm import PLANE, Arm, shown_unit
from tfarm.arm.feedback import OUTPUT_OF
from tfarm.arrays import Complex, Real
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.loop.circle_crossings import (
    GainMap,
    add_columns,
    ends_of_K1,
    refine_map,
    sampled_map,
    with_both_sides,
)
from tfarm.loop.plane import BoundaryLines, Plane, boundary_lines, gain_map, moment_axis
from tfarm.loop.plane_axes import Axis, rate_axis, rate_columns
from tfarm.loop.sampled import Sampled
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.records import frozen
from tfarm.schema import Column
from tfarm.spectrum.gains import default_gains
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.good_region import GoodRegion, map_region
from tfarm.synthesis.judge import damping_of
from tfarm.synthesis.models import continuous_model
from tfarm.synthesis.requirements import GOOD
from tfarm.synthesis.structures import Entry

# of the gain that balances a torque: 1 where the input is one, less for a motor's current
K2_RANGE = (-1.0, 1.5)
# of the same: where intervals are cut, just outside the picture: no cut is seen as an edge
CUT_RANGE = (-1.02, 1.52)
# values of the gain across, and either side of upright edges
OVERLAY_COLUMNS = 72
# values of the gain across at which the sampled region is cut, besides its exact ends
SAMPLED_COLUMNS = 120
# of the gain up the plane, beyond the picture: an edge there is none of the region
BEYOND_PICTURE = 0.1


class StableRegions(NamedTuple):
    """Both regions of one arm.  `sampled` has the arm's own C; at C = 0 also the regions with a little damping."""

    continuous: Plane
    # most damping first, so that each lies on the one before
    sampled: tuple[GainMap, ...]

    @property
    def columns(self) -> list[Column]:
        """At each value of the gain across the ends of the stable intervals of the other."""
        own = self.continuous.arm.damping
        regions = {"continuous_K2_intervals": self.continuous.stable_intervals}
        for plane in self.sampled:
            C = plane.loop.plant.arm.damping
            regions["sampled_K2_intervals" if own == C else f"sampled_at_C_{C:g}_s"] = plane.stable_intervals
        columns = [Column(PLANE[0], of=self.continuous.x)]
        for key, intervals in regions.items():
            columns.append(Column(key, of=[tuple(map(float, np.ravel(each))) for each in intervals]))
        return columns


def stable_regions(case: Case) -> StableRegions:
    """Return the regions around the gains of a case.  Raises ParameterError where it has no loop."""
    gains = case.gains
    assert gains is not None
    arm = case.arm
    # at C = 0 with a little damping too
    dampings = (arm.damping,) if arm.damping else (1e-4, 1e-6, 0.0)
    loops = [sampled_verdict(case.on(arm.with_numbers(damping=C))).full for C in dampings]
    ends = np.unique(np.concatenate([ends_of_K1(loop) for loop in loops]))
    ends = ends[ends > 0]
    ends = ends[np.diff(ends, prepend=0.0) > 1e-3 * ends]
    unit = arm.input_per_torque
    cut = unit * np.array(CUT_RANGE)
    # beyond all that is stable
    low = gains.K1 / 15.0
    top = 1.7 * max([gains.K1, *ends])
    across = with_both_sides(np.geomspace(low, top, OVERLAY_COLUMNS), ends)
    across = across[(low <= across) & (top >= across)]
    # about the width of the picture over its height
    wide = 1.8 / np.log(top / low)
    tall = np.ptp(unit * np.array(K2_RANGE))

    def drawn(K1: Real, K2: Real) -> Complex:
        return np.asarray(wide * np.log(K1) + 1j * K2 / tall)

    planes = [outline_region(loop, across, cut, drawn) for loop in loops]
    every = np.unique(np.concatenate([plane.x for plane in planes]))
    return StableRegions(gain_map(arm, every, cut), tuple(add_columns(plane, every) for plane in planes))


@lru_cache(maxsize=8)
def sampled_region(arm: Arm, x: Axis, y: Axis, chain: Chain) -> GainMap | None:
    """Return where in the picture the sampled loop is stable, with the modes of the verdict on the default gains."""
    try:
        loop = sampled_verdict(Case(arm, default_gains(arm), chain)).full
        across = with_both_sides(rate_columns(arm, x, SAMPLED_COLUMNS), ends_of_K1(loop))
        across = across[(x.low <= across) & (x.high > across)]
        up = np.array([y.low - BEYOND_PICTURE, y.high + BEYOND_PICTURE])

        def drawn(K1: Real, K2: Real) -> Complex:
            return np.asarray(1.5 * x.place(K1) + 1j * y.place(K2))

        return outline_region(loop, across, up, drawn)
    except ConvergenceError:
        return None


def outline_region(loop: Sampled, across: Real, up: Real, drawn: Callable[[Real, Real], Complex]) -> GainMap:
    """Return the sampled region cut at these K1, and between them where its outline as it is `drawn` has corners."""
    return refine_map(sampled_map(loop, across, up), drawn)


# ------------------------------------------------------------ the map


# flexible modes in the band of the damping that is drawn and designed for, as `tfarm design` has it
DESIGNED_MODES = 2
# of the coloured grid
GRID_COLUMNS = 240
GRID_ROWS = 200


@frozen
class StabilityMap:
    """The numbers of the map.

    `region` is the exact count on the coloured grid, `boundary` the exact boundary in the picture; `damping` (rows,
    columns) the least damping ratio of the first `DESIGNED_MODES` modes on the `coarse` grid, of every fourth value of
    each gain and the frame's.  `sampled` is the region of the loop sampled by a chain, None where that is not
    determined; `good` that of the requirements of the grade good, None where no gains are stable.
    """

    arm: Arm
    x: Axis
    y: Axis
    region: Plane
    boundary: BoundaryLines
    coarse: Plane
    damping: Real
    sampled: GainMap | None
    good: GoodRegion | None

    @property
    def columns(self) -> list[Column]:
        """The coarse grid with counts and damping, the boundary with its frequencies, the edge of the good region."""
        values = *np.meshgrid(*self.coarse.axes), self.coarse.unstable, self.damping
        rows: list[tuple[Any, ...]] = [
            ("grid", K1, K2, math.inf if count < 0 else int(count), ratio, "")
            for K1, K2, count, ratio in zip(*map(np.ravel, values), strict=True)
        ]
        rows += [
            ("boundary", K1, K2, "", "", omega)
            for K1, K2, omega in self.boundary.points.tolist()
            if not math.isnan(K1)
        ]
        if self.good is not None:
            for K1, intervals in zip(self.good.x.tolist(), self.good.stable_intervals, strict=True):
                rows += [("good", K1, end, "", "", "") for interval in intervals for end in interval]
        rate = "_".join(f"{PLANE[0]} {shown_unit(PLANE[0], self.arm)}".replace("/", " ").split())
        keys = "what", rate, PLANE[1], "unstable_poles", "least_damping_ratio", "omega_rad_s"
        return [Column(key, of=of) for key, of in zip(keys, zip(*rows, strict=True), strict=True)]


def stability_map(arm: Arm, chain: Chain) -> StabilityMap:
    """Return the map of an arm, its ranges chosen by J w1 and by its stability intervals."""
    x = rate_axis(arm)
    y = moment_axis(arm, x)
    found = gain_map(arm, x.grid(GRID_COLUMNS), y.grid(GRID_ROWS))
    # damping at one in four of its values
    across = np.r_[x.low, found.x[2::4], x.high]
    up = np.r_[y.low, found.y[2::4], y.high]
    coarse = gain_map(arm, across, up)
    return StabilityMap(
        arm,
        x,
        y,
        found,
        boundary_lines(found, x, y),
        coarse,
        least_damping(coarse),
        sampled_region(arm, x, y, chain),
        # where the design of the arm begins, too
        map_region(arm, chain, GOOD),
    )


def least_damping(plane: Plane) -> Real:
    """Return the least damping ratio (rows, columns) of the first modes over both gains.

    It is that of a model of eight modes: right to a few digits, more than a contour shows.
    """
    signals = tuple(OUTPUT_OF[name] for name in PLANE)
    model = continuous_model(plane.arm, signals, DESIGNED_MODES, 8, first_frequency(plane.arm))
    grids = np.meshgrid(*plane.axes)
    laws = [Entry(name, grid.reshape(1, -1)) for name, grid in zip(signals, grids, strict=True)]
    return damping_of(model, model.poles(laws)).reshape(grids[0].shape)
