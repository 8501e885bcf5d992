"""The best law of a structure for the sampled loop: a search from many starts, and a certified verdict.

The objectives have edges where another pole, or another frequency, is the worst, and there a gradient says nothing: the
downhill simplex of Nelder and Mead (1965) goes on from the best of many starts about the sensible one, twice each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from tfarm.arm import Arm
from tfarm.arm.law import Law
from tfarm.dsp import Chain, Verdict
from tfarm.dsp.brief import brief_of
from tfarm.dsp.law_loop import SampledLaw
from tfarm.dsp.law_verdict import law_verdict
from tfarm.dsp.margins import most_modes
from tfarm.dsp.verdict import UNDAMPED_MODES
from tfarm.errors import ConvergenceError, ParameterError, did_you_mean
from tfarm.loop.law_loop import LawLoop
from tfarm.loop.law_stability import law_stability
from tfarm.loop.stability import Stability
from tfarm.records import record
from tfarm.synthesis.arms import NamedArm
from tfarm.synthesis.law_judge import LAW_OBJECTIVES, LOST, LawJudge, law_judge
from tfarm.synthesis.sampled import FEWEST_MODES
from tfarm.synthesis.structures import STRUCTURES, Structure, usual_angle_gain
from tfarm.synthesis.together import OnArm, in_step, worst_value
from tfarm.synthesis.worst_case import ALONE, WorstCase

Real = NDArray[np.float64]
Progress = Callable[[str], None]

STARTS, WIDTH, SEED = 48, 1.0, 0  # points about the start, how far they are spread, and of which numbers
REFINED = 3  # of them are refined
STEPS = 100  # evaluations a coefficient of a simplex
SIZE = 0.3  # of the first simplex, in logarithms


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
    verdict: Stability[LawLoop]
    sampled: Verdict[SampledLaw]
    modes: int
    chain: Chain
    arms: tuple[OnArm, ...]
    worst_case: WorstCase = ALONE


def law_design(
    arm: Arm, objective: str, structure: str, *, Kp: float = 0.0, modes: int = 2, chain: Chain | None = None,
    progress: Progress | None = None, others: Sequence[NamedArm] = (),
) -> LawDesign:  # fmt: skip
    """The law of a structure that serves an objective best in the sampled loop; `Kp` holds the angle.

    With `others` the objective is the worst of the arms, all of which hold.

    Raises ParameterError for an unknown structure or objective, ConvergenceError where no law found holds.
    """
    if structure not in STRUCTURES:
        raise ParameterError(key="structure", value=structure, remedy=did_you_mean(structure, ["K1-K2", *STRUCTURES]))
    if objective not in LAW_OBJECTIVES:
        remedy = f"of a structure use one of {', '.join(LAW_OBJECTIVES)}"
        raise ParameterError(key="objective", value=objective, remedy=remedy)
    if not (0.0 <= Kp < np.inf):
        raise ParameterError(key="Kp", value=Kp, remedy="the hub angle gain is zero (chosen) or positive")
    chain, tell = Chain() if chain is None else chain, progress or (lambda text: None)
    T = chain.sampling.period
    Kp = Kp or usual_angle_gain(arm, T)
    form = STRUCTURES[structure](arm, Kp, modes, T)
    arms = (NamedArm(arm.name, arm, {}), *others)
    for counts in in_step([_counts(each.arm, chain, modes) for each in arms]):
        judges = [
            law_judge(each.arm, chain, form.law(form.origin), objective, modes, count)
            for each, count in zip(arms, counts, strict=True)
        ]
        for x in _best(judges, form, tell):
            law = form.law(x)
            if all(judge.holds(law) for judge in judges):
                named = dict(zip(form.names, form.coefficients(x).tolist(), strict=True))
                on_arms = [
                    _on_arm(each, judge.value(law), law, chain) for each, judge in zip(arms, judges, strict=True)
                ]
                return LawDesign(
                    objective, structure, law, {"Kp": Kp} | named, form.at_limit(x),
                    worst_value(objective, [each.value for each in on_arms]),
                    cast("Stability[LawLoop]", on_arms[0].verdict), law_verdict(arm, law, chain), modes, chain,
                    tuple(on_arms),
                )  # fmt: skip
    raise ConvergenceError(
        f"no law {structure} was found that holds when sampled: try another Kp or period", None, None
    )


def _on_arm(each: NamedArm, value: float, law: Law, chain: Chain) -> OnArm:
    """The verdicts on one arm."""
    sampled = brief_of(law_verdict(each.arm, law, chain), chain)
    return OnArm(each.name, each.numbers, value, law_stability(each.arm, law), sampled)


def score_on(found: LawDesign, arm: Arm) -> float:
    """What a design minimised, on another arm; `LOST` and more where the loop does not hold."""
    count = next(_counts(arm, found.chain, found.modes))
    return law_judge(arm, found.chain, found.law, found.objective, found.modes, count).score(found.law)


def _counts(arm: Arm, chain: Chain, modes: int) -> Iterator[int]:
    """Flexible modes of the first model, and of larger ones where its best laws do not hold."""
    if arm.has_elastic_link:
        yield UNDAMPED_MODES
        return
    most = most_modes(arm, chain)
    count = min(most, max(FEWEST_MODES, modes + FEWEST_MODES // 2))
    while count < most:
        yield count
        count *= 2
    yield most


def _best(judges: Sequence[LawJudge], form: Structure, tell: Progress) -> list[Real]:
    """The best points found, the best first; those that are not stable left out."""
    rng = np.random.default_rng(SEED)
    points = [form.origin, *(WIDTH * rng.standard_normal((STARTS, form.origin.size)))]
    scores = [_score(judges, form, x) for x in points]
    order = np.argsort(scores, kind="stable")[:REFINED]
    found = []
    for number, n in enumerate(order, 1):
        x = points[n]
        for size in (SIZE, SIZE / 10):
            x = _refined(judges, form, x, size)
        found.append((_score(judges, form, x), x))
        tell(f"{form.name}: search {number} of {len(order)}, best so far {min(found, key=_first)[0]:.6g}")
    found += [(scores[n], points[n]) for n in order]
    return [x for score, x in sorted(found, key=_first) if score < LOST]


def _first(pair: tuple[float, Real]) -> float:
    return pair[0]


def _score(judges: Sequence[LawJudge], form: Structure, x: Real) -> float:
    """The worst score of the arms; where one is lost, it alone, so that the next need not be asked."""
    try:
        law, worst = form.law(x), -np.inf
        for judge in judges:
            worst = max(worst, judge.score(law))
            if worst >= LOST:
                break
        return worst
    except (ParameterError, np.linalg.LinAlgError):  # coefficients too large to be a law
        return LOST * 1e9


def _refined(judges: Sequence[LawJudge], form: Structure, x: Real, size: float) -> Real:
    simplex = x + size * np.vstack([np.zeros(x.size), np.eye(x.size)])
    options: Any = {"initial_simplex": simplex, "xatol": 1e-6, "fatol": 1e-9, "maxfev": STEPS * x.size}

    def score(at: Any) -> float:
        return _score(judges, form, at)

    done = minimize(score, x, method="Nelder-Mead", options=options)
    return np.asarray(done.x, dtype=float)
