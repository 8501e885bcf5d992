"""Does the loop still hold when it is sampled?  Verdict, regions, loci, modes, the slew in time, and a coarse chain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, Arm, shown_unit
from tfarm.columns import Column, Table
from tfarm.comparing.regions import regions_table
from tfarm.digits import how_many, plain, scientific, significant, singly
from tfarm.dsp import Chain, sampled_verdict
from tfarm.dsp.crossings import around
from tfarm.dsp.loci import STRONGER, sampled_loci
from tfarm.dsp.modes import ModeTable
from tfarm.dsp.traces import Slews, StripChart, slews, strip_chart
from tfarm.plots.folded import draw_folded_loci
from tfarm.plots.growth import draw_modes
from tfarm.plots.regions import draw_overlay
from tfarm.plots.strip import draw_strip_chart
from tfarm.report.loop_laws import has_loop, what_holds, why_no_loop
from tfarm.report.sampled_tables import example_words, loci_table, mode_rows, strip_table
from tfarm.report.sampled_words import (
    Sampled,
    against_continuous,
    chain_words,
    cure,
    in_ms,
    interval_words,
    sampled_facts,
    sampled_in_short,
    sampled_study,
    spans,
)
from tfarm.report.sections import PageSection, Picture
from tfarm.report.time_responses import (
    draw_slews,
    resolution_words,
    seen_words,
    slews_table,
    what_slews_show,
)
from tfarm.report.words import typeset

PAST_HUB = 1.25  # times the rate gain at which sampling the hub alone would break it: how far its locus goes

LOCUS_K2 = (-0.5, 1.5)  # of its locus: what holds when sampled, and a little of what does not, to either side


def sampled_section(arm: Arm, chain: Chain | None = None) -> PageSection:
    """The loop through the arm's own chain, under the default gains; one sentence for an arm without a loop."""
    chain = Chain() if chain is None else chain
    title = f"The sampled loop: does it still hold at {in_ms(chain)} ms?"
    if not has_loop(arm):
        return PageSection(anchor="sampled", title=title, words=(why_no_loop(arm),))
    data = sampled_study(arm, chain)
    blocks: list[Picture | Table] = [_overlay_picture(data), _periods_table(data), *_mode_blocks(data)]
    words = [sampled_in_short(data), chain_words(arm, chain), against_continuous(data), cure(data)]
    if arm.has_rigid_mode:
        loop = data.analysis.verdict.loop
        moved = slews(arm, data.gains, loop.chain, loop.plant.count)
        blocks.append(_slew_picture(moved))
        if moved.with_moment.stopped is None:
            coarse = strip_chart(arm, data.gains, moved.with_moment, loop.plant.count)
            blocks.append(_strip_picture(coarse, loop.chain))
    else:
        words.append(f"{what_holds(arm)}, so there is no slew to show in time.")
    return PageSection(anchor="sampled", title=title, words=words, facts=sampled_facts(data), blocks=blocks)


def _overlay_picture(data: Sampled) -> Picture:
    regions = data.regions
    low = plain(float(regions.continuous.axes[0][0]), 2)
    layers = (
        "Nested blues: C = 0 (for the first modes only), and what the same arm would do with a little damping. "
        if len(regions.sampled) > 1
        else ""
    )
    proven = "Below the dashed line lies what the energy argument proves at C = 0. " if data.arm.is_uniform else ""
    return Picture(
        stem="sampled-overlay",
        title="The same gains, continuous and sampled",
        caption=(
            "Sand: where the continuous loop is stable, with every mode. Blue: where the sampled one is. Sand without "
            f"blue is what a controller that ignores its clock would wrongly trust. {layers}{proven}"
            "All edges are exact crossings of the axis or the unit circle. "
            f"The axis is logarithmic: {RATE_GAIN} = 0 lies beyond its left end at {low}{beyond_words(data.arm)}. "
        ),
        alt=(
            f"Map of {' and '.join(PLANE)}: at {data.held} the continuous loop is stable for {MOMENT_GAIN} "
            f"{interval_words(data.continuous.around, data.continuous.looked_at)}, the sampled one "
            f"{interval_words(data.sampled_K2)}."
        ),
        figure=draw_overlay(regions),
        data=regions_table(regions, "sampled-overlay-data"),
    )


