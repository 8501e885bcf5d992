"""Loci of a law as they are drawn: where two poles meet on the real axis, and that no branch ends short of it.

Road: on the real axis each s is a pole at the gain K(s) = -1/L(s), L the loop function at the gain 1, and two of them
meet where K is stationary.
"""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import tfarm
from tests.shared import thinned
from tfarm.loop.law_locus import inside, law_locus
from tfarm.loop.law_rounded import rounded_law_locus
from tfarm.loop.loop import Loop

LAB = tfarm.load("sasaki2012-lab")
LAW = tfarm.Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002)


@cache
def drawn(start, stop, points):
    return rounded_law_locus(law_locus(LAB, LAW, "gain", start, stop, points, 1))


def stationary(low, high, sign):
    """Where the gain of a real pole is largest (sign 1) or least between two, and that gain."""

    def size(s):
        return -sign * float(-1.0 / Loop(LAB, LAW).loop_function(np.array([complex(s)]))[0].real)

    found = minimize_scalar(size, bounds=(low, high), method="bounded", options={"xatol": 1e-10})
    return float(found.x), -sign * float(found.fun)


@pytest.mark.parametrize(
    ("start", "stop", "points", "low", "high", "sign"),
    thinned(
        [
            (1.0, 8.0, 8, -60.0, -12.0, 1),  # two real poles part as a pair
            (8.0, 1.0, 8, -60.0, -12.0, 1),  # the other way round
            (0.0, 60.0, 24, -2.0, -0.6, -1),  # a pair from s = 0 becomes two real poles, all in the first steps
        ],
        2,
    ),
    ids=["part", "meet", "from rest"],
)
def test_branches_reach_the_point_where_they_meet(start, stop, points, low, high, sign):
    fine = drawn(start, stop, points)
    s, gain = stationary(low, high, sign)
    at = int(abs(fine.values - gain).argmin())
    assert fine.values[at] == pytest.approx(gain, rel=1e-10)
    here = fine.branches[:, at]
    assert (here.imag[abs(here - s) < 1e-5 * abs(s)] == 0).all()
    assert (abs(here - s) < 1e-5 * abs(s)).sum() >= 2  # both real poles, or one of them and the pair


@pytest.mark.parametrize(("start", "stop", "points"), [(0.0, 60.0, 24), (1.0, 8.0, 8)])
def test_no_branch_ends_or_begins_but_at_the_edge_of_the_box_or_on_another(start, stop, points):
    fine = drawn(start, stop, points)
    for number, row in enumerate(fine.branches):
        lives = np.isfinite(row)
        for n in np.flatnonzero(lives[1:] != lives[:-1]):
            end = n if lives[n] else n + 1
            others = np.delete(fine.branches[:, end], number)
            assert (others == row[end]).any() or not inside(row[end : end + 1], fine.box).any()


def test_every_value_between_has_poles_on_every_branch():
    """The residual 1 + L of each, and of the meeting, where it is of second order."""
    fine = drawn(1.0, 8.0, 8)
    for n in range(0, fine.values.size, 7):
        loop = Loop(LAB, LAW.having("gain", float(fine.values[n])))
        assert abs(1 + loop.loop_function(fine.branches[np.isfinite(fine.branches[:, n]), n])).max() < 1e-6
