"""What `tfarm design` prints with --json: a plain dictionary."""

from __future__ import annotations

from typing import Any

from tfarm.arm import TWO_GAINS
from tfarm.dsp.brief import brief_of
from tfarm.loop.answers import law_answer
from tfarm.synthesis.design import Design
from tfarm.synthesis.law_design import LawDesign


def design_answer(found: Design) -> dict[str, Any]:
    """The gains, what they reach, both verdicts, and how flat the optimum is."""
    law, bounds = found.law, found.bounds
    return {
        "arm": found.verdict.loop.arm.name,
        "objective": found.objective,
        "structure": TWO_GAINS,
        "designed_for": found.loop,
        **law_answer(law, found.verdict.loop.arm),
        "value": found.value,
        "verdict": found.verdict.verdict,
        "modes": found.modes,
        "bounds": {name: list(pair) for name, pair in bounds.items()},
        "at_bound": list(found.at_bound),
        "at_limit": list(found.at_limit),
        "widened": list(found.widened),
        "flat_K1": list(found.flat_K1),
        "flat_K2": list(found.flat_K2),
        "sampled": found.sampled.answer,
        **arms_answer(found),
    }


def law_design_answer(found: LawDesign) -> dict[str, Any]:
    """The law and its coefficients, what it reaches, and both verdicts."""
    return {
        "arm": found.verdict.loop.arm.name,
        "objective": found.objective,
        "structure": found.structure,
        "designed_for": "sampled",
        **law_answer(found.law, found.verdict.loop.arm),
        "coefficients": found.coefficients,
        "at_limit": list(found.at_limit),
        "value": found.value,
        "verdict": found.verdict.verdict,
        "known_beyond_the_band": found.verdict.is_known_beyond,
        "band_rad_s": found.verdict.band,
        "modes": found.modes,
        "sampled": brief_of(found.sampled, found.chain).answer,
        **arms_answer(found),
    }


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
