"""The bound that no controller passes: the finite-horizon linear-quadratic optimum, full state and preview of the slew.

    minimise T sum of a x_k^2/2 + b e_k^2/2,   s_{k+1} = A s_k + B (e_k + r_k),   x_k = c s_k - m_k,   s_0 = 0

with r (feedforward not counted in u) and m (the rigid arm's moment) known beforehand.  The value of the remaining
samples is s^T P s/2 + q^T s + a constant, and e_k = -(B^T P (A s + B r) + B^T q)/(T b + B^T P B).  It bounds
every e(t), for this arm, slew, sampling and cost, whatever network, gain or law makes it.
"""

from __future__ import annotations

import numpy as np

from tfarm.tuner.trial import Record, Trial


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
