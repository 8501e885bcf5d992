"""Laws that take off exactly what holds a rig at rest: a pole is at s = 0, which is marginal and no refusal."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm import Hub, HubFeedback, Law, load

LAB = load("sasaki2012-lab")
SPRING = 3.0  # N m/rad
HELD = replace(LAB, hub=Hub(inertia=0.1, stiffness=SPRING, friction=0.1))
PUSHES = Law({"hub_angle": ([-SPRING], [1e-2, 1.0])})


@pytest.mark.parametrize("law", [HubFeedback(Kp=-SPRING), PUSHES])
def test_the_verdict_is_marginal_and_its_pole_listed_at_0(law):
    assert tfarm.margins(HELD, law).stability.verdict == "marginal"
    poles = tfarm.closed_loop_poles(HELD, law, 3)
    assert (poles.values == 0).sum() == 1
    assert poles.unstable == 0


@pytest.mark.parametrize(("more", "verdict"), [(1e-6, "unstable"), (-1e-6, "stable")])
def test_beside_it_they_are_told_apart(more, verdict):
    for law in (HubFeedback(Kp=-SPRING * (1 + more)), PUSHES.having("gain", 1 + more)):
        assert tfarm.margins(HELD, law).stability.verdict == verdict


def test_without_losses_two_poles_meet_there():
    arm = replace(LAB.elastic, hub=Hub(inertia=0.1, stiffness=SPRING))
    poles = tfarm.closed_loop_poles(arm, HubFeedback(Kp=-SPRING), 4)
    assert (poles.values == 0).sum() == 2
    assert tfarm.margins(arm, HubFeedback(Kp=-SPRING)).stability.verdict == "marginal"


def test_a_map_may_have_it_among_its_points():
    x, y = np.linspace(0, 2, 5), np.array([0.5, 0.8, 1.0])
    found = tfarm.map(HELD, x, y, law=PUSHES, vary=("gain", "hub_angle"))
    product = np.outer(y, x)
    clear = abs(product - 1) > 1e-9
    np.testing.assert_array_equal(found.unstable[clear], (product > 1)[clear])


def test_a_sampled_loop_beside_it_bears_a_delay_that_changes_nothing_at_rest():
    assert tfarm.sampled(HELD, PUSHES.having("gain", 1 - 1e-11)).delay_margin.is_bound
    for less in (1e-13, 1e-14, 0.0):  # rounding decides on which side of the circle it is, and is no error
        assert tfarm.sampled(HELD, PUSHES.having("gain", 1 - less)).delay_margin.samples >= 0
