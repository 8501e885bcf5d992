"""The sampled loops of a case: verdict, margins, stability intervals, modes, and motion in time.

In time: slews, and steps that were measured with the exact sampled loop over them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, Arm, HubFeedback, shown_unit
from tfarm.digits import how_many, kept_digits, plain, significant, singly
from tfarm.dsp import Analysis, Chain, Simulation, Verdict, sampled_verdict, traces
from tfarm.dsp.chain import MOST_DELAY
from tfarm.dsp.crossings import around
from tfarm.dsp.modes import STRONGER, SampledLoci, sampled_loci
from tfarm.dsp.results import drawn
from tfarm.dsp.traces import RECORD_LENGTH
from tfarm.dsp.verdict import at_periods, sampled
from tfarm.errors import ParameterError
from tfarm.fitting.recording import RunComparison, compare_run, overshoot
from tfarm.plots.motion import draw_measured_runs
from tfarm.plots.motion import slew as slew_plot
from tfarm.plots.regions import StableRegions, draw_overlay, regions_table, stable_regions
from tfarm.plots.roots import draw_sampled_loci
from tfarm.plots.style import safe
from tfarm.report.cases import Case, Controller, margins_of, on_hub, what_holds
from tfarm.report.sections import Fact, PageSection, Picture, prose
from tfarm.schema import Column, Quantity, Table, across, quantities, table, text, with_unit

MORE_DELAY = (0.0, 0.5, 1.0)  # samples of further delay for which the verdict is given
PAST_HUB = 1.25  # times the rate gain at which sampling alone makes the hub unstable: the end of its locus
LOCUS_K2 = (-0.5, 1.5)  # of its locus: the stability interval of most arms, and a little to either side
VERDICT_COLUMNS = ("word", "spectral_radius", "time_constant", "slowest", "holds_for")
WHOLE_LAW_COLUMNS = ("index", "natural_frequency", "band", "aliased", "first_order", "by_damping", "log_radius")
CURVE_DIGITS = 7  # digits of a curve in its file: a hundredth of the width of a line is four
Analysed = Sequence[tuple[Controller, Analysis]]


def sampled_section(case: Case) -> PageSection:
    """The sampled loop of each controller; in time runs measured under the laws, else the slew."""
    arm, chain = case.arm, case.chain
    found = [(each, sampled(each.arm, each.law, chain)) for each in case.controllers]
    words, blocks = [chain_words(arm, chain)], list[Picture | Table]()
    first = found[0][1]
    if not case.laws:
        blocks.append(overlay_picture(stable_regions(arm, first.loop.gains, chain), first))
    numbers = {each.title: it for each, it in found}
    blocks.append(across(numbers, keys=[each.key for each, _ in found], stem="sampled",
                         title="Verdict and margins of the sampled loop", caption=prose("sampled")))  # fmt: skip
    blocks += [*(numbers_table(*each) for each in found), delays_table(found, chain)]
    if not case.laws:
        blocks += [periods_table(arm, first.loop.gains, chain), loci_picture(first)]
    blocks += [modes_table(*each) for each in found]
    blocks += measured_blocks(case)
    if not arm.has_rigid_mode:
        words.append(f"{what_holds(arm)}: no slew is simulated.")
    elif any(each.given.measured is None for each in case.controllers):
        bare = [] if case.laws else [first.loop.gains.having(MOMENT_GAIN, 0.0)]
        without = [on_hub(arm, gains, f"{MOMENT_GAIN} = 0", "without") for gains in bare]
        slewed, refused = slew(case, [*without, *case.controllers])
        blocks += slewed
        words += refused
    facts = [fact for each in found for fact in facts_on(*each)]
    return PageSection(
        anchor="sampled",
        title=f"The sampled loop, {plain(1e3 * chain.sampling.period)} ms",
        answer=prose("sampled_lead", found=found, period=chain.sampling.period),
        facts=facts,
        words=words,
        blocks=[block for block in blocks if not isinstance(block, Table) or block.columns],
    )


# ------------------------------------------------------------ verdict


def facts_on(each: Controller, found: Analysis) -> list[Fact]:
    """Verdict, delay margin and minimum structural damping of a sampled loop."""
    verdict = found.verdict
    facts = [Fact(label=each.title, value=verdict.word.upper(), note=prose("dominant", it=verdict))]
    if verdict.is_stable:
        value = text(found.delay_margin_seconds, 3)
        note = f"{significant(found.delay_margin_samples, 3)} samples"
        facts.append(Fact(label=f"{each.name}: delay margin", value=value, unit="s", note=note))
    if found.minimum_damping is not None and (each.arm.has_elastic_link or not verdict.is_stable):
        of = quantities(type(found))["minimum_damping"]
        facts.append(Fact(label=f"{each.name}: {of.label}", value=with_unit(found.minimum_damping, of)))
    return facts


def chain_words(arm: Arm, chain: Chain) -> str:
    """Every part of the chain that is not ideal."""
    return prose("chain", chain=chain, unit=arm.input_unit, is_default=chain == Chain())


def _stem(name: str, each: Controller) -> str:
    """The name of a controller's table; the first has no more than the name."""
    return f"sampled-{name}" if each.key in ("default", "law") else f"sampled-{name}-{each.key.replace('_', '-')}"


