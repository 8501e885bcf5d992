"""The verbs that draw, and --png: the picture is a picture, and its numbers are those of Python."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image

import tfarm
from tests.shared import thinned
from tests.shell import answer, run

LAB = "sasaki2012-lab"
BENCH = str(Path(__file__).parents[1] / "rigs" / "bench-rig.toml")
LAW = "[law]\ndelay = 0.002\n[law.hub_angle]\nnum = [2.0, 1.0]\nden = [0.01, 1.0]\n"


DRAWN = (
    "bode LAB --to 300",
    "nyquist LAB",
    "nyquist LAB --disc",
    "bode LAB --loop --period 0.01",
    "nichols LAB --law LAW",
    "sensitivity LAB",
    "nyquist LAB --law LAW",
    "locus LAB --vary K2 --from 0 --to 2 --points 40 --branches 3",
    "locus LAB --law LAW --vary gain --from 0 --to 40 --points 20 --branches 2",
    "map LAB --points 21",
    "simulate LAB --duration 2 --modes 8",
    "step LAB --scenario deflection --duration 1",
    "map LAB --law LAW --points 8 --vary hub_angle.num.0=0,20 --vary delay=0,0.02",
)


@pytest.mark.parametrize("line", thinned(DRAWN, 3))
def test_a_picture_is_written_and_named(line, tmp_path, capsys):
    (tmp_path / "law.toml").write_text(LAW, encoding="utf-8")
    names = {"LAB": LAB, "LAW": str(tmp_path / "law.toml")}
    file = tmp_path / "drawn.png"
    code, out, err = run(capsys, *(names.get(word, word) for word in line.split()), "--png", str(file))
    assert (code, err) == (0, f"written: {file}\n")
    assert out
    pixels = image.imread(file)
    assert min(pixels.shape[:2]) > 600
    assert 0.002 < np.mean(pixels[..., :3].min(axis=-1) < 0.5) < 0.5  # ink on paper


def test_bode_looks_along_the_arm_at_either_side_of_a_joint_and_from_another_input(capsys):
    """Strain jumps at a joint of two segments: its two sides differ by one factor at all frequencies."""
    rig = tfarm.load(BENCH)
    joint, factors = rig.links[0].length, []
    there = ("--output", "strain", "--x", str(joint), "--input", "hub_torque", "--to", "200")
    for side in ("inner", "outer"):
        found = answer(capsys, "bode", BENCH, *there, "--side", side)
        assert (found["x"], found["input"]) == (joint, "hub_torque")
        factors.append(np.array(found["value"]) @ [1, 1j])
    assert found["output"] == "strain"
    ratio = factors[0] / factors[1]
    assert ratio == pytest.approx(np.full(ratio.size, ratio[0]), rel=1e-6)
    assert abs(ratio[0] - 1) > 0.1


def test_the_file_of_a_bode_plot_has_what_is_drawn(capsys, tmp_path):
    code, out, _ = run(capsys, "bode", "sasaki2012", "--to", "300", "--csv", str(tmp_path / "bode.csv"))
    header, *rows = csv.reader((tmp_path / "bode.csv").read_text().splitlines())
    assert (code, header[0], float(rows[-1][0])) == (0, "omega_rad_s [rad/s]", 300.0)
    assert header[1:5] == ["re_value", "im_value", "phase_deg [deg]", "magnitude"]
    assert re.search(r"^frequency range +\([\d.]+, 300\) rad/s$", out, re.MULTILINE)


def test_bode_reports_and_draws_an_output_that_is_zero(capsys, tmp_path):
    """Nothing is beyond the free tip to shear it: G is 0, which has no logarithm."""
    there = ("bode", LAB, "--output", "shear", "--x", "1", "--to", "300")
    code, out, err = run(capsys, *there, "--png", str(tmp_path / "zero.png"))
    assert (code, err) == (0, f"written: {tmp_path / 'zero.png'}\n")
    assert "0 poles and 0 zeros up to 300 rad/s" in out
    found = tfarm.bode(tfarm.load(LAB), "shear", (1.0, 300.0), x=1.0)
    assert found.is_zero
    figure = tfarm.plots.bode.figure(found)
    assert [each.get_text() for each in figure.axes[0].texts] == ["zero at every frequency"]


def test_a_film_is_that_of_the_run_and_a_gif(capsys, tmp_path):
    file = tmp_path / "slew.gif"
    words = ("simulate", LAB, "--duration", "0.2", "--modes", "20", "--animate")
    code, out, err = run(capsys, *words, str(file))
    assert (code, err) == (0, f"written: {file}\n")
    assert "residual root moment" in out
    arm = tfarm.load(LAB)
    shown = tfarm.plots.animate(arm, tfarm.simulate(arm, tfarm.default_gains(arm), duration=0.2, count=20))
    assert file.read_bytes() == shown.gif
    code, _, err = run(capsys, *words, str(tmp_path / "slew.png"))
    assert code == 2
    assert "--animate" in err
    assert "ends in .gif" in err
