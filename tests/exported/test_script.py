"""The script of python-control: run in a process of its own, against the exact arm, the law and the simulation."""

import ast
import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests import hostile
from tfarm import HubFeedback, Law
from tfarm.dsp import Chain
from tfarm.dsp.scenarios import scenario
from tfarm.dsp.simulate import Simulator
from tfarm.response.signals import Signals

LAB = tfarm.load("sasaki2012-lab")
LAW = HubFeedback(K1=0.3, K2=0.3)
SECONDS = 120  # for a process that imports python-control, on a machine under load
WHAT = ("plant", "controller", "loop")
OMEGA = np.array([1.0, 20.0, 66.0, 200.0])
READER = """
import json, runpy, sys
import control, numpy as np
omega, out = np.array(json.loads(sys.argv[1])), {}
for file in sys.argv[2:]:
    names = runpy.run_path(file)
    found = {name: each for name, each in names.items() if isinstance(each, control.StateSpace)}
    out[file] = {}
    for name, each in found.items():
        values = each(1j * omega if each.dt == 0 else np.exp(1j * omega * each.dt), squeeze=False)
        step = values[:0]
        if name == "loop":
            step = control.step_response(each, np.arange(40) * 0.01, input=0).outputs[:, 0]
        out[file][name] = [each.input_labels, each.output_labels, each.dt, values.real.tolist(), values.imag.tolist(),
            step.real.tolist()]
print(json.dumps(out))
"""


def systems(folder, *names):
    """The objects of scripts in another process: names, period, response (outputs, inputs, n) and step of each."""
    files = [str(folder / f"{name}.py") for name in names]
    call = [sys.executable, "-c", READER, json.dumps(OMEGA.tolist()), *files]
    done = subprocess.run(call, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert done.returncode == 0, done.stderr
    return [
        {name: (*head, np.array(real) + 1j * np.array(imag), step) for name, (*head, real, imag, step) in each.items()}
        for each in json.loads(done.stdout).values()
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("py")
    for what in WHAT:
        tfarm.export(LAB, LAW, what=what, form="py", folder=folder)
    return folder


@pytest.fixture(scope="module")
def read(folder):
    return dict(zip(WHAT, systems(folder, *WHAT), strict=True))


def test_the_reduced_model_is_within_the_error_that_the_script_states(folder, read):
    inputs, outputs, period, G, _ = read["loop"]["reduced"]
    exact, h = Signals(LAB, tuple(outputs)), 1e-5
    above, below = (exact.values(1j * OMEGA * (1 + each)) for each in (h, -h))
    size = abs(exact.values(1j * OMEGA)) + abs(above - below) / (2 * h)
    (stated,) = re.findall(r"worst .* (\S+) from 0.1 to 1000 rad/s", (folder / "loop.py").read_text())
    error = abs(G[:, 0] - exact.values(1j * OMEGA)) / size
    assert error.max() < float(stated) + 1e-11  # rounding of the solution of order 42
    assert (inputs, period) == (["hub_torque"], 0.0)


def test_the_loop_is_closed_by_the_law_and_steps_as_the_simulation(read):
    """Torque over feedforward is 1/(1 + K1 rate + K2 moment)."""
    _, outputs, period, P, _ = read["loop"]["plant"]
    inputs, _, _, L, step = read["loop"]["loop"]
    rate, moment = (P[outputs.index(name), 0] for name in ("hub_rate", "root_moment"))
    assert (inputs[0], period) == ("feedforward", 0.01)
    assert L[-1, 0] == pytest.approx(1 / (1 + 0.3 * rate + 0.3 * moment), rel=1e-9)
    task = scenario("step", LAB, Chain(), 0.5)
    torque = Simulator(LAB, Chain(), task, LAW).run().torque[:40] / task.feedforward[0]
    assert step[-1] == pytest.approx(torque, rel=0, abs=1e-10)  # 40 samples, torques of about 1


@pytest.mark.parametrize("what", ["plant", "controller"])
def test_parts_of_a_loop_are_those_of_its_script(read, what):
    part, whole = read[what], read["loop"]
    assert part.keys() < whole.keys()
    for name, each in part.items():
        assert each[:3] == whole[name][:3]
        assert np.array_equal(each[3], whole[name][3])


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
