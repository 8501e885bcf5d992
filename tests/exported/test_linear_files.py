"""State spaces in files of MATLAB and python-control: variables, names and texts, run by Octave and by Python.

The road of `reduce --mat` too.
"""

import ast
import io
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import scipy.io

import tfarm
from tests import hostile
from tests.octave import left_by_octave
from tests.shell import run
from tfarm import HubFeedback, Law, ParameterError
from tfarm.arm.law_tables import law_of_table
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain
from tfarm.exported.result import ExportTask
from tfarm.exported.systems import linear, save_mat, without_dots
from tfarm.reduced import reduce
from tfarm.response.signals import Signals

LAB = tfarm.load("sasaki2012-lab")
LAW = HubFeedback(K1=0.3, K2=0.3)
WHAT = ("plant", "controller", "loop")
SECONDS = 120  # for a process that imports python-control, on a machine under load
STUBS = {  # of the control package, which a machine may have or not
    "ss": "function s = ss(A, B, C, D, T, varargin)\n  s = struct('A', A, 'B', B, 'C', C, 'D', D, 'T', T);\n"
    "  s.names = {varargin{2:2:end}};\nend\n",
    "frd": "function s = frd(H, w, varargin)\n  s = struct('H', H, 'w', w);\nend\n",
}
READER = """
import json, runpy, sys
import control
for file in sys.argv[1:]:
    found = {name: each for name, each in runpy.run_path(file).items() if isinstance(each, control.StateSpace)}
    print(json.dumps({
        name: [of.input_labels, of.output_labels, of.dt, *(each.tolist() for each in (of.A, of.B, of.C, of.D))]
        for name, of in found.items()
    }))
"""


def systems_of(what):
    """The systems of the loop of this file, by the library."""
    return linear(ExportTask(case=Case(LAB, LAW), what=what, form="mat")).systems


def systems_in(folder, *names):
    """The objects of scripts in another process: labels of inputs and outputs, period and matrices of each."""
    call = [sys.executable, "-c", READER, *(str(folder / f"{name}.py") for name in names)]
    done = subprocess.run(call, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def reduced():
    return reduce(tfarm.load("sasaki2012"), ["root_moment", "hub_rate"], order=10)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, reduced):
    """Each export of one loop, and the file of a reduced model."""
    folder = tmp_path_factory.mktemp("files")
    for what in WHAT:
        for form in ("mat", "py"):
            tfarm.export(LAB, LAW, what=what, form=form, folder=folder)
    save_mat(reduced, folder / "my-arm.mat")
    save_mat(reduced, folder / "it's.mat")
    return folder


def test_mat_file_and_its_script(reduced, folder):
    data, text = scipy.io.loadmat(folder / "my-arm.mat", squeeze_me=True), (folder / "load_my_arm.m").read_text()
    for name, matrix in zip("ABCD", reduced.matrices(), strict=True):
        np.testing.assert_array_equal(data[name], matrix.squeeze())
    assert list(data["output_names"]) == ["root_moment", "hub_rate"]
    assert len(data["state_names"]) == 10
    w = data["omega"]
    np.testing.assert_array_equal(data["response"], tfarm.transfer(reduced.arm, reduced.outputs)(1j * w))
    assert "data = load(fullfile(here, 'my-arm.mat'));" in text
    used = set(re.findall(r"\b(?:data|this_system)\.(\w+)", text))
    assert used <= set(data)
    assert {"A", "B", "C", "D", "omega", "response"} <= used


def test_the_file_of_a_loop_has_every_system_and_the_exact_response(folder):
    data = scipy.io.loadmat(folder / "loop.mat", squeeze_me=True)
    names = [name for name, value in data.items() if getattr(value, "dtype", np.dtype(float)).names]
    assert names == ["controller", "plant", "reduced"]
    exact = Signals(LAB, tuple(data["exact_outputs"])).values(1j * data["omega"])
    np.testing.assert_array_equal(data["response"], exact)
    assert list(data["exact_outputs"]) == list(data["plant"]["output_names"].item())
    assert float(data["reduced"]["worst_error"]) < 1e-10
    assert (float(data["period"]), float(data["reduced"]["period"])) == (0.01, 0.0)


