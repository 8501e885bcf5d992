"""What `tfarm design` prints with --json: a plain dictionary."""

from __future__ import annotations

from typing import Any

from tfarm.arm import TWO_GAINS
from tfarm.dsp.verdict import brief_of
from tfarm.loop.law_answers import law_answer
from tfarm.synthesis.design import Design
from tfarm.synthesis.law_design import LawDesign
from tfarm.synthesis.sampled import slew_and_after, trial_slew


def design_answer(found: Design | LawDesign) -> dict[str, Any]:
    """The law and what it reaches, both verdicts; of gains how flat the optimum is, of another law its coefficients."""
    verdict, arm = found.verdict, found.verdict.loop.arm
    if isinstance(found, Design):
        own: dict[str, Any] = {
            "structure": TWO_GAINS,
            "designed_for": found.loop,
            "bounds": {name: list(pair) for name, pair in found.bounds.items()},
            "at_bound": list(found.at_bound),
            "widened": list(found.widened),
            "flat_K1": list(found.flat_K1),
            "flat_K2": list(found.flat_K2),
            "sampled": found.sampled.answer,
        }
    else:
        own = {
            "structure": found.structure,
            "designed_for": "sampled",
            "coefficients": found.coefficients,
            "known_beyond_the_band": verdict.is_known_beyond,
            "band_rad_s": verdict.band,
            "sampled": brief_of(found.sampled, found.chain).answer,
        }
    return {
        "arm": arm.name,
        "objective": found.objective,
        **law_answer(found.law, arm),
        "value": found.value,
        "slew_duration_s": slew_duration(found),
        "verdict": verdict.verdict,
        "modes": found.modes,
        "at_limit": list(found.at_limit),
        **own,
        **arms_answer(found),
    }


def slew_duration(found: Design | LawDesign) -> float | None:
    """How long the record [s] is that a residual or a cost is of, for `tfarm simulate --duration`; None of others."""
    arm, chain = found.verdict.loop.arm, found.chain
    if isinstance(found, Design) and found.loop == "continuous":
        return None
    tasks = {"residual": lambda: slew_and_after(arm, arm, chain), "cost": lambda: trial_slew(arm, chain)}
    return float(tasks[found.objective]().t[-1]) if found.objective in tasks else None


def arms_answer(found: Design | LawDesign) -> dict[str, Any]:
    """What the law is on each arm that it was chosen for, which of them is the worst, and how they were chosen."""
    worst = next(each.name for each in found.arms if each.value == found.value)
    return {
        "arms": [
            {
                "name": each.name,
                "numbers": each.numbers,
                "value": each.value,
                "verdict": each.verdict.verdict,
                "known_beyond_the_band": each.verdict.is_known_beyond,
                "band_rad_s": each.verdict.band,
                "sampled": each.sampled.answer,
            }
            for each in found.arms
        ],
        "worst_arm": worst,
        "arms_tried_inside": found.worst_case.tried,
        "worst_case_in_words": found.worst_case.sentence(len(found.arms)),
    }
