"""The verbs of the continuous loop as a shell sees them."""

import csv
import re
from pathlib import Path

import pytest

import tfarm
from tests.cli.test_commands import answer, run
from tfarm import HubFeedback

LAW = HubFeedback(K1=0.3, K2=0.3)


def test_infinities_are_strings_and_what_has_no_margin_is_null(capsys) -> None:
    found = answer(capsys, "margins", "sasaki2012")
    K1, K2, _ = (row["interval"] for row in found["stability_intervals"])
    assert (K2["low"], K2["high"], K2["low_is"]) == ("-inf", pytest.approx(1.0, abs=1e-9), "no limit")
    assert (K1["low"], K1["high"]) == (0.0, "inf")
    assert (found["delay_margin_s"], found["disk_margin"], found["peak_sensitivity"]) == (0.0, 0.0, "inf")
    assert found["in_range"]["delay_margin_s"] > 0
    assert found["lyapunov"]["proven"] is True
    assert found["lyapunov"]["a1_over_a2"] == pytest.approx(0.7)
    driven = answer(capsys, "margins", "sasaki2012", "--K2", "1.2")
    assert driven["unstable_roots_infinite"] is True
    assert [row["interval"] for row in driven["stability_intervals"]] == [None] * 3
    assert [driven[key] for key in ("delay_margin_s", "disk_margin")] == [None] * 2


def test_what_a_passive_loop_has_at_every_frequency_is_at_none(capsys):
    """With K2 = 0 the undamped hub is passive: no law of its kind has a smaller peak, and no frequency is named."""
    found = answer(capsys, "margins", "sasaki2012", "--K2", "0")
    margins = found["in_range"]
    for key, value in (("disk_margin", 2), ("peak_sensitivity", 1)):
        assert found[key] == margins[key] == pytest.approx(value, rel=1e-7)
        assert margins[f"{key}_at_rad_s"] is None
    assert margins["phase_margin_at_rad_s"] > 0
    _, out, _ = run(capsys, "margins", "sasaki2012", "--K2", "0")
    assert re.search(r"^disk margin +2$", out, re.MULTILINE)
    assert re.search(r"^phase margin +90 deg at [\d.]+ rad/s$", out, re.MULTILINE)


def test_the_map_counts_unstable_poles_over_its_grid(capsys, tmp_path) -> None:
    found = answer(capsys, "map", "sasaki2012", "--points", "4", "--K1", "-1,1", "--K2", "0,2")
    assert found["x"] == [-0.75, -0.25, 0.25, 0.75]
    assert found["unstable_roots"] == [["inf", "inf", 0, 0]] * 2 + [[1, 1, "inf", "inf"]] * 2
    file = tmp_path / "map.csv"
    code, _, err = run(capsys, "map", "sasaki2012-lab", "--points", "3", "--csv", str(file))
    assert (code, err) == (0, f"written: {file}\n")
    rows = list(csv.reader(file.read_text().splitlines()))
    assert rows[0] == ["K1", "K2", "unstable_roots"]
    assert len(rows) == 10


@pytest.mark.parametrize("typed", [("--K1", "-1,3"), ("--K2", "-2,2"), ("--Kp", "3")])
def test_a_map_of_a_law_has_no_ranges_of_gains(capsys, tmp_path, typed) -> None:
    """They were passed over without a word."""
    law = tmp_path / "law.toml"
    law.write_text("[law.hub_rate]\ngain = 0.3\n[law.root_moment]\ngain = 0.3\n")
    plane = ("--vary", "hub_rate=-1,3", "--vary", "root_moment=-2,2", "--points", "3")
    code, out, err = run(capsys, "map", "sasaki2012-lab", "--law", str(law), *plane, *typed)
    assert (code, out) == (2, "")
    assert err.startswith(f"tfarm: {typed[0]} = ")
    assert "--vary NAME=LO,HI" in err
    code, out, err = run(capsys, "map", "sasaki2012", "--law", str(law), *plane[:-1], "7")
    assert (code, err) == (0, "")  # by the theorem on gains at the hub, as without a law


@pytest.mark.parametrize("verb", ["poles", "margins", "map", "design"])
def test_people_get_a_page_with_the_sign_convention(capsys, verb) -> None:
    more = {"map": ["--points", "12"], "design": ["--modes", "1", "--K1", "0,2", "--K2", "0,1"]}.get(verb, [])
    code, out, err = run(capsys, verb, "sasaki2012-lab", *more)
    assert (code, err) == (0, "")
    assert "K2 E I phi'(0)" in out
    assert not re.search(r"\bnan\b", out)


@pytest.mark.parametrize("Kp", ["0", "0.5"])
def test_the_verdict_sets_a_pole_at_0_apart_where_there_is_one(capsys, Kp) -> None:
    """That pole is in the list of poles, or not."""
    listed = answer(capsys, "poles", "sasaki2012-lab", "--Kp", Kp, "--count", "2")["poles"]
    at_rest = [0.0, 0.0] in listed
    _, out, _ = run(capsys, "margins", "sasaki2012-lab", "--Kp", Kp)
    assert ("its pole at s = 0 is left out" in out) is at_rest is (Kp == "0")


def test_what_cannot_be_decided_is_exit_3_with_its_reason(capsys) -> None:
    code, out, err = run(capsys, "margins", "sasaki2012-lab", "--K2", "1.0305375542174282")
    assert (code, out) == (3, "")
    assert "on the imaginary axis to working precision" in err
    code, _, err = run(capsys, "design", "sasaki2012", "--K1", "0.1,1", "--K2", "1.1,2")
    assert code == 3
    assert "widen the bounds" in err


def test_a_list_of_poles_names_the_shear_cut_off_where_it_ends(capsys, tmp_path) -> None:
    file = tmp_path / "arm.toml"
    stocky = Path(tfarm.__file__).parent / "arm" / "presets" / "stocky-steel.toml"
    file.write_text(stocky.read_text().replace("damping = 0.0 ", "damping = 1e-5 "))
    found = answer(capsys, "poles", str(file), "--K1", "300")
    assert found["ends_at_shear_cutoff"] is True
    assert found["box"][3] <= found["shear_cutoff_rad_s"]
    printed = run(capsys, "poles", str(file), "--K1", "300")[1]
    assert re.search(r"^ends at the shear cut-off, sqrt\(kGA/rhoI\) +yes$", printed, re.MULTILINE)
    assert answer(capsys, "poles", str(file), "--K1", "300", "--count", "10")["ends_at_shear_cutoff"] is False
