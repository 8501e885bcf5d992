"""The sampled loops of a report: verdict, margins, stability intervals, modes, motion in time, and the gain tuner.

In time: slews.  Of the tuner: costs against
baselines, what it learns, and where it is proven.
"""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, Arm, shown_unit
from tfarm.assessment.step import Step
from tfarm.digits import plain, significant
from tfarm.dsp import Chain, Simulation, scenarios, traces
from tfarm.errors import CertificationError, ParameterError
from tfarm.loop.sampled_analysis import Analysis
from tfarm.plots import animation, motion, regions, roots, style
from tfarm.report.blocks import (
    Fact,
    PageSection,
    Picture,
    columns_of,
    picture_block,
    prose,
    record_sheet,
    sheet,
)
from tfarm.report.page import ArmReport, PageCase, has_loop
from tfarm.schema import Column, Table, across, table, text
from tfarm.studies.candidates import WITHOUT, TunerNumbers
from tfarm.synthesis.stability_map import StableRegions


def sampled_section(report: ArmReport) -> PageSection:
    """Return the sampled loop of each controller, in time the slew, where no run was measured under each."""
    chain = report.chain
    found = [(each, each.sampled) for each in report.cases]
    numbers = across({each.title: it for each, it in found}, keys=[each.key for each, _ in found])
    blocks: list[Picture | Table] = [sheet("sampled", numbers)]
    for each, it in found:
        intervals = table(it.stability_intervals)
        blocks.append(sheet("sampled_numbers", intervals, stem=_stem("numbers", each), each=each, found=it))
    blocks.append(delays_table(report))
    pictures, words, facts = slews(report)
    if not report.laws:
        # the gains of the arm itself
        (_, own), *_ = found
        blocks = [overlay_picture(report, own), *blocks, loci_picture(report, own)]
        facts = [*sampled_interval_facts(own), *facts]
    of_whole_law = (
        "index",
        "natural_frequency",
        "band",
        "aliased",
        "first_order",
        "by_damping",
        "log_radius",
    )
    for each, it in found:
        modes = table(it.modes, () if it.loop.is_of_gains else of_whole_law)
        blocks.append(sheet("sampled_modes", modes, stem=_stem("modes", each), each=each, found=it))
    growths = [growth_words(each, it) for each, it in found if it.verdict.log_radius > 0]
    return PageSection(
        title=f"The sampled loop, {plain(1e3 * chain.sampling.period)} ms",
        facts=facts,
        words=[" ".join([chain_words(report.arm, chain), *growths]), *words],
        blocks=[*blocks, *pictures],
    )


# ------------------------------------------------------------ verdict


def sampled_interval_facts(found: Analysis) -> Iterator[Fact]:
    """Yield the stability intervals of both gains of a sampled loop."""
    period = plain(1e3 * found.loop.chain.sampling.period)
    modes = f" (first {found.verdict.modes_used} modes)"
    for name in PLANE:
        unit = shown_unit(name, found.loop.plant.arm)
        shown = text(list(found.shown[name]), 4) or "no value"
        known = f"{name}, sampled, {period} ms{modes if modes in shown else ''}"
        yield Fact(known, shown.replace(modes, ""), unit)


def chain_words(arm: Arm, chain: Chain) -> str:
    """Return every part of the chain that is not ideal."""
    return prose("chain", chain=chain, unit=arm.input_unit, is_default=chain == Chain())


def _stem(name: str, each: PageCase) -> str:
    """Return the name of a controller's table; the first has no more than the name."""
    if each.key in ("default", "law"):
        return f"sampled-{name}"
    return f"sampled-{name}-{each.key.replace('_', '-')}"


def delays_table(report: ArmReport) -> Table:
    """Return the verdict on each controller as it is, and with half a sample and a whole one of further delay."""
    rows = [(each.name, *row) for each in report.cases for row in each.delays]
    names, delays, verdicts = zip(*rows, strict=True)
    columns = (
        Column("law", "controller", of=names),
        Column("further_delay_ms", "further delay", "ms", of=delays),
        *table(verdicts, ("word", "spectral_radius", "time_constant", "slowest", "holds_for")).columns,
    )
    return sheet("sampled_delays", columns, free=any(verdict.loop.has_free_angle for verdict in verdicts))