def numbers_table(each: Controller, found: Analysis) -> Table:
    """Stability intervals of each number of a controller, the others fixed."""
    return table(
        found.stability_intervals,
        stem=_stem("numbers", each),
        title=f"Stability intervals, {each.name}",
        caption=prose("sampled_numbers", modes=found.verdict.modes_used, is_of_gains=found.loop.is_of_gains),
    )


def modes_table(each: Controller, found: Analysis) -> Table:
    """The modes of the sampled loop one by one; the parts of K1 and K2 are those of gains at the hub."""
    is_of_gains = found.loop.is_of_gains
    return table(
        found.modes,
        () if is_of_gains else WHOLE_LAW_COLUMNS,
        stem=_stem("modes", each),
        title=f"Modes of the sampled loop, {each.name}",
        caption=prose(
            "sampled_modes",
            period=found.loop.chain.sampling.period,
            first=" and ".join(f"by {name}" for name in PLANE) if is_of_gains else "first order",
        ),
    )


def delays_table(found: Analysed, chain: Chain) -> Table:
    """The verdict on each controller as it is, and with half a sample and a whole one of further delay."""
    rows: list[tuple[str, float, Verdict]] = []
    T = chain.sampling.period
    for each, it in found:
        for more in MORE_DELAY:
            delay = chain.sampling.delay_samples + more
            if more and delay + each.law.delay / T > MOST_DELAY:
                continue
            late = replace(chain, sampling=replace(chain.sampling, delay_samples=delay))
            verdict = sampled_verdict(each.arm, each.law, late) if more else it.verdict
            rows.append((each.name, 1e3 * T * more, verdict))
    names, delays, verdicts = zip(*rows, strict=True)
    first = Column("law", "controller", of=names), Column("further_delay_ms", "further delay", "ms", of=delays)
    return Table(
        stem="sampled-delays",
        title="Stability with further delay",
        caption=prose("sampled_delays", free=any(verdict.loop.has_free_angle for verdict in verdicts)),
        columns=(*first, *table(verdicts, VERDICT_COLUMNS).columns),
    )


def periods_table(arm: Arm, gains: HubFeedback, chain: Chain) -> Table:
    """The gains at other sampling periods, with their stability intervals there."""
    rows = at_periods(arm, gains, chain)
    columns = [Column("period_ms", "period", "ms", of=[1e3 * row.period for row in rows], digits=singly(plain))]
    half_rates = [0.5 / row.period for row in rows]
    columns.append(Column("half_rate_hz", "aliased above", "Hz", of=half_rates, digits=singly(plain)))
    columns += table([row.verdict for row in rows], VERDICT_COLUMNS).columns
    for name in PLANE:
        windows = [list(row.windows[name]) for row in rows]
        ends = [around(each, gains[name]) or tuple(end for pair in each for end in pair) for each in windows]
        cells = [text(each, 4) or "none" for each in windows]
        columns.append(Column(f"stable_{name}", f"stable {name}", shown_unit(name, arm), of=ends, shown=cells))
    return Table(
        stem="sampled-periods",
        title="Stability at other sampling periods",
        caption=prose("sampled_periods", gains=" and ".join(gains.gain_text(name, plain) for name in PLANE)),
        columns=tuple(columns),
    )


