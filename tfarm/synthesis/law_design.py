"""The best law of a structure: a minimax search from many starts, with exact slopes, and a certified verdict.

The objectives have edges where another pole, or another frequency, is the worst: `minimax` takes the tangents of all of
them.  It is run from the best of many starts about the sensible one, and once more from the best found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tfarm.arm import ANGLE_GAIN, TWO_GAINS, Arm, Law
from tfarm.arrays import Real
from tfarm.dsp import Chain, Verdict
from tfarm.dsp.chain import chain_or_usual
from tfarm.dsp.verdict import brief_of, sampled_verdict
from tfarm.errors import ConvergenceError, ParameterError, did_you_mean
from tfarm.loop.stability import Stability, stability
from tfarm.records import record
from tfarm.synthesis.law_judge import LAW_OBJECTIVES, LawJudge, law_judge
from tfarm.synthesis.minimax import LOST, Pieces, ScoredPoint, minimax
from tfarm.synthesis.sampled import mode_counts
from tfarm.synthesis.structures import STRUCTURES, Structure, usual_angle_gain
from tfarm.synthesis.together import OnArm, in_step, worst_value
from tfarm.synthesis.worst_case import WITHOUT_BOX, NamedArm, Tell, WorstCase

STARTS_EACH = 16  # points about the start, a coefficient
START_WIDTH = 1.0  # of x: the deviation of these points
STARTS_SEED = 0  # of these points
SEARCHES_EACH = 2  # of them are searched from, a coefficient
MOST_SEARCHES = 6  # at most


@dataclass(frozen=True)
@record
class LawDesign:
    """The best law of a `structure` and its `coefficients`, the value of the objective and both verdicts.

    `value` is a damping ratio, a disk margin, the largest |S|, or a delay margin [s], of the sampled loop of `chain`;
    `verdict` is that of the continuous loop, `sampled` that of the sampled one.  `at_limit` names coefficients at the
    end of what samples tell apart, 2/T of a pole or the frequency of a filter.  `arms` has value and verdicts for each
    arm that it was chosen for, the arm itself first; `value` is the worst among them.
    """

    objective: str
    structure: str
    law: Law
    coefficients: dict[str, float]
    at_limit: tuple[str, ...]
    value: float
    verdict: Stability
    sampled: Verdict
    modes: int
    chain: Chain
    arms: tuple[OnArm, ...]
    worst_case: WorstCase = WITHOUT_BOX


def law_design(
    arm: Arm, objective: str, structure: str, *, on_angle: float, modes: int, chain: Chain | None,
    progress: Tell | None, others: Sequence[NamedArm],
) -> LawDesign:  # fmt: skip
    """The law of a structure that serves an objective best in the sampled loop; the gain `on_angle` holds that.

    With `others` the objective is the worst of the arms, all of which hold.

    Raises ParameterError for an unknown structure or objective, ConvergenceError where no law found holds.
    """
    if structure not in STRUCTURES:
        raise ParameterError(key="structure", value=structure, remedy=did_you_mean(structure, [TWO_GAINS, *STRUCTURES]))
    if objective not in LAW_OBJECTIVES:
        remedy = f"of a structure use one of {', '.join(LAW_OBJECTIVES)}"
        raise ParameterError(key="objective", value=objective, remedy=remedy)
    if not (0.0 <= on_angle < np.inf):
        raise ParameterError(key=ANGLE_GAIN, value=on_angle, remedy="the hub angle gain is zero (chosen) or positive")
    chain, tell = chain_or_usual(chain), progress or (lambda text: None)
    T = chain.sampling.period
    on_angle = on_angle or usual_angle_gain(arm, T)
    form = STRUCTURES[structure](arm, on_angle, modes, T)
    arms = (NamedArm(arm.name, arm, {}), *others)
    nearest = (np.inf, form.law(form.origin))
    for counts in in_step([mode_counts(each.arm, chain, modes) for each in arms]):
        judges = [
            law_judge(each.arm, chain, form.law(form.origin), objective, modes, count, arm)
            for each, count in zip(arms, counts, strict=True)
        ]
        for score, x in _best(judges, form, tell):
            law = form.law(x)
            nearest = min(nearest, (score, law), key=lambda pair: pair[0])
            if score < LOST and all(judge.holds(law) for judge in judges):
                named = dict(zip(form.names, form.coefficients(x).tolist(), strict=True))
                sampled = [sampled_verdict(each.arm, law, chain) for each in arms]
                on_arms = [
                    OnArm(each.name, each.numbers, judge.value(law), stability(each.arm, law), brief_of(own, chain))
                    for each, judge, own in zip(arms, judges, sampled, strict=True)
                ]
                return LawDesign(
                    objective, structure, law, {ANGLE_GAIN: on_angle} | named, form.at_limit(x),
                    worst_value(objective, [each.value for each in on_arms]),
                    on_arms[0].verdict, sampled[0], modes, chain,
                    tuple(on_arms),
                )  # fmt: skip
    raise ConvergenceError(_why_none(arms, structure, nearest[1], chain), nearest[1], None)


def _why_none(arms: Sequence[NamedArm], structure: str, law: Law, chain: Chain) -> str:
    """What drives the law that came nearest to holding, on the arm where it grows most, and what to try."""
    text = f"no law {structure} was found that holds when sampled: "
    verdict = max((sampled_verdict(each.arm, law, chain) for each in arms), key=lambda each: float(each.log_radius))
    growth = float(np.expm1(verdict.log_radius))
    slowest = f"under the nearest {verdict.slowest} grows by {growth:.2g} a sample"
    grows, arm = slowest if growth > 0 else "none has a reserve", verdict.loop.plant.arm
    if not arm.has_elastic_link:
        return f"{text}{grows}; try another {ANGLE_GAIN} or period"
    return (
        f"{text}{grows}; with link.damping = 0 no mode loses energy of its own, and a held input drives each "
        f"one that the law does not damp where its alias is seen: give link.damping, or take {TWO_GAINS}"
    )


def law_score_on(found: LawDesign, arm: Arm) -> float:
    """What a design minimised, on another arm; `LOST` and more where the loop does not hold."""
    count, known = next(mode_counts(arm, found.chain, found.modes)), found.verdict.loop.arm
    judge = law_judge(arm, found.chain, found.law, found.objective, found.modes, count, known)
    return judge.score(found.law)


def _best(judges: Sequence[LawJudge], form: Structure, tell: Tell) -> list[ScoredPoint]:
    """The best points found and their scores, the best first: the worst of all arms, and lost where x is no law."""

    def pieces(x: Real) -> Pieces:
        try:
            law, slopes = form.law(x), form.slopes(x)
            parts = [judge.pieces(law, slopes) for judge in judges]
            return Pieces(*(np.concatenate(each) for each in zip(*parts, strict=True)))
        except (ParameterError, np.linalg.LinAlgError):  # coefficients too large to be a law
            flat = np.zeros((1, x.size))
            return Pieces(np.zeros(1), flat, np.array([1e6]), flat)

    def score(x: Real) -> float:
        try:
            law, worst = form.law(x), -np.inf
            for judge in judges:
                worst = max(worst, judge.score(law))
                if worst >= LOST:  # the next arm need not be asked
                    break
            return worst
        except (ParameterError, np.linalg.LinAlgError):
            return LOST * 1e9

    rng = np.random.default_rng(STARTS_SEED)
    points = [form.origin, *(START_WIDTH * rng.standard_normal((STARTS_EACH * form.origin.size, form.origin.size)))]
    number = min(SEARCHES_EACH * (1 + form.origin.size), MOST_SEARCHES)
    best = [points[n] for n in np.argsort([score(x) for x in points], kind="stable")[:number]]

    def told(number: int, score: float) -> None:
        tell(f"{form.name}: search {number}, best so far {score:.6g}")

    return minimax(pieces, best, form.upper, told)
