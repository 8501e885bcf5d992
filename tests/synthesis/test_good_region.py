"""Gains of the grade good: the region of models on a grid against the result cards of the exact loops."""

from functools import cache

import numpy as np
import pytest

import tfarm
from tfarm.arm import HubFeedback
from tfarm.dsp import Chain
from tfarm.loop.plane import moment_axis
from tfarm.loop.plane_axes import rate_axis
from tfarm.synthesis.good_region import good_region

CHAIN = Chain()


@cache
def region_of(name):
    arm = tfarm.load(name)
    x = rate_axis(arm)
    return arm, good_region(arm, x, moment_axis(arm, x), CHAIN)


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


def test_the_recommended_gains_are_the_fastest_of_the_region():
    """By the exact time constants at places of the grid inside; and all requirements are met."""
    arm, found = region_of("sasaki2012-lab")
    chosen = found.recommended
    assert chosen.is_met
    own = tfarm.result_card(arm, chosen.law, CHAIN)
    assert {own.sampled.grade, own.continuous.grade} == {"good"}
    for place in np.random.default_rng(2).permutation(np.argwhere(found.excess < -0.01))[:8]:
        assert own.sampled.time_constant <= 1.001 * grades(arm, found, place)[1]


def test_the_intervals_end_between_a_point_inside_and_one_outside():
    _, found = region_of("sasaki2012-lab")
    met = found.met
    for column, intervals in enumerate(found.stable_intervals):
        inside = [any(low <= y <= high for low, high in intervals) for y in found.y]
        assert inside == met[:, column].tolist()
