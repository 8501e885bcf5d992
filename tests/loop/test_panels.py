"""Samples of the loop's parts along the axis, from which a page computes any loop, and modes that no gain reaches."""

from __future__ import annotations

import math

import numpy as np
import pytest

import tfarm
from tfarm.loop.panels import Positions, positions, sensed_places


@pytest.mark.parametrize(("sensor", "share"), [("displacement", 0.6), ("moment", 0.3)])
def test_zeros_are_those_of_the_complete_search(sensor, share):
    """`zeros` counts them by the winding number around a box; slow real ones to the left are not looked for here."""
    arm = tfarm.load("sasaki2012-lab")
    x = share * arm.length
    found = positions(arm, sensor, np.array([x]), 4)
    all_zeros = tfarm.transfer(arm, sensor, x=x).zeros(up_to=found.band).values
    wanted = all_zeros[(all_zeros.imag > 1e-6) | ((all_zeros.real > 1e-6) & (all_zeros.real < found.band))]
    here = found.zeros[0]
    assert len(here) == len(wanted) > 2
    for s in wanted:
        assert abs(here - s).min() < 1e-7 * abs(s)


@pytest.mark.parametrize("C", [0.01, 0.1])
def test_the_zeros_of_a_heavily_damped_arm_are_those_of_the_complete_search(C):
    """-1/C lies nearer to s = 0 than the first mode: every real zero to the right is found, and no other is told."""
    arm = tfarm.load("sasaki2012-lab").having(damping=C)
    for sensor, share in (("displacement", 1.0), ("moment", 0.3)):
        x = share * arm.length
        found = positions(arm, sensor, np.array([x]), 4)
        all_zeros = tfarm.transfer(arm, sensor, x=x).zeros(up_to=found.band).values
        assert all(abs(all_zeros - s).min() < 1e-7 * abs(s) for s in found.zeros[0])
        real = all_zeros[(abs(all_zeros.imag) < 1e-6) & (all_zeros.real > 1e-6)]
        assert len(real) == (sensor == "displacement")
        assert all(abs(found.zeros[0] - s).min() < 1e-7 * abs(s) for s in real)


@pytest.mark.parametrize("name", ["sasaki2012", "quanser-2dsfl"])
def test_a_sensor_at_a_node_has_the_mode_for_a_zero_and_sees_none_of_it(name):
    arm = tfarm.load(name)
    modes = tfarm.modes(arm, count=3)
    node = modes.nodes[-1][0]
    found = positions(arm, "displacement", np.array([node, arm.length]), 3)
    assert found.participation[2, 0] == pytest.approx(0.0, abs=1e-9)
    assert abs(found.zeros[0] - 1j * modes.natural_frequency[-1]).min() < 1e-7 * modes.natural_frequency[-1]


def test_participation_is_the_shape_over_its_largest():
    arm = tfarm.load("stocky-steel")
    x = np.linspace(0.0, arm.length, 5)[1:]
    found, modes = positions(arm, "displacement", x, 2), tfarm.modes(arm, count=2)
    w = modes.shape(x)[1:]
    assert found.participation == pytest.approx(w / abs(w).max(axis=1)[:, None])
    assert found.natural_frequency == pytest.approx(modes.natural_frequency[1:])


def test_of_a_zero_what_is_no_more_than_its_error_is_left_out():
    zeros = np.array([3.0 + 4e-9j, 1e-9 + 5j, -2.0 + 2j])
    found = Positions(np.array([0.5]), 10.0, np.ones(1), np.ones((1, 1)), (zeros, zeros[:0]))
    assert [each.tolist() for each in found.known_zeros] == [[3.0, 5j, -2.0 + 2j], []]


def test_an_end_that_no_mode_moves_is_no_place_for_a_sensor():
    """The clamp of a hub without radius does not move, nor does the tip without payload bend."""
    arm = tfarm.load("sasaki2012").having(payload_mass=0.0, payload_inertia=0.0)
    x = np.linspace(0.0, arm.length, 5)
    assert sensed_places(arm, "displacement", x, 3).tolist() == x[1:].tolist()
    assert sensed_places(arm, "moment", x, 3).tolist() == x[:-1].tolist()


def test_an_arm_that_cannot_turn_has_no_such_zeros():
    with pytest.raises(tfarm.ParameterError):
        positions(tfarm.load("sasaki2012").having(hub_inertia=math.inf), "moment", np.array([0.1]), 2)
