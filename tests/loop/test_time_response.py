"""Continuous-time responses, by roads without poles: Bromwich's integral, final values, modal sums, python-control."""

from dataclasses import replace

import control
import mpmath
import numpy as np
import pytest

import tfarm
from tests.loop.arms import loop_of
from tests.shared import thinned
from tfarm.exact.appendix import output_value as appendix_response
from tfarm.exact.outputs import OUTPUTS
from tfarm.loop.time_response import ACTUATOR, Excitation, time_response, usual_poles
from tfarm.reduced.modal import modal_model, sensed_model

LAB, LOSSLESS = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
LAW = tfarm.HubFeedback(K1=0.3, K2=0.3)
SERVO = tfarm.Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_deflection": ([0.5], [0.02, 1.0])}, delay=0.003)
NAMES = ("hub_angle", "tip_displacement", "root_moment")
WIDTH = 0.1  # s, of the pulses


def versine(width=WIDTH):
    """(1 - cos w t)/2 for a width of 2 pi/w, and its transform."""
    w = 2 * np.pi / width
    return Excitation({ACTUATOR: lambda s: (1 / s - s / (s * s + w * w)) / 2}, (0.0, width), (1.0, -1.0), (1j * w,))


def durbin(values, duration, points=2**15):
    """Times and signals of transforms, `values(s)` (signals, n), by Bromwich's integral: a trapezoid and one FFT.

    The shift of the path times its period is 36, so that the response aliases by e^-36.
    """
    period = 4 * duration
    shift = 36 / period
    n = np.arange(points)
    found = values(shift + 2j * np.pi * n / period)
    found[:, 0] /= 2
    t = n * period / points
    return t, 2 / period * np.exp(shift * t) * (np.fft.ifft(found, axis=1) * points).real


def exact_signals(arm, law, excitation, s):
    """The signals of a closed loop from the arm's transfer functions and the law's: G W/(1 + L)."""
    law = loop_of(arm, law).law
    L = sum(
        C * np.exp(-s * law.delay) * tfarm.transfer(arm, name)(s)
        for name, C in zip(law.signals, law.values(s), strict=True)
    )
    pulses = sum(w * np.exp(-s * t) for t, w in zip(excitation.times, excitation.weights, strict=True))
    driven = excitation.inputs[ACTUATOR](s) * pulses / (1 + L)
    return np.array([tfarm.transfer(arm, name)(s) * driven for name in NAMES])


@pytest.mark.parametrize(
    ("arm", "law", "width", "duration"),
    [
        (LAB, LAW, WIDTH, 1.0),
        (LAB, SERVO, WIDTH, 1.0),
        (LAB, tfarm.HubFeedback(K1=1e-6, Kp=1e-7), WIDTH, 1.0),
        (LAB.with_numbers(damping=2e-3), LAW, WIDTH, 1.0),
        (LOSSLESS, LAW, WIDTH, 1.0),
        (LOSSLESS, tfarm.HubFeedback(K1=0.3, K2=0.3, Kp=3.0), WIDTH, 1.0),
        (tfarm.load("stocky-steel"), tfarm.HubFeedback(K1=77.7, K2=0.3), 0.01, 0.05),
        (tfarm.load("quanser-flexlink"), tfarm.HubFeedback(K1=0.01, K2=2.0), WIDTH, 1.0),
    ],
    ids=["damped", "law with states and delay", "slow poles", "overdamped", "undamped", "servo", "stocky", "motor"],
)
def test_a_smooth_pulse_is_that_of_bromwichs_integral(arm, law, width, duration):
    """Twelve digits of each peak; elsewhere within the bound and what the integral itself leaves out."""
    excitation = versine(width)
    found = time_response(usual_poles(loop_of(arm, law)), NAMES, excitation, duration)
    t, expected = durbin(lambda s: exact_signals(arm, law, excitation, s), duration)
    t, expected = t[t <= duration], expected[:, t <= duration]
    y, bound = found.at(t)[:-1], found.remainder(t)[:-1]
    peak = abs(expected).max(axis=1, keepdims=True)
    at = abs(expected).argmax(axis=1)
    rows = np.arange(len(NAMES))
    assert (abs(y - expected)[rows, at] <= 1e-12 * peak[:, 0] + bound[rows, at]).all()
    assert (bound[rows, at] <= 1e-12 * peak[:, 0]).all() or not arm.damping
    assert (abs(y - expected) <= bound + 1e-9 * peak).all()


