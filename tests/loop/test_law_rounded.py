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
from tfarm.crossing.turning import PIXEL
from tfarm.loop.locus import frame, locus, rounded
from tfarm.loop.loop import Loop

LAB = tfarm.load("sasaki2012-lab")
LAW = tfarm.Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002)


@cache
def drawn(start, stop, points):
    return rounded(locus(LAB, LAW, "gain", start, stop, points, 1))


def well_inside(s, box):
    """Whether a pole is farther from the edges of a box than a twentieth of its width or height."""
    room = 0.05 * min(box.re_max - box.re_min, box.im_max)
    return box.re_min + room < s.real < box.re_max - room and s.imag < box.im_max - room


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
    """Within a pixel of the picture, between the last value at which they are real and the first at which a pair."""
    fine = drawn(start, stop, points)
    s, gain = stationary(low, high, sign)
    left, right, bottom, top = frame(fine.branches)
    away = abs((fine.branches - s).real / (right - left) + 1j * fine.branches.imag / (top - bottom))
    meets = np.flatnonzero(np.nanmin(away, axis=1) < PIXEL)
    assert meets.size >= 2  # both real poles, or one of them and the pair
    for row, far in zip(fine.branches[meets], away[meets], strict=True):
        n = int(np.nanargmin(far))
        around = fine.gain[max(n - 1, 0) : n + 2]
        assert around.min() <= gain <= around.max(), row[n]


@pytest.mark.parametrize(("start", "stop", "points"), [(0.0, 60.0, 24), (1.0, 8.0, 8)])
def test_no_branch_ends_or_begins_but_at_the_edge_of_the_box_or_on_another(start, stop, points):
    fine = drawn(start, stop, points)
    for number, row in enumerate(fine.branches):
        lives = np.isfinite(row)
        for n in np.flatnonzero(lives[1:] != lives[:-1]):
            end = n if lives[n] else n + 1
            others = np.delete(fine.branches[:, end], number)
            assert (others == row[end]).any() or not well_inside(row[end], fine.box)


def test_every_value_between_has_poles_on_every_branch():
    """The residual 1 + L of each, and of the meeting, where it is of second order."""
    fine = drawn(1.0, 8.0, 8)
    for n in range(0, fine.gain.size, 7):
        loop = Loop(LAB, LAW.having("gain", float(fine.gain[n])))
        assert abs(1 + loop.loop_function(fine.branches[np.isfinite(fine.branches[:, n]), n])).max() < 1e-6
