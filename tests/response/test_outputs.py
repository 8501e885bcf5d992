"""Outputs of one's own: right by every door, or refused; and those that an end condition holds constant."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import tfarm
from tests.shared import refusal, thinned
from tfarm import Hub, Output, Payload
from tfarm.exact import appendix

EPS = np.finfo(float).eps
LAB, STOCKY = tfarm.load("sasaki2012-lab"), tfarm.load("stocky-steel")
ARMS = {
    "lab": LAB,
    "stocky": STOCKY,
    "bare": tfarm.load("sasaki2012"),
    "pinned tip": replace(STOCKY, payload=Payload(mass=math.inf, inertia=0.0)),
    "tip that cannot turn": replace(STOCKY, payload=Payload(mass=0.0, inertia=math.inf)),
    "locked hub": replace(STOCKY, hub=Hub(inertia=math.inf)),
    "free pin": replace(LAB, hub=Hub(inertia=0.0)),
}
POINTS = [0.3 + 57.1j, 2e-3j, -5.0 + 900.0j, 1.3e4j]
TURN = Output(quantity="Phi", place="tip", unit="rad", label="tip rotation")
MOMENT = Output(quantity="M", place="tip", unit="N m", label="tip moment")
FORCE = Output(quantity="Q", place="tip", unit="N", label="tip shear force")
JERK = Output(quantity="W", place="tip", unit="m/s^3", power=3, label="tip jerk")
SNAP = Output(quantity="theta", place="root", unit="rad/s^4", power=4, label="hub snap")
OWN = [TURN, MOMENT, FORCE, JERK, SNAP, replace(TURN, power=1, unit="rad/s", label="tip turning rate", name="")]


@pytest.mark.parametrize(("arm", "wanted"), thinned(product(ARMS.values(), OWN), 5))
def test_call_digits_and_frequency_response_agree_with_the_paper(arm, wanted) -> None:
    G = tfarm.transfer(arm, wanted)
    for s in POINTS:
        expected = complex(appendix.output_value(arm, wanted, s, 20))
        slope = abs(s * G.derivative(s))
        assert abs(G(s) - expected) <= 90 * EPS * (abs(expected) + slope)
        assert abs(complex(*map(float, G.digits(s, 17))) - expected) <= 4 * EPS * abs(expected)
    data = G.frequency_response([57.1, 900.0])
    assert data.output_labels == [wanted.name]
    assert (data.frdata[0, 0] == G([57.1j, 900j])).all()


AT_THE_TIP = product(("lab", "stocky", "pinned tip", "tip that cannot turn", "locked hub"), (TURN, MOMENT, FORCE))
NAMED = ("hub_angle", "root_moment", "tip_displacement", "tip_deflection", "root_shear")
RADII = {"lab": 390.0, "bare": 1290.0}  # of a circle that hardly any pole or zero is next to; 21,000 of the others


@pytest.mark.parametrize(("arm", "wanted"), [*thinned(AT_THE_TIP, 4), *thinned(product(("bare", "lab"), NAMED), 3)])
def test_zeros_are_zeros_and_as_many_as_the_argument_turns(arm: str, wanted: Output | str) -> None:
    G, radius = tfarm.transfer(ARMS[arm], wanted), RADII.get(arm, 21000.0)
    zeros, poles = G.zeros(up_to=1.2 * radius), G.poles(up_to=1.2 * radius)
    payload = ARMS[arm].payload
    if {MOMENT: payload.inertia, FORCE: payload.mass}.get(wanted) == 0:  # nothing at the tip takes it
        assert (zeros.proof, zeros.values.size, G(57.1j)) == ("constant", 0, 0)
        return
    moving = zeros.values[zeros.values != 0]
    assert all(abs(G(z * (1 + 1e-9))) <= 3e-9 * abs(z * G.derivative(z)) for z in moving)
    circle = radius * np.exp(2j * np.pi * (np.arange(20000) + 0.5) / 20000)
    values = G(circle)
    turns = np.angle(np.roll(values, -1) / values).sum() / (2 * np.pi)
    inside = [np.count_nonzero(abs(roots.values) < radius) for roots in (zeros, poles)]
    at_zero = round(math.log(abs(G(2e-4)) / abs(G(1e-4)), 2))  # G ~ s^at_zero; poles and zeros at 0 may have cancelled
    inside[0] += at_zero - (np.count_nonzero(zeros.values == 0) - np.count_nonzero(poles.values == 0))
    assert round(turns) == inside[0] - inside[1]


HELD = [
    ("lab", "rotation", 0.0, 0.0),
    ("lab", "deflection", 0.0, 0.0),
    ("lab", "moment", 1.0, 0.0),
    ("lab", "shear", 1.0, 0.0),
    ("lab", MOMENT, None, 0.0),
    ("pinned tip", "tip_acceleration", None, 0.0),
    ("locked hub", "hub_angle", None, 1.0),
    ("free pin", replace(MOMENT, place="root", name="clamp_moment"), None, -1.0),
]


@pytest.mark.parametrize(("name", "wanted", "share", "value"), HELD)
def test_what_is_held_constant_has_its_value_at_a_resonance_too(name: str, wanted, share, value) -> None:
    arm = replace(ARMS[name], link=replace(ARMS[name].link, damping=0.0))
    G = tfarm.transfer(arm, wanted, x=None if share is None else share * arm.link.length)
    s = 1j * float(tfarm.modes(arm, 2).natural_frequency[-1])
    assert "a natural frequency" in str(refusal(tfarm.transfer(arm, "tip_deflection"), s))
    assert (G(s), G.derivative(s), G(0)) == (value, 0.0, value)
    assert [float(part) for part in G.digits(s, 30)] == [value, 0.0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"quantity": "Chi"}, "quantity"),
        ({"quantity": "Phi", "place": "root"}, "known at: tip, x"),
        ({"quantity": "theta"}, "known at: root"),
        ({"place": "middle"}, "known at: tip"),
        ({"power": 5}, "0 to 4"),
        ({"power": True}, "0 to 4"),
        ({"power": 1.0}, "0 to 4"),
        ({"power": 1}, 'here "m/s"'),
        ({"unit": "mm"}, 'here "m"'),
        ({"gauge": True}, "moment only"),
        ({"label": " "}, "a text with a word"),
        ({"name": "a.b"}, "underscores"),
    ],
    ids=str,
)
def test_what_is_no_output_is_refused(change, message: str) -> None:
    right = {"quantity": "W", "place": "tip", "unit": "m", "label": "where the tip is"}
    assert Output(**right).name == "where_the_tip_is"
    assert message in str(refusal(Output, **(right | change)))


def test_two_outputs_of_one_name_are_not_confused() -> None:
    false = Output(quantity="Y", place="tip", unit="m", label="tip displacement")
    assert "the name of another output" in str(refusal(tfarm.transfer, LAB, false))
    assert "the name of an output" in str(refusal(tfarm.transfer, LAB, [3]))
