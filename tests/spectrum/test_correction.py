"""Zeros corrected from a guess, told apart from their neighbours, and those that went astray named."""

import numpy as np
import pytest

from tests.spectrum.test_continuation import with_zeros
from tfarm.exact.characteristic import Analytic
from tfarm.spectrum.continuation import Member, _together, corrected, improved


@pytest.mark.parametrize("pair", [(-3 + 0.1j, -3 - 0.1j), (-2.9, -3.1), (-3 + 1e-5j, -3 - 1e-5j)])
def test_two_zeros_of_a_cubic_are_found_at_once(pair):
    """From values and slopes at two points near them: four numbers, as many as a cubic has."""
    cubic = np.poly1d(np.poly([*pair, 4.0]) * 7.0)
    near = np.array([pair[0] * 1.004 + 0.01, pair[1] * 1.004 + 0.01])
    found = _together(near, cubic(near), cubic.deriv()(near))
    np.testing.assert_allclose(found, pair, rtol=1e-9)


def test_a_zero_at_the_origin_stays_there():
    """Exactly, though its partner is near enough for both to be corrected together."""
    truth = np.array([[0.0, -0.01], [-5 + 2j, -5 - 2j]])
    zeros, _ = improved(Member(with_zeros(truth)), np.array([[0.0, -0.018], [-5 + 2j, -5 - 2j]]))
    assert zeros[0, 0] == 0
    assert abs(zeros[0, 1] + 0.01) < 0.008


def test_correction_is_of_third_order():
    """Ehrlich-Aberth of all zeros of a polynomial: Newton's method alone is of second order."""
    truth = np.array([[-1 + 2j, -1 - 2j], [-0.5 + 4j, -0.5 - 4j], [-3.0, -9.0]])
    for share in (1e-2, 1e-3):
        off = truth * share * (1 + 0.3j)
        off[2] = off[2].real
        off[:2, 1] = off[:2, 0].conj()
        after, _ = improved(Member(with_zeros(truth)), truth + off)
        assert abs(after - truth).max() < 20 * share**3


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
