"""The characteristic function D, open and fed back: in float64, in balls and over wide balls."""

import math
from itertools import product

import flint
import mpmath
import numpy as np
import pytest

import tfarm
from tests.shared import sized, thinned
from tests.spectrum.damped_roads import delta, newton_step, shot
from tests.strategies import ENDS, some_arm, some_s
from tfarm import HubFeedback
from tfarm.exact.balls import point, precision
from tfarm.exact.characteristic import (
    NO_GAINS,
    as_column,
    characteristic,
    characteristic_ball,
    characteristic_over,
    gains_of,
    loop_system,
    quick_characteristics,
    tangent,
    zeros_at_origin,
)
from tfarm.exact.system import system_of

EPS = np.finfo(float).eps
LAW = {"Kp": 2.0, "K1": 0.3, "K2": 0.4}
S = np.array([1.0, 1j, -3 + 40j, 2 + 900j, -2e3 + 5e3j, 1e-3j, -5e4])


def quick_characteristic(k, s, gains=NO_GAINS, at_zero=0):
    """With slopes from differences."""
    return quick_characteristics(k, s, as_column(gains), at_zero)


def arm_at(case, seed=5, damping=1e-5):
    return some_arm(np.random.default_rng(seed), case, damping=damping, slenderness=(8, 60))


def number(ball):
    return mpmath.mpc(ball.real.mid().str(60, radius=False), ball.imag.mid().str(60, radius=False))


def balls(k, s, gains=NO_GAINS):
    """D as mpmath numbers of 60 digits."""
    with precision(300), mpmath.workdps(60):
        return [number(characteristic_ball(k, point(complex(at)), gains)) for at in s]


def true_value(at):
    with mpmath.workdps(30):
        return [mpmath.mpc(v) * mpmath.exp(mpmath.mpc(c)) for v, c in zip(at.value, at.scale, strict=True)]


def laws(case):
    """No feedback, and all three gains where the hub is free to turn."""
    return ({}, LAW) if case[0] != "infinite" else ({},)


def gains_under(k, law):
    return gains_of(k, HubFeedback(**law)) if law else NO_GAINS


@pytest.mark.parametrize("points", sized(6, 7))  # the last of S takes longer than all others
@pytest.mark.parametrize("case", thinned([(each,) for each in list(product(ENDS, repeat=3))[::6]], 5))
def test_D_is_the_determinant_of_the_shot_arm_but_for_a_constant(case, points) -> None:
    arm = arm_at(case)
    k = system_of(arm)
    for law in laws(case):
        ours = balls(k, S[:points], gains_under(k, law))
        with mpmath.workdps(40):
            ratio = [shot(arm, s, **law) / value for s, value in zip(S[:points], ours, strict=True)]
            assert max(abs(r / ratio[0] - 1) for r in ratio) < 1e-30


@pytest.mark.parametrize("case", list(product(ENDS, repeat=3))[1::4])
def test_float64_agrees_with_balls_at_random_s(case) -> None:
    rng = np.random.default_rng(11)
    arm = arm_at(case, seed=6)
    k = system_of(arm)
    size = 3 * tfarm.modes(arm, 8).natural_frequency[-1]
    s = np.array(
        [complex(rng.uniform(-0.5, 0.5), rng.uniform(-1, 1)) * size * 10 ** rng.uniform(-3, 0) for _ in range(40)]
    )
    for law in laws(case):
        gains = gains_under(k, law)
        ours = characteristic(k, s, gains)
        quick = quick_characteristic(k, s, gains)
        theirs = balls(k, s, gains)
        conditioning = 1 + abs(s * ours.slope / ours.value)
        for fast, tolerance in ((ours, 64 * EPS), (quick, 64 * EPS)):
            errors = [float(abs(a / b - 1)) for a, b in zip(true_value(fast), theirs, strict=True)]
            assert (np.array(errors) / conditioning).max() < tolerance


def test_slopes_are_derivatives_of_the_values() -> None:
    """(log D)' of each against a difference of 60-digit balls."""
    arm = arm_at(("some", "some", "some"))
    k = system_of(arm)
    for law in ({}, LAW):
        gains = gains_under(k, law)
        ours, quick = characteristic(k, S, gains), quick_characteristic(k, S, gains)
        with precision(400), mpmath.workdps(60):
            for n, s in enumerate(S):
                h = 1e-20 * abs(s)
                here = point(complex(s))
                up, down = (number(characteristic_ball(k, here + sign * h, gains)) for sign in (1, -1))
                middle = number(characteristic_ball(k, here, gains))
                wanted = complex((up - down) / (2 * mpmath.mpf(h) * middle))
                assert ours.slope[n] / ours.value[n] == pytest.approx(wanted, rel=1e-11)
                assert quick.slope[n] / quick.value[n] == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("name", ["sasaki2012-lab", "tests/rigs/bench-rig.toml"])
@pytest.mark.parametrize("at_zero", [0, 1, 2])
def test_the_quick_function_is_the_other_without_its_zeros_at_rest(name, at_zero) -> None:
    """Values to rounding and slopes to what differences give: of one link and of a chain."""
    k, s = loop_system(tfarm.load(name)), np.array([1e-3j, 2.0, -3 + 40j, 2 + 900j, -80 + 5e3j])
    gains = gains_of(k, HubFeedback(K1=0.3, K2=0.4))
    exact, quick = characteristic(k, s, gains, at_zero), quick_characteristic(k, s, gains, at_zero)
    ratio = quick.value * np.exp(quick.scale - exact.scale) / exact.value
    assert abs(ratio - 1).max() < 1e-9
    assert quick.slope / quick.value == pytest.approx(exact.slope / exact.value, rel=1e-6)


