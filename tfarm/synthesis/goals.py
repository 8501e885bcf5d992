"""Laws that meet requirements: the least value of a quantity, found on models and examined by the exact loops.

1. Differential evolution on a model of few modes minimises log q + w sum max(0, v), q a quantity of the loop and v the
   violations, with a floor of speed (`slowness`): an exact penalty (Fletcher, Practical Methods of Optimization, 1987,
   sec. 12.3), whose minimum lies on the limits where the weight w is above the multipliers.
2. A simplex of Nelder and Mead minimises quantities of the slew, which is simulated with its converters.
3. The result card of the exact loops has the last word.  What it has less than the model tightens the requirement
   on the model, and the search goes on from there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from operator import itemgetter
from typing import Annotated, Any, NamedTuple, cast

import numpy as np
from scipy.optimize import minimize

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.weights import Weights
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.assessment.card import LoopCard, analysis_of, graded_arm, loop_card
from tfarm.assessment.signal_figures import PARTS
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.dsp.plant import arm_under_chain
from tfarm.dsp.stages import admit_case
from tfarm.errors import ConvergenceError, require
from tfarm.loop.loop_margins import bandwidth
from tfarm.loop.norms import NormBound, norm
from tfarm.loop.sampled_verdict import SAMPLED_LOOP
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.gains import turning_inertia
from tfarm.spectrum.table import first_frequency
from tfarm.synthesis.judge import LOST, lost, of_laws, slowest_allowed
from tfarm.synthesis.measures import LoopMeasures
from tfarm.synthesis.models import DesignModel
from tfarm.synthesis.requirements import MEASURES, NORM, Requirement
from tfarm.synthesis.search import Search, Worst, sobol
from tfarm.synthesis.slew_measures import SLOPES, SlewMeasures
from tfarm.synthesis.structures import Entry
from tfarm.synthesis.worst_case import NamedArm

# ln |z| of a loop with the delay of its requirement, which counts as a violation of 1
GROWTH_OF_DELAY = 0.05
# requirements on poles, the others on the loop function
OF_POLES = ("least_damping", "time_constant_s", NORM)
# of the scores, times a violation
WEIGHT = 30.0
# of the time constant, in the score of a settling time: it decides where the tip is at rest when the motion ends
SHARE_OF_SPEED = 0.05


@frozen
class Goal:
    """The least value of a quantity under requirements, as an objective of a judge.

    `shifts` tighten each requirement of the sampled (0) and of the continuous-time loop (1) on the model; `delays` are
    further delays [periods] with which the sampled loop has to be stable.  A violation counts by the `weight`.
    `weights` are those of a norm.
    """

    requirements: tuple[Requirement, ...]
    minimised: str
    shifts: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    delays: tuple[float, ...] = ()
    weight: float = WEIGHT
    weights: Weights | None = None

    is_negated = False
    of_slew = False
    of_poles = True
    needs_speed = False

    @property
    def by_simulation(self) -> bool:
        """Whether a quantity of the slew is minimised or limited."""
        names = (self.minimised, *(each.name for each in self.requirements))
        return any(_is_of_slew(name) for name in names)

    def tighter(self, shifts: Real) -> Goal:
        """Return the goal with more (2, requirements) of each shift."""
        more = np.array(self.shifts) + shifts if any(self.shifts) else shifts
        return replace(self, shifts=(tuple(more[0].tolist()), tuple(more[1].tolist())))

    def shifted(self, loop: int) -> Iterable[tuple[Requirement, float]]:
        """Return each requirement with its shift in the sampled (0) or the continuous-time loop (1)."""
        shifts = self.shifts[loop] or (0.0,) * len(self.requirements)
        return zip(self.requirements, shifts, strict=True)

    def aims(self, judge: Any, entries: Sequence[Entry], limits: Real) -> Real:
        """Return the scores of laws (laws,), `LOST` and more where the model is unstable; any value above their limits.

        Margins of the sampled loop are first: most laws are above their limit by these, whatever their speed.
        """
        scores = slowness(judge, entries) + self._least(judge)
        for stage in (self._margins, self._speeds, self._continuous):
            left = np.flatnonzero(scores <= limits)
            if left.size:
                scores[left] += stage(judge, of_laws(entries, left))
        return self._with_delays(judge, entries, scores, limits)

    def _least(self, judge: Any) -> float:
        """Return a lower bound of the logarithm of the value."""
        if _is_of_slew(self.minimised) or self.minimised == "time_constant_s":
            # half the time constant of a pole at twice the first frequency
            return float(np.log(0.25 / first_frequency(judge.arm)))
        return float(np.log(LEAST_SIZE))

    def _margins(self, judge: Any, entries: Sequence[Entry]) -> Real:
        """Return the penalties of requirements on the loop function (laws,)."""
        return self._penalty(self.loop_violations(0, measures_of(judge, entries), (False,)))

    def _speeds(self, judge: Any, entries: Sequence[Entry]) -> Real:
        """Return the logarithm of the value above its bound, with the penalties of requirements on poles (laws,)."""
        loop = measures_of(judge, entries)
        growth = loop.growth
        scores = np.log(self.value(judge, loop)) - self._least(judge)
        scores += self._penalty(self.loop_violations(0, loop, (True,)))
        return np.where(growth < 0, scores, lost(1, growth))

    def _continuous(self, judge: Any, entries: Sequence[Entry]) -> Real:
        """Return the penalties of the continuous-time loop (laws,)."""
        return self._penalty(self.loop_violations(1, measures_of(judge, entries, judge.also[0])))

    def _with_delays(self, judge: Any, entries: Sequence[Entry], scores: Real, limits: Real) -> Real:
        """Return the scores with the penalty of the fastest growth under the delays required (laws,).

        The longest delay is first, by which most laws are above their limit.
        """
        found = scores.copy()
        for model in reversed(judge.delayed):
            left = np.flatnonzero(found <= limits)
            if left.size:
                growth = measures_of(judge, of_laws(entries, left), model).growth
                penalty = self._penalty([self._of_delay(growth)])
                found[left] = np.maximum(found[left], scores[left] + penalty)
        return found

    def value(self, judge: Any, sampled: LoopMeasures) -> Real:
        """Return the quantity that is minimised, in place of one of the slew the dominant time constant (laws,)."""
        if _is_of_slew(self.minimised):
            return sampled.dominant_time_constant(first_frequency(judge.arm))
        return np.maximum(sampled.of(self.minimised), LEAST_SIZE)

    def _penalty(self, violations: Iterable[Real]) -> Real:
        """Return the weighted sum of violations (laws,)."""
        return np.asarray(self.weight * sum(np.maximum(each, 0.0) for each in violations))

    def loop_violations(
        self, number: int, loop: LoopMeasures, of_poles: tuple[bool, ...] = (False, True)
    ) -> list[Real]:
        """Return the violations (laws,) of each requirement of the sampled (0) or the continuous-time loop (1)."""
        found = []
        for each, shift in self.shifted(number):
            if each.measure.is_of(number) and (each.name in OF_POLES) in of_poles:
                found.append(each.violations(loop.of(each.name)) + shift)
        return found

    def delay_violations(self, judge: Any, entries: Sequence[Entry]) -> list[Real]:
        """Return the growth (laws,) with the delays: the loop function leaves out that signals are read late."""
        growth = [measures_of(judge, entries, model).growth for model in judge.delayed]
        return [self._of_delay(np.max(growth, axis=0))] if growth else []

    def _of_delay(self, growth: Real) -> Real:
        """Return the violation of a loop with a delay required by the growth of its poles (laws,).

        After a correction it begins with a jump: a mode may grow slowly whatever the law.
        """
        least = 5e-4 if self.delays else 0.0
        return growth / GROWTH_OF_DELAY + np.where(growth >= 0, least, 0.0)

    def violations(self, judge: Any, sampled: LoopMeasures) -> list[Real]:
        """Return the violations (laws,) of each requirement of the loops but the delays, of the sampled one first."""
        continuous = measures_of(judge, sampled.entries, judge.also[0])
        return [*self.loop_violations(0, sampled), *self.loop_violations(1, continuous)]

    def on_models(self, judges: Sequence[Any], law: AnyLaw) -> Real:
        """Return the largest violations (2, requirements) of a law on the models, without shifts; -1 of a slew."""
        found = np.full((2, len(self.requirements)), -1.0)
        for judge in judges:
            entries = judge.entries(law)
            for number, model in enumerate((judge.model, *judge.also[:1])):
                loop = measures_of(judge, entries, model)
                for n, each in enumerate(self.requirements):
                    if each.measure.is_of(number):
                        found[number, n] = max(found[number, n], each.violations(loop.of(each.name))[0])
        return found

    def excess(self, judges: Sequence[Any], law: AnyLaw) -> float:
        """Return the sum of violations of a law on the models, the largest of the arms, without shifts."""
        plain = replace(self, shifts=((), ()), weight=1.0)
        found = []
        for judge in judges:
            loop = measures_of(judge, judge.entries(law))
            violations = plain.violations(judge, loop) + plain.delay_violations(judge, loop.entries)
            found.append(float(plain._penalty(violations)[0]))
        return max(found)

    def simulated_score(self, judge: Any, slew: SlewMeasures, law: AnyLaw) -> Real:
        """Return the score of one law with its slew, and those with `SLOPES` for the jumps of the settling time (3,).

        `LOST` where it is unstable on the model, or has no figure.
        """
        score = float(judge.score(law))
        if score >= LOST or not self.by_simulation:
            return np.full(3, score)
        figures = slew.of(law)
        for each, shift in self.shifted(0):
            if each.measure.of_slew:
                score += self.weight * max(each.violation(figures[each.name]) + shift, 0.0)
        if not _is_of_slew(self.minimised):
            return np.full(3, min(score, LOST))
        speed = float(self.value(judge, measures_of(judge, judge.entries(law)))[0])
        values = np.full(3, figures[self.minimised])
        if self.minimised == "settling_time_s":
            values[1:] = [figures[name] for name in SLOPES]
        if self.minimised.endswith("settling_time_s"):
            # a tip that does not settle in the longest record: of such laws the fastest is the best
            values = np.minimum(values, 100.0 * speed) + SHARE_OF_SPEED * speed
        return np.minimum(score + np.log(np.maximum(values, LEAST_SIZE) / speed), LOST)

    @property
    def below_models(self) -> float:
        """The difference of the score with a slew to that on the models, at least; -inf where that is not known.

        Where the tip is at rest when the motion ends the settling time is 0, and the law with the best score on the
        models is the best.
        """
        if self.minimised.endswith("settling_time_s"):
            return float(np.log(SHARE_OF_SPEED))
        return -np.inf if _is_of_slew(self.minimised) else 0.0

    def words(self, score: float) -> str:
        """Return a score as the quantity that is minimised on the models."""
        name = "time_constant_s" if _is_of_slew(self.minimised) else self.minimised
        measure = MEASURES[name]
        return f"{measure.title} {np.exp(score):.4g} {measure.unit}".rstrip() + ", violations counted"

    @staticmethod
    def worst(values: Sequence[float]) -> float:
        """Return the worst of its values."""
        return max(values)

    @staticmethod
    def within_one_per_cent(score: float) -> float:
        """Return the score of a value one per cent larger."""
        return score + 0.01


def measures_of(judge: Any, entries: Sequence[Entry], model: DesignModel | None = None) -> LoopMeasures:
    """Return the measures of laws in the sampled loop of a judge, or in another of its models."""
    return LoopMeasures(model or judge.model, entries, judge.chain.sampling.period)


def slowness(judge: Any, entries: Sequence[Entry]) -> Real:
    """Return 10 log(J w^2/abs(C(i w))) of laws, at least 0 (laws,), C from hub angle to input, w of `slowest_allowed`.

    Below one the law is slower than w: without this floor a law of hardly any gain is the best for the least Ms or
    input, and where a vibration decays more slowly than the hub whatever the law.  Of laws that are equal otherwise the
    faster is better, up to a tenth of the first frequency, or of a radian a sample.
    """
    period = judge.chain.sampling.period
    floor = 1 / slowest_allowed(judge.arm, period)
    usual = 0.1 * min(first_frequency(judge.arm), 1 / period)
    return 10 * _slower_than(floor, judge, entries) + 0.1 * _slower_than(usual, judge, entries)


def _slower_than(w: float, judge: Any, entries: Sequence[Entry]) -> Real:
    """Return log(J w^2/abs(C(i w))) of laws, at least 0 (laws,)."""
    s = 1j * w
    from_angle = {"hub_angle": 1.0, "hub_rate": s}
    gain: Any = np.zeros(1)
    for signal, num, den in entries:
        if signal in from_angle:
            gain = gain + from_angle[signal] * np.polyval(num, s) / np.polyval(den, s)
    # no less: a law without these signals, whatever its coefficients
    least = 1e-6
    return np.asarray(-np.log(np.clip(abs(gain) / (turning_inertia(judge.arm) * w**2), least, 1.0)))


def _is_of_slew(name: str) -> bool:
    return MEASURES[name].of_slew


def simulated_scores(goal: Goal, judges: Sequence[Any]) -> Callable[[AnyLaw], Real]:
    """Return a function from a law to its largest scores on any arm, with its slew (3,)."""
    # modes of a slew that is simulated hundreds of times
    modes = 8
    names = (goal.minimised, *(each.name for each in goal.requirements))
    parts = tuple(each for each in PARTS if any(name.startswith(f"{each}.") for name in names))
    slews = [SlewMeasures(judge.arm, judge.known, judge.chain, modes, parts) for judge in judges]
    pairs = list(zip(judges, slews, strict=True))
    return lambda law: np.max([goal.simulated_score(*pair, law) for pair in pairs], axis=0)


def by_slews(goal: Goal, judges: Sequence[Any], found: Search) -> list[tuple[float, Real]]:
    """Return the points of a search, and others of a sequence of Sobol, in the order of their slews.

    A law that is slower on the models may settle sooner.  The first three are ends of simplices.
    """
    # laws of the sequence whose value on the models is at most that many times the best, and their largest number
    slower = 5.0
    most = 40
    form = found.form
    points = sobol(*form.box, 1024, 99)
    of_models = Worst(tuple(judges)).scores(form, points)
    (near,) = np.nonzero(of_models < found.found[0][0] + np.log(slower))
    # in the order of the sequence, in which any first ones are spread over all
    near = near[:most]
    scores = simulated_scores(goal, judges)
    candidates = [x for _, x in found.found] + list(points[:, near].T)
    low, high = form.box
    chosen: list[Real] = []
    for n in np.argsort([scores(form.record_at(x))[-1] for x in candidates]):
        x = candidates[n]
        if len(chosen) < 3 and all((abs(x - other) > 0.05 * (high - low)).any() for other in chosen):
            chosen.append(x)
    ends = [polished(goal, judges, form, x, 1.0, 0.5, slope=-1) for x in chosen]
    return sorted(ends, key=itemgetter(0)) or found.found


def polished(
    goal: Goal, judges: Sequence[Any], form: Any, x: Real, size: float, share: float, slope: int = 1
) -> tuple[float, Real]:
    """Return the best score and point of a simplex that begins at x, with the slew simulated on every arm.

    `size` and `share` are of its usual size and its usual number of steps.  It goes down a `slope`, by its place among
    the scores, where the settling time jumps; the best of its points is that with the jumps.
    """
    scores = simulated_scores(goal, judges)
    points: list[tuple[float, Real]] = []

    def score(at: Real) -> float:
        found = scores(form.record_at(at)).tolist()
        points.append((found[0], at.copy()))
        return float(found[slope])

    low, high = form.box
    step = 0.02 * size * (high - low)
    is_outside = (x + step > high) | (x + step < low)
    edges = np.diag(np.where(is_outside, -step, step))
    most = int(60 * share * form.size)
    options = {"initial_simplex": [x, *(x + edges)], "maxfev": most, "adaptive": form.size > 2}
    cast("Any", minimize)(score, x, method="Nelder-Mead", bounds=np.transpose(form.box), options=options)
    return min(points, key=itemgetter(0))


class LoopValues(NamedTuple):
    """Exact values of the measures by name, of the sampled and the continuous-time loop, None of a law in z."""

    sampled: dict[str, float]
    continuous: dict[str, float] | None


def card_values(card: LoopCard) -> dict[str, float]:
    """Return the measures of a card, the worst value of what is not defined."""
    gain = [each.value for each in (card.gain_margin, card.gain_reduction)]
    damping = card.least_damping
    if card.stability != "stable":
        ratio = -np.inf
    elif damping is None:
        ratio = 1.0
    else:
        ratio = float(damping.ratio)
    return {
        "gain_margin_db": -np.inf if None in gain else min(cast("list[float]", gain)),
        "gain_reduction_db": _or(card.gain_reduction.value, -np.inf),
        "phase_margin_deg": _or(card.phase_margin.value, -np.inf),
        "delay_margin_ms": _or(card.delay_margin.value, -np.inf),
        "delay_margin_periods": _or(card.delay_margin_periods, -np.inf),
        "peak_sensitivity": _or(card.peak_sensitivity.value, np.inf),
        "disk_margin": _or(card.disk_margin, -np.inf),
        "least_damping": ratio,
        "time_constant_s": _or(card.time_constant, np.inf),
    }


def _or(value: float | None, other: float) -> float:
    return other if value is None else float(value)


@lru_cache(64)
def norm_bound(case: Case, weights: Weights) -> NormBound:
    """Return the norm of the column of all weighted functions of a sampled loop, with its certified bound."""
    case = admit_case(SAMPLED_LOOP, case)
    return norm(case.arm, case.law, case.chain, weights=weights).bounds[-1]


def must_have_norm(judge: Any, form: Any, weights: Weights) -> None:
    """Raise ParameterError for a weight with which the norm is infinite at rest under the first law of a structure."""
    entries = form.entries(form.coefficients(form.origin[:, None]))
    # near rest, one a tenth of the other [rad]: a pole at rest that nothing cancels makes ten times as much
    angles = np.array([1e-7, 1e-6])
    for name, block in weights.blocks.items():
        model = replace(judge.model, weights=Weights({name: block}, weights.period))
        ((nearest, near),) = measures_of(judge, entries, model).weighted(None, angles)
        remedy = "the norm is infinite: the function is not 0 at rest; give a stable pole"
        require(nearest < 3 * near, f"weights.{name}", "integrator", remedy)


def _bandwidths(name: str, case: Case) -> dict[str, float]:
    """Return the bandwidth of a loop, and its inverse, of the arm that the card grades."""
    case = admit_case(SAMPLED_LOOP, case)
    verdict = analysis_of(name, case.on(graded_arm(case.arm)[0])).verdict
    found = bandwidth(verdict.full, verdict.frequencies)
    return {"bandwidth_rad_s": found, "inverse_bandwidth_s": 1 / found}


def loop_values(name: str, case: Case, weights: Weights | None) -> dict[str, float]:
    """Return the exact measures of the loop of that name; the norm, of the sampled one with weights, by its bound."""
    card = loop_card(name, case)
    values = card_values(card)
    if card.stability == "stable":
        values |= _bandwidths(name, case)
        if weights is not None and name == "sampled":
            bound = norm_bound(case.on(graded_arm(case.arm)[0]), weights)
            values[NORM] = bound.value if bound.upper is None else bound.upper
    return values


@lru_cache(256)
def exact_values(case: Case, known: Arm | None, weights: Weights | None = None) -> LoopValues:
    """Return the measures of both loops of a case by the result card.

    Those of the slew are for an arm `known`, if any, and the norm is the upper bound with the weights, if any.
    """
    found: list[dict[str, float] | None] = []
    for name in ("sampled", "continuous"):
        if name == "continuous" and case.law.is_discrete:
            found.append(None)
            continue
        try:
            found.append(loop_values(name, case, weights))
        except ConvergenceError:
            found.append({})
    sampled = found[0] or {}
    if known is not None:
        arm, chain = arm_under_chain(case.arm, case.chain)
        slew = SlewMeasures(arm, arm_under_chain(known, case.chain)[0], chain)
        sampled = {**sampled, **slew.of(case.law)}
    return LoopValues(sampled, found[1])


class Checked(NamedTuple):
    """A requirement with the exact values of a law on an arm, and its violation, the larger of the two loops."""

    requirement: Annotated[str, Quantity("requirement", help="as after --require")]
    arm: Annotated[str, Quantity("arm", help="the arm")]
    sampled: Annotated[
        float | None, Quantity("sampled", digits=4, help="by the card of the sampled loop, or its slew")
    ]
    continuous: Annotated[
        float | None, Quantity("continuous-time", digits=4, help="of the continuous-time loop")
    ]
    violation: Annotated[
        float, Quantity("violation", digits=2, help="excess over the limit in units of the limit")
    ]


def check(goal: Goal, known: Arm, chain: Chain, named: NamedArm, law: AnyLaw) -> tuple[list[Checked], Real]:
    """Return the requirements with exact values of a law on an arm, and violations (2, requirements) of the loops.

    These are of the arm and the chain as they are given; slews are those of the arm `known`.
    """
    values = exact_values(Case(named.arm, law, chain), known if goal.by_simulation else None, goal.weights)
    rows = []
    violations = np.full((2, len(goal.requirements)), -1.0)
    for n, each in enumerate(goal.requirements):
        shown = [None if of is None else of.get(each.name) for of in values]
        for loop, value in enumerate(shown):
            if values[loop] is not None and (not loop or each.measure.is_of(loop)):
                violations[loop, n] = np.inf if value is None else each.violation(value)
        rows.append(Checked(str(each), named.name, shown[0], shown[1], float(violations[:, n].max())))
    return rows, violations
