"""What is said about the sampled loop: its numbers, and the answer in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tfarm.arm import Arm, HubFeedback
from tfarm.dsp import Analysis, analyse, sampled_verdict, stable_windows
from tfarm.dsp.chain import Chain, Sampling
from tfarm.dsp.margins import around
from tfarm.loop.stability import stability
from tfarm.loop.windows import gain_windows
from tfarm.records import record
from tfarm.report.digits import plain, scientific, significant
from tfarm.report.overlay import Overlay, overlay
from tfarm.report.sections import Fact
from tfarm.spectrum.scales import default_gains

PERIODS = (0.001, 0.005, 0.01, 0.02, 0.05)  # s
DEEPEST = -50.0  # K2: how far down the continuous window is looked for
DAY = 86400.0  # s
SHORT_SIGN = "A positive root moment accelerates the hub; with the gauge reversed K2 changes its sign."
Window = tuple[float, float]


@dataclass(frozen=True)
@record
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
    def gains(self) -> HubFeedback:
        """The gains that the section is about."""
        return self.analysis.verdict.loop.gains

    @property
    def sampled_K2(self) -> Window | None:
        """The stable interval of K2 around the gains."""
        return around(self.analysis.K2_windows, self.gains.K2)


@dataclass(frozen=True)
class Row:
    """One sample period: its verdict, and the stable intervals around the gains."""

    period: float
    analysis_modes: int
    log_radius: float
    K1: Window | None
    K2: Window | None


def study(arm: Arm) -> Sampled:
    """The numbers of the section.  Raises ParameterError for an arm without a loop."""
    chain, gains = Chain(), default_gains(arm)
    analysis = analyse(arm, gains, chain)
    window = gain_windows(stability(arm, gains), "K2").around
    rows = tuple(_row(arm, gains, period) for period in PERIODS)
    return Sampled(arm, analysis, window, overlay(arm, gains, chain), rows)


def _row(arm: Arm, gains: HubFeedback, period: float) -> Row:
    verdict = sampled_verdict(arm, gains, Chain(sampling=Sampling(period=period)))
    windows = {name: stable_windows(verdict.loop, name) for name in ("K1", "K2")}
    return Row(
        period,
        verdict.modes_used,
        verdict.loop.poles.log_spectral_radius,
        around(windows["K1"], gains.K1),
        around(windows["K2"], gains.K2),
    )


# ------------------------------------------------------------ words


def short_answer(data: Sampled) -> str:
    """Yes or no, for how many modes, and how fast."""
    verdict = data.analysis.verdict
    growth = verdict.loop.poles.log_spectral_radius
    gains = f"K1 = {plain(data.gains.K1)} N m s/rad and K2 = {plain(data.gains.K2)}"
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
    return f"{typeset(what)}: it {verb} in {duration(T * math.log(2) / abs(growth))}."


def typeset(text: str) -> str:
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
    told = f"At K1 = {plain(data.gains.K1)} {both}"
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
    K1, at = around(analysis.K1_windows, data.gains.K1), f"at K2 = {plain(data.gains.K2)}"
    delay = f"{'> ' if margin.is_bound else ''}{significant(1e3 * T * margin.samples, 3)}"
    samples = f"{significant(margin.samples, 3)} samples"
    return (
        Fact(label=f"does a {data.ms} ms loop hold?", value=answer, beside=f"{word}, {held}"),
        Fact(label="ln|z| a sample, largest", value=scientific(growth, 3), beside="below 0 is stable"),
        Fact(label="stable K2", value=span(data.sampled_K2), beside=f"continuous: {span(data.continuous_K2)}"),
        Fact(label="stable K1", value=span(K1), unit="N m s/rad" if K1 else "", beside=at),
        Fact(label="further delay it bears", value=delay, unit="ms", beside=samples),
        Fact(label="damping C that it needs", value=scientific(analysis.required_damping, 2), unit="s"),
    )


def span(window: Window | None) -> str:
    """An interval of a gain in a few digits; one that was looked for down to -50 has no lower end."""
    if window is None:
        return "none"
    low, high = window
    if low <= DEEPEST:
        return f"< {significant(high, 4)}"
    lower = f"{low:.2g}".replace("-", "−") if 1e-4 < abs(low) < 1e-3 else significant(low, 3)
    return f"{lower} … {significant(high, 4)}"
