"""The exact discretisation against the aliasing sum and a fine simulation."""

import control
import numpy as np
import pytest
from scipy.linalg import expm

import tfarm
from tests.dsp.roads import aliased, aliased_loop
from tests.odd_arms import odd_arms
from tests.strategies import arm_of
from tfarm.arm import FED_BACK, HubFeedback
from tfarm.dsp import Chain, Sampling, pulse_transfer, sampled_loop
from tfarm.dsp.plant import PulseTransfer, sensed_plant, undelayed_plant, with_filter
from tfarm.errors import ParameterError
from tfarm.reduced import modal_model

T = 0.01
BOTH = ["hub_rate", "root_moment"]
DELAYS = (0.0, 0.25, 0.5, 0.95, 1.0, 1.7, 2.0)
CIRCLE = (np.exp(0.3j), np.exp(2.8j), 1.1 * np.exp(1j))


@pytest.mark.parametrize(
    ("delay", "period"), [*((delay, T) for delay in DELAYS), (0.4, 0.001), (0.4, 0.003), (0.4, 0.02)]
)
def test_the_aliasing_sum_over_the_exact_arm(lab, delay, period):
    H = pulse_transfer(lab, BOTH, Sampling(period=period, delay_samples=delay), count=14)
    for z in CIRCLE if period == T else CIRCLE[2:]:
        np.testing.assert_allclose(H(z), aliased_loop(lab, z, period, delay, 16_000), rtol=1e-8)


def test_the_aliasing_sum_converges_with_the_power_that_its_tail_has(lab):
    """A gauge moment s^-3/2 times the hold 1/s: the sum of n^-5/2 beyond N is as N^-3/2, a factor 8 for 4 times N."""
    H = pulse_transfer(lab, BOTH, Sampling(), count=14)(CIRCLE[0])
    errors = [abs(aliased_loop(lab, CIRCLE[0], T, 0, terms) - H) for terms in (4000, 16_000, 64_000)]
    rates = np.log(np.array(errors[:-1]) / np.array(errors[1:])) / np.log(4)
    assert np.all((rates > 1.35) & (rates < 1.6)), rates


def test_modes_left_out_of_a_lossless_arm_count_with_their_cube_at_most(lossless):
    """b^2 falls as n^-4, so that the moment of the modes beyond N is off by N^-3, or less where they alternate."""
    z = 1.2 * np.exp(1j)
    exact = aliased_loop(lossless, z, T, 0.3, 2**18)
    clock = Sampling(delay_samples=0.3)
    errors = [abs(pulse_transfer(lossless, BOTH, clock, count=n)(z) - exact)[1] for n in (10, 40, 160)]
    rates = np.log(np.array(errors[:-1]) / np.array(errors[1:])) / np.log(4)
    assert np.all(rates > 2.8), rates
    assert errors[-1] < 1e-8


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.6])
def test_a_hundred_modes_stepped_in_tenths_of_a_sample(lossless, delay):
    """Matrix exponentials of the modal state space, with the torque switched at the right tenth."""
    model = modal_model(lossless, BOTH, 100)
    A, B, C, D = model.matrices()
    n = len(A)
    step = expm(np.block([[A, B], [np.zeros((1, n + 1))]]) * T / 10)
    torque = np.random.default_rng(3).normal(size=40)
    late = round(10 * delay)
    H = pulse_transfer(lossless, BOTH, Sampling(delay_samples=delay), count=100)
    F, G, E = H.matrices()
    x, fine, worst, size = np.zeros(len(F)), np.zeros(n), 0.0, 0.0
    held = 0.0
    for k in range(40):
        expected = C @ fine + D[:, 0] * held
        worst, size = max(worst, abs(E @ x - expected).max()), max(size, abs(expected).max())
        x = F @ x + G * torque[k]
        for tenth in range(10):
            j = (10 * k + tenth - late) // 10
            held = torque[j] if j >= 0 else 0.0
            fine = step[:n, :n] @ fine + step[:n, n] * held
    assert worst < 1e-9 * size


def test_the_state_space_is_the_pulse_transfer_function(lab):
    H = pulse_transfer(lab, ["hub_angle", *BOTH], Sampling(delay_samples=1.3), count=12)
    system = H.state_space()
    assert isinstance(system, control.StateSpace)
    assert (system.dt, system.output_labels, system.input_labels) == (T, ["hub_angle", *BOTH], ["hub_torque"])
    assert not system.D.any()
    z = np.array([np.exp(0.1 + 0.2j), np.exp(0.01 + 2j)])
    np.testing.assert_allclose(system(z)[:, 0], H(z), rtol=1e-12)


def test_lossless_poles_stay_on_the_circle(lossless):
    H = pulse_transfer(lossless, BOTH, Sampling(), count=100)
    assert abs(abs(H.multipliers) - 1).max() <= 2 * np.finfo(float).eps


