"""Pairs predicted, corrected and told apart where they are known in closed form: each kind of pair by itself."""

from itertools import pairwise

import numpy as np
import pytest

from tests.spectrum.test_continuation import with_zeros
from tfarm.arrays import LEAST_SIZE
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic
from tfarm.spectrum.continuation import Node, _exchange, _jumped, _next_zero, follow, predicted, through_nodes
from tfarm.spectrum.correction import Member, _gaps, _together, corrected, improved, neighbours_of

PLACES = (0.0, 0.3, 0.7)


def ringing(C):
    mean, square = -1 - C + 0.2 * C**2, 9 + 3 * C - C**2
    return mean + 1j * np.sqrt(square), mean - 1j * np.sqrt(square)


def close_together(C):
    mean, root = -5 + C - C**2, np.sqrt(0.3 + 0.2 * C + 0.1 * C**2)
    return mean + root, mean - root


def far_apart(C):
    """As of an overdamped mode: the inverse of the slow one is a polynomial, nearly -C, and the fast one is."""
    return 1 / (-2 - C - 0.3 * C**2), -9 - 4 * C + C**2


def through_the_origin(C):
    """There the inverse is none: mean and square of half the distance are."""
    return -0.3 + 0.6 * C, -4 - C


def at_the_origin(C):
    return 0.0, -3 - C - 0.5 * C**2


def alone(C):
    return -2 + C + 0.5 * C**2, np.nan


def ended(_):
    return np.nan, np.nan


KINDS = (ringing, close_together, far_apart, through_the_origin, at_the_origin, alone, ended)


def at_place(C):
    return np.array([kind(C) for kind in KINDS], dtype=complex)


def test_each_kind_of_pair_is_predicted_by_what_is_a_parabola_of_it():
    nodes = [Node(C, at_place(C)) for C in PLACES]
    for C in (1.1, 0.5, -0.2):
        np.testing.assert_allclose(through_nodes(nodes, C), at_place(C), rtol=1e-13)
        np.testing.assert_allclose(predicted(nodes, C), at_place(C), rtol=1e-13)
    places = np.array([[1.1, 0.5, -0.2], [0.0, 0.31, 2.0]])
    table = through_nodes(nodes, places)
    assert table.shape == (2, 3, len(KINDS), 2)
    np.testing.assert_allclose(table, [[at_place(C) for C in row] for row in places], rtol=1e-13)


def test_a_pair_is_predicted_by_as_many_nodes_as_know_it():
    """By parabolas; one that was paired anew by a straight line, and at first by where it stands."""

    def exact(C):
        return np.array([[-1 - C + C**2, np.nan], [-5 + 2 * C, np.nan], [-9 + C, np.nan]], dtype=complex)

    nodes = [Node(C, exact(C)) for C in (-1.0, *PLACES)]  # the first one too far back
    nodes[0].zeros[:] = 77.0
    nodes[1].zeros[1] = np.nan
    nodes[1].zeros[2] = nodes[2].zeros[2] = np.nan
    found = predicted(nodes, 1.2)
    np.testing.assert_allclose(found[:2], exact(1.2)[:2], rtol=1e-13)
    assert found[2, 0] == exact(PLACES[-1])[2, 0]


# ------------------------------------------------------------ following


def straight(C):
    """Two pairs of which all but the distance of one is linear in C."""
    return np.array([[-1 - C + 3j, -1 - C - 3j], [-2 - C, -6 - 2 * C]])


def test_the_way_back_is_the_way_there():
    def family(C):
        return Member(with_zeros(straight(C)))

    there = follow(family, Node(0.0, straight(0.0)), 2.0, 0.01, 2)
    back = follow(family, there[-1], 0.0, -0.01, 2)
    assert back[-1].at == 0.0
    assert all(after.at < before.at for before, after in pairwise(back))
    for node in (*there, *back):
        np.testing.assert_allclose(node.zeros, straight(node.at), rtol=1e-6)


