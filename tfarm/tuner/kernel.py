"""The compiled heart of the tuner: a trial forward, its cost's gradient backward, and the learning rules.

All compiled functions stand in this one file, for numba's cache does not notice an edited callee elsewhere.  Arrays:

    model       A^T, A (n, n), B (n,), rate (n,), moment (n,): s' = A s + B torque, read as rate.s and moment.s
    reference   (N, 4): hub rate wanted, torque counted in u, torque not counted in it, rigid arm's moment
    numbers     K1, a, b, T, bound, lag: the cost's weights, the period, the largest |moment|, samples until x answers
    guard       1 with lo and hi, or 0
    weights     W1 (h, m) row by row, then w2 (h,)
    run         inputs (N, m), hidden (N, h), signals (N, 5): x, u, e, K, dK/dz

With u = (torque counted) + K1 (rate wanted - rate) and e = u - K x the torque is e + (torque not counted).
"""

from __future__ import annotations

from math import exp, isfinite, log1p, sqrt
from typing import Any

import numpy as np

from tfarm.exact.compiled import compiled

X, U, E, GAIN, SLOPE = range(5)  # columns of the signals
TURNED, ADVANCE, DRIVE, RATE, MOMENT = range(5)  # A^T, A, B and the rows of the model
RATE_GAIN, MOMENT_WEIGHT, TORQUE_WEIGHT, PERIOD, BOUND, LAG = range(6)  # of the numbers
PLAIN, CLIPPED, BACKTRACKING = 0, 1, 2
SOURCE = (1, 5, 6, 10, 0, 4, 7)  # of each input in the rows of `_derive`: x, u, e, K now, before, and before that


@compiled
def logistic(z: float) -> float:
    """1/(1 + e^-z), without overflow."""
    if z >= 0.0:
        return 1.0 / (1.0 + exp(-z))
    small = exp(z)
    return small / (1.0 + small)


@compiled
def guarded(z: float, guard: Any) -> tuple[float, float]:
    """The gain and its derivative for the output neuron's sum z.

    kappa = ln(1 + e^z) without a guard; lo + (hi - lo)(1 - e^-kappa) with one.
    """
    s = logistic(z)
    if guard[0] < 0.5:
        return max(z, 0.0) + log1p(exp(-abs(z))), s
    span = guard[2] - guard[1]
    return min(max(guard[1] + span * s, guard[1]), guard[2]), span * s * logistic(-z)


@compiled
def gain(weights: Any, inputs: Any, hidden: Any, guard: Any) -> tuple[float, float]:
    """The network's gain and its derivative by the output neuron's sum; fills `hidden`."""
    m, h = inputs.size, hidden.size
    z = 0.0
    for j in range(h):
        net = 0.0
        for i in range(m):
            net += weights[j * m + i] * inputs[i]
        hidden[j] = logistic(net)
        z += weights[h * m + j] * hidden[j]
    return guarded(z, guard)


@compiled
def gain_gradient(weights: Any, inputs: Any, hidden: Any, by_sum: float, out: Any) -> None:
    """Adds by_sum times the derivative of the output neuron's sum by every weight to `out`."""
    m, h = inputs.size, hidden.size
    for j in range(h):
        out[h * m + j] += by_sum * hidden[j]
        by_net = by_sum * weights[h * m + j] * hidden[j] * (1.0 - hidden[j])
        for i in range(m):
            out[j * m + i] += by_net * inputs[i]


@compiled
def _copy(source: Any, target: Any) -> None:
    """target = source, element by element: an assignment of arrays takes numba seconds to compile, and a loop none."""
    for i in range(target.size):
        target[i] = source[i]


@compiled
def _turn(rows: Any, vector: Any, out: Any) -> None:
    """out = rows^T vector, in the order of memory."""
    out.fill(0.0)
    for j in range(vector.size):
        v = vector[j]
        if v != 0.0:
            for i in range(out.size):
                out[i] += rows[j, i] * v


@compiled
def _dot(a: Any, b: Any) -> float:
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled
def _sense(k: int, model: Any, reference: Any, numbers: Any, scales: Any, state: Any, run: Any) -> bool:
    """Reads x and u at sample k and fills the network's inputs there; False where the moment passes the bound."""
    inputs, _, signals = run
    moment = _dot(model[MOMENT], state)
    if not abs(moment) <= numbers[BOUND]:
        return False
    signals[k, X] = moment - reference[k, 3]
    signals[k, U] = reference[k, 1] + numbers[RATE_GAIN] * (reference[k, 0] - _dot(model[RATE], state))
    inputs[k].fill(0.0)
    inputs[k, 0], inputs[k, 4] = signals[k, U], signals[k, X]
    if k >= 1:
        inputs[k, 1], inputs[k, 2], inputs[k, 5] = signals[k - 1, U], signals[k - 1, E], signals[k - 1, X]
        if inputs.shape[1] > 6:
            inputs[k, 6] = signals[k - 1, GAIN]
    if k >= 2:
        inputs[k, 3] = signals[k - 2, E]
    for i in range(inputs.shape[1]):
        inputs[k, i] /= scales[i]
    return True


