"""The parts of a rig: what they sum to, what they make of the arm, and what is refused."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shared import refusal
from tfarm.arm import Arm, Attachment, Gauge, Hub, Link, Motor, Payload, RotarySpring, Section, must_turn
from tfarm.errors import ParameterError
from tfarm.exact.system import system_of

ROOT = Link.isotropic(
    length=0.3,
    density=7850.0,
    youngs_modulus=2.1e11,
    poissons_ratio=0.3,
    section=Section.rectangle(width=0.04, depth=0.006),
    damping=2e-4,
)
TIP = replace(ROOT, length=0.2, density=2700.0, section=Section.rectangle(width=0.03, depth=0.004), damping=5e-5)
MOTOR = Motor(resistance=2.6, torque_constant=0.0077, gear_ratio=70.0, rotor_inertia=3.9e-7, gear_efficiency=0.9)
RIG = Arm(
    link=ROOT,
    outer=(TIP,),
    hub=Hub(inertia=0.002, friction=0.01, radius=0.05),
    clamp=RotarySpring(stiffness=900.0, damping=1e-4),
    motor=MOTOR,
    attachments=(Attachment(x=0.1, mass=0.02, inertia=1e-6), Attachment(x=0.5, mass=0.01)),
    payload=Payload(mass=0.1, inertia=3e-5, offset=0.02),
    input="motor_voltage",
)
PLAIN = Arm(link=ROOT, hub=Hub(inertia=0.002), payload=Payload(mass=0.1, inertia=3e-5))


def test_the_inertia_about_the_axis_is_the_integral_over_the_rigid_rig():
    """Each segment by quadrature of rhoA (r + x)^2 + rhoI; bodies at their distances; the rotor through its gear."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    beam, a = 0.0, 0.05
    for link in (ROOT, TIP):
        x = a + link.length * (nodes + 1) / 2
        beam += link.length / 2 * weights @ (link.rhoA * x**2 + link.rhoI)
        a += link.length
    bodies = 0.02 * 0.15**2 + 1e-6 + 0.01 * 0.55**2 + 0.1 * 0.57**2 + 3e-5
    hub = 0.002 + 70**2 * 3.9e-7
    assert RIG.total_inertia == pytest.approx(hub + beam + bodies, rel=16 * 2.3e-16)
    assert RIG.hub_side_inertia == pytest.approx(hub, rel=1e-15)
    assert RIG.carried_inertia == pytest.approx(beam + bodies, rel=1e-15)
    rotary = ROOT.rhoI * 0.3 + TIP.rhoI * 0.2
    for theory in ("shear", "euler-bernoulli"):
        assert RIG.total_inertia - replace(RIG, theory=theory).total_inertia == pytest.approx(rotary, rel=1e-9)
    assert replace(RIG, theory="rayleigh").total_inertia == RIG.total_inertia


