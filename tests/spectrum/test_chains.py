"""Modes of random rigs against finite elements and transition matrices (see `chains`), and what modes guarantee."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import tfarm
from tests import chain_elements
from tests.rigs import lossless, rig, some_rig
from tests.shared import sized, thinned
from tests.spectrum.chains import judge
from tests.transition import response
from tfarm import Attachment, Hub, Payload, RotarySpring
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.system import system_of
from tfarm.reduced.modal import end_residues, modal_model
from tfarm.spectrum.frequencies import list_frequencies

NAMES = ("hub_angle", "root_moment", "root_shear", "tip_displacement", "tip_deflection")


def rigs(seed, count, **kind):
    return [some_rig(np.random.default_rng([seed, n]), **kind) for n in range(count)]


@pytest.mark.parametrize("count", sized(3, 8))
def test_twenty_frequencies_of_random_rigs(count):
    """`python -m tests.spectrum.chains 1000` for more, here and below."""
    found = [judge(arm, certify=n == 0) for n, arm in enumerate(rigs(11, count, damped=False))]
    assert [each.words for each in found if each.outcome != "right"] == []
    assert max(each.figures["distance from the other model"] for each in found) < 1e-8


def test_rigs_of_different_lengths_are_listed_together():
    """In one loop, as a study does: those of each rig's own finite elements, with and without a rigid body."""
    arms = rigs(17, 40, damped=False)
    for rigid in (False, True):
        alike = [arm for arm in arms if arm.has_rigid_mode == rigid][:4]
        systems = [system_of(arm) for arm in alike]
        assert len({len(k.elements) for k in systems}) > 1
        list_frequencies(systems, rigid + 1, rigid + 5)
        for arm, k in zip(alike, systems, strict=True):
            found = k.kept[rigid + 1, rigid + 5]
            assert found == pytest.approx(chain_elements.natural_frequencies(arm, 5), rel=1e-8)


def test_a_prescribed_angle_has_the_modes_of_a_locked_hub():
    """However heavy the hub that is turned: no rigid body, and none of its frequencies left out."""
    arm = lossless(rig())
    arm = replace(arm, motor=None, hub=replace(arm.hub, stiffness=0.0))
    turned, locked = replace(arm, input="hub_angle"), arm.with_numbers(hub_inertia=np.inf)
    assert tfarm.modes(turned, 6).index[0] == 1
    assert np.array_equal(tfarm.modes(turned, 6).natural_frequency, tfarm.modes(locked, 6).natural_frequency)


@pytest.mark.parametrize("seed", thinned(range(6), 2))
def test_shapes_are_orthogonal_and_of_unit_mass(seed):
    """The mass matrix is the identity, and behind a rigid clamp the root moves with the radius."""
    arm = some_rig(np.random.default_rng([13, seed]), damped=False)
    table = tfarm.modes(arm, 8)
    mass = table._shapes.mass_matrix()
    assert abs(mass - np.eye(len(mass))).max() < 1e-9
    flexible = table.index > 0
    W, Psi = table.shape(0.0)[flexible], table.rotation(0.0)[flexible]
    if arm.clamp.is_rigid:
        assert pytest.approx(arm.hub.radius * Psi, rel=1e-9, abs=1e-9 * abs(Psi).max()) == W


def test_an_attachment_a_rounding_off_a_joint_is_at_that_joint():
    """0.1 + 0.2 is not 0.3 in binary: the piece of 4e-17 between the two has states of its own."""
    steel = tfarm.load("stocky-steel")
    links = [replace(steel.link, length=length) for length in (0.1, 0.2, 0.3)]
    first, second = (
        tfarm.modes(replace(steel, link=links[0], outer=tuple(links[1:]), attachments=(Attachment(x=x, mass=1.0),)), 6)
        for x in (0.3, 0.1 + 0.2)
    )
    assert first.sensitivity["length"] == pytest.approx(second.sensitivity["length"], rel=1e-12)
    assert abs(first._shapes.mass_matrix() - np.eye(6)).max() < 1e-12


def residue_of(arm, p, names):
    """Residues at a simple pole next to p, from values of the oracle on both sides of it."""
    with mpmath.workdps(40):
        h = mpmath.mpf("1e-9") * abs(p)
        right, left = (response(arm, mpmath.mpc(p) + sign * h, names, 40) for sign in (1, -1))
        return np.array([complex(2 * h / (1 / right[each] - 1 / left[each])) for each in names])


@pytest.mark.parametrize("drive", thinned(["motor_current", "hub_torque", "hub_angle"], 2))
def test_residues_of_an_undamped_rig(drive):
    arm = replace(lossless(rig()), input=drive)
    names = NAMES[drive == "hub_angle" :]
    model = modal_model(arm, names, 3)
    for s, found in zip(model.eigenvalues[:, 0], model.residues[:, :, 0].T, strict=True):
        exact = residue_of(arm, s, names)
        assert found == pytest.approx(exact, rel=1e-9, abs=1e-12 * abs(exact).max())


