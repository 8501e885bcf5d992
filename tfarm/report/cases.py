"""The controllers that a page is about: those given, else the default gains and the best that `tfarm design` finds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, AnyLaw, Arm, HubFeedback, Law, arm_and_law, as_law
from tfarm.dsp import Chain
from tfarm.dsp.discretise import discretised, with_all_gains
from tfarm.dsp.verdict import sampled_brief
from tfarm.errors import ConvergenceError, one_line
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.fitting.recording import MeasuredRun
from tfarm.loop.loop import Loop
from tfarm.loop.margins import Margins, margins
from tfarm.plots.style import gains_words
from tfarm.records import record
from tfarm.report.sections import typeset
from tfarm.response.controller import sign_of
from tfarm.response.signals import Signals
from tfarm.spectrum.table import default_gains
from tfarm.synthesis.design import Design, design

GIVEN_GAINS = "the gains given"
LONGEST_LAW_NAME = 60  # characters of a law's name in a heading
DESIGNED_MODES = 2  # flexible modes in the band of the damping that is drawn and designed for, as `tfarm design` has it
SIGN_WORDS = (
    f"Sign of {MOMENT_GAIN}: the strain gauge reads E I φ′(0), positive where it accelerates the hub. With the gauge "
    f"reversed every {MOMENT_GAIN} changes its sign."
)
NO_PLACE_FOR_K2 = (
    f"The hub of this arm has no inertia: {{gauge}}, so feeding it back by {MOMENT_GAIN} would be an algebraic loop. "
    f"There is no map of {' and '.join(PLANE)}; what {RATE_GAIN} does at {MOMENT_GAIN} = 0 is said below."
)


@dataclass(frozen=True)
@record
class GivenLaw:
    """A law, the name of its `file` where it has one, and a run that was `measured` under it on the rig."""

    law: AnyLaw
    file: str = ""
    measured: MeasuredRun | None = None

    @property
    def name(self) -> str:
        """What it is called, or its gains with their values."""
        law = as_law(self.law)
        return one_line(law.name, LONGEST_LAW_NAME) if law.gains is None else gains_words(law)


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
    """A controller on an arm: `arm` has the input that `law` drives, `given` is where it is from.

    `name` is for reading, `key` for the columns and names of files, "law" or of several "law_1", "law_2" ...
    """

    arm: Arm
    law: Law
    given: GivenLaw
    name: str
    key: str

    @property
    def gains(self) -> str:
        """Its gains with their values, or what it reads."""
        law = self.law
        return f"order {law.order}, of {', '.join(law.signals)}" if law.gains is None else gains_words(law)


def on_arm(arm: Arm, laws: Sequence[GivenLaw]) -> tuple[LawOnArm, ...]:
    """Each law on the arm, under a name that no other has."""
    found: list[LawOnArm] = []
    for number, given in enumerate(laws, 1):
        law = as_law(given.law)
        name = one_line(law.name, LONGEST_LAW_NAME) if law.gains is None else GIVEN_GAINS
        if name in {each.name for each in found}:
            name = f"{name} ({number})"
        key = f"law_{number}" if len(laws) > 1 else "law"
        found.append(LawOnArm(arm_and_law(arm, law)[0], law, given, name, key))
    return tuple(found)


def on_hub(arm: Arm, gains: HubFeedback, name: str, key: str) -> LawOnArm:
    """Gains at the hub under a name of their own."""
    return LawOnArm(arm, as_law(gains), GivenLaw(gains), name, key)


def cases_of(arm: Arm, laws: Sequence[GivenLaw]) -> tuple[LawOnArm, ...]:
    """The controllers that a section is about: the laws given, else the default gains."""
    return on_arm(arm, laws) if laws else (on_hub(arm, default_gains(arm), "default gains", "default"),)


def check_laws(arm: Arm, chain: Chain, laws: Sequence[GivenLaw]) -> None:
    """Raise ParameterError for a law that this arm, or the clock of its chain, can make nothing of."""
    if arm.is_locked:
        return  # its page says that there is no loop
    for each in on_arm(arm, laws):
        law = with_all_gains(*arm_and_law(each.arm, each.law))
        Signals(each.arm, law.signals)
        if not law.is_discrete:
            Loop(each.arm, law)
        discretised(law, chain.sampling.period)


def has_loop(arm: Arm) -> bool:
    """Whether both gains can be closed: the hub can turn, and has inertia."""
    return not (arm.is_locked or arm.has_massless_hub)


def has_rate_loop(arm: Arm) -> bool:
    """Whether the hub rate can be fed back: the hub can turn."""
    return not arm.is_locked


def why_no_loop(arm: Arm) -> str:
    """One sentence for an arm whose gains cannot both be closed."""
    if arm.is_locked:
        return "The hub of this arm is locked: it takes no torque, so there is no loop to close and no gain to choose."
    whole = "its gauge reads −u at every instant"
    damped = "its gauge reads −u/(1 + C s), the torque itself through a short lag"
    return NO_PLACE_FOR_K2.format(gauge=damped if arm.damping else whole)


def sign_words(arm: Arm) -> str:
    """The law, and the sign of its moment gain."""
    return f"Law: {typeset(sign_of(arm))}. {SIGN_WORDS}"


def what_holds(arm: Arm) -> str:
    """Why an arm without a rigid mode makes no slew."""
    return "The tip of this arm is held" if math.isinf(arm.payload.mass) else "Springs hold this arm"


def edge_of_K2(arm: Arm, law: HubFeedback) -> float | None:
    """The moment gain at which the loop loses its stability as it grows alone; None where none was found."""
    windows = margins_of(arm, law).windows[MOMENT_GAIN]
    return windows.around[1] if windows.around and windows.end(windows.around[1]) == "edge" else None


@lru_cache(maxsize=16)
def best(arm: Arm, chain: Chain) -> Design | None:
    """What `tfarm design ARM` finds; None where no gains within its bounds hold, or the moment has no place."""
    if not has_loop(arm):
        return None
    try:
        found = design(arm, modes=DESIGNED_MODES, chain=chain)
    except ConvergenceError:
        return None
    return None if found.at_limit else found  # the gain at which the hub stands still is no law to draw


brief_on = lru_cache(maxsize=64)(sampled_brief)  # each computed once for all sections of a page
_margins = lru_cache(maxsize=64)(margins)


def margins_of(arm: Arm, law: AnyLaw) -> Margins:
    """Verdict and margins, computed once for all sections."""
    return _margins(arm, as_law(law))


def continuous_cases(arm: Arm, chain: Chain, laws: Sequence[GivenLaw] = ()) -> tuple[LawOnArm, ...]:
    """The continuous-time controllers of a page: those given, else the default gains and the best ones."""
    found = None if laws else best(arm, chain)
    more = () if found is None else (on_hub(arm, found.law, "best damping", "best"),)
    return tuple(each for each in (*cases_of(arm, laws), *more) if not each.law.is_discrete)
