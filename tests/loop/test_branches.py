"""Branches between their nodes, their crossings without them, and loops that are one written in two ways."""

import numpy as np
import pytest

import tfarm
from tests.loop.test_starts import LAWS
from tests.shared import thinned
from tfarm import HubFeedback, Law
from tfarm.exact.characteristic import loop_parts
from tfarm.loop.crossings import branch_crossings
from tfarm.loop.loop import Loop
from tfarm.loop.nyquist import upper_contour
from tfarm.loop.stability import stability
from tfarm.loop.theorem import definite, polynomial, signs_of
from tfarm.loop.windows import windows_of

LAB, MOTOR = tfarm.load("sasaki2012-lab"), tfarm.load("quanser-flexlink")


def test_of_a_pair_that_meets_on_the_axis_both_are_listed_and_mirror_images_where_they_ring():
    """To the last digit, and each a zero of the loop."""
    found = tfarm.locus(LAB, HubFeedback(K1=0.3, Kp=0.5), "K1", 0.05, 4.0, points=30, branches=4)
    lower = np.argwhere(found.branches.imag < 0)
    assert lower.size
    assert (found.branches.imag[np.unique(lower[:, 0])] == 0).any()
    for row, column in lower:
        pole = found.branches[row, column]
        assert pole.conjugate() in found.branches[:, column]
        at = Loop(LAB, found.law.having("K1", float(found.gain[column]))).function(np.array([pole]))
        assert abs(at.value / at.slope)[0] < 1e-12 * abs(pole)


# ------------------------------------------------------------ crossings


LATE = Law({"hub_rate": 0.3, "root_moment": 0.3}, delay=0.01)


@pytest.mark.parametrize(
    ("law", "vary", "start", "stop", "way"),
    thinned(
        [
            (Law({"hub_angle": 1.0, "hub_rate": 0.3}), "hub_angle", 3.0, -2.1, "unstable"),  # a real pole, through 0
            (LATE, "gain", 0.5, 4.0, "unstable"),
            (LATE, "gain", 4.0, 0.5, "stable"),
        ],
        2,
    ),
)
def test_crossings_of_branches_are_those_of_d_decomposition(law, vary, start, stop, way):
    """Two roads: with the branches blotted out the same values, frequencies and directions, in the order of the way."""
    found = tfarm.locus(LAB, law, vary, start, stop, 9, 2)
    without = branch_crossings(found.varied, found.gain, np.full_like(found.branches, np.nan), found.box.im_max)
    assert len(without) == len(found.crossings) > 0
    span = abs(stop - start)
    for mine, theirs in zip(found.crossings, without, strict=True):
        assert theirs.branch is None
        assert theirs.gain == pytest.approx(mine.gain, abs=1e-9 * span)
        assert theirs.omega == pytest.approx(mine.omega, rel=1e-7, abs=1e-6)
        assert theirs.direction == mine.direction == way
    gains = [each.gain for each in without]
    assert gains == sorted(gains, reverse=stop < start)


def test_where_no_branch_swings_crossings_of_others_are_told_up_to_the_first_mode():
    """Of a rig whose first three branches are real at some gain: those of the windows of that gain."""
    law = tfarm.default_gains(MOTOR)
    found = tfarm.locus(MOTOR, law, "K2", -20.0, 10.0, branches=3, points=40)
    assert (np.nanmax(found.branches.imag, axis=0) == 0).any()
    first = tfarm.modes(MOTOR, 1).natural_frequency[-1]
    edges = windows_of(stability(MOTOR, law), ["K2"])["K2"].crossings
    expected = [(t, w) for t, w in zip(edges.gain, edges.at, strict=True) if -20 < t < 10 and w < first]
    assert [(each.gain, each.omega) for each in found.crossings] == [pytest.approx(each, rel=1e-9) for each in expected]
    assert len(expected) == 1


# ------------------------------------------------------------ one loop, written twice


@pytest.mark.parametrize("size", [2.0**-20, 2.0**20])
def test_a_sign_is_that_of_the_polynomial_times_any_number_above_0(size):
    for coefficients in ([1.0, 3.0], [1.0, -3.0, 2.25], [1.0, -3.0, 2.0], [2.0, 0.0, 1.0], [-1.0, 2.0]):
        assert definite(polynomial((size * np.array(coefficients)).tolist())) == definite(polynomial(coefficients))
    for num, den in (([1.0, 7.0], [1.0, 7.0, 12.0]), ([-3.0], [1.0, 2.0, 5.0]), ([5.0, 1.0], [0.1, 1.0])):
        one = signs_of(Law({"hub_angle": (num, den)}))
        many = signs_of(Law({"hub_angle": ((size * np.array(num)).tolist(), (size * np.array(den)).tolist())}))
        assert (one.kind, one.at_rest) == (many.kind, pytest.approx(many.at_rest, rel=1e-12))


def test_the_contour_ends_at_the_band_wherever_the_law_has_poles():
    """One below the band has points all around it, one above it has none; and at -1 +- 1/2 of its distance too."""
    band = 300.0
    for ringing, is_near in ((0.6 * band, True), (1.004 * band, False)):
        damped = 0.01 * ringing
        den = [1.0, 2 * damped, damped**2 + ringing**2]
        loop = Loop(LAB, Law({"hub_rate": ([ringing**2], den)}))
        s, is_arc = upper_contour(loop, np.array([0.0]), band, np.array([-1 + 20j]))
        w = s.imag[~is_arc]
        assert w.max() == pytest.approx(band, rel=1e-12)
        assert (np.diff(s.imag) >= 0).all()
        near = np.sort(w[abs(w - ringing) <= 4 * damped])
        if is_near:
            assert np.diff(near).max() < 0.5 * damped
            assert near[-1] > ringing + 3.5 * damped
            assert near[0] < ringing - 3.5 * damped


@pytest.mark.parametrize("name", LAWS)
def test_the_function_of_a_law_is_the_rig_s_drive_times_one_plus_l(name):
    """D s^n/(q drive) is 1 + L, up to the time that waves take and one factor."""
    loop = Loop(LAB, LAWS[name])
    s = np.array([0.3 + 2j, -5 + 40j, 2.0 + 9j])
    at = loop.function(s)
    drive, _, scale = loop_parts(loop.k, s)
    whole = np.prod([s[:, None] - loop.law.poles], axis=2)[0]
    mine = at.value * np.exp(at.scale) * s**loop.zeros_at_origin * np.exp(loop.delay_of_waves * s)
    ratio = mine / (drive * np.exp(scale) * whole * (1 + loop.loop_function(s)))
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-8)
