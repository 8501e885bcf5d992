"""The verbs of the continuous loop, and of assumptions, as a shell sees them; every printed digit of a pole holds."""

import csv
import math
import re
from dataclasses import replace
from decimal import Decimal

import pytest

import tfarm
from tests.shell import answer, refused, run
from tfarm.arm.reading import PRESETS
from tfarm.arm.writing import to_toml
from tfarm.loop.poles import closed_loop_poles
from tfarm.schema.quantities import COMPLEX_ERROR


def test_what_has_no_margin_is_null_and_what_is_at_every_frequency_is_at_none(capsys):
    """With K2 = 0 the undamped hub is passive: no law of its kind has a smaller peak, and no frequency is named."""
    driven = answer(capsys, "margins", "sasaki2012", "--K2", "1.2")
    assert driven["unstable_roots_infinite"] is True
    assert [row["interval"] for row in driven["stability_intervals"]] == [None] * 3
    assert [driven[key] for key in ("delay_margin_s", "disk_margin")] == [None] * 2
    found = answer(capsys, "margins", "sasaki2012", "--K2", "0")
    margins = found["in_range"]
    for key, value in (("disk_margin", 2), ("peak_sensitivity", 1)):
        assert found[key] == margins[key] == pytest.approx(value, rel=1e-7)
        assert margins[f"{key}_at_rad_s"] is None
    assert margins["phase_margin_at_rad_s"] > 0
    _, out, _ = run(capsys, "margins", "sasaki2012", "--K2", "0")
    assert re.search(r"^disk margin +2$", out, re.MULTILINE)
    assert re.search(r"^phase margin +90 deg at [\d.]+ rad/s$", out, re.MULTILINE)


@pytest.mark.parametrize("typed", [("--K1", "-1,3"), ("--K2", "-2,2"), ("--Kp", "3")])
def test_a_map_of_a_law_has_no_ranges_of_gains(capsys, tmp_path, typed):
    """They were passed over without a word."""
    law = tmp_path / "law.toml"
    law.write_text("[law.hub_rate]\ngain = 0.3\n[law.root_moment]\ngain = 0.3\n")
    plane = ("--vary", "hub_rate=-1,3", "--vary", "root_moment=-2,2", "--points", "7")
    err = refused(capsys, "map", "sasaki2012-lab", "--law", str(law), *plane, *typed)
    assert err.startswith(f"tfarm: {typed[0]} = ")
    assert "--vary NAME=LO,HI" in err
    file = tmp_path / "map.csv"  # by the theorem on gains at the hub, as without a law
    code, _, err = run(capsys, "map", "sasaki2012", "--law", str(law), *plane, "--csv", str(file))
    assert (code, err) == (0, f"written: {file}\n")
    rows = list(csv.reader(file.read_text().splitlines()))
    assert (rows[0], len(rows)) == (["hub_rate", "root_moment", "unstable_roots"], 50)


@pytest.mark.parametrize("verb", ["poles", "margins", "map", "design"])
def test_people_get_a_page_with_the_sign_convention(capsys, verb):
    more = {"map": ["--points", "12"], "design": ["--modes", "1", "--minimise", "damping"]}.get(verb, [])
    code, out, err = run(capsys, verb, "sasaki2012-lab", *more)
    assert (code, err) == (0, "")
    assert "K2 E I phi'(0)" in out
    assert not re.search(r"\bnan\b", out)


@pytest.mark.parametrize("Kp", ["0", "0.5"])
def test_the_verdict_sets_a_pole_at_0_apart_where_there_is_one(capsys, Kp):
    """That pole is in the list of poles, or not."""
    listed = answer(capsys, "poles", "sasaki2012-lab", "--Kp", Kp, "--count", "2")["poles"]
    at_rest = [0.0, 0.0] in listed
    _, out, _ = run(capsys, "margins", "sasaki2012-lab", "--Kp", Kp)
    assert ("its pole at s = 0 is left out" in out) is at_rest is (Kp == "0")


