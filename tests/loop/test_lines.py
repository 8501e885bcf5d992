"""Crossings of the imaginary axis along one gain, against poles on either side found in another way."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.agreement import some_free_arm, some_gains
from tests.loop.arms import held, held_stiffness, some_loop, window_arm
from tests.loop.ritz_loop import RitzLoop
from tfarm import Hub, HubFeedback, ParameterError
from tfarm.loop.loop import Loop
from tfarm.loop.poles import closed_loop_poles
from tfarm.loop.stability import band_of_loop
from tfarm.loop.windows import line_crossings

LAB = tfarm.load("sasaki2012-lab")


def crossings(arm, law, name, reach, band=None):
    loop = Loop(arm, law)
    return line_crossings(loop, name, -reach, reach, band or band_of_loop(loop)[0])


def at_rest(arm, law, name, reach):
    """The crossing at s = 0, or None."""
    return next((each for each in crossings(arm, law, name, reach, 100.0) if each.at == 0), None)


CASES = [(arm, name) for arm in (LAB, window_arm(), held()) for name in ("K1", "K2", "Kp")]
EMPTY = {(LAB, "Kp"), (held(), "K2"), (held(), "Kp")}


@pytest.mark.parametrize(("arm", "name"), CASES)
def test_at_each_crossing_a_pole_of_that_frequency_is_on_the_axis_and_goes_the_way_it_says(arm, name) -> None:
    law = HubFeedback(K1=0.3 if arm is not window_arm() else 1.0, K2=-9.0)
    found = [each for each in crossings(arm, law, name, 1e5) if each.at][:6]
    assert bool(found) != ((arm, name) in EMPTY)
    for each in found:
        step = 1e-6 * max(abs(each.t), 1e-3)
        real = [_next_to(arm, law.having(name, each.t + way * step), each.at) for way in (-1, 1)]
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
        found = crossings(arm, law, "K2", 25.0, band_of_loop(Loop(arm, law.having("K2", -25.0)))[0])
        for low, high in ((-25.0, -3.0), (-3.0, 0.5), (0.5, 4.0)):
            counts = [int((model.eigenvalues(law.having("K2", t)).real > 0).sum()) for t in (low, high)]
            assert counts[1] - counts[0] == sum(each.change for each in found if low < each.t < high)


@pytest.mark.parametrize("K1", [0.3, 1e-6, 1e3, -2.0])
def test_the_real_pole_of_a_free_arm_passes_zero_at_kp_zero_exactly(K1) -> None:
    each = at_rest(LAB, HubFeedback(K1=K1, K2=-10.0), "Kp", 20.0)
    assert (each.t, math.copysign(1.0, each.t), each.change) == (0.0, 1.0, -1 if K1 > 0 else 1)


def test_a_held_tip_gives_way_where_stiffness_vanishes() -> None:
    """K2 takes its share of the stiffness."""
    arm, K2 = held(), -0.7
    flexibility = 1 / held_stiffness(arm)
    each = at_rest(arm, HubFeedback(K1=0.3, K2=K2), "Kp", 2e3)
    assert (each.t, each.change) == (pytest.approx(-(1 - K2) / flexibility, rel=1e-9), -1)
    assert at_rest(arm, HubFeedback(K1=0.3), "K1", 5.0) is None
    for K1, change in ((0.3, 1), (-3.0, -1)):
        static = at_rest(arm, HubFeedback(K1=K1, Kp=20.0), "K2", 5.0)
        assert (static.t, static.change) == (pytest.approx(1 + 20.0 * flexibility, rel=1e-9), change)


ARM = tfarm.load("sasaki2012")


@pytest.mark.parametrize(
    ("inertia", "law", "words"),
    [(math.inf, HubFeedback(K1=0.3), "has no loop"), (0.0, HubFeedback(K1=0.3, K2=0.1), "an algebraic loop")],
)
def test_where_there_is_no_loop(inertia: float, law, words: str) -> None:
    with pytest.raises(ParameterError, match=words) as refused:
        Loop(replace(ARM, hub=Hub(inertia=inertia)), law)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("seed", range(5))
def test_the_loop_function_is_made_of_transfer_functions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm, law = some_loop(rng)
    omega = tfarm.modes(arm, 3).natural_frequency[-1]
    s = omega * rng.uniform(0.05, 1, 12) * np.exp(1j * rng.uniform(-1.4, 1.4, 12))
    theta, moment = tfarm.transfer(arm, ["hub_angle", "root_moment"])(s)
    terms = np.array([law.Kp * theta, law.K1 * s * theta, law.K2 * moment])
    miss = abs(Loop(arm, law).loop_function(s) - terms.sum(axis=0))
    assert (miss < 1e-12 * abs(terms).sum(axis=0)).all()


@pytest.mark.parametrize("K2", [-4.0, 0.0, 0.5, 1.2])
@pytest.mark.parametrize("radius", [0.0, 0.2])
def test_slow_torque_turns_the_effective_inertia(K2: float, radius: float) -> None:
    """The slow real pole tends to -K1/J_eff as K1 -> 0; a gauge on a hub's rim does not read all that the hub turns."""
    arm, misses = replace(ARM, hub=replace(ARM.hub, radius=radius)), []
    for K1 in (1e-2, 1e-3):
        slow = closed_loop_poles(arm, HubFeedback(K1=K1, K2=K2), 6).moving
        slow = slow[abs(slow).argmin()].real
        misses.append(abs(slow * Loop(arm, HubFeedback(K2=K2)).at_rest[2] / -K1 - 1))
    assert misses[1] < 1e-3
    assert misses[1] < misses[0] / 30 or misses[1] < 1e-12