def test_twelve_digits_of_a_peak_at_the_precision_of_mpmath():
    """Bromwich's integral of the paper's determinant at 25 digits: no pole, residue or double in it.

    The pulse is (1 - cos w t)^3/8, whose transform times that of the hub angle falls with s^-9: 600 terms are enough.
    """
    w, law = 2 * np.pi / WIDTH, tfarm.HubFeedback(K1=0.3, Kp=1.0)

    def pulse(s):
        return 10 / (32 * s) + sum(c * s / (32 * (s * s + (n * w) ** 2)) for n, c in ((1, -15), (2, 6), (3, -1)))

    excitation = Excitation({ACTUATOR: pulse}, (0.0, WIDTH), (1.0, -1.0), (1j * w, 2j * w, 3j * w))
    found = time_response(usual_poles(loop_of(LAB, law)), NAMES, excitation, 1.0)
    at, value, bound, _ = found.peaks(np.linspace(0.05, 0.3, 600))["hub_angle"]
    assert found.remainder(np.array([at]))[0, 0] < 1e-30 * value  # the omitted poles; the sum itself is rounded
    assert 1.1e-16 * value < bound < 4.5e-16 * value
    with mpmath.workdps(20):
        period = mpmath.mpf(2)
        shift, w = 32 / period, 2 * mpmath.pi / mpmath.mpf(WIDTH)
        total = mpmath.mpf(0)
        for n in range(600):
            s = mpmath.mpc(shift, 2 * mpmath.pi * n / period)
            angle = appendix_response(LAB, OUTPUTS["hub_angle"], s, 18)
            H = angle / (1 + (law.K1 * s + law.Kp) * angle) * pulse(s) * (1 - mpmath.exp(-s * WIDTH))
            total += (H * mpmath.exp(s * at)).real / (2 if n == 0 else 1)
        expected = 2 / period * total
    assert abs(value - expected) <= 1e-12 * abs(expected)


@pytest.mark.parametrize("arm", [LAB, LOSSLESS], ids=["damped", "undamped"])
def test_the_rest_of_four_times_as_many_modes_is_within_the_bound(arm):
    """Of a step of the torque, which excites every mode."""
    loop, step = loop_of(arm, LAW), Excitation({ACTUATOR: lambda s: 1 / s})
    few, many = (time_response(usual_poles(loop, count), NAMES, step, 1.0) for count in (20, 160))
    t = np.linspace(0.0, 1.0, 3001)[1:]
    whole = many.at(t)[: len(NAMES)]
    rest, bound = abs(few.at(t)[: len(NAMES)] - whole), few.remainder(t)[: len(NAMES)]
    most = abs(whole).max(axis=1, keepdims=True)
    assert (rest <= bound + 1e-12 * most).all()
    assert (bound.max(axis=1, keepdims=True) <= 0.02 * most).all()  # and no bound of everything


