"""Starts of Newton's method for damped eigenvalues: exact where the wave numbers are."""

import math

import numpy as np
import pytest

import tfarm
from tfarm.exact.system import system_of
from tfarm.spectrum.naming import function_of
from tfarm.spectrum.starts import damped_starts


@pytest.mark.parametrize("C", [1e-5, 1e-3, 0.02])
@pytest.mark.parametrize("name", ["sasaki2012", "stocky-steel"])
def test_on_two_pins_they_are_the_eigenvalues(name, C):
    """There mode n has k = n pi/L whatever the damping; below the cut-off and above, bending and shear, also real ones.

    The oracle is the characteristic function, in which k does not occur: a step of Newton's method is rounding.
    """
    arm = tfarm.load(name).having(damping=C, hub_inertia=0.0, payload_mass=math.inf, payload_inertia=0.0)
    omega = tfarm.modes(arm, 6).natural_frequency[1:]
    starts = damped_starts(arm, omega)[2 * omega.size :]  # behind those of no damping
    starts = starts[abs(1 + C * starts) > 0.2]
    at = function_of(system_of(arm))(starts)
    assert starts.size >= omega.size
    assert (abs(at.value / at.slope) < 1e-7 * abs(starts)).all()


def test_without_damping_they_are_the_frequencies():
    omega = np.array([3.0, 40.0])
    arm = tfarm.load("sasaki2012")
    np.testing.assert_array_equal(damped_starts(arm, omega), [3j, 40j, -3j, -40j])