@compiled
def _act(k: int, model: Any, reference: Any, weights: Any, guard: Any, state: Any, spare: Any, run: Any) -> None:
    """The gain, e and the torque at sample k; then one sample on."""
    inputs, hidden, signals = run
    K, slope = gain(weights, inputs[k], hidden[k], guard)
    signals[k, GAIN], signals[k, SLOPE] = K, slope
    signals[k, E] = signals[k, U] - K * signals[k, X]
    torque = signals[k, E] + reference[k, 2]
    _turn(model[TURNED], state, spare)
    for i in range(state.size):
        state[i] = spare[i] + model[DRIVE][i] * torque


@compiled
def trial_cost(done: int, numbers: Any, signals: Any) -> float:
    """T times the sum of a x^2/2 + b e^2/2 over the first `done` samples."""
    total = 0.0
    for k in range(done):
        total += 0.5 * numbers[MOMENT_WEIGHT] * signals[k, X] ** 2 + 0.5 * numbers[TORQUE_WEIGHT] * signals[k, E] ** 2
    return total * numbers[PERIOD]


@compiled
def forward(
    model: Any, reference: Any, numbers: Any, scales: Any, guard: Any, weights: Any, run: Any, work: Any
) -> int:
    """One trial with fixed weights; fills `run`, returns how many samples were made before the bound was passed."""
    state, spare = work[0], work[1]
    state.fill(0.0)
    n = reference.shape[0]
    for k in range(n):
        if not _sense(k, model, reference, numbers, scales, state, run):
            return k
        _act(k, model, reference, weights, guard, state, spare, run)
    return n


