"""The neural tuner: training over whole trials, compiled, beside the same training in plain NumPy."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

import tfarm
from tests.tuner.plain import PlainTrial, complex_step
from tfarm.tuner import Guard, Learning, Network, Trial, initial_network, slew_trial, train

from .caches import empty
from .rows import Row, Target

GROUP = "Neural tuner: trials of 3 s, 301 samples, 6 modes, with the exact gradient of each trial"
TRIALS = 200
LIMIT = 2.0  # seconds for so many, on one core
IN_NUMPY = 10  # trials, as many as patience allows
ROUNDS = 5
NOTE = (
    "both learn by (21) and (22) with the gradient by reverse accumulation; NumPy takes vectors sample by sample.  "
    "largest error: of the gradient, against complex steps through a second implementation, relative to its largest."
)


def tuner_rows() -> Iterator[Row]:
    """Seconds a trial of both, in turn."""
    trial = slew_trial(tfarm.load("sasaki2012-lab"))
    guard, network = Guard("frozen", 0.0, 1.1, 6, False), initial_network(0)
    ours, numpy = [], []
    learning = Learning(rule="plain")
    train(trial, network, guard, learning, 2)
    for _ in range(ROUNDS):
        empty()
        start = time.process_time()
        weights = train(trial, network, guard, learning, TRIALS).network.weights
        ours.append((time.process_time() - start) / TRIALS)
        start = time.process_time()
        other = numpy_training(trial, network, guard, IN_NUMPY)
        numpy.append((time.process_time() - start) / IN_NUMPY)
    same = train(trial, network, guard, learning, IN_NUMPY).network.weights
    assert weights.size == same.size
    np.testing.assert_allclose(other, same, rtol=1e-9)
    seconds, slow = float(np.median(ours)), float(np.median(numpy))
    yield Row(
        group=GROUP, what="tfarm: sasaki2012-lab, 6-6-1 network, one core", n=TRIALS, each="trial", seconds=seconds,
        error=_gradient_error(trial, network, guard), note=NOTE,
        target=Target(measured=TRIALS * seconds, limit=LIMIT, unit=f"s for {TRIALS} trials"),
    )  # fmt: skip
    yield Row(
        group=GROUP, what="plain NumPy: the same training, to the same weights", n=IN_NUMPY, each="trial", seconds=slow,
        ratio=slow / seconds, to="tfarm", to_seconds=seconds, note=NOTE,
    )  # fmt: skip


def numpy_training(trial: Trial, network: Network, guard: Guard, trials: int, eta: float = 0.8, alpha: float = 0.6):
    """The weights after so many trials of (21) and (22)."""
    change = 0.0
    for _ in range(trials):
        change = -eta * numpy_gradient(trial, network, guard) + alpha * change
        network = network.with_weights(network.weights + change)
    return network.weights


def numpy_gradient(trial: Trial, network: Network, guard: Guard):
    """Forward, then back through time, with six inputs and a guard."""
    model, (a, b, T, _, _) = trial.model, trial.numbers
    A, B, servo, moment = model.A, model.B, model.servo, model.moment
    at_samples = np.transpose(trial.reference)
    W1, w2, span = network.W1 / network.scales, network.w2, guard.hi - guard.lo
    n, state, past = trial.n, np.zeros(B.size), np.zeros(3)
    kept, before = [], np.zeros(3)  # u, e, x of the sample before, and of that before it
    for k in range(n):
        wanted, counted, rest, rigid = at_samples[k]
        x, u = moment @ state - rigid, counted + wanted - servo @ state
        row = np.array([u, before[0], before[1], past[1], x, before[2]])
        hidden = 1 / (1 + np.exp(-W1 @ row))
        s = 1 / (1 + np.exp(-w2 @ hidden))
        K = guard.lo + span * s
        e = u - K * x
        kept.append((x, e, K, span * s * (1 - s), row, hidden))
        past, before = before, np.array([u, e, x])
        state = A @ state + B * (e + rest)
    back, late, by_W1, by_w2 = np.zeros(B.size), np.zeros(4), np.zeros_like(W1), np.zeros_like(w2)
    for x, e, K, slope, row, hidden in reversed(kept):
        by_e = T * b * e + B @ back + late[0]
        by_sum = -x * by_e * slope
        by_net = by_sum * w2 * hidden * (1 - hidden)
        by_w2 += by_sum * hidden
        by_W1 += np.outer(by_net, row / network.scales)
        by_row = by_net @ W1
        by_u, by_x = by_e + by_row[0] + late[2], T * a * x - K * by_e + by_row[4] + late[3]
        back = A.T @ back + moment * by_x - servo * by_u
        late = np.array([late[1] + by_row[2], by_row[3], by_row[1], by_row[5]])
    return np.r_[by_W1.ravel(), by_w2]


def _gradient_error(trial: Trial, network: Network, guard: Guard) -> float:
    plain = PlainTrial(trial.arm)
    right = complex_step(lambda w: plain.cost(w, 6, network.scales, guard.limits), network.weights)
    return float(abs(trial.gradient(network, guard.limits)[1] - right).max() / abs(right).max())
