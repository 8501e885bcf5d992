"""Learning: the paper's momentum update over trials or at every sample, and what came of it.

    dw(t) = -eta_c dE/dw + alpha_c dw(t-1)   (21),      w(t+1) = w(t) + dw(t)   ((22) with its sign mended)

`trial`: E is the cost of a whole slew, its gradient goes back through network, plant and time, and the weights change
after each slew.  `online`: the paper's delta rule at every sample, with the plant's one-step sensitivity.

Plain (21) often dies at K = 0 or runs away.  "The momentum alpha_c is changed dynamically", by what rule the paper does
not say; here `dynamic` cuts the gradient to norm 0.5, and where the cost rises the step is taken back and halved and
the momentum set to zero.  `clipped` only cuts the gradient, `plain` is (21) as it stands.  Online there is no cost to
compare at every sample, and `dynamic` is `clipped`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from tfarm.arm.checks import not_negative, positive, whole
from tfarm.arrays import Real
from tfarm.errors import ParameterError, must_be_known
from tfarm.records import record
from tfarm.tuner import rules
from tfarm.tuner.guard import Guard
from tfarm.tuner.network import Network
from tfarm.tuner.trial import Record, Trial

Mode = Literal["trial", "online"]
Rule = Literal["dynamic", "clipped", "plain"]
Sensitivity = Literal["one-step", "whole"]

RULE_NUMBERS = {"dynamic": rules.BACKTRACKING_RULE, "clipped": rules.CLIPPED_RULE, "plain": rules.PLAIN_RULE}
MOST_TRIALS = 1_000_000  # of a tuning: a bound on what a slip of the hand may ask for
QUARTILES = (0.25, 0.5, 0.75)  # of learning curves over the seeds
NO_GAIN = 1e-3  # of K: a network that gives less all along a trial has driven its gain to nothing


@dataclass(frozen=True, kw_only=True)
@record
class Learning:
    """How to learn: `eta` (one number, or one a weight as `Network.weights` lists them), `alpha`, mode and rule.

    `clip` is the norm that the gradient is cut to; learning stops once the root mean square of x over a trial is below
    `enough` [N m] (the paper's stopping rule; 0 never stops).
    """

    mode: Mode = "trial"
    rule: Rule = "dynamic"
    sensitivity: Sensitivity = "one-step"
    eta: float | Real = 0.8
    alpha: float = 0.6
    clip: float = 0.5
    enough: float = 0.0

    def __post_init__(self) -> None:
        for key, kind in {"mode": Mode, "rule": Rule, "sensitivity": Sensitivity}.items():
            must_be_known(key, getattr(self, key), get_args(kind))
        for rate in np.atleast_1d(np.asarray(self.eta, dtype=float)).ravel():
            if not 0.0 < rate < math.inf:
                remedy = "a learning rate is positive and finite, 0.8 in the paper"
                raise ParameterError(key="eta", value=float(rate), remedy=remedy)
        momentum = not_negative("alpha", self.alpha, "the momentum factor lies in [0, 1)")
        if not momentum < 1.0:
            raise ParameterError(
                key="alpha", value=momentum, remedy="the momentum factor lies in [0, 1): 1 never forgets"
            )
        positive("clip", self.clip, "the norm that a gradient is cut to is positive and finite")
        not_negative("enough", self.enough, "the error to stop at is zero or positive, in N m")

    def rates(self, size: int) -> Real:
        """The learning rate of each of `size` weights."""
        rates = np.asarray(self.eta, dtype=float)
        if rates.shape not in ((), (size,)):
            raise ParameterError(key="eta", value=rates.shape, remedy=f"one learning rate, or one a weight, {size}")
        return np.ascontiguousarray(np.broadcast_to(rates, (size,)), dtype=float).copy()


@dataclass(frozen=True)
class Stopped:
    """A run that diverged: at `sample` of `trial` (both from 0) the root moment passed `bound` [N m]."""

    trial: int
    sample: int
    bound: float

    def __str__(self) -> str:
        return (
            f"diverged in trial {self.trial + 1} at sample {self.sample}: the root moment passed {self.bound:.4g} N m, "
            "at which the arm is folded up"
        )


@dataclass(frozen=True)
@record
class Training:
    """`costs` of the trials as they were run, the network that came out, and a trial with it as it is.

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
        """Whether the gain was driven to nothing."""
        return bool(self.result.K.max(initial=0.0) < NO_GAIN)


@dataclass(frozen=True)
@record
class LearningCurves:
    """Trainings from several seeds: `costs` (seeds, trials) as they were run, inf from where one diverged.

    `final` (seeds,): the cost with what was learnt, inf where it diverged.  `diverged` and `died` count seeds.
    """

    costs: Real
    final: Real
    diverged: int
    died: int

    @classmethod
    def of(cls, trainings: Sequence[Training], trials: int) -> LearningCurves:
        """Those of trainings of up to `trials` trials."""
        costs = np.full((len(trainings), trials), np.inf)
        for row, training in zip(costs, trainings, strict=True):
            row[: training.costs.size] = training.costs
        final = [math.inf if each.stopped is not None else each.result.cost for each in trainings]
        diverged = sum(each.stopped is not None for each in trainings)
        return cls(costs, np.array(final), diverged, sum(each.died for each in trainings))

    def quantile(self, share: float) -> Real:
        """The cost (trials,) that this share of the seeds is below, after each trial; always one of the costs."""
        return np.asarray(np.quantile(self.costs, share, axis=0, method="nearest"))

    def final_quantile(self, share: float) -> float:
        """The same of the final costs."""
        return float(np.quantile(self.final, share, method="nearest"))


def train(trial: Trial, network: Network, guard: Guard, learning: Learning, trials: int) -> Training:
    """Learn for so many trials (1 to 1,000,000), starting with `network`; memory does not grow with them.

    The same inputs give the same bits.  Raises ParameterError for a number of trials or rates that do not fit.
    """
    trials = whole("trials", trials, 1, MOST_TRIALS, f"a whole number of trials from 1 to {MOST_TRIALS}")
    weights, costs = network.weights, np.zeros(trials)
    longest = math.inf if learning.rule == "plain" else float(learning.clip)
    steps = rules.Steps(learning.rates(weights.size), float(learning.alpha), longest, float(learning.enough))
    common = (trial.setting(network, guard.limits), steps, weights, costs, *trial.room(network))
    if learning.mode == "trial":
        made, sample = rules.learn_by_trials(*common, RULE_NUMBERS[learning.rule])
    elif learning.sensitivity == "whole":
        made, sample = rules.learn_by_sensitivities(*common, np.zeros(weights.size))
    else:
        made, sample = rules.learn_by_samples(*common, trial.reply)
    learnt = network.with_weights(weights)
    result = trial.with_network(learnt, guard.limits)
    stopped = Stopped(made - 1, int(sample), trial.numbers.bound) if sample >= 0 else None
    return Training(learnt, guard, costs[:made], result, stopped, sample == rules.ENOUGH)
