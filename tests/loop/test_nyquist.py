"""Nyquist's contour: where the loop function has a pole at 0, told by its growth towards it."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.test_starts import LAWS
from tfarm import Hub, HubFeedback, Law, Payload
from tfarm.exact.characteristic import loop_parts
from tfarm.loop.loop import Loop
from tfarm.loop.nyquist import compressed, poles_on_axis, upper_contour

LAB = tfarm.load("sasaki2012-lab")
ARMS = {
    "free": LAB,
    "held by a spring at the hub": replace(LAB, hub=Hub(inertia=0.1, stiffness=3.0)),
    "held at the payload": replace(LAB, payload=Payload(mass=np.inf)),
}


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("law", [{"K1": 0.3}, {"Kp": 2.0}, {"K1": 0.3, "K2": 0.3}, {"K2": 0.3}])
def test_the_loop_function_has_a_pole_at_rest_where_it_grows_without_bound(name, law):
    """Nearer to 0 by a factor of ten L is ten or a hundred times as large there, and nowhere else."""
    loop = Loop(ARMS[name], HubFeedback(**law))
    near = abs(loop.loop_function(1j * 1e-4 * np.array([10.0, 1.0])))
    grows = bool(near[1] > 5 * near[0])
    assert (0.0 in poles_on_axis(loop, 1000.0)) == grows


def test_the_plane_is_drawn_in_a_disc():
    """r at r/(1 + r), its direction kept: back again r/(1 - r); what is infinite at 1."""
    L = np.array([0.0, 0.3 - 0.4j, -1.0, 7j, -1e8 + 1e8j])
    drawn = compressed(L)
    assert (abs(drawn) < 1).all()
    np.testing.assert_allclose(drawn / (1 - abs(drawn)), L, rtol=1e-7)
    assert compressed(np.array([complex(np.inf, 3.0)])).tolist() == [1.0]


@pytest.mark.parametrize("w", [0.2, 20.0])
def test_an_undamped_pole_of_the_law_is_one_of_the_loop_however_slow(w):
    """Beside it, nearer by a factor of ten, |L| is ten times as large."""
    loop = Loop(LAB, Law({"hub_rate": ([0.3, 0.0], [1.0, 0.0, w * w])}))
    near = abs(loop.loop_function(1j * w * (1 + 1e-6 * np.array([10.0, 1.0]))))
    assert near[1] == pytest.approx(10 * near[0], rel=1e-3)
    assert abs(poles_on_axis(loop, 100.0) - w).min() < 1e-12 * w


# ------------------------------------------------------------ branches between their nodes, their crossings with


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
