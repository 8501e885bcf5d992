"""A rig's TOML file: contents, refusals and round trip; each key has one label, unit and meaning."""

import math
import tomllib
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.arm.test_reading import arms, inertias, positive
from tests.shared import refusal
from tfarm.arm import (
    INPUTS,
    THEORIES,
    Arm,
    Attachment,
    Hub,
    Motor,
    Payload,
    RotarySpring,
    Section,
    load,
    schema,
    to_toml,
)
from tfarm.arm.chain import CHAIN_TABLES, chain_of_tables
from tfarm.arm.law_tables import LawTable, SignalTable, WeightTable
from tfarm.arm.schema import PART_TABLES, SHAPE_TABLES, ArmTable, LinkTable, arm_of_table, file_keys
from tfarm.fitting.run_files import RunTable

RIG = """\
name = "bench"
theory = "rayleigh"
input = "motor_voltage"
[[link]]
length = 0.05
density = 7850.0
youngs_modulus = 2.1e11
poissons_ratio = 0.3
[link.section]
shape = "rectangle"
width = 0.04
depth = 0.004
[[link]]
length = 0.35
density = 2700
youngs_modulus = 7.0e10
poissons_ratio = 0.33
damping = 1e-4
[link.section]
shape = "round"
diameter = 0.006
[hub]
inertia = 0.002
friction = 0.015
radius = 0.03
stiffness = 0.1
[clamp]
stiffness = 900
damping = 1e-4
[joint]
stiffness = inf
[motor]
resistance = 2.6
torque_constant = 0.00768
gear_ratio = 70
rotor_inertia = 3.9e-7
gear_efficiency = 0.9
[[attachment]]
x = 0.02
mass = 0.005
[[attachment]]
x = 0.4
stiffness = 12.0
[payload]
mass = 0.1
inertia = 3e-5
offset = -0.01
"""


def rig(old="", new=""):
    """The arm of the file above, with one of its texts replaced."""
    assert old in RIG
    return arm_of_table(tomllib.loads(RIG.replace(old, new, 1)))


def test_a_file_holds_all_that_a_rig_has():
    arm = rig()
    assert (arm.theory, arm.input) == ("rayleigh", "motor_voltage")
    assert [link.length for link in arm.links] == [0.05, 0.35]
    assert arm.outer[0].section == Section.round(diameter=0.006)
    assert arm.hub == Hub(inertia=0.002, friction=0.015, radius=0.03, stiffness=0.1)
    assert (arm.clamp, arm.joint) == (RotarySpring(stiffness=900.0, damping=1e-4), RotarySpring())
    motor = Motor(resistance=2.6, torque_constant=0.00768, gear_ratio=70, rotor_inertia=3.9e-7, gear_efficiency=0.9)
    assert arm.motor == motor
    assert arm.attachments == (Attachment(x=0.02, mass=0.005), Attachment(x=arm.length, stiffness=12.0))
    assert arm.length < 0.4  # 0.05 + 0.35 in binary; what a person puts at the tip is at the tip
    assert arm.payload == Payload(mass=0.1, inertia=3e-5, offset=-0.01)


def test_a_rig_file_may_have_the_tables_of_the_loop():
    assert chain_of_tables(tomllib.loads(RIG + "[sampling]\nperiod = 0.002\n")).sampling.period == 0.002


