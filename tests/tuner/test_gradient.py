"""Gradients of a trial and of a sample against complex steps, and reverse against forward accumulation."""

from itertools import product

import numpy as np
import pytest

from tests.shared import thinned
from tests.tuner.plain import PlainTrial, complex_step, gradient_of, gradient_of_sample, plain_gain
from tfarm.dsp import Chain, Converters, Sampling
from tfarm.exact.compiled import compiled
from tfarm.tuner import initial_network, kernel, slew_trial, training
from tfarm.tuner.kernel import Limits

pytestmark = pytest.mark.kernels

NONE, SECTOR = Limits(0.0, np.inf), Limits(0.3, 0.64)


def some_network(seed, inputs=6, hidden=6):
    return initial_network(seed, hidden=hidden, scales=np.linspace(0.6, 1.7, inputs))


@pytest.mark.parametrize(
    ("inputs", "signals", "guard"), thinned(product([6, 7], ["vibration", "total"], [NONE, SECTOR]), 3)
)
def test_the_gradient_of_a_trial_is_that_of_complex_steps(lab, signals, guard, inputs):
    network = some_network(inputs, inputs)
    servo = {"K1": 3.6, "Kp": 10.0} if inputs == 7 else {}
    cost, gradient = gradient_of(slew_trial(lab, signals=signals, **servo), network, guard)
    plain = PlainTrial(lab, signals=signals, **servo)
    expected = complex_step(lambda w: plain.cost(w, 6, network.scales, guard), network.weights)
    assert cost == pytest.approx(plain.cost(network.weights, 6, network.scales, guard).real, rel=1e-11)
    np.testing.assert_allclose(gradient, expected, atol=1e-9 * abs(expected).max())


@pytest.mark.parametrize(
    "chain",
    [
        Chain(sampling=Sampling(delay_samples=1.4)),
        Chain(sampling=Sampling(antialias_corner=300.0)),
        Chain(converters=Converters(hub_rate="difference", rate_filter=80.0)),
    ],
)
@pytest.mark.parametrize(("inputs", "hidden"), [(6, 6), (7, 3)])
def test_reverse_and_forward_accumulation_agree(lab, chain, inputs, hidden):
    """The gradients of the samples with whole sensitivities add up to that of the trial."""
    trial, network = slew_trial(lab, chain), some_network(1, inputs, hidden)
    _, gradient = gradient_of(trial, network, SECTOR)
    total, weights, setting = np.zeros(gradient.size), network.weights, trial.setting(network, SECTOR)
    (run, work), T = trial.room(network), trial.numbers.T
    S, spare, D = (np.zeros((rows, total.size)) for rows in (work.state.size, work.state.size, 3 * training.BEFORE))
    sense, act, derive = (compiled(each.py_func) for each in (kernel.sense, kernel.act, training.derive))
    for k in range(trial.n):
        assert sense(k, setting, run, work)
        act(k, setting, weights, run, work)
        derive(k, setting, weights, run, work, S, spare, D)
        total += T * (trial.cost.a * run.x[k] * D[training.X] + trial.cost.b * run.e[k] * D[training.E])
    np.testing.assert_allclose(total, gradient, atol=1e-12 * abs(gradient).max())


@pytest.mark.parametrize(("k", "guard"), thinned(product([5, 47, 160], [NONE, SECTOR]), 3))
def test_the_gradient_of_a_sample_is_that_of_complex_steps(lab, guard, k):
    """E = a x(k+1)^2/2 + b e(k)^2/2 by the gain at k: x(k+1) answers to the torque with the plant's first sample."""
    trial, network = slew_trial(lab), some_network(2)
    gradient = gradient_of_sample(trial, network, guard, k)
    plain = PlainTrial(lab)
    signals, _ = plain.run(lambda row: plain_gain(row, network.weights, 6, network.scales, guard))
    x, u, e, _ = signals.real.T
    row = np.array([u[k], u[k - 1], e[k - 1], e[k - 2], x[k], x[k - 1]])
    reply = plain.C[-1] @ plain.B + plain.D[-1]

    def error(weights):
        e_k = u[k] - plain_gain(row, weights, 6, network.scales, guard) * x[k]
        return ((x[k + 1] + reply * (e_k - e[k])) ** 2 + 2.6 * e_k**2) / 2

    expected = complex_step(error, network.weights)
    np.testing.assert_allclose(gradient, expected, atol=1e-9 * abs(expected).max())
