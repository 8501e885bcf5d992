"""The compiled heart of the tuner: a trial forward, and its cost's gradient backward.  Arrays:

    model       A^T, A (n, n), B (n,), servo (n,), moment (n,): s' = A s + B torque; servo.s by angle and rate
    reference   (N, 4): what servo.s should be, torque counted in u, torque not counted in it, rigid arm's moment
    numbers     a, b, T, bound, lag: the cost's weights, the period, the largest |moment|, samples until x answers
    guard       1 with lo and hi, or 0
    weights     W1 (h, m) row by row, then w2 (h,)
    run         inputs (N, m), hidden (N, h), signals (N, 5): x, u, e, K, dK/dz

With u = (torque counted) + (what servo.s should be) - servo.s and e = u - K x the torque is e + (torque not counted).
"""

from __future__ import annotations

from math import exp, log1p
from typing import Any

from tfarm.exact.compiled import compiled

X, U, E, GAIN_USED, SLOPE = range(5)  # columns of the signals
TURNED_ROWS, ADVANCE_ROWS, DRIVE_ROW, SERVO_ROW, MOMENT_ROW = range(5)  # A^T, A, B and the rows of the model
MOMENT_WEIGHT, TORQUE_WEIGHT, PERIOD, BOUND, LAG = range(5)  # of the numbers


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
def network_gain(weights: Any, inputs: Any, hidden: Any, guard: Any) -> tuple[float, float]:
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
def copied(source: Any, target: Any) -> None:
    """target = source, element by element: an assignment of arrays takes numba seconds to compile, and a loop none."""
    for i in range(target.size):
        target[i] = source[i]


@compiled
def turn(rows: Any, vector: Any, out: Any) -> None:
    """out = rows^T vector, in the order of memory."""
    out.fill(0.0)
    for j in range(vector.size):
        v = vector[j]
        if v != 0.0:
            for i in range(out.size):
                out[i] += rows[j, i] * v


@compiled
def dot(a: Any, b: Any) -> float:
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled
def sense(k: int, model: Any, reference: Any, numbers: Any, scales: Any, state: Any, run: Any) -> bool:
    """Reads x and u at sample k and fills the network's inputs there; False where the moment passes the bound."""
    inputs, _, signals = run
    moment = dot(model[MOMENT_ROW], state)
    if not abs(moment) <= numbers[BOUND]:
        return False
    signals[k, X] = moment - reference[k, 3]
    signals[k, U] = reference[k, 1] + reference[k, 0] - dot(model[SERVO_ROW], state)
    inputs[k].fill(0.0)
    inputs[k, 0], inputs[k, 4] = signals[k, U], signals[k, X]
    if k >= 1:
        inputs[k, 1], inputs[k, 2], inputs[k, 5] = signals[k - 1, U], signals[k - 1, E], signals[k - 1, X]
        if inputs.shape[1] > 6:
            inputs[k, 6] = signals[k - 1, GAIN_USED]
    if k >= 2:
        inputs[k, 3] = signals[k - 2, E]
    for i in range(inputs.shape[1]):
        inputs[k, i] /= scales[i]
    return True


@compiled
def act(k: int, model: Any, reference: Any, weights: Any, guard: Any, state: Any, spare: Any, run: Any) -> None:
    """The gain, e and the torque at sample k; then one sample on."""
    inputs, hidden, signals = run
    K, slope = network_gain(weights, inputs[k], hidden[k], guard)
    signals[k, GAIN_USED], signals[k, SLOPE] = K, slope
    signals[k, E] = signals[k, U] - K * signals[k, X]
    torque = signals[k, E] + reference[k, 2]
    turn(model[TURNED_ROWS], state, spare)
    for i in range(state.size):
        state[i] = spare[i] + model[DRIVE_ROW][i] * torque


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
        if not sense(k, model, reference, numbers, scales, state, run):
            return k
        act(k, model, reference, weights, guard, state, spare, run)
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
    a, b, T = numbers[MOMENT_WEIGHT], numbers[TORQUE_WEIGHT], numbers[PERIOD]
    gradient.fill(0.0)
    back.fill(0.0)
    late.fill(0.0)
    for k in range(n - 1, -1, -1):
        by_e = T * b * signals[k, E] + dot(model[DRIVE_ROW], back) + late[0]
        by_sum = (late[4] - signals[k, X] * by_e) * signals[k, SLOPE]
        gain_gradient(weights, inputs[k], hidden[k], by_sum, gradient)
        by_input.fill(0.0)
        for j in range(h):
            by_net = by_sum * weights[h * m + j] * hidden[k, j] * (1.0 - hidden[k, j])
            for i in range(m):
                by_input[i] += by_net * weights[j * m + i] / scales[i]
        by_u = by_e + by_input[0] + late[2]
        by_x = T * a * signals[k, X] - signals[k, GAIN_USED] * by_e + by_input[4] + late[3]
        turn(model[ADVANCE_ROWS], back, spare)
        for i in range(back.size):
            back[i] = spare[i] + model[MOMENT_ROW][i] * by_x - model[SERVO_ROW][i] * by_u
        late[0], late[1] = late[1] + by_input[2], by_input[3]
        late[2], late[3] = by_input[1], by_input[5]
        late[4] = by_input[6] if m > 6 else 0.0


@compiled
def sample_gradient(k: int, numbers: Any, reply: float, x_next: float, run: Any, weights: Any, out: Any) -> None:
    """Gradient of a x_next^2/2 + b e^2/2 by the weights that made K at sample k; x_next answers to the torque by
    `reply`."""
    inputs, hidden, signals = run
    by_gain = -signals[k, X] * (numbers[MOMENT_WEIGHT] * x_next * reply + numbers[TORQUE_WEIGHT] * signals[k, E])
    out.fill(0.0)
    gain_gradient(weights, inputs[k], hidden[k], by_gain * signals[k, SLOPE], out)