# ------------------------------------------------------------ pictures of gains


def overlay_picture(regions: StableRegions, found: Analysis) -> Picture:
    """Stability regions of the continuous and of the sampled loop in one plane, with the intervals of K2 below it."""
    arm, (low, *_) = regions.continuous.arm, regions.continuous.axes[0]
    gains = found.loop.gains
    rows = [row for row in margins_of(arm, gains).stability_intervals if row.name == MOMENT_GAIN]
    continuous = text([each for row in rows for each in row.intervals], 4) or "no value"
    sampled_at = text(list(found.shown[MOMENT_GAIN]), 4) or "no value"
    return Picture(
        stem="sampled-overlay",
        title="Stability regions, continuous and sampled",
        caption=prose(
            "overlay",
            arm=arm,
            low=float(low),
            nested=len(regions.sampled) > 1,
            continuous=continuous,
            sampled=sampled_at,
            at=gains.gain_text(RATE_GAIN, plain, arm),
        ),
        alt="Map of both gains: stability regions of the continuous and of the sampled loop.",
        figure=draw_overlay(regions),
        data=regions_table(regions, "sampled-overlay-data"),
    )


def loci_picture(found: Analysis) -> Picture:
    """Root loci of the sampled loop in the z-plane, along each gain."""
    loop, arm = found.loop, found.loop.plant.arm
    turning = arm.hub_side_inertia * arm.input_per_torque  # at the hub, in the unit of the input times s^2
    top = max(PAST_HUB * 2 * turning / loop.chain.sampling.period, STRONGER * loop.gains[RATE_GAIN])
    loci = sampled_loci(loop, top, LOCUS_K2)
    aliased = how_many(int((found.modes.band > 0).sum()), "aliased mode")
    return Picture(
        stem="sampled-loci",
        title="Root loci of the sampled loop",
        caption=prose("sampled_loci", half=loci.half_rate),
        alt=f"Root loci of the sampled loop in the z-plane; {aliased}.",
        figure=draw_sampled_loci(loci),
        data=loci_table(loci, "sampled-loci-data"),
    )


def loci_table(data: SampledLoci, stem: str) -> Table:
    """Every pole of the loci with Im z >= 0: a row a gain and a branch."""
    rows = []
    for name, locus in data.by.items():
        for value, poles in zip(locus.values.tolist(), locus.z, strict=True):
            loop = locus.loop.having(**{locus.gain: value})
            each = zip(locus.mode.tolist(), poles, strict=True)
            rows += [(name, *map(loop.number, PLANE), mode, z.real, z.imag) for mode, z in each if not z.imag < 0]
    titles = {"locus": "locus", **{name: name for name in PLANE}, "mode": "mode", "real": "Re z", "imaginary": "Im z"}
    columns = [Column(*title, of=cells) for title, cells in zip(titles.items(), zip(*rows, strict=True), strict=True)]
    return Table(stem=stem, title="Poles of the sampled loop", columns=tuple(columns))


# ------------------------------------------------------------ in time


class SlewRow(NamedTuple):
    """A slew under one controller in numbers; what is not reached in the record, or of an unstable loop, is None."""

    law: Annotated[str, Quantity("controller", help="controller of the slew")]
    residual: Annotated[
        float | None,
        Quantity(
            "residual root moment",
            "N m rms",
            3,
            key="residual_moment_rms",
            help="rms of root moment less the rigid arm's, from the end of the slew on",
        ),
    ]
    settling_time: Annotated[
        float | None,
        Quantity(
            "settling time (5 %)",
            "s",
            3,
            help="time from which on the root moment stays within 5 % of its largest value",
        ),
    ]
    hub_error: Annotated[
        float | None, Quantity("hub error at the end", "deg", 3, help="hub angle less reference at the last sample")
    ]
    stopped: Annotated[
        float | None,
        Quantity("unstable, stopped at", "s", 3, help="time at which the simulation of an unstable loop was stopped"),
    ]


