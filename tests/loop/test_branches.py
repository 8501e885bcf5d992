"""Branches between their nodes, their crossings without them, and loops that are one written in two ways."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.test_starts import LAWS
from tests.shared import thinned
from tfarm import Hub, HubFeedback, Law
from tfarm.arm import Motor
from tfarm.exact.characteristic import gains_of, loop_parts, quick_characteristics
from tfarm.loop.branches import NOBODY, Stretch, ordered, stretches
from tfarm.loop.law_locus import Family, _crossings, _room, law_locus
from tfarm.loop.law_rounded import _with
from tfarm.loop.loop import Loop
from tfarm.loop.nyquist import upper_contour
from tfarm.loop.stability import stability
from tfarm.loop.theorem import definite, polynomial, signs_of
from tfarm.loop.variation import Variation, free_of_loss
from tfarm.loop.windows import windows_of
from tfarm.spectrum.continuation import Node

LAB, MOTOR = tfarm.load("sasaki2012-lab"), tfarm.load("quanser-flexlink")


# ------------------------------------------------------------ between nodes


def swinging(at):
    """Three pairs whose mean and square of half the distance are no polynomials."""
    mean, square = -1 - 0.3 * np.sin(at), 4 + np.exp(0.4 * at)
    real = -8 - 0.5 * np.cos(at)
    return np.array([
        [mean + 1j * np.sqrt(square), mean - 1j * np.sqrt(square)],
        [mean + 9j, mean - 9j],
        [real + 0.5, real - 0.5],
    ])  # fmt: skip


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_guess_is_that_of_the_two_nodes_on_either_side(way):
    """Interpolation by a cubic: |f''''| h^4/24 times 9/16 in the middle of four nodes, more than that beside it."""
    step = 0.2
    places = way * step * np.arange(12)
    nodes = [Node(float(at), swinging(at)) for at in places]
    found = Stretch(nodes, np.arange(6).reshape(3, 2))
    values = way * np.sort(np.random.default_rng(2).uniform(step, 10 * step, 60))
    guess = found.guess(values)
    exact = ordered(np.array([swinging(at) for at in values]), False)
    fourth = 0.5  # of the cosine, the largest of the fourth derivatives of real parts
    assert abs((guess - exact).real).max() <= 1.1 * fourth * step**4 / 24 * 9 / 16
    at_nodes = found.guess(places)
    np.testing.assert_allclose(at_nodes, ordered(np.array([swinging(at) for at in places]), False), rtol=1e-13)
    few = Stretch(nodes[:2], found.slots)  # of two nodes a straight line
    np.testing.assert_allclose(few.guess(places[:2]), at_nodes[:2], rtol=1e-13)
    assert few.guess(places[:1] + way * step / 2)[0, 1, 0].real == pytest.approx(
        at_nodes[:2, 1, 0].real.mean(), rel=1e-12
    )
    one = Stretch(nodes[:1], found.slots)
    np.testing.assert_array_equal(one.guess(places[:1])[0], at_nodes[0])


def test_an_order_holds_while_a_pair_stays_one():
    """Im > 0 first, or the larger of two real ones; a pair at 0 is left as it is."""
    pairs = np.array([[-1 - 2j, -1 + 2j], [-3.0, -1.0], [-1.0, -3.0], [-1 + 2j, -1 - 2j]], complex)
    np.testing.assert_array_equal(ordered(pairs, False)[:, 0], [-1 + 2j, -1, -1, -1 + 2j])
    pinned = np.array([[-4.0, 0.0], [-3.0, -1.0]], complex)
    np.testing.assert_array_equal(ordered(pinned, True), [[-4.0, 0.0], [-1.0, -3.0]])
    np.testing.assert_array_equal(ordered(pinned, False), [[0.0, -4.0], [-1.0, -3.0]])


def test_a_branch_stays_with_its_zero_where_pairs_exchange_theirs():
    """And one that comes in is new, one that is gone nobody's: numbers go on from the largest."""
    before = [[-1.0, -5.2], [-4.8, -30.0], [-7 + 3j, -7 - 3j]]
    after = [[-1.0, -30.0], [-4.8, -5.2], [-7 + 3j, -7 - 3j]]
    later = [[-1.0, np.nan], [-5 + 1j, -5 - 1j], [-7 + 3j, -7 - 3j], [-60.0, -70.0]]
    nodes = [
        Node(at, np.array(zeros, complex))
        for at, zeros in ((0, before), (1, before), (1, after), (2, later), (2, later))
    ]
    nodes[3] = Node(2, np.array([[-1.0, -30.0], [-5 + 1j, -5 - 1j], [-7 + 3j, -7 - 3j]]))
    first, second, third = stretches(nodes, False)
    assert [[node.at for node in each.nodes] for each in (first, second, third)] == [[0, 1], [1, 2], [2]]
    np.testing.assert_array_equal(first.slots, np.arange(6).reshape(3, 2))
    np.testing.assert_array_equal(second.slots, [[0, 3], [2, 1], [4, 5]])
    np.testing.assert_array_equal(third.slots, [[0, NOBODY], [2, 1], [4, 5], [6, 7]])


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
    found = law_locus(LAB, law, vary, start, stop, 9, 2)
    family = Family(LAB, law, vary, start)
    without = _crossings(family, found.values, np.full_like(found.branches, np.nan), found.box)
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


def test_the_room_of_a_pole_ends_at_its_own_mirror_image():
    """Of real ones at the next; those at 0 are one."""
    poles = np.array([0.0, 0.0, -3.0, -5.0, -1 + 2j, -1 + 9j])
    np.testing.assert_allclose(_room(poles), [5**0.5, 5**0.5, 2.0, 2.0, 5**0.5, 7.0])


def test_poles_between_two_values_are_put_on_branches_or_begin_their_own():
    """Each known pole stands once in its column; a branch that is not the same on both sides is cut there."""
    rows = np.array([[1.0, 2.0, 3.0], [10.0, 20.0, 30.0], [np.nan, 5.0, 6.0]], complex)
    before = np.array([1.5, 14.0, np.nan], complex)
    after = np.array([1.5, 16.0, 4.5], complex)
    found = _with(rows, 1, before, after, np.array([7.0 + 0j]))
    blank = np.nan
    expected = [
        [1, 1.5, 2, 3],
        [10, 14, blank, blank],
        [blank, 4.5, 5, 6],
        [blank, 16, 20, 30],
        [blank, 7, blank, blank],
    ]
    np.testing.assert_array_equal(found, expected)


# ------------------------------------------------------------ one loop, written twice


@pytest.mark.parametrize("inductance", [0.0, 3e-3])
def test_what_a_hub_loses_is_a_rate_gain_beside_any_law(inductance):
    """D of the rig is that of the freed one with the gain: friction and back-EMF, or back-EMF alone if that is late."""
    motor = Motor(
        resistance=2.0, torque_constant=0.05, back_emf_constant=0.06, inductance=inductance, gear_ratio=20.0,
        rotor_inertia=1e-5, rotor_friction=1e-4,
    )  # fmt: skip
    arm = replace(LAB, motor=motor, input="motor_voltage", hub=Hub(inertia=0.1, friction=0.02))
    freed, loss = free_of_loss(arm)
    law, s = HubFeedback(K1=0.3, K2=0.2, Kp=1.0), np.array([0.3 + 2j, -4 + 57j, 20.0 + 0j])
    k, gains = Variation(freed, law, "K1", loss).system(law.K1)
    whole = Loop(arm, law)
    own = np.array([[float(gain)] for gain in gains_of(whole.k, whole.gains)])
    mine, theirs = quick_characteristics(k, s, gains, 0), quick_characteristics(whole.k, s, own, 0)
    ratio = mine.value / theirs.value * np.exp(mine.scale - theirs.scale)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    assert loss.K1 > 0
    assert freed.rate_loss < 1e-12 * loss.K1 or inductance


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
