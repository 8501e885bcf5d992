"""The sampled loop of each case of a page: verdict, margins, stability intervals, modes, and motion in time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, Arm, HubFeedback, shown_unit
from tfarm.columns import Column, Table
from tfarm.digits import how_many, plain, scientific, significant, singly
from tfarm.dsp import Analysis, Chain, Verdict, sampled_verdict
from tfarm.dsp.chain import MOST_DELAY
from tfarm.dsp.crossings import around
from tfarm.dsp.modes import STRONGER, SampledLoci, sampled_loci
from tfarm.dsp.verdict import at_periods, sampled
from tfarm.plots.regions import StableRegions, draw_overlay, regions_table, stable_regions
from tfarm.plots.roots import draw_sampled_loci
from tfarm.records import record
from tfarm.report.cases import GivenLaw, LawOnArm, cases_of, has_loop, margins_of, on_hub, what_holds, why_no_loop
from tfarm.report.motion import measured_blocks, slew
from tfarm.report.sections import Fact, PageSection, Picture, in_ms, span, spans, typeset, upper
from tfarm.schema import table

MORE_DELAY = (0.0, 0.5, 1.0)  # samples of further delay for which the verdict is given
PAST_HUB = 1.25  # times the rate gain at which sampling alone makes the hub unstable: the end of its locus
LOCUS_K2 = (-0.5, 1.5)  # of its locus: the stability interval of most arms, and a little to either side
DELAYS_CAPTION = (
    "The exact loop with further delay between reading and acting. Stable: every |z| below 1{apart}. {held}"
)
VERDICT_COLUMNS = ("word", "spectral_radius", "time_constant", "slowest", "holds_for")
APART_FROM_FREE = ", that at z = 1 of a hub without angle feedback apart"
NUMBERS_CAPTION = (
    "Each number alone, the others fixed; a name that ends in “gain” is a factor on that part of the controller. At an "
    "edge a pole of the sampled loop is on the unit circle ({modes})."
)
MODES_CAPTION = (
    "ln|z|: change of a mode's size per sample of {ms} ms, negative where it decays. Own damping: without feedback; "
    "{gains}: to first order; the closed loop is the exact pole. Modes above {half} Hz (band 1 and on) are aliased: "
    "the samples show them at the frequency given."
)
LOCI_CAPTION = (
    "z-plane, stable inside the circle. Open circles: where the range of the gain begins; dots: gains of the loop; "
    "orange: modes above {half} Hz, which are aliased; grey: hub, filters and delay."
)
OVERLAY_CAPTION = (
    "Sand: stability region of the continuous loop, with every mode. Blue: that of the sampled loop. {layers}{proven}"
    "Edges are exact crossings of the imaginary axis or the unit circle. Logarithmic axis: {rate} = 0 lies beyond its "
    "left end at {low}{beyond}."
)
NO_DAMPING_HELPS = "none up to 15 % of critical in the first mode"


@dataclass(frozen=True)
@record
class SampledCase:
    """A case with the analysis of its sampled loop."""

    each: LawOnArm
    analysis: Analysis

    @property
    def verdict(self) -> Verdict:
        """The verdict on the loop."""
        return self.analysis.verdict


def sampled_section(arm: Arm, chain: Chain, laws: Sequence[GivenLaw] = ()) -> PageSection:
    """The sampled loop under the laws given, or the default gains; one sentence for an arm without a loop.

    In time: runs measured under the laws with the exact loop over them, else the slew.
    """
    title = f"The sampled loop, {in_ms(chain)} ms"
    if not laws and not has_loop(arm):
        return PageSection(anchor="sampled", title=title, words=(why_no_loop(arm),))
    cases = cases_of(arm, laws)
    found = [SampledCase(each, sampled(each.arm, each.law, chain)) for each in cases]
    words = [*map(answer, found), chain_words(arm, chain)]
    blocks: list[Picture | Table] = [*map(numbers_table, found), delays_table(found, chain)]
    if not laws:
        gains = found[0].analysis.loop.gains
        blocks = [overlay_picture(stable_regions(arm, gains, chain), found[0]), *blocks]
        blocks += [periods_table(arm, gains, chain), loci_picture(found[0].analysis)]
    blocks += [modes_table(each) for each in found]
    if any(each.given.measured is not None for each in cases):
        blocks += measured_blocks(cases, chain)
    if not arm.has_rigid_mode:
        words.append(f"{what_holds(arm)}: no slew is simulated.")
    elif any(each.given.measured is None for each in cases):
        slewed = cases if laws else (without_moment(arm, found[0]), *cases)
        pictures, said = slew(arm, chain, slewed)
        blocks += pictures
        words += said
    facts = [fact for each in found for fact in facts_of(each)]
    return PageSection(anchor="sampled", title=title, facts=facts, words=words, blocks=blocks)


def without_moment(arm: Arm, found: SampledCase) -> LawOnArm:
    """The gains of a case without the feedback of the root moment."""
    gains = found.analysis.loop.gains.having(MOMENT_GAIN, 0.0)
    return on_hub(arm, gains, f"{MOMENT_GAIN} = 0", "without")


# ------------------------------------------------------------ verdict


def answer(found: SampledCase) -> str:
    """Verdict, delay margin, how far both are certified, and the dominant pole."""
    verdict, T = found.verdict, found.verdict.loop.chain.sampling.period
    delay = f", delay margin {delay_words(found)}" if verdict.is_stable else ""
    radius, growth = math.exp(verdict.log_radius), verdict.log_radius
    pace = f", time constant {significant(T / abs(growth), 3)} s" if growth else ""
    return typeset(
        f"{upper(found.each.name)}, {found.each.gains}: the loop is {verdict.word} when sampled every "
        f"{in_ms(verdict.loop.chain)} ms{delay} ({verdict.holds_for}). "
        f"Dominant pole: {verdict.slowest}, |z| = {plain(radius, 10)}{pace}."
    )


def delay_words(found: SampledCase) -> str:
    """The delay margin in ms and samples."""
    margin, T = found.analysis.delay_margin, found.verdict.loop.chain.sampling.period
    ms = significant(1e3 * T * margin.samples, 3)
    return f"{'over ' if margin.is_bound else ''}{ms} ms ({significant(margin.samples, 3)} samples)"


def facts_of(found: SampledCase) -> list[Fact]:
    """Verdict, delay margin and minimum structural damping of a case."""
    verdict, name = found.verdict, f"{found.each.name}: "
    beside = typeset(f"ln|z| = {scientific(verdict.log_radius, 3)} a sample")
    facts = [Fact(label=f"{name}{found.each.gains}", value=verdict.word.upper(), beside=beside)]
    if verdict.is_stable:
        facts.append(Fact(label=f"{name}delay margin", value=delay_words(found)))
    needed, arm = found.analysis.damping, found.each.arm
    if arm.has_elastic_link or not verdict.is_stable:
        held = "" if needed.is_settled else f"for the first {needed.modes} modes"
        value = "none" if needed.value == 0 else NO_DAMPING_HELPS
        if 0 < needed.value < math.inf:
            percent = 50 * needed.value * float(found.analysis.modes.natural_frequency[0])
            value = f"C = {scientific(needed.value, 2)} s"
            held = f"{scientific(percent, 2)} % of critical in the first mode{f', {held}' if held else ''}"
        facts.append(Fact(label=f"{name}minimum structural damping for stability", value=value, beside=held))
    return facts


def chain_words(arm: Arm, chain: Chain) -> str:
    """Every part of the chain that is not ideal."""
    sampling, converters, actuator = chain.sampling, chain.converters, chain.actuator
    sides = (("moment read", converters.moment_bits, converters.moment_range),
             ("torque written", converters.torque_bits, converters.torque_range))  # fmt: skip
    parts = (
        (True, f"sampled every {in_ms(chain)} ms"),
        (sampling.delay_samples, f"{how_many(sampling.delay_samples, 'sample')} of delay"),
        (math.isfinite(sampling.antialias_corner), f"an anti-alias filter at {plain(sampling.antialias_corner)} rad/s"),
        (converters.encoder_counts, f"an encoder of {converters.encoder_counts} counts a turn"),
        (converters.hub_rate == "difference", "the hub rate differenced from the encoder"),
        *((bits, f"a {name} with {bits} bits{'' if span is None else f' over ±{plain(span, 3)} N m'}")
          for name, bits, span in sides),
        (math.isfinite(actuator.torque_limit), f"an input of at most {plain(actuator.torque_limit)} {arm.input_unit}"),
        (actuator.hub_damping, f"hub damping of {plain(actuator.hub_damping)} N m s/rad"),
    )  # fmt: skip
    steps = " Verdicts are of the linear loop; steps and limits act in the simulations." * (not chain.is_linear)
    paper = " These are the paper's: the arm's file has no chain of its own." * (chain == Chain())
    return f"The chain: {', '.join(text for has, text in parts if has)}.{steps}{paper}"


def numbers_table(found: SampledCase) -> Table:
    """Stability intervals of each number of a case, the others fixed."""
    stem = "sampled-numbers" if found.each.key in ("default", "law") else f"sampled-numbers-{found.each.key[4:]}"
    caption = NUMBERS_CAPTION.format(modes=f"{found.verdict.modes_used} flexible modes")
    title = f"Stability intervals, {found.each.name}"
    return table(found.analysis.stability_intervals, stem=stem, title=title, caption=caption)


def delays_table(found: Sequence[SampledCase], chain: Chain) -> Table:
    """The verdict on each case as it is, and with half a sample and a whole one of further delay."""
    rows: list[tuple[str, float, Verdict]] = []
    T = chain.sampling.period
    for it in found:
        for more in MORE_DELAY:
            delay = chain.sampling.delay_samples + more
            if more and delay + it.each.law.delay / T > MOST_DELAY:
                continue
            late = replace(chain, sampling=replace(chain.sampling, delay_samples=delay))
            verdict = sampled_verdict(it.each.arm, it.each.law, late) if more else it.verdict
            rows.append((it.each.name, more, verdict))
    verdicts = [verdict for *_, verdict in rows]
    held = dict.fromkeys(f"{upper(verdict.holds_for)}." for verdict in verdicts)
    free = any(verdict.loop.has_free_angle for verdict in verdicts)
    first = (
        Column("law", "controller", of=[name for name, *_ in rows]),
        Column("further_delay_ms", "further delay", "ms", of=[1e3 * T * more for _, more, _ in rows],
               digits=singly(plain)),
    )  # fmt: skip
    return Table(
        stem="sampled-delays",
        title="Stability with further delay",
        caption=DELAYS_CAPTION.format(apart=APART_FROM_FREE * free, held=typeset(" ".join(held))),
        columns=(*first, *table(verdicts, VERDICT_COLUMNS).columns),
    )


def periods_table(arm: Arm, gains: HubFeedback, chain: Chain) -> Table:
    """The gains at other sampling periods, with their stability intervals there."""
    rows = at_periods(arm, gains, chain)
    return Table(
        stem="sampled-periods",
        title="Stability at other sampling periods",
        caption=(
            f"The same gains, {' and '.join(gains.gain_text(name, plain) for name in PLANE)}. Growth: of the dominant "
            "pole, per second: negative is stable. Verdicts hold for the modes given where they are not certified."
        ),
        record=rows,
        columns=(
            Column("period_ms", "period", "ms", of=lambda row: 1e3 * row.period, digits=singly(plain)),
            Column("half_rate_hz", "aliased above", "Hz", of=lambda row: 0.5 / row.period, digits=singly(plain)),
            *table([row.verdict for row in rows], VERDICT_COLUMNS).columns,
            *(
                Column(
                    f"stable_{name}", f"stable {name}", shown_unit(name, arm),
                    of=[
                        around(list(row.windows[name]), gains[name])
                        or tuple(end for window in row.windows[name] for end in window)
                        for row in rows
                    ],
                    shown=[spans(row.windows[name], gains[name]) for row in rows],
                )
                for name in PLANE
            ),
        ),
    )  # fmt: skip


def modes_table(found: SampledCase) -> Table:
    """The modes of the sampled loop one by one."""
    T = found.verdict.loop.chain.sampling.period
    gains = " and ".join(PLANE)
    suffix = "" if found.each.key in ("default", "law") else f"-{found.each.key.replace('_', '-')}"
    return table(
        found.analysis.modes,
        stem=f"sampled-modes{suffix}",
        title=f"Modes of the sampled loop, {found.each.name}",
        caption=MODES_CAPTION.format(ms=plain(1e3 * T), half=plain(0.5 / T), gains=gains),
    )


# ------------------------------------------------------------ pictures of gains


def overlay_picture(regions: StableRegions, found: SampledCase) -> Picture:
    """Stability regions of the continuous and of the sampled loop in one plane."""
    arm, gains = found.each.arm, found.analysis.loop.gains
    layers = "Nested blues: C = 0 (first modes only), and the same arm with a little damping. "
    low = plain(float(regions.continuous.axes[0][0]), 2)
    held = gains.gain_text(RATE_GAIN, plain)
    before = margins_of(arm, gains).windows[MOMENT_GAIN]
    after = found.analysis.interval(MOMENT_GAIN)
    both = f"{MOMENT_GAIN} {span(before.around, before.looked_at)} continuous, {span(after)} sampled"
    return Picture(
        stem="sampled-overlay",
        title="Stability regions, continuous and sampled",
        caption=OVERLAY_CAPTION.format(
            layers=layers * (len(regions.sampled) > 1),
            proven="Below the dashed line: stable at C = 0 by the energy argument. " * arm.is_uniform,
            rate=RATE_GAIN, low=low, beyond=beyond_words(arm),
        ) + f" At {held}: stable for {both}.",
        alt=f"Map of {' and '.join(PLANE)}: at {held} stable for {both}.",
        figure=draw_overlay(regions),
        data=regions_table(regions, "sampled-overlay-data"),
    )  # fmt: skip


def beyond_words(arm: Arm) -> str:
    """The rate gain below which a free hub is unstable, whatever the other gain; sampled too."""
    if not arm.has_rigid_mode:
        return ""
    least = f"−{plain(arm.rate_loss, 5)}, which takes what the hub loses" if arm.rate_loss else "0"
    return f", and nothing is stable at {RATE_GAIN} < {least}"


def loci_picture(found: Analysis) -> Picture:
    """Root loci of the sampled loop in the z-plane, along each gain."""
    loop, arm = found.loop, found.loop.plant.arm
    turning = arm.hub_side_inertia * arm.input_per_torque  # at the hub, in the unit of the input times s^2
    top = max(PAST_HUB * 2 * turning / loop.chain.sampling.period, STRONGER * loop.gains[RATE_GAIN])
    loci = sampled_loci(loop, top, LOCUS_K2)
    aliased = int((found.modes.band > 0).sum())
    return Picture(
        stem="sampled-loci",
        title="Root loci of the sampled loop",
        caption=LOCI_CAPTION.format(half=plain(loci.half_rate)),
        alt=f"Root loci of the sampled loop in the z-plane; {how_many(aliased, 'aliased mode')}.",
        figure=draw_sampled_loci(loci),
        data=loci_table(loci, "sampled-loci-data"),
    )


def loci_table(data: SampledLoci, stem: str) -> Table:
    """Every pole of the loci with Im z >= 0: a row a gain and a branch."""
    rows = []
    for name, locus in data.by.items():
        for value, poles in zip(locus.values.tolist(), locus.z, strict=True):
            loop = locus.loop.having(**{locus.gain: value})
            across, up = (loop.number(each) for each in PLANE)
            each = zip(locus.mode.tolist(), poles, strict=True)
            rows += [(name, across, up, mode, z.real, z.imag) for mode, z in each if not z.imag < 0]
    titles = {"locus": "locus", **{name: name for name in PLANE}, "mode": "mode", "real": "Re z", "imaginary": "Im z"}
    columns = [
        Column(*title, of=list(cells)) for title, cells in zip(titles.items(), zip(*rows, strict=True), strict=True)
    ]
    return Table(stem=stem, title="Poles of the sampled loop", columns=tuple(columns))


# ------------------------------------------------------------ in time
