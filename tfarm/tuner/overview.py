"""The numbers of the tuner's section: one tuning, its simulations, its studies, and the table of comparisons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.dsp import Chain, Simulation
from tfarm.dsp.results import ideal_chain
from tfarm.dsp.traces import WITHOUT, resolved
from tfarm.errors import CertificationError, ConvergenceError, ParameterError
from tfarm.records import record
from tfarm.spectrum.scales import first_frequency
from tfarm.tuner import Learning, Plan, Tuning, compare_controllers, tried_loops, tune
from tfarm.tuner.comparison import Outcomes, quantised_chain
from tfarm.tuner.guard import GuardKind
from tfarm.tuner.studies import (
    ALPHAS,
    ETAS,
    PAPER_PAIR,
    Finished,
    final_cost,
    learning_costs,
    map_verdict,
    plans_of,
    run_study,
)
from tfarm.tuner.training import Rule
from tfarm.tuner.tuning import usual_plan

MOST_SAMPLES = 80_000_000  # that its trials may have together, some 35 s of one core
SERVO_SPEED = 1 / 20  # of the first frequency: the servo's angle loop is so slow that it leaves the mode alone
SERVO_TURN = 0.03  # rad a sample, where that is slower
STUDY_THREADS = 2  # threads; a report uses no more cores
LEARNT: tuple[tuple[str, str, Rule, GuardKind], ...] = (
    ("default", "default, in the guard", "dynamic", "time-varying"),
    ("default_no_guard", "default, no guard", "dynamic", "none"),
    ("plain", "(21) as printed, no guard", "plain", "none"),
)
AS_TRAINED, QUANTISED_AND_LATE = 0, 3  # rows of the comparison, which begins with those of the arm itself


@dataclass(frozen=True, kw_only=True)
@record
class StudySize:
    """How much is tried: seeds of the learning curves, seeds and trials of each pair of the map, its pairs, and the
    `conditions` of the comparison (None: all).

    A coarser map has every second momentum factor and learning rate, the paper's pair among them.
    """

    curve_seeds: int
    map_seeds: int
    map_trials: int
    coarser: bool = False
    conditions: int | None = None

    def map_plans(self, base: Plan) -> list[Plan]:
        """The plans of the map."""
        plans = plans_of("map", replace(base, trials=self.map_trials), self.map_seeds)
        wanted = (ALPHAS[1::2], ETAS[::2]) if self.coarser else (ALPHAS, ETAS)
        return [plan for plan in plans if plan.learning.alpha in wanted[0] and plan.learning.eta in wanted[1]]

    @property
    def trials(self) -> int:
        """How many trials the curves and the map have together."""
        base = Plan()
        return len(LEARNT) * self.curve_seeds * base.trials + self.map_trials * len(self.map_plans(base))


SIZES = (
    StudySize(curve_seeds=20, map_seeds=5, map_trials=60),
    StudySize(curve_seeds=8, map_seeds=1, map_trials=60),
    StudySize(curve_seeds=3, map_seeds=1, map_trials=20, coarser=True, conditions=QUANTISED_AND_LATE + 1),
)


def study_size(samples: int) -> StudySize | None:
    """The largest of SIZES with trials of so many samples within MOST_SAMPLES; None where there is none."""
    return next((size for size in SIZES if size.trials * samples <= MOST_SAMPLES), None)


@dataclass(frozen=True)
@record
class Curves:
    """Learning curves of one rule over the seeds: `costs` (seeds, trials), inf from where a run diverged."""

    key: str
    title: str
    costs: Real
    finished: tuple[Finished, ...]

    def quantile(self, share: float) -> Real:
        """The cost that this share of the seeds is below, after each trial; always one of the costs."""
        return np.asarray(np.quantile(self.costs, share, axis=0, method="nearest"))

    @property
    def final(self) -> Real:
        """The costs with what was learnt."""
        return np.array([each.cost for each in self.finished])

    @property
    def died(self) -> int:
        """How many seeds ended with the gain switched off."""
        return sum(each.died for each in self.finished)

    @property
    def diverged(self) -> int:
        """How many ran away."""
        return sum(each.stopped for each in self.finished)


@dataclass(frozen=True)
@record
class CostMap:
    """`median` (alphas, etas) of the final cost over the seeds, and the study's verdict on the paper's pair."""

    alphas: Real
    etas: Real
    median: Real
    verdict: str

    @property
    def best(self) -> tuple[int, int]:
        """Row and column of the lowest."""
        i, j = np.unravel_index(int(np.argmin(self.median)), self.median.shape)
        return int(i), int(j)

    @property
    def papers(self) -> tuple[int, int]:
        """Row and column of the paper's pair."""
        return int(np.argmin(abs(self.alphas - PAPER_PAIR[0]))), int(np.argmin(abs(self.etas - PAPER_PAIR[1])))

    @property
    def is_papers_best(self) -> bool:
        """Whether nothing is lower than the paper's pair."""
        return bool(self.median[self.papers] <= self.median[self.best])

    @property
    def best_at_edge(self) -> bool:
        """Whether the lowest lies at the largest momentum or learning rate of the map."""
        return self.best[0] == self.alphas.size - 1 or self.best[1] == self.etas.size - 1


