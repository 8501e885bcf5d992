"""A sampled verdict in short: what is said beside gains that were chosen without a clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from tfarm.arm import AnyLaw, Arm
from tfarm.dsp.chain import Chain, Sampling
from tfarm.dsp.verdict import LARGEST_LOG, Verdict, sampled_verdict
from tfarm.errors import ConvergenceError


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledBrief:
    """Whether a loop holds at a chain's sampling, apart from z = 1 of a free hub angle.

    `is_stable` and `log_radius`, ln of the spectral radius, are None where the loop could not be judged; `sentence`
    then says why.
    """

    sampling: Sampling
    is_stable: bool | None
    log_radius: float | None
    sentence: str

    @property
    def at(self) -> str:
        """The clock in words, and whether it is only tfarm's default: a file that names no period has that."""
        T, delay = self.sampling.period, self.sampling.delay_samples
        late = f", {delay:g} samples late" if delay else ""
        default = " (tfarm's default period)" if Sampling().period == T else ""
        return f"sampled every {1e3 * T:g} ms{late}{default}"

    @property
    def short(self) -> str:
        """The verdict in a few words, for a legend or a card."""
        verdict = "undecided" if self.is_stable is None else "stable" if self.is_stable else "UNSTABLE"
        return f"{verdict} when sampled every {1e3 * self.sampling.period:g} ms"

    @property
    def words(self) -> str:
        """The clock and the verdict, loud where the gains do not hold."""
        verdict, _, rest = self.sentence.partition(":")
        return f"{self.at} these gains are {verdict if self.is_stable else verdict.upper()}:{rest}"

    @property
    def answer(self) -> dict[str, Any]:
        """The brief as a dictionary of plain numbers and texts."""
        size = self.log_radius
        radius = None if size is None else math.exp(size) if size < LARGEST_LOG else math.inf
        return {
            "period_s": self.sampling.period,
            "period_is_default": self.sampling.period == Sampling().period,
            "delay_samples": self.sampling.delay_samples,
            "stable": self.is_stable,
            "spectral_radius": radius,
            "in_words": self.words,
        }


def sampled_brief(arm: Arm, law: AnyLaw, chain: Chain) -> SampledBrief:
    """The verdict on a law at the clock of a chain.  Raises ParameterError where the arm has no such loop."""
    try:
        verdict = sampled_verdict(arm, law, chain)
    except ConvergenceError as error:
        return SampledBrief(sampling=chain.sampling, is_stable=None, log_radius=None, sentence=f"undecided: {error}")
    return brief_of(verdict, chain)


def brief_of(verdict: Verdict, chain: Chain) -> SampledBrief:
    """A verdict in short."""
    return SampledBrief(
        sampling=chain.sampling,
        is_stable=verdict.is_stable,
        log_radius=float(verdict.log_radius),
        sentence=verdict.sentence,
    )