def test_the_exact_arm_of_a_file_has_the_analog_damping_of_the_actuator(tmp_path):
    """It is friction of the hub."""
    chain, braked = Chain(actuator=Actuator(hub_damping=0.02)), replace(LAB, hub=replace(LAB.hub, friction=0.02))
    tfarm.export(LAB, LAW, what="plant", form="mat", folder=tmp_path, chain=chain)
    data = scipy.io.loadmat(tmp_path / "plant.mat", squeeze_me=True)
    exact = Signals(braked, tuple(data["exact_outputs"])).values(1j * data["omega"])
    np.testing.assert_array_equal(data["response"], exact)
    assert "single1" in list(data["reduced"]["state_names"].item())  # the rate that friction brings to rest


@pytest.mark.parametrize("what", WHAT)
def test_same_inputs_same_bytes(what, folder, tmp_path):
    for form, names in (("mat", (f"{what}.mat", f"load_{what}.m")), ("py", (f"{what}.py",))):
        assert tfarm.export(LAB, LAW, what=what, form=form, folder=tmp_path).files == names
    for file in tmp_path.iterdir():
        assert file.read_bytes() == (folder / file.name).read_bytes()


def test_a_script_builds_the_systems_of_its_task(folder):
    """With every digit; the first lines have the error of the reduced model."""
    for what, found in zip(WHAT, systems_in(folder, *WHAT), strict=True):
        own = systems_of(what)
        assert found.keys() == own.keys()
        for name, (inputs, outputs, period, *matrices) in found.items():
            assert (inputs, outputs, period) == (
                without_dots(own[name].inputs),
                without_dots(own[name].outputs),
                own[name].period,
            )
            assert [each.tolist() for each in own[name].matrices] == matrices
    (stated,) = re.findall(r"worst .* (\S+) from 0.1 to 1000 rad/s", (folder / "loop.py").read_text())
    assert stated == f"{own['reduced'].facts['worst_error']:.3g}"


def test_a_loop_that_is_not_certified_stable_needs_anyway(tmp_path):
    """And its file says so in its first lines; the plant needs none."""
    law = HubFeedback(K1=-0.3)
    tfarm.export(LAB, law, what="plant", form="py", folder=tmp_path / "plant")
    for form, name in (("py", "loop.py"), ("mat", "load_loop.m")):
        for what in ("controller", "loop"):
            with pytest.raises(ParameterError, match="--anyway"):
                tfarm.export(LAB, law, what=what, form=form, folder=tmp_path / form)
        assert not (tmp_path / form).exists()
        tfarm.export(LAB, law, what="loop", form=form, folder=tmp_path / form, anyway=True)
        assert "NOT CERTIFIED STABLE" in (tmp_path / form / name).read_text()


def test_a_controller_is_read_again_as_a_law(folder):
    """By `matrices = ` of a law's file; the sign is that of the input."""
    columns = ["hub_angle", "hub_rate", "root_moment"]
    table = {"matrices": "controller.mat", "period": 0.01, "sign": 1}
    law = law_of_table(table | {"signals": columns + [f"reference:{name}" for name in columns]}, folder)
    first, second = (tfarm.sampled(LAB, each) for each in (law, LAW))
    assert first.verdict.log_radius == pytest.approx(second.verdict.log_radius, rel=1e-9)
    inner = law_of_table(
        table | {"matrices": "loop.mat", "system": "controller", "signals": list(law.parts[0].signals)}, folder
    )
    assert inner == law


def test_octave_builds_each_system_with_its_names(folder, tmp_path):
    for file in folder.iterdir():
        shutil.copy(file, tmp_path)
    for name, text in STUBS.items():
        (tmp_path / f"{name}.m").write_text(text)
    left, printed = left_by_octave(tmp_path, "load_loop; load_my_arm")
    assert {"loop", "controller", "plant", "reduced", "sys", "exact"} <= set(left)
    assert not {"here", "this_system"} & set(left)
    assert "no ss" not in printed
    inputs, outputs, states, name = left["plant"]["names"].item()
    assert (inputs, outputs[0], states[0], name) == ("hub_torque", "hub_angle", "plant1", "sasaki2012-lab, sampled")
    assert float(left["plant"]["T"]) == 0.01
    for name, of in systems_of("loop").items():
        for letter, matrix in zip("ABCD", of.matrices, strict=True):
            np.testing.assert_array_equal(np.reshape(left[name][letter].item(), matrix.shape), matrix)


