"""The response with rigid links: closed forms of rigid bodies, and the limit of ever stiffer links.

    python -m tests.response.test_rigid SIZE SEED

Random rigs with links 1e6, 1e8 and 1e10 times as stiff, each output at one frequency and place.  Where these converge,
each step a hundredth of the one before, the rigid response is to be within two steps more of the last (and 1e-9 of it).
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests import survey
from tests.chain_elements import reached
from tests.rigs import some_rig
from tests.survey import Finding, numbered, tally
from tfarm.exact.outputs import OUTPUTS
from tfarm.exact.rigid import rigid_response

FLEX, LAB = tfarm.load("quanser-flexlink"), tfarm.load("sasaki2012-lab")


def test_behind_a_motor_with_friction_it_is_the_rigid_body_on_that_motor():
    """(L_a s + R) i = v - N Ke s theta,  (J s^2 + b s) theta = eta N Kt i,  w(L) = L theta."""
    data, motor = tfarm.bode(FLEX, "tip_displacement"), FLEX.motor
    s, gain = 1j * data.omega, motor.gear_efficiency * motor.gear_ratio * motor.torque_constant
    circuit = motor.inductance * s + motor.resistance
    back_emf = gain * motor.gear_ratio * motor.back_emf_constant * s
    theta = gain / (circuit * (FLEX.total_inertia * s**2 + FLEX.hub.friction * s) + back_emf)
    np.testing.assert_allclose(data.rigid, FLEX.length * theta, rtol=1e-12)
    assert abs(data.rigid[0]) > 100 * abs(data.rigid[-1])
    np.testing.assert_allclose(rigid_response(FLEX, OUTPUTS["hub_rate"], s), s * theta, rtol=1e-12)


@pytest.mark.parametrize("output", ["tip_deflection", "tip_rotation", "strain"])
def test_a_rigid_link_in_a_rigid_clamp_does_not_bend(output):
    arm = tfarm.load("stocky-steel")
    data = tfarm.bode(arm, output, (1.0, 1e4), x=0.3 * arm.length if output == "strain" else None)
    assert not data.rigid.any()


def test_it_is_the_limit_of_ever_stiffer_links_on_random_rigs():
    """`python -m tests.response.test_rigid 500` for more."""
    _, figures, wrong = tally(numbered(rigs), 12, 34)
    assert wrong == 0
    assert sum(figures["responses"]) > 150


STIFFER = (1e6, 1e8, 1e10)
NEXT = 0.02  # of the last step: the next ones
ROUNDING = 1e-9  # of an output: of the stiffest links, whose waves are slow


def departures(arm, omega, x):
    """|rigid - limit| of each output, over what the limit is known to."""
    found, s = {}, np.array([1j * omega])
    for each in OUTPUTS.values():
        if each.quantity == "strain" or (each.quantity == "current" and (arm.motor is None or arm.is_locked)):
            continue
        at = x if each.place == "x" else None
        rigid = rigid_response(arm, each, s, 0.0 if at is None else at / arm.length)[0]
        values = [tfarm.transfer(stiffened(arm, factor), each, x=at)(s)[0] for factor in STIFFER]
        size, (first, last) = abs(values[-1]), abs(np.diff(values))
        if last <= NEXT * first + ROUNDING * size:
            found[each.name] = abs(rigid - values[-1]) / (NEXT * last + ROUNDING * abs(rigid) + 1e-300)
    return found


def contradicts(arm):
    """Whether an infinite payload and the hub hold the rigid link in two ways, so that it has no response."""
    infinite = math.isinf(arm.payload.mass), math.isinf(arm.payload.inertia)
    return all(infinite) or (any(infinite) and arm.is_locked and arm.clamp.is_rigid and arm.joint.is_rigid)


def stiffened(arm, factor):
    """The arm with E and G of each link times `factor`."""
    first, *outer = (
        replace(link, youngs_modulus=factor * link.youngs_modulus, shear_modulus=factor * link.shear_modulus)
        for link in arm.links
    )
    return replace(arm, link=first, outer=tuple(outer))


def rigs(rng):
    """The finding on the outputs of one rig at one frequency and place."""
    arm = some_rig(rng)
    omega, x = reached(arm, 10 ** rng.uniform(-3, 0.5)), float(rng.uniform(0, arm.length))
    found = {} if contradicts(arm) else departures(arm, omega, x)
    wrong = {name: value for name, value in found.items() if not value <= 1.0}
    words = f"{wrong} at {omega!r} rad/s, x = {x!r} m\n    {arm}" if wrong else ""
    outcome = "wrong" if wrong else "right" if found else "held twice over"
    return Finding(outcome, words, bool(wrong), {"responses": len(found)})


if __name__ == "__main__":
    survey.main(numbered(rigs), seed=0)
