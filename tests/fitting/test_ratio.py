"""The exact response from one signal to another: as a transfer function where it is one, else by its parts."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.errors import ParameterError
from tfarm.fitting.overlay import Ratio

BARE, LAB, RIG = tfarm.load("sasaki2012"), tfarm.load("sasaki2012-lab"), tfarm.load("tests/rigs/bench-rig.toml")
S = 1j * np.array([3.0, 40.0, 150.0, 300.0]) + 0.2


def test_over_the_measured_hub_angle_it_is_that_of_the_held_hub():
    """The angle as input and the angle as one of two signals: two ways to the same function, poles and zeros."""
    direct = Ratio(RIG, "tip_acceleration", "hub_angle")
    above, below = (tfarm.transfer(RIG, each) for each in ("tip_acceleration", "hub_angle"))
    assert direct(S) == pytest.approx(above(S) / below(S), rel=1e-12)
    found = direct.roots(300.0)
    held = below.zeros(up_to=300.0).values
    held = held[(held != 0) & (held.imag >= 0)]
    assert np.sort_complex(found.poles) == pytest.approx(np.sort_complex(held), rel=1e-11)
    assert found.at_zero == 2


def test_of_two_signals_it_has_their_zeros_and_none_of_the_arms_poles():
    """On a circle about each root the ratio turns once, and about the arm's own poles not at all."""
    ratio = Ratio(LAB, "moment@0.3", "hub_rate")
    found = ratio.roots(250.0)
    everything = np.r_[found.poles, found.zeros, found.poles.conj(), found.zeros.conj(), 0.0]

    def turns(centre):
        far = min((abs(centre - each) for each in everything if each != centre), default=1.0)
        circle = centre + 0.3 * far * np.exp(2j * np.pi * np.arange(65) / 64)
        return round(np.unwrap(np.angle(ratio(circle)))[[0, -1]] @ [-1, 1] / (2 * np.pi))

    assert {turns(pole) for pole in found.poles} <= {-1}
    assert {turns(zero) for zero in found.zeros} == {1}
    own = tfarm.transfer(LAB, "hub_angle").poles(up_to=250.0).values
    assert {turns(pole) for pole in own[own != 0]} == {0}
    assert found.common.size == 0
    low = abs(ratio(np.array([1e-3j, 2e-3j])))
    assert math.log2(low[1] / low[0]) == pytest.approx(found.at_zero, abs=1e-4)


def test_what_both_signals_share_cancels():
    """Acceleration over displacement is s^2: all zeros are common."""
    ratio = Ratio(BARE, "tip_acceleration", "tip_displacement")
    found = ratio.roots(250.0)
    assert (found.poles.size, found.zeros.size, found.at_zero) == (0, 0, 2)
    assert found.common.size > 0
    assert ratio(S) == pytest.approx(S**2, rel=1e-12)


def test_residues_are_those_by_the_derivative():
    """At a simple zero p of what is below, r = T_out(p)/T_in'(p)."""
    above, below = tfarm.transfer(LAB, "tip_acceleration"), tfarm.transfer(LAB, "hub_angle")
    ratio = Ratio(LAB, "tip_acceleration", "hub_angle")
    found = ratio.roots(600.0)
    for pole in found.poles[found.poles.imag > 0].tolist():
        assert ratio.residue(pole, found) == pytest.approx(above(pole) / below.derivative(pole), rel=1e-8)


@pytest.mark.parametrize(
    ("arm", "output", "input", "message"),
    [
        (LAB, "tip_acceleration", "tip_acceleration", "a signal over itself is 1"),
        (LAB, "strain@0.05", "hub_rate", "link.section.shape"),
        (LAB, "moment", "hub_rate", "moment.x is missing"),
        (LAB.having(hub_inertia=math.inf), "root_moment", "hub_torque", "drives no locked hub"),
        (LAB, "moment@9", "hub_rate", "a point of the arm lies between"),
        (LAB, "root_moment", "motor_voltage", "motor"),
        (LAB.having(payload_mass=math.inf), "root_moment", "tip_acceleration", "it is held"),
    ],
)
def test_signals_that_the_arm_does_not_have_are_refused(arm, output, input, message):
    with pytest.raises(ParameterError, match=message):
        Ratio(arm, output, input)(S)


def test_a_current_that_is_measured_is_the_current_that_drives():
    rig = replace(tfarm.load("quanser-flexlink"), input="motor_voltage")
    above, below = (tfarm.transfer(rig, each) for each in ("hub_rate", "motor_current"))
    assert Ratio(rig, "hub_rate", "motor_current")(S) == pytest.approx(above(S) / below(S), rel=1e-11)
