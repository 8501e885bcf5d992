"""The plain product of transition matrices against closed forms, the paper's arm, and what nature guarantees."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.strategies import some_arm
from tests.transition import response
from tfarm import Section
from tfarm.arm import Attachment, Link, Motor, RotarySpring

NAMES = ("hub_angle", "hub_rate", "root_moment", "root_shear", "tip_displacement", "tip_deflection", "tip_acceleration")
EPS = np.finfo(float).eps


def link(length, depth, damping=0.0, E=7e10):
    section = Section.rectangle(width=0.04, depth=depth)
    return Link.isotropic(
        length=length, density=2700.0, youngs_modulus=E, poissons_ratio=0.33, section=section, damping=damping
    )


def rig(**changes):
    """Three segments with everything that a rig can have, lengths and places of few bits."""
    arm = tfarm.load("sasaki2012")
    rig = replace(
        arm,
        link=link(0.25, 0.005, 1e-4),
        outer=(link(0.5, 0.003, 2e-4), link(0.25, 0.02)),
        hub=replace(arm.hub, radius=0.0625, friction=0.1, stiffness=0.5),
        payload=replace(arm.payload, mass=0.2, inertia=1e-3, offset=0.03125),
        clamp=RotarySpring(stiffness=300.0, damping=1e-3),
        joint=RotarySpring(stiffness=200.0, damping=2e-3),
        motor=Motor(
            resistance=2.0,
            torque_constant=0.05,
            back_emf_constant=0.06,
            inductance=0.01,
            gear_ratio=14.0,
            rotor_inertia=1e-5,
            rotor_friction=1e-6,
            gear_efficiency=0.9,
        ),
        attachments=(
            Attachment(x=0.125, mass=0.03, inertia=1e-5),
            Attachment(x=0.25, mass=0.1, inertia=1e-4, stiffness=100.0, rotational_stiffness=2.0),
        ),
    )
    return replace(rig, **changes)


def test_the_papers_arm():
    """One link and nothing else: the same as the closed form in balls, to the last bit but one."""
    rng = np.random.default_rng(11)
    for _ in range(12):
        arm = some_arm(rng)
        s = 10 ** rng.uniform(-3, 4) * np.exp(1j * rng.uniform(0, math.pi / 2))
        exact = tfarm.transfer(arm, NAMES, method="balls")(s)
        found = response(arm, s, NAMES)
        for value, name in zip(exact, NAMES, strict=True):
            assert abs(complex(found[name]) - value) <= 2 * EPS * abs(value) + 1e-60


def test_static_force_on_the_tip():
    """W(L) of a unit force: beam in bending and shear, clamp, and hub spring and joint with the arm's whole lever."""
    arm = rig(outer=(), attachments=(), theory="timoshenko")
    beam, hub = arm.link, arm.hub
    lever = arm.length + hub.radius
    wanted = (
        arm.length**3 / (3 * beam.EI)
        + arm.length / beam.kGA
        + arm.length**2 / arm.clamp.stiffness
        + lever**2 * (1 / arm.joint.stiffness + 1 / hub.stiffness)
    )
    found = response(arm, 0, ["tip_displacement", "root_moment", "root_shear"], input=("force", arm.length))
    assert complex(found["tip_displacement"]) == pytest.approx(wanted, rel=8 * EPS)
    assert complex(found["root_moment"]) == pytest.approx(arm.length, rel=8 * EPS)
    assert complex(found["root_shear"]) == pytest.approx(1.0, rel=8 * EPS)


def test_the_motor_is_a_filter_and_a_damper_around_the_torque():
    """theta/v = g G/(R + L_a s + g N Ke s G) of theta/u = G and g = eta N Kt, and i = u/g."""
    s, arm = -3 + 200j, rig()
    motor, G = arm.motor, response(arm, s, ["hub_angle"])["hub_angle"]
    g, N = motor.gear_efficiency * motor.gear_ratio * motor.torque_constant, motor.gear_ratio
    coil = motor.resistance + motor.inductance * s
    voltage = response(arm, s, ["hub_angle", "motor_current"], input="motor_voltage")
    current = response(arm, s, ["hub_angle"], input="motor_current")["hub_angle"]
    wanted = g * G / (coil + g * N * motor.back_emf_constant * s * G)
    assert complex(voltage["hub_angle"]) == pytest.approx(complex(wanted), rel=8 * EPS)
    assert complex(voltage["motor_current"]) == pytest.approx(complex(wanted / G / g), rel=8 * EPS)
    assert complex(current) == pytest.approx(complex(g * G), rel=8 * EPS)


def test_sides_of_a_joint_and_of_a_mass():
    """At x = 0.25 a stiffer segment ends and a mass sits: M and Q jump by inertia and mass, the gauge also by C."""
    arm, s, at = rig(), 3 + 400j, 0.25
    each = arm.attachments[1]
    quantities = ("moment", "shear", "gauge", "displacement", "rotation")
    found = response(arm, s, [(name, at, side) for name in quantities for side in ("inner", "outer")])
    jump = {name: complex(found[name, at, "outer"] - found[name, at, "inner"]) for name in quantities}
    W, Psi = complex(found["displacement", at, "outer"]), complex(found["rotation", at, "outer"])
    assert jump["displacement"] == jump["rotation"] == 0
    assert jump["shear"] == pytest.approx((each.mass * s**2 + each.stiffness) * W, rel=64 * EPS)
    assert jump["moment"] == pytest.approx((each.inertia * s**2 + each.rotational_stiffness) * Psi, rel=64 * EPS)
    for side, segment in zip(("inner", "outer"), arm.links, strict=False):
        felt = complex(found["moment", at, side]) / (1 + segment.damping * s)
        assert complex(found["gauge", at, side]) == pytest.approx(felt, rel=8 * EPS)
