"""Loci of laws whose real pole passes through 0, where Newton's method has no digits: the static stiffness vanishes."""

from dataclasses import replace

import pytest

from tfarm import Hub, Law, load, locus

LAB = load("sasaki2012-lab")


@pytest.mark.parametrize("lag", [1e-3, 0.1])
@pytest.mark.parametrize(("stiffness", "friction"), [(1.0, 0.1), (1.0, 10.0), (100.0, 0.1)])
def test_the_law_pushes_as_hard_as_the_spring_holds(stiffness, friction, lag):
    arm = replace(LAB, hub=Hub(inertia=0.1, stiffness=stiffness, friction=friction))
    law = Law({"hub_angle": ([-1.0], [lag, 1.0])})
    (crossing,) = locus(arm, law, "gain", 0.01 * stiffness, 7.3 * stiffness, 9, 3).crossings
    assert (crossing.omega, crossing.direction) == (0.0, "unstable")
    assert crossing.gain == pytest.approx(stiffness, rel=1e-12)
