"""Tuning in one call: the guard, the training and the baselines, as records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import MOMENT_GAIN, Arm, HubFeedback, must_be_arm
from tfarm.arm.chain import MomentReading
from tfarm.arm.checks import check_annotated, positive
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.dsp import Chain, scenario
from tfarm.dsp.results import Run, simulate_modes
from tfarm.dsp.scenarios import TRIAL_DURATION, TRIAL_SLEWS, describe_scenario, torque_unit
from tfarm.dsp.simulation import RESIDUAL
from tfarm.errors import require
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.gains import default_gains
from tfarm.tuner.baselines import SHAPERS, BestConstant, Outcomes, best_constant, lq_bound, shaped_trial
from tfarm.tuner.guard import Guard, GuardKind, find_guard
from tfarm.tuner.kernel import PAPER_HIDDEN, PAPER_INPUTS, Network, initial_network
from tfarm.tuner.training import Learning, LearningCurves, Training, train
from tfarm.tuner.trial import (
    TRIAL_MODES,
    Cost,
    Record,
    SavedTuner,
    Trial,
    TunedGain,
    slew_trial,
    tip_off,
    with_signals,
)

NUMBERS: dict[str, Callable[[float], float]] = {  # of a plan, by which studies may vary it
    "trials": int,
    "seed": int,
    "K1": float,
    "Kp": float,
    "duration": float,
    "hidden": int,
    "scale": float,
}
NUMBERS_OF_LEARNING = ("eta", "alpha", "clip", "enough")


@frozen(kw_only=True)
class Plan:
    """Plan of a tuning, with the paper's figures by default.

    `K1` [N m s/rad] and `Kp` [N m/rad] of the servo, 0 in the paper, `duration` of a trial [s], flexible modes `count`,
    `hidden` neurons; `seventh_input` adds K(t-1), the gain that the paper names among its inputs; `scale` [N m] is the
    unit of moments and torques, of the other six inputs and in the cost.
    """

    cost: Cost = field(default_factory=Cost)
    learning: Learning = field(default_factory=Learning)
    signals: MomentReading = "vibration"
    guard: GuardKind = "time-varying"
    trials: int = 100
    seed: int = 0
    K1: float = 0.3
    Kp: float = 0.0
    duration: float = TRIAL_DURATION
    count: int = TRIAL_MODES
    hidden: int = PAPER_HIDDEN
    seventh_input: bool = False
    scale: Annotated[float, positive, "a scale is a positive, finite number of N m"] = 1.0

    def __post_init__(self) -> None:
        check_annotated(self, "")

    def trial(self, arm: Arm, chain: Chain | None) -> Trial:
        """Return the trial on an arm, with the weights of the cost on moments and torques in units of the scale."""
        return slew_trial(
            arm,
            chain,
            K1=self.K1,
            Kp=self.Kp,
            signals=self.signals,
            duration=self.duration,
            count=self.count,
            cost=Cost(a=self.cost.a / self.scale**2, b=self.cost.b / self.scale**2),
        )

    def network(self, seed: int) -> Network:
        """Return the network with the first weights of a seed."""
        return initial_network(
            seed,
            hidden=self.hidden,
            scales=np.r_[np.full(PAPER_INPUTS, self.scale), np.ones(int(self.seventh_input))],
        )


@frozen
class Tuning:
    """A trained tuner and its baselines, all of one trial.

    `shaped`: costs of the slew through the ZV and the EI shaper without moment feedback.  It arrives later, and its x
    and e are from its own reference, so that the bound of the unshaped slew is no bound of it.
    """

    trial: Trial
    plan: Plan
    training: Training
    without: Record
    best_constant: BestConstant
    bound: Record
    shaped: dict[str, Baseline]

    @property
    def finding(self) -> str:
        """Costs of the tuned slew, of the best constant gain, and without moment feedback."""
        costs = self.training.result.cost, self.best_constant.cost, self.without.cost
        return "cost {:.6g}; {:.6g} with the best constant gain, {:.6g} without".format(*costs)

    def saved(self) -> SavedTuner:
        """Return the record that `save_tuner` writes."""
        guard = self.training.guard
        plan = self.plan
        network = self.training.network
        return SavedTuner(
            format="tfarm tuner 1",
            arm=self.trial.arm.name,
            period=self.trial.task.period,
            K1=plan.K1,
            Kp=plan.Kp,
            signals=plan.signals,
            a=plan.cost.a,
            b=plan.cost.b,
            guard_kind=guard.kind,
            guard=None if guard.kind == "none" else (guard.lo, guard.hi),
            scales=network.scales.tolist(),
            W1=network.W1.tolist(),
            w2=network.w2.tolist(),
        )

    def gain(self) -> TunedGain:
        """Return the trained controller."""
        return self.saved().gain()

    @property
    def constant(self) -> HubFeedback:
        """The law with the best constant gain."""
        return self.trial.loop.gains.with_number(MOMENT_GAIN, self.best_constant.gain)


def usual_plan(arm: Arm, chain: Chain | None = None) -> Plan:
    """Return the paper's figures at the arm's default rate gain, in its unit of torque, for three times its slew."""
    gains = default_gains(arm)
    chain = Case(arm, gains, chain).chain
    return Plan(
        K1=gains.K1,
        signals=chain.slew.reading,
        duration=TRIAL_SLEWS * chain.slew.rise_time,
        scale=torque_unit(arm, chain),
    )


def tune(arm: Arm, plan: Plan | None = None, chain: Chain | None = None) -> Tuning:
    """Find the guard, train, and compute the baselines.

    Raises ParameterError for an invalid plan, arm or chain, and CertificationError where there is no guard.
    """
    require(
        isinstance(plan, Plan | None),
        "plan",
        plan,
        "give a tfarm.tuner.Plan, such as Plan(trials=50, K1=0.3)",
    )
    must_be_arm(arm)
    plan = usual_plan(arm, chain) if plan is None else plan
    network = plan.network(plan.seed)
    trial, guard, baselines = _baselines(arm, chain, replace(plan, learning=Learning(), trials=1, seed=0))
    return Tuning(
        trial=trial, plan=plan, training=train(trial, network, guard, plan.learning, plan.trials), **baselines
    )


@lru_cache(maxsize=1)
def _baselines(arm: Arm, chain: Chain | None, plan: Plan) -> tuple[Trial, Guard, dict[str, Any]]:
    """Return trial, guard and baselines of a plan: the same for each learning, seed and number of trials."""
    trial = plan.trial(arm, chain)
    best = best_constant(trial)
    shaped = dict[str, Baseline]()
    for kind in SHAPERS:
        late = shaped_trial(trial, kind)
        delay = late.task.busy_until - trial.task.busy_until
        shaped[kind] = Baseline(f"input shaping, {kind}", late.with_constant(0.0).cost, delay)
    return (
        trial,
        find_guard(trial.loop, plan.guard, best.gain),
        {
            "without": trial.with_constant(0.0),
            "best_constant": best,
            "bound": lq_bound(trial),
            "shaped": shaped,
        },
    )


def tune_by_default(arm: Arm, chain: Chain, plan: Plan | None = None, **numbers: float) -> Tuning:
    """Tune with a plan, the usual one by default, and other values of some of its numbers: seed, eta, alpha ..."""
    plan = usual_plan(arm, chain) if plan is None else plan
    learning: dict[str, Any] = {name: value for name, value in numbers.items() if name in NUMBERS_OF_LEARNING}
    own: dict[str, Any] = {name: NUMBERS[name](value) for name, value in numbers.items() if name in NUMBERS}
    return tune(arm, replace(plan, learning=replace(plan.learning, **learning), **own), chain)


class Baseline(NamedTuple):
    """The cost of a slew with a baseline."""

    name: Annotated[str, Quantity("controller", help="tuner or baseline")]
    cost: Annotated[
        float, Quantity("cost of a slew", digits=4, help="T sum of (a x^2 + b e^2)/2 over its samples")
    ]
    later: Annotated[float | None, Quantity("arrives later", "s", 3, "delay of the shaped slew")] = None


class SlewEnd(NamedTuple):
    """End of the slew through the converters: with the tuner, with the best constant gain, without moment feedback."""

    residual: Annotated[
        float | None,
        Quantity(
            RESIDUAL, "N m rms", key="residual_moment_rms", help="after the slew, less that of a rigid arm"
        ),
    ]
    residual_raw: Annotated[
        float | None,
        Quantity(key="residual_raw_moment_rms", help="rms of the root moment after the slew [N m]"),
    ]
    residual_without: Annotated[
        float | None, Quantity("without moment feedback", "N m rms", help="its residual")
    ]
    tip_error: Annotated[float | None, Quantity("tip error at the end", "m", 3, "distance from the target")]
    tip_error_constant: Annotated[
        float | None,
        Quantity("with the best constant gain", "m", 3, "its tip error", key="tip_error_best_constant_m"),
    ]
    tip_error_without: Annotated[
        float | None, Quantity("and without moment feedback", "m", 3, "its tip error")
    ]

    @classmethod
    def of(cls, tuning: Tuning) -> SlewEnd:
        """Return the end of the trial of a tuning."""
        simulator = tuning.trial.simulator()
        gain = tuning.gain()
        runs = gain.run(simulator), simulator.linear(tuning.constant), simulator.linear(gain.servo)
        residuals = runs[0].residual_moment, runs[0].residual_raw, runs[-1].residual_moment
        return cls(*residuals, *(tip_off(run, tuning.trial) for run in runs))


@dataclass(frozen=True)
class TuningResult:
    """A tuning with its figures, and optionally its learning curves and a comparison."""

    tuning: Tuning
    curves: Annotated[
        LearningCurves | None, Quantity("learning curves", help="cost after each trial over several seeds")
    ] = None
    comparison: Annotated[
        list[Outcomes] | None,
        Quantity(
            "compared in other conditions",
            help="the same controllers with converters, delay and on other arms",
        ),
    ] = None

    @property
    def arm(self) -> Annotated[str, Quantity("arm", help="name of the arm")]:
        """The name of the arm."""
        return self.tuning.trial.arm.name

    @property
    def plan(
        self,
    ) -> Annotated[dict[str, Any], Quantity("plan", flat=True, help="options of learning, servo and cost")]:
        """Mode, rule, constants and seed of the learning, gains of the servo, and weights of the cost."""
        plan = self.tuning.plan
        found = {name: getattr(plan.learning, name) for name in ("mode", "rule", "sensitivity")}
        found |= {name: getattr(plan, name) for name in ("signals", "seed", "K1", "Kp")}
        return found | {"a": plan.cost.a, "b": plan.cost.b, "cost_unit_N_m": plan.scale}

    @property
    def trials(self) -> Annotated[int, Quantity("trials", help="slews of the training")]:
        """Number of trials."""
        return int(self.tuning.training.costs.size)

    @property
    def costs(self) -> Annotated[Real, Quantity("cost", curve=True, key="cost", help="cost of each trial")]:
        """The cost of each trial."""
        return self.tuning.training.costs

    @property
    def baselines(
        self,
    ) -> Annotated[list[Baseline], Quantity("compared with baselines", help="costs of the same slew")]:
        """The costs with the tuner and with the baselines."""
        tuning = self.tuning
        best = tuning.best_constant
        is_plain = tuning.trial.loop.chain.reference.shaper == "none"
        return [
            Baseline("no moment feedback", tuning.without.cost),
            Baseline(f"best constant gain, K = {best.gain:.4g}", best.cost),
            Baseline(f"tuner, after {self.trials} trials", tuning.training.result.cost),
            *tuning.shaped.values(),
            Baseline(f"linear-quadratic bound of the {'unshaped ' * is_plain}slew", tuning.bound.cost),
        ]

    @property
    def numbers(self) -> Annotated[dict[str, Any], Quantity(flat=True, help="costs of tuner and baselines")]:
        """The same numbers by name."""
        tuning = self.tuning
        shaped = tuning.shaped
        bound = "the least cost of any control signal e on this slew, with full state and preview"
        if tuning.plan.signals == "total":
            bound = "the least cost of any torque: under this reading it is that of an arm at rest"
        return {
            "cost_tuned": tuning.training.result.cost,
            "cost_without": tuning.without.cost,
            "cost_best_constant": tuning.best_constant.cost,
            "best_constant_gain": tuning.best_constant.gain,
            "cost_lq_bound": tuning.bound.cost,
            "lq_bound_note": bound,
            "cost_shaped": min(each.cost for each in shaped.values()),
            "shaped": {
                kind: {"cost": each.cost, "arrives_later_by_s": each.later} for kind, each in shaped.items()
            },
            "shaped_note": "no moment feedback; cost of the shaped slew, which arrives later: cost_lq_bound is no "
            "bound of it",
        }

    @property
    def gain(
        self,
    ) -> Annotated[dict[str, Real], Quantity(help="moment gain K at the times t of the tuned slew")]:
        """The moment gain over time, tuned."""
        slew = self.tuning.training.result
        return {"t": slew.t, "K": slew.K}

    @property
    def gain_range(
        self,
    ) -> Annotated[
        tuple[float, float], Quantity("moment gain", digits=4, help="least and largest during the tuned slew")
    ]:
        """The least and the largest moment gain."""
        K = self.tuning.training.result.K
        return float(K.min()), float(K.max())

    @cached_property
    def end(
        self,
    ) -> Annotated[SlewEnd, Quantity(flat=True, help="residual moment and tip error of the slew")]:
        """The end of the slew, tuned and not."""
        return SlewEnd.of(self.tuning)

    @property
    def guard(
        self,
    ) -> Annotated[Guard, Quantity("guard of the gain", help="interval that the gain cannot leave")]:
        """The interval of the tuner's gain, and its certificate."""
        return self.tuning.training.guard

    @property
    def reached(
        self,
    ) -> Annotated[
        bool, Quantity(key="reached_preset_error", help="whether training ended at the rms error asked for")
    ]:
        """Whether the preset error was reached."""
        return self.tuning.training.reached

    @property
    def stopped(
        self,
    ) -> Annotated[str | None, Quantity("stopped", help="trial and sample where training diverged")]:
        """The reason of an early end of the training."""
        stopped = self.tuning.training.stopped
        return None if stopped is None else str(stopped)

    @property
    def weights(
        self,
    ) -> Annotated[dict[str, Any], Quantity(help="weights of the network and scales of its inputs")]:
        """Every weight of the network."""
        return self.tuning.saved().model_dump(include={"scales", "W1", "w2"})


def simulate_tuner(
    arm: Arm,
    saved: SavedTuner,
    chain: Chain,
    name: str,
    duration: float,
    *,
    count: int | None,
    between: int,
    outputs: Sequence[str] = (),
) -> Run:
    """Simulate a scenario with a saved tuner as the gain.

    Its guard is certified for the loop of its training, not for another arm or chain.
    """
    chain = with_signals(chain, saved.signals)
    gain = saved.gain()
    case = Case(arm, gain.servo, chain)
    task = scenario(name, arm, chain, duration, gain.servo)
    run, used = simulate_modes(case, task, count, between, outputs, gain.run)
    trained = {
        "trained_on": saved.arm,
        "guard_kind": saved.guard_kind,
        "guard": list(gain.guard),
        "K1": saved.K1,
        "Kp": saved.Kp,
        "signals": saved.signals,
        "period_s": saved.period,
        "a": saved.a,
        "b": saved.b,
        "cost_unit_N_m": saved.scales[0],
    }
    return Run(case, run, used, describe_scenario(task, arm, chain), tuner=trained)