# ------------------------------------------------------------ pictures of gains


def overlay_picture(report: ArmReport, found: Analysis) -> Picture:
    """Return the regions of the continuous and of the sampled loop in one plane, with the intervals of K2 below it."""
    both = report.regions
    rows = [row for row in report.cases[0].margins.stability_intervals if row.name == MOMENT_GAIN]
    return picture_block(
        "sampled_overlay",
        regions.gain_regions.figure(*both),
        data=both.columns,
        arm=report.arm,
        low=float(both.continuous.x[0]),
        nested=len(both.sampled) > 1,
        continuous=text([each for row in rows for each in row.intervals], 4) or "no value",
        sampled=text(list(found.shown[MOMENT_GAIN]), 4) or "no value",
        at=report.gains.gain_text(RATE_GAIN, plain, report.arm),
    )


def loci_picture(report: ArmReport, found: Analysis) -> Picture:
    """Return root loci of the sampled loop in the z-plane, along each gain; its data are the poles with Im z >= 0."""
    loci = report.sampled_loci
    rows = []
    for name, locus in loci.by.items():
        for value, poles in zip(locus.values.tolist(), locus.z, strict=True):
            own = locus.loop.with_number(locus.gain, value)
            gains = [own.number(each) for each in PLANE]
            upper = [(mode, z) for mode, z in zip(locus.mode.tolist(), poles, strict=True) if not z.imag < 0]
            rows += [(name, *gains, mode, z.real, z.imag) for mode, z in upper]
    return picture_block(
        "sampled_loci",
        roots.draw_sampled_loci.figure(loci),
        data=columns_of(("locus", *PLANE, "mode", "real", "imaginary"), rows),
        half=loci.half_rate,
        aliased=int((found.modes.band > 0).sum()),
    )


# ------------------------------------------------------------ in time


def slews(report: ArmReport) -> tuple[list[Picture | Table], list[str], list[Fact]]:
    """Return the slew under each controller, reasons of a missing one, settling times; none where runs are measured.

    Of an arm's own gains the slew without moment feedback is there too.
    """
    chain = report.chain
    if not report.arm.has_rigid_mode:
        return [], [f"{prose('what_holds', arm=report.arm)}: no slew is simulated."], []
    if all(each.measured is not None for each in report.cases):
        return [], [], []
    runs: dict[str, Simulation] = {}
    simulated: list[PageCase] = []
    words: list[str] = []
    for each in report.cases if report.laws else (report.bare, *report.cases):
        try:
            runs[each.name] = each.slew
            simulated.append(each)
        except ParameterError as error:
            words.append(f"No slew of {each.name} is simulated: {error}.")
    if len({each.arm.input_unit for each in simulated}) > 1:
        return (
            [],
            [*words, "The controllers drive inputs of different units: their slews are not drawn together."],
            [],
        )
    if not runs:
        return [], words, []
    arm = simulated[0].arm
    title = prose("slew_title", task=chain.slew, reach=report.arm.reach)
    figure = motion.slew.figure(arm, {style.safe(name): run for name, run in runs.items()}, title)
    columns = response_columns(arm, {each.key: runs[each.name] for each in simulated})
    numbers = (
        Column("law", "controller", of=list(runs)),
        *table(list(runs.values()), ("residual_moment", "settling_time")).columns,
        Column("finding", "finding", of=[run.finding for run in runs.values()]),
    )
    own = [each for each in simulated if each.key != "without"]
    moving = next((each for each in own if runs[each.name].stopped is None), None)
    blocks: list[Picture | Table] = [
        picture_block(
            "sampled_slew", figure, data=columns, runs=runs, piece=piece_of_bands(runs), task=title
        ),
        sheet("slew_numbers", numbers, stem="sampled-slew-numbers"),
    ]
    facts = [settling_fact(each, runs[each.name], len(report.laws) > 1) for each in own]
    if moving is not None:
        found = moving.time_responses
        blocks.insert(1, film_picture(moving, runs[moving.name]))
        blocks.append(sheet("time_responses", found.table, each=moving, found=found))
        facts += tip_facts(found)
    return blocks, words, facts


