"""One residual root moment: what a design promises, a simulation finds and the tuner reports, to the last digits.

The arm's own moment less the rigid arm's after the slew, whatever the moment feedback reads of it; by matrix
exponentials of the modal model with its analog filter once more.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import tfarm
from tests.shell import run
from tests.synthesis.judged import judge_of
from tfarm import HubFeedback, tuner
from tfarm.dsp import Chain, Slew
from tfarm.dsp.chain import Sampling
from tfarm.dsp.results import simulated_run
from tfarm.reduced import modal_model
from tfarm.schema import to_dict
from tfarm.synthesis import search
from tfarm.synthesis.design import design
from tfarm.tuner.tuning import controlled_run

DATA = Path(__file__).parents[1] / "data" / "reproductions"
LAB = tfarm.load("sasaki2012-lab")
CHAINS = [
    Chain(sampling=Sampling(period=0.008, antialias_corner=corner), slew=Slew(reading=reading))
    for corner in (np.inf, 300.0)
    for reading in ("vibration", "total")
]
NAMED = [f"{chain.slew.reading}, {chain.sampling.antialias_corner:g} rad/s" for chain in CHAINS]


def by_exponentials(arm, law, chain, duration, count):
    """The residual of gains at the hub: plant and filter under a hold by one matrix exponential, stepped in NumPy."""
    T, corner = chain.sampling.period, chain.sampling.antialias_corner
    A, B, C, D = modal_model(arm, ["hub_angle", "hub_rate", "root_moment"], count).matrices()
    n, more = len(A), 0 if np.isinf(corner) else 2  # filtered: rate and moment
    whole = np.zeros((n + more + 1,) * 2)
    whole[:n, :n], whole[:n, -1] = A, B[:, 0]
    for row in range(more):
        whole[n + row, :n], whole[n + row, -1], whole[n + row, n + row] = (
            corner * C[row + 1],
            corner * D[row + 1, 0],
            -corner,
        )
    step = expm(whole * T)
    t = T * np.arange(round(duration / T) + 1)
    peak = 4 * 1.15 * arm.reach / (arm.reach * chain.slew.rise_time**2)
    rate = peak * np.clip(np.minimum(t, chain.slew.rise_time - t), 0, None)
    acceleration = np.append(np.diff(rate), 0.0) / T
    angle = np.r_[0.0, np.cumsum((rate[1:] + rate[:-1]) / 2) * T]
    rigid = -(arm.total_inertia - arm.hub.inertia) * np.r_[0.0, acceleration[:-1]]
    z, moments = np.zeros(n + more + 1), []
    for k in range(t.size):
        theta, speed, moment = C @ z[:n] + D[:, 0] * z[-1]
        moments.append(moment)
        if more:
            speed, moment = z[n : n + 2]
        x = moment - rigid[k] * (chain.slew.reading == "vibration")
        u = law.Kp * (angle[k] - theta) + law.K1 * (rate[k] - speed) - law.K2 * x
        z[-1] = arm.total_inertia * acceleration[k] + u
        z = step @ z
    left = (np.array(moments) - rigid)[t >= chain.slew.rise_time * (1 - 1e-12)]
    return np.sqrt(np.mean(left**2))


@pytest.mark.parametrize("chain", CHAINS, ids=NAMED)
def test_a_simulation_finds_the_arms_own_moment_less_the_rigid_arms(chain):
    law = HubFeedback(K1=0.5, K2=0.15, Kp=2.0)
    found = to_dict(simulated_run(LAB, law, chain, "slew", 1.4, count=6))["residual_moment_rms"]
    assert found == pytest.approx(by_exponentials(LAB, law, chain, 1.4, 6), rel=1e-8)


@pytest.mark.parametrize("chain", CHAINS, ids=NAMED)
def test_a_design_promises_what_a_simulation_finds(chain, monkeypatch):
    """To the last bit; what was minimised, of eight modes, is the same but for the modes left out."""
    monkeypatch.setattr(search, "MOST_RUNS", 1)
    found = design(LAB, "residual", chain=chain, K1=(0.1, 3.0), K2=(-0.5, 0.5))
    assert (
        found.value == to_dict(simulated_run(LAB, found.law, chain, "slew", found.slew_duration))["residual_moment_rms"]
    )
    assert judge_of(LAB, found.law, "residual", chain).score(found.law) == pytest.approx(found.value, rel=1e-4)


@pytest.mark.parametrize("chain", CHAINS[-1:], ids=NAMED[-1:])
def test_so_does_a_design_of_a_law(chain):
    found = tfarm.design(LAB, "residual", structure="PD", chain=chain)
    assert (
        found.value == to_dict(simulated_run(LAB, found.law, chain, "slew", found.slew_duration))["residual_moment_rms"]
    )
    assert judge_of(LAB, found.law, "residual", chain).score(found.law) == pytest.approx(found.value, rel=1e-4)


@pytest.mark.parametrize("chain", CHAINS, ids=NAMED)
def test_the_tuner_reports_what_a_simulation_finds(chain):
    """Tuned, with a constant gain and without moment feedback, of as many modes."""
    plan = tuner.Plan(K1=0.5, Kp=2.0, signals=chain.slew.reading, trials=3, duration=1.5)
    tuning = tuner.tune(LAB, plan, chain)
    found = to_dict(tuner.TuningResult(tuning))
    again = to_dict(controlled_run(LAB, tuning.saved(), chain, "slew", 1.5, count=6, between=0))
    for key in ("residual_moment_rms", "residual_raw_moment_rms"):
        assert again[key] == pytest.approx(found[key], rel=1e-9)
    for gain, residual in ((0.0, found["residual_without"]), (0.2, None)):
        record = tuning.trial.with_constant(gain)
        law = HubFeedback(K1=0.5, K2=gain, Kp=2.0)
        simulated = to_dict(simulated_run(LAB, law, chain, "slew", 1.5, count=6))["residual_moment_rms"]
        assert tuner.residual_rms(record, tuning.trial.task) == pytest.approx(simulated, rel=1e-9)
        assert residual is None or residual == pytest.approx(simulated, rel=1e-9)


def test_the_optimal_trial_has_the_moment_of_its_own_torque():
    """The bound's record: its torque into the open plant by a simulation without any gain."""
    chain = CHAINS[-1]
    trial = tuner.slew_trial(LAB, chain, signals="total", duration=1.2)
    bound = tuner.lq_bound(trial)
    task = replace(trial.task, feedforward=bound.e)
    moved = trial.simulator(task=task).linear(HubFeedback())
    np.testing.assert_allclose(bound.moment, moved.at_samples.root_moment, atol=1e-9 * abs(bound.moment).max())


