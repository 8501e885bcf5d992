"""What is asked of a sampled loop, of whatever law: gains at the hub have more to tell than any other."""

from __future__ import annotations

from typing import Any

from tfarm.arm import AnyLaw, Arm, HubFeedback, arm_and_law
from tfarm.dsp.chain import Chain
from tfarm.dsp.law_verdict import LawAnalysis, analyse_law, law_verdict
from tfarm.dsp.verdict import Analysis, Verdict, analyse, sampled_verdict


def sampled(arm: Arm, law: AnyLaw, chain: Chain | None = None, *, count: int | None = None) -> Analysis | LawAnalysis:
    """Is the sampled loop stable?  Of gains at the hub with intervals of each, modes one by one and the damping that
    makes it safe; of any other law with the factors on it and the further delay that it bears.

    `count` is the number of flexible modes, as many as it takes if not given.  Raises ParameterError for a locked hub,
    an algebraic loop, an unknown signal, and a law in z whose period is not the chain's.
    """
    arm, law = arm_and_law(arm, law)
    if isinstance(law, HubFeedback):
        return analyse(arm, law, chain, count=count)
    return analyse_law(arm, law, chain, count=count)


def verdict_on(arm: Arm, law: AnyLaw, chain: Chain | None = None) -> Verdict[Any]:
    """The verdict alone.  Raises what `sampled` raises."""
    arm, law = arm_and_law(arm, law)
    return sampled_verdict(arm, law, chain) if isinstance(law, HubFeedback) else law_verdict(arm, law, chain)
