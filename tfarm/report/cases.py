"""The controllers that a page is about: those given, else the default gains and the best that `tfarm design` finds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from tfarm.arm import MOMENT_GAIN, PLANE, RATE_GAIN, AnyLaw, Arm, HubFeedback, Law, arm_and_law, as_law, input_words
from tfarm.digits import plain, significant
from tfarm.dsp import Chain
from tfarm.dsp.discretise import discretised, with_all_gains
from tfarm.dsp.verdict import SampledBrief, sampled_brief
from tfarm.errors import ConvergenceError, one_line
from tfarm.fitting.data import Measured
from tfarm.fitting.fit import Fit
from tfarm.fitting.recording import MeasuredRun
from tfarm.loop.loop import Loop
from tfarm.loop.margins import Margins, margins
from tfarm.plots.words import gains_words
from tfarm.records import record
from tfarm.response import transfer
from tfarm.response.signals import Signals
from tfarm.spectrum.table import default_gains
from tfarm.synthesis.design import Design, design

GIVEN_GAINS = "the gains given"
LONGEST_LAW_NAME = 60  # characters of a law's name in a heading
DESIGNED_MODES = 2  # flexible modes in the band of the damping that is drawn and designed for, as `tfarm design` has it
SIGN_WORDS = (
    f"Law: u = −{RATE_GAIN} dθ/dt − {MOMENT_GAIN} E I φ′(0) + r. Sign of {MOMENT_GAIN}: the strain gauge reads "
    f"E I φ′(0), positive where it accelerates the hub; {{rest}}. With the gauge reversed every "
    f"{MOMENT_GAIN} changes its sign."
)
TORQUE_AT_REST = "a torque u at rest gives −(J − I_h)/J u"
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


def on_hub(arm: Arm, gains: HubFeedback, name: str, key: str) -> LawOnArm:
    """Gains at the hub under a name of their own."""
    return LawOnArm(arm, gains, GivenLaw(gains), name, key)


def cases_of(arm: Arm, laws: Sequence[GivenLaw]) -> tuple[LawOnArm, ...]:
    """The controllers that a section is about: the laws given, else the default gains."""
    return on_arm(arm, laws) if laws else (on_hub(arm, default_gains(arm), "default gains", "default"),)


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
    if arm.is_uniform and arm.has_rigid_mode:
        return SIGN_WORDS.format(rest=TORQUE_AT_REST)
    if arm.has_rigid_mode:
        share = significant(arm.gauged_inertia / arm.total_inertia, 5)
        rest = f"a torque that turns the whole arm gives −{share} times as much"
    else:
        static = transfer(arm, "root_moment").static * arm.input_per_torque
        rest = (
            f"a torque that lasts gives {plain(static, 5)} times as much" if static else "a torque that lasts gives 0"
        )
    driven = "" if arm.is_uniform else f"Here u is {input_words(arm)}. "
    return driven + SIGN_WORDS.format(rest=rest)


def what_holds(arm: Arm) -> str:
    """Why an arm without a rigid mode makes no slew."""
    return "The tip of this arm is held" if math.isinf(arm.payload.mass) else "Springs hold this arm"


def edge_of_K2(arm: Arm, law: HubFeedback) -> float | None:
    """The moment gain at which the loop loses its stability as it grows alone; None where none was found."""
    windows = margins_of(arm, law).windows[MOMENT_GAIN]
    top = math.inf if windows.around is None else windows.around[1]
    return top if windows.around is not None and windows.end(top) == "edge" else None


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


@lru_cache(maxsize=64)
def brief_on(arm: Arm, law: AnyLaw, chain: Chain) -> SampledBrief:
    """Stability of the sampled loop, computed once for all sections."""
    return sampled_brief(arm, law, chain)


@lru_cache(maxsize=64)
def margins_of(arm: Arm, law: AnyLaw) -> Margins:
    """Verdict and margins, computed once for all sections."""
    return margins(arm, law)


def continuous_cases(arm: Arm, chain: Chain, laws: Sequence[GivenLaw] = ()) -> tuple[LawOnArm, ...]:
    """The continuous-time controllers of a page: those given, else the default gains and the best ones."""
    if laws:
        return continuous_laws(on_arm(arm, laws))
    found = best(arm, chain)
    return (*cases_of(arm, ()), *([] if found is None else [on_hub(arm, found.law, "best damping", "best")]))
