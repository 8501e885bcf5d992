"""tfarm tune and tfarm simulate --controller as a shell sees them; one cost of a slew wherever it is read."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tfarm
from tests.shell import answer, refused, run
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.dsp.results import simulate_scenario
from tfarm.schema import to_dict
from tfarm.tuner import Plan, compare_controllers, shaped_trial, slew_trial, tune
from tfarm.tuner.baselines import tried_loops
from tfarm.tuner.guard import Guard


def test_tune_lab(capsys, tmp_path):
    """The figures of theory and prototypes, then the saved tuner in the simulator."""
    file = tmp_path / "tuner.json"
    result = answer(capsys, "tune", "sasaki2012-lab", "--trials", "60", "--save", str(file))
    assert result["cost_without"] == pytest.approx(2.69, abs=0.005)
    assert result["cost_best_constant"] == pytest.approx(0.953, abs=5e-4)
    assert result["best_constant_gain"] == pytest.approx(0.34, abs=0.005)
    assert result["cost_lq_bound"] == pytest.approx(0.256, abs=5e-4)
    assert result["cost_shaped"] == min(each["cost"] for each in result["shaped"].values()) < 0.03
    late = {kind: each["arrives_later_by_s"] for kind, each in result["shaped"].items()}
    assert late == pytest.approx(lateness(tfarm.load("sasaki2012-lab"), 0.01), abs=1e-12)
    assert len(result["cost"]) == result["trials"] == 60
    assert result["cost_lq_bound"] < result["cost_tuned"] < result["cost_best_constant"]
    assert result["residual_moment_rms"] < 0.4 * result["residual_without"]
    low, high = result["guard"]["lo"], result["guard"]["hi"]
    assert low <= min(result["gain"]["K"]) <= max(result["gain"]["K"]) <= high
    assert (result["guard"]["kind"], result["guard"]["proven"]) == ("time-varying", True)
    assert np.array(result["weights"]["W1"]).shape == (6, 6)
    simulated = answer(capsys, "simulate", "sasaki2012-lab", "--controller", str(file), "--modes", "6")
    np.testing.assert_allclose(simulated["gain"], result["gain"]["K"], atol=1e-11)
    assert simulated["controller"]["trained_on"] == "sasaki2012-lab"
    for key in ("residual_moment_rms", "residual_raw_moment_rms"):  # one name, one meaning
        assert simulated[key] == pytest.approx(result[key], rel=1e-9)
    assert result["residual_raw_moment_rms"] > 1.05 * result["residual_moment_rms"]


def lateness(arm, period):
    """Half a damped period of either mode of the exact loop in whole samples and one more; of EI a whole one."""
    poles = tfarm.closed_loop_poles(arm, tfarm.HubFeedback(K1=0.3), 4).values
    first, second = sorted(pole.imag for pole in poles if pole.imag > 0)[:2]

    def samples(halves):
        return sum(math.floor(halves * math.pi / (omega * period)) + 1 for omega in (first, second))

    return {"ZV": period * samples(1), "EI": period * samples(2)}


def test_a_shaped_slew_is_that_of_the_shaper_without_moment_feedback(capsys, tmp_path):
    """Tuned on it, with the baselines of the plain slew; the saved tuner meets the same slew in the simulator."""
    chain, file = tmp_path / "chain.toml", tmp_path / "tuner.json"
    chain.write_text('[reference]\nshaper = "ZV"\n')
    options = ("tune", "sasaki2012-lab", "--trials", "3")
    plain = answer(capsys, *options)
    found = answer(capsys, *options, "--dsp", str(chain), "--save", str(file))
    assert found["cost_without"] == pytest.approx(plain["shaped"]["ZV"]["cost"], rel=1e-9)
    assert found["shaped"]["ZV"]["cost"] == pytest.approx(found["cost_without"], rel=1e-9)
    assert found["shaped"]["ZV"]["arrives_later_by_s"] == pytest.approx(0.0, abs=1e-12)
    assert found["shaped"]["EI"]["cost"] == pytest.approx(plain["shaped"]["EI"]["cost"], rel=1e-9)
    assert found["cost_lq_bound"] < found["cost_best_constant"] <= found["cost_without"]
    words = ("simulate", "sasaki2012-lab", "--controller", str(file), "--modes", "6", "--dsp", str(chain))
    simulated = answer(capsys, *words)
    np.testing.assert_allclose(simulated["gain"], found["gain"]["K"], atol=1e-11)
    assert simulated["residual_moment_rms"] == pytest.approx(found["residual_moment_rms"], rel=1e-9)
    words = ("export", "sasaki2012-lab", "--what", "tuner", "--as", "c", "--tuned", str(file), "--dsp", str(chain))
    assert "reference.shaper = 'ZV'" in refused(capsys, *words, "--out", str(tmp_path / "out"))


def test_without_a_guard_the_upper_end_is_inf_and_a_divergence_is_reported(capsys):
    options = ("tune", "sasaki2012-lab", "--guard", "none", "--rule", "plain", "--seed", "3", "--curves", "2")
    code, out, err = run(capsys, *options, "--json")
    result = json.loads(out)
    curves = result["curves"]
    assert code == 0
    assert (result["guard"]["lo"], result["guard"]["hi"], result["guard"]["proven"]) == (0.0, "inf", False)
    assert result["cost"][-1] == "inf"
    assert f"diverged in trial {len(result['cost'])} at sample" in err
    assert err.endswith(f"tfarm: {result['stopped']}; the tuner is that of the trial before\n")
    assert (curves["diverged"], curves["final_cost"][0], curves["upper_quartile"][-1]) == (1, "inf", "inf")
    _, out, _ = run(capsys, *options)
    assert re.search(r"^seeds diverged +1$", out, re.MULTILINE)
    assert re.search(r"^seeds +2$", out, re.MULTILINE)


def test_tables_for_people(capsys):
    _, out, _ = run(capsys, "tune", "sasaki2012-lab", "--trials", "2", "--mode", "online", "--seventh-input")
    assert "linear-quadratic bound of the unshaped slew" in out
    assert "certified for any K(t)" in out


def test_learning_curves_are_the_tunings_of_their_seeds(capsys):
    """Median and quartiles after each trial, and of the final costs."""
    options = ("tune", "sasaki2012-lab", "--trials", "4", "--guard", "frozen", "--rule", "clipped")
    curves = answer(capsys, *options, "--seed", "7", "--curves", "5")["curves"]
    alone = [answer(capsys, *options, "--seed", str(seed)) for seed in range(7, 12)]
    costs, final = np.sort([each["cost"] for each in alone], axis=0), [each["cost_tuned"] for each in alone]
    assert [curves[key] for key in ("lower_quartile", "median", "upper_quartile")] == costs[1:4].tolist()
    assert (curves["seeds"], curves["final_cost"], curves["final_quartiles"]) == (5, final, sorted(final)[1:4])
    assert (curves["diverged"], curves["died"]) == (0, 0)


BAD = ("--eta -0.8", "--alpha 1", "--trials 0", "--trials 2.5", "--mode batch", "--guard wide", "--signals both",
       "--rule adam", "--a -1", "--K1 nan", "--duration 0", "--hidden 0", "--curves -1", "--seed -1",
       "--save /no/such/folder/tuner.json --trials 1 --guard none")  # fmt: skip


@pytest.mark.parametrize("options", BAD)
def test_bad_input_is_one_line(capsys, options):
    name, *_ = options.split()
    assert f"{name.strip('-')} = " in refused(capsys, "tune", "sasaki2012-lab", *options.split())


def test_an_empty_guard_is_exit_3(capsys):
    assert "with a damping of C =" in refused(capsys, "tune", "sasaki2012", code=3)


def test_a_bad_controller_is_one_line(capsys, tmp_path):
    file = tmp_path / "tuner.json"
    file.write_text('{"format": "tfarm tuner 1", "w2": [NaN]}')
    assert str(file) in refused(capsys, "simulate", "sasaki2012-lab", "--controller", str(file))


def test_the_comparison_is_of_one_run():
    """On the arm as trained it repeats the tuning's costs, by the simulator; the bound bounds every unshaped row."""
    lab = tfarm.load("sasaki2012-lab")
    tuning = tune(lab, Plan(trials=40, guard="frozen"))
    listed = [each for each in tried_loops(tuning.trial.case) if "C =" not in each.name]
    assert len(listed) == 9
    rows = compare_controllers(tuning.trial, tuning.gain(), tuning.training.guard, listed[:1] + listed[3:5])
    first = rows[0]
    assert not first.proven  # the guard is of the frozen kind, though its middle is a proven sector of this loop
    middle = Guard("time-varying", 0.3, 0.35, 6, True, (object(),))
    assert [
        compare_controllers(tuning.trial, tuning.gain(), each, listed[:1])[0].proven
        for each in (middle, replace(middle, proofs=()), replace(middle, lo=0.0, hi=9.0))
    ] == [True, False, False]
    assert first.without.cost == pytest.approx(tuning.without.cost, rel=1e-10)
    assert first.best_constant.cost == pytest.approx(tuning.best_constant.cost, rel=1e-10)
    assert first.tuner.cost == pytest.approx(tuning.training.result.cost, rel=1e-10)
    assert first.bound.cost == pytest.approx(tuning.bound.cost, rel=1e-10)
    for kind in ("ZV", "EI"):
        assert getattr(first, kind).cost == pytest.approx(tuning.shaped[kind].cost, rel=1e-10)
    loaded = replace(slew_trial(listed[4].case.arm, K1=0.3), task=tuning.trial.task)
    assert listed[4].name == "payload 0.1 kg"
    shaped_slew = replace(loaded, task=shaped_trial(tuning.trial, "ZV").task)  # by the poles of the arm it was made for
    assert rows[2].ZV.cost == pytest.approx(shaped_slew.with_constant(0.0).cost, rel=1e-10)
    assert rows[2].without.cost == pytest.approx(loaded.with_constant(0.0).cost, rel=1e-10)
    for row in rows:
        for each in (row.without, row.best_constant, row.own_constant, row.tuner):
            assert each.cost > row.bound.cost
        assert row.own_constant.cost <= row.best_constant.cost * (1 + 1e-9) or "quantised" in row.condition