@pytest.mark.parametrize("name", ["sasaki2012-lab", "tests/rigs/bench-rig.toml"])
def test_with_its_zero_at_rest_divided_out_the_function_is_its_limit_there(name) -> None:
    """(K1 + what the hub loses) theta, not 0: else a box would hold a pole at rest twice."""
    k = loop_system(tfarm.load(name))
    gains, rest = gains_of(k, HubFeedback(K1=0.3, K2=0.4)), np.array([0j, 1e-9])
    assert zeros_at_origin(k, gains) == 1
    for at in (characteristic(k, rest, gains, 1), quick_characteristic(k, rest, gains, 1)):
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
        arm = arm_at(case, seed=8)
        k = system_of(arm)
        gains = gains_of(k, HubFeedback(**law))
        s = S[:5]
        fed, free = balls(k, s, gains), balls(k, s)
        with mpmath.workdps(80):
            theirs = [delta(arm, at, **law) / delta(arm, at) for at in s]
            assert max(abs(a / b / t - 1) for a, b, t in zip(fed, free, theirs, strict=True)) < 1e-30


def test_a_closed_loop_pole_in_float64_is_one_of_the_papers_matrix() -> None:
    arm = tfarm.load("sasaki2012-lab")
    k = system_of(arm)
    gains = gains_of(k, HubFeedback(K1=0.3, K2=0.3, Kp=0.5))
    s = np.array([-3 + 70j, -3 + 200j, -20 + 530j])
    for _ in range(60):
        at = characteristic(k, s, gains)
        s = s - at.value / at.slope
    assert max(newton_step(arm, z, Kp=0.5, K1=0.3, K2=0.3) for z in s) < 1e-14


def test_D_is_linear_in_the_gains_and_the_gauge_does_not_read_the_damping() -> None:
    """dD/dK2 is M/(1 + C s), the moment without its damping part: E I psi'(0) over theta as `transfer` has it."""
    arm = tfarm.load("sasaki2012-lab")
    k = system_of(arm)
    s = S[:5]
    none, by_angle, by_gauge = (
        np.array([complex(v) for v in true_value(characteristic(k, s, gains_of(k, HubFeedback(K2=K2, Kp=Kp))))])
        for Kp, K2 in ((0.0, 0.0), (1e3, 0.0), (0.0, 1e3))
    )
    gauge = tfarm.transfer(arm, "root_moment")(s) / tfarm.transfer(arm, "hub_angle")(s)
    np.testing.assert_allclose((by_gauge - none) / (by_angle - none), gauge, rtol=1e-11)


@pytest.mark.parametrize(
    "case",
    [("some", "some", "some"), ("zero", "some", "zero"), ("some", "infinite", "zero"), ("infinite", "zero", "zero")],
)
def test_zeros_at_the_origin_are_as_many_as_the_order_of_D_there(case) -> None:
    arm = arm_at(case)
    k = system_of(arm)
    small = np.array([1e-3, 1e-4]) * tfarm.modes(arm, 1).natural_frequency[-1]
    laws = [(0, 0, 0)] if case[0] == "infinite" else [(0, 0, 0), (1, 0.2, 0), (0, 0.2, 0), (1, 0.2, 3)]
    for K1, K2, Kp in laws:
        gains = gains_of(k, HubFeedback(K1=K1, K2=K2, Kp=Kp)) if any((K1, K2, Kp)) else NO_GAINS
        at = small * (1e-9 if K1 else 1.0)  # where K1 s outweighs the inertia
        value = characteristic(k, at.astype(complex), gains).value.real
        order = np.log10(value[0] / value[1])
        assert order == pytest.approx(zeros_at_origin(k, gains), abs=1e-2)


def test_zeros_at_the_origin_are_divided_out() -> None:
    arm = tfarm.load("sasaki2012-lab")
    k = system_of(arm)
    whole = characteristic(k, S)
    for kind in (characteristic, quick_characteristic):
        less = kind(k, S, NO_GAINS, 2)
        np.testing.assert_allclose(less.value * S**2 * np.exp(less.scale - whole.scale), whole.value, rtol=1e-12)
        rate = whole.slope / whole.value - 2 / S
        np.testing.assert_allclose(less.slope / less.value, rate, rtol=1e-6, atol=1e-6 * abs(1 / S).min())


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
            assert (
                slope.contains(_difference(k, middle, factor))
                or abs(slope / _difference(k, middle, factor) - 1) < 1e-30
            )


def _difference(k, middle, factor):
    h = flint.arb(2) ** -120
    up, down = (characteristic_ball(k, point(middle) + sign * h) for sign in (1, -1))
    return (up - down) / (2 * h) * factor


def test_random_points_of_the_plane_need_no_warning() -> None:
    rng = np.random.default_rng(21)
    for _ in range(60):
        k = system_of(some_arm(rng, damping=float(10 ** rng.uniform(-9, -2))))
        s = np.array([some_s(rng) for _ in range(10)])
        at = characteristic(k, s)
        quick = quick_characteristic(k, s)
        assert np.isfinite([*at.value, *at.slope, *at.scale, *quick.value]).all()
