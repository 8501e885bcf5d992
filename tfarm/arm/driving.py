"""What a law drives, and whether it is more than gains at the hub."""

from __future__ import annotations

from dataclasses import replace

from tfarm.arm.feedback import HubFeedback
from tfarm.arm.law import Law
from tfarm.arm.records import Arm
from tfarm.errors import ParameterError

AnyLaw = HubFeedback | Law


def through(arm: Arm, law: AnyLaw) -> tuple[Arm, AnyLaw]:
    """The arm with the input that the law drives, and the law as gains at the hub where it is no more than those.

    Raises ParameterError for what is no law.
    """
    if isinstance(law, HubFeedback):
        return arm, law
    if not isinstance(law, Law):
        raise ParameterError(key="law", value=law, remedy="give a HubFeedback or a Law")
    if law.input is not None and law.input != arm.input:
        arm = replace(arm, input=law.input)  # type: ignore[arg-type]  # the record refuses what is none
    return arm, law.gains or law


def tracked(arm: Arm, law: AnyLaw) -> tuple[Arm, AnyLaw]:
    """The same for a loop that is led: gains at the hub follow references in all that they feed back.

    So a law that is no more than gains is taken for them where each of its signals is among its references.
    """
    driven, plain = through(arm, law)
    if isinstance(law, Law) and not set(law.signals) <= set(law.references):
        return driven, law
    return driven, plain
