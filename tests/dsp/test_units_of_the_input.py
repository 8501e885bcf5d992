"""What a rig's motor gives is in volts or amperes where these are its input: words, columns and pictures say so."""

from dataclasses import replace
from pathlib import Path

import matplotlib
import pytest

import tfarm
from tests.shell import answer, run
from tfarm.dsp import Actuator
from tfarm.plots import slew
from tfarm.report.motion import responses_table

RIG = "quanser-2dsfl"
UNITS = {"motor_voltage": "V", "motor_current": "A", "hub_torque": "N m"}


@pytest.fixture(scope="module", params=UNITS)
def run_of(request):
    """The rig through each of its inputs, and a short slew of it."""
    arm = replace(tfarm.load(RIG), input=request.param)
    return arm, UNITS[request.param], tfarm.simulate(arm, tfarm.HubFeedback(), duration=0.3, count=3)


def test_the_unit_stands_at_the_axis_and_in_the_table(run_of):
    arm, unit, done = run_of
    *_, motor = slew(arm, done)
    assert motor.get_ylabel().endswith(f"[{unit}]")
    matplotlib.pyplot.close(motor.figure)
    table = responses_table("x", "y", arm, {"run": done})
    (column,) = (each for each in table.columns if each.key.startswith(("torque_", "input_")))
    assert column.unit == unit
    assert column.key == ("torque_run_N_m" if unit == "N m" else f"input_run_{unit}")


def test_the_signals_file_and_the_words_have_it(tmp_path, capsys):
    """By current: A in the head of the CSV, in the answer, and in what a step is called."""
    file = tmp_path / "signals.csv"
    run(capsys, "simulate", RIG, "--scenario", "step", "--duration", "0.05", "--modes", "3", "--csv", str(file))
    assert "torque [A]" in Path(file).read_text(encoding="utf-8").splitlines()[0]
    found = answer(capsys, "simulate", RIG, "--scenario", "step", "--duration", "0.05", "--modes", "3")
    assert found["torque_unit"] == "A"
    assert found["scenario_in_words"].endswith(" A")


def test_a_limit_says_in_which_unit_it_is():
    with pytest.raises(tfarm.ParameterError, match="in V or A where that is the arm's input"):
        Actuator(torque_limit=-1.0)