@dataclass(frozen=True)
@record
class TunerStudy:
    """All of it.  `slews` and `coarse` hold two simulations each, without and with the tuner; `constant` is the slew
    with the best constant gain; `servo` the tuning with the angle held, None where no range of gains is proven there.
    `size`: how much of it was tried.
    """

    arm: Arm
    size: StudySize
    tuning: Tuning
    slews: Mapping[str, Simulation]
    constant: Simulation
    coarse: Mapping[str, Simulation]
    curves: tuple[Curves, ...]
    cost_map: CostMap
    rows: tuple[Outcomes, ...]
    servo: Tuning | None


def tuner_study(arm: Arm, chain: Chain) -> TunerStudy:
    """Train with the paper's figures, through the arm's own chain with its converters ideal, and measure.

    Raises ParameterError for an arm without a loop or a slew, or with too many samples in one, CertificationError where
    no range of gains is proven.
    """
    plan = usual_plan(arm, chain)
    size = study_size(trial_samples(arm, chain))
    if size is None:
        raise ParameterError(key="sampling.period", value=chain.sampling.period, remedy="too short for so long a slew")
    tuning = tune(arm, plan, ideal_chain(chain))
    ideal = tuning.trial.loop.chain
    listed = tried_loops(arm, ideal, quantised_chain(arm, chain))[: size.conditions]
    rows = compare_controllers(tuning.trial, tuning.gain(), tuning.training.guard, listed, tuning.best_constant.gain)
    return TunerStudy(
        arm=arm,
        size=size,
        tuning=tuning,
        slews=_simulated(tuning, ideal),
        constant=tuning.trial.simulator(chain=ideal).linear(tuning.constant),
        coarse=_simulated(tuning, listed[QUANTISED_AND_LATE].chain),
        curves=tuple(_curves(tuning, size, *each) for each in LEARNT),
        cost_map=_cost_map(tuning, size),
        rows=tuple(rows),
        servo=_servo_tuning(arm, plan, ideal),
    )


def _servo_tuning(arm: Arm, plan: Plan, chain: Chain) -> Tuning | None:
    """The same tuning with an angle loop a twentieth as fast as the first mode, or slower where the clock is slow."""
    speed = min(SERVO_SPEED * first_frequency(arm), SERVO_TURN / chain.sampling.period)
    on_angle = float(f"{arm.turned_inertia * speed**2:.2g}")
    try:
        return tune(arm, plan.holding(arm, on_angle), chain)
    except (CertificationError, ConvergenceError):
        return None


def trial_samples(arm: Arm, chain: Chain) -> int:
    """How many samples each of its trials has."""
    return 1 + round(usual_plan(arm, chain).duration / chain.sampling.period)


def _simulated(tuning: Tuning, chain: Chain) -> dict[str, Simulation]:
    without, tuned = resolved(
        tuning.trial.simulator(chain=chain),
        tuning.trial.arm,
        lambda each: each.linear(tuning.gain().servo),
        lambda each: tuning.gain().run(each),
    )
    return {WITHOUT: without, "with the tuner": tuned}


def _curves(tuning: Tuning, size: StudySize, key: str, title: str, rule: Rule, guard: GuardKind) -> Curves:
    base = replace(tuning.plan, learning=Learning(rule=rule), guard=guard)
    finished = _studied(tuning, plans_of("curves", base, size.curve_seeds))
    return Curves(key, title, learning_costs(finished, base.trials), tuple(finished))


def _studied(tuning: Tuning, plans: list[Plan]) -> list[Finished]:
    return run_study(tuning.trial.arm, plans, tuning.trial.loop.chain, workers=STUDY_THREADS, tuned=tuning)


def _cost_map(tuning: Tuning, size: StudySize) -> CostMap:
    finished = _studied(tuning, size.map_plans(tuning.plan))
    groups = [finished[i : i + size.map_seeds] for i in range(0, len(finished), size.map_seeds)]
    learnt = [group[0].plan.learning for group in groups]
    pairs = [(each.alpha, float(np.asarray(each.eta))) for each in learnt]
    medians = {pair: final_cost(group, 0.5) for pair, group in zip(pairs, groups, strict=True)}
    alphas, etas = (np.array(sorted({pair[i] for pair in medians})) for i in (0, 1))
    median = np.array([[medians[alpha, eta] for eta in etas] for alpha in alphas])
    return CostMap(alphas, etas, median, map_verdict(groups))
