"""The laws that a page is about where they are given: gains that were typed, the arm's own [law], files of laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from tfarm.arm import AnyLaw, Arm, HubFeedback, Law, arm_and_law, as_law
from tfarm.dsp import Chain
from tfarm.dsp.discretise import discretised, with_all_gains
from tfarm.errors import one_line
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.fitting.recording import MeasuredRun
from tfarm.loop.loop import Loop
from tfarm.plots.words import gains_words
from tfarm.records import record
from tfarm.response.signals import Signals
from tfarm.spectrum.table import default_gains

GIVEN_GAINS = "the gains given"
LONGEST_LAW_NAME = 60  # characters of a law's name in a heading


@dataclass(frozen=True)
@record
class GivenLaw:
    """A law, the name of its `file` where it has one, and a run that was `measured` under it on the rig."""

    law: AnyLaw
    file: str = ""
    measured: MeasuredRun | None = None

    @property
    def given_name(self) -> str:
        """What it is called, or its gains with their values."""
        return gains_words(self.law) if isinstance(self.law, HubFeedback) else one_line(self.law.name, LONGEST_LAW_NAME)


class Subject(NamedTuple):
    """Whose page it is: an arm, its chain, and the laws that the page is about; none: the default gains.

    `fit` is where its numbers are from, if they were fitted to measurements; `measured` are responses to be laid over
    its own.
    """

    arm: Arm
    chain: Chain
    laws: tuple[GivenLaw, ...] = ()
    fit: Fit | None = None
    measured: tuple[Measured, ...] = ()


@dataclass(frozen=True)
@record
class LawOnArm:
    """A given law on an arm: `arm` has the input that it drives, and `law` is gains at the hub where it is no more.

    `name` is for reading, `key` for the columns and names of files, "law" or of several "law_1", "law_2" ...
    """

    arm: Arm
    law: AnyLaw
    given: GivenLaw
    name: str
    key: str

    @property
    def gains(self) -> str:
        """Its gains with their values, or what it reads."""
        if isinstance(self.law, HubFeedback):
            return gains_words(self.law)
        return f"order {self.law.order}, of {', '.join(self.law.signals)}"

    @property
    def any_law(self) -> Law:
        """The law as one of signals, gains at the hub too."""
        return as_law(self.law)

    @property
    def is_discrete(self) -> bool:
        """Whether it is a law in z, which acts at samples only."""
        return self.any_law.is_discrete

    @property
    def measured(self) -> MeasuredRun | None:
        """The run that was measured under it."""
        return self.given.measured


def on_arm(arm: Arm, laws: Sequence[GivenLaw]) -> tuple[LawOnArm, ...]:
    """Each law on the arm, under a name that no other has."""
    found: list[LawOnArm] = []
    for number, given in enumerate(laws, 1):
        driven, law = arm_and_law(arm, given.law)
        name = GIVEN_GAINS if isinstance(law, HubFeedback) else one_line(law.name, LONGEST_LAW_NAME)
        if name in {each.name for each in found}:
            name = f"{name} ({number})"
        found.append(LawOnArm(driven, law, given, name, f"law_{number}" if len(laws) > 1 else "law"))
    return tuple(found)


def cases_of(arm: Arm, laws: Sequence[GivenLaw]) -> tuple[LawOnArm, ...]:
    """The controllers that a section is about: the laws given, else the default gains."""
    if laws:
        return on_arm(arm, laws)
    gains = default_gains(arm)
    return (LawOnArm(arm, gains, GivenLaw(gains), "default gains", "default"),)


def check_laws(arm: Arm, chain: Chain, laws: Sequence[GivenLaw]) -> None:
    """Raise ParameterError for a law that this arm, or the clock of its chain, can make nothing of."""
    if arm.is_locked:
        return  # its page says that there is no loop
    for each in on_arm(arm, laws):
        if isinstance(each.law, HubFeedback):
            with_all_gains(each.arm, each.law)
            continue
        _ = Signals(each.arm, each.law.signals)
        if not each.is_discrete:
            Loop(each.arm, each.law)
        discretised(each.law, chain.sampling.period)


def continuous_laws(laws: Sequence[LawOnArm]) -> tuple[LawOnArm, ...]:
    """Those that act on the continuous loop."""
    return tuple(each for each in laws if not each.is_discrete)
