"""Observer with state feedback, several notches, resonant feedback: against python-control and closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import control
import numpy as np
import pytest

import tfarm
from tfarm.arm.blocks import Rational
from tfarm.arm.law import Law
from tfarm.case import Case
from tfarm.exported.systems import controller_system
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import stability
from tfarm.reduced.modal import sensed_model
from tfarm.spectrum.gains import turning_inertia
from tfarm.synthesis.observer import held_model
from tfarm.synthesis.structures import structure_of

T = 0.01
SIGNALS = ("hub_angle", "root_moment")
LAB = tfarm.load("sasaki2012-lab")
MOTOR = tfarm.load("quanser-flexlink")
S = 30 + 80j


def form_of(name, arm=LAB, modes=2):
    return structure_of(name, arm, Kp=0.0, modes=modes, period=T, bounds={})


def drawn(form, number=4):
    """Coefficients (n, number) near the start."""
    return form.coefficients(form.origin[:, None] + np.random.default_rng(1).normal(0, 1.0, (form.size, number)))


def ratio(entry, s, n=0):
    num, den = entry.num, np.broadcast_to(entry.den, (len(entry.den), entry.num.shape[1]))
    return np.polyval(num[:, n], s) / np.polyval(den[:, n], s)


@pytest.mark.parametrize("arm", [LAB, MOTOR])
def test_the_model_of_an_observer_is_that_of_held_samples(arm):
    """G(z) of python-control under a hold, at z = (1 + w T/2)/(1 - w T/2)."""
    A, B, C, D = sensed_model(arm, SIGNALS, 2)
    held = control.sample_system(control.ss(A, B, C, 0 * D), T)
    model = control.ss(*held_model(arm, SIGNALS, 2, T))
    for w in (3 + 40j, 150j, -20 + 300j):
        np.testing.assert_allclose(model(w), held((1 + w * T / 2) / (1 - w * T / 2)), rtol=1e-8)


@pytest.fixture(params=[LAB, MOTOR], ids=["torque", "voltage"])
def textbook(request):
    """Laws of LQG, and gains and model of each by python-control."""
    form = form_of("LQG", request.param)
    c = drawn(form)
    A, B, C, D = held_model(request.param, SIGNALS, 2, T)
    n = len(A)
    whole, push = np.block([[A, np.zeros((n, 1))], [C[:1], 0.0]]), np.vstack([B, [[0.0]]])
    laws = []
    for Ki, weight, speed, noise in c.T:
        read = np.diag([form.fixed["Kp"], weight, Ki]) @ np.block([[C, np.zeros((2, 1))], [np.eye(n + 1)[n:]]])
        K, _, regulated = control.lqr(whole, push, read.T @ read, [[1.0]])
        angle_noise = 1 / (turning_inertia(request.param) * speed**2)
        L, _, observed = control.lqe(A, B, C, [[1.0]], np.diag([angle_noise**2, noise**2]))
        own = A - L @ C - (B - L @ D) @ K[:, :n]
        states = np.block([[own, -(B - L @ D) @ K[:, n:]], [np.zeros((1, n + 1))]])
        law = control.ss(states, np.vstack([L, [[1.0, 0.0]]]), K, np.zeros((1, 2)))
        laws.append(SimpleNamespace(law=law, Ki=Ki, K=K, poles=np.r_[regulated, observed]))
    return SimpleNamespace(form=form, c=c, plant=control.ss(A, B, C, D), laws=laws)


def test_lqg_is_that_of_python_control(textbook):
    """Its transfer functions; and k = Ki, since |a_c(0)| = Ki |b(0)| of the spectral factor a_c."""
    entries = textbook.form.entries(textbook.c)
    for n, each in enumerate(textbook.laws):
        for s in (0.3j, 20j, S, 500j):
            np.testing.assert_allclose([ratio(entry, s, n) for entry in entries], each.law(s)[0], rtol=1e-5)
        assert each.K[0, -1] == pytest.approx(each.Ki, rel=1e-6)


def test_poles_under_lqg_are_those_of_regulator_and_observer(textbook):
    """Of the model with the law of python-control: so what is compared is no unstable loop."""
    for each in textbook.laws:
        loop = control.feedback(textbook.plant, each.law)
        found, wanted = np.sort_complex(loop.poles()), np.sort_complex(each.poles)
        np.testing.assert_allclose(found, wanted, rtol=1e-4)
        assert found.real.max() < 0


def test_lqg_has_the_integral_of_the_angle_alone():
    """As many states as the model, 2 x modes + rigid states, and an integrator of the angle."""
    for modes in (1, 2, 3):
        form = form_of("LQG", modes=modes)
        angle, moment = form.entries(drawn(form))
        assert (len(angle.den) - 1, len(moment.den) - 1) == (2 * modes + 3, 2 * modes + 2)
        assert not angle.den[-1].any()
        assert moment.den[-1].all()


@pytest.mark.parametrize("modes", [1, 3])
def test_notches_are_a_product(modes):
    """(s^2 + 2 a w s + w^2)/(s^2 + 2 b w s + w^2) a mode, each first at its mode; with one it is PD+notch."""
    form = form_of("PD+notches", modes=modes)
    c = drawn(form)
    (entry,) = form.entries(c)
    K1, pole = c[:2, 0]
    wanted = form.fixed["Kp"] + K1 * S / (1 + S / pole)
    for w, a, b in c[2:, 0].reshape(modes, 3):
        wanted *= (S**2 + 2 * a * w * S + w**2) / (S**2 + 2 * b * w * S + w**2)
    assert ratio(entry, S) == pytest.approx(wanted, rel=1e-9)
    frequencies = np.minimum(tfarm.modes(LAB, modes).natural_frequency[-modes:], 1 / T)
    starts = dict(zip(form.names, form.coefficients(form.origin), strict=True))
    np.testing.assert_allclose([starts[f"notch_rad_s_{n}"] for n in range(1, modes + 1)], frequencies, rtol=1e-9)
    if modes == 1:
        (alone,) = form_of("PD+notch").entries(c)
        assert ratio(alone, S) == ratio(entry, S)


def test_resonant_feedback_is_a_sum_of_band_passes():
    """2 zeta w s/(s^2 + 2 zeta w s + w^2) a mode on the root moment, each g at its own frequency."""
    form = form_of("rate+resonant")
    c = drawn(form)
    angle, rate, moment = form.entries(c)
    assert (angle.signal, rate.signal, moment.signal) == ("hub_angle", "hub_rate", "root_moment")
    assert ratio(rate, S) == c[0, 0]

    def band(w, zeta, s):
        return 2 * zeta * w * s / (s**2 + 2 * zeta * w * s + w**2)

    filters = c[1:, 0].reshape(2, 3)
    assert ratio(moment, S) == pytest.approx(sum(g * band(w, zeta, S) for g, w, zeta in filters), rel=1e-9)
    assert all(band(w, zeta, 1j * w) == pytest.approx(1.0) for _, w, zeta in filters)


FOUND = {  # by design --structure NAME, rounded
    ("LQG", LAB): (5.868e4, 1.363, 172.6, 0.1491),
    ("LQG", MOTOR): (604.9, 20.14, 0.01174, 0.0439),
    ("rate+resonant", LAB): (14.72, 2.743, 122.6, 0.1968, -0.09598, 1.087, 1.542),
    ("rate+resonant", MOTOR): (1.499, 180.1, 0.5731, 2.261, 1916.0, 75.87, 0.01582),
    ("PD+notches", LAB): (3487.0, 23.15, 5.997, 0.3397, 0.003819, 3.539, 6.179, 927.8),
    ("PD+notches", MOTOR): (6.765, 53.17, 0.6092, 2.395, 8.287, 5.327, 0.2507, 8.806),
}


@pytest.mark.parametrize(("name", "arm"), FOUND, ids=lambda each: getattr(each, "name", each))
def test_laws_of_each_structure_are_stable_by_exact_verdicts(name, arm):
    """In continuous time and sampled, as found by a search of few modes."""
    form = form_of(name, arm)
    law = form.record_at(form.at(FOUND[name, arm]))
    assert isinstance(law, Law)
    assert stability(Case(arm, law)).is_stable
    assert sampled_verdict(Case(arm, law)).is_stable


@pytest.mark.parametrize("arm", [LAB, MOTOR], ids=["torque", "voltage"])
def test_an_observer_with_an_integrator_has_a_state_more_than_its_model(arm):
    """Simulated and exported: the ratios of both signals have one denominator, that of the angle an integrator too."""
    form = form_of("LQG", arm)
    law = form.record_at(form.origin)
    angle, moment = law.parts
    n = moment.block.order
    assert law.order == 2 * n + 1
    # the same ratio in other numbers: its states are its own
    apart = Rational(tuple(3 * each for each in moment.block.num), tuple(3 * each for each in moment.block.den))
    other = Law({}, parts=(angle, replace(moment, block=apart)), references=law.references)
    systems = [controller_system(Case(arm, each)) for each in (law, other)]
    assert [len(each.states) for each in systems] == [n + 1, 2 * n + 1]
    runs = [tfarm.simulate(arm, each, duration=1.0) for each in (law, other)]
    np.testing.assert_allclose(runs[0].torque, runs[1].torque, atol=1e-7 * abs(runs[1].torque).max())
    z = np.exp(1j * np.array([0.02, 0.3, 2.0]))
    for A, B, C, D in (each.matrices for each in systems):
        values = [C @ np.linalg.solve(at * np.eye(len(A)) - A, B) + D for at in z]
        tustin = 2 / T * (z - 1) / (z + 1)
        for found, s in zip(values, tustin, strict=True):
            expected = [np.polyval(each.block.num, s) / np.polyval(each.block.den, s) for each in law.parts]
            np.testing.assert_allclose(found[0, :2], np.negative(expected), rtol=1e-6)
