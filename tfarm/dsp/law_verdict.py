"""Is the sampled loop of any linear law stable, and how much more gain and delay does it bear?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from tfarm.arm import Arm, Law, cancelled
from tfarm.arm.checks import whole as whole_number
from tfarm.columns import JSON, REPORT, TERMINAL, Column, Table
from tfarm.crossing import Window
from tfarm.digits import general, plain, singly
from tfarm.dsp.chain import Chain, chain_or_usual
from tfarm.dsp.discretise import described_law, rule_in_words
from tfarm.dsp.law_circle import LawCircle
from tfarm.dsp.law_loop import SampledLaw, sampled_law
from tfarm.dsp.law_margins import stable_factors, stable_numbers
from tfarm.dsp.margins import DelayMargin, around, delay_margin, with_all_modes
from tfarm.dsp.verdict import MOST_ASKED, UNDAMPED_MODES, Verdict, settled_verdict, verdict_answer
from tfarm.records import record

WINDOW_DIGITS = 6  # of the ends of a window, where a person reads


class SampledNumber(NamedTuple):
    """One number of a law, the gain of a part or a factor on it, and how far it may go alone at the samples."""

    number: str
    value: float
    windows: list[Window]

    @property
    def interval(self) -> Window | None:
        """The window that its value lies in."""
        return around(self.windows, self.value)

    def spans(self, how: Callable[[float, int], str]) -> str:
        """Its windows, each end in six digits."""
        return " ".join(f"({how(low, WINDOW_DIGITS)}, {how(high, WINDOW_DIGITS)})" for low, high in self.windows)


SAMPLED_NUMBER_COLUMNS = (  # of `SampledNumber`
    Column("number", "number of the law"),
    Column("value", "value", printed=singly(general, 6), digits=singly(plain, 5)),
    Column("interval", of=lambda row: row.interval and list(row.interval), on=(JSON,)),
    Column("windows", of=lambda row: [list(window) for window in row.windows], on=(JSON,)),
    Column("", "stable, the others held", of=lambda row: row.spans(general) or "none", on=(TERMINAL,)),
    Column("stable_windows", "stable, the others held", on=REPORT,
           of=lambda row: " ".join(repr(end) for window in row.windows for end in window) or "none",
           shown=lambda row: row.spans(plain) or "none"),
)  # fmt: skip


def sampled_numbers(loop: SampledLaw) -> list[SampledNumber]:
    """How far the gain of each part of the law may go, the others held."""
    values, windows = loop.asked.part_gains, stable_numbers(loop)
    return [SampledNumber(name, values[name][1], each) for name, each in windows.items()]


@dataclass(frozen=True)
@record
class LawAnalysis:
    """What is said of a sampled loop under a law: its verdict, every interval of a factor on the whole law in which it
    is stable, and the further delay that it bears; both of the loop with the modes of the verdict."""

    verdict: Verdict[SampledLaw]
    factors: list[Window]
    delay_margin: DelayMargin

    @property
    def loop(self) -> SampledLaw:
        """The loop of the verdict."""
        return self.verdict.loop

    @property
    def gain_factors(self) -> Window | None:
        """The interval around 1 in which a factor on the law may lie; None where the loop is not stable."""
        return around(self.factors, 1.0)

    @cached_property
    def numbers(self) -> list[SampledNumber]:
        """How far the gain of each part of the law may go, the others held."""
        return sampled_numbers(self.loop)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should know of the law: unstable poles of its own that its own zeros cancel."""
        return cancelled(self.loop.law)

    @property
    def rule(self) -> str:
        """How the law came to be one in z."""
        return rule_in_words(self.loop.asked)


def law_verdict(arm: Arm, law: Law, chain: Chain | None = None, *, count: int | None = None) -> Verdict[SampledLaw]:
    """The verdict, with `count` modes, or as many as it takes (C > 0), or the first 20 (C = 0): see `sampled_verdict`.

    Raises ParameterError for what `sampled_law` refuses and a count outside 1..400.
    """
    chain = chain_or_usual(chain)
    if count is not None:
        words = f"a whole number of flexible modes from 1 to {MOST_ASKED}"
        count = whole_number("modes", count, 1, MOST_ASKED, words)
        return Verdict(sampled_law(arm, law, chain, count=count))
    if arm.has_elastic_link:
        return Verdict(sampled_law(arm, law, chain, count=UNDAMPED_MODES))
    small = sampled_law(arm, law, chain, count=1)
    largest = with_all_modes(arm, small.chain, small.with_modes)
    return settled_verdict(largest, lambda band: LawCircle(band.loop, band.kept, band.missing).outside())


def analyse_law(arm: Arm, law: Law, chain: Chain | None = None, *, count: int | None = None) -> LawAnalysis:
    """Verdict, stable factors on the law, and delay margin.  Raises ParameterError as `law_verdict` does."""
    verdict = law_verdict(arm, law, chain, count=count)
    return LawAnalysis(verdict, stable_factors(verdict.loop), delay_margin(verdict.loop))


def sampled_law_answer(analysis: LawAnalysis) -> dict[str, Any]:
    """The analysis as a dictionary of plain numbers, texts and lists."""
    verdict, loop = analysis.verdict, analysis.loop
    sampling, bound = loop.chain.sampling, analysis.delay_margin
    return {
        "arm": loop.plant.arm.name,
        **described_law(loop.asked, loop.plant.arm),
        **verdict_answer(verdict, sampling),
        "nearest": verdict.slowest,
        "warnings": list(analysis.warnings),
        "free_hub_angle": loop.has_free_angle,
        "stable_gain_factors": [list(window) for window in analysis.factors],
        "gain_factors": None if analysis.gain_factors is None else list(analysis.gain_factors),
        "windows": Table(columns=SAMPLED_NUMBER_COLUMNS, record=analysis.numbers),
        "delay_margin_samples": bound.samples,
        "delay_margin_s": bound.samples * sampling.period,
        "delay_margin_is_lower_bound": bound.is_bound,
        "unfiltered_signals": [name for name, analog in zip(loop.law.signals, loop.analog, strict=True) if not analog],
    }
