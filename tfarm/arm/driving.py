"""What a law drives, whether it is more than gains at the hub, and what a person should know of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tfarm.arm.feedback import AT_HUB, GAINS, HubFeedback
from tfarm.arm.law import Law
from tfarm.arm.records import Arm
from tfarm.errors import ParameterError

AnyLaw = HubFeedback | Law

CANCELLED = 1e-6  # of its size: a zero of the law so near to an unstable pole of it cancels that


def as_law(law: AnyLaw) -> Law:
    """The law as one of signals, gains at the hub too.  Raises ParameterError for what is no law."""
    if not isinstance(law, HubFeedback | Law):
        raise ParameterError(key="law", value=law, remedy="give a HubFeedback or a Law")
    return Law.of_gains(law) if isinstance(law, HubFeedback) else law


def full_law(law: AnyLaw) -> Law:
    """The law as one of signals; gains at the hub as a law on all of their signals, also those with a gain of 0."""
    gains = as_law(law).gains
    if gains is None:
        return as_law(law)
    entries = {gain.output: gains[gain.name] for gain in GAINS}
    return Law(entries, name="gains at the hub", references=AT_HUB)


def arm_and_law(arm: Arm, law: AnyLaw) -> tuple[Arm, AnyLaw]:
    """The arm with the input that the law drives, and the law as gains at the hub where it is no more than those.

    Raises ParameterError for what is no law.
    """
    if isinstance(law, HubFeedback):
        return arm, law
    law = as_law(law)
    if law.input is not None and law.input != arm.input:
        arm = replace(arm, input=law.input)  # type: ignore[arg-type]  # the record refuses what is none
    return arm, law.gains or law


def tracked(arm: Arm, law: AnyLaw) -> tuple[Arm, AnyLaw]:
    """The same for a loop that is led: gains at the hub follow references in all that they feed back.

    So a law that is no more than gains is taken for them where each of its signals is among its references.
    """
    driven, plain = arm_and_law(arm, law)
    if isinstance(law, Law) and not set(law.signals) <= set(law.references):
        return driven, law
    return driven, plain


def must_not_be_algebraic(arm: Arm, key: str, value: object) -> None:
    """Raise ParameterError where the hub has no inertia: its root moment, fed back, is the torque itself."""
    if arm.has_massless_hub:
        remedy = (
            "with hub.inertia = 0 the root moment is -u itself, so that moment feedback is an algebraic loop; "
            "give the hub an inertia, or feed no moment back"
        )
        raise ParameterError(key=key, value=value, remedy=remedy)


def cancelled(law: Law) -> tuple[str, ...]:
    """Warnings: the law's own poles right of the axis, or outside the unit circle, that its own zeros cancel."""
    found = []
    for part in law.parts:
        zeros = getattr(part.block, "zeros", np.empty(0, complex))
        for pole in part.block.poles:
            gap = abs(zeros - pole).min() if zeros.size else math.inf
            grows = abs(pole) >= 1 if law.is_discrete else pole.real >= 0
            if grows and gap <= CANCELLED * max(abs(pole), 1e-12):
                where = f"z = {pole:.6g}" if law.is_discrete else f"{pole:.6g} 1/s"
                found.append(
                    f"the law cancels its own unstable pole {where} on {', '.join(part.signals)}: it is not stable"
                )
    return tuple(found)
