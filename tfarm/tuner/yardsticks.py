"""What a tuner that moves the gain has to beat, the best constant gain, and the bound that no controller passes.

The bound is the finite-horizon linear-quadratic optimum, with the full state and preview of the slew:

    minimise T sum of a x_k^2/2 + b e_k^2/2,   s_{k+1} = A s_k + B (e_k + r_k),   x_k = c s_k - m_k,   s_0 = 0

with r (feedforward not counted in u) and m (what is taken off the moment) known beforehand.  The value of the remaining
samples is s^T P s/2 + q^T s + a constant, and e_k = -(B^T P (A s + B r) + B^T q)/(T b + B^T P B).  It bounds
every e(t), for this arm, slew, sampling and cost, whatever network, gain or law makes it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from tfarm.tuner import kernel
from tfarm.tuner.guard import constant_windows
from tfarm.tuner.trial import Record, Trial

CONSTANT_GAINS = 200  # constant gains of a window that are tried, before the best are refined
LEAST_GAINS = 20  # of them where trials are long
GAIN_SAMPLES = 2_000_000  # that the trials of a window's gains may have together
BEST_REFINED = 3  # of them
GAIN_XTOL = 1e-9  # to so much they are refined: a cost is flat there, so that the last digits say nothing


class BestConstant(NamedTuple):
    """The gain, and the trial's cost with it."""

    gain: float
    cost: float


def tried_gains(samples: int) -> int:
    """How many constant gains of a window are tried in trials of so many samples."""
    return min(CONSTANT_GAINS, max(LEAST_GAINS, GAIN_SAMPLES // samples))


def best_constant(trial: Trial) -> BestConstant:
    """The best constant gain K >= 0 among those that leave the loop stable: all of a grid, the three lowest refined.

    Where no constant gain is stable, K = 0.
    """
    windows = constant_windows(trial.loop)
    number = tried_gains(trial.n)
    found = [BestConstant(0.0, trial.with_constant(0.0).cost)] if not windows or windows[0][0] == 0.0 else []
    for low, high in windows:
        gains = np.linspace(low, high, number + 2)[1:-1]
        costs = np.array([trial.with_constant(float(K)).cost for K in gains])
        step = (high - low) / (number + 1)
        for i in np.argsort(costs)[:BEST_REFINED]:
            done = minimize_scalar(
                lambda K: trial.with_constant(float(K)).cost,
                bounds=(max(float(gains[i]) - step, low), min(float(gains[i]) + step, high)),
                method="bounded",
                options={"xatol": GAIN_XTOL},
            )
            found.append(BestConstant(float(done.x), float(done.fun)))
    return min(found, key=lambda each: each.cost)


def lq_bound(trial: Trial) -> Record:
    """The optimal trial; its K is zero, for it is no moment feedback, and its u is e."""
    rest, rigid = trial.reference.rest, trial.reference.rigid
    gains, (offsets, x, e, moment) = np.zeros((trial.n, trial.model.B.size)), np.zeros((4, trial.n))
    kernel.optimal(trial.model, rest, rigid, trial.numbers, gains, offsets)
    kernel.controlled(trial.model, rest, rigid, gains, offsets, x, e, moment)
    cost = float(trial.numbers.T * np.sum(trial.cost.a * x**2 + trial.cost.b * e**2) / 2)
    return Record(trial.task.t, x, e, e, np.zeros(trial.n), moment, cost, None)
