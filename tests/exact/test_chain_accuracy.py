"""float64 chains against ball arithmetic (see `chain_accuracy`), and the survey's own yardstick."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

import tfarm
from tests.exact.chain_accuracy import BOUND, PLACES, WANTED, anywhere, exact_values, measure, run
from tests.shared import thinned
from tests.test_transition import rig
from tests.transition import response
from tfarm.exact import balls
from tfarm.exact.chaining import chain_of


@pytest.mark.parametrize("place", thinned([anywhere, *PLACES.values()], 2), ids=["anywhere", *PLACES])
def test_no_error_above_the_bound_that_is_not_flagged(place):
    """`python -m tests.exact.chain_accuracy 5000` for more."""
    points = run(12, 41, place)
    fair = [point for point in points if not point.flagged]
    assert len(fair) > 0.4 * len(points) > 40
    bad = [point for point in fair if not point.error <= BOUND]
    assert not bad, f"{len(bad)} of {len(fair)}, worst {max(bad, key=lambda point: point.error)}"


def test_the_balls_and_their_condition_are_those_of_the_transition_matrices():
    arm, s, share = rig(), -4 + 900j, 0.625
    length, names = sum(Fraction(link.length) for link in arm.links), {"theta": "hub_angle", "Y": "deflection"}
    h = 2.0**-30
    for each, pair in zip(WANTED, exact_values(chain_of(arm), s, share), strict=True):
        if each.power or each.quantity not in names or each.place == "tip":
            continue
        wanted = names[each.quantity]
        at = [(wanted, float(length) * share * (1 + step)) for step in (0, h)] if each.place == "x" else [wanted] * 2
        here = complex(response(arm, s, [at[0]])[at[0]])
        later = complex(response(arm, s * (1 + h), [at[0]])[at[0]])
        moved = complex(response(arm, s, [at[1]])[at[1]])
        value, condition = pair
        assert balls.nearest_float(value) == pytest.approx(here, rel=1e-15)
        assert condition == pytest.approx((abs(later / here - 1) + abs(moved / here - 1)) / h, rel=1e-4)


def test_decay_beyond_a_place_costs_it_no_digit():
    """Next to the root of a long chain at large real s: the scales of all segments sum up to some 500 there."""
    arm = tfarm.load("sasaki2012")
    part = replace(arm.link, length=arm.link.length / 6)
    chain = replace(arm, link=part, outer=(part,) * 5)
    points = [point for share in np.geomspace(0.01, 0.1, 12) for point in measure(chain, 3e5 + 0j, float(share))]
    assert max(point.error for point in points) < 1e-15