SMALL = Path(__file__).parents[1] / "data" / "reproductions" / "r3.toml"
ARM, UNIT = tfarm.load(SMALL), 0.3  # N m: a tenth of the paper's 3 N m is what its slew takes, to one digit


def cost_by_hand(law, duration=3.0):
    """T sum of (x^2 + 2.6 e^2)/2 of a simulated slew, in units of 0.3 N m; e is what the law adds to r."""
    found = to_dict(simulate_scenario(Case(ARM, law, Chain()), "slew", duration, count=6))
    t, acceleration = np.array(found["t"]), 4 * 1.15  # rad/s^2: 1.15 rad in 1 s
    sign = np.where(t < 0.5 - 1e-9, 1.0, np.where(t < 1.0 - 1e-9, -1.0, 0.0))
    before = np.r_[0.0, sign[:-1]]
    rate = acceleration * np.clip(np.minimum(t, 1 - t), 0, None)
    mean = np.append((rate[1:] + rate[:-1]) / 2, 0.0)
    feedforward = ARM.total_inertia * acceleration * sign + ARM.hub.friction * mean
    x = np.array(found["root_moment"]) + ARM.gauged_inertia * acceleration * before
    e = np.array(found["torque"]) - feedforward
    return 0.01 * np.sum(x**2 + 2.6 * e**2) / 2 / UNIT**2


