"""The map of both gains: stability region, its boundary, damping, and the sampled region."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import GAINS, MOMENT_GAIN, PLANE, RATE_GAIN, Arm, shown_unit, unit_of, written_unit
from tfarm.arrays import Real
from tfarm.columns import Column, Table
from tfarm.digits import plain, significant
from tfarm.dsp import Chain
from tfarm.dsp import GainMap as SampledMap
from tfarm.dsp.verdict import SampledBrief
from tfarm.loop.loop import band_of
from tfarm.loop.plane import DEEPEST_MOMENT_GAIN, Axis, Plane, edge, gain_map, moment_axis, rate_axis
from tfarm.loop.windows import Windows
from tfarm.plots import plane
from tfarm.plots.regions import sampled_region
from tfarm.plots.style import blank, headline, legend_below, style
from tfarm.records import record
from tfarm.report.cases import DESIGNED_MODES, LawOnArm, best, brief_on, continuous_cases, margins_of
from tfarm.report.sections import PageSection, Picture, typeset
from tfarm.spectrum.table import default_gains, default_words, first_frequency, rate_unit
from tfarm.synthesis.design import Design
from tfarm.synthesis.models import continuous_model
from tfarm.synthesis.objectives import least_damping
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
OF_ELASTIC = (
    "Lyapunov's argument proves all with K1 > {least} and K2 < {whole}: the links are elastic, and what hub, clamp and "
    "joint lose only adds to K1."
)
OF_DAMPED = "At C > 0 Lyapunov's argument proves K2 = 0 alone, as the gauge does not feel C; the edge is computed."
OF_OTHER_GAUGE = (
    "The gauge does not read the moment on the hub, so Lyapunov's argument proves K2 = 0 alone; the edge is computed."
)
OF_LAG = "The voltage comes late through an inductance, so Lyapunov's argument proves nothing; the edge is computed."
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


def map_section(arm: Arm, chain: Chain | None = None) -> PageSection:
    """How high may the gains go?  And how high when the loop is sampled by the chain's clock?"""
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
    words = (_answer(arm), _best_words(data))
    return PageSection(
        anchor="margins-map", title="How high may the gains go?", words=[w for w in words if w], blocks=(picture,)
    )


def _answer(arm: Arm) -> str:
    """The windows of both gains through the default ones, in words."""
    found = margins_of(arm, default_gains(arm))
    start = f"With the default gains {typeset(default_words(arm))} the loop is {found.stability.verdict}"
    across, up = PLANE
    if any(found.windows[name].around is None for name in PLANE):
        return f"{start}; the picture shows which gains are stable."
    many = len(found.windows[up].all)
    again = f" {up} has {many} separate stable windows at that {across}, listed below." if many > 1 else ""
    more = {name: _room(found.windows[name], written_unit(name, arm)) for name in PLANE}
    return f"{start}: at that {across}, {up} may {more[up]}; at that {up}, {across} may {more[across]}.{again}"


def _room(windows: Windows, unit: str) -> str:
    """How far a gain may go up and down: to an edge and what happens there, to where the search ends, or anywhere."""
    assert windows.around is not None
    ways = []
    for value, way in zip(reversed(windows.around), ("up", "down"), strict=True):
        place = f"{plain(value, 5)}{unit}"
        if windows.end(value) == "no limit":
            ways.append(f"go {way} without limit")
        elif windows.end(value) == "search bound":
            ways.append(f"go {way} with no limit found as far as {place}")
        else:
            ways.append(f"go {way} to {place}{_crossing_there(windows, value)}")
    return ", and may ".join(ways)


def _crossing_there(windows: Windows, value: float) -> str:
    """What reaches the axis at that edge."""
    crossing = next((each for each in windows.crossings if each.t == value), None)
    if crossing is None:
        return ""
    if crossing.at == 0:
        return ", where a real pole passes through 0"
    if not np.isfinite(crossing.at):
        return ", where every flexible mode crosses at once"
    return f", where poles cross at {significant(crossing.at, 4)} rad/s"


def _best_words(data: MapOfArm) -> str:
    found = data.design
    if found is None:
        return ""
    cut = " and ".join(
        found.law.told(name, lambda gain: plain(gain, 4)) for name in found.at_bound if name not in found.at_limit
    )
    gains = " and ".join(found.law.told(name, lambda gain: significant(gain, 4), data.arm) for name in PLANE)
    brief = data.briefs[-1]
    words = typeset(brief.words)
    sampled = f"{words[0].upper()}{words[1:]}" if brief.is_stable else f"But {words}"
    edge = f" That is no optimum: the dotted frame cuts the search off at {cut}, and there is more beyond." * bool(cut)
    return (
        f"The best damping of the first {DESIGNED_MODES} modes that the sampled loop holds within the dotted frame is "
        f"{significant(100 * found.value, 3)} % of critical, at {gains} (tfarm design), without a clock "
        f"{found.verdict.verdict}.{edge} {sampled}."
    )


def _map_caption(data: MapOfArm) -> str:
    proof = proof_words(data.arm)
    unit = f"{plain(rate_unit(data.arm), 4)} {unit_of(RATE_GAIN, data.arm)}"
    reach = ALL_MODES if data.region.is_known else UP_TO.format(band=significant(data.region.band, 5))
    free = data.arm.has_rigid_mode
    seen = MAP_SEEN.format(
        band=significant(data.band, 5),
        proof=proof,
        unit=unit,
        reach=reach,
        apart=APART_FROM_HUB * free,
        held=WITH_INERTIA * (not free),
    )
    sampled = SAMPLED_NOT_SEEN if data.sampled is None else SAMPLED_SEEN
    clock = f"{plain(1e3 * data.chain.sampling.period)} ms"
    modes = 0 if data.sampled is None else data.sampled.modes_used
    deepest = plain(DEEPEST_MOMENT_GAIN * data.arm.input_per_torque, 4)
    depth = "" if data.arm.loses_at_hub_alone else DEPTH_WORDS.format(deepest=deepest)  # by a theorem, however deep
    return seen + sampled.format(clock=clock, modes=modes) + depth


def proof_words(arm: Arm) -> str:
    """What Lyapunov's argument proves in the plane of gains, as the margins' table says it of each law."""
    if arm.is_uniform:
        return PROOF if arm.is_undamped else NO_PROOF
    if arm.input_lags:
        return OF_LAG
    if not arm.reads_hub_moment:
        return OF_OTHER_GAUGE
    if not arm.has_elastic_link:
        return OF_DAMPED
    whole, least = arm.input_per_torque, 0.0 - arm.rate_loss
    return OF_ELASTIC.format(
        whole=plain(whole, 5) + written_unit(MOMENT_GAIN, arm), least=plain(least, 5) + written_unit(RATE_GAIN, arm)
    )
