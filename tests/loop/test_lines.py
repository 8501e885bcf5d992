"""Crossings of the imaginary axis along a line of gains, against poles on either side found in a box."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.agreement import some_free_arm, some_gains
from tests.loop.arms import window_arm, with_damping
from tests.loop.ritz_loop import RitzLoop
from tfarm import Arm, Hub, HubFeedback, Payload
from tfarm.loop.frequencies import grid, steep_places
from tfarm.loop.lines import Line, along, crossing_at_zero, line_crossings
from tfarm.loop.loop import Loop
from tfarm.loop.poles import poles_below
from tfarm.loop.stability import band_of_loop

LAB = tfarm.load("sasaki2012-lab")


def held(C=1e-4) -> Arm:
    """The lab arm with its tip pinned: no rigid-body mode, a static stiffness."""
    return replace(with_damping(LAB, C), payload=Payload(mass=math.inf))


def test_a_line_takes_one_gain_through_its_own_values() -> None:
    law = HubFeedback(K1=0.3, K2=-2.0, Kp=5.0)
    for name in ("K1", "K2", "Kp"):
        assert along(name, law).at(0.7) == replace(law, **{name: 0.7})
    assert Line(law, HubFeedback(K1=1.0, Kp=2.0)).at(-2.0) == HubFeedback(K1=-1.7, K2=-2.0, Kp=1.0)


CASES = [(arm, name) for arm in (LAB, window_arm(), held()) for name in ("K1", "K2", "Kp")]
EMPTY = {(LAB, "Kp"), (held(), "K2"), (held(), "Kp")}


@pytest.mark.parametrize(("arm", "name"), CASES)
def test_at_each_crossing_a_pole_of_that_frequency_is_on_the_axis_and_goes_the_way_it_says(arm, name) -> None:
    law = HubFeedback(K1=0.3 if arm is not window_arm() else 1.0, K2=-9.0)
    line = along(name, law)
    band = band_of_loop(Loop(arm, law))[0]
    found = [each for each in line_crossings(arm, line, band) if each.at and abs(each.t) < 1e9][:6]
    assert bool(found) != ((arm, name) in EMPTY)
    for each in found:
        step = 1e-6 * max(abs(each.t), 1e-3)
        real = [_next_to(arm, line.at(each.t + way * step), each.at) for way in (-1, 1)]
        assert real[0] * each.change < 0 < real[1] * each.change


def _next_to(arm, law, omega) -> float:
    """The real part of the pole next to i omega, by a secant on the loop function of a transfer function."""
    plant = tfarm.transfer(arm, ["hub_angle", "root_moment"])

    def f(s):
        theta, moment = plant(np.array([s]))[:, 0]
        return 1 + (law.Kp + law.K1 * s) * theta + law.K2 * moment

    a, b = 1j * omega, 1j * omega * (1 + 1e-6) + 1e-6 * omega
    for _ in range(60):
        if a == b or f(a) == f(b):
            break
        a, b = b, b - f(b) * (b - a) / (f(b) - f(a))
        if abs(b - a) < 1e-13 * abs(b):
            break
    assert abs(b - 1j * omega) < 0.02 * omega
    return b.real


def test_no_crossing_is_missed_the_count_steps_as_they_say() -> None:
    rng = np.random.default_rng(11)
    for _ in range(3):
        arm = some_free_arm(rng, damped=True)
        K1, K2, Kp = some_gains(rng, arm, 2)
        law, model = HubFeedback(K1=float(K1[-1]), K2=float(K2[0]), Kp=Kp), RitzLoop(arm, 20)
        line = along("K2", law)
        found = line_crossings(arm, line, band_of_loop(Loop(arm, line.at(-25.0)))[0])
        for low, high in ((-25.0, -3.0), (-3.0, 0.5), (0.5, 4.0)):
            counts = [int((model.eigenvalues(line.at(t)).real > 0).sum()) for t in (low, high)]
            assert counts[1] - counts[0] == sum(each.change for each in found if low < each.t < high)


@pytest.mark.parametrize("K1", [0.3, 1e-6, 1e3, -2.0])
def test_the_real_pole_of_a_free_arm_passes_zero_at_kp_zero_exactly(K1) -> None:
    each = crossing_at_zero(LAB, along("Kp", HubFeedback(K1=K1, K2=-10.0)))
    assert (each.t, each.at, each.change) == (0.0, 0.0, -1 if K1 > 0 else 1)
    assert crossing_at_zero(window_arm(), along("Kp", HubFeedback(K1=1.0, K2=-10.0))).t == 0


@pytest.mark.parametrize(("K2", "change"), [(0.3, -1), (5.0, 1)])
def test_damping_the_hub_passes_zero_at_k1_zero_by_the_sign_of_the_effective_inertia(K2, change) -> None:
    each = crossing_at_zero(LAB, along("K1", HubFeedback(K2=K2)))
    assert (each.t, each.change) == (0.0, change)
    assert crossing_at_zero(LAB, along("K1", HubFeedback(K2=K2, Kp=1.0))) is None
    assert crossing_at_zero(LAB, along("K2", HubFeedback(K1=1.0))) is None


def test_without_other_gains_the_gauge_cancels_the_inertia_at_one_k2() -> None:
    each = crossing_at_zero(LAB, along("K2", HubFeedback()))
    J, hub = LAB.total_inertia, LAB.hub.inertia
    assert each.t == pytest.approx(J / (J - hub), rel=1e-15)
    loop = Loop(LAB, HubFeedback(K2=each.t * 1.01))
    assert poles_below(loop, 50.0).unstable > 0
    assert poles_below(Loop(LAB, HubFeedback(K2=each.t * 0.99)), 20.0).values.real.max() < 1e-9


def test_a_hub_that_rounds_the_arm_away_has_no_k2_that_cancels_it() -> None:
    arm = replace(LAB, hub=Hub(inertia=1e20))
    assert arm.total_inertia == arm.hub.inertia
    assert crossing_at_zero(arm, along("K2", HubFeedback())) is None


@pytest.mark.parametrize(("K2", "expected"), [(0.5, 1), (-0.5, -1), (0.0, -1)])
def test_stiffness_without_k1_leaves_an_oscillation_that_k2_drives_or_damps(K2, expected) -> None:
    """From one real unstable pole to two or to none: with C > 0 the gauge lags by C behind the inertia it feels."""
    each = crossing_at_zero(LAB, along("Kp", HubFeedback(K2=K2)))
    assert each.change == expected
    model = RitzLoop(LAB, 14)
    below, above = (int((model.eigenvalues(HubFeedback(K2=K2, Kp=Kp)).real > 0).sum()) for Kp in (-0.5, 0.5))
    assert (below, above - below) == (1, expected)


def test_a_held_tip_gives_way_where_stiffness_vanishes() -> None:
    """k = 3 E I/L and a little shear: a pinned arm's static stiffness at the root; K2 takes its share of it."""
    arm, K2 = held(), -0.7
    link = arm.link
    flexibility = link.length / (3 * link.EI) + 1 / (link.kGA * link.length)
    each = crossing_at_zero(arm, along("Kp", HubFeedback(K1=0.3, K2=K2)))
    assert each.t == pytest.approx(-(1 - K2) / flexibility, rel=1e-11)
    assert each.change == -1
    assert crossing_at_zero(arm, along("K1", HubFeedback(K1=0.3))) is None
    for K1, change in ((0.3, 1), (-3.0, -1)):
        static = crossing_at_zero(arm, along("K2", HubFeedback(K1=K1, Kp=20.0)))
        assert static.t == pytest.approx(1 + 20.0 * flexibility, rel=1e-11)
        assert static.change == change


