"""Crossings along one gain, and its stability intervals, against poles found in another way, bisection and theorems."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.agreement import some_free_arm, some_gains
from tests.loop.arms import window_arm
from tests.loop.ritz_loop import RitzLoop
from tfarm import Hub, HubFeedback, ParameterError, Payload
from tfarm.case import Case
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.lines import line_crossings
from tfarm.loop.margins import margins
from tfarm.loop.poles import poles_below
from tfarm.loop.stability import stability
from tfarm.loop.windows import windows_of
from tfarm.spectrum.table import default_gains, most_gain

LAB, BARE, STOCKY = (tfarm.load(name) for name in ("sasaki2012-lab", "sasaki2012", "stocky-steel"))


def windows(arm, law, name):
    return windows_of(stability(Case(arm, law)), [name])[name]


def edge_by_bisection(model, law, name, inside, outside):
    """The value of a gain where the rightmost eigenvalue of the model changes sign."""
    for _ in range(28):
        middle = (inside + outside) / 2
        if model.rightmost(replace(law, **{name: middle})) < 0:
            inside = middle
        else:
            outside = middle
    return inside


PIN = replace(LAB, hub=Hub(inertia=0.0))
AROUND = [  # by theorems: without damping K2 reaches from minus infinity to 1, and a passive hub has no upper end
    *((arm, HubFeedback(K1=K1, K2=0.3), "K2", (-math.inf, 1.0)) for arm in (BARE, STOCKY) for K1 in (1e-6, 0.3, 100.0)),
    *((arm, HubFeedback(K1=0.3, K2=-4.0), "K1", (0.0, math.inf)) for arm in (BARE, STOCKY)),
    *((LAB, HubFeedback(K1=0.3), name, (0.0, math.inf)) for name in ("K1", "Kp")),
    (LAB, HubFeedback(K1=0.3, K2=1.2), "K2", None),  # unstable
    (PIN, HubFeedback(K1=0.3), "K2", None),  # has no K2 to choose
    (PIN, HubFeedback(K1=0.3), "K1", (0.0, math.inf)),
]


@pytest.mark.parametrize(("arm", "law", "name", "around"), AROUND)
def test_intervals_known_by_a_theorem_are_exact(arm, law, name, around) -> None:
    found = windows(arm, law, name)
    assert found.around == around
    if arm is not LAB:
        assert found.all == (() if around is None else (around,))


def test_the_window_of_the_counterexample_and_those_beyond_it() -> None:
    law = HubFeedback(K1=1.0, K2=-5.0)
    found = windows(window_arm(), law, "K2")
    low, high = found.all[-2][1], found.around[0]
    assert (round(low, 2), round(high, 2)) == (-11.47, -8.48)
    model = RitzLoop(window_arm(), 18)
    assert high == pytest.approx(edge_by_bisection(model, law, "K2", -5.0, -10.0), rel=1e-7)
    assert low == pytest.approx(edge_by_bisection(model, law, "K2", -12.0, -10.0), rel=1e-7)
    assert found.around[1] == pytest.approx(edge_by_bisection(model, law, "K2", 0.5, 1.2), rel=1e-7)
    there = windows(window_arm(), replace(law, K2=-10.0), "K2")
    assert there.around is None
    np.testing.assert_allclose(np.ravel(there.all)[1:], np.ravel(found.all)[1:], rtol=1e-11)


@pytest.mark.parametrize("seed", range(4))
def test_random_stability_intervals_agree_with_the_model(seed) -> None:
    rng = np.random.default_rng(100 + seed)
    arm = some_free_arm(rng, damped=True)
    K1, K2, Kp = some_gains(rng, arm, 3)
    law, model = HubFeedback(K1=float(K1[1]), K2=float(K2[1]), Kp=Kp), RitzLoop(arm, 18)
    verdict = stability(Case(arm, law))
    for name in ("K1", "K2", "Kp"):
        found = windows_of(verdict, [name])[name]
        edges = sorted({*found.looked_at, *(each.t for each in found.crossings)})
        for low, high in itertools.pairwise(edges):
            middle = (low + high) / 2
            if high - low < 1e-6 * max(abs(low), abs(high)):
                continue
            rightmost = model.rightmost(replace(law, **{name: middle}))
            assert any(a < middle < b for a, b in found.all) == (rightmost < 0)


def test_gains_near_the_largest_allowed_are_looked_at_too() -> None:
    most = most_gain(LAB, "K1")
    found = windows(LAB, HubFeedback(K1=0.9 * most), "K1")
    assert found.looked_at == (-most, most)
    heavy = replace(LAB, hub=Hub(inertia=1e7), payload=Payload(mass=1e5))
    assert windows(heavy, HubFeedback(K1=0.3, K2=0.2), "Kp").around[0] == 0


def test_an_end_of_the_search_is_no_edge() -> None:
    """An edge has poles on the axis there, a search bound none as far as poles can be found, infinity is a theorem."""
    found = windows(LAB, HubFeedback(K1=0.3, K2=0.3), "K2")
    assert [found.end(value) for value in found.around] == ["search bound", "edge"]
    for value in found.around:
        poles = poles_below(ContinuousLoop(Case(LAB, HubFeedback(K1=0.3, K2=value))), 2e3).moving
        assert (abs(poles.real / abs(poles)).min() < 1e-12) == (found.end(value) == "edge")
    assert [windows(BARE, HubFeedback(K1=0.3), "K1").end(value) for value in (0.0, math.inf)] == ["edge", "no limit"]


@pytest.mark.parametrize("C", [0.0, 1e-4])
def test_of_a_heavy_hub_k2_is_looked_at_beyond_where_it_cancels_the_inertia(C) -> None:
    """A hub of 100 times the beam: from K2 = J/(J - I_h) = 101 on K1 > 0 turns a negative inertia."""
    carried = LAB.total_inertia - LAB.hub.inertia
    arm = replace(LAB, hub=Hub(inertia=100 * carried), link=replace(LAB.link, damping=C))
    found = windows(arm, HubFeedback(K1=1e-3, K2=0.3), "K2")
    assert (found.looked_at[1] > 101 >= found.around[1], found.end(found.around[1])) == (True, "edge")
    assert stability(Case(arm, HubFeedback(K1=1e-3, K2=101.5))).unstable_roots > 0


def test_behind_an_inductance_the_lowest_K2_is_that_of_its_band():
    """Elastic links: each higher mode is driven by less; the answer names the band, which a higher one undercuts."""
    arm = tfarm.load("quanser-flexlink")
    law = default_gains(arm)
    found = margins(arm, law)
    assert "poles may cross inside them" in found.intervals_note
    band = found.windows["K2"].band
    assert math.isfinite(band)
    low = found.windows["K2"].around[0]
    higher = line_crossings(ContinuousLoop(Case(arm, law)), "K2", 2 * low, 0.0, 4 * band).gain
    assert 0.5 * low < higher[higher < 0].max() < 0


@pytest.mark.parametrize(("name", "reach"), [("sasaki2012", math.inf), ("sasaki2012-lab", None)])
def test_exact_intervals_have_no_note(name, reach):
    arm = tfarm.load(name)
    found = margins(arm, default_gains(arm))
    assert found.intervals_note is None
    assert reach in (None, found.windows["K2"].band)


@pytest.mark.parametrize(
    ("inertia", "law", "words"),
    [(math.inf, HubFeedback(K1=0.3), "has no loop"), (0.0, HubFeedback(K1=0.3, K2=0.1), "an algebraic loop")],
)
def test_where_there_is_no_loop(inertia: float, law, words: str) -> None:
    with pytest.raises(ParameterError, match=words) as refused:
        ContinuousLoop(Case(replace(BARE, hub=Hub(inertia=inertia)), law))
    assert "\n" not in str(refused.value)
