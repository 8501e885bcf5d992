"""Branches between their nodes, their crossings without them, and loops that are one written in two ways."""

import numpy as np
import pytest

import tfarm
from tests.loop.test_starts import LAWS
from tfarm import Law
from tfarm.exact.characteristic import loop_parts
from tfarm.loop.loop import Loop
from tfarm.loop.nyquist import upper_contour

LAB, MOTOR = tfarm.load("sasaki2012-lab"), tfarm.load("quanser-flexlink")


# ------------------------------------------------------------ crossings


# ------------------------------------------------------------ one loop, written twice


def test_the_contour_ends_at_the_band_wherever_the_law_has_poles():
    """One below the band has points all around it, one above it has none; and at -1 +- 1/2 of its distance too."""
    band = 300.0
    for ringing, is_near in ((0.6 * band, True), (1.004 * band, False)):
        damped = 0.01 * ringing
        den = [1.0, 2 * damped, damped**2 + ringing**2]
        loop = Loop(LAB, Law({"hub_rate": ([ringing**2], den)}))
        s, is_arc = upper_contour(loop, np.array([0.0]), band, np.array([-1 + 20j]))
        w = s.imag[~is_arc]
        assert w.max() == pytest.approx(band, rel=1e-12)
        assert (np.diff(s.imag) >= 0).all()
        near = np.sort(w[abs(w - ringing) <= 4 * damped])
        if is_near:
            assert np.diff(near).max() < 0.5 * damped
            assert near[-1] > ringing + 3.5 * damped
            assert near[0] < ringing - 3.5 * damped


@pytest.mark.parametrize("name", LAWS)
def test_the_function_of_a_law_is_the_rig_s_drive_times_one_plus_l(name):
    """D s^n/(q drive) is 1 + L, up to the time that waves take and one factor."""
    loop = Loop(LAB, LAWS[name])
    s = np.array([0.3 + 2j, -5 + 40j, 2.0 + 9j])
    at = loop.function(s)
    drive, _, scale = loop_parts(loop.k, s)
    whole = np.prod([s[:, None] - loop.law.poles], axis=2)[0]
    mine = at.value * np.exp(at.scale) * s**loop.zeros_at_origin * np.exp(loop.delay_of_waves * s)
    ratio = mine / (drive * np.exp(scale) * whole * (1 + loop.loop_function(s)))
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-8)