def tip_facts(found: Step) -> Iterator[Fact]:
    """Yield the settling time of the tip in each loop, from the end of the slew, and its residual vibration."""
    for name, loop in found.loops.items():
        label = f"settling time of the tip after the slew, {name.partition(',')[0]}"
        if loop.tip is None or loop.tip.settling_time is None:
            yield Fact(label, "not settled")
        else:
            residual = f"residual {text(loop.tip.residual_rms, 3)} mm rms"
            yield Fact(label, text(loop.tip.settling_time, 4), "s", residual)


def film_picture(each: PageCase, run: Simulation) -> Picture:
    """Return the film of a slew, and of what follows for half as long."""
    found = each.film(run)
    still = picture_block("slew_film", animation.draw_motion.figure(found), name=each.name, found=found)
    return still._replace(film=animation.film(found).gif)


def settling_fact(each: PageCase, run: Simulation, is_named: bool) -> Fact:
    """Return the settling time of a slew, or the time within which it is not reached."""
    label = f"settling time of the root moment{f', {each.name}' if is_named else ''}"
    if run.stopped is not None:
        return Fact(label, "unstable")
    if run.settling_time is None:
        return Fact(label, f"not settled within {significant(run.t[-1], 4)}", "s")
    return Fact(label, text(run.settling_time, 4), "s")


def piece_of_bands(runs: Mapping[str, Simulation]) -> float | None:
    """Return the time [s] that each piece of a curve spans that is drawn as a band; None where all are lines."""
    curves = (traces.curve_of(run, "root_moment") for run in runs.values())
    return next((float(one.t[1] - one.t[0]) for one in curves if one.is_band), None)


def response_columns(arm: Arm, each: Mapping[str, Simulation]) -> Sequence[Column]:
    """Return the curves of some simulations of one scenario as they are drawn: a row a point, or a piece of the bands.

    Torques are those held at that time, the rigid arm's moment that of the sample after it.
    """
    moments = {key: traces.curve_of(run, "root_moment") for key, run in each.items()}
    t = min((moment.t for moment in moments.values()), key=len)
    first = next(iter(each.values()))
    rigid = np.r_[first.scenario.rigid_moment[1:], first.scenario.rigid_moment[-1:]]
    columns: list[Column] = [
        Column("t_s", of=t),
        Column("rigid_moment_N_m", of=traces.held_at(first, rigid, t)),
    ]
    driven = "torque" if arm.input_unit == "N m" else "input"
    unit = arm.input_unit
    for key, run in each.items():
        columns += moments[key].at(t).columns(f"root_moment_{key}", "N m")
        columns += traces.tip_deviation(arm, run).at(t).columns(f"tip_error_{key}", "m")
        name = f"{driven}_{key}_{unit.replace(' ', '_')}"
        columns.append(Column(name, unit=unit, of=traces.held_at(run, run.torque, t)))
    return columns


def growth_words(each: PageCase, found: Analysis) -> str:
    """State the growth of an unstable loop; after a measured run also when the hub angle shows it."""
    return prose(
        "growth",
        name=each.name,
        found=found.verdict,
        growth=each.growth,
        measured=each.measured,
        shown=each.departures,
    )


# ------------------------------------------------------------ the gain tuner


# relative difference of two costs below which they are called the same
SAME_COST = 1e-4


def tuner_section(report: ArmReport) -> PageSection:
    """Return the tuner with the paper's figures on a damped arm and its own chain; one sentence for any other."""
    title = "The gain tuner against baselines"
    answer = why_not(report.arm, report.chain)
    if not answer:
        try:
            data = report.tuner
            if math.isfinite(data.tuning.without.cost):
                return PageSection(
                    title=title,
                    answer=tuner_in_short(data),
                    facts=tuner_facts(data),
                    words=[prose("tuner", guard=data.tuning.training.guard.sentence)],
                    blocks=list(tuner_blocks(data, report.tuned_regions(data))),
                )
            answer = prose("tuner_unstable")
        except CertificationError as error:
            answer = prose("tuner_unproven", error=error)
    return PageSection(title=title, answer=answer)


