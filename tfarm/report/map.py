"""The map of both gains: where the exact loop is stable, what its boundary is made of, how well modes are damped."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import GAINS, PLANE, Arm, shown_unit
from tfarm.arrays import Real
from tfarm.columns import Column, Table
from tfarm.comparing.regions import sampled_region
from tfarm.dsp import Chain
from tfarm.dsp import GainMap as SampledMap
from tfarm.dsp.verdict import SampledBrief
from tfarm.loop.loop import band_of
from tfarm.loop.plane import Axis, Plane, edge, gain_map, moment_axis, rate_axis
from tfarm.plots import plane
from tfarm.plots.style import blank, headline, legend_below, style
from tfarm.records import record
from tfarm.report.loop_laws import DESIGNED_MODES, NamedLaw, best, brief_on, laws
from tfarm.spectrum.scales import first_frequency
from tfarm.synthesis.design import Design
from tfarm.synthesis.models import continuous_model
from tfarm.synthesis.objectives import least_damping
from tfarm.synthesis.structures import ONE, Entry

if TYPE_CHECKING:
    from tfarm.plots.style import Figure


GRID_COLUMNS, GRID_ROWS = 240, 200  # of the coloured grid
MARKERS = {"default": plane.DIAMOND, "best": plane.STAR}
DAMPING_EVERY = 4  # every so many of them the damping is computed
DAMPING_MODES = 8  # of the model whose poles that is of: it is right to a few digits, more than a contour shows
GAINS_AT_ONCE = 500  # of them: memory, whatever the grid


@dataclass(frozen=True)
@record
class MapOfArm:
    """What the map shows.

    `region` is the exact count on the coloured grid, `edge` (n, 3) the exact boundary, both gains and w, within the
    picture with rows of nan where it leaves it; `damping` (rows, columns) the least damping ratio of the first
    `DESIGNED_MODES` modes at `axes`, every fourth value of each gain on the grid and the frame's; `design` the best
    gains for the sampled loop.  `sampled` is where the loop is stable at the clock of `chain` too, None where that
    could not be settled; `briefs` are the sampled verdicts on the laws.
    """

    arm: Arm
    x: Axis
    y: Axis
    region: Plane
    edge: Real
    axes: tuple[Real, Real]
    damping: Real
    laws: tuple[NamedLaw, ...]
    design: Design | None
    chain: Chain
    sampled: SampledMap | None
    briefs: tuple[SampledBrief, ...]

    @property
    def is_undamped(self) -> bool:
        """Whether C = 0."""
        return self.arm.is_undamped

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """Unstable poles on the grid of the damping."""
        return np.asarray(gain_map(self.arm, *self.axes).unstable)

    @property
    def band(self) -> float:
        """Below which [rad/s] the damping is the least."""
        return band_of(self.arm, DESIGNED_MODES)


def map_of_arm(arm: Arm, chain: Chain | None = None) -> MapOfArm:
    """The map of an arm, its ranges chosen by J w1 and by the windows that it has; without a chain at 10 ms."""
    chain = Chain() if chain is None else chain
    x = rate_axis(arm)
    y = moment_axis(arm, x)
    found = gain_map(arm, x.grid(GRID_COLUMNS), y.grid(GRID_ROWS))
    half = DAMPING_EVERY // 2
    across, up = (
        np.r_[axis.low, each[half::DAMPING_EVERY], axis.high] for axis, each in zip((x, y), found.axes, strict=True)
    )
    points = np.reshape(np.meshgrid(across, up), (2, -1))
    damping = _damping(arm, points).reshape(up.size, across.size)
    named = laws(arm, chain)
    briefs = tuple(brief_on(arm, each.law, chain) for each in named)
    sampled = sampled_region(arm, x, y, chain)
    return MapOfArm(
        arm, x, y, found, edge(found, x, y), (across, up), damping, named, best(arm, chain), chain, sampled, briefs
    )


def _damping(arm: Arm, points: Real) -> Real:
    """The least damping ratio (n,) at points (2, n) of the plane, by poles of a modal model."""
    signals = tuple(each.output for name in PLANE for each in GAINS if each.name == name)
    model = continuous_model(arm, signals, DESIGNED_MODES, DAMPING_MODES, first_frequency(arm))
    parts = np.array_split(points, math.ceil(points.shape[1] / GAINS_AT_ONCE), axis=1)
    laws = ([Entry(name, row[None], ONE) for name, row in zip(signals, part, strict=True)] for part in parts)
    return np.concatenate([least_damping(model, law) for law in laws])


def draw_map_of_arm(data: MapOfArm) -> Figure:
    """Both gains: the count, its boundary, the damping, what sampling leaves, Lyapunov's frame, and the laws."""
    found, x, y = data.region, data.x, data.y
    with style():
        figure = blank(9.0, 6.2)
        ax = figure.subplots()
        plane.ground(found, x, y, ax)
        plane.contours(*data.axes, np.where(data.counts == 0, data.damping, np.nan), ax)
        plane.draw_boundary(found, data.edge, x, y, ax)
        plane.draw_sampled(data.sampled, ax)
        if data.arm.is_uniform:
            plane.draw_proven(data.arm, x, y, ax)
        for law, brief in zip(data.laws, data.briefs, strict=True):
            plane.law_mark(law.law, MARKERS[law.key], f"{law.name}: {law.gains};\n{brief.short}", ax)
        if data.design is not None:
            plane.search_frame(data.design.bounds, ax)
        plane.count_labels(found, x, y, ax)
        legend_below(figure)
        headline(figure, f"{data.arm.name}: how high may the gains go?")
    return figure


def map_data(data: MapOfArm) -> Table:
    """The grid with counts and damping, the boundary with its frequencies, then the ends of the sampled intervals.

    Ends that are cut by the picture are left out.
    """
    grid = [each.ravel() for each in np.meshgrid(*data.axes)]
    edge = data.edge[~np.isnan(data.edge[:, 0])] if data.edge.size else data.edge
    ends: list[tuple[float, float]] = []
    if data.sampled is not None:
        for across, windows in zip(data.sampled.axes[0], data.sampled.stable_intervals, strict=True):
            ends += [(float(across), end) for window in windows for end in window if data.y.low <= end <= data.y.high]
    sampled = np.array(ends).reshape(-1, 2)
    counts: list[float | int | str] = [math.inf if count < 0 else int(count) for count in data.counts.ravel()]
    none: list[float | int | str] = [""]
    beyond = len(edge) + len(sampled)
    across, up = PLANE
    key = "_".join([across, *shown_unit(across, data.arm).replace("/", " ").split()])
    what = ["grid"] * grid[0].size + ["boundary"] * len(edge) + ["sampled boundary"] * len(sampled)
    columns = (
        Column("what", "what", of=what),
        Column(key, across, shown_unit(across, data.arm), of=np.r_[grid[0], edge[:, 0], sampled[:, 0]]),
        Column(up, up, shown_unit(up, data.arm), of=np.r_[grid[1], edge[:, 1], sampled[:, 1]]),
        Column("unstable_poles", "unstable poles", of=counts + none * beyond),
        Column("least_damping_ratio", "least damping ratio", of=[*data.damping.ravel().tolist(), *none * beyond]),
        Column("omega_rad_s", "frequency", "rad/s", of=none * grid[0].size + edge[:, 2].tolist() + none * len(sampled)),
    )  # fmt: skip
    return Table(stem="map-data", title=f"The map of {' and '.join(PLANE)}", columns=columns)