def test_offsets_lose_nothing_next_to_a_pole(lossless):
    """offset H at z = e^{pT} + offset tends to the residue, and does so for offsets below the last bit of z."""
    H = pulse_transfer(lossless, BOTH, Sampling(delay_samples=0.3), count=10)
    base = np.array([12])
    values = []
    for size in (1e-8, 1e-12, 1e-20):
        offset = np.array([size * np.exp(0.4j)])
        values.append(H.scaled(H.multipliers[base] + offset, base, offset)[:, 0])
    np.testing.assert_allclose(values[0], values[2], rtol=1e-3)
    np.testing.assert_allclose(values[1], values[2], rtol=1e-7)


@pytest.mark.parametrize("delay", [0.0, 0.6, 2.0])
def test_the_anti_alias_filter_is_a_filter(lab, delay):
    corner = 150.0
    chain = Chain(sampling=Sampling(delay_samples=delay, antialias_corner=corner))
    H = PulseTransfer(sensed_plant(lab, chain, FED_BACK, 14).together, chain.sampling)
    exact = tfarm.transfer(lab, ["hub_angle", "hub_rate", "root_moment"])
    lag = np.array([[0.0], [1.0], [1.0]])

    def filtered(s):
        return exact(s) * np.where(lag, corner / (s + corner), 1.0)

    for z in CIRCLE:
        np.testing.assert_allclose(H(z), aliased(filtered, z, T, delay, 16_000), rtol=1e-8)


@pytest.mark.parametrize("delay", [0.0, 0.6])
def test_analog_hub_damping_moves_the_exact_arm(lab, delay):
    """u - kb theta_t: G/(1 + kb R) of the exact arm."""
    from tfarm.dsp import Actuator

    kb = 0.8
    chain = Chain(sampling=Sampling(delay_samples=delay), actuator=Actuator(hub_damping=kb))
    H = PulseTransfer(sensed_plant(lab, chain, FED_BACK, 14).together, chain.sampling)
    exact = tfarm.transfer(lab, ["hub_angle", "hub_rate", "root_moment"])

    def damped(s):
        values = exact(s)
        return values / (1 + kb * values[1])

    for z in CIRCLE:
        reference = aliased(damped, z, T, delay, 60_000)
        np.testing.assert_allclose(H(z)[[0, 2]], reference[[0, 2]], rtol=2e-6)
        np.testing.assert_allclose(H(z)[1], reference[1], rtol=1e-4)  # a tail of 1/s: the sum itself is that short


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
def test_a_rigid_inertia_is_stable_up_to_its_known_gain(delay):
    """Whole delays: stable iff K1 T/J < 2 sin(pi/(2(2d + 1))), here with an arm that is as good as rigid."""
    arm = arm_of(
        length=0.1, slenderness=5, width=1, density=1e3, E=3e11, nu=0.3, damping=1e-6, hub=1.0, mass=0, inertia=0
    )
    edge = 2 * np.sin(np.pi / (2 * (2 * delay + 1))) * arm.total_inertia / T
    chain = Chain(sampling=Sampling(delay_samples=delay))
    for factor, stable in ((0.999, True), (1.001, False)):
        loop = sampled_loop(arm, HubFeedback(K1=factor * edge, K2=0.0), chain, count=2)
        assert loop.poles.is_stable is stable


def test_a_filter_is_for_what_does_not_drift(lab):
    """The rigid body's rate 1/(J s) is lagged, an angle's 1/(J s^2) refused: encoders have no analog filter."""
    plain = undelayed_plant(lab, ("hub_rate", "root_moment", "hub_angle"), 8)
    lagged = with_filter(plain, [0], 90.0)
    for s in (3.0 + 1j, 200j, -20.0 + 400j):
        rate, moment, _ = lagged(s)
        assert rate == pytest.approx(plain(s)[0] * 90 / (s + 90), rel=1e-11)
        assert moment == plain(s)[1]
    with pytest.raises(ParameterError, match="filtered output = 'hub_angle'"):
        with_filter(plain, [2], 90.0)


@pytest.mark.parametrize("delay", [0.0, 0.4])
def test_slopes_at_z_1_are_those_of_differences_beside_it(delay):
    """Of an arm that cannot drift, by the differences of two steps and Richardson's rule."""
    H = pulse_transfer(odd_arms()["pinned"], ["hub_angle", "root_moment"], Sampling(delay_samples=delay), count=4)
    h = 1e-4
    one, two = (((H(1 + n * h) - H(1 - n * h)) / (2 * n * h)).real for n in (1, 2))
    np.testing.assert_allclose(H.slopes_at_one, (4 * one - two) / 3, rtol=1e-6)