def test_steps_grow_while_all_goes_well():
    """Of geometric steps from 1e-6 on 31 reach 2; with as many nodes to begin with two more are needed at most."""
    first, stop = 1e-6, 2.0
    nodes = follow(lambda C: Member(with_zeros(straight(C))), Node(0.0, straight(0.0)), stop, first, 2)
    needed = np.log(1 + stop / first * 0.6) / np.log(1.6)
    assert needed - 1 < len(nodes) - 1 < needed + 3


def test_the_zero_that_goes_on_stands_first_whichever_of_a_pair_has_ended():
    """Here it is the slower one that comes to the singular point at -2; a pair that has not met it keeps both."""

    def exact(C):
        return np.array([[-1 - C, 5 - C], [-0.2 + 3j, -0.2 - 3j], [-0.5 + 0.1 * C, -1.2]], dtype=complex)

    def family(C):
        return Member(with_zeros(exact(C)), -2.0, 1e-3, 0.05)

    nodes = follow(family, Node(0.0, exact(0.0)), 2.5, 0.03, 3)
    np.testing.assert_allclose(nodes[-1].zeros[0, 0], 2.5, rtol=1e-9)
    assert np.isnan(nodes[-1].zeros[0, 1])
    np.testing.assert_allclose(nodes[-1].zeros[1:], exact(2.5)[1:], rtol=1e-9)
    np.testing.assert_array_equal(np.isnan(nodes[-1].zeros).sum(), 1)


def test_stepping_over_the_singular_point_is_no_step():
    """Infinitely many zeros lie there; a pair that rings, or a function without such a point, may pass."""
    before, after = np.array([[-1.9, -4.0], [-1.9, -3.0], [-1 + 1j, -1 - 1j]]), np.array(
        [[-2.1, -4.0], [-1.8, -3.1], [-3 + 1j, -3 - 1j]]
    )  # fmt: skip
    here, there = (Member(with_zeros([-1.0]), singular, 0.0, 0.05) for singular in (-2.0, -2.05))
    np.testing.assert_array_equal(_jumped(here, there, before, after), [True, False, False])
    entire = Member(with_zeros([-1.0]), -2.0)
    assert not _jumped(entire, entire, before, after).any()


@pytest.mark.parametrize(("lone", "kept"), [(-1.0, True), (0.0, False)])
def test_a_zero_left_by_its_partner_goes_on_alone_where_zeros_can_end(lone, kept):
    """Unless it stands at 0, where every function of the family has it."""

    def exact(C):
        meeting = np.sqrt(complex(0.25 - C)) * 4
        return np.array([lone, -8 + meeting, -8 - meeting, -3 + 20j, -3 - 20j])

    def family(C):
        return Member(with_zeros(exact(C)), -50.0, 1e-3, 0.05)

    nodes = follow(family, Node(0.0, np.array([[lone, -6.0], [-3 + 20j, -3 - 20j]])), 1.0, 0.01, 2)
    expected = [[-8 + 1j * np.sqrt(12), -8 - 1j * np.sqrt(12)], exact(1.0)[3:], [lone, np.nan]]
    np.testing.assert_allclose(nodes[-1].zeros, expected[: 2 + kept], rtol=1e-5)


def test_two_pairs_exchange_partners_where_one_of_each_meet():
    """The two that meet ring together from then on; the slower of the others stand in the lower row."""

    def exact(C):
        meeting = 2 * np.sqrt(complex(0.25 - C))
        return np.array([-1.0, -5 + meeting, -5 - meeting, -30.0])

    def family(C):
        return Member(with_zeros(exact(C)))

    nodes = follow(family, Node(0.0, exact(0.0).reshape(2, 2)), 1.0, 0.01, 2)
    ringing_now = -5 + 2j * np.sqrt(0.75)
    np.testing.assert_allclose(nodes[-1].zeros, [[-1, -30], [ringing_now, ringing_now.conjugate()]], rtol=1e-5)
    before, after = next((one, two) for one, two in pairwise(nodes) if one.at == two.at)
    assert 0.2 < after.at < 0.25
    np.testing.assert_allclose(np.sort(after.zeros.ravel()), np.sort(before.zeros.ravel()), rtol=1e-12)


