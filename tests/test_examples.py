"""The scripts of examples/, each run unchanged; its results are compared with a second method."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot

import tfarm
from tfarm.dsp import sampled_verdict

SCRIPTS = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))


@pytest.fixture
def example(tmp_path, monkeypatch, capsys):
    """A function that runs the script of a number in an empty folder: its names, and what it prints."""
    monkeypatch.chdir(tmp_path)
    pyplot.switch_backend("Agg")

    def run(number):
        (script,) = (each for each in SCRIPTS if each.name.startswith(f"{number}_"))
        names = runpy.run_path(str(script))
        return names, capsys.readouterr().out

    yield run
    pyplot.close("all")


def test_there_are_eight_and_the_readme_names_each():
    text = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
    assert len(SCRIPTS) == 8
    assert [each.name for each in SCRIPTS if each.name not in text] == []


def test_my_arm_is_that_of_a_file(example, tmp_path):
    names, out = example(1)
    (tmp_path / "arm.toml").write_text(
        'name = "my-arm"\n[link]\nlength = 0.8\ndensity = 7850.0\nyoungs_modulus = 2.1e11\npoissons_ratio = 0.3\n'
        'damping = 2e-5\n[link.section]\nshape = "rectangle"\nwidth = 0.06\ndepth = 0.004\n'
        "[hub]\ninertia = 0.05\n[payload]\nmass = 0.2\ninertia = 1e-4\n"
    )
    other = tfarm.load(str(tmp_path / "arm.toml"))
    assert names["modes"].natural_frequency == pytest.approx(tfarm.modes(other, 4).natural_frequency, rel=1e-13)
    assert "|G| at 73.8588 rad/s" in out


def test_margins_are_seen_on_the_map_too(example, tmp_path):
    names, out = example(2)
    _, end = names["found"].windows["K2"].around
    plane = names["plane"]
    column = int(np.argmin(abs(plane.K1 - 0.3)))
    (window,) = tfarm.map(tfarm.load("sasaki2012-lab"), np.array([0.2, 0.3]), plane.K2).stable_intervals[1]
    assert window[1] == pytest.approx(end, rel=1e-10)
    assert plane.stable[:, column].tolist() == np.less(plane.K2, end).tolist()
    assert out.startswith("stable\n")
    assert (tmp_path / "margins.png").stat().st_size > 10_000


def test_a_notch_that_a_model_is_content_with_drives_a_mode(example):
    names, out = example(3)
    poles = tfarm.closed_loop_poles(names["arm"], names["law"], 8).values
    driven = poles[poles.real > 1e-9 * abs(poles)][0]  # the slowest: others are driven too
    assert f"mode 3 is unstable in the exact loop, at {abs(driven.imag):.6g} rad/s" in out
    assert out.endswith("with damping: stable\n")


def test_the_sampled_loop_holds_and_K2_calms_the_slew(example, tmp_path):
    names, out = example(4)
    assert out.count("ms: stable") == 2
    quiet, loud = (abs(names["runs"][f"K2 = {K2}"].at_samples.root_moment[-20:]).max() for K2 in ("0.3", "0"))
    assert quiet < loud
    assert (tmp_path / "slew.png").exists()


def test_a_tuned_gain_stays_in_its_guard(example, tmp_path):
    names, _ = example(5)
    training = names["found"].training
    assert min(training.costs) <= training.costs[0]
    K, guard = training.result.K, training.guard
    assert guard.lo <= K.min() <= K.max() <= guard.hi
    assert (tmp_path / "gain.png").exists()


def test_a_fit_finds_the_numbers_that_were_measured(example):
    names, out = example(6)
    truth = {"link.youngs_modulus": names["softer"].youngs_modulus, "hub.inertia": names["bench"].hub.inertia}
    for each in names["found"].parameters:
        assert abs(each.value - truth[each.key]) < 4 * each.deviation < 0.02 * truth[each.key]
    assert out.startswith("fitted")


def test_a_design_for_one_sampling_period_may_be_unstable_at_another(example):
    names, out = example(7)
    slow, fast = names["chosen"].values()
    assert slow.value < fast.value
    assert sampled_verdict(names["arm"], slow.law).word == "stable"
    assert out.endswith("at the longer sampling period: unstable\n")


def test_what_is_exported_is_the_rig_and_a_law_that_holds_on_it(example, tmp_path):
    """The matrices in the file answer as the exact arm does, to the error that the model promises."""
    names, out = example(8)
    assert "on the rig itself: stable" in out
    file, omega = np.load(tmp_path / "model.npz"), np.array([1.0, 20.0, 66.0, 200.0])
    A, B, C, D = (file[each] for each in "ABCD")
    moment = [(C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D)[0, 0] for w in omega]
    G = tfarm.transfer(names["bench"], "root_moment")
    scale = abs(G(1j * omega)) + omega * abs(G.derivative(1j * omega))
    assert (abs(moment - G(1j * omega)) < names["model"].worst_error * scale).all()
    assert np.array_equal(names["law"].signals, ("hub_rate", "root_moment"))
