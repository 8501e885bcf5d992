"""The verdict on a sampled loop in short, with its sampling period and the origin of that."""

from dataclasses import dataclass
from typing import Annotated

from tfarm.arm.chain import Sampling
from tfarm.case import Case
from tfarm.errors import ConvergenceError
from tfarm.loop.sampled_verdict import Verdict, sampled_verdict
from tfarm.schema import Quantity

# origin of a sampling period that nothing gives
DEFAULT_PERIOD = "tfarm's default period"


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledBrief:
    """Whether a loop is stable at a chain's sampling, without z = 1 of a free hub angle.

    `is_stable` and `spectral_radius` are None where that is not determined; `words` then have the reason.
    `period_from` is the origin of the sampling period, "" where that is not known.
    """

    period: Annotated[float, Quantity(unit="s", help="sampling period of the controller")]
    delay_samples: Annotated[float, Quantity(help="delay of the loop in samples")]
    period_from: str
    is_stable: Annotated[
        bool | None, Quantity(key="stable", help="whether every pole lies inside the unit circle")
    ]
    spectral_radius: Annotated[
        float | None,
        Quantity("spectral radius", help="largest |z| of the closed-loop poles; below 1 of a stable loop"),
    ]
    words: Annotated[str, Quantity("sampled loop", key="in_words", help="verdict at the sampling period")]

    @property
    def period_is_default(
        self,
    ) -> Annotated[bool, Quantity(help="whether the sampling period is tfarm's own")]:
        """Whether it is tfarm's: neither of the law, nor of a file or an option."""
        return self.period_from == DEFAULT_PERIOD

    @property
    def short(self) -> str:
        """The verdict in a few words, for a legend or a card."""
        if self.is_stable is None:
            verdict = "undecided"
        elif self.is_stable:
            verdict = "stable"
        else:
            verdict = "UNSTABLE"
        return f"{verdict} when sampled every {1e3 * self.period:g} ms"


def sampled_brief(case: Case) -> SampledBrief:
    """Return the verdict on a case in short.  Raises ParameterError where the arm has no such loop."""
    try:
        return brief_of(sampled_verdict(case), case)
    except ConvergenceError as error:
        return brief_of(error, case)


def brief_of(found: Verdict | ConvergenceError, case: Case) -> SampledBrief:
    """Return a verdict on a case in short, or the reason for none; in capitals where the loop is not stable."""
    T = case.chain.sampling.period
    delay = case.chain.sampling.delay_samples
    origin = case.chain.period_from
    if case.law.is_discrete:
        origin = "the controller's period"
    elif not origin and Sampling().period == T:
        origin = DEFAULT_PERIOD
    is_stable = None
    radius = None
    if isinstance(found, ConvergenceError):
        sentence = f"undecided: {found}"
    else:
        sentence = found.sentence
        is_stable = found.is_stable
        radius = found.spectral_radius
    if not is_stable:
        word, _, rest = sentence.partition(" ")
        sentence = f"{word.upper()} {rest}"
    late = f", {delay:g} sample{'s' * (delay != 1)} late" if delay else ""
    words = f"{sentence}, sampled every {1e3 * T:g} ms{late}{origin and f' ({origin})'}"
    return SampledBrief(
        period=T,
        delay_samples=delay,
        period_from=origin,
        is_stable=is_stable,
        spectral_radius=radius,
        words=words,
    )