def test_hostile_names_stay_text(tmp_path):
    """In comments, in literals, and in the variables of a file."""
    arm = replace(LAB, name=hostile.NAME + "'; exit(7); %{ ... x")
    name = hostile.TEXT + "'); exit(7) % \n\"'\nexit(7)\n%}\n\\"
    law = Law({"hub_rate": 0.3, "moment@1e-1": 0.1, "moment@0.3": 0.1}, name=name)
    for what in ("controller", "loop"):
        tfarm.export(arm, law, what=what, form="mat", folder=tmp_path)
        text = (tmp_path / f"load_{what}.m").read_text("ascii")
        assert str(scipy.io.loadmat(tmp_path / f"{what}.mat", squeeze_me=True)["name"]).isascii()
        assert not [line for line in text.splitlines() if "exit" in line and not line.startswith("% ")]
        made = tfarm.export(arm, law, what=what, form="py", folder=tmp_path)
        tree = ast.parse((tmp_path / f"{what}.py").read_text("ascii"))
        called = {ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
        assert called == {"control.StateSpace", "np.reshape"}
        assert [tuple(each) for each in made.names] == [("moment@0.3", "moment@0_3")]
    (found,) = systems_in(tmp_path, "controller")
    assert found["controller"][0] == ["hub_rate", "moment@1e-1", "moment@0_3"]
    for name, stub in STUBS.items():
        (tmp_path / f"{name}.m").write_text(stub)
    left, _ = left_by_octave(tmp_path, "load_controller; load_loop; went = 1")
    assert left["went"] == 1
    assert str(left["controller"]["names"].item()[-1]).startswith("<script>alert(1)</script>")


def test_reduce_writes_the_same_file_to_a_name_and_to_standard_output(capfdbinary, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ("reduce", "sasaki2012-lab", "--order", "6", "--mat")
    with pytest.raises(SystemExit):
        tfarm.cli.main([*words, "-"])
    out, _ = capfdbinary.readouterr()
    assert not list(tmp_path.iterdir())
    with pytest.raises(SystemExit):
        tfarm.cli.main([*words, "arm"])
    assert (tmp_path / "arm.mat").read_bytes() == out
    assert scipy.io.loadmat(io.BytesIO(out))["A"].shape == (6, 6)
    assert (tmp_path / "load_arm.m").exists()


@pytest.mark.parametrize(
    "name", ["none/a.mat", "a" * 300, "b" * 252, "Prüfstand.mat", "a\nexit(7).mat", "a\\b.mat", "pipe.mat"]
)
def test_a_name_that_no_file_or_no_script_can_have(reduced, tmp_path, name):
    os.mkfifo(tmp_path / "pipe.mat")
    with pytest.raises(ParameterError, match=r"cannot be written|printable ASCII|no regular file"):
        save_mat(reduced, tmp_path / name)
    assert [file.name for file in tmp_path.iterdir()] == ["pipe.mat"]


def test_a_script_that_is_another_files_is_left_alone(reduced, tmp_path):
    """load_a_b.m is the script of a-b.mat and would be that of a_b.mat; one written by hand belongs to no file."""
    save_mat(reduced, tmp_path / "a-b.mat")
    save_mat(reduced, tmp_path / "a-b.mat")
    (tmp_path / "load_c.m").write_text("x = 1;\n")
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    for name in ("a_b.mat", "c.mat"):
        with pytest.raises(ParameterError, match="is not its script"):
            save_mat(reduced, tmp_path / name)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_the_command_writes_both_files_and_names_the_loop(capsys, tmp_path):
    words = ("export", "sasaki2012-lab", "--what", "loop", "--as", "mat", "--out", str(tmp_path))
    code, out, err = run(capsys, *words)
    assert (code, err.count("written: ")) == (0, 2)
    assert "stable (certified" in out