def test_text_json_and_file_have_one_cost(capsys, tmp_path):
    saved = tmp_path / "tuner.json"
    _, out, _ = run(capsys, "tune", str(SMALL))
    found = answer(capsys, "tune", str(SMALL), "--save", str(saved))
    assert f"cost_unit_N_m {UNIT:g}" in out
    assert (found["a"], found["b"], found["cost_unit_N_m"]) == (1.0, 2.6, UNIT)
    for key in ("cost_without", "cost_best_constant", "cost_tuned"):
        assert f"{found[key]:.4g}" in out
    kept = json.loads(saved.read_text())
    assert (kept["a"], kept["b"], kept["scales"]) == (1.0, 2.6, [UNIT] * 6)
    for key, K2 in (("cost_without", 0.0), ("cost_best_constant", found["best_constant_gain"])):
        assert found[key] == pytest.approx(cost_by_hand(tfarm.HubFeedback(K1=found["K1"], K2=K2)), rel=1e-9)


def test_the_reading_of_the_chain_is_that_of_a_trial(capsys, tmp_path):
    file = tmp_path / "total.toml"
    file.write_text('[slew]\nreading = "total"\nrise_time = 0.5\n')
    found = answer(capsys, "tune", "sasaki2012-lab", "--dsp", str(file), "--trials", "2")
    assert found["signals"] == "total"
    assert found["gain"]["t"][-1] == pytest.approx(1.5)
