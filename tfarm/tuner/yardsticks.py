"""What a tuner that moves the gain has to beat, the best constant gain, and the bound that no controller passes.

The bound is the finite-horizon linear-quadratic optimum, with the full state and preview of the slew:

    minimise T sum of a x_k^2/2 + b e_k^2/2,   s_{k+1} = A s_k + B (e_k + r_k),   x_k = c s_k - m_k,   s_0 = 0

with r (feedforward not counted in u) and m (the rigid arm's moment) known beforehand.  The value of the remaining
samples is s^T P s/2 + q^T s + a constant, and e_k = -(B^T P (A s + B r) + B^T q)/(T b + B^T P B).  It bounds
every e(t), for this arm, slew, sampling and cost, whatever network, gain or law makes it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from tfarm.tuner.guard import constant_windows
from tfarm.tuner.trial import Record, Trial

CONSTANT_GAINS = 200  # constant gains of a window that are tried, before the best are refined
BEST_REFINED = 3  # of them
GAIN_XTOL = 1e-9  # to so much they are refined: a cost is flat there, so that the last digits say nothing


class BestConstant(NamedTuple):
    """The gain, and the trial's cost with it."""

    gain: float
    cost: float


def best_constant(trial: Trial) -> BestConstant:
    """The best constant gain K >= 0 among those that leave the loop stable: all of a grid, the three lowest refined.

    Where no constant gain is stable, K = 0.
    """
    windows = constant_windows(trial.loop)
    found = [BestConstant(0.0, trial.with_constant(0.0).cost)] if not windows or windows[0][0] == 0.0 else []
    for low, high in windows:
        gains = np.linspace(low, high, CONSTANT_GAINS + 2)[1:-1]
        costs = np.array([trial.with_constant(float(K)).cost for K in gains])
        step = (high - low) / (CONSTANT_GAINS + 1)
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
    A, B, c = trial.model.A, trial.model.B, trial.model.moment
    rest, rigid = trial.reference.rest, trial.reference.rigid
    a, b, T = trial.numbers.a, trial.numbers.b, trial.numbers.T
    n, size = trial.n, B.size
    gains, offsets = np.zeros((n, size)), np.zeros(n)
    P, q = np.zeros((size, size)), np.zeros(size)
    for k in range(n - 1, -1, -1):
        PB, pull = P @ B, q + P @ B * rest[k]
        weight = T * b + B @ PB
        if weight > 0:
            gains[k], offsets[k] = (A.T @ PB) / weight, (B @ pull) / weight
        closed = A - np.outer(B, gains[k])
        q = closed.T @ (q + P @ B * (rest[k] - offsets[k])) + T * b * gains[k] * offsets[k] - T * a * rigid[k] * c
        P = closed.T @ P @ closed + T * b * np.outer(gains[k], gains[k]) + T * a * np.outer(c, c)
        P = (P + P.T) / 2
    s, x, e = np.zeros(size), np.zeros(n), np.zeros(n)
    for k in range(n):  # the optimal e applied forward
        x[k] = c @ s - rigid[k]
        e[k] = -(gains[k] @ s) - offsets[k]
        s = A @ s + B * (e[k] + rest[k])
    cost = float(T * np.sum(trial.cost.a * x**2 + trial.cost.b * e**2) / 2)
    return Record(trial.task.t, x, e, e, np.zeros(n), cost, None)
