"""Trials and their yardsticks by second roads: NumPy, the simulator, batch least squares, prototype figures."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import toeplitz

from tfarm import Hub
from tfarm.arm import HubFeedback
from tfarm.dsp import Chain, Converters, Sampling, Simulator, pulse_transfer
from tfarm.errors import ParameterError
from tfarm.tuner import Cost, TunedGain, best_constant, initial_network, lq_bound, residual_rms, slew_trial
from tfarm.tuner.kernel import Limits
from tfarm.tuner.trial import judged

NONE, SECTOR = Limits(0.0, np.inf), Limits(0.3, 0.64)


@pytest.mark.parametrize("inputs", [6, 7])
@pytest.mark.parametrize(
    ("signals", "chain"),
    [
        ("vibration", Chain()),
        ("total", Chain(sampling=Sampling(delay_samples=0.7))),
        ("vibration", Chain(sampling=Sampling(delay_samples=2.0, antialias_corner=500.0))),
        ("vibration", Chain(converters=Converters(hub_rate="difference", rate_filter=100.0))),
    ],
)
@pytest.mark.parametrize(("K1", "Kp"), [(0.3, 0.0), (3.6, 10.0)])
def test_a_trial_is_that_of_the_simulator(lab, inputs, signals, chain, K1, Kp):
    """The tuner as a controller of `tfarm.dsp.Simulator`, which knows nothing of this room."""
    trial = slew_trial(lab, chain, K1=K1, Kp=Kp, signals=signals)
    network = initial_network(3, scales=np.full(inputs, 1.3))
    record = trial.with_network(network, SECTOR)
    gain = TunedGain(network, SECTOR, HubFeedback(K1=K1, Kp=Kp), signals)
    other = judged(gain.run(Simulator(lab, trial.loop.chain, trial.task, count=6)), trial.cost, signals)
    np.testing.assert_allclose(other.K, record.K, atol=1e-11)
    np.testing.assert_allclose(other.e, record.e, atol=1e-10)
    np.testing.assert_allclose(other.x, record.x, atol=1e-10)  # behind the filter, where there is one
    assert other.cost == pytest.approx(record.cost, rel=1e-11)


def test_under_the_total_reading_the_best_constant_gain_is_none(lab):
    trial = slew_trial(lab, signals="total")
    assert best_constant(trial).gain < 1e-4
    costs = [trial.with_constant(K).cost for K in (0.0, 0.1, 0.2, 0.4, 0.8)]
    assert costs == sorted(costs)


def test_the_best_constant_gain_is_global(lab):
    """Against every hundredth of the stable interval, by the simulator."""
    trial = slew_trial(lab, signals="vibration", cost=Cost(a=3.0, b=0.4))
    best = best_constant(trial)
    loop = Simulator(lab, trial.loop.chain, trial.task, count=6)

    def cost(K):
        run = loop.linear(HubFeedback(K1=0.3, K2=K))
        x = run.at_samples.root_moment - trial.task.rigid_moment
        return 0.01 * np.sum(3.0 * x**2 + 0.4 * (run.torque - trial.task.feedforward) ** 2) / 2

    assert best.cost == pytest.approx(cost(best.gain), rel=1e-10)
    assert best.cost <= min(cost(K) for K in np.arange(0, 1.16, 0.01))


@pytest.mark.parametrize(
    ("signals", "delay", "a", "b"),
    [("vibration", 0.0, 1.0, 2.6), ("total", 0.0, 5.0, 0.01), ("total", 1.4, 1.0, 2.6), ("vibration", 1.4, 3.0, 0.1)],
)
def test_the_bound_is_batch_least_squares(lab, signals, delay, a, b):
    """x = x0 + G e with G the impulse responses: one least-squares problem in all e at once, no Riccati equation."""
    chain = Chain(sampling=Sampling(delay_samples=delay))
    trial = slew_trial(lab, chain, signals=signals, cost=Cost(a=a, b=b), duration=1.2)
    bound = lq_bound(trial)
    A, B, C = pulse_transfer(lab, ["root_moment"], chain.sampling, count=6).matrices()
    n, impulse, state = trial.n, [0.0], B.copy()
    for _ in range(n - 1):
        impulse.append(C[0] @ state)
        state = A @ state
    G = toeplitz(impulse, np.zeros(n))
    rest = np.zeros(n) if signals == "total" else trial.task.feedforward
    x0 = G @ rest - (signals == "vibration") * trial.task.rigid_moment
    rows = np.vstack([np.sqrt(a) * G, np.sqrt(b) * np.eye(n)])
    e = np.linalg.lstsq(rows, np.r_[-np.sqrt(a) * x0, np.zeros(n)], rcond=None)[0]
    cost = 0.01 * np.sum(a * (x0 + G @ e) ** 2 + b * e**2) / 2
    assert bound.cost == pytest.approx(cost, rel=1e-9)
    np.testing.assert_allclose(bound.e, e, atol=1e-6 * abs(e).max())


def test_a_trial_that_runs_away_stops_and_says_where(lab):
    record = slew_trial(lab).with_constant(3.0)
    assert record.stopped == record.K.size > 5
    assert record.cost == np.inf
    assert residual_rms(record, slew_trial(lab).task) is None
    assert np.isfinite(record.x).all()


@pytest.mark.parametrize("inertia", [0.0, np.inf])
def test_hubs_that_cannot_be_tuned_are_refused(lab, inertia):
    with pytest.raises(ParameterError, match=rf"hub\.inertia = {inertia}"):
        slew_trial(replace(lab, hub=Hub(inertia=inertia)))


def test_the_same_slew_asked_of_another_arm_is_as_long_and_made_for_the_first(lab):
    """Sample by sample, at periods that no double holds too."""
    for period in (0.01, 0.007):
        trial = slew_trial(lab, Chain(sampling=Sampling(period=period)), K1=0.3)
        other = trial.on(lab.having(payload_mass=0.1), trial.loop.chain, HubFeedback(K1=0.2))
        assert other.n == trial.n
        np.testing.assert_array_equal(other.task.hub_angle, trial.task.hub_angle)
        assert other.loop.gains.K1 == 0.2
