"""Studies: resumable, in order, and their verdicts."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.columns import TERMINAL
from tfarm.dsp import Chain, Sampling
from tfarm.errors import ParameterError
from tfarm.tuner import Cost, Plan, studies, tune
from tfarm.tuner.guard import find_guard
from tfarm.tuner.overview import CostMap
from tfarm.tuner.studies import PAPER_PAIR, Finished, map_verdict, plans_of, run_study, study_answer


@pytest.fixture(scope="module")
def lab():
    return tfarm.load("sasaki2012-lab")


BASE = Plan(trials=6, guard="frozen")


def test_a_study_is_its_tunings(lab):
    plans = plans_of("curves", BASE, 3)
    results = run_study(lab, plans)
    for plan, result in zip(plans, results, strict=True):
        training = tune(lab, plan).training
        assert result.costs == training.costs.tolist()
        assert result.cost == training.result.cost
    curve = study_answer("curves", results, 3)
    assert curve["median"][0] == sorted(each.costs[0] for each in results)[1]


def test_learning_curves_have_their_median_and_quartiles(lab):
    """Of five seeds the second, third and fourth; a run that ended early counts as inf from there on."""
    (one,) = run_study(lab, plans_of("curves", replace(BASE, trials=1, guard="none"), 1))
    five = [replace(one, costs=[cost, cost + 10.0]) for cost in (5.0, 1.0, 4.0, 2.0)]
    curve = study_answer("curves", [*five, replace(one, costs=[3.0])], 5)
    assert [curve[key] for key in ("lower_quartile", "median", "upper_quartile")] == [[2, 12], [3, 14], [4, 15]]


def test_a_group_is_summed_up_over_its_seeds():
    """Five made-up runs of each of two plans; of the second one has run away."""
    costs, gains, residuals = [5.0, 1.0, 3.0, 4.0, 2.0], [0.1, 0.2, 0.5, 0.4, 0.3], [9.0, 7.0, 8.0, 6.0, 5.0]
    first = [
        Finished(BASE, [cost], cost, residual, gain, False, gain < 0.25, 0.7, 3.5)
        for cost, gain, residual in zip(costs, gains, residuals, strict=True)
    ]
    second = [replace(each, plan=replace(BASE, cost=Cost(a=4.0)), cost=each.cost + 2.0) for each in first]
    second[3] = replace(second[3], cost=np.inf, stopped=True)
    one, two = study_answer("weights", first + second, 5)["groups"]
    assert [one[key] for key in ("cost_median", "cost_quartiles", "cost_best", "cost_worst")] == [3.0, [2.0, 4.0], 1, 5]
    assert [two[key] for key in ("cost_median", "cost_quartiles", "cost_best", "cost_worst")] == [5, [4, 7], 3, np.inf]
    assert [one[key] for key in ("below_best_constant", "diverged", "died")] == [3, 0, 2]
    assert [two[key] for key in ("below_best_constant", "diverged", "died")] == [1, 1, 2]
    assert (one["mean_gain_median"], one["residual_median"], one["a"], two["a"]) == (0.3, 7.0, 1.0, 4.0)
    assert (one["best_constant_gain"], one["best_constant_cost"]) == (0.7, 3.5)
    shown = {column.title: column.cells for column in study_answer("weights", first + second, 5)["groups"].on(TERMINAL)}
    assert shown["below best constant"] == ["3 of 5", "1 of 5"]
    assert {"a"} == {"a", "b", "alpha", "eta", "rule", "mode", "inputs", "sensitivity"} & set(shown)  # what differs


def test_a_study_on_the_ground_of_a_tuning_is_the_same_and_finds_no_guard_again(lab, monkeypatch):
    plans = [*plans_of("curves", BASE, 2), *plans_of("curves", replace(BASE, guard="none"), 1)]
    alone, tuned, asked = run_study(lab, plans), tune(lab, BASE), []
    monkeypatch.setattr(studies, "best_constant", lambda trial: pytest.fail("the tuning has it"))
    monkeypatch.setattr(studies, "find_guard", lambda *given: [asked.append(given[1]), find_guard(*given)][1])
    assert run_study(lab, plans, tuned=tuned) == alone
    assert asked == ["none"]


def test_what_was_kept_of_one_chain_or_arm_is_not_taken_for_another(lab, tmp_path):
    keep, plans = tmp_path / "study.jsonl", plans_of("curves", BASE, 1)
    slow, heavy = Chain(sampling=Sampling(period=0.02)), replace(lab, payload=replace(lab.payload, mass=0.3))
    asked = [(lab, None), (lab, slow), (heavy, None), (lab, Chain())]
    results = [run_study(arm, plans, chain, keep=keep)[0] for arm, chain in asked]
    assert len(keep.read_text().splitlines()) == 3  # no chain is the standard one
    assert results[3] == results[0]
    assert results[1] == run_study(lab, plans, slow)[0] != results[0] != results[2]


def test_a_stopped_study_goes_on(lab, tmp_path):
    keep, seen = tmp_path / "study.jsonl", []
    plans = plans_of("rules", BASE, 2)
    first = run_study(lab, plans[:5], keep=keep)
    with open(keep, "a") as file:
        file.write('{"key": "cut sh')
    results = run_study(lab, plans, keep=keep, tell=lambda done, total: seen.append((done, total)))
    assert results[:5] == first
    assert seen == [(done, 12) for done in range(6, 13)]
    kept = keep.read_text().splitlines()
    assert len(kept) == 12
    assert not any("cut sh" in line for line in kept)
    assert run_study(lab, plans, keep=keep, tell=lambda *_: pytest.fail("nothing was left to do")) == results


def test_a_file_that_is_no_study_is_refused(lab, tmp_path):
    keep = tmp_path / "notes.txt"
    for text in ("first\nsecond\n", "first", '{"key": "x"}\n'):
        keep.write_text(text)
        with pytest.raises(ParameterError, match="line 1 is no result"):
            run_study(lab, plans_of("curves", BASE, 1), keep=keep)
        assert keep.read_text() == text


def test_every_study_has_its_plans():
    sizes = {name: len(plans_of(name, BASE, 2)) for name in ("curves", "map", "weights", "inputs", "rules")}
    assert sizes == {"curves": 2, "map": 84, "weights": 14, "inputs": 4, "rules": 12}
    assert PAPER_PAIR in [(plan.learning.alpha, plan.learning.eta) for plan in plans_of("map", BASE, 1)]
    with pytest.raises(ParameterError, match="known are"):
        plans_of("colours", BASE, 1)


def test_the_verdict_on_the_best_momentum_and_rate(lab):
    results = run_study(lab, plans_of("curves", BASE, 3))
    other = replace(BASE, learning=replace(BASE.learning, alpha=0.1))

    def moved(by):
        return [replace(each, plan=replace(other, seed=each.plan.seed), cost=each.cost + by) for each in results]

    assert "the best of 2 points" in map_verdict([results, moved(0.1)])
    assert "rank 2 of 2; best (0.1, 0.8)" in map_verdict([results, moved(-0.5)])
    assert "beyond the paper's quartiles" in map_verdict([results, moved(-0.5)])


def test_the_verdict_is_by_medians_and_quartiles_of_the_seeds(lab):
    """Of five seeds the third, and the second and fourth, whatever the highest cost is."""
    (one,) = run_study(lab, plans_of("curves", replace(BASE, trials=1, guard="none"), 1))

    def group(alpha, *costs):
        plan = replace(BASE, learning=replace(BASE.learning, alpha=alpha))
        return [replace(one, plan=plan, cost=float(cost)) for cost in costs]

    paper, low, high = group(0.6, 5, 1, 3, 4, 90), group(0.1, 2, 2, 2.5, 80, 80), group(0.2, 0, 0, 9, 9, 9)
    start = f"(alpha_c, eta_c) = {PAPER_PAIR}: median cost 4 (quartiles 3, 5), rank 2 of 3; best (0.1, 0.8) with"
    assert map_verdict([high, paper, low]) == f"{start} 2.5, beyond the paper's quartiles"
    low = group(0.1, 3, 3, 3, 80, 80)
    assert map_verdict([high, paper, low]) == f"{start} 3, within the paper's quartiles"


def test_one_seed_is_a_study_too(lab):
    """Each point has then one cost, and its quartiles are that."""
    (one,) = run_study(lab, plans_of("curves", BASE, 1))
    other = replace(one, plan=replace(BASE, learning=replace(BASE.learning, alpha=0.1)), cost=one.cost + 1.0)
    assert "the best of 2 points" in map_verdict([[one], [other]])


@pytest.mark.parametrize(("lowest", "is_best", "at_edge"), [((0, 1), True, False), ((1, 1), False, True)])
def test_a_map_of_costs_knows_its_lowest_and_the_papers(lowest, is_best, at_edge):
    alphas, etas = np.array([PAPER_PAIR[0], 0.9]), np.array([0.1, PAPER_PAIR[1], 3.0])
    median = np.full((2, 3), 2.0)
    median[lowest] = 1.0
    found = CostMap(alphas, etas, median, "")
    assert (found.papers, found.best) == ((0, 1), lowest)
    assert (found.is_papers_best, found.best_at_edge) == (is_best, at_edge)