def slew_row(name: str, run: Simulation) -> SlewRow:
    """The numbers of a slew."""
    if run.stopped is not None:
        return SlewRow(name, None, None, None, run.stopped.time)
    error = math.degrees(run.at_samples.hub_angle[-1] - run.scenario.hub_angle[-1])
    return SlewRow(name, run.residual_moment, run.settling_time, error, None)


def slew(case: Case, controllers: Sequence[Controller]) -> tuple[list[Picture | Table], list[str]]:
    """The slew of the chain under each controller, and why one is not simulated."""
    runs: dict[str, Simulation] = {}
    words, task = [], case.chain.slew
    for each in controllers:
        try:
            runs[each.name] = drawn(each.arm, each.law, case.chain, "slew", RECORD_LENGTH * task.rise_time)
        except ParameterError as error:
            words.append(f"No slew of {each.name} is simulated: {error}.")
    simulated = [each for each in controllers if each.name in runs]
    if len({each.arm.input_unit for each in controllers}) > 1:
        words.append("The controllers drive inputs of different units: their slews are not drawn together.")
    elif simulated:
        arm, keys = simulated[0].arm, {each.key: runs[each.name] for each in simulated}
        title = f"{plain(task.travel_of(case.arm.reach), 3)} m of tip travel in {plain(task.rise_time, 3)} s"
        picture = Picture(
            stem="sampled-slew",
            title="The slew",
            caption=prose("slew", runs=runs, piece=piece_of_bands(runs)),
            alt=f"Root moment, tip and motor in a slew of {title}.",
            figure=slew_plot.figure(arm, {safe(name): run for name, run in runs.items()}, title),
            data=responses_table("sampled-slew-data", "The slew in time", arm, keys),
        )
        rows = [slew_row(name, run) for name, run in runs.items()]
        return [picture, table(rows, stem="sampled-slew-numbers", title="The slew in numbers")], words
    return [], words


def piece_of_bands(runs: Mapping[str, Simulation]) -> float | None:
    """The time [s] that each piece of a curve spans that is drawn as a band; None where all are lines."""
    curves = (traces.curve_of(run, "root_moment") for run in runs.values())
    return next((float(one.t[1] - one.t[0]) for one in curves if one.is_band), None)


def responses_table(stem: str, title: str, arm: Arm, each: Mapping[str, Simulation]) -> Table:
    """The curves of some simulations of one scenario as they are drawn: a row a point, or a piece of the bands.

    Torques and gains are those held at that time, the rigid arm's moment that of the sample after it.  Numbers have
    `CURVE_DIGITS` digits: a page's folder is no place for six thousand rows of eleven columns to the last bit.
    """
    moments = {key: traces.curve_of(run, "root_moment") for key, run in each.items()}
    t = min((moment.t for moment in moments.values()), key=len)
    first = next(iter(each.values()))
    rigid = first.scenario.rigid_moment
    columns: list[Column] = [
        Column("t_s", "time", "s", of=t),
        Column("rigid_moment_N_m", "rigid arm", "N m", of=traces.held_at(first, np.r_[rigid[1:], rigid[-1:]], t)),
    ]
    driven, unit = "torque" if arm.input_unit == "N m" else "input", arm.input_unit
    for key, run in each.items():
        columns += moments[key].at(t).columns(f"root_moment_{key}", "root moment", "N m")
        columns += traces.curve_of(run, "tip_displacement").at(t).columns(f"tip_{key}", "tip", "m")
        columns += traces.tip_deviation(arm, run).at(t).columns(f"tip_error_{key}", "tip less reference", "m")
        name = f"{driven}_{key}_{unit.replace(' ', '_')}"
        columns.append(Column(name, driven, unit, of=traces.held_at(run, run.torque, t)))
        if run.gain is not None and np.ptp(run.gain):
            columns.append(Column(f"K_{key}", "gain", of=traces.held_at(run, run.gain, t)))
    columns = [replace(each, of=kept_digits(map(float, each.values), CURVE_DIGITS)) for each in columns]
    return Table(stem=stem, title=title, columns=tuple(columns))


# ------------------------------------------------------------ measured in time


