"""The exact discretisation against the aliasing sum and a fine simulation."""

from dataclasses import replace

import control
import numpy as np
import pytest

import tfarm
from tests.dsp.independent import aliased, aliased_loop
from tests.odd_arms import odd_arms
from tests.strategies import arm_of
from tfarm.arm import FED_BACK, HubFeedback
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Sampling, pulse_transfer
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.sensed import sensed_plant
from tfarm.loop.sampled import sampled_loop

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


def test_the_state_space_is_the_pulse_transfer_function(lab):
    H = pulse_transfer(lab, ["hub_angle", *BOTH], Sampling(delay_samples=1.3), count=12)
    system = H.state_space()
    assert isinstance(system, control.StateSpace)
    assert (system.dt, system.output_labels, system.input_labels) == (T, ["hub_angle", *BOTH], ["hub_torque"])
    assert not system.D.any()
    z = np.array([np.exp(0.1 + 0.2j), np.exp(0.01 + 2j)])
    np.testing.assert_allclose(system(z)[:, 0], H(z), rtol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.6])
def test_the_states_of_a_braked_hub_are_its_pulse_transfer_function(lab, delay):
    """With friction that leaves the digits of both."""
    braked = replace(lab, hub=replace(lab.hub, friction=0.3))
    H = pulse_transfer(braked, ["hub_angle", *BOTH], Sampling(delay_samples=delay))
    assert H.plant.slow_hub_pole(T) is not None
    z = np.array([1.2j, 0.95 * np.exp(0.3j), -1.1 + 0.2j])
    np.testing.assert_allclose(H.state_space()(z)[:, 0], H(z), rtol=1e-9)


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
        values.append(H.scaled_values(H.multipliers[base] + offset, base, offset)[:, 0])
    np.testing.assert_allclose(values[0], values[2], rtol=1e-3)
    np.testing.assert_allclose(values[1], values[2], rtol=1e-7)


CORNER, FRICTION = 150.0, 0.8


def filtered(G):
    """Rate and moment through the analog filter."""
    return lambda s: G(s) * np.where([[0], [1], [1]], CORNER / (s + CORNER), 1.0)


def damped(G):
    """u - kb theta_t: G/(1 + kb R)."""
    return lambda s: (values := G(s)) / (1 + FRICTION * values[1])


@pytest.mark.parametrize("delay", [0.0, 0.6, 2.0])
@pytest.mark.parametrize(
    ("chain", "G", "terms", "off"),
    [
        (Chain(sampling=Sampling(antialias_corner=CORNER)), filtered, 16_000, [1e-8] * 3),
        (Chain(actuator=Actuator(hub_damping=FRICTION)), damped, 60_000, [2e-6, 1e-4, 2e-6]),  # the rate's tail is 1/s
    ],
    ids=["filter", "damping"],
)
def test_analog_parts_act_on_the_exact_arm(lab, chain, G, terms, off, delay):
    chain = replace(chain, sampling=replace(chain.sampling, delay_samples=delay))
    H = PulseTransfer(sensed_plant(lab, chain, FED_BACK, 14).together, chain.sampling)
    exact = G(tfarm.transfer(lab, list(FED_BACK)))
    for z in CIRCLE:
        reference = aliased(exact, z, T, delay, terms)
        assert (abs(H(z) - reference) <= off * abs(reference)).all()


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
def test_a_rigid_inertia_is_stable_up_to_its_known_gain(delay):
    """Whole delays: stable iff K1 T/J < 2 sin(pi/(2(2d + 1))), here with an arm that is as good as rigid."""
    arm = arm_of(
        length=0.1, slenderness=5, width=1, density=1e3, E=3e11, nu=0.3, damping=1e-6, hub=1.0, mass=0, inertia=0
    )
    edge = 2 * np.sin(np.pi / (2 * (2 * delay + 1))) * arm.total_inertia / T
    chain = Chain(sampling=Sampling(delay_samples=delay))
    for factor, stable in ((0.999, True), (1.001, False)):
        loop = sampled_loop(Case(arm, HubFeedback(K1=factor * edge, K2=0.0), chain), count=2)
        assert loop.poles.is_stable is stable


@pytest.mark.parametrize("delay", [0.0, 0.4])
def test_slopes_at_z_1_are_those_of_finite_differences(delay):
    """Of an arm that cannot drift, by the differences of two steps and Richardson's rule."""
    H = pulse_transfer(odd_arms()["pinned"], ["hub_angle", "root_moment"], Sampling(delay_samples=delay), count=4)
    h = 1e-4
    one, two = (((H(1 + n * h) - H(1 - n * h)) / (2 * n * h)).real for n in (1, 2))
    np.testing.assert_allclose(H.slopes_at_one, (4 * one - two) / 3, rtol=1e-6)