@pytest.mark.parametrize("unit", [1e9, 1e-9, -1.0])
def test_the_way_does_not_depend_on_the_unit_of_the_parameter_nor_on_where_it_is_0(unit):
    """Where zeros are paired anew and where one ends: the same steps, from 3 units on, and the same zeros."""

    def exact(C):
        meeting = 2 * np.sqrt(complex(0.25 - C))
        return np.array([-1.0, -5 + meeting, -5 - meeting, -30.0, 3 - 20 * C, 30.0])

    def family(C):
        return Member(with_zeros(exact(C)), -8.0, 1e-3, 0.05)

    start = exact(0.0).reshape(3, 2)
    plain = follow(family, Node(0.0, start), 0.6, 0.01, 3)
    other = follow(lambda at: family(at / unit - 3), Node(3 * unit, start), 3.6 * unit, 0.01 * unit, 3)
    assert np.isnan(plain[-1].zeros).any()
    assert len(other) == len(plain)
    np.testing.assert_allclose(
        [node.at / unit - 3 for node in other], [node.at for node in plain], rtol=1e-6, atol=1e-12
    )
    np.testing.assert_allclose(other[-1].zeros, plain[-1].zeros, rtol=1e-9)


def test_a_way_that_leads_nowhere_is_given_up(monkeypatch):
    """With the last node in hand, after so many steps that did not go well, each shorter than the one before."""

    def exact(C):
        upper = np.array([-0.1 + 1j * (1 + 3 * (C > 0.37)), -0.1 + 12j])
        return np.stack([upper, upper.conj()], 1)

    asked = []

    def family(C):
        asked.append(C)
        return Member(with_zeros(exact(C)))

    monkeypatch.setattr("tfarm.spectrum.continuation.MOST_REFUSALS", 7)
    with pytest.raises(ConvergenceError, match=r"cannot be told apart beyond 0\.3") as told:
        follow(family, Node(0.0, exact(0.0)), 1.0, 0.01, 2)
    assert 0.3 < told.value.best.at < 0.37
    assert sum(C > 0.37 for C in asked) <= 8
    np.testing.assert_allclose(told.value.best.zeros, exact(0.0), rtol=1e-9)


def test_zeros_that_part_are_not_paired():
    """Only what would meet: with the same zeros on their way back nothing is exchanged."""

    def exact(C):
        meeting = 2 * np.sqrt(0.25 - C)
        return np.array([[-1.0, -5 + meeting], [-5 - meeting, -30.0]], dtype=complex)

    def family(C):
        return Member(with_zeros(exact(C)))

    for at, is_pair in ((0.2495, True), (0.23, False)):
        nodes = [Node(0.2, exact(0.2)), Node(0.249, exact(0.249))]
        assert _exchange(family, nodes, np.array([True, False]), at) == is_pair


def test_the_next_real_zero_is_looked_for_on_both_sides():
    """Its sign is that of the mantissa turned by the exponent, which jumps by i pi here."""

    def turned(zeros):
        function = with_zeros(zeros)

        def with_jumps(s):
            value, slope, scale = function(s)
            turn = np.where(np.floor(abs(s) * 1e5) % 2, 1, 0)
            return Analytic(value * (1 - 2 * turn), slope * (1 - 2 * turn), scale + 1j * np.pi * turn)

        return with_jumps

    for near, zeros in ((-0.95, [-1, -1.1, -0.95]), (-1.1, [-1, -1.1, -0.8]), (-1.25, [-1, -1.25]), (np.inf, [-1, -2])):
        assert _next_zero(turned(zeros), -1.0) == pytest.approx(near, rel=1e-13)


