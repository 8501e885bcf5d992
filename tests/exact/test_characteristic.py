"""The characteristic function D, open and fed back: in float64, in balls and over wide balls."""

import math
from itertools import product

import flint
import mpmath
import numpy as np
import pytest

import tfarm
from tests.shared import sized, thinned
from tests.spectrum.independent import delta
from tests.strategies import ENDS, some_arm
from tests.transition import determinant
from tfarm import HubFeedback
from tfarm.case import Case
from tfarm.exact.balls import point, precision
from tfarm.exact.characteristic import (
    Analytic,
    characteristic,
    characteristic_ball,
    characteristic_over,
    quick_characteristics,
    tangent,
)
from tfarm.exact.system import system_of
from tfarm.loop.continuous import ContinuousLoop

EPS = np.finfo(float).eps
LAW = {"Kp": 2.0, "K1": 0.3, "K2": 0.4}
S = np.array([1.0, 1j, -3 + 40j, 2 + 900j, -2e3 + 5e3j, 1e-3j, -5e4])


def arm_at(case, seed=5, damping=1e-5):
    return some_arm(np.random.default_rng(seed), case, damping=damping, slenderness=(8, 60))


def number(ball):
    return mpmath.mpc(ball.real.mid().str(60, radius=False), ball.imag.mid().str(60, radius=False))


def balls(k, s, law=None):
    """D as mpmath numbers of 60 digits."""
    with precision(300), mpmath.workdps(60):
        return [number(characteristic_ball(k, point(complex(at)), law)) for at in s]


def true_value(at):
    with mpmath.workdps(30):
        return [mpmath.mpc(v) * mpmath.exp(mpmath.mpc(c)) for v, c in zip(at.value, at.scale, strict=True)]


def allowed(law, hub):
    """The gains that a hub may have: without inertia its moment is the torque itself, an algebraic loop."""
    return {name: gain for name, gain in law.items() if name != "K2" or hub != "zero"}


def laws(case):
    """No feedback, and the gains where the hub is free to turn."""
    return ({}, allowed(LAW, case[0])) if case[0] != "infinite" else ({},)


def exact(arm, law):
    return ContinuousLoop(Case(arm, HubFeedback(**law))).exact if law else None


def in_doubles(arm, law, s):
    """D of a loop, its zeros at the origin multiplied in again; both kinds without a law."""
    if not law:
        return characteristic(system_of(arm), s), quick_characteristics(system_of(arm), s)
    loop = ContinuousLoop(Case(arm, HubFeedback(**law)))
    at, n = loop.function(s), loop.zeros_at_origin
    return (Analytic(at.value * s**n, (at.slope + n / s * at.value) * s**n, at.scale),)


@pytest.mark.parametrize("points", sized(6, 7))  # the last of S takes longer than all others
@pytest.mark.parametrize("case", thinned([(each,) for each in list(product(ENDS, repeat=3))[::6]], 5))
def test_D_is_the_determinant_of_the_transition_matrices_but_for_a_constant(case, points) -> None:
    arm = arm_at(case)
    ours = balls(system_of(arm), S[:points])
    with mpmath.workdps(40):
        ratio = [determinant(arm, s) / value for s, value in zip(S[:points], ours, strict=True)]
        assert max(abs(r / ratio[0] - 1) for r in ratio) < 1e-30


@pytest.mark.parametrize("case", [*list(product(ENDS, repeat=3))[1::4], "tests/rigs/bench-rig.toml"])
def test_float64_agrees_with_balls_at_random_s(case) -> None:
    rng = np.random.default_rng(11)
    arm = tfarm.load(case) if isinstance(case, str) else arm_at(case, seed=6)
    k = system_of(arm)
    size = 3 * tfarm.modes(arm, 8).natural_frequency[-1]
    s = np.array(
        [complex(rng.uniform(-0.5, 0.5), rng.uniform(-1, 1)) * size * 10 ** rng.uniform(-3, 0) for _ in range(40)]
    )
    for law in laws(case):
        theirs = balls(k, s, exact(arm, law))
        for fast in in_doubles(arm, law, s):
            conditioning = 1 + abs(s * fast.slope / fast.value)
            errors = [float(abs(a / b - 1)) for a, b in zip(true_value(fast), theirs, strict=True)]
            assert (np.array(errors) / conditioning).max() < 64 * EPS


