"""Stability regions of both gains of one arm, continuous-time and sampled, as a picture of given axes shows them.

Each region is a list of intervals of K2 at values of K1, with exact edges (D-decomposition); its outline has as many
values of K1 as its corners in that picture need.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from tfarm.arm import PLANE, Arm, HubFeedback
from tfarm.arm.chain import Chain
from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.loop.circle_crossings import GainMap, ends_of_K1, rounded_map, sampled_map, with_both_sides, with_more
from tfarm.loop.plane import Axis, Plane, gain_map, rate_columns
from tfarm.loop.sampled import Sampled
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.schema import Column
from tfarm.spectrum.table import default_gains

K2_RANGE = (-1.0, 1.5)  # of the gain that balances a torque: 1 where the input is one, less for a motor's current
CUT_RANGE = (-1.02, 1.52)  # of the same: where intervals are cut, just outside the picture: no cut is seen as an edge
OVERLAY_COLUMNS = 72  # values of the gain across, and either side of upright edges
SAMPLED_COLUMNS = 120  # values of the gain across at which the sampled region is cut, besides its exact ends
BEYOND_PICTURE = 0.1  # of the gain up the plane, beyond the picture: an edge there is none of the region


class StableRegions(NamedTuple):
    """Both regions of one arm.  `sampled` has the arm's own C; at C = 0 also the regions with a little damping."""

    continuous: Plane
    sampled: tuple[GainMap, ...]  # most damping first, so that each lies on the one before

    @property
    def columns(self) -> list[Column]:
        """At each value of the gain across the ends of the stable intervals of the other."""
        own = self.continuous.arm.damping
        regions = {"continuous_K2_intervals": self.continuous.stable_intervals}
        for plane in self.sampled:
            C = plane.loop.plant.arm.damping
            regions["sampled_K2_intervals" if own == C else f"sampled_at_C_{C:g}_s"] = plane.stable_intervals
        return [
            Column(PLANE[0], of=self.continuous.x),
            *(Column(key, of=[tuple(map(float, np.ravel(x))) for x in each]) for key, each in regions.items()),
        ]


def stable_regions(arm: Arm, gains: HubFeedback, chain: Chain) -> StableRegions:
    """Return the regions around these gains.  Raises ParameterError where the arm has no loop."""
    # at C = 0 with a little damping too
    dampings = (arm.damping,) if arm.damping else (1e-4, 1e-6, 0.0)
    loops = [sampled_verdict(arm.having(damping=C), gains, chain).full for C in dampings]
    ends = np.unique(np.concatenate([ends_of_K1(loop) for loop in loops]))
    ends = ends[ends > 0]
    ends = ends[np.diff(ends, prepend=0.0) > 1e-3 * ends]
    span, cut = (arm.input_per_torque * np.array(ends) for ends in (K2_RANGE, CUT_RANGE))
    # beyond all that is stable
    low, top = gains.K1 / 15.0, 1.7 * max([gains.K1, *ends])
    across = with_both_sides(np.geomspace(low, top, OVERLAY_COLUMNS), ends)
    # about the width of the picture over its height
    wide = 1.8 / np.log(top / low)

    def drawn(K1: Real, K2: Real) -> Complex:
        return np.asarray(wide * np.log(K1) + 1j * K2 / np.ptp(span))

    planes = [outlined(loop, across[(low <= across) & (top >= across)], cut, drawn) for loop in loops]
    every = np.unique(np.concatenate([plane.x for plane in planes]))
    return StableRegions(gain_map(arm, every, cut), tuple(with_more(plane, every) for plane in planes))


@lru_cache(maxsize=8)
def sampled_region(arm: Arm, x: Axis, y: Axis, chain: Chain) -> GainMap | None:
    """Return where in the picture the sampled loop is stable, with the modes of the verdict on the default gains."""
    try:
        loop = sampled_verdict(arm, default_gains(arm), chain).full
        across = with_both_sides(rate_columns(arm, x, SAMPLED_COLUMNS), ends_of_K1(loop))
        across = across[(x.low <= across) & (x.high > across)]
        up = np.array([y.low - BEYOND_PICTURE, y.high + BEYOND_PICTURE])
        return outlined(loop, across, up, lambda K1, K2: np.asarray(1.5 * x.place(K1) + 1j * y.place(K2)))
    except ConvergenceError:
        return None


def outlined(loop: Sampled, across: Real, up: Real, drawn: Callable[[Real, Real], Complex]) -> GainMap:
    """Return the sampled region cut at these K1, and between them where its outline as it is `drawn` has corners."""
    return rounded_map(sampled_map(loop, across, up), drawn)