def beyond_words(arm: Arm) -> str:
    """From which rate gain down a free hub runs away, whatever the other gain; a sampled one too."""
    if not arm.has_rigid_mode:
        return ""
    least = f"−{plain(arm.rate_loss, 5)}, which takes what the hub loses" if arm.rate_loss else "0"
    return f", and nothing is stable at {RATE_GAIN} < {least}"


def _periods_table(data: Sampled) -> Table:
    rows = data.periods
    growth = np.array([row.verdict.log_radius / row.period for row in rows])
    ms = np.array([1e3 * row.period for row in rows])
    half = 500.0 / ms
    settled, modes = [row.verdict.is_settled for row in rows], [row.verdict.modes_used for row in rows]
    first = [f"{'' if known or not any(settled) else 'first '}{n}" for known, n in zip(settled, modes, strict=True)]
    held = "all that matter" if all(settled) else "the first so many" if not any(settled) else "where marked, the first"
    return Table(
        stem="sampled-periods",
        title="Faster or slower sampling",
        caption=(
            f"The same gains, {' and '.join(data.gains.told(name, plain) for name in PLANE)}, at other sample periods; "
            f"the verdicts hold for the modes given ({held}). Growth is that of the pole that decides, per second: "
            "negative is stable. Where the gains are not stable, the intervals are those that would be. "
        ),
        record=rows,
        columns=(
            Column("period_ms", "period", "ms", of=ms, digits=singly(plain)),
            Column("half_rate_hz", "aliased above", "Hz", of=half, digits=singly(plain)),
            Column("verdict", "verdict", of=lambda row: "stable" if row.verdict.log_radius < 0 else "unstable"),
            Column("growth_1_s", "growth", "1/s", of=growth, digits=singly(scientific, 3)),
            Column("modes", "modes", of=modes, shown=first),
            *(_window_column(name, data) for name in PLANE),
        ),
    )


def _window_column(name: str, data: Sampled) -> Column:
    """The interval around the gain of that name, or the ends of all that there are, at each period."""
    rows = [(row.windows[name], data.gains[name]) for row in data.periods]
    here = [around(list(windows), gain) for windows, gain in rows]
    every = [tuple(end for window in windows for end in window) for windows, _ in rows]
    values = [window or others for window, others in zip(here, every, strict=True)]
    shown = [spans(*row) for row in rows]
    return Column(f"stable_{name}", f"stable {name}", shown_unit(name, data.arm), of=values, shown=shown)


def _mode_blocks(data: Sampled) -> list[Picture | Table]:
    loop, table = data.analysis.verdict.loop, data.analysis.modes
    T = loop.chain.sampling.period
    turning = data.arm.hub_side_inertia * data.arm.input_per_torque  # at the hub, in the unit of the input times s^2
    top = max(PAST_HUB * 2 * turning / T, STRONGER * data.gains[RATE_GAIN])
    found = sampled_loci(loop, top, LOCUS_K2)
    aliased = [int(i) for i, band in zip(table.index, table.band, strict=True) if band > 0]
    first = f"From mode {aliased[0]} on all are aliased. " if aliased else "No mode here is aliased. "
    picture = Picture(
        stem="sampled-loci",
        title="Poles of the sampled loop",
        caption=(
            f"Left: the samples tell frequencies apart up to {plain(0.5 / T)} Hz only; what lies in the shaded strips "
            f"is seen, and moved by the gains, where the arrows end. {first}Lines: {RATE_GAIN} alone, growing from the "
            "open circles to the dots; the real axis is logarithmic away from 0. Right: the z-plane, stable inside the "
            "circle; open circles where the range begins, dots at the gains, orange the aliased modes, grey hub and "
            f"delay. What looks like lying on the circle is told apart by the next picture."
        ),
        alt=f"Root loci of the sampled loop in the folded s-plane and the z-plane; {len(aliased)} aliased modes.",
        figure=draw_folded_loci(found),
        data=loci_table(found, "sampled-loci-data"),
    )
    grown = table.index[table.log_radius > 0]
    rows = mode_rows(loop, table, "sampled-modes")
    said = grown_words(grown.tolist())
    chart = Picture(
        stem="sampled-growth",
        title="What each mode gains or loses a sample",
        caption=(
            f"Upwards is growth, downwards decay, both on logarithmic scales. {first_order_words(table)}Where a filled "
            "dot lies far from what is added to first order, another mode in the loop decides. "
            f"Of {table.index.size} modes, {said}."
        ),
        alt=f"Growth per sample of {table.index.size} modes over their frequency; {said}.",
        figure=draw_modes(loop, table),
        data=replace(rows, stem="sampled-growth-data"),
    )
    return [picture, chart, rows]


