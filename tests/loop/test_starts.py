"""Where searches for poles start, how far they reach, and what lists are cut to: against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.test_lossless import RIGS as REACTIVE
from tests.loop.test_lossless import edges_of
from tests.shared import thinned
from tfarm import HubFeedback, Law
from tfarm.errors import ParameterError
from tfarm.loop.loop import Loop
from tfarm.loop.poles import (
    Poles,
    count_with_mirrors,
    first_poles,
    near_modes,
    poles_below,
    quiet_edge,
    real_starts,
)
from tfarm.loop.stability import stability
from tfarm.loop.windows import looked_at, windows_of
from tfarm.spectrum.box import Box
from tfarm.spectrum.table import angle_unit, rate_unit

LAB, STOCKY = tfarm.load("sasaki2012-lab"), tfarm.load("stocky-steel")


# ------------------------------------------------------------ starts


def test_starts_beside_a_mode_are_where_bending_alone_takes_it_and_left_of_that():
    """s^2 + C w^2 s + w^2 = 0 first; a mode that no longer swings starts at its mean on the real axis."""
    omega, C = np.array([1.0, 7.0, 30.0]), 0.1
    starts = near_modes(omega, C).reshape(-1, 3)
    for n, w in enumerate(omega):
        roots = np.roots([1.0, C * w**2, w**2])
        assert starts[0, n] == pytest.approx(roots[np.argmax(roots.imag)] if C * w < 2 else roots.mean(), rel=1e-12)
    assert len(starts) > 1
    np.testing.assert_array_equal(starts.imag, np.broadcast_to(starts[0].imag, starts.shape))
    shares = (starts[0] - starts).real / omega
    assert (np.diff(shares[:, 0]) > 0).all()
    np.testing.assert_allclose(shares, np.broadcast_to(shares[:, :1], shares.shape), rtol=1e-12)
    np.testing.assert_array_equal(near_modes(omega, 0.0).reshape(-1, 3)[0], 1j * omega)


def test_real_starts_are_even_in_decades_and_reach_beyond_the_box():
    starts = real_starts(60.0)
    assert starts[0] < 60.0 / 100
    assert starts[-1] > 60.0
    np.testing.assert_allclose(starts[1:] / starts[:-1], starts[1] / starts[0], rtol=1e-12)
    assert starts[1] / starts[0] < 1.5


@pytest.mark.parametrize("K1", [0.3, -30.0])
def test_a_box_reaches_right_to_where_no_pole_can_be(K1):
    """From the first edge that is tried on: on the one that is taken Re L > -1/2, on the one before it was not."""
    loop, height, first = Loop(LAB, HubFeedback(K1=K1)), 300.0, 30.0
    right = quiet_edge(loop, first, height)
    edge = 1j * np.linspace(0.0, height, 400)
    assert loop.loop_function(right + edge).real.min() > -0.6
    if right > first:
        before = right / 1.7
        near = np.r_[before + edge, before * np.array([2.0, 5.0, 20.0])]
        assert loop.loop_function(near).real.min() <= -0.45
    poles = poles_below(loop, height).values
    assert (poles.real < right).all()
    assert (right > first) == (poles.real.max() > first)


# ------------------------------------------------------------ lists


def listed(*values):
    box = Box(-50.0, 10.0, -60.0, 60.0)
    return Poles(Loop(LAB, HubFeedback(K1=0.3)), np.array(values, complex), box)


def test_a_shorter_list_has_a_lower_box_between_its_last_pole_and_the_next():
    poles = listed(-3.0, -1.0, -2 + 4j, -1 + 10j, -1 + 40j)
    for count, top in ((2, 2.0), (3, 7.0), (4, 25.0), (5, 60.0)):
        some = first_poles(poles, count)
        np.testing.assert_array_equal(some.values, poles.values[:count])
        assert some.box == Box(-50.0, 10.0, -top, top)
        assert some.box.holds(some.values).all()
        assert not some.box.holds(poles.values[count:]).any()
    with pytest.raises(ParameterError, match="2 poles are real"):
        first_poles(poles, 1)
    assert count_with_mirrors(poles.values) == poles.count == 8


def test_without_a_number_ten_are_listed_and_every_real_one():
    swinging = [-1 + 1j * n for n in range(1, 16)]
    assert first_poles(listed(*swinging), None).values.size == 10
    assert first_poles(listed(-1.0, -2.0, *swinging), None).values.size == 10
    assert first_poles(listed(*(-1.0 - n for n in range(12)), *swinging), None).values.size == 12


def test_the_rightmost_pole_is_not_one_at_0():
    poles = listed(0.0, 0.0, -3.0, -1 + 10j)
    assert poles.spectral_abscissa == -1.0
    np.testing.assert_array_equal(poles.moving, [-3.0, -1 + 10j])
    assert (poles.unstable, listed(2.0, 3 + 1j, -1 + 2j).unstable) == (0, 3)


@pytest.mark.parametrize("name", thinned(REACTIVE, 2))
def test_of_a_rig_without_losses_each_driven_mode_of_the_box_is_two_unstable_poles(name):
    """However near to the axis: as many as there are K2_n between 0 and the law's, of modes below the box's top."""
    arm = REACTIVE[name]
    gains, at = edges_of(arm)
    K2 = 1.5 * float(max(gains[:3], key=abs))
    law = HubFeedback(K1=1e-3 * rate_unit(arm), K2=K2)
    poles = poles_below(Loop(arm, law), 1.3 * float(at[3]))
    driven = (np.sign(gains) == np.sign(K2)) & (abs(gains) < abs(K2)) & (at < poles.box.im_max)
    assert poles.unstable == 2 * driven.sum() > 0


# ------------------------------------------------------------ how far windows are looked for


@pytest.mark.parametrize("arm", [LAB, STOCKY], ids=lambda arm: arm.name)
def test_windows_are_looked_for_well_beyond_what_matters_to_the_first_mode(arm):
    """20 J w1 of a rate, 20 J w1^2 of an angle; 50 of a moment, or where twice the inertia is taken off."""
    loop = Loop(arm, HubFeedback(K1=1e-3 * rate_unit(arm), K2=0.3))
    assert looked_at(loop, "K1") == pytest.approx((-20 * rate_unit(arm), 20 * rate_unit(arm)), rel=1e-12)
    assert looked_at(loop, "Kp") == pytest.approx((-20 * angle_unit(arm), 20 * angle_unit(arm)), rel=1e-12)
    most = max(50.0, 2 * arm.total_inertia / arm.carried_inertia)
    assert looked_at(loop, "K2") == pytest.approx((-most, most), rel=1e-12)
    far = Loop(arm, HubFeedback(K1=5 * rate_unit(arm), K2=-9.0))
    assert looked_at(far, "K1")[1] == pytest.approx(50 * rate_unit(arm), rel=1e-12)
    assert looked_at(far, "K2")[1] == pytest.approx(max(most, 90.0), rel=1e-12)
    assert looked_at(Loop(arm, HubFeedback(K1=5e8 * rate_unit(arm))), "K1")[1] == 1e9 * rate_unit(arm)


@pytest.mark.parametrize("friction", [0.0, 0.02])
def test_a_hub_without_inertia_is_stable_from_where_it_loses_something_on(friction):
    """The law is in its window, whose lower end is where K1 takes back what the hub loses: a pole passes infinity."""
    pin = replace(LAB, hub=replace(LAB.hub, inertia=0.0, friction=friction))
    for K1 in (0.3, -0.5 * friction) if friction else (0.3,):
        verdict = stability(pin, HubFeedback(K1=K1))
        assert verdict.is_stable
        low, high = windows_of(verdict, ["K1"])["K1"].around
        assert low == pytest.approx(-friction, abs=1e-12)
        assert low < K1 < high


# ------------------------------------------------------------ the function of a law


LEAD = {"hub_angle": ([0.7, 3.0, 20.0], [0.002, 0.3, 1.0]), "root_moment": ([0.2], [1e-4, 2e-2, 1.0])}
LAWS = {
    "lead": Law(LEAD),
    "late": Law(LEAD, delay=0.004),
    "integral": Law({"hub_angle": ([1.0, 5.0], [1.0, 0.0]), "hub_rate": 0.4}),
}


@pytest.mark.parametrize("name", LAWS)
def test_the_slope_of_the_function_is_its_difference_quotient(name):
    """Of higher order and wider: by the values of the function alone, its zeros at 0 divided out."""
    loop = Loop(LAB, LAWS[name])
    for s in (0.3 + 2j, -5 + 40j, 2.0 + 0j, 1e-3 + 1e-2j):
        h = 1e-3 * abs(s)
        at = loop.function(s + h * np.array([0, -2, -1, 1, 2]))
        values = at.value * np.exp(at.scale - at.scale[0])
        difference = (values[1] - 8 * values[2] + 8 * values[3] - values[4]) / (12 * h)
        assert difference == pytest.approx(at.slope[0], rel=1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_two_laws_have_one_factor_of_the_rig(name):
    """D of one over D of the other, of laws with one denominator, is the quotient of 1 + L."""
    one, s = Loop(LAB, LAWS[name]), np.array([0.3 + 2j, -5 + 40j, 2.0 + 0j])
    half = {signal: ([0.5 * n for n in num], den) for signal, (num, den) in LEAD.items()}
    other = one.under(Law(half, delay=0.001)) if name != "integral" else one.under(LAWS[name].having("gain", 0.5))
    of_rig = one.signals.parts(s)
    ratio = one.characteristic(s, of_rig) / other.characteristic(s, of_rig)
    expected = (1 + one.loop_function(s)) / (1 + other.loop_function(s))
    np.testing.assert_allclose(ratio, expected, rtol=1e-10)
