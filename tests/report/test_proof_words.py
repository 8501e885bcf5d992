"""What a map's caption says of Lyapunov's argument is what the argument proves of laws in it."""

from dataclasses import replace

import pytest

import tfarm
from tfarm import Hub, HubFeedback
from tfarm.arm import Motor, RotarySpring
from tfarm.loop.theorem import lyapunov
from tfarm.report.map_section import proof_words

ARM, LAB, FLEX = (tfarm.load(name) for name in ("sasaki2012", "sasaki2012-lab", "quanser-flexlink"))
FRICTION = replace(ARM, hub=Hub(inertia=ARM.hub_inertia, friction=0.05, stiffness=3.0))
CLAMPED = replace(FRICTION, clamp=RotarySpring(stiffness=500.0, damping=1e-4))
MOTOR = Motor(resistance=2.0, torque_constant=0.01, gear_ratio=50)
DRIVEN = replace(CLAMPED, motor=MOTOR, input="motor_voltage")


@pytest.mark.parametrize("arm", [ARM, FRICTION, CLAMPED, DRIVEN], ids=["paper", "friction", "clamp", "motor"])
def test_where_links_are_elastic_the_frame_is_proven_and_no_more(arm):
    """Just inside its corner a law is proven, just outside either side it is not."""
    words = proof_words(arm)
    assert "proves" in words
    assert "K1 > " in words
    whole, loss = arm.input_per_torque, arm.rate_loss
    for K1, K2, proven in ((1e-3, 0.999, True), (1e-3, 1.001, False), (-1e-3, 0.999, False)):
        law = HubFeedback(K1=K1 * max(loss, 1.0) - loss, K2=K2 * whole)
        assert lyapunov(arm, law).proven is proven


@pytest.mark.parametrize(
    ("arm", "words", "at_0"),
    [
        (replace(LAB, hub=Hub(inertia=LAB.hub_inertia, friction=0.1)), "K2 = 0 alone", True),
        (replace(FRICTION, hub=Hub(inertia=0.3, friction=0.1, radius=0.05)), "K2 = 0 alone", True),
        (FLEX if FLEX.input_lags else replace(DRIVEN, motor=replace(MOTOR, inductance=0.01)), "proves nothing", False),
    ],
    ids=["C", "radius", "lag"],
)
def test_elsewhere_no_moment_gain_is_proven(arm, words, at_0):
    assert words in proof_words(arm)
    assert not lyapunov(arm, HubFeedback(K1=0.1, K2=0.1 * arm.input_per_torque)).proven
    assert lyapunov(arm, HubFeedback(K1=0.1)).proven is at_0
