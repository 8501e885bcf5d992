"""The script of python-control, run in a process of its own: it has the systems of its task."""

import ast
import json
import re
import subprocess
import sys
from dataclasses import replace

import pytest

import tfarm
from tests import hostile
from tfarm import HubFeedback, Law
from tfarm.case import Case
from tfarm.exported.result import ExportTask
from tfarm.exported.systems import linear, plain

LAB = tfarm.load("sasaki2012-lab")
LAW = HubFeedback(K1=0.3, K2=0.3)
SECONDS = 120  # for a process that imports python-control, on a machine under load
WHAT = ("plant", "controller", "loop")
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


def systems(folder, *names):
    """The objects of scripts in another process: labels of inputs and outputs, period and matrices of each."""
    call = [sys.executable, "-c", READER, *(str(folder / f"{name}.py") for name in names)]
    done = subprocess.run(call, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("py")
    for what in WHAT:
        tfarm.export(LAB, LAW, what=what, form="py", folder=folder)
    return folder


def test_a_script_builds_the_systems_of_its_task(folder):
    """With every digit; the first lines have the error of the reduced model."""
    for what, found in zip(WHAT, systems(folder, *WHAT), strict=True):
        own = linear(ExportTask(case=Case(LAB, LAW), what=what, form="py")).systems
        assert found.keys() == own.keys()
        for name, (inputs, outputs, period, *matrices) in found.items():
            assert (inputs, outputs, period) == (plain(own[name].inputs), plain(own[name].outputs), own[name].period)
            assert [each.tolist() for each in own[name].matrices] == matrices
    (stated,) = re.findall(r"worst .* (\S+) from 0.1 to 1000 rad/s", (folder / "loop.py").read_text())
    assert stated == f"{own['reduced'].facts['worst_error']:.3g}"


def test_hostile_names_are_literals_and_comments(tmp_path):
    arm = replace(LAB, name=hostile.NAME + "'; exit(7); x")
    law = Law({"hub_rate": 0.3, "moment@1e-1": 0.1, "moment@0.3": 0.1}, name=f"{hostile.TEXT}\n\"'\nexit(7)\n\\")
    for what in ("controller", "loop"):
        made = tfarm.export(arm, law, what=what, form="py", folder=tmp_path)
        tree = ast.parse((tmp_path / f"{what}.py").read_text("ascii"))
        called = {ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
        assert called == {"control.StateSpace", "np.reshape"}
        assert [tuple(each) for each in made.names] == [("moment@0.3", "moment@0_3")]
    (found,) = systems(tmp_path, "controller")
    assert found["controller"][0] == ["hub_rate", "moment@1e-1", "moment@0_3"]


def test_same_inputs_same_bytes(folder, tmp_path):
    made = tfarm.export(LAB, LAW, what="loop", form="py", folder=tmp_path)
    assert made.files == ("loop.py",)
    assert (tmp_path / "loop.py").read_bytes() == (folder / "loop.py").read_bytes()


def test_a_loop_that_is_not_certified_stable_needs_anyway(tmp_path):
    """And its file says so in its first lines; the plant needs none."""
    law = HubFeedback(K1=-0.3)
    for form in ("py", "mat"):
        for what in ("controller", "loop"):
            with pytest.raises(tfarm.ParameterError, match="--anyway"):
                tfarm.export(LAB, law, what=what, form=form, folder=tmp_path)
        assert list(tmp_path.iterdir()) == []
    tfarm.export(LAB, law, what="plant", form="py", folder=tmp_path)
    tfarm.export(LAB, law, what="loop", form="py", folder=tmp_path, anyway=True)
    tfarm.export(LAB, law, what="loop", form="mat", folder=tmp_path, anyway=True)
    for name in ("loop.py", "load_loop.m"):
        assert "NOT CERTIFIED STABLE" in (tmp_path / name).read_text()
