"""Ranges of both gains on an arm's page: the map of their stability regions, and the root loci along each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import GAINS, MOMENT_GAIN, PLANE, RATE_GAIN, Arm, HubFeedback, shown_unit, unit_of
from tfarm.arrays import Real
from tfarm.digits import plain, significant
from tfarm.dsp import Chain
from tfarm.dsp import GainMap as SampledMap
from tfarm.dsp.verdict import SampledBrief
from tfarm.errors import ConvergenceError
from tfarm.loop.loci import Loci, held_branches, loci
from tfarm.loop.loop import band_of
from tfarm.loop.plane import DEEPEST_MOMENT_GAIN, Axis, Plane, edge, gain_map, moment_axis, rate_axis
from tfarm.loop.stability import MARGIN_OF_ZERO, stability
from tfarm.plots import regions as plane
from tfarm.plots.regions import sampled_region
from tfarm.plots.roots import draw_loci
from tfarm.plots.style import page
from tfarm.records import record
from tfarm.report.cases import DESIGNED_MODES, Case, Controller, best, brief_on, has_loop, margins_of
from tfarm.report.loop_section import poles_tables
from tfarm.report.sections import PageSection, Picture, prose
from tfarm.schema import Column, Quantity, Table, across, table, text
from tfarm.spectrum.table import default_gains, default_words, first_frequency, rate_unit
from tfarm.synthesis.design import Design
from tfarm.synthesis.judge import damping_of
from tfarm.synthesis.models import continuous_model
from tfarm.synthesis.structures import ONE, Entry

if TYPE_CHECKING:
    from tfarm.plots.style import Figure

GRID_COLUMNS, GRID_ROWS = 240, 200  # of the coloured grid
MARKERS = {"default": plane.DIAMOND, "best": plane.STAR}
DAMPING_EVERY = 4  # of them, the damping is computed at one in four
DAMPING_MODES = 8  # of the model whose poles that is of: it is right to a few digits, more than a contour shows
GAINS_AT_ONCE = 500  # of them: memory, whatever the grid
LISTED_MOMENT_GAINS = (0.9, 1.0, 1.01, 1.1, 1.5)  # values of K2 whose exact poles are listed
AROUND_EDGE = (0.9, 1.1)  # times the edge, if that lies above all of them
LISTED_RATE_GAINS = (0.0, 0.05, 0.2, 0.5, 1.0, 2.0)  # times J w1: values of K1 whose poles are listed without a locus
RANGE_OF_K2 = (-1.0, 1.6)  # of the locus, times what balances a torque: both sides of 0, and beyond 1
FIRST_PAIRS = 3  # pairs of poles in a row of the list
shortly = partial(plain, digits=4)  # how a gain is written in a title


@dataclass(frozen=True)
@record
class MapOfArm:
    """The numbers of the map.

    `region` is the exact count on the coloured grid, `edge` (n, 3) the exact boundary, both gains and w, within the
    picture with rows of nan where it leaves it; `damping` (rows, columns) the least damping ratio of the first
    `DESIGNED_MODES` modes at `axes`, every fourth value of each gain on the grid and the frame's; `design` the best
    gains for the sampled loop.  `sampled` is the region of the loop sampled by `chain`, None where that is not
    determined; `briefs` are the sampled verdicts on the laws.
    """

    arm: Arm
    x: Axis
    y: Axis
    region: Plane
    edge: Real
    axes: tuple[Real, Real]
    damping: Real
    laws: tuple[Controller, ...]
    design: Design | None
    chain: Chain
    sampled: SampledMap | None
    briefs: tuple[SampledBrief, ...]

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """Unstable poles on the grid of the damping."""
        return np.asarray(gain_map(self.arm, *self.axes).unstable)

    @property
    def band(self) -> float:
        """Below which [rad/s] the damping is the least."""
        return band_of(self.arm, DESIGNED_MODES)


def map_of_arm(arm: Arm, chain: Chain) -> MapOfArm:
    """The map of an arm, its ranges chosen by J w1 and by its stability intervals."""
    x = rate_axis(arm)
    y = moment_axis(arm, x)
    found = gain_map(arm, x.grid(GRID_COLUMNS), y.grid(GRID_ROWS))
    half = DAMPING_EVERY // 2
    across, up = (
        np.r_[axis.low, each[half::DAMPING_EVERY], axis.high] for axis, each in zip((x, y), found.axes, strict=True)
    )
    signals = tuple(each.output for name in PLANE for each in GAINS if each.name == name)
    model = continuous_model(arm, signals, DESIGNED_MODES, DAMPING_MODES, first_frequency(arm))
    points = np.reshape(np.meshgrid(across, up), (2, -1))
    parts = np.array_split(points, math.ceil(points.shape[1] / GAINS_AT_ONCE), axis=1)
    laws = ([Entry(name, row[None], ONE) for name, row in zip(signals, part, strict=True)] for part in parts)
    damping = np.concatenate([damping_of(model, model.poles(law)) for law in laws]).reshape(up.size, across.size)
    named = Case(arm, chain).in_s
    briefs = tuple(brief_on(arm, each.law, chain) for each in named)
    sampled = sampled_region(arm, x, y, chain)
    return MapOfArm(
        arm, x, y, found, edge(found, x, y), (across, up), damping, named, best(arm, chain), chain, sampled, briefs
    )


def draw_map_of_arm(data: MapOfArm) -> Figure:
    """Both gains: the count, its boundary, the damping, the sampled region, Lyapunov's frame, and the laws."""
    found, x, y = data.region, data.x, data.y
    with page(9.0, 6.2, f"{data.arm.name}: stability region of both gains") as (figure, ax):
        plane.ground(found, x, y, ax)
        plane.contours(*data.axes, np.where(data.counts == 0, data.damping, np.nan), ax)
        plane.draw_boundary(found, data.edge, x, y, ax)
        plane.draw_sampled(data.sampled, ax)
        if data.arm.is_uniform:
            plane.draw_proven(data.arm, x, y, ax)
        points = (default_gains(data.arm), *([] if data.design is None else [data.design.law]))
        for law, gains, brief in zip(data.laws, points, data.briefs, strict=True):
            plane.law_mark(gains, MARKERS[law.key], f"{law.title};\n{brief.short}", ax)
        if data.design is not None:
            plane.search_frame(data.design.bounds, ax)
    return figure


