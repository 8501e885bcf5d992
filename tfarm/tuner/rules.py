"""The compiled learning rules of the tuner: after each trial, or at every sample.

Arrays as in `kernel`; `rates` and `change` are those of (21) and (22), a number a weight.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Any

import numpy as np

from tfarm.exact.compiled import compiled

from .kernel import (
    ADVANCE_ROWS,
    DRIVE_ROW,
    GAIN_USED,
    LAG,
    MOMENT_ROW,
    MOMENT_WEIGHT,
    PERIOD,
    SERVO_ROW,
    SLOPE,
    TORQUE_WEIGHT,
    E,
    U,
    X,
    act,
    backward,
    copied,
    forward,
    gain_gradient,
    sample_gradient,
    sense,
    trial_cost,
)

PLAIN_RULE, CLIPPED_RULE, BACKTRACKING_RULE = range(3)  # as compiled code tells them
INPUT_ROWS = (1, 5, 6, 10, 0, 4, 7)  # of each input in the rows of `_derive`: x, u, e, K now, before, and before that
SHARE_FALLS, SHARE_GROWS = 0.5, 1.2  # times: a step of learning halves at once, and is whole after four good trials


@compiled
def _rms(done: int, signals: Any) -> float:
    total = 0.0
    for k in range(done):
        total += signals[k, X] ** 2
    return sqrt(total / max(done, 1))


@compiled
def _step(weights: Any, change: Any, gradient: Any, rates: Any, momentum: float, share: float, longest: float) -> None:
    """(21) and (22) with the sign mended: dw = -eta g + alpha dw, w = w + dw; g cut to norm `longest` (inf: never)."""
    norm = 0.0
    for i in range(gradient.size):
        norm += gradient[i] ** 2
    norm = sqrt(norm)
    cut = longest / norm if norm > longest else 1.0
    for i in range(weights.size):
        change[i] = -share * rates[i] * cut * gradient[i] + momentum * change[i]
        weights[i] += change[i]


@compiled
def learn_by_trials(
    model: Any, reference: Any, numbers: Any, scales: Any, guard: Any, weights: Any, rates: Any, momentum: float,
    rule: int, longest: float, enough: float, costs: Any, run: Any, work: Any,
) -> tuple[int, int]:  # fmt: skip
    """Learning after each trial; fills `costs`, changes `weights`.

    Returns how many trials were made and the sample at which the last one passed the bound (-1: none did); `weights`
    are then those of the last trial that did not.  Under BACKTRACKING_RULE a trial that costs more than the last
    accepted one is taken back, its step shortened and the momentum set to zero; an accepted one lets the step grow
    again, up to its full size.
    """
    n, size = reference.shape[0], weights.size
    gradient, change, kept, slope = np.zeros(size), np.zeros(size), weights.copy(), np.zeros(size)
    best, share = np.inf, 1.0
    for trial in range(costs.size):
        done = forward(model, reference, numbers, scales, guard, weights, run, work)
        cost = trial_cost(done, numbers, run[2]) if done == n else np.inf
        costs[trial] = cost
        if rule == BACKTRACKING_RULE and not cost <= best and best < np.inf:
            share *= SHARE_FALLS
            copied(kept, weights)
            change.fill(0.0)
            _step(weights, change, slope, rates, momentum, share, longest)
            continue
        if done < n or not isfinite(cost):
            copied(kept, weights)
            return trial + 1, done
        if _rms(done, run[2]) < enough:
            return trial + 1, -1
        backward(model, numbers, scales, weights, run, work, gradient)
        copied(weights, kept)
        if rule == BACKTRACKING_RULE:
            copied(gradient, slope)
            share = min(1.0, SHARE_GROWS * share) if best < np.inf else 1.0
            best = cost
        _step(weights, change, gradient, rates, momentum, share, longest)
    if rule == BACKTRACKING_RULE:
        copied(kept, weights)
    return costs.size, -1


@compiled
def learn_by_samples(
    model: Any, reference: Any, numbers: Any, scales: Any, guard: Any, weights: Any, rates: Any, momentum: float,
    reply: float, longest: float, enough: float, costs: Any, run: Any, work: Any,
) -> tuple[int, int]:  # fmt: skip
    """Learning at every sample (the paper's delta rule): as x arrives, the weights that it answers to are corrected.

    A torque is answered `numbers[LAG]` samples later.  `reply` is the derivative of that x by the torque.
    """
    n, size, lag = reference.shape[0], weights.size, int(numbers[LAG])
    gradient, change, past = np.zeros(size), np.zeros(size), np.zeros((lag, size))
    state, spare = work[0], work[1]
    kept = weights.copy()
    for trial in range(costs.size):
        state.fill(0.0)
        copied(weights, kept)
        for k in range(n):
            if not sense(k, model, reference, numbers, scales, state, run):
                costs[trial] = np.inf
                copied(kept, weights)
                return trial + 1, k
            if k >= lag:
                sample_gradient(k - lag, numbers, reply, run[2][k, X], run, past[k % lag], gradient)
                _step(weights, change, gradient, rates, momentum, 1.0, longest)
            copied(weights, past[k % lag])
            act(k, model, reference, weights, guard, state, spare, run)
        costs[trial] = trial_cost(n, numbers, run[2])
        if _rms(n, run[2]) < enough:
            return trial + 1, -1
    return costs.size, -1


@compiled
def _derive(k: int, model: Any, scales: Any, weights: Any, run: Any, S: Any, spare: Any, D: Any) -> None:
    """Derivatives at sample k by every weight, forward: rows of D are those of x, u, e, K now and one, two samples ago.

    S (n, weights) is the state's; it is taken one sample on.
    """
    inputs, hidden, signals = run
    m, h = inputs.shape[1], hidden.shape[1]
    for row in range(11, 3, -1):
        copied(D[row - 4], D[row])
    for row in range(4):
        D[row].fill(0.0)
    for i in range(S.shape[0]):
        for p in range(S.shape[1]):
            D[X, p] += model[MOMENT_ROW][i] * S[i, p]
            D[U, p] -= model[SERVO_ROW][i] * S[i, p]
    gain_gradient(weights, inputs[k], hidden[k], signals[k, SLOPE], D[GAIN_USED])
    for i in range(m):
        by_input = 0.0
        for j in range(h):
            by_input += weights[h * m + j] * hidden[k, j] * (1.0 - hidden[k, j]) * weights[j * m + i]
        share = signals[k, SLOPE] * by_input / scales[i]
        for p in range(S.shape[1]):
            D[GAIN_USED, p] += share * D[INPUT_ROWS[i], p]
    for p in range(S.shape[1]):
        D[E, p] = D[U, p] - signals[k, GAIN_USED] * D[X, p] - signals[k, X] * D[GAIN_USED, p]
    spare.fill(0.0)
    for i in range(S.shape[0]):
        for j in range(S.shape[0]):
            if model[ADVANCE_ROWS][i, j] != 0.0:
                for p in range(S.shape[1]):
                    spare[i, p] += model[ADVANCE_ROWS][i, j] * S[j, p]
        for p in range(S.shape[1]):
            spare[i, p] += model[DRIVE_ROW][i] * D[E, p]
    for i in range(S.shape[0]):
        copied(spare[i], S[i])


@compiled
def learn_by_sensitivities(
    model: Any, reference: Any, numbers: Any, scales: Any, guard: Any, weights: Any, rates: Any, momentum: float,
    longest: float, enough: float, costs: Any, run: Any, work: Any, total: Any,
) -> tuple[int, int]:  # fmt: skip
    """Learning at every sample with the whole sensitivity of the plant, carried forward since the trial began.

    The gradient of a x^2/2 + b e^2/2 now, by weights taken for constant all the trial (Williams and Zipser, 1989).
    `total` collects T times the gradients of a trial: with rates of zero that is the gradient of its cost.
    """
    n, size, states = reference.shape[0], weights.size, model[DRIVE_ROW].size
    gradient, change, kept = np.zeros(size), np.zeros(size), weights.copy()
    S, room, D = np.zeros((states, size)), np.zeros((states, size)), np.zeros((12, size))
    state, spare = work[0], work[1]
    for trial in range(costs.size):
        copied(weights, kept)
        state.fill(0.0)
        total.fill(0.0)
        S.fill(0.0)
        D.fill(0.0)
        for k in range(n):
            if not sense(k, model, reference, numbers, scales, state, run):
                costs[trial] = np.inf
                copied(kept, weights)
                return trial + 1, k
            act(k, model, reference, weights, guard, state, spare, run)
            _derive(k, model, scales, weights, run, S, room, D)
            for p in range(size):
                gradient[p] = (
                    numbers[MOMENT_WEIGHT] * run[2][k, X] * D[X, p] + numbers[TORQUE_WEIGHT] * run[2][k, E] * D[E, p]
                )
                total[p] += numbers[PERIOD] * gradient[p]
            _step(weights, change, gradient, rates, momentum, 1.0, longest)
        costs[trial] = trial_cost(n, numbers, run[2])
        if _rms(n, run[2]) < enough:
            return trial + 1, -1
    return costs.size, -1
