"""What V proves against the exact poles."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.arms import held, held_stiffness, some_loop, window_arm
from tests.shared import thinned
from tfarm import Hub, HubFeedback, ParameterError
from tfarm.loop.loop import Loop
from tfarm.loop.poles import closed_loop_poles, poles_below
from tfarm.loop.theorem import lyapunov
from tfarm.spectrum import modes_below

ARM = tfarm.load("sasaki2012")
LAB = tfarm.load("sasaki2012-lab")


def law(K1=0.3, K2=0.3, Kp=0.0):
    return HubFeedback(K1=K1, K2=K2, Kp=Kp)


def unstable(arm, feedback, count=8):
    return closed_loop_poles(arm, feedback, count).unstable


@pytest.mark.parametrize("K2", [-1e6, -10.0, 0.0, 0.3, 0.999])
def test_weights_prove_every_K2_below_one(K2: float) -> None:
    found = lyapunov(ARM, law(K2=K2))
    assert found.proven
    assert found.kind == "dissipated"
    assert found.a1_over_a2 == 1 - K2


def test_without_K1_V_is_constant() -> None:
    found = lyapunov(ARM, law(K1=0.0))
    assert (found.proven, found.kind, found.a1_over_a2) == (True, "conserved", 0.7)
    poles = closed_loop_poles(ARM, law(K1=0.0), 8)
    assert abs(poles.values.real).max() < 1e-12 * abs(poles.values).max()


@pytest.mark.parametrize(
    ("arm", "feedback", "words"),
    [
        (ARM, law(K1=-0.1), "K1 = -0.1 supplies energy"),
        (ARM, law(K2=1.0), "hub alone"),
        (ARM, law(K2=1.5), "1 - K2 = -0.5 is negative"),
        (ARM, law(Kp=-2.0), "Kp = -2 is below"),
        (LAB, law(K2=0.1), "gauge signal has no term in the damping"),
        (LAB, law(K2=-0.1), "gauge signal has no term in the damping"),
    ],
)
def test_where_no_weights_exist(arm, feedback, words: str) -> None:
    found = lyapunov(arm, feedback)
    assert (found.proven, found.a1_over_a2, found.kind) == (False, None, "unproven")
    assert words in found.reason
    assert "\n" not in found.reason


@pytest.mark.parametrize("seed", thinned(range(4), 2))
def test_at_zero_damping_proven_is_stable_and_unproven_unstable(seed: int) -> None:
    """On random arms, payloads and tips, off the edges K1 = 0 and K2 = 1 of the region."""
    rng, seen = np.random.default_rng(seed), []
    while len(seen) < 12:
        arm, feedback = some_loop(rng, damping=0.0)
        if feedback.K1:
            proven = lyapunov(arm, feedback).proven
            seen.append(proven)
            assert proven == (unstable(arm, feedback, 6) == 0), (arm, feedback)
    assert 0 < sum(seen) < len(seen)


def test_a_negative_spring_is_proven_up_to_the_stiffness_of_a_held_tip() -> None:
    arm, K2 = held(0.0), 0.4
    edge = -(1 - K2) * held_stiffness(arm)
    for Kp, proven in ((edge * (1 - 1e-9), True), (edge * (1 + 1e-9), False)):
        assert lyapunov(arm, law(K2=K2, Kp=Kp)).proven is proven
    assert unstable(arm, law(K2=K2, Kp=0.999 * edge)) == 0
    assert unstable(arm, law(K2=K2, Kp=1.001 * edge)) == 1


@pytest.mark.parametrize("K2", [1.001, 1.05])
def test_beyond_one_every_flexible_mode_is_unstable(K2: float) -> None:
    loop = Loop(ARM, law(K2=K2))
    for height in (1e3, 1e4):
        poles = poles_below(loop, height)
        flexible = poles.values.imag > 0
        assert (poles.values.real[flexible] > 0).all()
        assert poles.unstable == 2 * flexible.sum()
        held = modes_below(replace(ARM, hub=Hub(inertia=math.inf)), height)
        assert flexible.sum() == held  # none is missing, and there are ever more


@pytest.mark.parametrize(("K2", "expected"), [(-8.47, 0), (-8.49, 2), (-10.0, 2), (-11.46, 2), (-11.48, 0)])
def test_counterexample_at_positive_damping(K2: float, expected: int) -> None:
    arm, feedback = window_arm(), law(K1=1.0, K2=K2)
    assert not lyapunov(arm, feedback).proven
    assert unstable(arm, feedback, 8) == expected
    undamped = arm.having(damping=0.0)
    assert lyapunov(undamped, feedback).proven
    assert unstable(undamped, feedback) == 0


@pytest.mark.parametrize("seed", thinned(range(3), 2))
def test_without_K2_damping_does_no_harm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(6):
        arm, drawn = some_loop(rng)
        feedback = HubFeedback(K1=abs(drawn.K1), Kp=abs(drawn.Kp))
        assert lyapunov(arm, feedback).proven
        assert unstable(arm, feedback, 6) == 0


def test_a_locked_hub_has_no_loop_to_prove() -> None:
    with pytest.raises(ParameterError, match="has no loop"):
        lyapunov(replace(ARM, hub=Hub(inertia=math.inf)), law())
