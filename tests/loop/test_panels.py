"""Samples of the loop's parts along the axis, from which a page computes any loop, and modes that no gain reaches."""

import numpy as np
import pytest

import tfarm
from tfarm.loop.loop import Loop
from tfarm.loop.panels import CHEBYSHEV, loop_panels


@pytest.mark.parametrize("name", ["sasaki2012-lab", "quanser-flexlink"])
def test_samples_are_those_of_the_loop_function_at_chebyshevs_points(name):
    """L = (Kp theta + K1 s theta + K2 m)/d of each sample, each panel's parts up to one factor."""
    arm = tfarm.load(name)
    law = tfarm.default_gains(arm).having("Kp", 0.3)
    found = loop_panels(arm, 400.0)
    assert found.high[-1] == 400.0
    np.testing.assert_array_equal(found.low[1:], found.high[:-1])
    for low, high, (d, theta, m) in zip(found.low, found.high, np.moveaxis(found.values, 1, 0), strict=True):
        s = 1j * ((low + high) / 2 + (high - low) / 2 * CHEBYSHEV)
        s, keep = s[s.imag > 0], s.imag > 0
        L = ((law.Kp + law.K1 * s) * theta[keep] + law.K2 * m[keep] * s**2) / (d[keep] * s**found.order)
        np.testing.assert_allclose(L, Loop(arm, law).loop_function(s), rtol=1e-9)