@compiled
def backward(model: Any, numbers: Any, scales: Any, weights: Any, run: Any, work: Any, gradient: Any) -> None:
    """The gradient of the cost of the trial in `run`, through network, plant and time (reverse accumulation).

    `back` is the derivative by the state of the next sample; `late` what the inputs of later samples owe to e (of this
    sample and the one before), u, x and K.
    """
    inputs, hidden, signals = run
    n, m, h = inputs.shape[0], inputs.shape[1], hidden.shape[1]
    back, spare, by_input, late = work[0], work[1], work[2], work[3]
    K1, a, b, T = numbers[RATE_GAIN], numbers[MOMENT_WEIGHT], numbers[TORQUE_WEIGHT], numbers[PERIOD]
    gradient.fill(0.0)
    back.fill(0.0)
    late.fill(0.0)
    for k in range(n - 1, -1, -1):
        by_e = T * b * signals[k, E] + _dot(model[DRIVE], back) + late[0]
        by_sum = (late[4] - signals[k, X] * by_e) * signals[k, SLOPE]
        gain_gradient(weights, inputs[k], hidden[k], by_sum, gradient)
        by_input.fill(0.0)
        for j in range(h):
            by_net = by_sum * weights[h * m + j] * hidden[k, j] * (1.0 - hidden[k, j])
            for i in range(m):
                by_input[i] += by_net * weights[j * m + i] / scales[i]
        by_u = by_e + by_input[0] + late[2]
        by_x = T * a * signals[k, X] - signals[k, GAIN] * by_e + by_input[4] + late[3]
        _turn(model[ADVANCE], back, spare)
        for i in range(back.size):
            back[i] = spare[i] + model[MOMENT][i] * by_x - K1 * model[RATE][i] * by_u
        late[0], late[1] = late[1] + by_input[2], by_input[3]
        late[2], late[3] = by_input[1], by_input[5]
        late[4] = by_input[6] if m > 6 else 0.0


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
    are then those of the last trial that did not.  Under
    BACKTRACKING a trial that costs more than the last accepted one is taken back, its step halved and the momentum set
    to zero; an accepted one lets the step grow by a fifth, up to its full size.
    """
    n, size = reference.shape[0], weights.size
    gradient, change, kept, slope = np.zeros(size), np.zeros(size), weights.copy(), np.zeros(size)
    best, share = np.inf, 1.0
    for trial in range(costs.size):
        done = forward(model, reference, numbers, scales, guard, weights, run, work)
        cost = trial_cost(done, numbers, run[2]) if done == n else np.inf
        costs[trial] = cost
        if rule == BACKTRACKING and not cost <= best and best < np.inf:
            share *= 0.5
            _copy(kept, weights)
            change.fill(0.0)
            _step(weights, change, slope, rates, momentum, share, longest)
            continue
        if done < n or not isfinite(cost):
            _copy(kept, weights)
            return trial + 1, done
        if _rms(done, run[2]) < enough:
            return trial + 1, -1
        backward(model, numbers, scales, weights, run, work, gradient)
        _copy(weights, kept)
        if rule == BACKTRACKING:
            _copy(gradient, slope)
            share = min(1.0, 1.2 * share) if best < np.inf else 1.0
            best = cost
        _step(weights, change, gradient, rates, momentum, share, longest)
    if rule == BACKTRACKING:
        _copy(kept, weights)
    return costs.size, -1


@compiled
def sample_gradient(k: int, numbers: Any, reply: float, x_next: float, run: Any, weights: Any, out: Any) -> None:
    """Gradient of a x_next^2/2 + b e^2/2 by the weights that made K at sample k; x_next answers to the torque by
    `reply`."""
    inputs, hidden, signals = run
    by_gain = -signals[k, X] * (numbers[MOMENT_WEIGHT] * x_next * reply + numbers[TORQUE_WEIGHT] * signals[k, E])
    out.fill(0.0)
    gain_gradient(weights, inputs[k], hidden[k], by_gain * signals[k, SLOPE], out)


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
        _copy(weights, kept)
        for k in range(n):
            if not _sense(k, model, reference, numbers, scales, state, run):
                costs[trial] = np.inf
                _copy(kept, weights)
                return trial + 1, k
            if k >= lag:
                sample_gradient(k - lag, numbers, reply, run[2][k, X], run, past[k % lag], gradient)
                _step(weights, change, gradient, rates, momentum, 1.0, longest)
            _copy(weights, past[k % lag])
            _act(k, model, reference, weights, guard, state, spare, run)
        costs[trial] = trial_cost(n, numbers, run[2])
        if _rms(n, run[2]) < enough:
            return trial + 1, -1
    return costs.size, -1


@compiled
def _derive(k: int, model: Any, numbers: Any, scales: Any, weights: Any, run: Any, S: Any, spare: Any, D: Any) -> None:
    """Derivatives at sample k by every weight, forward: rows of D are those of x, u, e, K now and one, two samples ago.

    S (n, weights) is the state's; it is taken one sample on.
    """
    inputs, hidden, signals = run
    m, h = inputs.shape[1], hidden.shape[1]
    for row in range(11, 3, -1):
        _copy(D[row - 4], D[row])
    for row in range(4):
        D[row].fill(0.0)
    for i in range(S.shape[0]):
        for p in range(S.shape[1]):
            D[X, p] += model[MOMENT][i] * S[i, p]
            D[U, p] -= numbers[RATE_GAIN] * model[RATE][i] * S[i, p]
    gain_gradient(weights, inputs[k], hidden[k], signals[k, SLOPE], D[GAIN])
    for i in range(m):
        by_input = 0.0
        for j in range(h):
            by_input += weights[h * m + j] * hidden[k, j] * (1.0 - hidden[k, j]) * weights[j * m + i]
        share = signals[k, SLOPE] * by_input / scales[i]
        for p in range(S.shape[1]):
            D[GAIN, p] += share * D[SOURCE[i], p]
    for p in range(S.shape[1]):
        D[E, p] = D[U, p] - signals[k, GAIN] * D[X, p] - signals[k, X] * D[GAIN, p]
    spare.fill(0.0)
    for i in range(S.shape[0]):
        for j in range(S.shape[0]):
            if model[ADVANCE][i, j] != 0.0:
                for p in range(S.shape[1]):
                    spare[i, p] += model[ADVANCE][i, j] * S[j, p]
        for p in range(S.shape[1]):
            spare[i, p] += model[DRIVE][i] * D[E, p]
    for i in range(S.shape[0]):
        _copy(spare[i], S[i])


@compiled
def learn_by_sensitivities(
    model: Any, reference: Any, numbers: Any, scales: Any, guard: Any, weights: Any, rates: Any, momentum: float,
    longest: float, enough: float, costs: Any, run: Any, work: Any, total: Any,
) -> tuple[int, int]:  # fmt: skip
    """Learning at every sample with the whole sensitivity of the plant, carried forward since the trial began.

    The gradient of a x^2/2 + b e^2/2 now, by weights taken for constant all the trial (Williams and Zipser, 1989).
    `total` collects T times the gradients of a trial: with rates of zero that is the gradient of its cost.
    """
    n, size, states = reference.shape[0], weights.size, model[DRIVE].size
    gradient, change, kept = np.zeros(size), np.zeros(size), weights.copy()
    S, room, D = np.zeros((states, size)), np.zeros((states, size)), np.zeros((12, size))
    state, spare = work[0], work[1]
    for trial in range(costs.size):
        _copy(weights, kept)
        state.fill(0.0)
        total.fill(0.0)
        S.fill(0.0)
        D.fill(0.0)
        for k in range(n):
            if not _sense(k, model, reference, numbers, scales, state, run):
                costs[trial] = np.inf
                _copy(kept, weights)
                return trial + 1, k
            _act(k, model, reference, weights, guard, state, spare, run)
            _derive(k, model, numbers, scales, weights, run, S, room, D)
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