# ------------------------------------------------------------ correcting


@pytest.mark.parametrize("pair", [(-3 + 0.1j, -3 - 0.1j), (-2.9, -3.1), (-3 + 1e-5j, -3 - 1e-5j)])
def test_two_zeros_of_a_cubic_are_found_at_once(pair):
    """From values and slopes at two points near them: four numbers, as many as a cubic has."""
    cubic = np.poly1d(np.poly([*pair, 4.0]) * 7.0)
    near = np.array([pair[0] * 1.004 + 0.01, pair[1] * 1.004 + 0.01])
    found = _together(near, cubic(near), cubic.deriv()(near))
    np.testing.assert_allclose(found, pair, rtol=1e-9)


def test_a_function_is_the_same_however_it_is_written():
    """Its exponent apart or multiplied in, for two zeros that are corrected together."""
    truth = np.array([[-2.99, -3.01], [-1 + 2j, -1 - 2j]])
    apart = with_zeros(truth, 0.3)

    def whole(s):
        value, slope, scale = apart(s)
        return Analytic(value * np.exp(scale), slope * np.exp(scale), 0 * scale)

    zeros = truth + np.array([[0.2, -0.3], [0.01, 0.01]])
    for _ in range(3):
        one, another = (improved(Member(function), zeros)[0] for function in (apart, whole))
        np.testing.assert_allclose(one, another, rtol=1e-12)
        zeros = one


def test_a_zero_at_the_origin_stays_there():
    """Exactly, though its partner is near enough for both to be corrected together."""
    truth = np.array([[0.0, -0.01], [-5 + 2j, -5 - 2j]])
    zeros, _ = improved(Member(with_zeros(truth)), np.array([[0.0, -0.018], [-5 + 2j, -5 - 2j]]))
    assert zeros[0, 0] == 0
    assert abs(zeros[0, 1] + 0.01) < 0.008


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_what_moves_by_rounding_has_not_moved(size):
    """By a share of its size, so that no unit of time matters: 4 eps are none, 1e-12 are some."""
    truth = np.array([[-1 + 2j, -1 - 2j], [-3.0, -9.0]])
    for off, has_moved in ((2.0**-52, False), (1e-12, True)):
        _, moved = improved(Member(with_zeros(size * truth)), size * truth * (1 + off))
        np.testing.assert_array_equal(moved > 0, has_moved)


def test_correction_is_of_third_order():
    """Ehrlich-Aberth of all zeros of a polynomial: Newton's method alone is of second order."""
    truth = np.array([[-1 + 2j, -1 - 2j], [-0.5 + 4j, -0.5 - 4j], [-3.0, -9.0]])
    for share in (1e-2, 1e-3):
        off = truth * share * (1 + 0.3j)
        off[2] = off[2].real
        off[:2, 1] = off[:2, 0].conj()
        after, _ = improved(Member(with_zeros(truth)), truth + off)
        assert abs(after - truth).max() < 20 * share**3


def brute_gaps(zeros, member):
    """To the nearest zero of another pair, the singular point, or as far as the origin's mirror image."""
    gaps = np.full(zeros.shape, np.inf)
    for i, j in np.ndindex(zeros.shape):
        others = np.delete(zeros, i, axis=0)
        away = [*abs(others[np.isfinite(others)] - zeros[i, j]), abs(zeros[i, j] - member.singular)]
        gaps[i, j] = (
            min(*away, max(2 * abs(zeros[i, j]), member.free, LEAST_SIZE)) if np.isfinite(zeros[i, j]) else np.inf
        )
    return gaps


