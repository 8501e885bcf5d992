"""What the report asks of the tuner, on runs that are made up: curves over seeds, and the map of costs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from tfarm.tuner import Plan, overview
from tfarm.tuner.overview import PAPER_PAIR, Curves
from tfarm.tuner.studies import ALPHAS, ETAS, Finished

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
    found, third = overview._cost_map(TUNING), TUNING.plan.seed + 2
    assert (tuple(found.alphas), tuple(found.etas)) == (ALPHAS, ETAS)
    wanted = [[cost(alpha, eta) + third**2 for eta in ETAS] for alpha in ALPHAS]
    np.testing.assert_allclose(found.median, wanted, rtol=1e-15)
    assert found.is_papers_best
    assert found.verdict.endswith(f"the best of {len(ALPHAS) * len(ETAS)} points")
    assert {plan.trials for plan in asked} == {overview.MAP_TRIALS}


def test_curves_over_seeds_say_their_quantiles_and_how_many_died_or_ran_away(monkeypatch):
    def studied(_, plans):
        assert {(plan.learning.rule, plan.guard) for plan in plans} == {("plain", "none")}
        return [
            made_up(plan, n + 0.5, costs=[n, 10.0 + n][: 2 - (n == 19)], stopped=n == 19, died=n < 3)
            for n, plan in enumerate(plans)
        ]

    monkeypatch.setattr(overview, "_studied", studied)
    found = overview._curves(TUNING, "plain", "(21) as printed", "plain", "none")
    np.testing.assert_array_equal(found.costs, [[n, 10.0 + n if n < 19 else np.inf] for n in range(20)])
    assert found.quantile(0.0).tolist() == [0.0, 10.0]
    assert found.quantile(1.0).tolist() == [19.0, np.inf]
    assert found.final.tolist() == [n + 0.5 for n in range(20)]
    assert (found.died, found.diverged) == (3, 1)
    few = replace(found, costs=np.array([[5.0], [1.0], [4.0], [2.0], [3.0]]))
    assert isinstance(few, Curves)
    assert [few.quantile(share).tolist() for share in (0.25, 0.5, 0.75)] == [[2.0], [3.0], [4.0]]
