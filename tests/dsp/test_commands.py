"""tfarm sampled and tfarm simulate as a shell sees them: words, files, units, the sampled verdict of a design."""

import csv
import re
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from scipy.io import loadmat

import tfarm
from tests.shared import remember, thinned
from tests.shell import answer, run
from tfarm import HubFeedback, Law
from tfarm.arm.chain import Sampling, chain_of_tables
from tfarm.case import Case
from tfarm.cli.options import chain_of_options
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.loop.sampled_brief import brief_of
from tfarm.plots import slew
from tfarm.report.sampled_section import response_columns
from tfarm.synthesis import design


def test_tables_for_people(capsys):
    _, out, _ = run(capsys, "sampled", "sasaki2012-lab", "--modes", "12")
    assert "(-0.1526 (first 12 modes), 1.16388 (first 12 modes))" in out
    _, out, _ = run(capsys, "simulate", "sasaki2012-lab", "--duration", "1.2", "--modes", "12")
    assert "residual root moment" in out


@pytest.mark.parametrize("scenario", thinned(["slew", "step", "decay", "impulse"], 2))
def test_simulate_writes_what_it_prints(capsys, tmp_path, scenario):
    table, mat = tmp_path / "run.csv", tmp_path / "run.mat"
    arguments = ["simulate", "sasaki2012", "--scenario", scenario, "--duration", "1.5", "--between", "1"]
    arguments += ["--output", "moment@0.25"]
    result = answer(capsys, *arguments, "--csv", str(table), "--mat", str(mat))
    n = len(result["t"])
    assert n == 151
    for name in ("root_moment", "tip_displacement", "torque", "hub_angle", "hub_rate", "gain"):
        assert len(result[name]) == n
    assert result["energy_error"] < 1e-13
    header, *rows = csv.reader(table.read_text().splitlines())
    assert header[:2] == ["t [s]", "hub_angle [rad]"]
    torque, inside = header.index("torque [N m]"), header.index("moment@0.25 [N m]")
    at_samples, between = ([row for row in rows if bool(row[torque]) is there] for there in (True, False))
    assert [float(row[3]) for row in at_samples] == result["root_moment"]
    assert [float(row[3]) for row in between] == result["between"]["root_moment"]
    assert [float(row[inside]) for row in at_samples] == result["moment@0.25"]
    assert [float(row[inside]) for row in between] == result["between"]["moment@0.25"]
    times = [float(row[0]) for row in rows]
    assert times == sorted(result["t"] + result["between"]["t"])
    assert len(set(times)) == 2 * n == len(rows)
    stored = loadmat(mat)
    np.testing.assert_array_equal(stored["torque"][:, 0], result["torque"])
    np.testing.assert_array_equal(stored["between"]["t"][0, 0][:, 0], result["between"]["t"])
    np.testing.assert_array_equal(stored["moment_0_25"][:, 0], result["moment@0.25"])
    first = mat.read_bytes()
    answer(capsys, *arguments, "--mat", str(mat))
    assert mat.read_bytes() == first


def test_a_dsp_file_given_with_the_arm(capsys, tmp_path):
    file = tmp_path / "loop.toml"
    file.write_text(
        "[sampling]\nperiod = 0.02\n[converters]\ntorque_bits = 8\ntorque_range = 2.0\n"
        "[actuator]\nmotor_constant = 2.0\n"
    )
    result = answer(capsys, "simulate", "sasaki2012-lab", "--dsp", str(file), "--modes", "10")
    assert result["period_s"] == 0.02
    assert result["saturated_samples"]["torque"] > 0
    assert result["volts"] == [u / 2 for u in result["torque"]]
    assert answer(capsys, "simulate", "sasaki2012-lab", "--dsp", str(file), "--period", "0.01")["period_s"] == 0.01


def test_gains_that_fail_when_sampled_are_not_recommended_without_a_word(capsys, monkeypatch):
    """At 10 ms, which no file of a preset sets and which is reported as a default."""
    remember(monkeypatch, design, "design")  # two commands call it alike
    found = answer(capsys, "design", "sasaki2012-lab", "--continuous")
    sampled = found["sampled"]
    assert (sampled["period_s"], sampled["period_is_default"], sampled["stable"]) == (0.01, True, False)
    assert sampled["spectral_radius"] > 2
    assert found["designed_for"] == "continuous"
    _, out, _ = run(capsys, "design", "sasaki2012-lab", "--continuous")
    assert "inside bounds that were widened" in out
    assert re.search(r"\nsampled loop +UNSTABLE [^\n]*\n? .*\(tfarm's\s+default\s+period\)\n", out)


@pytest.mark.parametrize(
    ("chain", "law", "origin"),
    [
        (Chain(), HubFeedback(K1=0.3), "tfarm's default period"),
        (Chain(), Law({"hub_rate": 0.3}, period=0.01), "the controller's period"),
        (chain_of_options("sasaki2012-lab", period=0.01), HubFeedback(K1=0.3), "--period"),
        (chain_of_tables({"sampling": {"period": 0.01}}), HubFeedback(K1=0.3), "the file's period"),
        (Chain(sampling=Sampling(period=0.02)), HubFeedback(K1=0.3), ""),
    ],
)
def test_the_origin_of_the_period(chain, law, origin):
    brief = brief_of(ConvergenceError("not tried", None, None), Case(tfarm.load("sasaki2012-lab"), law, chain))
    assert (brief.period_from, brief.period_is_default) == (origin, origin == "tfarm's default period")
    assert brief.words.endswith(f"({origin})" if origin else "ms")


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
    (column,) = (each for each in response_columns(arm, {"run": done}) if each.key.startswith(("torque_", "input_")))
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