@pytest.mark.parametrize("count", [1, 3, 30, 60])
def test_the_room_of_a_zero_is_the_distance_to_what_is_next(count):
    """Of few zeros by all distances, of many by a tree."""
    rng = np.random.default_rng(count)
    zeros = rng.normal(size=(count, 2)) * 5 + 1j * rng.normal(size=(count, 2)) * 5
    zeros[count // 2 + 1 :: 7, 1] = np.nan
    zeros[-1, 0] = 0.0
    for member in (Member(with_zeros([1.0]), -2.0), Member(with_zeros([1.0]), free=3.0)):
        gap, way = _gaps(zeros, member, neighbours_of(zeros))
        np.testing.assert_allclose(gap, brute_gaps(zeros, member), rtol=1e-13)
        assert way.shape == (2 * count, min(8, 2 * count))


def test_the_eight_nearest_repel_each_other():
    """Itself and its partner marked, wherever they are among them."""
    rng = np.random.default_rng(5)
    for count in (20, 60):
        zeros = rng.normal(size=(count, 2)) + 1j * rng.normal(size=(count, 2))
        flat, found = zeros.ravel(), neighbours_of(zeros)
        nearest = np.argsort(abs(flat[:, None] - flat), axis=1)[:, :8]
        np.testing.assert_array_equal(np.sort(found.which, axis=1), np.sort(nearest, axis=1))
        own = np.arange(2 * count)[:, None]
        np.testing.assert_array_equal(found.itself, found.which == own)
        np.testing.assert_array_equal(found.own_pair, (found.which == own) | (found.which == own + 1 - 2 * (own % 2)))


def test_what_moves_is_measured_by_that_room():
    truth = np.array([[-1 + 2j, -1 - 2j], [-3.0, -9.0]])
    member, off = Member(with_zeros(truth), -2.5), truth * 1.001
    after, moved = improved(member, off)
    np.testing.assert_allclose(moved, (abs(after - off) / brute_gaps(off, member)).max(1), rtol=1e-12)


def test_two_pairs_that_have_become_one_stay_there():
    """They do not drive each other away, as at no distance they would to infinity."""
    truth = np.array([[-1 + 2j, -1 - 2j], [-3.0, -9.0]])
    after, moved = improved(Member(with_zeros(truth)), truth[[0, 0, 1]])
    np.testing.assert_allclose(after, truth[[0, 0, 1]], rtol=1e-15)
    np.testing.assert_array_equal(moved, 0.0)


def test_a_zero_that_lands_too_far_from_its_guess_is_stray():
    """By more than a fifth of its room; around a meeting on the axis the means are compared."""
    truth = np.array([[-1 + 2j, -1 - 2j], [-1 + 7j, -1 - 7j], [-20.0, -20.2]])
    guess = truth + np.array([[0.1], [0.1], [0.0]])
    guess[2] = [-20.1 + 0.3j, -20.1 - 0.3j]  # met since: the zeros lie 0.3 away, their mean nowhere
    zeros, stray = corrected(Member(with_zeros(truth)), guess)
    np.testing.assert_allclose(zeros, truth, rtol=1e-9)
    assert not stray.any()
    guess[1] += 1.2  # of 5
    zeros, stray = corrected(Member(with_zeros(truth)), guess)
    np.testing.assert_array_equal(stray, [False, True, False])
    np.testing.assert_allclose(zeros, truth, rtol=1e-9)


def test_a_pair_whose_mean_alone_stays_is_stray():
    """Where it rings before and after, both zeros are compared, not their mean."""
    truth = np.array([[-1 + 7j, -1 - 7j], [-20.0, -20.2]])
    _, stray = corrected(Member(with_zeros(truth)), truth - np.array([[3.5j, -3.5j], [0.0, 0.0]]))
    np.testing.assert_array_equal(stray, [True, False])


def test_where_there_is_no_zero_nothing_settles():
    """A constant, and a guess in a place without a value: the guess is given back, and all of it is stray."""
    guess = np.array([[-1 + 2j, -1 - 2j]])

    def constant(s):
        return Analytic(np.ones(s.size, complex), np.full(s.size, 1e-3 + 0j), np.zeros(s.size, complex))

    zeros, stray = corrected(Member(constant), guess)
    assert stray.all()
    np.testing.assert_array_equal(zeros, guess)
