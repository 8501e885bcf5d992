"""Does a 10 ms loop still hold?  Verdict, regions, loci, modes, the slew in time, and a coarse chain."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tfarm.arm import Arm, HubFeedback
from tfarm.dsp import Analysis, Gains, analyse, sampled_verdict, stable_windows
from tfarm.dsp.chain import Chain, Sampling
from tfarm.dsp.margins import around
from tfarm.loop.stability import stability
from tfarm.loop.windows import gain_windows
from tfarm.report.digits import plain, scientific, significant
from tfarm.report.discrete_loci import draw_loci, loci, loci_table
from tfarm.report.figures import Picture
from tfarm.report.loop_laws import SIGN, has_loop, why_no_loop
from tfarm.report.overlay import Overlay, draw_overlay, overlay, overlay_table
from tfarm.report.sampled_modes import draw_modes, mode_rows
from tfarm.report.sections import Fact, Section
from tfarm.report.strip_chart import StripChart, draw_strip_chart, strip_chart, strip_table
from tfarm.report.tables import Column, Table, number_column, text_column
from tfarm.report.time_responses import Slews, draw_slews, slews, slews_table, what_slews_show

GAINS = Gains(K1=0.3, K2=0.3)
PERIODS = (0.001, 0.005, 0.01, 0.02, 0.05)  # s
LOCUS_K2 = (-0.5, 1.5)
PAST_HUB = 1.25  # times the K1 at which sampling the hub alone would break it: how far its locus goes
DEEPEST = -50.0  # K2: how far down the continuous window is looked for
DAY = 86400.0  # s
SHORT_SIGN = "A positive root moment accelerates the hub; with the gauge reversed K2 changes its sign."
Window = tuple[float, float]


@dataclass(frozen=True)
class Sampled:
    """Everything that the section says and draws."""

    arm: Arm
    analysis: Analysis
    continuous_K2: Window | None
    regions: Overlay
    periods: tuple[Row, ...]

    @property
    def ms(self) -> str:
        """The sample period in ms."""
        return plain(1e3 * self.analysis.verdict.loop.chain.sampling.period)

    @property
    def sampled_K2(self) -> Window | None:
        """The stable interval of K2 around the gains."""
        return around(self.analysis.K2_windows, GAINS.K2)


@dataclass(frozen=True)
class Row:
    """One sample period: its verdict, and the stable intervals around the gains."""

    period: float
    analysis_modes: int
    log_radius: float
    K1: Window | None
    K2: Window | None


def sampled_section(arm: Arm) -> Section:
    """The loop at 10 ms under the default gains; one sentence for an arm without a loop."""
    title = "The sampled loop: does it still hold at 10 ms?"
    if not has_loop(arm):
        return Section(anchor="sampled", title=title, words=(why_no_loop(arm),))
    data = study(arm)
    blocks: list[Picture | Table] = [_overlay_picture(data), _periods_table(data), *_mode_blocks(data)]
    words = [short_answer(data), compared(data), cure(data), SIGN]
    if arm.has_rigid_mode:
        blocks += _time_blocks(data)
    else:
        words.append("The tip of this arm is held, so there is no slew to show in time.")
    return Section(anchor="sampled", title=title, words=words, facts=headline_facts(data), blocks=blocks)


def study(arm: Arm) -> Sampled:
    """The numbers of the section.  Raises ParameterError for an arm without a loop."""
    chain = Chain()
    analysis = analyse(arm, GAINS, chain)
    window = gain_windows(stability(arm, HubFeedback(K1=GAINS.K1, K2=GAINS.K2)), "K2").around
    rows = tuple(_row(arm, period) for period in PERIODS)
    return Sampled(arm, analysis, window, overlay(arm, GAINS, chain), rows)


def _row(arm: Arm, period: float) -> Row:
    verdict = sampled_verdict(arm, GAINS, Chain(sampling=Sampling(period=period)))
    windows = {name: stable_windows(verdict.loop, name) for name in ("K1", "K2")}
    return Row(
        period,
        verdict.modes_used,
        verdict.loop.poles.log_spectral_radius,
        around(windows["K1"], GAINS.K1),
        around(windows["K2"], GAINS.K2),
    )


# ------------------------------------------------------------ words


def short_answer(data: Sampled) -> str:
    """Yes or no, for how many modes, and how fast."""
    verdict = data.analysis.verdict
    growth = verdict.loop.poles.log_spectral_radius
    gains = f"K1 = {plain(GAINS.K1)} N m s/rad and K2 = {plain(GAINS.K2)}"
    modes = verdict.modes_used
    settled = f"with all modes that matter ({modes})" if verdict.is_settled else f"as far as its first {modes} modes go"
    if verdict.is_stable:
        lead = f"Yes: sampled every {data.ms} ms with {gains}, the loop is stable, {settled}."
    else:
        lead = f"Not strictly: sampled every {data.ms} ms with {gains}, the loop is unstable, {settled}."
    return f"{lead} {_slowest(data, growth)}"


def _slowest(data: Sampled, growth: float) -> str:
    """The pole that decides, and in what time it changes by a factor of two."""
    verdict, T = data.analysis.verdict, data.analysis.verdict.loop.chain.sampling.period
    what = verdict.sentence.partition(": ")[2].partition(" (")[0]
    what = what[0].upper() + what[1:]
    if growth == 0:
        return f"{what}."
    verb = "doubles" if growth > 0 else "halves"
    return f"{_typeset(what)}: it {verb} in {duration(T * math.log(2) / abs(growth))}."


def _typeset(text: str) -> str:
    """Powers of ten as a person writes them."""
    words = []
    for word in text.split(" "):
        is_power = "e-" in word or "e+" in word
        words.append(scientific(float(word), 3) if is_power else word)
    return " ".join(words)


def duration(seconds: float) -> str:
    """A time in the unit that a person would use."""
    for unit, size in (("days", DAY), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2 * size:
            return f"{significant(seconds / size, 2)} {unit}"
    return f"{significant(seconds, 2)} s"


def compared(data: Sampled) -> str:
    """The continuous interval of K2 against the sampled one."""
    continuous = interval(data.continuous_K2)
    sampled = interval(data.sampled_K2, cut=False)
    modes = "" if data.analysis.verdict.is_settled else f" (first {data.analysis.verdict.modes_used} modes)"
    both = f"the continuous loop is stable for K2 {continuous}; the sampled one {sampled}{modes}."
    told = f"At K1 = {plain(GAINS.K1)} {both}"
    if data.sampled_K2 is None:
        return f"{told} Sampling loses what the continuous proof promised."
    low, high = data.sampled_K2
    lost = "all negative K2" if low >= 0 else f"K2 below {significant(low, 3)}"
    gained = f", and adds room up to {significant(high, 4)}" if high > 1 else ""
    return (
        f"{told} Sampling takes away {lost}{gained}: the energy argument holds for the continuous loop alone and says "
        "nothing about this one."
    )


def interval(window: Window | None, cut: bool = True) -> str:
    """An interval of K2 in words; `cut` where -50 is only the end of the search."""
    if window is None:
        return "for no K2 around this one"
    low, high = window
    if math.isinf(low) or (cut and low <= DEEPEST):
        beyond = "" if math.isinf(low) else " (looked at down to −50)"
        return f"below {significant(high, 5)}{beyond}"
    return f"from {significant(low, 4)} to {significant(high, 5)}"


def cure(data: Sampled) -> str:
    """How much damping makes these gains safe, and how far the arm is from it."""
    needed, own = data.analysis.required_damping, data.arm.link.damping
    if math.isinf(needed):
        return "No Kelvin-Voigt damping up to 15 % of critical in the first mode makes these gains stable."
    if needed == 0:
        modes = data.analysis.verdict.modes_used
        return (
            f"No damping is needed for the first {modes} modes. Without damping there is always a higher mode to ask "
            "about, so this is no proof for the arm with all of them; a little damping settles those."
        )
    if own:
        return (
            f"Without damping the sampled loop would not hold. How little cures it: C = {scientific(needed, 2)} s is "
            f"enough, and this arm has {scientific(own, 2)} s."
        )
    first = float(data.analysis.modes.natural_frequency[0])
    return (
        f"How little cures it: Kelvin-Voigt damping of C = {scientific(needed, 2)} s, "
        f"{scientific(50 * needed * first, 2)} % of critical in the first mode, and these gains are stable. Every real "
        "arm has more."
    )


def headline_facts(data: Sampled) -> tuple[Fact, ...]:
    """The headline numbers."""
    analysis = data.analysis
    verdict, margin = analysis.verdict, analysis.delay_margin
    T, growth = verdict.loop.chain.sampling.period, verdict.loop.poles.log_spectral_radius
    held = "all modes" if verdict.is_settled else f"first {verdict.modes_used} modes"
    answer, word = ("yes", "stable") if verdict.is_stable else ("not strictly", "unstable")
    K1 = around(analysis.K1_windows, GAINS.K1)
    delay = f"{'> ' if margin.is_bound else ''}{significant(1e3 * T * margin.samples, 3)}"
    samples = f"{significant(margin.samples, 3)} samples"
    return (
        Fact(label=f"does a {data.ms} ms loop hold?", value=answer, beside=f"{word}, {held}"),
        Fact(label="ln|z| a sample, largest", value=scientific(growth, 3), beside="below 0 is stable"),
        Fact(label="stable K2", value=_span(data.sampled_K2), beside=f"continuous: {_span(data.continuous_K2)}"),
        Fact(label="stable K1", value=_span(K1), unit="N m s/rad", beside=f"at K2 = {plain(GAINS.K2)}"),
        Fact(label="further delay it bears", value=delay, unit="ms", beside=samples),
        Fact(label="damping C that it needs", value=scientific(analysis.required_damping, 2), unit="s"),
    )


def _span(window: Window | None) -> str:
    if window is None:
        return "none"
    low, high = window
    return f"< {significant(high, 4)}" if low <= DEEPEST else f"{significant(low, 3)} … {significant(high, 4)}"


# ------------------------------------------------------------ blocks


def _overlay_picture(data: Sampled) -> Picture:
    regions = data.regions
    low = plain(regions.K1_range[0], 2)
    layers = (
        "Nested blues: C = 0 (for the first modes only), and what the same arm would do with a little damping. "
        if len(regions.sampled) > 1
        else ""
    )
    return Picture(
        stem="sampled-overlay",
        title="The same gains, continuous and sampled",
        caption=(
            "Sand: where the continuous loop is stable, with every mode. Blue: where the sampled one is. Sand without "
            f"blue is what a controller that ignores its clock would wrongly trust. {layers}Below the dashed line lies "
            "what the energy argument proves at C = 0. All edges are exact crossings of the axis or the unit circle. "
            f"The axis is logarithmic: K1 = 0 lies beyond its left end at {low}, and nothing is stable at K1 < 0. "
            f"{SHORT_SIGN}"
        ),
        alt=(
            f"Map of K1 and K2: at K1 = {plain(GAINS.K1)} the continuous loop is stable for K2 "
            f"{interval(data.continuous_K2)}, the sampled one {interval(data.sampled_K2, cut=False)}."
        ),
        figure=draw_overlay(regions),
        data=overlay_table(regions, "sampled-overlay-data"),
    )


def _periods_table(data: Sampled) -> Table:
    rows = data.periods
    growth = np.array([row.log_radius / row.period for row in rows])
    ms = np.array([1e3 * row.period for row in rows])
    half = 500.0 / ms
    held = "all that matter" if data.arm.link.damping else "the first 20"
    return Table(
        stem="sampled-periods",
        title="Faster or slower sampling",
        caption=(
            f"The same gains, K1 = {plain(GAINS.K1)} and K2 = {plain(GAINS.K2)}, at other sample periods; the verdicts "
            f"hold for the modes given ({held}). Growth is that of the pole that decides, per second: negative is "
            f"stable. {SHORT_SIGN}"
        ),
        columns=(
            number_column("period_ms", "period", "ms", ms, [plain(x) for x in ms]),
            number_column("half_rate_hz", "aliased above", "Hz", half, [plain(x) for x in half]),
            text_column("verdict", "verdict", ["stable" if row.log_radius < 0 else "unstable" for row in rows]),
            number_column("growth_1_s", "growth", "1/s", growth, [scientific(x, 3) for x in growth]),
            Column(
                key="modes",
                title="modes",
                values=[row.analysis_modes for row in rows],
                cells=[str(row.analysis_modes) for row in rows],
            ),
            _window_column("stable_K1", "stable K1", "N m s/rad", [row.K1 for row in rows]),
            _window_column("stable_K2", "stable K2", "", [row.K2 for row in rows]),
        ),
    )


def _window_column(key: str, title: str, unit: str, windows: list[Window | None]) -> Column:
    values = [window if window is not None else () for window in windows]
    return Column(key=key, title=title, unit=unit, values=values, cells=[_span(window) for window in windows])


def _mode_blocks(data: Sampled) -> list[Picture | Table]:
    loop, table = data.analysis.verdict.loop, data.analysis.modes
    T = loop.chain.sampling.period
    found = loci(loop, PAST_HUB * 2 * data.arm.hub.inertia / T, LOCUS_K2)
    aliased = [int(i) for i, band in zip(table.index, table.band, strict=True) if band > 0]
    first = f"From mode {aliased[0]} on all are aliased. " if aliased else "No mode here is aliased. "
    picture = Picture(
        stem="sampled-loci",
        title="Poles of the sampled loop",
        caption=(
            f"Left: the samples tell frequencies apart up to {plain(0.5 / T)} Hz only; what lies in the shaded strips "
            f"is seen, and moved by the gains, where the arrows end. {first}Lines: K1 alone, growing from the open "
            "circles to the dots; the real axis is logarithmic away from 0. Right: the z-plane, stable inside the "
            "circle; open circles where the range begins, dots at the gains, orange the aliased modes, grey hub and "
            f"delay. What looks like lying on the circle is told apart by the next picture. {SHORT_SIGN}"
        ),
        alt=f"Root loci of the sampled loop in the folded s-plane and the z-plane; {len(aliased)} aliased modes.",
        figure=draw_loci(found),
        data=loci_table(found, "sampled-loci-data"),
    )
    grown = table.index[table.log_radius > 0]
    rows = mode_rows(loop, table, "sampled-modes", SHORT_SIGN)
    said = f"growing: {', '.join(map(str, grown))}" if grown.size else "none grows"
    chart = Picture(
        stem="sampled-growth",
        title="What each mode gains or loses a sample",
        caption=(
            "Upwards is growth, downwards decay, both on logarithmic scales. Shaded are the bands in which hub rate "
            "feedback destabilises, as the samples see a rate of the wrong sign there; above the narrowest one shown "
            "they alternate too closely to draw. Root moment feedback with K2 > 0 damps in every band to first order; "
            "where a filled dot lies far from that, another mode in the loop decides. "
            f"Of {table.index.size} modes, {said}. {SHORT_SIGN}"
        ),
        alt=f"Growth per sample of {table.index.size} modes over their frequency; {said}.",
        figure=draw_modes(loop, table),
        data=replace(rows, stem="sampled-growth-data", is_data=True),
    )
    return [picture, chart, rows]


def _time_blocks(data: Sampled) -> list[Picture | Table]:
    loop = data.analysis.verdict.loop
    moved = slews(data.arm, GAINS, loop.chain, loop.plant.count)
    coarse = strip_chart(data.arm, GAINS, moved.with_moment, loop.plant.count)
    return [_slew_picture(moved), _strip_picture(coarse)]


def _slew_picture(moved: Slews) -> Picture:
    return Picture(
        stem="sampled-slew",
        title="The slew, with and without moment feedback",
        caption=(
            f"{what_slews_show(moved)} A bang-bang slew with rigid feedforward; the moment feedback sees the moment "
            "less the rigid arm's (dashed). The dotted line is the end of the slew; the tip is shown against L times "
            "the reference angle. The motor is in N m, as the paper gives no motor constant: its volts are this curve "
            f"divided by it. {SHORT_SIGN}"
        ),
        alt=f"Root moment, tip and motor torque of a slew. {what_slews_show(moved)}",
        figure=draw_slews(moved),
        data=slews_table(moved, "sampled-slew-data"),
    )


def _strip_picture(coarse: StripChart) -> Picture:
    chain = coarse.simulation.chain
    verdict = sampled_verdict(coarse.arm, coarse.gains, chain)
    clipped = int(coarse.saturated.sum())
    what = (
        f"{clipped} of {coarse.asked.size} samples ask for more than the motor's {plain(coarse.limit, 3)} N m "
        f"(shaded); the moment is read in steps of {significant(coarse.step, 3)} N m (faint lines in the close-up)"
    )
    return Picture(
        stem="sampled-strip",
        title="A coarse chain: ADC steps, delay, saturation",
        caption=(
            f"An example, not the paper's hardware: {chain.converters.moment_bits} bits of ADC over "
            f"±{plain(chain.converters.moment_range or 0.0, 3)} N m, one sample of delay, and a motor that gives 80 % "
            f"of what the ideal slew takes. {what[0].upper()}{what[1:]}. Without its steps and limits the loop with "
            f"this delay is {_typeset(verdict.sentence.partition(' (')[0])}."
        ),
        alt=f"Strip chart of root moment and motor torque through a coarse chain; {what}.",
        figure=draw_strip_chart(coarse),
        data=strip_table(coarse, "sampled-strip-data"),
    )
