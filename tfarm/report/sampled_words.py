"""What is said about the sampled loop: its numbers, and the answer in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, Arm, HubFeedback, unit_of
from tfarm.comparing.regions import StableRegions, stable_regions
from tfarm.crossing import Window
from tfarm.digits import how_many, plain, scientific, significant
from tfarm.dsp import Analysis, Verdict
from tfarm.dsp.chain import Chain
from tfarm.dsp.crossings import around
from tfarm.dsp.verdict import AtPeriod, at_periods, sampled
from tfarm.loop.stability import stability
from tfarm.loop.windows import Windows, windows_of
from tfarm.records import record
from tfarm.report.sections import Fact
from tfarm.report.words import typeset, upper
from tfarm.spectrum.scales import default_gains, default_words

EVERYWHERE = (-math.inf, math.inf)  # gains of any size: an interval that has no end but its own
MOVED = 1e-4  # an end of a window that sampling moves by less is said to stay, in its own size
DAY = 86400.0  # s
SLOW_GROWTH = 60.0  # s: what takes longer to double is no growth that anyone would see
ANYONE_HAS = 0.05  # % of critical damping: less than any real arm has


@dataclass(frozen=True)
@record
class Sampled:
    """Everything that the section says and draws.  `continuous`: the moment gain's windows without a clock."""

    arm: Arm
    analysis: Analysis
    continuous: Windows
    regions: StableRegions
    periods: tuple[AtPeriod, ...]

    @property
    def chain(self) -> Chain:
        """The arm's own chain."""
        return self.analysis.verdict.loop.chain

    @property
    def ms(self) -> str:
        """The sample period in ms."""
        return in_ms(self.chain)

    @property
    def gains(self) -> HubFeedback:
        """The gains that the section is about."""
        return self.analysis.verdict.loop.gains

    @property
    def sampled_K2(self) -> Window | None:
        """The stable interval of the moment gain around the gains."""
        return around(self.analysis.windows[MOMENT_GAIN], self.gains[MOMENT_GAIN])

    @property
    def held(self) -> str:
        """The rate gain that the intervals of the moment gain hold for."""
        return self.gains.told(RATE_GAIN, plain)


def in_ms(chain: Chain) -> str:
    """The sample period in ms."""
    return plain(1e3 * chain.sampling.period)


def sampled_study(arm: Arm, chain: Chain) -> Sampled:
    """The numbers of the section.  Raises ParameterError for an arm without a loop."""
    gains = default_gains(arm)
    analysis = sampled(arm, gains, chain)
    windows = windows_of(stability(arm, gains), [MOMENT_GAIN])[MOMENT_GAIN]
    return Sampled(arm, analysis, windows, stable_regions(arm, gains, chain), at_periods(arm, gains, chain))


# ------------------------------------------------------------ words


def sampled_in_short(data: Sampled) -> str:
    """Yes or no, by how much, for how many modes; the pole that decides, and in what time it doubles or halves."""
    verdict, T = data.analysis.verdict, data.chain.sampling.period
    gains = " and ".join(data.gains.told(name, plain, data.arm) for name in PLANE)
    settled = f"with {_modes(verdict)}" if verdict.is_settled else f"as far as its {_modes(verdict)} go"
    is_stable, growth = verdict.is_stable, verdict.log_radius
    margin = f" and bears {_delay(data)} more of delay" if is_stable else ""
    word = "stable" if is_stable else "marginal" if verdict.word == "marginal" else "unstable"
    lead = f"{_yes_or_no(data)}: sampled every {data.ms} ms with {gains}, the loop is {word}{margin}, {settled}."
    what = upper(verdict.sentence.partition(": ")[2].partition(" (")[0])
    if growth:
        verb = "doubles" if growth > 0 else "halves"
        what = f"{typeset(what)}: it {verb} in {duration(T * math.log(2) / abs(growth))}"
    return f"{lead} {what}."


def _yes_or_no(data: Sampled) -> str:
    """No strict yes where the growth is too slow for anyone to see."""
    verdict = data.analysis.verdict
    if verdict.is_stable:
        return "Yes"
    growth = verdict.log_radius
    return "Not strictly" if growth * SLOW_GROWTH < data.chain.sampling.period * math.log(2) else "No"


def _delay(data: Sampled) -> str:
    """The further delay that the loop bears, in ms."""
    margin = data.analysis.delay_margin
    return f"{'over ' if margin.is_bound else ''}{significant(1e3 * data.chain.sampling.period * margin.samples, 3)} ms"