def why_not(arm: Arm, chain: Chain, longest: int = 70_000) -> str:
    """Return the sentence for an arm or a chain on which no tuner is trained; empty of any other.

    No trial on a page is of more samples than the `longest`.
    """
    period = chain.sampling.period
    samples = 1 + round(scenarios.TRIAL_SLEWS * chain.slew.rise_time / period)
    return prose("no_tuner", arm=arm, has_loop=has_loop(arm), samples=samples, most=longest, period=period)


def saved_cost(data: TunerNumbers) -> float:
    """Return by how much the median cost of the tuner is below that of the best constant gain [%]."""
    return 100 * (1 - data.curves.final_quartiles[1] / data.tuning.best_constant.cost)


def tuner_in_short(data: TunerNumbers) -> str:
    """Compare the median cost of the tuner over its seeds with the best constant gain."""
    curves = data.curves
    return prose(
        "tuner_in_short",
        gain=saved_cost(data),
        same=100 * SAME_COST,
        median=curves.final_quartiles[1],
        best=data.tuning.best_constant.cost,
        final=curves.final,
    )


def tuner_facts(data: TunerNumbers) -> tuple[Fact, ...]:
    """Return the costs, from no moment feedback to the bound, and where the tuner leaves the tip."""
    tuning = data.tuning
    best = tuning.best_constant
    saved = saved_cost(data)
    low, median, high = (significant(cost, 4) for cost in data.curves.final_quartiles)
    left = float(traces.away(data.arm, data.slews["with the tuner"])[-1])
    less = f"{significant(saved, 2)} % less cost" if saved > 100 * SAME_COST else "no improvement"
    return (
        Fact("tuner against the best constant gain", less, note=f"median of {data.curves.seeds} seeds"),
        Fact("cost without moment feedback", significant(tuning.without.cost, 4)),
        Fact(
            "best constant gain",
            significant(best.cost, 4),
            note=f"{MOMENT_GAIN} = {significant(best.gain, 3)}",
        ),
        Fact("tuner", median, note=f"half between {low} and {high}"),
        Fact("bound", significant(tuning.bound.cost, 4), note="linear-quadratic optimum"),
        Fact("tip error at the end", significant(1e3 * abs(left), 2), "mm"),
    )


def tuner_blocks(data: TunerNumbers, both: StableRegions) -> Iterator[Picture | Table]:
    """Yield the gain, slews without and with the tuner, the costs, and the learning curves.

    The slews are through ideal converters, then with those and the delay of the arm's own chain.
    """
    tuning = data.tuning
    result = tuning.training.result
    columns = Column("t_s", of=result.t), Column("K", of=result.K), Column("x_N_m", of=result.x)
    gain = tuning.constant.gain_text(RATE_GAIN, plain)
    yield picture_block(
        "tune_gain", motion.draw_gain.figure(tuning, *both), data=columns, tuning=tuning, gain=gain
    )
    chain = chain_words(data.arm, data.coarse[WITHOUT].chain)
    for kind, runs, how in (
        ("tune_slew", data.slews, "ideal converters"),
        ("tune_dsp", data.coarse, "with converters and delay"),
    ):
        figure = motion.slew.figure(data.arm, runs, f"the slew, {how}")
        slews = response_columns(data.arm, dict(zip(("without", "tuner"), runs.values(), strict=True)))
        yield picture_block(
            kind, figure, data=slews, runs=runs, piece=piece_of_bands(runs), how=how, chain=chain
        )
    yield record_sheet("tune_comparison", data.rows, data=data)
    curves = data.curves
    learned = [Column("trial", of=range(1, curves.costs.shape[1] + 1))]
    learned += [Column(name, of=costs) for name, costs in curves.quartile_curves.items()]
    learned += [Column(f"seed_{seed}", of=costs) for seed, costs in enumerate(curves.costs)]
    yield picture_block(
        "tune_curves", motion.draw_learning.figure(curves, tuning), data=learned, curves=curves
    )
