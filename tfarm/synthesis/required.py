"""Search for the law that meets requirements on all arms, and the reasons where none of a structure does.

What the exact loops have less than the models tightens the requirements of the next search; four of these are enough.
Where no law meets them all, the law with the least violations is returned, with the requirements that conflict: those
without which the others are met.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from operator import attrgetter
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import ANGLE_GAIN, TWO_GAINS, AnyLaw, Arm
from tfarm.arm.weights import Weights
from tfarm.arrays import Real
from tfarm.assessment.card import graded_arm
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.loop.edges import most_modes
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.synthesis.goals import (
    WEIGHT,
    Checked,
    Goal,
    by_slews,
    check,
    exact_values,
    loop_values,
    measures_of,
    polished,
    simulated_scores,
)
from tfarm.synthesis.judge import LOST, Judge, judge_of, model_sizes
from tfarm.synthesis.models import sampled_model
from tfarm.synthesis.requirements import MEASURES, Requirement
from tfarm.synthesis.search import Search, Worst, search
from tfarm.synthesis.structures import Structure
from tfarm.synthesis.worst_case import Effort, NamedArm, Tell

# of a violation on the models: less is met after a search that goes on
MET = 1e-3
# and without one requirement, where the others are looked at
NEAR = 0.05
# by the exact loops: up to it a simplex corrects the law, beyond it a search
SMALL = 0.1
DELAY = "delay_margin_periods"
# of scores, logarithms of a quantity: a smaller difference is none
SAME = 3e-3


class RequiredLaw(NamedTuple):
    """A law found for some arms, its goal with shifts, and the requirements with exact values on each arm.

    `violations` (2, requirements) are the largest on any arm, of the sampled and the continuous-time loop.
    """

    worst: Worst
    search: Search
    score: float
    x: Real
    law: AnyLaw
    goal: Goal
    checked: tuple[Checked, ...]
    violations: Real = np.zeros((2, 0))

    @property
    def violation(self) -> float:
        """The largest violation on any arm, 0 where all requirements are met; inf of an unstable loop."""
        return max((each.violation for each in self.checked), default=0.0)


class RequirementSlope(NamedTuple):
    """The change of a required quantity with a coefficient."""

    requirement: Annotated[str, Quantity("requirement", help="as after --require")]
    coefficient: Annotated[str, Quantity("coefficient", help="a number of the law")]
    change: Annotated[
        float,
        Quantity(
            "change per 1 %", digits=3, help="of the quantity, sampled loop, per 1 % of the coefficient"
        ),
    ]


@frozen
class RequirementTask:
    """A search for the least `minimised` quantity under requirements by a structure; slews are those of `arm`."""

    arm: Arm
    requirements: tuple[Requirement, ...]
    minimised: str
    form: Structure
    modes: int
    chain: Chain
    tell: Tell
    weights: Weights | None = None

    @property
    def goal(self) -> Goal:
        """The goal without shifts."""
        return Goal(self.requirements, self.minimised, weights=self.weights)

    def judge(self, on: Arm, goal: Goal, step: int) -> Judge:
        """Return the judge of laws on an arm by the models of a step of their sizes, with the delays required.

        An arm without damping has that with which its card is graded.
        """
        graded, _ = graded_arm(on)
        sizes = model_sizes(graded, self.chain, self.modes, continuous=False)
        count = sizes[min(step, len(sizes) - 1)]
        found = judge_of(graded, self.arm, self.chain, goal, self.form.signals, self.modes, count)
        if graded is not on:
            # the loop of the arm as it is has to be stable
            most = model_sizes(on, self.chain, self.modes, continuous=False)[0]
            own = judge_of(on, self.arm, self.chain, goal, self.form.signals, self.modes, most)
            found = replace(found, also=(*found.also, own.model, *own.also))
        if goal.weights is not None:
            found = replace(found, model=replace(found.model, weights=goal.weights))
        sampling = found.chain.sampling
        delays = list(goal.delays)
        for each, shift in goal.shifted(0):
            if each.name == DELAY:
                # a little more, so that the exact margin is not below the limit by its rounding
                longest = each.limit * (1.0005 + shift)
                delays += [longest / 3, 2 * longest / 3, longest]
        chains = [
            replace(found.chain, sampling=replace(sampling, delay_samples=sampling.delay_samples + each))
            for each in delays
        ]
        signals = found.model.signals
        delayed = tuple(sampled_model(found.arm, each, signals, self.modes, count) for each in chains)
        return replace(found, delayed=delayed)

    def find(self, named: Sequence[NamedArm], before: RequiredLaw | None, effort: Effort) -> RequiredLaw:
        """Return the best law for all arms, near the one found `before`, if any.

        Raises ConvergenceError where no law is stable on all arms.
        """
        goal = self.goal if before is None else before.goal
        form = self.form if before is None else before.search.form
        near = None if before is None else before.x
        best: RequiredLaw | None = None
        sizes = [model_sizes(each.arm, self.chain, self.modes, continuous=False) for each in named]
        step = 0
        chosen: RequiredLaw | None = None
        # no score with a slew is below
        least = -np.inf
        # with the large models of undamped arms a search takes a minute
        attempts = 2 if any(each.arm.has_elastic_link for each in named) else 8
        for attempt in range(attempts):
            judges = tuple(self.judge(each.arm, goal, step) for each in named)
            share = 1.0
            size = 1.0
            if chosen is not None and chosen.violation < SMALL:
                # a small correction moves the best law little
                found = chosen.search._replace(found=[(chosen.score, chosen.x)])
                share = 0.25
                # a simplex that is too large ends before it is as small as the correction
                size = max(100 * chosen.violation, 1e-3)
            else:
                found = search(Worst(judges[::-1]), form, self.tell, near, effort if attempt == 0 else "near")
                if attempt == 0 and effort == "whole" and found.found[0][0] < LOST:
                    least = found.found[0][0] + goal.below_models
                    found, share = _ranked_by_slews(goal, judges, found, least)
            form = found.form
            law = form.record_at(found.found[0][1])
            if found.found[0][0] >= LOST:
                break
            if effort == "sketch":
                return RequiredLaw(Worst(judges), found, *found.found[0], law, goal, ())
            chosen = self._first_stable(named, judges, found, goal, min(size, share), share)
            if chosen is None:
                step += 1
                if step >= max(map(len, sizes)):
                    break
                continue
            # further delays that change nothing: the models leave out what is missing
            is_stuck = best is not None and SMALL < 0.99 * best.violation < chosen.violation and goal.delays
            if best is None or chosen.violation < best.violation:
                best = chosen
            if chosen.violation <= 0 and effort == "whole":
                return self._relaxed(named, judges, chosen, least)
            if chosen.violation <= 0 or is_stuck:
                break
            near = chosen.x
            if goal.excess(judges, chosen.law) > MET:
                # the weight is below the multipliers, or no law meets the requirements
                if goal.weight > WEIGHT:
                    break
                goal = replace(goal, weight=10 * WEIGHT)
                continue
            goal = self._corrected(goal, chosen.violations)
        if best is None:
            raise ConvergenceError(why_none(named, form, law, self.chain, max(map(max, sizes))), law, None)
        return best

    def _first_stable(
        self,
        named: Sequence[NamedArm],
        judges: tuple[Judge, ...],
        found: Search,
        goal: Goal,
        size: float,
        share: float,
    ) -> RequiredLaw | None:
        """Return the best law of a search that is stable: the models may leave out a mode by which it is not."""
        points = (x for score, x in found.found if score < LOST)
        laws = (self.examine(named, judges, found, x, goal, size, share) for x in points)
        return next((each for each in laws if np.isfinite(each.violation)), None)

    def examine(
        self,
        named: Sequence[NamedArm],
        judges: tuple[Judge, ...],
        found: Search,
        x: Real,
        goal: Goal,
        size: float = 1.0,
        share: float = 1.0,
    ) -> RequiredLaw:
        """Return the end of a simplex from a point, with the exact values of all requirements on each arm.

        Where the exact loop of that is unstable, it is the law at the point.
        """
        _, end = polished(goal, judges, found.form, x, size, share)
        better = self._exact(named, judges, found, end, goal)
        if np.isfinite(better.violation):
            return better
        return self._exact(named, judges, found, x, goal)

    def _relaxed(
        self, named: Sequence[NamedArm], judges: tuple[Judge, ...], chosen: RequiredLaw, least: float
    ) -> RequiredLaw:
        """Return a law that meets the requirements, with less left of those by which the models are stricter.

        The score is not searched below the `least`.  The shift of a requirement is what the exact loops violate more
        than the models at the law before.
        """
        # of a violation: what is farther from its limit is not active
        near = 0.1
        is_other = [each.name != DELAY for each in self.requirements]
        # of simplices to either side, the second begun at the end of the first; one where a slew takes longer
        sizes = (0.5, -0.5) if chosen.search.form.size <= 2 else (0.5,)
        value = self._aim(judges, chosen)
        for size in sizes:
            if value < least + SAME:
                break
            goal = chosen.goal
            by_models = goal.on_models(judges, chosen.law)
            shifts = np.array(goal.shifts) if any(goal.shifts) else np.zeros_like(by_models)
            gap = chosen.violations - by_models + 1e-5
            is_known = (chosen.violations > -near) & np.isfinite(gap) & is_other
            shifts = np.where(is_known, gap, shifts) - shifts
            better = self.examine(named, judges, chosen.search, chosen.x, goal.tighter(shifts), size, 0.5)
            found = self._aim(judges, better)
            if better.violation <= 0 and found < value:
                chosen = better
                value = found
        return chosen

    def _aim(self, judges: tuple[Judge, ...], choice: RequiredLaw) -> float:
        """Return the logarithm of the quantity that is minimised, on the models with their slews."""
        plain = Goal((), self.minimised, weights=self.weights)
        return float(simulated_scores(plain, judges)(choice.law)[0])

    def _exact(
        self, named: Sequence[NamedArm], judges: tuple[Judge, ...], found: Search, x: Real, goal: Goal
    ) -> RequiredLaw:
        """Return the law at x with the exact values of all requirements on each arm."""
        form = found.form
        coefficients, *others = form.typed(x)
        if others:
            scores = simulated_scores(goal, judges)
            least = scores(form.record_at(x))[0] + SAME
            # next to a jump the nearest may be on its other side
            near = (each for each in (coefficients, *others) if scores(form.record_of(each))[0] <= least)
            coefficients = next(near, coefficients)
        law = form.record_of(coefficients)
        x = form.at(coefficients)
        score = float(Worst(judges).scores(form, x[:, None])[0])
        rows = []
        violations = np.full((2, len(self.requirements)), -1.0)
        for each in named:
            own, exact = check(goal, self.arm, self.chain, each, law)
            rows += own
            violations = np.maximum(violations, exact)
        return RequiredLaw(Worst(judges), found, score, x, law, goal, tuple(rows), violations)

    def _corrected(self, goal: Goal, violations: Real) -> Goal:
        """Return the goal with what the exact loops have less: shifts, and the delays that make a loop unstable."""
        # a little more of a small one, so that few corrections end below the limit
        more = np.minimum(0.5 * violations, 1e-3) + 1e-5
        shifts = np.where(violations > 0, 1.1 * violations + more, 0.0)
        for n, each in enumerate(self.requirements):
            if each.name == DELAY and 0 < violations[0, n] < np.inf:
                # the loop is unstable from there on, though not with every longer delay
                first = each.limit * (1 - violations[0, n])
                goal = replace(goal, delays=(*goal.delays, *np.linspace(first, each.limit, 5).tolist()))
                # an active limit is missed by rounding, one between two delays of the models by more
                if violations[0, n] > 0.01:
                    shifts[0, n] = 0.0
        return goal.tighter(shifts)

    @property
    def objective(self) -> str:
        """The quantity that is minimised, as it is written."""
        return MEASURES[self.minimised].short[0]

    def values_on(self, on: Arm, law: AnyLaw) -> dict[str, float]:
        """Return the exact measures of a law on an arm, of the sampled loop, with its slew where that is minimised."""
        known = self.arm if MEASURES[self.minimised].of_slew else None
        return exact_values(Case(on, law, self.chain), known, self.weights).sampled

    def value_on(self, judge: Judge, on: Arm, law: AnyLaw) -> float:
        """Return the quantity of a law that is minimised, on an arm of a judge."""
        return self.values_on(on, law).get(self.minimised, np.inf)

    def meets(self, named: Sequence[NamedArm]) -> bool:
        """Return whether a law of the structure meets all requirements on all arms."""
        with suppress(ConvergenceError):
            near = self._nearly_met(named, self.form, None)
            return near is not None and self.find(named, near, "near").violation <= 0
        return False

    def _nearly_met(
        self, named: Sequence[NamedArm], form: Structure, near: Real | None
    ) -> RequiredLaw | None:
        """Return a law by the models alone that violates the requirements by less than `NEAR`, None without one.

        A sketch is enough where its law is far from any.
        """
        # of violations: a whole search hardly finds so much less than a sketch
        far = 0.5
        judges = tuple(self.judge(each.arm, self.goal, 0) for each in named)
        for effort in ("sketch", "near"):
            found = search(Worst(judges[::-1]), form, self.tell, near, effort)
            score, x = found.found[0]
            law = found.form.record_at(x)
            excess = self.goal.excess(judges, law)
            if score < LOST and excess <= NEAR:
                return RequiredLaw(Worst(judges), found, score, x, law, self.goal, ())
            if score >= LOST or excess > far:
                break
        return None

    def score_on(self, choice: RequiredLaw, on: Arm) -> float:
        """Return the value of a law on another arm, e^(w v) times as much under a violation v; inf if unstable.

        Of logarithms one per cent more would say nothing.
        """
        judge = self.judge(on, choice.goal, 0)
        value = choice.goal.value(judge, measures_of(judge, judge.entries(choice.law)))[0]
        score = float(np.log(value)) + choice.goal.weight * self.violation_on(choice, on)
        return float(np.exp(score)) if score < np.log(LOST) else np.inf

    def violation_on(self, choice: RequiredLaw, on: Arm) -> float:
        """Return the largest violation of a requirement on an arm, 0 where all are met; inf of an unstable loop.

        By the exact loops where the models are near a limit; after a sketch, which has not examined the law, by the
        models.
        """
        # of a limit: an arm with more left by the models has some left by the exact loops
        near = 0.01
        by_models = violation_by_models(self.judge(on, choice.goal, 0), choice)
        if by_models < -near or not choice.checked:
            return max(0.0, by_models)
        rows, _ = check(choice.goal, self.arm, self.chain, NamedArm(on.name, on, {}), choice.law)
        return max(0.0, *(each.violation for each in rows))

    def without(self, name: str) -> RequirementTask:
        """Return the task without the requirement of this name."""
        return replace(self, requirements=tuple(each for each in self.requirements if each.name != name))

    def conflicts(self, choice: RequiredLaw, named: Sequence[NamedArm]) -> tuple[str, ...]:
        """Return the requirements without which the others are met, near a law that does not meet them all."""
        form = choice.search.form
        return tuple(
            str(each)
            for each in self.requirements
            if self.without(each.name)._nearly_met(named, form, choice.x) is not None
        )

    def sensitivities(self, choice: RequiredLaw) -> list[RequirementSlope]:
        """Return the changes of the required quantities of the exact sampled loop, by differences.

        A margin without a limit has none.
        """
        form = choice.search.form
        # of a coefficient: a slope has the error of its bend over that, and the digits of a margin are far below
        change = 1e-4
        values = loop_values("sampled", Case(self.arm, choice.law, self.chain), self.weights)
        found = []
        for n, coefficient in enumerate(form.names):
            c = form.coefficients(choice.x)
            c[n] *= 1 + change
            case = Case(self.arm, form.record_at(form.at(c)), self.chain)
            changed = loop_values("sampled", case, self.weights)
            for each in self.requirements:
                if not each.measure.is_of(0):
                    continue
                slope = (changed.get(each.name, np.inf) - values.get(each.name, np.inf)) / change / 100
                if np.isfinite(slope):
                    found.append(RequirementSlope(str(each), coefficient, slope))
        return found


def violation_by_models(judge: Judge, choice: RequiredLaw) -> float:
    """Return the largest violation on the models of both loops, negative where all are met; 0 where a slew decides."""
    entries = judge.entries(choice.law)
    wanted = choice.goal.requirements
    found = [0.0] if any(each.measure.of_slew for each in wanted) else []
    for number, model in enumerate((judge.model, *judge.also[:1])):
        loop = measures_of(judge, entries, model)
        if loop.growth.max() >= 0:
            return np.inf
        found += [
            float(each.violations(loop.of(each.name))[0]) for each in wanted if each.measure.is_of(number)
        ]
    return max(found)


def _ranked_by_slews(
    goal: Goal, judges: tuple[Judge, ...], found: Search, least: float
) -> tuple[Search, float]:
    """Return a search in the order of slews, and the share of a simplex from its best law.

    No score with a slew is below the `least`: where the best law on the models has it, a quarter of one is enough.
    """
    law = found.form.record_at(found.found[0][1])
    if simulated_scores(goal, judges)(law)[0] < least + SAME:
        return found, 0.25
    return found._replace(found=by_slews(goal, judges, found)), 1.0


def is_active(checked: Checked) -> bool:
    """Whether a requirement limits a law: less than two per cent of its limit are left."""
    # of the limit
    slack = 0.02
    return checked.violation > -slack


def names_of(rows: Sequence[Checked], test: Any) -> list[str]:
    """Return the requirements of the rows that pass a test, each once."""
    return list(dict.fromkeys(each.requirement for each in rows if test(each)))


def why_none(arms: Sequence[NamedArm], form: Structure, law: AnyLaw, chain: Chain | None, size: int) -> str:
    """Return the most unstable mode under the law nearest to stability when sampled, the bounds, and a remedy.

    `size` is the number of modes of the largest model.
    """
    within = " and ".join(f"{each.name} in ({each.bounds[0]:g}, {each.bounds[1]:g})" for each in form.free)
    text = f"no law {form.name} with {within} was found that is stable"
    if chain is None:
        return f"{text}: widen the bounds"
    verdicts = [sampled_verdict(Case(each.arm, law, chain)) for each in arms]
    verdict = max(verdicts, key=attrgetter("log_radius"))
    growth = np.expm1(verdict.log_radius)
    nearest = f"{verdict.slowest} grows by {growth:.2g} a sample" if growth > 0 else "there is no reserve"
    remedy = f"widen the bounds, or try another {ANGLE_GAIN} or period"
    text = f"{text} when sampled: under the nearest law {nearest}; {remedy}"
    if any(most_modes(each.arm, chain) > size for each in arms if not each.arm.has_elastic_link):
        text = f"{text}; only models of up to {size} modes were searched"
    if not verdict.loop.plant.arm.has_elastic_link or form.name == TWO_GAINS:
        return text
    return (
        f"{text}; with link.damping = 0 every mode that the law does not damp at its alias is unstable under a held "
        f"input: give link.damping, or take {TWO_GAINS}"
    )
