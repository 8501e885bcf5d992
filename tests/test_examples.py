"""The scripts of examples/, each run unchanged: what it prints and draws, and what a second method has for it."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from matplotlib import pyplot

import tfarm

ROOT = Path(__file__).parent.parent
SCRIPTS = sorted((ROOT / "examples").glob("*.py"))


def within_four_deviations(names):
    truth = {"link.youngs_modulus": names["softer"].youngs_modulus, "hub.inertia": names["bench"].hub.inertia}
    fitted = names["found"].parameters
    return all(abs(each.value - truth[each.key]) < 4 * each.deviation < 0.02 * truth[each.key] for each in fitted)


def is_on_the_map(names):
    """The end of the stability interval is where the column of the map at these gains ends."""
    plane, (_, end) = names["plane"], names["found"].windows["K2"].around
    column = int(np.argmin(abs(plane.K1 - 0.3)))
    (window,) = tfarm.map(tfarm.load("sasaki2012-lab"), np.array([0.2, 0.3]), plane.K2).stable_intervals[1]
    return window[1] == pytest.approx(end, rel=1e-10) and np.array_equal(plane.stable[:, column], end > plane.K2)


def drives_the_slowest_pole(names):
    poles = tfarm.closed_loop_poles(names["arm"], names["law"], 8).values
    (driven, *_) = poles[poles.real > 1e-9 * abs(poles)]  # others are driven too
    return f"{abs(driven.imag):.6g} rad/s" in names["found"].in_words


def is_calmed(names):
    quiet, loud = (abs(names["runs"][f"K2 = {K2}"].at_samples.root_moment[-20:]).max() for K2 in ("0.3", "0"))
    return quiet < loud


def is_damped_more_at_the_shorter_period(names):
    slow, fast = names["chosen"].values()
    return slow.value < fast.value


def stays_in_its_guard(names):
    training = names["found"].training
    K, guard = training.result.K, training.guard
    return guard.lo <= K.min() <= K.max() <= guard.hi and min(training.costs) <= training.costs[0]


def is_the_fitted_arm(names):
    """The matrices in the file answer as the exact fitted arm does, to the error in the file."""
    model, omega = scipy.io.loadmat("matlab/loop.mat", squeeze_me=True)["reduced"], np.array([1.0, 20.0, 66.0, 200.0])
    A, B, C, D = (model[each].item() for each in "ABCD")
    row = list(model["output_names"].item()).index("root_moment")
    moment = [C[row] @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D[row] for w in omega]
    G = tfarm.transfer(names["arm"], "root_moment")
    scale = abs(G(1j * omega)) + omega * abs(G.derivative(1j * omega))
    return (abs(moment - G(1j * omega)) < (float(model["worst_error"]) + 1e-11) * scale).all()  # and rounding


EXAMPLES = {  # of the script: some of what it prints, its picture, and what is so of its names
    "1_my_arm": ("|G| at 73.8588 rad/s", "", lambda names: names["modes"].natural_frequency.size == 5),
    "2_margins": ("stable\n", "margins.png", is_on_the_map),
    "3_notch": ("with damping: stable\n", "", drives_the_slowest_pole),
    "4_sampled_slew": ("ms: stable", "slew.png", is_calmed),
    "5_tune": ("best constant gain", "gain.png", stays_in_its_guard),
    "6_fit": ("fitted", "", within_four_deviations),
    "7_design": ("at the longer sampling period: unstable\n", "", is_damped_more_at_the_shorter_period),
    "8_fit_design_export": ("on the rig itself: stable", "matlab/loop.mat", is_the_fitted_arm),
}


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_an_example_runs_and_is_right(script, tmp_path, monkeypatch, capsys):
    printed, file, is_right = EXAMPLES[script.stem]
    monkeypatch.chdir(tmp_path)
    pyplot.switch_backend("Agg")
    names = runpy.run_path(str(script))
    pyplot.close("all")
    assert printed in capsys.readouterr().out
    assert not file or (tmp_path / file).stat().st_size > 1_000
    assert is_right(names)
    assert script.name in (ROOT / "README.md").read_text(encoding="utf-8")
