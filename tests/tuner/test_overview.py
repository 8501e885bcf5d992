"""What the report asks of the tuner, on runs that are made up: curves over seeds, and the map of costs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tfarm.tuner import Plan, overview
from tfarm.tuner.overview import PAPER_PAIR, Curves
from tfarm.tuner.studies import ALPHAS, ETAS, Finished

FULL = overview.SIZES[0]
TUNING = SimpleNamespace(plan=Plan(trials=2, guard="none"))  # all that is asked of it where studies are made up


def made_up(plan, cost, *, costs=(), stopped=False, died=False):
    """A tuning of a study that ended with that cost."""
    return Finished(plan, list(costs) or [cost] * plan.trials, cost, 0.0, 0.3, stopped, died, 0.3, 9.0)


def test_the_map_has_the_median_of_its_seeds_at_every_pair(monkeypatch):
    """Costs that grow away from the paper's pair, and with the seeds' squares: the median is that of the third of 5."""
    asked = []

    def studied(_, plans):
        asked.extend(plans)
        return [made_up(plan, cost(plan.learning.alpha, plan.learning.eta) + plan.seed**2) for plan in plans]

    def cost(alpha, eta):
        return 1.0 + abs(alpha - PAPER_PAIR[0]) + abs(np.log(eta / PAPER_PAIR[1]))

    monkeypatch.setattr(overview, "_studied", studied)
    found, third = overview._cost_map(TUNING, FULL), TUNING.plan.seed + 2
    assert (tuple(found.alphas), tuple(found.etas)) == (ALPHAS, ETAS)
    wanted = [[cost(alpha, eta) + third**2 for eta in ETAS] for alpha in ALPHAS]
    np.testing.assert_allclose(found.median, wanted, rtol=1e-15)
    assert found.is_papers_best
    assert found.verdict.endswith(f"the best of {len(ALPHAS) * len(ETAS)} points")
    assert {plan.trials for plan in asked} == {FULL.map_trials}


def test_curves_over_seeds_say_their_quantiles_and_how_many_died_or_ran_away(monkeypatch):
    def studied(_, plans):
        assert {(plan.learning.rule, plan.guard) for plan in plans} == {("plain", "none")}
        return [
            made_up(plan, n + 0.5, costs=[n, 10.0 + n][: 2 - (n == 19)], stopped=n == 19, died=n < 3)
            for n, plan in enumerate(plans)
        ]

    monkeypatch.setattr(overview, "_studied", studied)
    found = overview._curves(TUNING, FULL, "plain", "(21) as printed", "plain", "none")
    np.testing.assert_array_equal(found.costs, [[n, 10.0 + n if n < 19 else np.inf] for n in range(20)])
    assert found.quantile(0.0).tolist() == [0.0, 10.0]
    assert found.quantile(1.0).tolist() == [19.0, np.inf]
    assert found.final.tolist() == [n + 0.5 for n in range(20)]
    assert (found.died, found.diverged) == (3, 1)
    few = replace(found, costs=np.array([[5.0], [1.0], [4.0], [2.0], [3.0]]))
    assert isinstance(few, Curves)
    assert [few.quantile(share).tolist() for share in (0.25, 0.5, 0.75)] == [[2.0], [3.0], [4.0]]


@pytest.mark.parametrize("size", overview.SIZES)
def test_trials_of_a_study_are_those_of_its_plans(size, monkeypatch):
    """Counted as they are asked for, by the functions that run them; the paper's pair is in every map."""
    asked = []

    def studied(_, plans):
        asked.extend(plans)
        return [made_up(plan, 1.0) for plan in plans]

    monkeypatch.setattr(overview, "_studied", studied)
    tuning = SimpleNamespace(plan=Plan())
    found = overview._cost_map(tuning, size)
    for each in overview.LEARNT:
        overview._curves(tuning, size, *each)
    assert sum(plan.trials for plan in asked) == size.trials
    assert (found.alphas[found.papers[0]], found.etas[found.papers[1]]) == PAPER_PAIR


def test_no_study_has_more_samples_than_a_page_can_spend():
    """The full one for the usual 301 samples of a trial and for 3,001; none for a million; ever less in between."""
    assert overview.study_size(301) == overview.study_size(3001) == FULL
    sizes = [overview.study_size(int(n)) for n in np.geomspace(100, 1e6, 200)]
    spent = [size.trials * int(n) for size, n in zip(sizes, np.geomspace(100, 1e6, 200), strict=True) if size]
    assert max(spent) <= overview.MOST_SAMPLES
    order = [len(overview.SIZES) if size is None else overview.SIZES.index(size) for size in sizes]
    assert order == sorted(order)
    assert set(order) == {0, 1, 2, 3}
