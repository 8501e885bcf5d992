"""The law of a structure with the best value of an objective, for one arm or for the worst of several.

A search within bounds by a judge of few modes is followed by exact verdicts, which exclude unstable laws.  The record
has the number of searches that agreed, the width of the optimum, and whether the bounds cut the search off.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache, partial
from itertools import islice
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

import numpy as np

from tfarm.arm import TWO_GAINS, AnyLaw, Arm, Law, must_turn
from tfarm.arm.stages import Consumer
from tfarm.arm.weights import USUAL_WEIGHTS, Weights, weights_of
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.dsp.plant import arm_under_chain
from tfarm.dsp.scenarios import slew_scenario
from tfarm.dsp.simulate import largest_moment, quantisers
from tfarm.dsp.stages import admit
from tfarm.errors import ConvergenceError, ParameterError, TfarmError
from tfarm.errors import require as require_that
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.norms import weight_sizes
from tfarm.loop.sampled_brief import sampled_brief
from tfarm.loop.stability import stability
from tfarm.records import frozen
from tfarm.synthesis.drawn import AnyStudy, drawn_arms, verify
from tfarm.synthesis.goals import must_have_norm, norm_bound
from tfarm.synthesis.judge import LOST, OBJECTIVES, TOO_SLOW, Judge, judge_of, model_sizes
from tfarm.synthesis.near_map import find_near_map
from tfarm.synthesis.required import RequiredLaw, RequirementTask, why_none
from tfarm.synthesis.requirements import (
    MEASURES,
    NAMES,
    NORM,
    RequirementList,
    measure_named,
    requirements_of,
)
from tfarm.synthesis.result import Design, OnArm
from tfarm.synthesis.search import Search, Worst, flat_part, search
from tfarm.synthesis.structures import STRUCTURES, Bounds, Structure, check_bounds, structure_of
from tfarm.synthesis.trade_off import TradeOff, front
from tfarm.synthesis.worst_case import (
    ArmBox,
    Effort,
    NamedArm,
    Tell,
    WorstCase,
    arms_of,
    for_the_worst,
    same_input,
)

CONSUMER = Consumer(
    "design",
    acts=(
        "reference",
        "shaper",
        "anti-alias filter",
        "hub rate",
        "law",
        "hold",
        "delay",
        "hub damping",
        "plant",
    ),
    partly=(
        "encoder",
        "amplifier steps",
        "amplifier range",
        "DAC steps",
        "DAC range",
        "torque limit",
        "arithmetic",
    ),
    none=("volts",),
)


class _Choice(NamedTuple):
    """A law that is stable on all arms, by the judges of `worst`."""

    worst: Worst
    search: Search
    score: float
    x: Any
    law: AnyLaw


def design(
    arm: Arm,
    objective: str | None = None,
    *,
    require: RequirementList | None = None,
    structure: str = TWO_GAINS,
    K1: Bounds | None = None,
    K2: Bounds | None = None,
    Kp: float = 0.0,
    modes: int = 2,
    chain: Chain | None = None,
    continuous: bool = False,
    progress: Tell | None = None,
    also: Sequence[Arm] = (),
    ranges: Mapping[str, Bounds] | None = None,
    study: AnyStudy | None = None,
    posterior: str | os.PathLike[str] | None = None,
    fresh: int = 64,
    weights: Mapping[str, Any] | Weights | None = None,
) -> Design:
    """Return the law of a structure with the best value of an objective in the sampled loop of a chain (default 10 ms).

    By default the law has the grade *good* in the result card of both loops, and the least settling time of the tip in
    the slew, or the least time constant of an arm that cannot turn.  Quantities of `tfarm.synthesis.requirements` are
    minimised under the requirements `require`, "good" by default, such as "GM>=6, PM>=45, torque<=5" or
    {"phase_margin": 45}: the time constant decides where the tip is at rest when the motion ends.  Where no law meets
    them all, that with the least violations is returned: `.is_met` is false, and `.conflicts` and `.alternatives` have
    what would help.

    Structures are those of `tfarm.synthesis.structures`: "K1-K2", gains of rate and moment, within the bounds `K1` and
    `K2` where given, "PD", "PD+notch" and others; `modes` is the number of filters, `Kp` is chosen where it is 0, but
    of "K1-K2".
    Objectives without requirements are "damping" of the first `modes` modes, "margin", "sensitivity", "delay",
    "residual" and "cost", of laws with a dominant time constant of at most four periods of mode 1, or 50 samples.  The
    law is stable when sampled, with all gains a quarter larger or smaller, and in continuous time.
    `continuous`: for the continuous-time loop instead, by "damping" unless another objective is named; its best law may
    be unstable when sampled.
    `progress` is called with one line at a time.

    `also` are further arms for the law, `ranges` the ends of numbers of the arm, such as {"payload.mass": (0.1, 0.5)}.
    The objective is then the worst of the arm, of those, of the corners of the box, and of worse arms inside it that a
    search finds, which is no proof over the box.  The law is stable on each arm in `.arms`; references and feed-forward
    are those of the arm itself.

    `study` is the file of a study, or its table of distributions, `posterior` that of a fit: requirements are met on
    the worst arms of a pool drawn from them, and `fresh` further arms examine the law, `.verification`.

    `weights` of S, KS and T are those of `tfarm.norm`, by default 1 of S and T: "norm" is the H-infinity norm of all
    weighted functions as a column, on the exact loop its certified upper bound.

    Raises ParameterError for options that exclude each other, ConvergenceError where no
    stable law is found.
    """
    if continuous and objective is None and require is None:
        objective = "damping"
    is_plain = require is None and objective in OBJECTIVES
    remedy = "requirements are of both loops: leave out the continuous-time loop"
    require_that(is_plain or not continuous, "continuous", continuous, remedy)
    ends = {key: (float(low), float(high)) for key, (low, high) in (ranges or {}).items()}
    box = ArmBox(arm, ends) if ends else None
    options = _Options(
        arm, structure, {"K1": K1, "K2": K2}, Kp, modes, chain or Chain(), tuple(also), box, progress, weights
    )
    is_of_drawn = study is not None or posterior is not None
    remedy = "requirements hold on arms of a study or posterior: name --minimise by one of their quantities"
    require_that(not (is_plain and is_of_drawn), "objective", objective, remedy)
    if is_plain:
        remedy = "the cost of the tuner's trial is one of samples: design for the sampled loop"
        require_that(objective != "cost" or not continuous, "objective", objective, remedy)
        if OBJECTIVES[str(objective)].of_slew:
            must_turn(arm)
        arms, form = options.arms_and_form(is_angle_free=False)
        task = _DesignTask(arm, str(objective), form, modes, options.chain, continuous, options.tell)
        return options.with_norm(
            task.design(*for_the_worst(arms, box, task.find, task.score_on, options.tell))
        )
    search_for, arms = options.task(objective, require)
    drawn = None
    worst = search_for.score_on
    if is_of_drawn:
        require_that(box is None, "range", ranges, "a study or posterior has its own ranges: leave these out")
        drawn = drawn_arms(arm, study, posterior, fresh)
        worst = search_for.violation_on
    found, named, case = for_the_worst(
        arms, box or drawn, partial(find_near_map, search_for), worst, options.tell
    )
    conflicts: tuple[str, ...] = ()
    alternatives: tuple[str, ...] = ()
    if found.violation > 0:
        conflicts = search_for.conflicts(found, named)
        alternatives = _alternatives(options, search_for, named)
    record = replace(
        _record(search_for, found, named, case, is_continuous=False),
        requirements=found.checked,
        sensitivities=tuple(search_for.sensitivities(found)),
        verification=verify(search_for, found, drawn, options.tell) if drawn is not None else None,
        conflicts=conflicts,
        alternatives=alternatives,
    )
    return replace(options, weights=search_for.weights).with_norm(record)


@lru_cache(maxsize=8)
def recommended_gains(arm: Arm, chain: Chain) -> tuple[Design | None, str]:
    """Return the design by default of an arm, and the reason where there is none."""
    try:
        return design(arm, chain=chain), ""
    except TfarmError as error:
        return None, str(error)


def trade_off(
    arm: Arm,
    objective: str | None = None,
    *,
    require: RequirementList | None = None,
    structure: str = TWO_GAINS,
    K1: Bounds | None = None,
    K2: Bounds | None = None,
    Kp: float = 0.0,
    modes: int = 2,
    chain: Chain | None = None,
    progress: Tell | None = None,
    also: Sequence[Arm] = (),
    number: int = 12,
    weights: Mapping[str, Any] | Weights | None = None,
) -> TradeOff:
    """Return the front of speed against robustness: designs from 0.4 to 1.9 times the limits of the grade good.

    Arguments are those of `design`; the dominant time constant is minimised unless another quantity is named.
    Requirements of other quantities than gain, phase and delay margin and Ms hold at every one of the `number` designs.
    Raises ParameterError as `design` does, ConvergenceError where no law is stable on all arms.
    """
    bounds = {"K1": K1, "K2": K2}
    options = _Options(
        arm, structure, bounds, Kp, modes, chain or Chain(), tuple(also), None, progress, weights
    )
    return front(*options.task(objective or "time-constant", require), number)


@frozen
class _Options:
    """The arms of a design, the structure with what is given of it, and its sampling."""

    arm: Arm
    structure: str
    bounds: dict[str, Bounds | None]
    Kp: float
    modes: int
    chain: Chain
    also: tuple[Arm, ...]
    box: ArmBox | None
    progress: Tell | None
    weights: Mapping[str, Any] | Weights | None

    def tell(self, text: str) -> None:
        """Pass a line of progress on."""
        if self.progress is not None:
            self.progress(text)

    def form(self, structure: str, *, is_angle_free: bool) -> Structure:
        """Return a structure with what is given of it, if it is the one named."""
        is_own = structure == self.structure
        found = structure_of(
            structure,
            self.arm,
            Kp=self.Kp if is_own else 0.0,
            modes=self.modes,
            period=self.chain.sampling.period,
            bounds=self.bounds if is_own else {},
            is_angle_free=is_angle_free,
        )
        *_, highest = quantisers(self.chain)[-1]
        return replace(found, is_limited=bool(np.isfinite(highest)))

    def with_norm(self, found: Design) -> Design:
        """Return a design with the norm of its law, where there are weights."""
        if self.weights is None:
            return found
        return replace(
            found, norm=norm_bound(Case(self.arm, found.law, self.chain), weights_of(self.weights))
        )

    def arms_and_form(self, *, is_angle_free: bool) -> tuple[list[NamedArm], Structure]:
        """Return all arms, each with its name, and the structure.  Raises ParameterError for what does not fit."""
        arms = arms_of(self.arm, self.also, self.box)
        for each in arms:
            admit(CONSUMER, each.arm, self.chain)
        same_input(arms)
        form = self.form(self.structure, is_angle_free=is_angle_free)
        for each in arms:
            ContinuousLoop(Case(each.arm, form.record_at(form.origin)))
            check_bounds(form, each.arm)
        if self.weights is not None:
            judge = judge_of(
                self.arm, self.arm, self.chain, "damping", form.signals, self.modes, self.modes + 2
            )
            must_have_norm(judge, form, weights_of(self.weights))
        return arms, form

    def task(
        self, objective: str | None, wanted: RequirementList | None
    ) -> tuple[RequirementTask, list[NamedArm]]:
        """Return the search for a law that meets requirements, and its arms."""
        if objective is None:
            # an arm that cannot turn has no slew
            objective = "settling" if self.arm.has_rigid_mode else "time-constant"
        remedy = (
            "goes without requirements: leave them out, or minimise settling, time-constant, torque or Ms"
        )
        require_that(objective not in OBJECTIVES or objective in NAMES, "objective", objective, remedy)
        minimised = measure_named(objective, "objective")
        remedy = "is large in a good loop: require it, and minimise settling, time-constant, torque or Ms"
        require_that(MEASURES[minimised].sense == "<=", "objective", objective, remedy)
        limits = requirements_of("good" if wanted is None else wanted)
        if MEASURES[minimised].of_slew or any(each.measure.of_slew for each in limits):
            # a file of a profile is read here, before any search
            rise = self.chain.slew.rise_time
            slew = slew_scenario(self.arm, self.chain, rise)
            is_small = abs(slew.rigid_moment).max() <= largest_moment(self.arm)
            remedy = "bends the arm far beyond small deflections: give [slew] a longer one, or minimise time-constant"
            require_that(is_small, "slew.rise_time", rise, remedy)
        arms, form = self.arms_and_form(is_angle_free=True)
        names = {minimised, *(each.name for each in limits)}
        if "peak_input" in names:
            form = replace(form, is_limited=True)
        weights = None
        if NORM in names or self.weights is not None:
            weights = weights_of(USUAL_WEIGHTS if self.weights is None else self.weights)
            # those of another period are refused before any work
            weight_sizes(weights, np.ones(1), self.chain.sampling.period)
        task = RequirementTask(self.arm, limits, minimised, form, self.modes, self.chain, self.tell, weights)
        return task, arms


def _other_forms(options: _Options) -> Iterator[Structure]:
    """Yield the other structures of an arm, those of few coefficients first."""
    forms = []
    for name in STRUCTURES:
        if name != options.structure:
            with suppress(ParameterError):
                forms.append(options.form(name, is_angle_free=True))
    # a search among more takes more than a minute
    most_coefficients = 6
    yield from sorted((each for each in forms if each.size <= most_coefficients), key=attrgetter("size"))


def _alternatives(options: _Options, task: RequirementTask, named: Sequence[NamedArm]) -> tuple[str, ...]:
    """Return the first other structure with a law that meets all requirements on all arms, if there is one."""
    if options.arm.has_elastic_link:
        # with the large models of an arm without damping a search takes minutes
        return ()
    others = (replace(task, form=each) for each in _other_forms(options))
    return tuple(islice((each.form.name for each in others if each.meets(named)), 1))


@frozen
class _DesignTask:
    """A task of design: the arm of the slews, an objective, and a structure with its bounds."""

    arm: Arm
    objective: str
    form: Structure
    modes: int
    chain: Chain
    continuous: bool
    tell: Tell

    def sizes(self, on: Arm) -> list[int]:
        """Return numbers of modes of the models of an arm, in turn."""
        return model_sizes(on, self.chain, self.modes, continuous=self.continuous)

    def judge(self, on: Arm, count: int) -> Judge:
        """Return the judge of laws on an arm, by a model of `count` modes."""
        return judge_of(
            on,
            self.arm,
            self.chain,
            self.objective,
            self.form.signals,
            self.modes,
            count,
            continuous=self.continuous,
        )

    def find(self, named: Sequence[NamedArm], before: _Choice | None, effort: Effort) -> _Choice:
        """Return the best law that is stable on all arms, near the one found `before`, if any.

        A sketch has the first models, and no exact verdict.  Raises ConvergenceError where none is found.
        """
        nearest: tuple[float, Any] = (np.inf, None)
        sizes = [self.sizes(each.arm) for each in named]
        near = None if before is None else before.x
        least_lost = TOO_SLOW if OBJECTIVES[self.objective].needs_speed else LOST
        for step in range(max(map(len, sizes))):
            several = tuple(
                self.judge(each.arm, own[min(step, len(own) - 1)])
                for each, own in zip(named, sizes, strict=True)
            )
            # corners, and what was worst inside the box: most laws are lost there
            last_first = Worst(several[::-1])
            found = search(last_first, self.form, self.tell, near, effort)
            nearest = min(nearest, found.found[0], key=itemgetter(0))
            for score, x in found.found:
                law = found.form.record_at(x)
                if effort == "sketch" or (
                    score < least_lost
                    and all(judge.is_stable(law) and judge.is_confirmed(law, score) for judge in several)
                ):
                    return _Choice(Worst(several), found, score, x, law)
        score, x = nearest
        law = self.form.record_at(x)
        chain = None if self.continuous else self.chain
        words = why_none(named, self.form, law, chain, max(map(max, sizes)))
        if len(named) > 1:
            words = f"{words}; for {len(named)} arms at once: {'; '.join(each.name for each in named)}"
        raise ConvergenceError(words, law, score)

    def score_on(self, choice: _Choice, on: Arm) -> float:
        """Return the score of a law on another arm; inf where the loop is unstable."""
        score = self.judge(on, self.sizes(on)[0]).score(choice.law)
        return score if score < LOST else np.inf

    def value_on(self, judge: Judge, on: Arm, law: AnyLaw) -> float:
        """Return the objective of a law on an arm of a judge."""
        return judge.value(law)

    def design(self, choice: _Choice, named: Sequence[NamedArm], case: WorstCase) -> Design:
        """Return the record of a law for these arms."""
        return _record(self, choice, named, case, is_continuous=self.continuous)


def _record(
    task: _DesignTask | RequirementTask,
    choice: _Choice | RequiredLaw,
    named: Sequence[NamedArm],
    case: WorstCase,
    *,
    is_continuous: bool,
) -> Design:
    """Return the record of a law for these arms."""
    law = choice.law
    x = choice.x
    own = choice.search.form
    objective = choice.worst.judges[0].objective
    on_arms = []
    for (name, arm, numbers), judge in zip(named, choice.worst.judges, strict=True):
        # of an arm without damping the judge has that with which its card is graded
        own_arm, chain = arm_under_chain(arm, task.chain)
        on_arm = Case(own_arm, law, chain)
        value = task.value_on(judge, arm, law)
        on_arms.append(OnArm(name, numbers, value, stability(on_arm), sampled_brief(on_arm)))
    at_ends = own.at_ends(x)
    physical = own.ends(physical=True)
    coefficients = own.by_name(own.coefficients(x).tolist())
    if isinstance(law, Law) and law.anti_windup:
        coefficients["anti_windup_s"] = law.anti_windup
    return Design(
        objective=task.objective,
        structure=own.name,
        law=law,
        coefficients=coefficients,
        value=objective.worst([each.value for each in on_arms]),
        verdict=on_arms[0].verdict,
        bounds={each.name: each.bounds for each in own.free},
        flat=flat_part(choice.worst, own, x, objective.within_one_per_cent(choice.score)),
        modes=task.modes,
        at_bound=tuple(own.names[place] for place, _ in at_ends),
        at_limit=tuple(own.names[place] for place, end in at_ends if (place, end) in physical),
        widened=choice.search.widened,
        loop="continuous" if is_continuous else "sampled",
        chain=task.chain,
        sampled=on_arms[0].sampled,
        arms=tuple(on_arms),
        starts=choice.search.starts,
        agreed=choice.search.agreed,
        worst_case=case,
    )