def test_the_total_reading_changes_the_feedback_and_not_the_residual(capsys):
    """Clipped moment and torque, 2.3 samples of delay: 1.15797 N m was the moment itself."""
    command = ("simulate", "sasaki2012-lab", "--dsp", str(DATA / "q2.toml"), "--K1", ".6", "--K2", ".2", "--Kp", "3",
               "--duration", "2", "--json")  # fmt: skip
    _, out, _ = run(capsys, *command)
    answer = json.loads(out)
    t, moment = np.array(answer["t"]), np.array(answer["root_moment"])
    after = t >= 0.7 - 1e-9
    assert answer["residual_raw_moment_rms"] == pytest.approx(np.sqrt(np.mean(moment[after] ** 2)), rel=1e-12)
    assert answer["residual_raw_moment_rms"] == pytest.approx(1.15797, abs=5e-6)
    rigid = np.zeros(t.size)
    rigid[np.flatnonzero(after)[0]] = (LAB.total_inertia - LAB.hub.inertia) * 4 * 1.15 / 0.7**2  # still braking
    assert answer["residual_moment_rms"] == pytest.approx(np.sqrt(np.mean((moment - rigid)[after] ** 2)), rel=1e-9)
    assert answer["residual_moment_rms"] == pytest.approx(1.1923, abs=5e-5)


def test_what_was_not_computed_is_null_and_is_no_number_in_words(capsys):
    stopped = ("simulate", str(DATA / "r2.toml"), "--dsp", str(DATA / "q1.toml"), "--K1", "13.81572", "--K2", ".1",
               "--Kp", "27.1322", "--duration", "2")  # fmt: skip
    _, out, err = run(capsys, *stopped)
    assert "residual root moment, as the run stops at 0.528 s" in out
    assert "unstable: stopped at 0.528 s" in err
    answer = json.loads(run(capsys, *stopped, "--json")[1])
    assert answer["residual_moment_rms"] is answer["residual_raw_moment_rms"] is None
    short = run(capsys, "simulate", "sasaki2012-lab", "--duration", "0.9")[1]
    assert "residual root moment, as the record ends before the slew" in short


def test_a_loop_that_runs_away_later_leaves_no_number_either():
    """Stopped after the slew: the record that the residual is of does not exist."""
    law = HubFeedback(K1=0.3, K2=1.2)
    answer = to_dict(simulated_run(LAB, law, Chain(), "slew", 60.0, count=6))
    assert answer["stopped_at_s"] > 1.0
    assert answer["residual_moment_rms"] is None