def test_slopes_are_derivatives_of_the_values() -> None:
    """(log D)' of each against a difference of 60-digit balls."""
    arm = arm_at(("some", "some", "some"))
    k = system_of(arm)
    for law in ({}, LAW):
        fed, kinds = exact(arm, law), in_doubles(arm, law, S)
        with precision(400), mpmath.workdps(60):
            for n, s in enumerate(S):
                h = 1e-20 * abs(s)
                here = point(complex(s))
                up, down = (number(characteristic_ball(k, here + sign * h, fed)) for sign in (1, -1))
                wanted = complex((up - down) / (2 * mpmath.mpf(h) * number(characteristic_ball(k, here, fed))))
                for kind, tolerance in zip(kinds, (1e-6,) if law else (1e-11, 1e-6), strict=True):
                    assert kind.slope[n] / kind.value[n] == pytest.approx(wanted, rel=tolerance)


@pytest.mark.parametrize("name", ["sasaki2012-lab", "tests/rigs/bench-rig.toml"])
@pytest.mark.parametrize("at_zero", [0, 1, 2])
def test_the_quick_function_is_the_other_without_its_zeros_at_rest(name, at_zero) -> None:
    """Values to rounding and slopes to what differences give: of one link and of a chain."""
    k, s = system_of(tfarm.load(name)), np.array([1e-3j, 2.0, -3 + 40j, 2 + 900j, -80 + 5e3j])
    whole, quick = characteristic(k, s, at_zero), quick_characteristics(k, s, at_zero)
    ratio = quick.value * np.exp(quick.scale - whole.scale) / whole.value
    assert abs(ratio - 1).max() < 1e-9
    assert quick.slope / quick.value == pytest.approx(whole.slope / whole.value, rel=1e-6)


@pytest.mark.parametrize("name", ["sasaki2012-lab", "tests/rigs/bench-rig.toml"])
def test_with_its_zero_at_rest_divided_out_the_function_is_its_limit_there(name) -> None:
    """(K1 + what the hub loses) theta, not 0: else a box would hold a pole at rest twice."""
    loop = ContinuousLoop(Case(tfarm.load(name), HubFeedback(K1=0.3, K2=0.4)))
    assert loop.zeros_at_origin == 1
    at = loop.function(np.array([0j, 1e-9]))
    assert at.value[0] == pytest.approx(at.value[1], rel=1e-8)
    assert at.value[0] != 0


@pytest.mark.parametrize("law", [{"Kp": 2.0}, {"K1": 0.3}, {"K2": 0.4}, {"K2": -3.0}, LAW], ids=str)
def test_feedback_changes_the_hub_row_of_the_papers_matrix(law) -> None:
    """D with gains over D without is the paper's Delta with the changed row over Delta: no common factor is left."""
    for case in (
        ("some", "some", "some"),
        ("some", "zero", "zero"),
        ("some", "infinite", "some"),
        ("zero", "some", "zero"),
    ):
        arm, gains = arm_at(case, seed=8), allowed(law, case[0])
        k = system_of(arm)
        s = S[:5]
        fed, free = balls(k, s, exact(arm, gains)), balls(k, s)
        with mpmath.workdps(80):
            theirs = [delta(arm, at, **gains) / delta(arm, at) for at in s]
            assert max(abs(a / b / t - 1) for a, b, t in zip(fed, free, theirs, strict=True)) < 1e-30


