"""The neural tuner: training over whole trials, compiled."""

from __future__ import annotations

import numpy as np

import tfarm
from tests.tuner.plain import PlainTrial, complex_step, gradient_of
from tfarm.tuner import Guard, Learning, Network, Trial, initial_network, slew_trial, train

from .rows import Row, Target
from .timing import once

GROUP = "Neural tuner: trials of 3 s, 301 samples, 6 modes, with the exact gradient of each trial"
TRIALS = 200
LIMIT = 2.0  # seconds for so many, on one core
ROUNDS = 5
NOTE = "largest error: of the gradient, against complex steps through a second implementation, relative to its largest."


def tuner_row() -> Row:
    """Seconds a trial, and the error of its gradient."""
    trial = slew_trial(tfarm.load("sasaki2012-lab"))
    guard, network = Guard("frozen", 0.0, 1.1, 6, False), initial_network(0)
    learning, rounds = Learning(rule="plain"), []
    train(trial, network, guard, learning, 2)
    for _ in range(ROUNDS):
        with once() as watch:
            train(trial, network, guard, learning, TRIALS)
        rounds.append(watch.seconds / TRIALS)
    seconds = float(np.median(rounds))
    return Row(
        group=GROUP, what="tfarm: sasaki2012-lab, 6-6-1 network, one core", n=TRIALS, each="trial", seconds=seconds,
        error=_gradient_error(trial, network, guard), note=NOTE,
        target=Target(measured=TRIALS * seconds, limit=LIMIT, unit=f"s for {TRIALS} trials"),
    )  # fmt: skip


def _gradient_error(trial: Trial, network: Network, guard: Guard) -> float:
    plain = PlainTrial(trial.arm)
    right = complex_step(lambda w: plain.cost(w, 6, network.scales, guard.limits), network.weights)
    return float(abs(gradient_of(trial, network, guard.limits)[1] - right).max() / abs(right).max())
