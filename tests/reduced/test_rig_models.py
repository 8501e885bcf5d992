"""Modal models of rigs: friction leaves one integral and a real pole, or one that is no mode's; a circuit its own."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest

import tfarm
from tests.reduced.test_modal import by_matrices
from tests.transition import determinant
from tfarm import Hub, damped_modes, load, modes, transfer
from tfarm.arm import FED_BACK, Motor
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling, pulse_transfer
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.reduced.modal import modal_model
from tfarm.spectrum.damped import missing_real_eigenvalues
from tfarm.spectrum.gains import default_gains

MEASURED = ("hub_angle", "hub_rate", "root_moment")
S = np.array([0.01 + 0.02j, 5 + 40j, 3 - 20j])


@pytest.fixture(params=["tests/rigs/bench-rig.toml", "quanser-2dsfl", "quanser-flexlink"])
def arm(request):
    return tfarm.load(request.param)


def test_a_model_with_friction_is_the_exact_rig_at_low_frequency(arm):
    """Static remainders are off by (s/w)^2 of the first mode left out: 1e-4 at |s| of 50 1/s, far less at the hub."""
    exact = tfarm.transfer(arm, MEASURED)(S)
    model = modal_model(arm, MEASURED, 7)
    np.testing.assert_allclose(model(S), exact, rtol=1e-4)
    assert model.order == 14 + 1 + model.single.size == len(model.states)
    np.testing.assert_allclose(by_matrices(model, S), model(S), rtol=1e-9)


def test_the_single_poles_are_eigenvalues_of_the_rig(arm):
    found = tfarm.damped_modes(tfarm.modes(arm, 2))
    np.testing.assert_array_equal(modal_model(arm, "hub_rate", 2).single, found.single)
    assert found.single.size == (2 if arm.motor and arm.motor.inductance else 1)
    G = tfarm.transfer(arm, "hub_rate")
    near, far = (abs(G(found.single * (1 + share))) for share in (1e-6, 1e-3))
    assert (near > 100 * far).all()


def test_a_sampled_rig_turns_at_rest_as_its_friction_lets_it(arm):
    """At z = 1 the pulse transfer of the hub rate is that of the rig at s = 0: one over all friction at the hub."""
    H = pulse_transfer(arm, ("hub_rate",), count=4)
    assert H(1.0 + 1e-9)[0].real == pytest.approx(1.0 / arm.rate_loss, rel=1e-4)


def test_reduced_models_of_rigs_keep_their_word(arm):
    reduced = tfarm.reduce(arm, ["hub_angle", "root_moment"], order=10, band=(0.1, 50.0))
    assert reduced.order == 10 - (10 - 1 - reduced.model.single.size) % 2 * (arm.damping == 0)
    assert reduced.worst_error < 1e-3
    space = reduced.state_space()
    values = space(5j)[:, 0]
    np.testing.assert_allclose(values, tfarm.transfer(arm, ["hub_angle", "root_moment"])(5j), rtol=1e-2)


@pytest.mark.parametrize("radius", [0.0, 0.05])
def test_a_lossless_rig_behind_an_inductance_has_its_circuits_pole(radius):
    """Without back-EMF the circuit is the factor 1/(L_a s + R) of every response: of the current all there is."""
    plain = tfarm.load("sasaki2012")
    motor = Motor(resistance=2.6, torque_constant=0.0077, back_emf_constant=0.0, inductance=0.02, gear_ratio=70)
    plain = replace(plain, hub=replace(plain.hub, radius=radius))
    arm = replace(plain, motor=motor, input="motor_voltage")
    outputs = ("hub_angle", "root_moment", "motor_current")
    model = modal_model(arm, outputs, 12)
    np.testing.assert_allclose(model.single, [-motor.resistance / motor.inductance], rtol=1e-14)
    exact = tfarm.transfer(arm, outputs)(S)
    np.testing.assert_allclose(model(S), exact, rtol=1e-6)
    circuit = 1 / (motor.resistance + motor.inductance * S)
    np.testing.assert_allclose(model(S)[2], circuit, rtol=1e-12)
    by_torque = modal_model(plain, outputs[:2], 40)(S) * circuit * motor.gear_ratio * motor.torque_constant
    np.testing.assert_allclose(model(S)[:2], by_torque, rtol=1e-5)
    np.testing.assert_allclose(by_matrices(model, S), exact, rtol=1e-6)
    with pytest.raises(tfarm.ParameterError, match="no inductance"):
        tfarm.reduce(arm, "hub_angle", order=8, method="aaa")


LAB = load("sasaki2012-lab")
LEFT_OUT = 2e-3  # of a response: what the modes left out add to their static share at C = 0


def rubbing(inertia, friction, *, theory="timoshenko", C=1e-4):
    return replace(LAB.with_numbers(damping=C), hub=Hub(inertia=inertia, friction=friction), theory=theory)


@pytest.mark.parametrize("theory", ["timoshenko", "euler-bernoulli"])
@pytest.mark.parametrize("inertia", [0.0, 1e-6])
def test_the_pole_is_one_of_the_exact_arm(theory, inertia):
    arm = rubbing(inertia, 5.0, theory=theory)
    (pole,) = missing_real_eigenvalues(damped_modes(modes(arm, 6)))
    either_side = [determinant(arm, mpmath.mpf(pole * (1 + side)), digits=30).real for side in (-1e-9, 1e-9)]
    assert either_side[0] * either_side[1] < 0
    assert -140 < pole < -130


@pytest.mark.parametrize("C", [1e-4, 0.0])
@pytest.mark.parametrize("friction", [2.0, 5.0])
@pytest.mark.parametrize("inertia", [0.0, 1e-6])
def test_a_modal_model_has_it(C, friction, inertia):
    arm, s = rubbing(inertia, friction, C=C), 1j * np.array([20.0, 50.0, 300.0])
    exact = transfer(arm, list(FED_BACK))(s)
    np.testing.assert_allclose(modal_model(arm, FED_BACK, 16)(s), exact, rtol=LEFT_OUT)


def test_the_sampled_loop_of_few_modes_is_that_of_many():
    """Both with a pole at -135 1/s that was in neither: a fit of slow poles had stood in for it."""
    arm, chain = rubbing(0.0, 5.0), Chain(sampling=Sampling(period=2e-3))
    law = default_gains(arm)
    few, many = (sampled_verdict(Case(arm, law, chain), count=count) for count in (8, 24))
    assert few.log_radius == pytest.approx(many.log_radius, rel=1e-6)


@pytest.mark.parametrize("inertia", [1e-3, 0.1])
def test_a_hub_that_weighs_something_has_none(inertia):
    assert not missing_real_eigenvalues(damped_modes(modes(rubbing(inertia, 5.0), 6))).size


def test_a_segment_next_to_massless_is_no_warning():
    """On the negative axis its waves hardly swing: what D grows by from one s to the next is beyond any number."""
    first = replace(LAB.link, length=0.3, density=1e-9, damping=0.0)
    assert not missing_real_eigenvalues(damped_modes(modes(replace(LAB, link=first, outer=(LAB.link,)), 6))).size