@pytest.mark.parametrize("at", [0.0, 0.12, 0.3, 0.41])
def test_the_moment_at_the_gauge_of_the_rigid_rig_is_the_integral_beyond_it(at):
    """Quadrature of rhoA (r + x)(x - at) + rhoI over what is beyond, and the bodies there, for theta_tt = 1."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    expected = 0.01 * 0.55 * (0.5 - at) + 0.1 * 0.57 * (0.52 - at) + 3e-5
    expected += (0.02 * 0.15 * (0.1 - at) + 1e-6) * (at < 0.1)
    for link, first, last in ((ROOT, 0.0, 0.3), (TIP, 0.3, 0.5)):
        a = min(max(first, at), last)
        x = a + (last - a) * (nodes + 1) / 2
        expected += (last - a) / 2 * weights @ (link.rhoA * (0.05 + x) * (x - at) + link.rhoI)
    assert replace(RIG, gauge=Gauge(x=at)).gauged_inertia == pytest.approx(expected, rel=1e-14)


def test_a_link_cut_into_pieces_and_a_radius_of_zero_change_no_sum():
    piece = replace(ROOT, length=ROOT.length / 64)
    cut = replace(PLAIN, link=piece, outer=(piece,) * 63)
    assert cut.length == PLAIN.length
    assert cut.own_mass == PLAIN.own_mass
    assert cut.total_inertia == pytest.approx(PLAIN.total_inertia, rel=1e-15)
    spelt = replace(PLAIN, hub=Hub(inertia=0.002, friction=0, radius=0, stiffness=0), outer=[], attachments=[])
    assert spelt == replace(PLAIN, clamp=RotarySpring(), joint=RotarySpring(stiffness=math.inf)) == PLAIN
    beam = ROOT.rhoA * ROOT.length**3 / 3 + ROOT.rhoI * ROOT.length
    assert PLAIN.total_inertia == 0.002 + beam + 0.1 * ROOT.length**2 + 3e-5  # as it ever was, to the last bit


def test_what_is_read_off_several_segments():
    assert RIG.links == (ROOT, TIP)
    assert RIG.length == 0.5
    assert RIG.damping == 2e-4
    assert system_of(RIG).singular == (-2e4, -5e3)
    assert system_of(replace(RIG, outer=(ROOT, TIP, replace(TIP, damping=0.0)))).singular == (-2e4, -5e3)
    assert system_of(PLAIN.with_numbers(damping=0.0)).singular == ()
    assert RIG.own_mass == pytest.approx(7850 * 0.04 * 0.006 * 0.3 + 2700 * 0.03 * 0.004 * 0.2, rel=1e-15)
    assert RIG.bending_scale == ROOT.EI / 0.5
    assert RIG.shear_cutoff == PLAIN.shear_cutoff  # the inner segment is the deeper one
    assert RIG.shear_cutoff < replace(PLAIN, link=TIP).shear_cutoff


USES = {
    "radius": {"hub": Hub(inertia=0.002, radius=0.01)},
    "friction": {"hub": Hub(inertia=0.002, friction=0.01)},
    "hub spring": {"hub": Hub(inertia=0.002, stiffness=0.01)},
    "clamp": {"clamp": RotarySpring(stiffness=1e4)},
    "joint": {"joint": RotarySpring(stiffness=1e4)},
    "motor": {"motor": MOTOR},
    "attachment": {"attachments": (Attachment(x=0, mass=1e-3),)},
    "offset": {"payload": Payload(mass=0.1, inertia=3e-5, offset=-0.01)},
    "segments": {"outer": (TIP,)},
}


@pytest.mark.parametrize("part", USES)
def test_only_the_paper_s_arm_is_uniform(part):
    assert PLAIN.is_uniform
    assert not replace(PLAIN, **USES[part]).is_uniform


IDLE = replace(PLAIN.with_numbers(damping=0.0), motor=MOTOR)
LOSSES = {
    "a segment": ({"outer": (TIP,)}, False),
    "an undamped segment": ({"outer": (replace(TIP, damping=0.0),)}, True),
    "clamp": ({"clamp": RotarySpring(stiffness=1e4, damping=1e-5)}, False),
    "joint": ({"joint": RotarySpring(stiffness=1e4, damping=1e-5)}, False),
    "springs": ({"clamp": RotarySpring(stiffness=1e4), "joint": RotarySpring(stiffness=1e4)}, True),
    "hub friction": ({"hub": Hub(inertia=1.0, friction=0.1)}, False),
    "hub spring": ({"hub": Hub(inertia=1.0, stiffness=0.1)}, True),
    "rotor friction": ({"motor": replace(MOTOR, rotor_friction=1e-6)}, False),
    "back-EMF": ({"input": "motor_voltage"}, False),
    "no back-EMF": ({"input": "motor_voltage", "motor": replace(MOTOR, back_emf_constant=0.0)}, True),
    "current": ({"input": "motor_current"}, True),
    "angle": ({"input": "hub_angle"}, True),
}


@pytest.mark.parametrize("part", LOSSES)
def test_a_rig_is_undamped_only_without_any_loss(part):
    change, undamped = LOSSES[part]
    assert replace(IDLE, **change).is_undamped is undamped


@pytest.mark.parametrize(
    "change",
    [
        {"motor": MOTOR},
        {"hub": Hub(inertia=0.0, friction=0.1)},
        {"hub": Hub(inertia=0.0, stiffness=0.1)},
        {"hub": Hub(inertia=0.0, radius=0.1)},
        {"motor": replace(MOTOR, rotor_inertia=0.0, rotor_friction=1e-9)},
        {"motor": replace(MOTOR, rotor_inertia=0.0), "input": "motor_voltage"},
    ],
)
def test_a_hub_is_massless_only_where_nothing_resists_its_turning(change):
    pin = PLAIN.with_numbers(hub_inertia=0.0)
    assert pin.has_massless_hub
    assert replace(pin, motor=replace(MOTOR, rotor_inertia=0.0)).has_massless_hub
    assert not replace(pin, **change).has_massless_hub


HELD = {
    "hub.stiffness": {"hub": Hub(inertia=0.002, stiffness=1.0)},
    "attachment.2.stiffness": {"attachments": (Attachment(x=0, mass=1), Attachment(x=0.05, stiffness=1))},
    "attachment.1.rotational_stiffness": {"attachments": (Attachment(x=0, rotational_stiffness=1),)},
    "payload.mass": {"payload": Payload(mass=math.inf, offset=0.01)},
}


@pytest.mark.parametrize("key", HELD)
def test_a_held_rig_does_not_turn_and_the_message_names_the_cause(key):
    must_turn(RIG)
    assert RIG.has_rigid_mode
    held = replace(PLAIN, **HELD[key])
    assert not held.has_rigid_mode
    with pytest.raises(ParameterError, match=f"^{key} = .*no slew"):
        must_turn(held)


def test_a_locked_hub_needs_no_friction_spring_or_motor():
    """`with_numbers` asks for the hub-locked rig of any rig; what stays is what still acts."""
    locked = replace(RIG, hub=replace(RIG.hub, stiffness=0.3)).with_numbers(hub_inertia=math.inf)
    assert locked == replace(RIG, hub=Hub(inertia=math.inf, radius=0.05), motor=None, input="hub_torque")
    assert locked.is_locked
    assert not RIG.is_locked
    assert replace(RIG, input="hub_angle").is_locked
    assert replace(RIG, input="hub_angle").with_numbers(hub_inertia=math.inf).input == "hub_angle"


def test_of_several_segments_none_is_changed_unasked():
    with pytest.raises(ParameterError, match=r"^length = 0\.1: ambiguous, as there are 2 segments"):
        RIG.with_numbers(length=0.1)
    assert {link.damping for link in RIG.with_numbers(damping=0.1).links} == {0.1}
    assert RIG.with_numbers(payload_mass=0.3, hub_inertia=0.1).payload == Payload(mass=0.3, inertia=3e-5, offset=0.02)


def test_the_back_emf_constant_is_the_torque_constant_unless_given():
    assert MOTOR.back_emf_constant == 0.0077
    assert replace(MOTOR, back_emf_constant=0.008).back_emf_constant == 0.008
    assert MOTOR.reflected_inertia == 70**2 * 3.9e-7


def test_a_repr_shows_a_new_part_only_where_it_is_used():
    assert repr(Hub(inertia=0.1)) == "Hub(inertia=0.1)"
    assert repr(Payload()) == "Payload(mass=0.0, inertia=0.0)"
    assert repr(Hub(inertia=0.1, radius=0.02)) == "Hub(inertia=0.1, radius=0.02)"
    plain = f"Arm(link={ROOT!r}, hub=Hub(inertia=0.002), payload=Payload(mass=0.1, inertia=3e-05), name='arm')"
    assert repr(PLAIN) == plain
    assert eval(repr(RIG), vars(tfarm.arm)) == RIG


BAD = {
    "friction": (lambda: Hub(inertia=1, friction=-1), "hub.friction = -1.0: a hub friction is zero or"),
    "radius": (lambda: Hub(inertia=1, radius=math.inf), "hub.radius = inf: a hub radius, from the axis"),
    "hub spring": (lambda: Hub(inertia=1, stiffness=math.inf), "hub.stiffness = inf: .*inertia = inf locks"),
    "locked and rubbing": (lambda: Hub(inertia=math.inf, friction=1), "hub.friction = 1.0: .*locks the hub"),
    "locked and sprung": (lambda: Hub(inertia=math.inf, stiffness=1), "hub.stiffness = 1.0: .*locks the hub"),
    "locked and driven": (
        lambda: replace(PLAIN, hub=Hub(inertia=math.inf), motor=MOTOR),
        "hub.inertia = inf: locks the hub, so the motor has no effect",
    ),
    "no stiffness": (lambda: RotarySpring(stiffness=0), "spring.stiffness = 0.0: .*positive in N m/rad, or inf"),
    "rigid and damped": (lambda: RotarySpring(damping=1e-3), "spring.damping = 0.001: a rigid spring"),
    "no resistance": (lambda: replace(MOTOR, resistance=0), "motor.resistance = 0.0: .*positive"),
    "back-EMF as a text": (lambda: replace(MOTOR, back_emf_constant="Kt"), "motor.back_emf_constant = 'Kt': "),
    "per cent": (lambda: replace(MOTOR, gear_efficiency=75), "motor.gear_efficiency = 75.0: .*entered as 0.75"),
    "nothing attached": (lambda: Attachment(x=0.1), "attachment.x = 0.1: an empty attachment: give a mass"),
    "inside the hub": (lambda: Attachment(x=-0.1, mass=1), "attachment.x = -0.1: .*from the clamp"),
    "beyond the tip": (
        lambda: replace(PLAIN, attachments=(Attachment(x=0.3, mass=1), Attachment(x=0.31, mass=1))),
        r"attachment.2.x = 0.31: is beyond the tip; .* of 0\.3 m",
    ),
    "tiny offset": (lambda: Payload(offset=-1e-300), "payload.offset = -1e-300: beyond any arm"),
    "pin on the axis": (
        lambda: replace(PLAIN, payload=Payload(mass=math.inf, offset=-0.3)),
        "payload.offset = -0.3: puts the pinned centre of mass on the axis",
    ),
    "no motor": (lambda: replace(PLAIN, input="motor_voltage"), "input = 'motor_voltage': there is no motor"),
    "unknown input": (lambda: replace(PLAIN, input="voltage"), "input = 'voltage': did you mean \"motor_v"),
    "unknown theory": (lambda: replace(PLAIN, theory="timoschenko"), 'theory = .*did you mean "timoshenko"'),
    "no text": (lambda: replace(PLAIN, theory=None), "theory = None: known are: timoshenko, shear"),
    "no segments": (lambda: replace(PLAIN, outer=TIP), "outer = Link.*give a tuple of Link records"),
    "too many": (lambda: replace(PLAIN, outer=(TIP,) * 64), "outer = 64: at most 63"),
    "too much": (lambda: replace(PLAIN, attachments=(Attachment(x=0, mass=1),) * 65), "attachments = 65: .*at most 64"),
}


@pytest.mark.parametrize("what", BAD)
def test_what_is_no_rig_is_refused_in_one_line(what):
    build, message = BAD[what]
    assert re.match(message, str(refusal(build)))


def test_a_sliver_is_a_segment_though_it_is_no_arm():
    sliver = replace(ROOT, length=1e-14 * 0.3)
    assert replace(PLAIN, outer=(sliver,)).links[1] == sliver
    with pytest.raises(ParameterError, match=r"^link\.length = .*is no beam"):
        replace(PLAIN, link=sliver)