def map_data(data: MapOfArm) -> Table:
    """The grid with counts and damping, the boundary with its frequencies, then the ends of the sampled intervals.

    Ends that are cut by the picture are left out.
    """
    counts = [math.inf if count < 0 else int(count) for count in data.counts.ravel()]
    grid = zip(*(each.ravel().tolist() for each in np.meshgrid(*data.axes)), counts, data.damping.ravel().tolist(),
               strict=True)  # fmt: skip
    rows: list[tuple[Any, ...]] = [("grid", *each, "") for each in grid]
    rows += [("boundary", K1, K2, "", "", omega) for K1, K2, omega in data.edge.tolist() if not math.isnan(K1)]
    if data.sampled is not None:
        for across, windows in zip(data.sampled.axes[0].tolist(), data.sampled.stable_intervals, strict=True):
            ends = [end for window in windows for end in window if data.y.low <= end <= data.y.high]
            rows += [("sampled boundary", across, end, "", "", "") for end in ends]
    units = [shown_unit(name, data.arm) for name in PLANE]
    keys = "_".join([PLANE[0], *units[0].replace("/", " ").split()]), PLANE[1]
    titles = (
        ("what", "what", ""), *zip(keys, PLANE, units, strict=True), ("unstable_poles", "unstable poles", ""),
        ("least_damping_ratio", "least damping ratio", ""), ("omega_rad_s", "frequency", "rad/s"),
    )  # fmt: skip
    columns = [Column(*title, of=cells) for title, cells in zip(titles, zip(*rows, strict=True), strict=True)]
    return Table(stem="map-data", title="The map of both gains", columns=tuple(columns))


