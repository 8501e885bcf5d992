"""Pairs predicted, corrected and told apart where they are known in closed form: each kind of pair by itself."""

from itertools import pairwise

import numpy as np
import pytest

from tests.spectrum.test_continuation import with_zeros
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic
from tfarm.spectrum.continuation import Member, Node, _exchange, _jumped, _next_zero, follow, predicted, through_nodes

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


@pytest.mark.parametrize("drift", [0.0, 0.1, -0.1])
def test_two_that_meet_where_the_function_grows_beyond_any_number_are_paired_without_a_warning(drift):
    def exact(C):
        return np.array([-1.0 + drift * C, -3.0, -1.2 + 0.15 * C, -9.0], complex)

    def family(C):
        function = with_zeros(exact(C))

        def grown(s):
            value, slope, scale = function(s)
            return Analytic(value, slope, scale + 1e4 * C)

        return Member(grown)

    nodes = [Node(0.0, exact(0.0).reshape(2, 2))]
    assert _exchange(family, nodes, np.array([True, False]), 1.0) in (True, False)  # pytest makes a warning an error


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
