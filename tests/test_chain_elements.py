"""Finite elements of rigs against transition matrices, and against the exact frequencies of the paper's arm."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.chain_elements import frequency_response, natural_frequencies
from tests.shared import thinned
from tests.strategies import some_arm
from tests.test_transition import NAMES, rig
from tests.transition import determinant, response
from tfarm.arm import RotarySpring


def lossless(arm):
    """The rig with nothing that dissipates."""
    motor = None if arm.motor is None else replace(arm.motor, rotor_friction=0.0)
    springs = {name: RotarySpring(stiffness=getattr(arm, name).stiffness) for name in ("clamp", "joint")}
    links = [replace(link, damping=0.0) for link in arm.links]
    drive = "hub_angle" if arm.input == "hub_angle" else "hub_torque"
    hub = replace(arm.hub, friction=0.0)
    return replace(arm, link=links[0], outer=tuple(links[1:]), hub=hub, motor=motor, input=drive, **springs)


def test_the_frequencies_of_the_papers_arm():
    rng = np.random.default_rng(12)
    for _ in range(6):
        arm = some_arm(rng)
        exact = tfarm.modes(arm, 15).natural_frequency[arm.has_rigid_mode :][:14]
        assert natural_frequencies(arm, exact.size) == pytest.approx(exact, rel=1e-9)


WANTED = [*NAMES, "link_angle", "payload_displacement"]
WANTED += [(name, 0.6) for name in ("gauge", "moment", "shear", "rotation", "twist", "curvature", "velocity")]


@pytest.mark.parametrize("drive", ["hub_torque", "motor_current", "motor_voltage", "hub_angle"])
@pytest.mark.parametrize("load", thinned([(None,), (("force", 0.4),), (("moment_pair", 0.1, 0.7),)], 3))
def test_responses_are_those_of_the_transition_matrices(drive, load):
    arm = rig(input=drive)
    for s in (130j, -4 + 900j):
        exact = np.array([complex(value) for value in response(arm, s, WANTED, 30, input=load).values()])
        assert frequency_response(arm, s, WANTED, input=load) == pytest.approx(exact, rel=1e-7, abs=1e-20)


def test_pinned_and_locked_payloads():
    """An infinite mass pins its centre beyond the tip, an infinite inertia forbids the tip to turn."""
    for changes in ({"mass": np.inf}, {"inertia": np.inf}, {"mass": np.inf, "inertia": np.inf}):
        arm = lossless(rig())
        arm = replace(arm, payload=replace(arm.payload, **changes))
        for omega in natural_frequencies(arm, 4):
            low, high = (determinant(arm, 1j * omega * (1 + shift), 30).real for shift in (-1e-10, 1e-10))
            assert low * high < 0
