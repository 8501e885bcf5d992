"""Shapes of damped modes where the hub is held, and where it is so heavy that it nearly is."""

import math

import numpy as np
import pytest

import tfarm


def shaped(inertia, name):
    """That quantity of the lab arm's first two flexible modes at seven places, with a hub of that inertia."""
    arm = tfarm.load("sasaki2012-lab").having(hub_inertia=inertia)
    damped = tfarm.damped_modes(tfarm.modes(arm, count=2))
    return getattr(damped, name)(np.linspace(0.0, arm.link.length, 7))


@pytest.mark.parametrize("name", ["shape", "rotation", "moment"])
def test_a_hub_that_is_held_is_the_limit_of_a_heavy_one(name):
    """They differ by the arm's inertia over the hub's: nothing of a shape is lost where the hub hardly turns."""
    held = shaped(math.inf, name)
    size = abs(held).max()
    assert size > 0.1
    for inertia in (1e9, 1e12):
        np.testing.assert_allclose(shaped(inertia, name), held, rtol=0, atol=(3.0 / inertia + 1e-14) * size)
