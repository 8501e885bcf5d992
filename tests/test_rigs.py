"""Random rigs are legal, various, and as wide as stated; a static force is in the oracle what statics has."""

import math

import numpy as np
import pytest

from tests.rigs import MOST_SEGMENTS, rig, some_rig
from tests.transition import response

EPS = np.finfo(float).eps
FEATURES = {
    "radius": lambda arm: arm.hub.radius > 0,
    "hub friction": lambda arm: arm.hub.friction > 0,
    "hub spring": lambda arm: arm.hub.stiffness > 0,
    "massless hub": lambda arm: arm.hub.inertia == 0,
    "locked hub": lambda arm: math.isinf(arm.hub.inertia),
    "clamp": lambda arm: not arm.clamp.is_rigid,
    "joint dashpot": lambda arm: arm.joint.damping > 0,
    "voltage": lambda arm: arm.input == "motor_voltage",
    "current": lambda arm: arm.input == "motor_current",
    "angle": lambda arm: arm.input == "hub_angle",
    "inductance": lambda arm: arm.motor is not None and arm.motor.inductance > 0,
    "attachments": lambda arm: len(arm.attachments) > 1,
    "ground": lambda arm: any(each.is_held for each in arm.attachments),
    "at a joint": lambda arm: {each.x for each in arm.attachments} & {link.length for link in arm.links[:-1]},
    "offset": lambda arm: arm.payload.offset > 0,
    "offset inwards": lambda arm: arm.payload.offset < 0,
    "pinned": lambda arm: math.isinf(arm.payload.mass) and arm.payload.offset != 0,
    "one segment": lambda arm: not arm.outer,
    "six segments": lambda arm: len(arm.links) == MOST_SEGMENTS,
    "undamped": lambda arm: arm.is_undamped,
    "damped": lambda arm: arm.damping > 0,
    "rigid mode": lambda arm: arm.has_rigid_mode,
    "plain": lambda arm: arm.is_locked and not arm.attachments,
}


def test_every_feature_comes_in_many_rigs():
    rigs = [some_rig(np.random.default_rng(seed)) for seed in range(400)]
    for name, has in FEATURES.items():
        assert 4 <= sum(map(bool, map(has, rigs))) <= 396, name


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