class MeasuredStep(NamedTuple):
    """A step under one controller in numbers, measured and computed."""

    law: Annotated[str, Quantity("controller", help="controller under which the step was measured")]
    step: Annotated[float, Quantity("step", "deg", 4, help="change of the reference")]
    overshoot_measured: Annotated[
        float,
        Quantity(
            "overshoot, measured",
            "%",
            3,
            key="overshoot_measured_percent",
            help="beyond the last reference, as a share of the step; below 0 it is not reached",
        ),
    ]
    overshoot_computed: Annotated[
        float,
        Quantity(
            "overshoot, computed",
            "%",
            3,
            key="overshoot_computed_percent",
            help="beyond the last reference, as a share of the step; below 0 it is not reached",
        ),
    ]
    end_measured: Annotated[
        float, Quantity("error at the end, measured", "deg", 3, help="hub angle less reference at the last sample")
    ]
    end_computed: Annotated[
        float, Quantity("error at the end, computed", "deg", 3, help="hub angle less reference at the last sample")
    ]
    moment_measured: Annotated[
        float | None,
        Quantity("largest |moment|, measured", "N m", 3, help="largest size of the root moment in the record"),
    ]
    moment_computed: Annotated[
        float,
        Quantity("largest |moment|, computed", "N m", 3, help="largest size of the root moment in the simulation"),
    ]
    difference: Annotated[
        float,
        Quantity("difference, rms", "deg", 3, key="apart_rms_deg", help="rms of computed less measured hub angle"),
    ]


def measured_step(name: str, found: RunComparison) -> MeasuredStep:
    """The numbers of a measured step."""
    measured, computed = found.measured, found.run.at_samples.root_moment
    step, end = measured.step, float(measured.reference[-1])
    beyond = [100 * overshoot(angle, step, end) for angle in (measured.hub_angle, found.hub_angle)]
    return MeasuredStep(
        name,
        math.degrees(step),
        beyond[0],
        beyond[1],
        math.degrees(measured.hub_angle[-1] - end),
        math.degrees(found.hub_angle[-1] - end),
        float(abs(measured.root_moment).max()) if measured.root_moment.size else None,
        float(abs(computed).max()),
        math.degrees(found.difference_rms),
    )


def measured_blocks(case: Case) -> Iterator[Picture | Table]:
    """Each measured run with the exact loop over it, and both in numbers; nothing where none was measured."""
    runs = [(each, each.given.measured) for each in case.controllers if each.given.measured is not None]
    found = {each.name: compare_run(each.arm, each.law, case.chain, run) for each, run in runs}
    if not found:
        return
    yield Picture(
        stem="sampled-measured",
        title="Measured on the rig, and computed",
        caption=prose("measured", found=found),
        alt=f"Hub angle and root moment over time, measured and computed, under {' and '.join(found)}.",
        figure=draw_measured_runs("Measured steps, and the exact sampled loop", found),
        data=compared_table({each.key: found[each.name] for each, _ in runs}),
    )
    if rows := [measured_step(name, it) for name, it in found.items() if it.measured.hub_angle.size]:
        yield table(
            rows, stem="sampled-overshoot", title="Measured and computed, in numbers", caption=prose("overshoot")
        )


def compared_table(found: Mapping[str, RunComparison]) -> Table:
    """The curves of the picture: a row a sample, measured values taken between their rows."""
    t = min((it.run.t for it in found.values()), key=len)
    columns = [Column("t_s", "time", "s", of=t)]
    for key, it in found.items():
        measured = it.measured
        reference = np.interp(t, measured.t, measured.reference)
        columns.append(Column(f"reference_{key}_rad", "reference", "rad", of=reference))
        for name, unit, values, computed in (
            ("hub_angle", "rad", measured.hub_angle, it.hub_angle),
            ("root_moment", "N_m", measured.root_moment, it.run.at_samples.root_moment),
        ):
            if values.size:
                columns.append(Column(f"{name}_measured_{key}_{unit}", name, of=np.interp(t, measured.t, values)))
            columns.append(Column(f"{name}_computed_{key}_{unit}", name, of=computed[: t.size]))
    return Table(stem="sampled-measured-data", title="Measured and computed", columns=tuple(columns))
