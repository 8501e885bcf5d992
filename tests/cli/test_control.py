"""The verbs of the continuous loop as a shell sees them."""

import csv
from pathlib import Path

import pytest

import tfarm
from tests.cli.test_commands import answer, run
from tfarm import HubFeedback

LAW = HubFeedback(K1=0.3, K2=0.3)


def test_infinities_are_strings_and_what_has_no_margin_is_null(capsys) -> None:
    found = answer(capsys, "margins", "sasaki2012")
    assert found["K2_interval"] == ["-inf", pytest.approx(1.0, abs=1e-9)]
    assert found["K1_interval"] == [0.0, "inf"]
    assert (found["delay_margin_s"], found["disk_margin"], found["peak_sensitivity"]) == (0.0, 0.0, "inf")
    assert found["in_band"]["delay_margin_s"] > 0
    assert found["lyapunov"]["proven"] is True
    assert found["lyapunov"]["a1_over_a2"] == pytest.approx(0.7)
    driven = answer(capsys, "margins", "sasaki2012", "--K2", "1.2")
    assert driven["unstable_roots_infinite"] is True
    assert [driven[key] for key in ("K1_interval", "K2_interval", "delay_margin_s", "disk_margin")] == [None] * 4


def test_what_a_passive_loop_has_at_every_frequency_is_at_none(capsys):
    """With K2 = 0 the undamped hub is passive: no law of its kind has a smaller peak, and no frequency is named."""
    _, out, _ = run(capsys, "margins", "sasaki2012", "--K2", "0")
    rows = {
        line.strip()[:16].strip(): line.split()[-3:] for line in out.splitlines() if "margin" in line or "peak" in line
    }
    assert rows["disk margin"] == ["2", "2", "-"]
    assert rows["peak sensitivity"] == ["1", "1", "-"]
    assert rows["phase margin [de"][-1] != "-"


def test_the_map_counts_unstable_poles_over_its_grid(capsys, tmp_path) -> None:
    found = answer(capsys, "map", "sasaki2012", "--points", "4", "--K1", "-1,1", "--K2", "0,2")
    assert found["K1"] == [-0.75, -0.25, 0.25, 0.75]
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
    assert "nan" not in out


@pytest.mark.parametrize("Kp", ["0", "0.5"])
def test_the_verdict_sets_a_pole_at_0_apart_where_there_is_one(capsys, Kp) -> None:
    """That pole is in the list of poles, or not."""
    listed = answer(capsys, "poles", "sasaki2012-lab", "--Kp", Kp, "--count", "2")["poles"]
    at_rest = [0.0, 0.0] in listed
    _, out, _ = run(capsys, "margins", "sasaki2012-lab", "--Kp", Kp)
    assert ("apart from the pole at 0" in out.splitlines()[0]) is at_rest is (Kp == "0")


@pytest.mark.parametrize(
    "arguments",
    [
        ["margins", "sasaki2012", "--K1", "nan"],
        ["margins", "sasaki2012", "--K2", "inf"],
        ["margins", "sasaki2012", "--Kp", "1e30"],
        ["margins", "sasaki2012", "--K1", "much"],
        ["poles", "sasaki2012", "--count", "0"],
        ["poles", "sasaki2012", "--K1", "-inf"],
        ["map", "sasaki2012", "--K1", "1,1"],
        ["map", "sasaki2012", "--K1", "3,-1"],
        ["map", "sasaki2012", "--K2", "0,inf"],
        ["map", "sasaki2012", "--K2", "-inf,0"],
        ["map", "sasaki2012", "--K2", "nan,1"],
        ["map", "sasaki2012", "--K2", "1"],
        ["map", "sasaki2012", "--K1", "-1e300,1e300"],
        ["map", "sasaki2012", "--points", "1"],
        ["map", "sasaki2012", "--Kp", "nan"],
        ["design", "sasaki2012", "--objective", "beauty"],
        ["design", "sasaki2012", "--K1", "0,1e300"],
        ["design", "sasaki2012", "--K2", "2"],
        ["design", "sasaki2012", "--modes", "0"],
    ],
)
def test_bad_input_is_one_line_and_exit_2(capsys, arguments) -> None:
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert "Traceback" not in err


def test_what_cannot_be_decided_is_exit_3_with_its_reason(capsys) -> None:
    code, out, err = run(capsys, "margins", "sasaki2012-lab", "--K2", "1.0305375542174282")
    assert (code, out) == (3, "")
    assert "on the imaginary axis to working precision" in err
    code, _, err = run(capsys, "design", "sasaki2012", "--K1", "0.1,1", "--K2", "1.1,2")
    assert code == 3
    assert "widen the bounds" in err


def test_phases_are_printed_with_their_unit_and_a_lead_is_called_one(capsys) -> None:
    _, out, _ = run(capsys, "margins", "sasaki2012-lab")
    assert "phase margin [deg]" in out
    assert "phase margin -7.90147 deg: lead; not an instability" in out
    _, out, _ = run(capsys, "margins", "sasaki2012-lab", "--K2", "0")
    assert "not an instability" not in out


def test_a_list_of_poles_that_ends_at_the_shear_cut_off_says_so(capsys, tmp_path) -> None:
    file = tmp_path / "arm.toml"
    stocky = Path(tfarm.__file__).parent / "arm" / "presets" / "stocky-steel.toml"
    file.write_text(stocky.read_text().replace("damping = 0.0 ", "damping = 1e-5 "))
    found = answer(capsys, "poles", str(file), "--K1", "300")
    assert found["ends_at_shear_cutoff"] is True
    assert found["box"][3] <= found["shear_cutoff_rad_s"]
    assert "no more lie below sqrt(kGA/rhoI)" in run(capsys, "poles", str(file), "--K1", "300")[1]
    assert answer(capsys, "poles", str(file), "--K1", "300", "--count", "10")["ends_at_shear_cutoff"] is False