def _modes(verdict: Verdict) -> str:
    """The modes that a verdict holds for."""
    if verdict.band_rad_s is None:
        return f"first {verdict.modes_used} modes"
    return f"every mode below {scientific(verdict.band_rad_s, 2)} rad/s (not known beyond)"


def chain_words(arm: Arm, chain: Chain) -> str:
    """What the section is about: the arm's own chain, or what stands for it where its file says nothing."""
    sampling = chain.sampling
    told = [f"every {in_ms(chain)} ms"]
    if sampling.delay_samples:
        told.append(f"{how_many(sampling.delay_samples, 'sample')} of delay")
    if not math.isinf(sampling.antialias_corner):
        told.append(f"an anti-alias filter at {plain(sampling.antialias_corner)} rad/s")
    if chain.converters.hub_rate == "difference":
        told.append("the hub rate differenced from the encoder")
    if chain.actuator.hub_damping:
        told.append(f"hub damping of {plain(chain.actuator.hub_damping)} N m s/rad")
    whose = "as the arm's file has it"
    if chain == Chain():
        whose = "which is the paper's: the arm's file has no [sampling], [converters] or [actuator] of its own"
    gains = typeset(default_words(arm))
    return f"Sampled {', '.join(told)}, {whose}. Gains, for which a file has no place: {gains}."


