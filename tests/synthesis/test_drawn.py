"""One law for drawn arms: no arm of the pool is worse, and the share of fresh ones is that of their study."""

import csv

import numpy as np
import pytest
from scipy import stats

import tfarm
from tests.shared import refusal
from tests.shell import answer, refused
from tests.synthesis.held_loop import HeldLoop
from tfarm.dsp import Chain
from tfarm.fitting.posterior import Posterior, PosteriorNumber
from tfarm.synthesis.drawn import drawn_arms, verify
from tfarm.synthesis.required import RequirementTask
from tfarm.synthesis.requirements import GOOD, Requirement
from tfarm.synthesis.structures import structure_of
from tfarm.synthesis.worst_case import arms_of, for_the_worst

LAB = tfarm.load("sasaki2012-lab")
OVER = {"payload.mass": {"uniform": [0.0, 0.1]}, "hub.inertia": {"normal": [0.1, 0.005]}}


def nothing(_):
    """No progress."""


def task(requirements=GOOD, minimised="time_constant_s"):
    form = structure_of("K1-K2", LAB, Kp=0.0, modes=2, period=0.01, bounds={}, is_angle_free=True)
    return RequirementTask(LAB, requirements, minimised, form, 2, Chain(), nothing)


def studied(folder, arms, law):
    """The cards of arms under a law, by a study of the list of their numbers."""
    with (folder / "rows.csv").open("w", newline="") as file:
        csv.writer(file).writerows([tuple(arms[0].numbers), *(each.numbers.values() for each in arms)])
    return tfarm.study(LAB, law=law, rows=folder / "rows.csv", ask=["card"], workers=1, out=folder / "out").table()


def is_good(card, loop):
    """Whether each arm of a study has the grade good in a loop; delay margins of both are in periods of 10 ms."""
    gain = np.minimum(card[f"{loop}.gain_margin_db"], np.nan_to_num(card[f"{loop}.gain_reduction_db"], nan=np.inf))
    delay = card[f"{loop}.delay_margin_ms"] / 10.0
    good = (gain >= 6.0) & (card[f"{loop}.phase_margin_deg"] >= 45.0) & (card[f"{loop}.peak_sensitivity"] <= 2.0)
    return good & (delay >= 1.0)


@pytest.fixture(scope="module")
def found():
    """The law for a pool of 37 arms, on the worst of which the penalty of a search has to outweigh a jump of speed."""
    drawn = drawn_arms(LAB, OVER, pool=37, fresh=12)
    search = task()
    law, named, case = for_the_worst(arms_of(LAB, (), None), drawn, search.find, search.violation_on, nothing)
    return search, drawn, law, named, case


def test_a_law_found_on_few_arms_is_good_on_the_pool(found, tmp_path):
    _, drawn, choice, named, case = found
    assert choice.violation <= 0
    assert 1 < len(named) < 6
    assert case.sentence(len(named)).endswith("37 arms of payload.mass, hub.inertia found none that is worse")
    card = studied(tmp_path, drawn.pool, choice.law)
    assert is_good(card, "sampled").all()
    assert is_good(card, "continuous").all()
    for each in named:
        assert HeldLoop(each.arm, 0.01).radius(choice.law) < 1.0


def test_the_share_of_fresh_arms_is_that_of_their_study(found, tmp_path):
    """Limits that some of the fresh arms miss; the least margins are those of the columns."""
    search, drawn, choice, _, _ = found
    card = studied(tmp_path, drawn.fresh, choice.law)
    limit = float(np.median(card["continuous.phase_margin_deg"])) + 1e-6
    strict = task((Requirement("phase_margin_deg", ">=", limit), Requirement("peak_sensitivity", "<=", 2.0)))
    fewer = verify(strict, choice._replace(goal=strict.goal), drawn, nothing)
    least = np.minimum(card["continuous.phase_margin_deg"], card["sampled.phase_margin_deg"])
    assert (fewer.arms, fewer.met) == (12, int(np.sum(least >= limit)))
    assert 0 < fewer.met < 12
    k, n = fewer.met, 12
    assert fewer.at_least == pytest.approx(stats.beta.ppf(0.05, k, n - k + 1), rel=1e-9)
    assert fewer.finding.startswith(f"requirements met on {k} of 12 arms: at least ")
    worst = int(np.argmin(least))
    phase, peak = fewer.margins
    assert (phase.arm, phase.numbers) == (drawn.fresh[worst].name, drawn.fresh[worst].numbers)
    assert phase.margin == pytest.approx(least[worst] / limit - 1, abs=1e-7)
    assert phase.continuous == pytest.approx(card["continuous.phase_margin_deg"][worst], rel=1e-7)
    largest = np.maximum(card["continuous.peak_sensitivity"], card["sampled.peak_sensitivity"]).max()
    assert peak.margin == pytest.approx(1 - largest / 2.0, abs=1e-7)
    assert verify(search, choice, drawn, nothing).met == int(
        np.sum(is_good(card, "sampled") & is_good(card, "continuous"))
    )


def test_an_unstable_loop_has_no_margin_and_is_the_worst(found):
    search, drawn, choice, _, _ = found
    unstable = choice._replace(law=tfarm.HubFeedback(K1=0.3, K2=3.0))
    shown = verify(search, unstable, drawn, nothing)
    assert (shown.met, shown.at_least) == (0, 0.0)
    assert {each.margin for each in shown.margins} == {None}
    for rows in (choice.checked, ()):
        assert search.violation_on(unstable._replace(checked=rows), LAB) == np.inf