REFUSED = {
    "link.2.length = -0.35: a length is": ("length = 0.35", "length = -0.35"),
    "link.1.shear_modulus is missing: give it in Pa": ("poissons_ratio = 0.3\n", ""),
    'link.2.dampin = 0.0001: unknown key; did you mean "damping"': ("damping = 1e-4", "dampin = 1e-4"),
    'link.2.section.diamter = 0.006: unknown key; did you mean "diameter"': ("diameter", "diamter"),
    "link.2.section.shape is missing: give one of rectangle": ('shape = "round"\n', ""),
    "joint.stiffness = -1.0: the stiffness": ("stiffness = inf", "stiffness = -1"),
    "attachment.2.x = 0.41: is beyond the tip": ("x = 0.4\n", "x = 0.41\n"),
    "attachment.1.x is missing: give a number": ("x = 0.02\n", ""),
    "payload.input = 'hub_angle': unknown key; input belongs at the top": ("offset = -0.01", 'input = "hub_angle"'),
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_wrong_entry_of_a_rig_s_file_is_refused_with_its_place(message):
    assert str(refusal(rig, *REFUSED[message])).startswith(message)


SHAPED = {
    "a table for the list": (
        "attachment = {'x': 0.4",
        {"attachment": {"x": 0.4, "mass": 1.0}},
        "headed [[attachment]]",
    ),
    "no segments": ("link is missing", {"link": []}, "headed [link], or [[link]] for each"),
    "a number for the link": ("link = 3", {"link": 3}, "headed [link], or [[link]] for each"),
    "a number among the segments": ("link.2 = 3", {"link": [{}, 3]}, "give a table, headed [link]"),
    "65 attachments": ("attachment = 65", {"attachment": [{"x": 0.0, "mass": 1.0}] * 65}, "at most 64"),
    "65 segments": ("link = 65", {"link": tomllib.loads(RIG)["link"][:1] * 65}, "at most 64"),
}


@pytest.mark.parametrize("what", SHAPED)
def test_lists_that_are_none_or_too_long(what):
    key, change, remedy = SHAPED[what]
    table = tomllib.loads(RIG) | change
    if what.endswith("among the segments"):
        table["link"][0] = tomllib.loads(RIG)["link"][0]
    error = str(refusal(arm_of_table, table))
    assert error.startswith(key)
    assert remedy in error


def test_a_single_link_has_no_number_in_either_spelling(tmp_path):
    table = tomllib.loads(RIG)
    (first, _), table["attachment"] = table["link"], []
    assert arm_of_table(table | {"link": first}) == arm_of_table(table | {"link": [first]})
    for link in (first | {"length": -1.0}, [first | {"length": -1.0}]):
        assert str(refusal(arm_of_table, table | {"link": link})).startswith("link.length = -1.0")
    path = tmp_path / "rig.toml"
    path.write_text(RIG.replace("length = 0.35", "length = nan"))
    wanted = f"{path}: link.2.length = nan: a length is a positive, finite number of metres"
    assert str(refusal(load, path)).startswith(wanted)


def test_an_arm_of_the_paper_s_kind_is_written_as_it_ever_was():
    """A study is found by the hash of this text, so it must not grow a key."""
    plain = tomllib.loads(to_toml(load("sasaki2012-lab")))
    assert list(plain) == ["name", "assumptions", "link", "hub", "payload"]
    assert (list(plain["hub"]), list(plain["payload"])) == (["inertia"], ["mass", "inertia"])
    written = tomllib.loads(to_toml(rig()))
    parts = ["name", "assumptions", "theory", "input", "link", "hub", "clamp", "motor", "attachment", "payload"]
    assert list(written) == parts  # no joint: it is rigid
    assert "back_emf_constant" not in written["motor"]
    assert tomllib.loads(to_toml(rig('input = "motor_voltage"\n')))["input"] == "hub_torque"  # a motor's is a choice
    assert written["attachment"] == [{"x": 0.02, "mass": 0.005}, {"x": rig().length, "stiffness": 12.0}]


loss = st.one_of(st.just(0.0), st.floats(1e-6, 1e3))
springs = st.one_of(st.just(RotarySpring()), st.builds(RotarySpring, stiffness=st.floats(1e-3, 1e6), damping=loss))
motors = st.builds(
    Motor,
    resistance=positive,
    torque_constant=positive,
    back_emf_constant=st.one_of(st.none(), loss),
    inductance=loss,
    gear_ratio=positive,
    rotor_inertia=loss,
    rotor_friction=loss,
    gear_efficiency=st.floats(0.1, 1.0),
)
places = st.one_of(st.just(0.0), st.floats(1e-6, 0.1))  # none so small that it is refused
attachments = st.builds(Attachment, x=places, mass=positive, inertia=loss, stiffness=loss, rotational_stiffness=loss)
offsets = st.floats(-0.5, 0.5).map(lambda x: round(x, 9))


@st.composite
def rigs(draw) -> Arm:
    """Any legal rig: the arm of the paper's kind with a few of the other parts."""
    arm = draw(arms)
    motor = draw(st.one_of(st.none(), motors))
    hub = Hub(inertia=draw(loss), friction=draw(loss), radius=draw(loss))
    locked = draw(st.booleans()) and motor is None
    return replace(
        arm,
        outer=tuple(draw(st.lists(arms.map(lambda each: each.link), max_size=2))),
        hub=Hub(inertia=math.inf, radius=draw(loss)) if locked else replace(hub, stiffness=draw(loss)),
        clamp=draw(springs),
        joint=draw(springs),
        motor=motor,
        attachments=tuple(draw(st.lists(attachments, max_size=2))),
        payload=Payload(mass=draw(loss), inertia=draw(inertias), offset=draw(offsets)),
        theory=draw(st.sampled_from(THEORIES)),
        input=draw(st.sampled_from(INPUTS if motor else ("hub_torque", "hub_angle"))),
    )


@given(arm=st.one_of(arms, rigs()))
def test_an_arm_or_rig_written_and_read_is_the_same_to_the_last_bit(tmp_path_factory, arm):
    path = tmp_path_factory.getbasetemp() / "round-trip.toml"
    path.write_text(to_toml(arm), encoding="utf-8")
    assert load(path) == arm


FILE_TABLES = {
    "top": [ArmTable], "link": [LinkTable], "link.section": SHAPE_TABLES.values(), "law": [LawTable],
    "law.SIGNAL": [SignalTable], "weights": [WeightTable], "measured": [RunTable],
    **{name: [table] for name, table in (PART_TABLES | CHAIN_TABLES).items() if name != "link"},
}  # fmt: skip


def test_each_key_of_a_file_has_one_label_unit_and_meaning():
    """`keys.toml` is also the contract with every file there is: a key that a record renames is missing there."""
    keys = {f"{place}.{key}" for place, tables in FILE_TABLES.items() for table in tables for key in table.model_fields}
    assert file_keys().keys() == keys | {"sensor.gain", "sensor.delay", "sensor.disturbance", "drive.delay"}
    for key, of in file_keys().items():
        assert of.label
        assert len(of.help.split()) > 1, key
    numbers = {
        key for key in keys if key.startswith("link.") and key.split(".")[-1] not in ("section", "shape", "material")
    }
    assert {key for key in numbers if not file_keys()[key].unit} == {"link.poissons_ratio", "link.section.shear_factor"}


@pytest.mark.parametrize(
    ("key", "label", "unit"),
    [
        ("link.2.section.width", "width of the section", "m"),
        ("attachment.1.stiffness", "attached stiffness", "N/m"),
        ("hub.stiffness", "hub stiffness", "N m/rad"),
        ("gain:2", "sensor gain", ""),
        ("theory", "beam theory", ""),
        ("actuator.torque_limit", "limit of the input", "A"),
    ],
)
def test_a_number_of_a_file_is_found_by_its_place(key, label, unit):
    found = schema.file_key(key, load("quanser-2dsfl"))  # driven by a current
    assert (found.label, found.unit) == (label, unit)