def duration(seconds: float) -> str:
    """A time in the unit that a person would use."""
    for unit, size in (("days", DAY), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2 * size:
            return f"{significant(seconds / size, 2)} {unit}"
    return f"{significant(seconds, 2)} s"


def against_continuous(data: Sampled) -> str:
    """The continuous interval of the moment gain against the sampled one, end by end."""
    verdict, before, after = data.analysis.verdict, data.continuous.around, data.sampled_K2
    edges = [edge for pair in data.analysis.shown[MOMENT_GAIN] for edge in pair]
    modes = "" if all(edge.is_settled for edge in edges) else f" (first {verdict.modes_used} modes)"
    both = (
        f"the continuous loop is stable for {MOMENT_GAIN} {interval_words(before, data.continuous.looked_at)}; "
        f"the sampled one {interval_words(after)}{modes}"
    )
    told = f"At {data.held} {both}."
    if after is None:
        return told if before is None else f"{told} Sampling loses what holds without it."
    if before is None:
        return f"{told} Here it is the sampling that stabilises."
    found = _moved_ends(before, after, data.continuous.looked_at)
    moved = " and ".join(found) or "moves neither end by a hundredth of a per cent"
    if not data.arm.is_uniform:
        return f"{told} Sampling {moved}."
    return (
        f"{told} Sampling {moved}: the energy argument holds for the continuous loop alone and says nothing about this "
        "one."
    )


def _moved_ends(before: Window, after: Window, looked_at: Window) -> list[str]:
    """What sampling does to both ends of the moment gain; a lower one below which nothing was looked at is no end."""
    (low, high), (new_low, new_high), told = before, after, []
    is_bound = low == looked_at[0] and new_low <= low
    if abs(new_low - low) > MOVED * abs(low) and not is_bound:
        gone = f"all negative {MOMENT_GAIN}" if new_low == 0 else f"{MOMENT_GAIN} below {significant(new_low, 3)}"
        told.append(f"takes away {gone}" if new_low > low else f"adds room down to {significant(new_low, 3)}")
    if abs(new_high - high) > MOVED * abs(high):
        verb = "adds room up to" if new_high > high else f"takes away {MOMENT_GAIN} above"
        told.append(f"{verb} {significant(new_high, 4)}")
    return told


def interval_words(window: Window | None, looked_at: Window = EVERYWHERE) -> str:
    """An interval of the moment gain in words; an end of what was looked at is no edge, and is said to be none."""
    if window is None:
        return f"for no {MOMENT_GAIN} around this one"
    low, high = window
    no_low, no_high = (math.isinf(end) or end == bound for end, bound in zip(window, looked_at, strict=True))
    bounds = [f"down to {plain(low, 4)}"] * (no_low and not math.isinf(low))
    bounds += [f"up to {plain(high, 4)}"] * (no_high and not math.isinf(high))
    beyond = f" (looked at {' and '.join(bounds)})" if bounds else ""
    if no_low and no_high:
        return f"of any size{beyond}"
    if no_low:
        return f"below {significant(high, 5)}{beyond}"
    if no_high:
        return f"above {significant(low, 5)}{beyond}"
    return f"from {significant(low, 4)} to {significant(high, 5)}"


def cure(data: Sampled) -> str:
    """How much damping makes these gains safe, and how far the arm is from it."""
    needed, own = data.analysis.required_damping, data.arm.damping
    if math.isinf(needed):
        return "No Kelvin-Voigt damping up to 15 % of critical in the first mode makes these gains stable."
    if needed == 0:
        modes = data.analysis.damping.modes
        return (
            f"No damping is needed for the first {modes} modes. Without damping there is always a higher mode to ask "
            "about, so this is no proof for the arm with all of them; a little damping settles those."
        )
    if own:
        enough = "and this arm has" if own >= needed else "but this arm has only"
        little = f", {_share(data)} and less than any real arm has," if _is_next_to_nothing(data) else ""
        return (
            f"Without damping the sampled loop would not hold. What cures it: C = {scientific(needed, 2)} s{little} is "
            f"enough{_for_modes(data)}, {enough} {scientific(own, 2)} s."
        )
    more = " Every real arm has more." if _is_next_to_nothing(data) else ""
    return (
        f"What cures it: Kelvin-Voigt damping of C = {scientific(needed, 2)} s, {_share(data)}, "
        f"and these gains are stable{_for_modes(data)}.{more}"
    )


def _percent(data: Sampled) -> float:
    """The damping that the gains need, in per cent of critical damping of the first mode."""
    return 50 * data.analysis.required_damping * float(data.analysis.modes.natural_frequency[0])


def _share(data: Sampled) -> str:
    return f"{scientific(_percent(data), 2)} % of critical in the first mode"


def _is_next_to_nothing(data: Sampled) -> bool:
    return 0 < _percent(data) < ANYONE_HAS


def _for_modes(data: Sampled) -> str:
    """For which modes a damping is enough, where more was not proven."""
    found = data.analysis.damping
    return "" if found.is_settled else f" for the first {found.modes} modes"


def sampled_facts(data: Sampled) -> tuple[Fact, ...]:
    """The headline numbers."""
    analysis, gains = data.analysis, data.gains
    verdict, margin = analysis.verdict, analysis.delay_margin
    growth = verdict.log_radius
    held = _modes(verdict)
    late = f"{significant(margin.samples, 3)} samples"
    by = f"by {late} of delay" if verdict.is_stable else verdict.word
    continuous = span(data.continuous.around, data.continuous.looked_at)
    on_rate, on_moment = (spans(analysis.windows[name], gains[name]) for name in PLANE)
    return (
        Fact(label=f"does a {data.ms} ms loop hold?", value=_yes_or_no(data).lower(), beside=f"{by}, {held}"),
        Fact(label="ln|z| a sample, largest", value=scientific(growth, 3), beside="below 0 is stable"),
        Fact(label=f"stable {MOMENT_GAIN}", value=on_moment, beside=f"continuous: {continuous}"),
        Fact(
            label=f"stable {RATE_GAIN}",
            value=on_rate,
            unit=unit_of(RATE_GAIN, data.arm) if on_rate != "none" else "",
            beside=f"at {gains.told(MOMENT_GAIN, plain)}",
        ),
        Fact(
            label="further delay it bears",
            value=_delay(data).removesuffix(" ms"),
            unit="ms",
            beside=f"{significant(margin.samples, 3)} samples",
        ),
        damping_fact(data),
    )


def damping_fact(data: Sampled) -> Fact:
    """The damping that the gains need: none, next to none, so much, or more than was looked at."""
    label, needed, held = "damping C that it needs", data.analysis.required_damping, _for_modes(data)
    if needed == 0:
        return Fact(label=label, value="none", beside=held.strip())
    if math.isinf(needed):
        return Fact(label=label, value="none helps", beside="up to 15 % of critical in the first mode")
    if _is_next_to_nothing(data):
        return Fact(label=label, value="next to none", beside=f"{scientific(needed, 2)} s: {_share(data)}{held}")
    return Fact(label=label, value=scientific(needed, 2), unit="s", beside=held.strip())


def spans(windows: Sequence[Window], gain: float, here: Window | None = None) -> str:
    """The interval around a gain in a few digits, or the others where there is none around it."""
    here = here or around(list(windows), gain)
    if here is not None:
        return span(here)
    others = " or ".join(span(window) for window in windows)
    return f"{others}, not {plain(gain, 3)}" if others else "none"


def span(window: Window | None, looked_at: Window = EVERYWHERE) -> str:
    """An interval of a gain in a few digits; an end of what was looked at is no end."""
    if window is None:
        return "none"
    low, high = window
    no_low, no_high = low <= looked_at[0], high >= looked_at[1]
    if no_low:
        return "any" if no_high else f"< {significant(high, 4)}"
    lower = f"{low:.2g}".replace("-", "−") if 1e-4 < abs(low) < 1e-3 else significant(low, 3)
    return f"> {lower}" if no_high else f"{lower} … {significant(high, 4)}"