def map_section(case: Case) -> PageSection:
    """The stability regions of both gains, continuous and sampled, and the gains that damp best."""
    data = map_of_arm(case.arm, case.chain)
    arm, found = data.arm, data.design
    unit, deepest = f"{plain(rate_unit(arm), 4)} {unit_of(RATE_GAIN, arm)}", DEEPEST_MOMENT_GAIN * arm.input_per_torque
    picture = Picture(
        stem="map",
        title="The plane of both gains",
        caption=prose("map", data=data, arm=arm, unit=unit, deepest=deepest),
        alt="Map of K1 and K2: the stable gains, and the number of unstable poles elsewhere.",
        figure=draw_map_of_arm(data),
        data=map_data(data),
    )
    answer = intervals(arm)
    if found is not None:
        gains = ", ".join(found.law.gain_text(name, partial(significant, digits=4), arm) for name in PLANE)
        answer += " " + prose("best_gains", data=data, found=found, modes=DESIGNED_MODES, gains=gains)
    title = "Stability region of both gains"
    return PageSection(anchor="margins-map", title=title, answer=answer, blocks=(picture,))


def intervals(arm: Arm) -> str:
    """The verdict on the default gains, and the stability interval of each."""
    found = margins_of(arm, default_gains(arm))
    rows = [row for row in found.stability_intervals if row.name in PLANE]
    return prose("default_gains", gains=default_words(arm), verdict=found.stability.verdict, rows=rows)


# ------------------------------------------------------------ root loci


class AtGain(NamedTuple):
    """The exact loop at one value of a gain; its verdict may be undecided on the axis."""

    value: Annotated[float, Quantity("value", digits=4, help="value of the gain that varies, the other one fixed")]
    verdict: Annotated[str, Quantity("stability", help="verdict on the exact loop with that gain")]
    unstable_poles: Annotated[
        int | str | None,
        Quantity("unstable poles", help="closed-loop poles right of the imaginary axis, conjugates counted"),
    ]
    spectral_abscissa: Annotated[
        float | None,
        Quantity(
            "spectral abscissa",
            "1/s",
            4,
            help="largest real part of the poles in the box; 0 where it is on the axis to working precision",
        ),
    ]
    first_pairs: Annotated[str, Quantity("first pairs of poles", "1/s", help="poles with Im s > 0 of least frequency")]


def locus_section(case: Case) -> PageSection:
    """Poles of the controllers; of an arm's own page root loci along each gain too, and poles at K2 = 1 and beyond."""
    words, tables = poles_tables(case)
    if case.laws:
        return PageSection(anchor="locus", title="Closed-loop poles", words=words, blocks=tables)
    arm, gains, blocks = case.arm, default_gains(case.arm), list[Picture | Table]()
    low, high = (share * arm.input_per_torque for share in RANGE_OF_K2)
    ranges = {RATE_GAIN: (0.0, 2.0 * rate_unit(arm)), **({MOMENT_GAIN: (low, high)} if has_loop(arm) else {})}
    found: dict[str, Loci] = {}
    for name, (start, stop) in ranges.items():
        try:
            found[name] = loci(arm, gains, name, start, stop)
            blocks += locus_blocks(found[name])
        except ConvergenceError:
            words.append(prose("not_followed", name=name))
            blocks += [rates_table(arm, gains)] * (name == RATE_GAIN)
    if found:
        title, caption = "Root loci in numbers", prose("loci")
        keys = {f"along {name}": each for name, each in found.items()}
        blocks.append(across(keys, keys=list(found), stem="loci", title=title, caption=caption))
    if has_loop(arm):
        blocks.append(beyond_table(arm, gains))
    others = {name: gains.gain_text(other, shortly, arm) for name, other in zip(PLANE, reversed(PLANE), strict=True)}
    answer = prose("locus_lead", found=found, gains=others)
    return PageSection(anchor="locus", title="Root loci", answer=answer, words=words, blocks=[*blocks, *tables])