def first_order_words(table: ModeTable) -> str:
    """What the rate gain does in each band where that alternates, and which modes the moment gain drives."""
    shaded = (
        "Shaded are the bands in which hub rate feedback destabilises, as the samples see a rate of the wrong sign "
        "there; above the narrowest one shown they alternate too closely to draw. "
    )
    words = shaded if table.rate_alternates and table.by_rate.any() else ""
    if not table.by_moment.any():
        return words
    driven = table.driven_by_moment
    effect = f"drives {named_modes(driven)}" if driven else "damps every mode"
    return f"{words}Root moment feedback {effect} to first order. "


def grown_words(grown: list[int]) -> str:
    """Which modes grow, as the end of "Of 20 modes ..."."""
    if not grown:
        return "none grows"
    return f"{'one grows' if len(grown) == 1 else f'{len(grown)} grow'}: {named_modes(grown)}"


def named_modes(numbers: list[int]) -> str:
    """Modes by their numbers: mode 1, modes 2, 5."""
    return f"mode{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}"


def _slew_picture(moved: Slews) -> Picture:
    volts = (
        "The motor is in N m, as the file gives no motor constant: its volts are this curve divided by it. "
        if moved.with_moment.volts is None and moved.arm.input_unit == "N m"
        else ""
    )
    if moved.arm.motor is not None and moved.arm.input_unit == "N m":
        volts = "The motor's torque is that at the hub, behind the gear. "
    return Picture(
        stem="sampled-slew",
        title="The slew, with and without moment feedback",
        caption=(
            f"{what_slews_show(moved)} A bang-bang slew with rigid feedforward; the moment feedback sees "
            f"{seen_words(moved)}. The dotted line is the end of the slew; the tip is shown against a rigid "
            f"arm's on its reference.{resolution_words(moved.each.values())} {volts}"
        ),
        alt=f"Root moment, tip and motor torque of a slew. {what_slews_show(moved)}",
        figure=draw_slews(moved),
        data=slews_table(moved, "sampled-slew-data"),
    )


def _strip_picture(coarse: StripChart, own: Chain) -> Picture:
    chain, delay = coarse.simulation.chain, coarse.simulation.chain.sampling.delay_samples
    verdict = sampled_verdict(coarse.arm, coarse.gains, chain)
    clipped, read = int(coarse.saturated.sum()), coarse.simulation.saturated["moment"]
    unit = coarse.arm.input_unit
    what = (
        f"{clipped} of {coarse.asked.size} samples ask for more than the motor's {plain(coarse.limit, 3)} {unit} "
        f"(shaded); the moment is read in steps of {significant(coarse.step, 3)} N m"
    )
    beyond = f", and lies beyond the ADC's range at {read} samples" if read else ""
    late = f"{how_many(delay, 'sample')} of delay"
    return Picture(
        stem="sampled-strip",
        title="A coarse chain: ADC steps, delay, saturation",
        caption=(
            f"{example_words(own, chain)}: {chain.converters.moment_bits} bits of ADC over "
            f"±{plain(chain.converters.moment_range or 0.0, 3)} N m, {late}, and a motor that gives at most "
            f"{plain(coarse.limit, 3)} {unit}. {what[0].upper()}{what[1:]}{beyond}. Without its steps and limits "
            f"the loop with this delay is {typeset(verdict.sentence.partition(' (')[0])}."
            f"{resolution_words([coarse.simulation])}"
        ),
        alt=f"Strip chart of root moment and motor torque through a coarse chain; {what}.",
        figure=draw_strip_chart(coarse),
        data=strip_table(coarse, "sampled-strip-data"),
    )