@pytest.mark.parametrize(
    "case",
    [("some", "some", "some"), ("zero", "some", "zero"), ("some", "infinite", "zero"), ("infinite", "zero", "zero")],
)
def test_zeros_at_the_origin_are_as_many_as_the_order_of_D_there(case) -> None:
    arm = arm_at(case)
    k = system_of(arm)
    small = np.array([1e-3, 1e-4]) * tfarm.modes(arm, 1).natural_frequency[-1]
    for K1, K2, Kp in [(0, 0, 0)] if case[0] == "infinite" else [(0, 0, 0), (1, 0.2, 0), (0, 0.2, 0), (1, 0.2, 3)]:
        law = allowed({"K1": K1, "K2": K2, "Kp": Kp} if any((K1, K2, Kp)) else {}, case[0])
        at = small * (1e-9 if K1 else 1.0)  # where K1 s outweighs the inertia
        far, near = (abs(each) for each in balls(k, at.astype(complex), exact(arm, law)))
        order = ContinuousLoop(Case(arm, HubFeedback(**law))).zeros_at_origin if law else k.at_rest
        assert float(mpmath.log10(far / near)) == pytest.approx(order, abs=1e-2)


def wide(middle, radius):
    return flint.acb(flint.arb(middle.real, radius), flint.arb(middle.imag, radius))


@pytest.mark.parametrize("case", list(product(ENDS, repeat=3))[2::5])
def test_a_wide_ball_holds_every_value_in_it(case) -> None:
    """Steps of contours, short and long, but for the factor > 0 found at the middle (1 in the plain form)."""
    rng = np.random.default_rng(3)
    arm = arm_at(case, seed=9, damping=1e-4)
    k = system_of(arm)
    omega = tfarm.modes(arm, 4).natural_frequency[-1]
    with precision(160):
        for _ in range(25):
            middle = complex(rng.uniform(-0.3, 0.3), rng.uniform(0.1, 1)) * omega
            along = abs(middle) * 10 ** rng.uniform(-4, -0.2) * rng.choice([1.0, 1j])
            over = characteristic_over(k, point(middle - along).union(point(middle + along)))
            factor = abs(characteristic_over(k, point(middle)) / characteristic_ball(k, point(middle)))
            inside = [characteristic_ball(k, point(middle + along * t)) for t in (-1, -0.7, 0.4, 0.95, 1)]
            held = [all(over.overlaps(value * unit) for value in inside) for unit in (factor, flint.arb(1))]
            assert any(held)


def test_a_step_that_is_narrow_for_D_gives_a_ball_off_zero() -> None:
    """The point of Taylor's form: the plain one loses the sign of D over so wide a ball."""
    k = system_of(tfarm.load("sasaki2012-lab"))
    with precision(96):
        assert not characteristic_over(k, wide(300 + 5000j, 10.0)).contains(0)
        assert characteristic_ball(k, wide(300 + 5000j, 10.0)).contains(0)


def test_the_tangent_bounds_the_remainder_over_a_disc() -> None:
    rng = np.random.default_rng(4)
    k = system_of(tfarm.load("sasaki2012-lab"))
    with precision(300):
        for middle, radius in ((-0.25 + 71.5j, 3.0), (-200 + 4000j, 40.0), (5000 + 100j, 10.0)):
            value, slope, half = tangent(k, point(middle), flint.arb(radius))
            factor = value / characteristic_ball(k, point(middle))
            for _ in range(20):
                away = radius * np.sqrt(rng.random()) * np.exp(2j * math.pi * rng.random())
                there = characteristic_ball(k, point(middle + away)) * factor
                rest = there - value - slope * point(away)
                assert not abs(rest) > abs(half) * radius**2
            h = flint.arb(2) ** -120
            up, down = (characteristic_ball(k, point(middle) + sign * h) for sign in (1, -1))
            difference = (up - down) / (2 * h) * factor
            assert slope.contains(difference) or abs(slope / difference - 1) < 1e-30
