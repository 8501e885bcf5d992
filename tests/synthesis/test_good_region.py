"""Gains of the grade good: the region of models on a grid against the result cards of the exact loops."""

from functools import cache

import numpy as np
import pytest

import tfarm
from tfarm.arm import HubFeedback
from tfarm.dsp import Chain
from tfarm.loop.plane import moment_axis
from tfarm.loop.plane_axes import rate_axis
from tfarm.synthesis.design import recommended_gains
from tfarm.synthesis.goals import Goal, check
from tfarm.synthesis.good_region import good_region
from tfarm.synthesis.requirements import GOOD
from tfarm.synthesis.worst_case import NamedArm

CHAIN = Chain()


@cache
def region_of(name):
    arm = tfarm.load(name)
    x = rate_axis(arm)
    return arm, good_region(arm, x, moment_axis(arm, x), CHAIN, GOOD)


def grades(arm, found, place):
    """The grades of both exact loops at a place of the grid, and the time constant of the sampled one."""
    row, column = place
    card = tfarm.result_card(arm, HubFeedback(K1=float(found.x[column]), K2=float(found.y[row])), CHAIN)
    return {card.sampled.grade, card.continuous.grade}, card.sampled.time_constant


@pytest.mark.parametrize("name", ["sasaki2012-lab", "sasaki2012"])
def test_the_exact_loops_are_good_inside_and_not_outside(name):
    """At places a twentieth of a limit off the border, which is approximate."""
    arm, found = region_of(name)
    rng = np.random.default_rng(1)
    for is_good, where in ((True, found.excess < -0.05), (False, found.excess > 0.05)):
        places = np.argwhere(where)
        assert places.size
        for place in rng.permutation(places)[:5]:
            assert (grades(arm, found, place)[0] == {"good"}) is is_good


@pytest.mark.parametrize("name", ["sasaki2012-lab", "quanser-flexlink"])
def test_the_border_is_that_of_the_exact_cards_within_a_hundredth_of_a_limit(name):
    """Next to ends of the intervals, on both sides; on the second arm some ends are exact edges of stability."""
    arm, found = region_of(name)
    goal = Goal(GOOD, "time_constant_s")
    ends = [
        (K1, end, side * (high - low))
        for K1, intervals in zip(found.x, found.stable_intervals, strict=True)
        for low, high in intervals
        for end, side in ((low, 1.0), (high, -1.0))
    ]
    for K1, end, inwards in np.random.default_rng(3).permutation(ends)[:8]:
        excess = []
        for share in (0.01, -0.01):
            law = HubFeedback(K1=float(K1), K2=float(end + share * inwards))
            excess.append(check(goal, arm, CHAIN, NamedArm(name, arm, {}), law)[1].max())
        assert excess[0] < 0.01
        assert excess[1] > -0.01


def test_the_search_of_a_design_begins_inside_and_ends_no_slower():
    """By the exact time constants, and those of places of the grid inside; and all requirements are met."""
    arm, found = region_of("sasaki2012-lab")
    chosen, _ = recommended_gains(arm, CHAIN)
    assert chosen.is_met
    own = tfarm.result_card(arm, chosen.law, CHAIN)
    assert {own.sampled.grade, own.continuous.grade} == {"good"}
    start = tfarm.result_card(arm, found.start, CHAIN)
    assert {start.sampled.grade, start.continuous.grade} == {"good"}
    assert own.sampled.time_constant <= start.sampled.time_constant
    for place in np.random.default_rng(2).permutation(np.argwhere(found.excess < -0.01))[:8]:
        assert own.sampled.time_constant <= 1.001 * grades(arm, found, place)[1]


def test_the_law_of_a_design_has_the_digits_that_are_shown():
    chosen, _ = recommended_gains(tfarm.load("sasaki2012-lab"), CHAIN)
    assert chosen.law == tfarm.design(tfarm.load("sasaki2012-lab")).law
    assert chosen.coefficients == pytest.approx(chosen.law.by_name, rel=1e-14)
    assert [float(f"{each:.6g}") for each in chosen.law.point] == list(chosen.law.point)


def test_the_intervals_end_between_a_point_inside_and_one_outside():
    _, found = region_of("sasaki2012-lab")
    met = found.met
    for column, intervals in enumerate(found.stable_intervals):
        inside = [any(low <= y <= high for low, high in intervals) for y in found.y]
        assert inside == met[:, column].tolist()