@pytest.mark.parametrize("drive", thinned(["motor_voltage", "hub_torque", "hub_angle"], 2))
def test_residues_and_shapes_of_a_damped_rig(drive):
    """Residues are c b/(2 s): w(x) b over the input, b^2 of what the input works on.

    That is the hub angle, behind the motor's (R + L_a s)/(eta N Kt), and of a prescribed angle the torque, with a minus
    sign, as W/theta = -u/F.
    """
    arm, x = rig(input=drive), 0.375
    held, motor = drive == "hub_angle", arm.motor
    damped = tfarm.damped_modes(tfarm.modes(arm, 2))
    p = damped.eigenvalues[damped.index > 0][:, 0]
    found, _ = end_residues(system_of(arm), [OUTPUTS[name] for name in NAMES], p)
    shapes, turns, moments = (part(x)[:, 0] for part in (damped.shape, damped.rotation, damped.moment))
    along = [("displacement", x), ("rotation", x), ("gauge", x), "hub_torque" if held else "hub_angle"]
    for n, s in enumerate(p):
        exact = residue_of(arm, s, NAMES[held:])
        assert found[held:, n] == pytest.approx(exact, rel=1e-8, abs=1e-12 * abs(exact).max())
        W, Psi, M, worked = residue_of(arm, s, along)
        volts = (1 + motor.inductance / motor.resistance * s) if drive == "motor_voltage" else 1.0
        square = 2 * s * W**2 / (-worked if held else worked) * volts * arm.input_per_torque
        assert shapes[n] ** 2 == pytest.approx(square, rel=1e-8)
        assert turns[n] / shapes[n] == pytest.approx(Psi / W, rel=1e-8)
        assert moments[n] / shapes[n] == pytest.approx(M / W, rel=1e-8)


def test_the_tip_of_a_damped_rig_moves_upwards_in_its_shape_at_any_place():
    """Near the root, where modes have either sign, and along with the tip: Re w(1) > 0."""
    damped = tfarm.damped_modes(tfarm.modes(rig(input="hub_torque"), 4))
    along = damped.shape(np.array([0.1, 0.375, 0.7, 1.0]))
    assert (along[..., -1].real > 0).all()
    for n, x in enumerate((0.1, 0.375, 0.7)):
        np.testing.assert_allclose(damped.shape(x), along[..., n], rtol=1e-12)
    assert (along[..., :-1].real < 0).any()


def test_a_spring_on_the_axis_holds_nothing():
    """There nothing moves: the rig turns freely, as without it; clamped off the axis it does not."""
    free = some_rig(np.random.default_rng(3), damped=False, segments=2)
    free = replace(free, attachments=(), hub=Hub(inertia=0.01), clamp=RotarySpring(), joint=RotarySpring())
    free = replace(free, payload=Payload(mass=0.1, inertia=1e-4), motor=None, input="hub_torque")
    held = replace(free, attachments=(Attachment(x=0.0, stiffness=50.0, mass=0.01),))
    same = replace(free, attachments=(Attachment(x=0.0, mass=0.01),))
    assert held.has_rigid_mode
    found = tfarm.modes(held, 6).natural_frequency
    np.testing.assert_allclose(found, tfarm.modes(same, 6).natural_frequency, rtol=1e-14)
    assert found[0] == 0
    off = replace(held, hub=Hub(inertia=0.01, radius=0.05), attachments=(Attachment(x=0.0, stiffness=1e-3, mass=0.01),))
    assert not off.has_rigid_mode
    first = math.sqrt(1e-3 * 0.05**2 / off.total_inertia)
    assert tfarm.modes(off, 1).natural_frequency[0] == pytest.approx(first, rel=1e-3)  # so soft that the rig is rigid


@pytest.mark.parametrize("name", ["tests/rigs/bench-rig.toml", "quanser-flexlink"])
def test_a_rigid_body_turns_about_the_axis_with_the_field_s_root_moment(name):
    """The turning rig moves its tip by (r + L + ...): the residue at 0 of tip over torque, without friction."""
    arm = tfarm.load(name).elastic.lossless_hub
    arm = replace(arm, clamp=replace(arm.clamp, damping=0.0), input="hub_torque")
    table = tfarm.modes(arm, 3)
    s = 1e-3j
    tip = tfarm.transfer(arm, "tip_displacement")(s) * s**2
    assert table.shape(arm.length)[0] * table.hub_participation[0] == pytest.approx(tip.real, rel=1e-6)
    np.testing.assert_allclose(table.modal_moment, table.moment(0.0), rtol=1e-9, atol=1e-12)
