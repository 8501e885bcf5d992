"""The survey of time responses: its inverse transforms in closed form, points known otherwise, and errors planted."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.assessment.inversion import durbin, inverse
from tests.assessment.step_truth import Case, Truth
from tests.assessment.steps import FIGURES, PARTS, Signal, answered, grows, judge
from tfarm.arm.chain import Sampling
from tfarm.dsp import Chain

LAB = tfarm.load("sasaki2012-lab")
COARSE = Chain(sampling=Sampling(period=0.05))
FAST = Case(LAB, {"hub_angle": ((1.0, 3.0), (1000.0,))}, 0.005, ("hub_angle",), "reference", COARSE, 4.0)
DOUBLE = Case(LAB, {"hub_angle": ((1.0, 3.0), (300.0, 300.0))}, 0.01, ("hub_angle",), "reference", COARSE, 4.0)
SERVO = Case(
    LAB, {"hub_angle": ((3.0,), ()), "hub_rate": ((1.0,), ()), "root_moment": ((0.3,), ())}, 0.0, ("hub_angle",),
    "slew", COARSE, 3.0,
)  # fmt: skip
OSCILLATOR = (20.0, 0.01)  # natural frequency [rad/s], damping ratio


def oscillator(s):
    """A step of an oscillator."""
    w, ratio = OSCILLATOR
    return w * w / (s * (s * s + 2 * ratio * w * s + w * w))


def oscillation(t):
    """The same over time."""
    w, ratio = OSCILLATOR
    wd, t = w * np.sqrt(1 - ratio**2), np.maximum(t, 0.0)
    return 1 - np.exp(-ratio * w * t) * (np.cos(wd * t) + ratio * w / wd * np.sin(wd * t))


@pytest.mark.parametrize("how", [(4.0, 30.0), (3.0, 28.0)])
def test_a_step_with_a_delay_and_a_lossless_rod_are_inverted(how):
    """Thirty periods of an oscillator damped 1 %, from a delay on; the free end of a clamped rod under a step of force,
    tanh(s)/s^2, is a triangle of period 4: kinks for ever."""
    late = 0.013
    t, y = durbin(lambda s: oscillator(s)[None] * np.exp(-s * late), 10.0, 2**18, *how)
    assert abs(y[0] - oscillation(t - late)).max() < 1e-6
    assert abs(y[0] - oscillation(t - late))[t > 2 * late].max() < 1e-10
    t, y = durbin(lambda s: (np.tanh(s) / s**2)[None], 20.0, 2**18, *how)
    away = abs((t + 1) % 2 - 1) > 0.1
    assert abs(y[0] - (2 - abs(t % 4 - 2)))[away].max() < 1e-10


def test_partial_fractions_of_multiple_poles():
    """t e^{-2t} + 3 delta, and 1/(s (s + 5)^3) from its closed form."""
    t = np.array([0.0, 0.3, 1.7])
    found = inverse([3.0, 12.0, 13.0], {-2.0: 2})
    np.testing.assert_allclose(found.at(t), t * np.exp(-2 * t), atol=1e-14)
    assert found.impulse == pytest.approx(3.0, rel=1e-15)
    expected = (1 - np.exp(-5 * t) * (1 + 5 * t + 12.5 * t**2)) / 125
    np.testing.assert_allclose(inverse([1.0], {0: 1, -5.0: 3}).at(t), expected, atol=1e-15)


def test_rounding_where_poles_nearly_coincide_is_named():
    """Poles 1e-6 apart leave few digits of 1/((s + 5)^2 (s + 5.000005)^2), a quadruple pole but for a millionth."""
    t = np.array([0.1, 0.3])
    near, same = inverse([1.0], {-5.0: 2, -5.000005: 2}), inverse([1.0], {-5.0: 4})
    apart = abs(near.at(t) - same.at(t))
    assert (apart > 1e-4 * same.at(t)).all()
    assert (apart < near.rounding(t)).all()
    assert (same.rounding(t) < 1e-15).all()


def test_torque_of_a_filtered_controller_after_its_delay():
    """0 before, the initial value 1/0.001 at the delay, and the controller's own step before the arm moves."""
    truth = Truth(FAST, 4.0)
    assert abs(truth.at(np.linspace(0.0, 0.00499, 30))[-1]).max() < 1e-10
    assert truth.at([0.005], 1.0)[-1] == pytest.approx(1000.0, rel=1e-9)
    own = 3.0 + 997.0 * np.exp(-0.5), 3.0 + 997.0 * np.exp(-1.0)
    np.testing.assert_allclose(truth.at([0.0055, 0.006])[-1], own, rtol=1e-9)
    double = Truth(DOUBLE, 4.0)
    assert double.at([0.0135])[-1] == pytest.approx(111.08, abs=0.005)
    time, peak = double.peak(PARTS.index("torque"))
    share = np.exp(-300 / 297)
    assert time == pytest.approx(0.01 + 1 / 297, abs=1e-6)
    assert peak == pytest.approx(3 * (1 - share * (1 + 300 / 297)) + 9e4 / 297 * share, rel=1e-9)


def test_loops_that_grow_are_not_drawn():
    """Rate feedback of the wrong sign, and a delay that is too long for the first mode."""
    late = replace(FAST, delay=0.15)
    wrong = replace(SERVO, entries={"hub_rate": ((-0.3,), ())})
    assert [grows(case, 71.5) for case in (SERVO, FAST, late, wrong)] == [False, False, True, True]


@pytest.mark.parametrize("case", [FAST, SERVO], ids=["delay", "slew"])
def test_figures_are_those_of_inverse_transforms(case):
    found = judge(case)
    assert len(found) > 30
    assert [each for each in found if each.outcome not in ("right", "undefined", "bound exceeded")] == []


def test_errors_of_some_percent_in_each_figure_are_found():
    """Of each signal of a slew; the peak of a signal that ends there is flat, and its time 40 % off."""
    found, truth = answered(SERVO), Truth(SERVO, SERVO.duration)
    shares = {"peak_time": -0.4, "residual_rms": 0.1}
    for part in PARTS:
        figures = getattr(found.continuous, part)
        for name in FIGURES:
            value = getattr(figures, name)
            if not value:
                continue
            share, size = shares.get(name, 0.03), abs(value)
            if name == "steady_state_error":
                size = abs(figures.peak)
            elif name == "overshoot":
                size += 1.0
            elif name in ("rise_time", "settling_time"):
                size += 4 * found.t[1] / share
            off = replace(figures, **{name: value + share * size})
            wrong = [each.name for each in Signal(part, off, found, truth).judged() if each.outcome == "wrong"]
            assert name in wrong, (part, name)
