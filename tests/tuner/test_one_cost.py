"""One cost of a slew, in one unit: printed, in JSON, on the page, in the saved file and of a design, and by hand."""

import json
from pathlib import Path

import numpy as np
import pytest

import tfarm
from tests.shell import answer, run
from tests.synthesis.judged import judge_of
from tfarm.dsp import Chain
from tfarm.dsp.results import simulated_run
from tfarm.report import tuner_section
from tfarm.report.tuner_section import cost_tables
from tfarm.schema import to_dict
from tfarm.tuner.tuning import trial_of, usual_plan

SMALL = Path(__file__).parents[1] / "data" / "reproductions" / "r3.toml"
ARM, UNIT = tfarm.load(SMALL), 0.3  # N m: a tenth of the paper's 3 N m is what its slew takes, to one digit


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return tmp_path_factory.mktemp("tuner") / "tuner.json"


@pytest.fixture(scope="module")
def page():
    """What the page has, but with few seeds, and the rows of the arm itself alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuner_section, "CURVE_SEEDS", 1)
        patch.setattr(tuner_section, "LONG_TRIAL", 1)
        patch.setattr(tuner_section, "_servo_tuning", lambda *given: None)
        return tuner_section.tuner_numbers(ARM, Chain())


def by_hand(law, duration=3.0):
    """T sum of (x^2 + 2.6 e^2)/2 of a simulated slew, in units of 0.3 N m; e is what the law adds to r."""
    found = to_dict(simulated_run(ARM, law, Chain(), "slew", duration, count=6))
    t, acceleration = np.array(found["t"]), 4 * 1.15  # rad/s^2: 1.15 rad in 1 s
    sign = np.where(t < 0.5 - 1e-9, 1.0, np.where(t < 1.0 - 1e-9, -1.0, 0.0))
    before = np.r_[0.0, sign[:-1]]
    rate = acceleration * np.clip(np.minimum(t, 1 - t), 0, None)
    mean = np.append((rate[1:] + rate[:-1]) / 2, 0.0)
    feedforward = ARM.total_inertia * acceleration * sign + ARM.hub.friction * mean
    x = np.array(found["root_moment"]) + ARM.gauged_inertia * acceleration * before
    e = np.array(found["torque"]) - feedforward
    return 0.01 * np.sum(x**2 + 2.6 * e**2) / 2 / UNIT**2


def test_text_json_page_and_file_have_one_cost(capsys, saved, page):
    _, out, _ = run(capsys, "tune", str(SMALL))
    found = answer(capsys, "tune", str(SMALL), "--save", str(saved))
    assert f"cost_unit_N_m {UNIT:g}" in out
    assert (found["a"], found["b"], found["cost_unit_N_m"]) == (1.0, 2.6, UNIT)
    costs = {"without": "cost_without", "best_constant": "cost_best_constant", "tuner": "cost_tuned"}
    row = cost_tables(page)[0][0]
    for name, key in costs.items():
        assert f"{found[key]:.4g}" in out
        assert row[f"{name}_cost"] == pytest.approx(found[key], rel=1e-9)
    assert page.tuning.training.costs.tolist() == found["cost"]
    assert f"units of {UNIT:g} N m" in cost_tables(page)[0].caption
    kept = json.loads(saved.read_text())
    assert (kept["a"], kept["b"], kept["scales"]) == (1.0, 2.6, [UNIT] * 6)
    law = tfarm.HubFeedback(K1=found["K1"])
    assert found["cost_without"] == pytest.approx(by_hand(law), rel=1e-9)
    law = tfarm.HubFeedback(K1=found["K1"], K2=found["best_constant_gain"])
    assert found["cost_best_constant"] == pytest.approx(by_hand(law), rel=1e-9)


def test_a_design_counts_the_same_cost():
    """Compared with a trial of as many modes."""
    plan = usual_plan(ARM)
    trial = trial_of(ARM, plan, Chain())
    alike = tfarm.tuner.slew_trial(ARM, K1=0.8, Kp=1.0, cost=trial.cost, duration=plan.duration, count=8).with_constant(
        0.2
    )
    law = tfarm.HubFeedback(Kp=1.0, K1=0.8, K2=0.2)
    assert judge_of(ARM, law, "cost").score(law) == pytest.approx(alike.cost, rel=1e-9)


def test_the_reading_of_the_chain_is_that_of_a_trial(capsys, tmp_path):
    file = tmp_path / "total.toml"
    file.write_text('[slew]\nreading = "total"\nrise_time = 0.5\n')
    found = answer(capsys, "tune", "sasaki2012-lab", "--dsp", str(file), "--trials", "2")
    assert found["signals"] == "total"
    assert found["gain"]["t"][-1] == pytest.approx(1.5)
