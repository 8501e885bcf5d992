"""The data of a Bode plot: no peak and no dip between two points, and a phase that is the limit of small damping."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import tfarm
from tests.shared import refusal, thinned
from tfarm.arm import Motor
from tfarm.response.frequency import bode, refined_grid, resonant_band, without_cancelled
from tfarm.schema import sections

UNDAMPED = tfarm.load("sasaki2012")
STOCKY = tfarm.load("stocky-steel")


def response(arm, output, count=7):
    return bode(arm, output, resonant_band(arm, count - 1))


def test_the_grid_is_dense_away_from_roots_and_holds_none_on_the_axis():
    data = response(UNDAMPED, "root_moment")
    step = np.diff(np.log10(data.omega))
    assert (step > 0).all()
    assert step.max() <= 1.0001 / 120
    for root in (*data.infinite, *data.vanishing):
        gap = abs(data.omega / root - 1)
        assert 1e-9 < gap.min() < 2e-6


PLACES = [("root_moment", None), ("tip_displacement", None), ("hub_rate", None), ("moment", 0.4), ("velocity", 0.7)]


@pytest.mark.parametrize(("arm", "place"), thinned(product([UNDAMPED, STOCKY], PLACES), 2))
def test_the_counted_phase_is_the_limit_of_small_damping(arm, place):
    """A method the code does not use: G at s = epsilon + i omega, unwrapped on a grid that resolves epsilon."""
    output, x = place
    data = bode(arm, output, resonant_band(arm, 6), x=x and x * arm.length)
    epsilon = 1e-4 * data.band[0]
    shifted = [root - epsilon for root in (*data.poles, *data.zeros)]
    omega = refined_grid(data.band, np.array(shifted))
    phase = np.degrees(np.unwrap(np.angle(tfarm.transfer(arm, output, x=data.x)(epsilon + 1j * omega))))
    phase -= 360 * round((phase[0] - data.phase[0]) / 360)
    away = np.array([min(abs(w - r) for r in (*data.infinite, *data.vanishing)) > 100 * epsilon for w in data.omega])
    limit = np.interp(data.omega[away], omega, phase)
    assert abs(limit - data.phase[away]).max() < 2.0


@pytest.mark.parametrize(
    ("along", "x", "own"), [("moment", 0.0, "root_moment"), ("displacement", 1.0, "tip_displacement")]
)
def test_along_the_arm_it_begins_and_ends_as_at_root_and_tip(along, x, own):
    """Fields along the arm against the closed forms of its ends."""
    arm = UNDAMPED.with_numbers(damping=1e-4)
    mine, theirs = bode(arm, along, (2.0, 300.0), x=x * arm.length), bode(arm, own, (2.0, 300.0))
    assert mine.poles == pytest.approx(theirs.poles, rel=1e-12)
    assert mine.zeros == pytest.approx(theirs.zeros, rel=1e-9)
    assert mine.at_zeros == pytest.approx(theirs.at_zeros, rel=1e-9)
    np.testing.assert_allclose(mine.dips, theirs.dips, rtol=1e-8)
    assert (mine.phase[0], mine.phase[-1]) == pytest.approx((theirs.phase[0], theirs.phase[-1]), rel=1e-9)
    assert (mine.gain_unit, mine.x, theirs.x) == (theirs.gain_unit, x * arm.length, None)
    assert f"at x = {x:g} m" in mine.label


def test_from_another_input_it_is_the_ratio_of_two_responses():
    """From the hub's angle: the tip over that angle, its poles the frequencies of the locked hub."""
    rig = tfarm.load("quanser-2dsfl")
    data = bode(rig, "tip_acceleration", (1.0, 2000.0), input="hub_angle")
    tip, hub = tfarm.transfer(rig, ["tip_acceleration", "hub_angle"])(1j * data.omega)
    assert data.value == pytest.approx(tip / hub, rel=1e-9)
    locked = tfarm.modes(rig.with_numbers(hub_inertia=math.inf), up_to=2000.0).natural_frequency
    assert data.resonances.imag == pytest.approx(locked, rel=1e-3)
    assert (data.gain_unit, data.input_label) == ("m/s^2/rad", "hub angle")
    tables = [each.table for each in sections(data) if each.table]
    assert [next(c.unit for c in each.columns if c.key == "magnitude") for each in tables] == ["m/s^2/rad"] * 4
    assert all(column.unit for each in tables for column in each.columns if column.key.startswith("frequency"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"output": "root_moment", "x": 0.5}, "leave x out"),
        ({"output": "root_moment", "input": "force@0.3"}, "needs an input at the hub"),
        ({"output": "root_moment", "input": "motor_voltage"}, "there is no motor"),
        ({"output": "root_moment", "band": 3}, "two frequencies in rad/s"),
        ({"output": "root_moment", "band": (5.0, 1.0)}, "two frequencies in rad/s"),
        ({"output": "root_moment", "band": (1e-308, 5.0)}, "at most 30 decades apart"),
        ({"output": "root_moment", "band": ("low", "high")}, "two frequencies in rad/s"),
    ],
)
def test_what_is_no_bode_plot_is_refused(arguments, words):
    assert words in str(refusal(bode, UNDAMPED, **arguments))


def test_a_pole_and_a_zero_that_coincide_cancel():
    poles, zeros = without_cancelled(np.array([1j, 2j, 2j]), np.array([2j, 3j]))
    assert poles.tolist() == [1j, 2j]
    assert zeros.tolist() == [3j]


def test_with_a_free_pin_the_gauge_reads_the_torque_and_a_pinned_tip_does_not_move():
    data = response(UNDAMPED.with_numbers(hub_inertia=0.0), "root_moment")
    assert data.poles.size == data.zeros.size == 0
    assert abs(data.value + 1).max() < 1e-12
    assert response(UNDAMPED.with_numbers(payload_mass=math.inf), "tip_displacement").is_zero


def test_behind_an_inductance_an_arm_without_losses_has_the_phase_of_its_values():
    """Its poles are on the axis, but the torque comes late: no half turns."""
    motor = Motor(resistance=1.0, torque_constant=0.1, back_emf_constant=0.0, inductance=0.02)
    arm = replace(tfarm.load("sasaki2012"), motor=motor, input="motor_voltage")
    data = tfarm.bode(arm, "root_moment", (1.0, 400.0))
    np.testing.assert_allclose(np.exp(1j * np.radians(data.phase)), data.value / abs(data.value), atol=1e-9)
