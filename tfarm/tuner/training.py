"""Compiled learning rules of the tuner, the paper's momentum update after each trial or at every sample.

    dw(t) = -eta_c dE/dw + alpha_c dw(t-1)   (21),      w(t+1) = w(t) + dw(t)   ((22) with corrected sign)

`trial`: E is the cost of a whole slew, its gradient goes back through network, plant and time, and the weights change
after each slew.  `online`: the paper's delta rule at every sample, with the plant's one-step sensitivity.

Plain (21) often ends at K = 0 or diverges.  "The momentum alpha_c is changed dynamically", without a rule in the paper.
Here `dynamic` clips the gradient to norm 0.5; where the cost rises the step is taken back and halved, and the momentum
set to zero.  `clipped` only clips the gradient, `plain` is (21) itself.  Online there is no cost to compare at every
sample, and `dynamic` is `clipped`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np

from tfarm.arm.checks import check_annotated, not_negative, positive, whole
from tfarm.arrays import Real
from tfarm.errors import must_be_known, require
from tfarm.exact.compiled import compiled, inlined
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.tuner.guard import Guard
from tfarm.tuner.kernel import (
    Network,
    SampleBuffers,
    Setting,
    TrialSignals,
    act,
    backward,
    copy_into,
    forward,
    gain_gradient,
    sample_gradient,
    sense,
    trial_cost,
)
from tfarm.tuner.trial import Record, Trial

# instead of the sample where a trial was stopped: none was, or x was small enough
NEVER = -1
ENOUGH = -2
# rows of the derivatives that `derive` carries, of the signals now
X, U, E, K = range(4)
# rows further are those of the sample before, and as many further again those of the one before that
BEFORE = 4
# of each input of the network
INPUT_ROWS = (U, U + BEFORE, E + BEFORE, E + 2 * BEFORE, X, X + BEFORE, K + BEFORE)


class DescentSettings(NamedTuple):
    """Constants of (21) and (22): learning rate, momentum, largest norm of a gradient (inf: any).

    `enough` is the root mean square of x [N m] over a trial that is small enough to stop.
    """

    rate: float
    momentum: float
    longest: float
    enough: float


@inlined
def _rms(x: Real) -> float:
    """Return the root of the mean square of x."""
    total = 0.0
    for k in range(x.size):
        total += x[k] ** 2
    return sqrt(total / x.size)


@inlined
def _step(weights: Real, change: Real, gradient: Real, steps: DescentSettings, share: float) -> None:
    """Take a step of (21) and (22): dw = -eta g + alpha dw, w = w + dw; eta times `share`, g clipped to `longest`."""
    norm = 0.0
    for i in range(gradient.size):
        norm += gradient[i] ** 2
    norm = sqrt(norm)
    cut = steps.longest / norm if norm > steps.longest else 1.0
    for i in range(weights.size):
        change[i] = -share * steps.rate * cut * gradient[i] + steps.momentum * change[i]
        weights[i] += change[i]


@compiled
def learn_by_trials(
    setting: Setting,
    steps: DescentSettings,
    weights: Real,
    costs: Real,
    run: TrialSignals,
    work: SampleBuffers,
    takes_back: bool,
) -> tuple[int, int]:
    """Learn after each trial: fill `costs`, change `weights`.

    Return the number of trials and the sample at which the last one passed the bound, NEVER or ENOUGH.  If it passed,
    `weights` are those of the last trial that did not.  Where the rule `takes_back`, a trial that costs more than the
    last accepted one is taken back, its step halved and the momentum set to zero; after an accepted one the step grows
    again, up to its full size.
    """
    size = weights.size
    gradient = np.zeros(size)
    change = np.zeros(size)
    kept = weights.copy()
    slope = np.zeros(size)
    best = np.inf
    share = 1.0
    for trial in range(costs.size):
        done = forward(setting, weights, run, work)
        cost = trial_cost(done, setting.numbers, run) if done == run.x.size else np.inf
        costs[trial] = cost
        if takes_back and not cost <= best and best < np.inf:
            share *= 0.5
            copy_into(kept, weights)
            change.fill(0.0)
            _step(weights, change, slope, steps, share)
            continue
        if not isfinite(cost):
            copy_into(kept, weights)
            return trial + 1, done
        if _rms(run.x) < steps.enough:
            return trial + 1, ENOUGH
        backward(setting, weights, run, work, gradient)
        copy_into(weights, kept)
        if takes_back:
            copy_into(gradient, slope)
            # the step is whole again after four good trials
            share = min(1.0, 1.2 * share)
            best = cost
        _step(weights, change, gradient, steps, share)
    if takes_back:
        copy_into(kept, weights)
    return costs.size, NEVER


@inlined
def derive(
    k: int,
    setting: Setting,
    weights: Real,
    run: TrialSignals,
    work: SampleBuffers,
    S: Real,
    spare: Real,
    D: Real,
) -> None:
    """Set derivatives at sample k by every weight, forward: rows of D are those of x, u, e, K now and 1, 2 samples ago.

    S (n, weights) is that of the state, and advances by one sample.
    """
    states, size = S.shape
    model = setting.model
    by_input = work.by_input
    for row in range(D.shape[0] - 1, BEFORE - 1, -1):
        copy_into(D[row - BEFORE], D[row])
    for row in range(BEFORE):
        D[row].fill(0.0)
    for i in range(states):
        for p in range(size):
            D[X, p] += model.moment[i] * S[i, p]
            D[U, p] -= model.servo[i] * S[i, p]
    gain_gradient(weights, run.inputs[k], run.hidden[k], run.slope[k], D[K], by_input)
    for i in range(by_input.size):
        for p in range(size):
            D[K, p] += by_input[i] / setting.scales[i] * D[INPUT_ROWS[i], p]
    for p in range(size):
        D[E, p] = D[U, p] - run.K[k] * D[X, p] - run.x[k] * D[K, p]
    spare.fill(0.0)
    for i in range(states):
        for j in range(states):
            if model.A[i, j] != 0.0:
                for p in range(size):
                    spare[i, p] += model.A[i, j] * S[j, p]
        for p in range(size):
            spare[i, p] += model.B[i] * D[E, p]
    for i in range(states):
        copy_into(spare[i], S[i])


@compiled
def learn_by_samples(
    setting: Setting,
    steps: DescentSettings,
    weights: Real,
    costs: Real,
    run: TrialSignals,
    work: SampleBuffers,
    is_whole: bool,
) -> tuple[int, int]:
    """Learn at every sample, from x by the weights of its torque; return as `learn_by_trials`.

    By the paper's delta rule x follows a torque `lag` samples later.  `is_whole` carries the plant's whole sensitivity
    forward since the trial began: the gradient of a x^2/2 + b e^2/2 now, by weights that are taken for constant
    (Williams and Zipser, 1989).
    """
    n = run.x.size
    size = weights.size
    states = work.state.size
    numbers = setting.numbers
    gradient = np.zeros(size)
    change = np.zeros(size)
    past = np.zeros((numbers.lag, size))
    kept = weights.copy()
    S = np.zeros((states, size))
    room = np.zeros((states, size))
    D = np.zeros((3 * BEFORE, size))
    for trial in range(costs.size):
        copy_into(weights, kept)
        work.state.fill(0.0)
        S.fill(0.0)
        D.fill(0.0)
        for k in range(n):
            if not sense(k, setting, run, work):
                costs[trial] = np.inf
                copy_into(kept, weights)
                return trial + 1, k
            if is_whole:
                act(k, setting, weights, run, work)
                derive(k, setting, weights, run, work, S, room, D)
                for p in range(size):
                    gradient[p] = numbers.a * run.x[k] * D[X, p] + numbers.b * run.e[k] * D[E, p]
                _step(weights, change, gradient, steps, 1.0)
                continue
            # the weights of the torque that x follows now
            made = past[k % numbers.lag]
            if k >= numbers.lag:
                sample_gradient(k - numbers.lag, numbers, run.x[k], run, made, gradient, work.by_input)
                _step(weights, change, gradient, steps, 1.0)
            copy_into(weights, made)
            act(k, setting, weights, run, work)
        costs[trial] = trial_cost(n, numbers, run)
        if _rms(run.x) < steps.enough:
            return trial + 1, ENOUGH
    return costs.size, NEVER


Mode = Literal["trial", "online"]
Rule = Literal["dynamic", "clipped", "plain"]
Sensitivity = Literal["one-step", "whole"]

MOMENTUM = "the momentum factor lies in [0, 1)"


@frozen(kw_only=True)
class Learning:
    """Options of learning: `eta` and `alpha` of (21), mode and rule.

    `clip` is the largest norm of the gradient; learning stops once the root mean square of x over a trial is below
    `enough` [N m] (the paper's stopping rule; 0 never stops).
    """

    mode: Mode = "trial"
    rule: Rule = "dynamic"
    sensitivity: Sensitivity = "one-step"
    eta: Annotated[float, positive, "a learning rate is positive and finite, 0.8 in the paper"] = 0.8
    alpha: Annotated[float, not_negative, MOMENTUM] = 0.6
    clip: Annotated[float, positive, "the largest norm of a gradient is positive and finite"] = 0.5
    enough: Annotated[float, not_negative, "the error to stop at is zero or positive, in N m"] = 0.0

    def __post_init__(self) -> None:
        for key, kind in {"mode": Mode, "rule": Rule, "sensitivity": Sensitivity}.items():
            must_be_known(key, getattr(self, key), get_args(kind))
        check_annotated(self, "")
        require(self.alpha < 1.0, "alpha", self.alpha, MOMENTUM)


@dataclass(frozen=True)
class Stopped:
    """A run that diverged: at `sample` of `trial` (both from 0) the root moment passed `bound` [N m]."""

    trial: int
    sample: int
    bound: float

    def __str__(self) -> str:
        where = f"trial {self.trial + 1} at sample {self.sample}"
        return (
            f"diverged in {where}: the root moment passed {self.bound:.4g} N m, the end of small deflections"
        )


@frozen
class Training:
    """`costs` of the trials in their order, the trained network, and the `result` of a trial with it.

    Where learning diverged the last cost is inf and the network is that of the last trial that did not.
    """

    network: Network
    guard: Guard
    costs: Real
    result: Record
    stopped: Stopped | None
    reached: bool

    @property
    def died(self) -> bool:
        """Whether the gain went to zero."""
        return bool(self.result.K.max(initial=0.0) < 1e-3)


@frozen
class LearningCurves:
    """Trainings from several seeds: `costs` (seeds, trials) in their order, inf from a divergence on.

    `final` (seeds,): the cost with the trained network, inf where it diverged.  `diverged` and `died` count seeds.
    """

    costs: Real
    final: Annotated[
        Real,
        Quantity(key="final_cost", help="cost with the trained network of each seed; infinite if diverged"),
    ]
    diverged: Annotated[
        int, Quantity("seeds diverged", key="diverged", help="trainings with an unstable trial")
    ]
    died: Annotated[
        int, Quantity("seeds died at K = 0", key="died", help="trainings whose gain went to zero")
    ]

    @property
    def seeds(self) -> Annotated[int, Quantity("seeds", help="trainings from different initial weights")]:
        """Number of seeds."""
        return int(self.final.size)

    @property
    def final_quartiles(
        self,
    ) -> Annotated[
        list[float],
        Quantity("final cost, quartiles and median", digits=4, help="over the seeds: 25 %, 50 % and 75 %"),
    ]:
        """Lower quartile, median and upper quartile of the final costs; always some of the costs."""
        return quartiles(self.final).tolist()

    @property
    def quartile_curves(
        self,
    ) -> Annotated[
        dict[str, Real], Quantity(flat=True, help="cost after each trial: 25 %, 50 % and 75 % over the seeds")
    ]:
        """The same of the cost after each trial (trials,)."""
        names = ("lower_quartile", "median", "upper_quartile")
        return dict(zip(names, quartiles(self.costs), strict=True))


def quartiles(costs: Real) -> Real:
    """Return lower quartile, median and upper quartile over the seeds (seeds, ...); always some of the costs."""
    found: Real = np.quantile(costs, (0.25, 0.5, 0.75), axis=0, method="nearest")
    return found


def train(trial: Trial, network: Network, guard: Guard, learning: Learning, trials: int) -> Training:
    """Learn for a number of trials (1 to 1,000,000), starting with `network`; memory does not grow with them.

    The same inputs give the same bits.  Raises ParameterError for an invalid number of trials or rates.
    """
    trials = whole("trials", trials, 1, 1_000_000, "a whole number of trials from 1 to 1000000")
    weights = network.weights
    costs = np.zeros(trials)
    longest = math.inf if learning.rule == "plain" else learning.clip
    steps = DescentSettings(learning.eta, learning.alpha, longest, learning.enough)
    common = (trial.setting(network, guard.limits), steps, weights, costs, *trial.room(network))
    if learning.mode == "trial":
        made, sample = learn_by_trials(*common, learning.rule == "dynamic")
    else:
        made, sample = learn_by_samples(*common, learning.sensitivity == "whole")
    learnt = network.with_weights(weights)
    stopped = Stopped(made - 1, int(sample), trial.numbers.bound) if sample >= 0 else None
    return Training(
        learnt, guard, costs[:made], trial.with_network(learnt, guard.limits), stopped, sample == ENOUGH
    )