def test_pool_and_fresh_arms_are_rows_of_the_study(tmp_path):
    drawn = drawn_arms(LAB, OVER, pool=5, fresh=3)
    rows = tfarm.study(LAB, OVER, ["modes.natural_frequency_rad_s.1"], draws=8, workers=1, out=tmp_path / "s").table()
    for n, each in enumerate((*drawn.pool, *drawn.fresh)):
        assert each.name == f"sasaki2012-lab, row {n}"
        assert each.numbers == {key: rows[key][n] for key in OVER}
        assert (each.arm.payload.mass, each.arm.hub.inertia) == tuple(each.numbers.values())
    assert drawn.is_independent


def test_of_a_grid_every_second_row_is_fresh_without_confidence(found):
    search, _, choice, _, _ = found
    drawn = drawn_arms(LAB, {"payload.mass": {"values": [0.0, 0.01, 0.02, 0.03, 0.04]}})
    assert [each.numbers["payload.mass"] for each in drawn.pool] == [0.0, 0.02, 0.04]
    assert [each.numbers["payload.mass"] for each in drawn.fresh] == [0.01, 0.03]
    shown = verify(search, choice, drawn, nothing)
    assert shown.at_least is None
    assert (
        shown.finding == f"requirements met on {shown.met} of 2 arms; no confidence, as they are no independent draws"
    )


def test_arms_of_the_file_of_a_study_with_its_posterior(tmp_path):
    """The mass has a normal distribution about its best value; the study gives the inertia a range of its own."""
    posterior = Posterior(
        format="tfarm posterior 1",
        arm="lab",
        numbers=[PosteriorNumber(key="payload.mass", value=0.05, low=None, high=None, size=0.01)],
        covariance=[[1.0]],
        not_determined=[],
    )
    (tmp_path / "fit.posterior.json").write_text(posterior.model_dump_json())
    lines = ('arm = "sasaki2012-lab"', 'posterior = "fit.posterior.json"', "seed = 3", "[over]")
    (tmp_path / "study.toml").write_text("\n".join((*lines, '"hub.inertia" = {uniform = [0.1, 0.11]}')))
    drawn = drawn_arms(LAB, tmp_path / "study.toml", fresh=40, pool=200)
    masses = [each.arm.payload.mass for each in drawn.pool]
    assert stats.kstest(np.array(masses), stats.norm(0.05, 0.01).cdf).pvalue > 1e-3
    assert all(0.1 < each.arm.hub.inertia < 0.11 for each in (*drawn.pool, *drawn.fresh))
    alone = drawn_arms(LAB, None, tmp_path / "fit.posterior.json", fresh=2, pool=2)
    assert (alone.source, list(alone.pool[0].numbers)) == ("fit.posterior.json", ["payload.mass"])
    error = refusal(drawn_arms, LAB, tmp_path / "study.toml", tmp_path / "fit.posterior.json")
    assert "the study has a posterior itself" in str(error)
    assert "is a study of sasaki2012-lab" in str(refusal(drawn_arms, tfarm.load("sasaki2012"), tmp_path / "study.toml"))


@pytest.mark.parametrize(
    ("over", "fresh", "words"),
    [
        ({"law.K2": {"uniform": [0.0, 1.0]}}, 64, "numbers of the arm alone"),
        ({"sampling.delay_samples": {"uniform": [0.0, 1.0]}}, 64, "numbers of the arm alone"),
        ({"payload.mas": {"uniform": [0.0, 1.0]}}, 64, 'did you mean "payload.mass"'),
        ({"payload.mass": {"normal": [0.0, 0.1]}}, 64, "arms are illegal, the first in row"),
        ({"payload.mass": {"values": [0.1]}}, 64, "at least two arms"),
        (OVER, 0, "a whole number from 1"),
        ({}, 64, "nothing is varied"),
    ],
)
def test_what_no_law_is_designed_for_is_refused_in_one_line(over, fresh, words):
    assert words in str(refusal(drawn_arms, LAB, over, fresh=fresh))


@pytest.mark.survey
def test_the_command_has_the_share_of_the_arms_of_a_study(capsys, tmp_path):
    (tmp_path / "study.toml").write_text('arm = "sasaki2012-lab"\n[over]\n"payload.mass" = {uniform = [0.0, 0.05]}\n')
    shown = answer(capsys, "design", "sasaki2012-lab", "--study", str(tmp_path / "study.toml"), "--fresh", "3")
    fresh = shown["verification"]
    assert (fresh["source"], fresh["arms"]) == ("study.toml", 3)
    drawn = drawn_arms(LAB, tmp_path / "study.toml", fresh=3)
    law = tfarm.HubFeedback(**{row["name"]: row["value"] for row in shown["coefficients"]})
    card = studied(tmp_path, drawn.fresh, law)
    assert fresh["met"] == np.sum(is_good(card, "sampled") & is_good(card, "continuous"))
    assert [row["requirement"] for row in fresh["margins"]] == ["GM>=6", "PM>=45", "delay>=1", "Ms<=2"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--objective", "margin"], "requirements hold on arms of a study or posterior"),
        (["--range", "payload.mass=0.1,0.2"], "has its own ranges"),
        (["--trade-off"], "the front is of given arms"),
        (["--fresh", "0"], "a whole number from 1"),
    ],
)
def test_options_that_exclude_an_ensemble_are_refused(capsys, tmp_path, options, words):
    (tmp_path / "study.toml").write_text('arm = "sasaki2012-lab"\n[over]\n"payload.mass" = {uniform = [0.0, 0.05]}\n')
    assert words in refused(capsys, "design", "sasaki2012-lab", "--study", str(tmp_path / "study.toml"), *options)
