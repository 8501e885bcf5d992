"""The case: an arm under a controller, sampled by a chain.  Whatever asks a loop takes one.

    y = G(s) u,    u = -sum over signals of C_i(s) (y_i - r_i),    sampled every T

The controller is normalised here, once.  Gains at the hub, each on the error of its signal, are a part for each gain
that is not 0 (`Law.of_gains`); any other controller is as it was given.  In the loop gains at the hub have a part for
each of the three, also for 0 (`feedback`).
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, cast

from tfarm.arm.chain import Chain, chain_or_usual
from tfarm.arm.feedback import AT_HUB, GAINS, HubFeedback
from tfarm.arm.law import AnyLaw, Law, as_law
from tfarm.arm.records import Arm, must_be_arm
from tfarm.exact.system import System
from tfarm.moved import FormerName, moved
from tfarm.records import frozen
from tfarm.response.signals import Signals
from tfarm.spectrum import Modes, modes


@frozen
class Case:
    """An arm with the input of its controller, the controller in its normal form, and the chain between both.

    `law` may be given as gains at the hub; a `chain` of 10 ms with ideal converters is taken unless one is given.
    Raises ParameterError for what is no arm, no controller or no chain.
    """

    arm: Arm
    law: Law
    chain: Chain = field(default=cast("Chain", None))

    if TYPE_CHECKING:
        # what may be given: gains become a law, no chain the usual one
        def __init__(self, arm: Arm, law: AnyLaw, chain: Chain | None = None) -> None: ...

    def __post_init__(self) -> None:
        must_be_arm(self.arm)
        law = as_law(self.law)
        if law.input not in (None, self.arm.input):
            # the record refuses an input that the arm has no motor for
            object.__setattr__(self, "arm", replace(self.arm, input=law.input))  # type: ignore[arg-type]
        if law.gains is not None and _follows_all(law):
            name = law.name
            law = Law.of_gains(law.gains)
            if name != Law.name:
                law = replace(law, name=name)
        object.__setattr__(self, "law", law)
        object.__setattr__(self, "chain", chain_or_usual(self.chain))

    @cached_property
    def gains(self) -> HubFeedback | None:
        """The controller as gains at the hub; None of any other."""
        return self.law.gains

    @cached_property
    def feedback(self) -> Law:
        """The controller in the loop: of gains at the hub a part for each, also for 0."""
        return full_law(self.law)

    @property
    def in_computer(self) -> Law:
        """The controller as a computer runs it: gains that do not follow all their references read their signals."""
        return self.feedback if self.feedback.references == AT_HUB else self.law

    @cached_property
    def signals(self) -> Signals:
        """The outputs that are fed back."""
        return Signals(self.arm, self.feedback.signals)

    @property
    def system(self) -> System:
        """The exact system of the arm."""
        return self.signals.system

    @cached_property
    def spectrum(self) -> Modes:
        """The first ten modes of the arm without controller."""
        return modes(self.arm, 10)

    def with_number(self, name: str, value: float) -> Case:
        """Return the case with another value of one number of the controller, by its name in `Law.with_number`."""
        return replace(self, law=self.law.with_number(name, value))

    having = FormerName("with_number")

    def under(self, law: AnyLaw) -> Case:
        """Return the case with another controller."""
        return Case(self.arm, law, self.chain)

    def on(self, arm: Arm) -> Case:
        """Return the case with another arm."""
        return replace(self, arm=arm)

    def through(self, chain: Chain) -> Case:
        """Return the case with another chain."""
        return replace(self, chain=chain)


class OfCase:
    """A record of a case, with its arm and its controller."""

    if TYPE_CHECKING:
        # a field here would come before those of each record in its tables
        case: Case

    @property
    def arm(self) -> Arm:
        """The arm with the input of the controller."""
        return self.case.arm

    @property
    def law(self) -> Law:
        """The controller."""
        return self.case.law


def _follows_all(law: Law) -> bool:
    """Whether each signal of a controller follows a reference."""
    return set(law.signals) <= set(law.references)


def full_law(law: AnyLaw) -> Law:
    """Return a controller; for gains at the hub with a part for each of the three, also for 0.

    Where each of its signals follows a reference the three of them do.
    """
    law = as_law(law)
    if law.gains is None:
        return law
    references = AT_HUB if _follows_all(law) else law.references
    entries = {gain.output: law.gains[gain.name] for gain in GAINS}
    return Law(entries, name="gains at the hub", references=references)


def tracked(arm: Arm, law: AnyLaw) -> tuple[Arm, AnyLaw]:
    """Return the arm with the input of a controller, and that as gains at the hub if those follow all references."""
    case = Case(arm, law)
    if case.gains is not None and _follows_all(case.law):
        law = case.gains
    return case.arm, law


# names that this module, a room then, had up to version 1.0
__getattr__ = moved(
    __name__,
    dict.fromkeys(
        ("ComparedSide", "Comparison", "LoopCard", "ResultCard", "compare", "loop_function", "result_card"),
        "tfarm.assessment",
    ),
)
