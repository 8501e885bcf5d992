"""tfarm reduce: what it prints, and how it fails."""

import json

import pytest

from tests.shell import run


def test_by_error_with_a_band_and_a_file(capsys, tmp_path):
    given = ("--error", "1e-6", "--band", "1,500", "--method", "modal", "--mat", str(tmp_path / "arm.mat"), "--json")
    code, out, _ = run(capsys, "reduce", "sasaki2012", "--outputs", "tip_displacement", *given)
    answer = json.loads(out)
    assert code == 0
    assert answer["worst_error"] <= 1e-6
    assert answer["method"] == "modal"
    assert (tmp_path / "arm.mat").exists()


def test_for_a_person(capsys):
    code, out, _ = run(capsys, "reduce", "sasaki2012", "--order", "14")
    assert code == 0
    assert "order 14" in out
    assert "first mode it lacks: 5" in out
    assert out.count("pole") == 6


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--order", "13"],
        ["--order", "some"],
        ["--order", "8", "--band", ""],
        ["--order", "8", "--outputs", "tip"],
        ["--order", "8", "--outputs", ""],
        ["--order", "8", "--mat", "/nowhere/a.mat"],
    ],
)
def test_bad_input_is_one_line(capsys, arguments):
    code, out, err = run(capsys, "reduce", "sasaki2012", *arguments)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1


def test_an_error_out_of_reach(capsys):
    code, _, err = run(capsys, "reduce", "sasaki2012", "--error", "1.1e-14", "--method", "aaa", "--band", "1,100")
    assert code == 3
    assert err.count("\n") == 1


def test_an_error_below_that_of_the_exact_values_is_refused_at_once(capsys):
    code, out, err = run(capsys, "reduce", "sasaki2012-lab", "--error", "1e-30")
    assert (code, out) == (2, "")
    assert err == (
        "tfarm: error = 1e-30: the exact values it is measured against are float64 numbers; ask for 1e-14 or more\n"
    )
