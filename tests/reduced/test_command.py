"""tfarm reduce: what it prints, and how it fails."""

import json

import pytest

import tfarm
from tfarm.cli import main
from tfarm.reduced import reduction
from tfarm.reduced.modal import relaxed_model


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(["reduce", *arguments])
    captured = capsys.readouterr()
    return stop.value.code, captured.out, captured.err


def test_by_error_with_a_band_and_a_file(capsys, tmp_path):
    given = ("--error", "1e-6", "--band", "1,500", "--method", "modal", "--mat", str(tmp_path / "arm.mat"), "--json")
    code, out, _ = run(capsys, "sasaki2012", "--outputs", "tip_displacement", *given)
    answer = json.loads(out)
    assert code == 0
    assert answer["worst_error"] <= 1e-6
    assert answer["method"] == "modal"
    assert (tmp_path / "arm.mat").exists()


def test_for_a_person(capsys):
    code, out, _ = run(capsys, "sasaki2012", "--order", "14")
    assert code == 0
    assert "order 14" in out
    assert "first mode it lacks: 5" in out
    assert out.count("pole") == 6


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--order", "13"],
        ["--order", "1e9"],
        ["--order", "some"],
        ["--error", "nan"],
        ["--order", "8", "--band", "nan,1"],
        ["--order", "8", "--band", "1,1"],
        ["--order", "8", "--band", ""],
        ["--order", "8", "--outputs", "tip"],
        ["--order", "8", "--outputs", "moment"],
        ["--order", "8", "--outputs", ""],
        ["--order", "8", "--method", "balred"],
        ["--order", "8", "--mat", "/nowhere/a.mat"],
    ],
)
def test_bad_input_is_one_line(capsys, arguments):
    code, out, err = run(capsys, "sasaki2012", *arguments)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1


def test_an_error_out_of_reach(capsys):
    code, _, err = run(capsys, "sasaki2012", "--error", "1.1e-14", "--method", "aaa", "--band", "1,100")
    assert code == 3
    assert err.count("\n") == 1


def test_an_error_below_that_of_the_exact_values_is_refused_at_once(capsys):
    code, out, err = run(capsys, "sasaki2012-lab", "--error", "1e-30")
    assert (code, out) == (2, "")
    assert err == (
        "tfarm: error = 1e-30: the exact values it is measured against are float64 numbers; ask for 1e-14 or more\n"
    )


@pytest.mark.survey
def test_the_search_ends_where_more_modes_no_longer_help(monkeypatch):
    """The relaxed model's error has a floor, that of one state for all modes left out: no 199 damped modes for it."""
    asked = []
    lab = tfarm.load("sasaki2012-lab")

    def model(arm, names, count, x):
        asked.append(count)
        return relaxed_model(arm, names, count, x)

    bench = reduction._Bench(lab, ("root_moment",), (1.0, 30.0), None, None)
    assert bench._few_modes(1.1e-14, model, 199) is None
    assert max(asked) < 60
