"""The map of both gains: stability region, its boundary, damping, and the sampled region."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import GAINS, PLANE, RATE_GAIN, Arm, shown_unit, unit_of
from tfarm.arrays import Real
from tfarm.columns import Column, Table
from tfarm.digits import plain, significant
from tfarm.dsp import Chain
from tfarm.dsp import GainMap as SampledMap
from tfarm.dsp.verdict import SampledBrief
from tfarm.loop.loop import band_of
from tfarm.loop.plane import DEEPEST_MOMENT_GAIN, Axis, Plane, edge, gain_map, moment_axis, rate_axis
from tfarm.plots import plane
from tfarm.plots.regions import sampled_region
from tfarm.plots.style import blank, headline, legend_below, style
from tfarm.records import record
from tfarm.report.cases import DESIGNED_MODES, LawOnArm, best, brief_on, continuous_cases, margins_of
from tfarm.report.sections import PageSection, Picture, in_ms, typeset
from tfarm.schema import text
from tfarm.spectrum.table import default_gains, default_words, first_frequency, rate_unit
from tfarm.synthesis.design import Design
from tfarm.synthesis.judge import least_damping
from tfarm.synthesis.models import continuous_model
from tfarm.synthesis.structures import ONE, Entry

MAP_SEEN = (
    "Green: every pole is in the left half-plane{apart}; orange: the number of unstable poles. The black edge and the "
    "counts are exact, of the arm itself and no reduced model{reach}. Blue: damping ratio of the least damped pole "
    "below {band} rad/s. {proof} K1 is scaled by J ω₁ = {unit}{held}."
)
APART_FROM_HUB, WITH_INERTIA = (
    ", that of the hub angle at 0 apart",
    ", with J the inertia of what turns: hub, link and finite payload",
)
ALL_MODES, UP_TO = ", with all its infinitely many modes", ", with every crossing up to {band} rad/s"
PROOF = "The purple frame is what the Lyapunov argument proves at C = 0: K1 > 0 and K2 < 1, all of the stable region."
NO_PROOF = (
    "The dashed frame is what the Lyapunov argument proves for an arm without damping; it is not a proof here, because "
    "the gauge does not feel C. At C > 0 it proves K2 = 0 alone (solid line). The true edge is the black line."
)
SAMPLED_SEEN = (
    " Hatched: what is stable when the loop is sampled every {clock}, its edge exact for the first {modes} modes; with "
    "that clock no gains outside the hatching hold, whatever the continuous loop promises."
)
SAMPLED_NOT_SEEN = " Where the loop is stable when it is sampled every {clock} could not be settled and is not drawn."
DEPTH_WORDS = " For this map unstable windows below K2 = {deepest} were not looked for."

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
    laws: tuple[LawOnArm, ...]
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
    named = continuous_cases(arm, chain)
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
        points = (default_gains(data.arm), *([] if data.design is None else [data.design.law]))
        for law, gains, brief in zip(data.laws, points, data.briefs, strict=True):
            plane.law_mark(gains, MARKERS[law.key], f"{law.name}: {law.gains};\n{brief.short}", ax)
        if data.design is not None:
            plane.search_frame(data.design.bounds, ax)
        legend_below(figure)
        headline(figure, f"{data.arm.name}: stability region of both gains")
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


def map_section(arm: Arm, chain: Chain | None = None) -> PageSection:
    """The stability regions of both gains, continuous and sampled, and the gains that damp best."""
    data = map_of_arm(arm, chain)
    picture = Picture(
        stem="map",
        title="The plane of both gains",
        caption=_map_caption(data),
        alt="Map of K1 and K2: the stable gains, and how many poles are unstable elsewhere; how far each gain may go "
        "is said above.",
        figure=draw_map_of_arm(data),
        data=map_data(data),
    )
    words = [_intervals(arm), *([] if data.design is None else [_best_words(data, data.design)])]
    return PageSection(anchor="margins-map", title="Stability region of both gains", words=words, blocks=(picture,))


def _intervals(arm: Arm) -> str:
    """The verdict on the default gains, and the stability interval of each."""
    found = margins_of(arm, default_gains(arm))
    rows = [row for row in found.stability_intervals if row.name in PLANE]
    spans = (f"{row.name} in {text(row.intervals, 5)} {row.unit}".rstrip() for row in rows)
    return (
        f"With the default gains {typeset(default_words(arm))} the loop is {found.stability.verdict}. Stability "
        f"intervals, the other gain fixed: {'; '.join(spans)}. With < or >: no limit found up to there."
    )


def _best_words(data: MapOfArm, found: Design) -> str:
    """The gains that damp the sampled loop best, and the verdicts on them."""
    gains = ", ".join(found.law.gain_text(name, lambda gain: significant(gain, 4), data.arm) for name in PLANE)
    cut = ", ".join(name for name in found.at_bound if name not in found.at_limit)
    edge = f" That is no optimum: {cut} lies on the dotted frame, the bound of the search." * bool(cut)
    return (
        f"Best damping of the first {DESIGNED_MODES} modes of the sampled loop within the dotted frame (tfarm design): "
        f"{significant(100 * found.value, 3)} % of critical at {gains}; continuous-time loop {found.verdict.verdict}, "
        f"{data.briefs[-1].short}.{edge}"
    )


def _map_caption(data: MapOfArm) -> str:
    """The colours and lines of the map, and how far each is known."""
    arm, region, sampled = data.arm, data.region, data.sampled
    seen = MAP_SEEN.format(
        band=significant(data.band, 5),
        proof=(PROOF if arm.is_undamped else NO_PROOF) if arm.is_uniform else "",
        unit=f"{plain(rate_unit(arm), 4)} {unit_of(RATE_GAIN, arm)}",
        reach=ALL_MODES if region.is_known else UP_TO.format(band=significant(region.band, 5)),
        apart=APART_FROM_HUB * arm.has_rigid_mode,
        held=WITH_INERTIA * (not arm.has_rigid_mode),
    )
    also = SAMPLED_NOT_SEEN if sampled is None else SAMPLED_SEEN
    seen += also.format(clock=f"{in_ms(data.chain)} ms", modes=0 if sampled is None else sampled.modes_used)
    deepest = plain(DEEPEST_MOMENT_GAIN * arm.input_per_torque, 4)
    return seen + DEPTH_WORDS.format(deepest=deepest) * (not arm.loses_at_hub_alone)  # by a theorem, however deep