@pytest.mark.parametrize(
    ("arm", "name"), thinned([((LAB, LOSSLESS)[n % 2], NAMES[n // 2]) for n in (0, 1, 3, 2, 4, 5)], 2)
)
def test_without_feedback_it_is_the_modal_sum(arm, name):
    """The rigid body and the residues of the modal model under a step of the torque, its remainder left out."""
    step = Excitation({ACTUATOR: lambda s: 1 / s})
    found = time_response(usual_poles(loop_of(arm, tfarm.HubFeedback())), (name,), step, 0.5)
    model, t = modal_model(arm, name, 60), np.linspace(0.0, 0.5, 101)[1:]
    p, r = model.eigenvalues.ravel(), model.residues[0].ravel()
    p, r = np.r_[p, model.single], np.r_[r, model.single_residues[0]]
    double, single = model.rigid[0]
    expected = (
        double * t**2 / 2 + single * t + (r / p * (np.exp(np.outer(t, p)) - 1)).sum(axis=1).real + model.static[0]
    )
    assert np.abs(found.at(t)[0] - expected).max() <= 2e-5 * abs(expected).max()


@pytest.mark.parametrize("arm", [LAB, LOSSLESS], ids=["damped", "undamped"])
def test_python_control_on_a_model_of_forty_modes_has_the_same_step_response(arm):
    law = tfarm.HubFeedback(K1=0.3, K2=0.3, Kp=3.0)
    A, B, C, D = sensed_model(arm, ("hub_angle", "hub_rate", "root_moment", "tip_displacement"), 40)
    gains = np.array([[law.Kp, law.K1, law.K2, 0.0]])
    through = gains / (1 + gains @ D)
    closed = control.ss(A - B @ through @ C, B, C - D @ through @ C, D / (1 + gains @ D))
    t = np.linspace(0.0, 1.0, 501)
    expected = law.Kp * control.step_response(closed, t).outputs[[0, 3, 2], 0]
    step = Excitation({"hub_angle": lambda s: 1 / s})
    y = time_response(usual_poles(loop_of(arm, law)), NAMES, step, 1.0).at(t)
    peak = abs(expected).max(axis=1, keepdims=True)
    assert (abs(y[:-1] - expected) <= 1e-4 * peak)[:, 1:].all()
    torque = law.Kp * (1 - y[0]) - law.K1 * control.step_response(closed, t).outputs[1, 0] * law.Kp - law.K2 * y[2]
    assert np.abs(y[-1] - torque)[1:].max() <= 1e-4 * abs(torque).max()


@pytest.mark.parametrize("stiffness", [0.0, 2.0])
def test_the_final_value_is_that_of_the_theorem(stiffness):
    """Kp/(Kp + k): a spring at the hub leaves an error, as no integrator removes it."""
    arm, law = replace(LAB, hub=replace(LAB.hub, stiffness=stiffness)), tfarm.HubFeedback(K1=0.5, K2=0.3, Kp=3.0)
    step = Excitation({"hub_angle": lambda s: 1 / s})
    found = time_response(usual_poles(loop_of(arm, law)), NAMES, step, 200.0).at(np.array([200.0]))[:, 0]
    theta = law.Kp / (law.Kp + stiffness)
    np.testing.assert_allclose(found[:2], [theta, theta * arm.reach], rtol=1e-9)
    np.testing.assert_allclose(found[2:], [0.0, stiffness * theta], atol=1e-9)


def test_a_growing_response_beyond_doubles_is_refused_with_a_duration():
    poles = usual_poles(loop_of(LAB, tfarm.HubFeedback(K1=-30.0)))
    with pytest.raises(tfarm.ParameterError, match=r"duration = 1000.0: the loop is unstable .* at most [\d.]+ s"):
        time_response(poles, NAMES, versine(), 1000.0)


STEP = Excitation({"hub_angle": lambda s: 1 / s})


@pytest.mark.parametrize(
    ("damping", "corner", "order"),
    thinned([(C, *of) for of in ((1000.0, 1), (300.0, 2), (64.0, 2)) for C in (0.0, 1e-4, 5e-3)], 2),
)
def test_until_twice_the_delay_the_torque_is_the_laws_own_step_response(damping, corner, order):
    """Nothing is fed back before: 0 until the delay, then the step response of C alone, here in closed form.

    The poles of the filter at 64 1/s are equal to the last digit, those at 300 1/s are not.
    """
    tau, den = 0.01, np.polymul([1 / corner, 1.0], [1 / corner, 1.0] if order == 2 else [1.0])
    law = tfarm.Law({"hub_angle": ([1.0, 3.0], list(den))}, delay=tau, references=("hub_angle",))
    assert np.unique(law.poles).size == (2 if corner == 300.0 else 1)
    found = time_response(usual_poles(loop_of(LAB.with_numbers(damping=damping), law)), NAMES, STEP, 1.0)
    after = np.array([0.0, 1e-6, 1e-4, 5e-4, 1e-3, 3e-3, 9e-3])
    x = corner * after
    own = 3 + np.exp(-x) * (corner - 3 if order == 1 else corner * x - 3 * (1 + x))
    np.testing.assert_allclose(found.at(tau + after)[-1], own, rtol=1e-10, atol=1e-10)
    early = np.linspace(0.0, tau, 50, endpoint=False)
    assert not found.at(early).any()
    assert not found.remainder(early).any()


def test_the_largest_torque_is_found_on_both_sides_of_a_jump():
    """1000 N m after the delay, at no sample of the record; and the end of a ramp that jumps back to 0."""
    law = tfarm.Law({"hub_angle": ([1.0, 3.0], [0.001, 1.0])}, delay=0.005, references=("hub_angle",))
    found = time_response(usual_poles(loop_of(LAB, law)), NAMES, STEP, 4.0)
    peak = found.peaks(np.linspace(0.0, 4.0, 1000))["torque"]
    assert peak[:2] == pytest.approx((0.005, 1000.0), rel=1e-12)
    assert peak.value <= peak.most <= 1000.0 + 1e-6
    ramp = Excitation({ACTUATOR: lambda s: 1 / s**2}, (0.0, 0.3), (1.0, -1.0))
    stopped = Excitation({ACTUATOR: lambda s: 1 / s**2 - 0.3 / s * np.exp(0 * s)}, (0.0,), (1.0,))
    free = usual_poles(loop_of(LAB, tfarm.HubFeedback()))
    t = np.linspace(0.0, 0.5, 101)
    np.testing.assert_allclose(time_response(free, NAMES, ramp, 0.5).at(t)[-1], np.minimum(t, 0.3), atol=1e-9)
    start = time_response(free, NAMES, stopped, 0.5).peaks(np.linspace(0.1, 0.5, 30))["torque"]
    assert (start.time, start.value) == pytest.approx((0.0, -0.3), rel=1e-9)


@pytest.mark.parametrize("corners", [(271.0, 271.0, 271.0), (196.0, 180.0, 102.0)])
def test_one_filter_of_three_signals_adds_its_poles_once(corners):
    """Apart they hide in each other, with multiplicities that no search separates; the response is Bromwich's."""
    den = np.poly(-np.array(corners)) / np.prod(corners)
    gains = {"hub_angle": 3.0, "hub_rate": 0.3, "root_moment": 0.3}
    law = tfarm.Law({name: ([gain], den) for name, gain in gains.items()}, delay=0.002)
    poles = usual_poles(loop_of(LAB, law))
    assert law.order == 9
    assert (abs(poles.values[:, None] + np.array(corners)) > 1e-3).all()
    excitation = versine()
    found = time_response(poles, NAMES, excitation, 1.0)
    t, expected = durbin(lambda s: exact_signals(LAB, law, excitation, s), 1.0)
    t, expected = t[t <= 1.0], expected[:, t <= 1.0]
    assert (abs(found.at(t)[:-1] - expected).max(axis=1) < 1e-9 * abs(expected).max(axis=1)).all()


def test_equal_filters_in_series_keep_their_digits():
    """Their poles are split by rounding; until twice the delay the torque is the law's own, in closed form."""
    c, tau = 2480.0, 0.01
    law = tfarm.Law({"hub_angle": ([0.1, 1.0], np.poly([-c] * 3) / c**3)}, delay=tau, references=("hub_angle",))
    found = time_response(usual_poles(loop_of(LAB, law)), NAMES, STEP, 1.0)
    after = np.linspace(0.0, 0.9 * tau, 40)
    x = c * after
    own = 1 - np.exp(-x) * (1 + x + x**2 / 2) + 0.1 * c * np.exp(-x) * x**2 / 2
    t = tau + after
    assert abs(found.at(t)[-1] - own).max() < 1e-11 * own.max()
    assert (found.remainder(t)[-1] < 1e-10 * own.max()).all()


def test_the_largest_of_many_maxima_is_found_whatever_the_record():
    """That of a torque of two frequencies over forty periods, as on a grid of two million times."""
    w = np.array([50.0, 50.0 * 2**0.5])
    two = Excitation({ACTUATOR: lambda s: sum(0.5 * each / (s * s + each**2) for each in w)}, poles=tuple(1j * w))
    found = time_response(usual_poles(loop_of(LAB, tfarm.HubFeedback())), NAMES, two, 5.0)
    t = np.linspace(0.0, 5.0, 2_000_001)
    expected = abs(0.5 * np.sin(np.outer(w, t)).sum(axis=0)).max()
    for points in (400, 701, 1000):
        peak = found.peaks(np.linspace(0.0, 5.0, points))["torque"]
        assert abs(peak.value) == pytest.approx(expected, rel=1e-8)
        assert expected <= peak.most * (1 + 1e-12) < expected * (1 + 1e-8)
