"""The loop: what is refused, the loop function against the arm's transfer functions, slow torque's inertia."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.arms import some_loop
from tfarm import Hub, HubFeedback, ParameterError
from tfarm.loop.loop import Loop
from tfarm.loop.poles import closed_loop_poles

ARM = tfarm.load("sasaki2012")


@pytest.mark.parametrize(
    ("inertia", "law", "words"),
    [
        (math.inf, HubFeedback(K1=0.3), "there is no loop"),
        (0.0, HubFeedback(K1=0.3, K2=0.1), "an algebraic loop"),
    ],
)
def test_where_there_is_no_loop(inertia: float, law, words: str) -> None:
    with pytest.raises(ParameterError, match=words) as refused:
        Loop(replace(ARM, hub=Hub(inertia=inertia)), law)
    assert "\n" not in str(refused.value)


def test_a_pin_without_inertia_may_be_damped() -> None:
    poles = closed_loop_poles(replace(ARM, hub=Hub(inertia=0.0)), HubFeedback(K1=0.3), 5)
    assert poles.unstable == 0


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
