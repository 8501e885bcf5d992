"""Samples of the loop's parts along the axis, from which a page computes any loop, and modes that no gain reaches."""

import numpy as np
import pytest

import tfarm
from tfarm.errors import ConvergenceError
from tfarm.loop import lossless
from tfarm.loop.panels import CHEBYSHEV, loop_panels
from tfarm.loop.plant import HubLoop


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
        np.testing.assert_allclose(L, HubLoop(arm, law).loop_function(s), rtol=1e-9)


def test_the_mode_that_the_hub_does_not_feel_is_named(monkeypatch):
    """Its hub's moment vanishes, as where a rig is symmetric: here the second mode's is taken away."""
    arm, parts = tfarm.load("sasaki2012"), lossless.line_parts

    def without_the_second(k, line, s):
        drive, M = parts(k, line, s)
        return np.where(np.arange(s.size) == 1, 0.0, drive), M

    monkeypatch.setattr(lossless, "line_parts", without_the_second)
    lossless.locked_edges.cache_clear()
    second = tfarm.modes(arm.having(hub_inertia=np.inf), 2).natural_frequency[1]
    with pytest.raises(ConvergenceError, match=f"{second:.6g} rad/s: no gain decides"):
        lossless.locked_edges(arm)
    monkeypatch.undo()
    lossless.locked_edges.cache_clear()
    assert len(lossless.locked_edges(arm)) == lossless.MOST_BAND_MODES