def test_what_cannot_be_decided_is_exit_3_with_its_reason(capsys):
    on_axis = refused(capsys, "margins", "sasaki2012-lab", "--K2", "1.0305375542174282", code=3)
    assert "on the imaginary axis to working precision" in on_axis
    unmet = refused(capsys, "design", "sasaki2012", "--K1", "0.1,1", "--K2", "1.1,2", code=3)
    assert "widen the bounds" in unmet


def test_a_list_of_poles_names_the_shear_cut_off_where_it_ends(capsys, tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text(PRESETS.joinpath("stocky-steel.toml").read_text().replace("damping = 0.0 ", "damping = 1e-5 "))
    found = answer(capsys, "poles", str(file), "--K1", "300")
    assert found["ends_at_shear_cutoff"] is True
    assert found["box"][3] <= found["shear_cutoff_rad_s"]
    printed = run(capsys, "poles", str(file), "--K1", "300")[1]
    assert re.search(r"^ends at the shear cut-off, sqrt\(kGA/rhoI\) +yes$", printed, re.MULTILINE)
    assert answer(capsys, "poles", str(file), "--K1", "300", "--count", "10")["ends_at_shear_cutoff"] is False


def test_the_table_marks_the_arm_and_gives_the_limits(capsys, tmp_path):
    code, out, err = run(capsys, "proof", "assumptions", "sasaki2012")
    assert (code, err) == (0, "")
    own = [line.split() for line in out.splitlines() if line.lstrip().startswith("yes")]
    assert own[0][1:5] == ["0.006", "0.1", "1.8e-09", "71.5057,"]
    assert own[1][1:3] == ["0.1", "71.5057,"]
    assert re.search(r"free pin \(I_h = 0\) \[rad/s\] +133.297,", out)
    assert re.search(r"locked hub \(I_h = inf\) \[rad/s\] +30.3995,", out)
    assert "area, shear factor and all else held" in out
    arm = replace(tfarm.load("stocky-steel"), hub=tfarm.Hub(inertia=math.inf), name="held")
    (tmp_path / "held.toml").write_text(to_toml(arm), encoding="utf-8")
    code, out, _ = run(capsys, "proof", "assumptions", str(tmp_path / "held.toml"))
    assert (code, "hub inertias" in out) == (0, False)


def pole_rows(printed):
    """The cells of the table of poles."""
    _, after = printed.split("damping ratio\n")
    return [line.split() for line in after.splitlines() if "default" not in line]


def test_poles_of_a_hardly_damped_arm_are_printed_as_far_as_they_are_proven(capsys, tmp_path):
    """C = 1e-10 s and a weak law: real parts below a millionth of the frequencies, against discs of 25 digits."""
    lab = tfarm.load("sasaki2012-lab")
    arm, file = replace(lab, link=replace(lab.link, damping=1e-10)), tmp_path / "arm.toml"
    file.write_text(to_toml(arm), encoding="utf-8")
    code, out, _ = run(capsys, "poles", str(file), "--K1", "1e-6", "--K2", "0", "--count", "6")
    assert code == 0
    discs = closed_loop_poles(arm, tfarm.HubFeedback(K1=1e-6), 6).certify(25)
    for row, disc in zip(pole_rows(out)[-len(discs) :], discs, strict=True):
        unit = Decimal(row[0]).as_tuple().exponent
        assert abs(Decimal(row[0]) - Decimal(disc.re)) <= Decimal(10) ** unit
        assert abs(Decimal(disc.re)) > COMPLEX_ERROR * math.hypot(float(disc.re), float(disc.im))


def test_a_lossless_loop_has_zeros_and_no_noise(capsys):
    code, out, _ = run(capsys, "poles", "sasaki2012", "--K1", "0", "--K2", "0.3", "--count", "6")
    assert code == 0
    assert [row[0] for row in pole_rows(out)] == ["0"] * 6
    code, out, _ = run(capsys, "sampled", "sasaki2012", "--K1", "0", "--K2", "0", "--modes", "4")
    assert code == 0
    assert "-0.000e+00" not in out
