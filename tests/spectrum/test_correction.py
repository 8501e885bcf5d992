"""Zeros corrected from a guess, told apart from their neighbours, and those that went astray named."""

import numpy as np
import pytest

from tests.spectrum.test_continuation import with_zeros
from tfarm.arrays import LEAST_SIZE
from tfarm.exact.characteristic import Analytic
from tfarm.spectrum.continuation import Member, _gaps, _together, corrected, improved, neighbours_of


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
