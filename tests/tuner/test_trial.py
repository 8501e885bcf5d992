"""Trials and their yardsticks by second methods: NumPy, the simulator, batch least squares, prototype figures.

With a servo: the guard by second methods, and where the slew ends.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import toeplitz

import tfarm
from tests.dsp.independent import aliased, aliased_loop
from tests.shell import answer, refused
from tfarm.arm import Hub, HubFeedback
from tfarm.case import Case
from tfarm.dsp import Chain, Converters, Sampling, Simulator, pulse_transfer
from tfarm.errors import ParameterError
from tfarm.loop.sampled import sampled_loop
from tfarm.tuner import (
    Cost,
    Plan,
    TunedGain,
    best_constant,
    find_guard,
    initial_network,
    lq_bound,
    residual_rms,
    slew_trial,
    tune,
)
from tfarm.tuner.guard import MovingGain
from tfarm.tuner.kernel import Limits
from tfarm.tuner.trial import record_of_simulation, usual_rate_gain
from tfarm.tuner.tuning import SlewEnd

SECTOR = Limits(0.3, 0.64)


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
    """The tuner as a controller of `tfarm.dsp.Simulator`, which is independent of this room."""
    trial = slew_trial(lab, chain, K1=K1, Kp=Kp, signals=signals)
    network = initial_network(3, scales=np.full(inputs, 1.3))
    record = trial.with_network(network, SECTOR)
    gain = TunedGain(network, SECTOR, HubFeedback(K1=K1, Kp=Kp), signals)
    other = record_of_simulation(
        gain.run(Simulator(Case(lab, HubFeedback(), trial.loop.chain), trial.task, count=6)), trial.cost, signals
    )
    np.testing.assert_allclose(other.K, record.K, atol=1e-11)
    np.testing.assert_allclose(other.e, record.e, atol=1e-10)
    np.testing.assert_allclose(other.x, record.x, atol=1e-10)  # behind the filter, where there is one
    assert other.cost == pytest.approx(record.cost, rel=1e-11)


def test_the_best_constant_gain_is_global(lab):
    """Against every hundredth of the stable interval, by the simulator; none under the total reading."""
    assert best_constant(slew_trial(lab, signals="total")).gain < 1e-4
    trial = slew_trial(lab, signals="vibration", cost=Cost(a=3.0, b=0.4))
    best = best_constant(trial)
    loop = Simulator(Case(lab, HubFeedback(), trial.loop.chain), trial.task, count=6)

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


def test_a_diverging_trial_stops_and_reports_where(lab):
    record = slew_trial(lab).with_constant(3.0)
    assert record.stopped == record.K.size > 5
    assert record.cost == np.inf
    assert residual_rms(record, slew_trial(lab).task) is None
    assert np.isfinite(record.x).all()


@pytest.mark.parametrize("inertia", [0.0, np.inf])
def test_hubs_that_cannot_be_tuned_are_refused(lab, inertia):
    with pytest.raises(ParameterError, match=rf"hub\.inertia = {inertia}"):
        slew_trial(replace(lab, hub=Hub(inertia=inertia)))


def test_a_slew_on_another_arm_keeps_its_length_and_its_design(lab):
    """Sample by sample, at periods that no double holds too."""
    for period in (0.01, 0.007):
        trial = slew_trial(lab, Chain(sampling=Sampling(period=period)), K1=0.3)
        other = trial.on(Case(lab.with_numbers(payload_mass=0.1), HubFeedback(K1=0.2, K2=1.0), trial.loop.chain))
        assert other.n == trial.n
        np.testing.assert_array_equal(other.task.hub_angle, trial.task.hub_angle)
        assert other.loop.gains.K1 == 0.2


LAB = tfarm.load("sasaki2012-lab")
KP, K1 = 10.0, 3.6


def moving(count=6):
    return MovingGain(sampled_loop(Case(LAB, HubFeedback(K1=K1, K2=1.0, Kp=KP), Chain()), count=count))


def test_the_exact_arm_obeys_the_criterion_with_its_angle_held():
    """|H_m| by the aliasing sum over the transcendental plant, H = M/(1 + Kp Theta + K1 R), is never above 1/radius."""
    loop, m, angle = moving(), 0.3, tfarm.transfer(LAB, ["hub_angle"])
    radius = loop.radius(m)
    sizes = []
    z = np.exp(1j * np.r_[np.geomspace(0.02, 3.1, 16), 0.5799])
    for each in z:
        rate, moment = aliased_loop(LAB, each, 0.01, terms=2000)
        H = moment / (1 + KP * aliased(angle, each, 0.01, 0.0, 2000)[0] + K1 * rate)
        sizes.append(abs(H / (1 + m * H)))
    _, theta, rate, moment = loop.loop.rig.terms(z, None, np.ones(z.size))
    H = moment / (1 + KP * theta + K1 * rate)
    np.testing.assert_allclose(sizes, abs(H / (1 + m * H)), rtol=3e-4)
    assert max(sizes) <= 1 / radius * (1 + 3e-4)


@pytest.fixture(scope="module")
def tuning():
    return tune(LAB, Plan(Kp=KP, K1=usual_rate_gain(LAB, KP), trials=30))


def test_the_tuned_slew_ends_on_its_target(tuning):
    """Within a millimetre, where the paper's law leaves 38 after so few; the guard is proven, with more modes too."""
    assert max(abs(each) for each in SlewEnd.of(tuning)[-3:]) < 1e-3  # tuned, constant gain, without feedback
    assert abs(SlewEnd.of(tune(LAB, Plan(trials=30))).tip_error) > 0.02
    guard = tuning.training.guard
    assert guard.is_proven
    assert guard.lo <= tuning.training.result.K.min() <= tuning.training.result.K.max() <= guard.hi
    assert find_guard(tuning.trial.loop, "time-varying", tuning.best_constant.gain).sentence == guard.sentence


def test_the_usual_rate_gain_damps_the_rigid_arm():
    J = LAB.total_inertia
    for Kp in (KP, 0.05):
        s = np.roots([J, usual_rate_gain(LAB, Kp), Kp])
        assert (-s.real / abs(s)).min() == pytest.approx(np.sqrt(0.5), rel=1e-12)
    rubbed = replace(LAB, hub=Hub(inertia=LAB.hub.inertia, friction=5.0))
    assert usual_rate_gain(rubbed, KP) == 0.0  # what the hub loses is more than enough
    assert usual_rate_gain(LAB, 0.0) == tfarm.default_gains(LAB).K1
    with pytest.raises(ParameterError, match="Kp"):
        usual_rate_gain(LAB, -1.0)


def test_the_command_reports_where_the_tip_ends(capsys):
    found = answer(capsys, "tune", "sasaki2012-lab", "--Kp", "10", "--trials", "5")
    assert found["Kp"] == 10.0
    assert abs(found["tip_error_m"]) < 1e-3
    assert "damping ratio 0.71 of the rigid arm under Kp" in found["default_gains_in_words"]
    assert "Kp" in refused(capsys, "tune", "sasaki2012-lab", "--Kp=-1")
