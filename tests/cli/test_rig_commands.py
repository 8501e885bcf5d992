"""The commands on rigs: every part that the paper's arm does not have, from a file to what is printed."""

import math

import numpy as np
import pytest

import tfarm
from tests import chain_elements
from tests.cli.shortest import OF_AN_ARM
from tests.shared import thinned
from tests.shell import answer, refused, run

RIGS = {"bench-rig": "tests/rigs/bench-rig.toml"} | {name: name for name in ("quanser-2dsfl", "quanser-flexlink")}


@pytest.mark.parametrize("rig", RIGS.values(), ids=RIGS)
def test_hub_locked_frequencies_are_listed_with_the_free_ones_and_interlace_them(rig, capsys):
    """Elements of another kind have the same locked hub, and one constraint parts the frequencies (Rayleigh)."""
    found = answer(capsys, "modes", rig, "--count", "4")
    rigid, *flexible = found["modes"]
    free, locked = ([row[key] for row in flexible] for key in ("natural_frequency_rad_s", "hub_locked_rad_s"))
    assert rigid["hub_locked_rad_s"] is None
    assert all(low < high for low, high in zip(locked, free, strict=True))
    assert all(low < high for low, high in zip(free, locked[1:], strict=False))
    elements = chain_elements.natural_frequencies(tfarm.load(rig).with_numbers(hub_inertia=math.inf), 4)
    np.testing.assert_allclose(locked, elements, rtol=1e-8)
    assert "dry friction" in found["hub_locked_note"]


def test_what_friction_makes_of_a_rigid_body_is_its_second_eigenvalue(capsys):
    found = answer(capsys, "modes", RIGS["quanser-flexlink"], "--count", "2", "--certify")
    turning = found["modes"][0]["second_eigenvalue"]
    assert found["modes"][0]["eigenvalue"] == [0, 0]
    assert turning < 0
    (disc,) = found["modes"][0]["discs"]
    assert abs(float(disc["re"]) - turning) <= float(disc["radius"]) + 1e-12 * abs(turning)
    arm = tfarm.load(RIGS["quanser-flexlink"])
    assert found["circuit_eigenvalues"][0] == pytest.approx(-arm.motor.resistance / arm.motor.inductance, rel=0.02)
    _, out, _ = run(capsys, "modes", RIGS["quanser-flexlink"], "--count", "2")
    assert "-18.486" in out
    assert "motor's circuit" in out
    assert "-1/C" not in out


@pytest.mark.parametrize("verb", thinned(["poles", "margins", "map", "locus", "simulate", "sampled", "reduce"], 2))
def test_every_command_names_the_input_and_each_gains_unit(capsys, verb):
    found = answer(capsys, verb, RIGS["quanser-2dsfl"], *OF_AN_ARM[verb].split())
    assert found["input"] == "motor_current"
    if verb != "reduce":
        assert found["gain_units"] == {"K1": "A s/rad", "K2": "A/(N m)", "Kp": "A/rad"}
        assert "the motor's current [A]" in found.get("sign_convention", found.get("law"))


def test_gains_of_a_voltage_have_its_units(capsys):
    _, out, _ = run(capsys, "margins", RIGS["quanser-flexlink"])
    assert "V s/rad" in out
    assert "V/(N m)" in out
    assert "u is the motor's voltage [V]" in out
    assert "N m s/rad" not in out
    found = answer(capsys, "map", RIGS["quanser-flexlink"], "--points", "3")
    arm = tfarm.load(RIGS["quanser-flexlink"])
    assert found["y"][-1] == pytest.approx(2 * arm.input_per_torque * 2 / 3)


def test_a_response_is_of_the_input_of_the_option(capsys):
    """A response to the angle is that to the torque over the angle's own; a current is a torque through the gear."""
    file, values, units = RIGS["quanser-flexlink"], {}, {}
    for name in ("hub_torque", "motor_current", "motor_voltage", "hub_angle"):
        found = answer(capsys, "response", file, "--output", "root_moment", "--input", name, "--s", "2+30j")
        assert found["input"] == name
        values[name], units[name] = complex(*found["value"][0]), found["input_unit"]
    assert list(units.values()) == ["N m", "A", "V", "rad"]
    motor = tfarm.load(file).motor
    gain = motor.gear_efficiency * motor.gear_ratio * motor.torque_constant
    assert values["motor_current"] == pytest.approx(gain * values["hub_torque"], rel=1e-12)
    angle = answer(capsys, "response", file, "--output", "hub_angle", "--input", "hub_torque", "--s", "2+30j")["value"]
    assert values["hub_angle"] * complex(*angle[0]) == pytest.approx(values["hub_torque"], rel=1e-12)
    without = ("response", "sasaki2012", "--output", "hub_rate", "--input", "motor_voltage", "--s", "1")
    assert "there is no motor" in refused(capsys, *without)