def test_the_grid_has_points_closer_to_every_steep_place_than_its_width() -> None:
    omega = np.asarray(grid(LAB, 5000.0))
    assert (np.diff(omega) > 0).all()
    assert omega[-1] == 5000.0
    hubless = replace(LAB, hub=Hub(inertia=math.inf))
    locked = tfarm.modes(hubless, up_to=5000.0).natural_frequency
    for place in locked:
        assert np.isin(np.round(place, 9), np.round(np.asarray(steep_places(LAB, 5250.0)), 9))
        assert abs(omega - place).min() < LAB.link.damping * place**2


@pytest.mark.parametrize("name", ["K1", "K2", "Kp"])
@pytest.mark.parametrize("Kp", [0.0, 3.0])
def test_along_a_longer_direction_the_same_crossing_is_at_less(name, Kp):
    """Of the pole through the origin: the same law is reached at a third of the way, and as many poles have changed."""
    arm = replace(tfarm.load("sasaki2012-lab"), hub=Hub(inertia=0.1, friction=0.4))
    base = HubFeedback(K1=0.2, K2=0.1, Kp=Kp)
    if name == "K2":
        base = base.having("K1", -0.4)  # no rate is left, so that the inertia decides
    line = along(name, base)
    one = crossing_at_zero(arm, line)
    three = crossing_at_zero(arm, Line(line.base, HubFeedback(**{name: 3.0})))
    assert (one is None) == (three is None) == (Kp != 0.0 and name != "Kp")
    if one is not None:
        assert three.t == pytest.approx(one.t / 3, rel=1e-14)
        assert three.change == one.change


def test_a_grid_begins_at_a_millionth_of_the_first_steep_place():
    arm = tfarm.load("sasaki2012-lab")
    first = tfarm.modes(arm.having(hub_inertia=math.inf), 1).natural_frequency[-1]  # locked: the lowest of all
    assert grid(arm, 1e3)[0] == pytest.approx(1e-6 * first, rel=1e-12)
    assert grid(arm, 1e3)[-1] == pytest.approx(1e3, rel=1e-12)
