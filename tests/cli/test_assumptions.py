"""`tfarm assumptions` as a shell sees it."""

import math
import re
from dataclasses import replace

import tfarm
from tests.shell import run as shell
from tfarm.arm import to_toml


def run(capsys, *arguments):
    return shell(capsys, "assumptions", *arguments)


def test_the_table_marks_the_arm_and_gives_the_limits(capsys):
    code, out, err = run(capsys, "sasaki2012")
    assert (code, err) == (0, "")
    own = [line.split() for line in out.splitlines() if line.lstrip().startswith("yes")]
    assert own[0][1:5] == ["0.006", "0.1", "1.8e-09", "71.5057,"]
    assert own[1][1:3] == ["0.1", "71.5057,"]
    assert re.search(r"free pin \(I_h = 0\) \[rad/s\] +133.297,", out)
    assert re.search(r"locked hub \(I_h = inf\) \[rad/s\] +30.3995,", out)
    assert "area, shear factor and all else held" in out


def test_a_locked_hub_has_none_to_choose(capsys, tmp_path):
    arm = replace(tfarm.load("stocky-steel"), hub=tfarm.Hub(inertia=math.inf), name="held")
    (tmp_path / "held.toml").write_text(to_toml(arm), encoding="utf-8")
    code, out, _ = run(capsys, str(tmp_path / "held.toml"))
    assert code == 0
    assert "hub inertias" not in out