def locus_blocks(data: Loci) -> Iterator[Picture | Table]:
    """The picture of a locus, its branches, and their crossings of the imaginary axis."""
    name, reduced = data.name, data.reduced
    stem, columns = f"locus-{name}", [Column(data.name, data.name, data.unit, of=data.exact.gain)]
    for which, branches in {"exact": data.exact.branches, "reduced": reduced.branches}.items():
        for n, row in enumerate(held_branches(branches)):  # to the digits that hold on every processor
            for part, values in (("re", row.real), ("im", row.imag)):
                cells = ["" if np.isnan(value) else value for value in values.tolist()]
                columns.append(Column(f"{which}_{n}_{part}", f"{which} branch {n}, {part}", "1/s", of=cells))
    yield Picture(
        stem=stem,
        title=f"Closed-loop poles along {name}",
        caption=prose("locus", name=name, reduced=reduced),
        alt=prose("locus_alt", name=name, exact=data.exact, reduced=reduced),
        figure=draw_loci(data),
        data=Table(stem=f"{stem}-data", title=f"Loci along {name}", columns=tuple(columns)),
    )
    yield table(
        data.rows,
        stem=f"{stem}-branches",
        title=f"Branches along {name}",
        caption=prose("branches", order=reduced.order),
    )
    if data.exact.crossings:
        yield table(
            data.exact.crossings,
            stem=f"{stem}-crossings",
            title=f"Crossings of the imaginary axis along {name}",
            caption=prose("crossings", name=name),
        )


def beyond_table(arm: Arm, gains: HubFeedback) -> Table:
    """Verdict and poles of the exact loop for a few K2 around 1 and beyond."""
    edge, unit = edge_of_K2(arm, gains) or 0.0, arm.input_per_torque
    last = LISTED_MOMENT_GAINS[-1] * unit
    more = [float(f"{share * edge:.3g}") for share in AROUND_EDGE if edge > last]
    values = [*(share * unit for share in LISTED_MOMENT_GAINS), *(value for value in more if last < value)]
    undecided = [] if arm.is_undamped else [edge]  # no list of poles ends there
    rows = [at_gain(arm, gains.having(MOMENT_GAIN, value), value, undecided) for value in values]
    one = gains.having(MOMENT_GAIN, unit).gain_text(MOMENT_GAIN, shortly, arm)
    return table(
        rows,
        stem="beyond",
        title=f"{one} and beyond, at {gains.gain_text(RATE_GAIN, shortly)}",
        caption=prose("beyond", arm=arm, J=arm.total_inertia, hub=arm.hub.inertia),
    )


def edge_of_K2(arm: Arm, law: HubFeedback) -> float | None:
    """The moment gain at which the loop loses its stability as it grows alone; None where none was found."""
    windows = margins_of(arm, law).windows[MOMENT_GAIN]
    return windows.around[1] if windows.around and windows.end(windows.around[1]) == "edge" else None


def rates_table(arm: Arm, gains: HubFeedback) -> Table:
    """Verdict and poles of the exact loop for a few rate gains."""
    values = [float(f"{share * rate_unit(arm):.3g}") for share in LISTED_RATE_GAINS]
    rows = [at_gain(arm, gains.having(RATE_GAIN, value), value) for value in values]
    return table(
        rows,
        stem="rates",
        title=f"Poles at a few {RATE_GAIN}, at {gains.gain_text(MOMENT_GAIN, shortly)}",
        caption="Exact poles, each list complete in its box.",
    )


def at_gain(arm: Arm, law: HubFeedback, value: float, undecided: Sequence[float] = ()) -> AtGain:
    """The row of one value; a pole may be on the axis to working precision, and is on it at those undecided."""
    try:
        found = None if np.isclose(value, undecided, rtol=1e-9, atol=0.0).any() else stability(arm, law)
    except ConvergenceError:
        found = None
    if found is None:
        return AtGain(value, "on the axis, not determined", None, None, "")
    poles, moving, rightmost = found.poles.values, found.poles.moving, found.poles.spectral_abscissa
    rounding = MARGIN_OF_ZERO * abs(moving[moving.real == rightmost]).max(initial=0.0)
    pairs = text(poles[poles.imag > 0][:FIRST_PAIRS].tolist(), 5)
    count = "infinitely many" if found.unstable_roots_infinite else found.unstable_roots
    return AtGain(value, found.verdict, count, rightmost if abs(rightmost) > rounding else 0.0, pairs)
