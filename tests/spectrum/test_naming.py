"""Roots followed on functions whose roots are known, and whole pairs made of what they arrive at."""

from dataclasses import dataclass

import numpy as np
import pytest

import tfarm
from tests.rigs import some_rig
from tfarm.errors import ConvergenceError
from tfarm.spectrum.damped import damped_modes
from tfarm.spectrum.following import follow
from tfarm.spectrum.naming import LOST, in_pairs


@dataclass
class Known:
    """A family whose roots at each value are known; what is next to a guess is the nearest of them."""

    roots: object
    most_halvings: int = 200

    least_step = 1e-9
    blur = alone = 0.0

    def near(self, values, guess):
        found = guess.copy()
        for row, value in zip(found, values, strict=True):
            known = np.asarray(self.roots(value), complex)
            alive = np.flatnonzero(~np.isnan(row))
            real = known[known.imag == 0]
            for n in alive:
                of = real if row[n].imag == 0 else known
                row[n] = of[abs(of - row[n]).argmin()] if of.size else np.nan
        return found

    def complete(self, value, guess):
        return np.asarray(self.roots(value), complex)

    def singular(self, values):
        return np.empty((values.size, 0))


def oscillators(omega):
    """Roots of s^2 + t w^2 s + w^2 = 0 for each w."""

    def roots(t):
        half = t * omega**2 / 2
        root = np.sqrt((half**2 - omega**2).astype(complex))
        return np.stack([-half + root, -half - root], axis=1).ravel()

    return roots


@pytest.mark.parametrize("stop", [0.03, 0.21, 1.1, 5.0])
def test_oscillators_are_followed_into_overdamping(stop):
    """In the order in which they began, whatever lies between."""
    roots = oscillators(np.array([1.0, 1.7, 4.0, 9.0]))
    found = follow(Known(roots), np.array([0.0, stop]), roots(0.0))[1].reshape(-1, 2)
    expected = roots(stop).reshape(-1, 2)
    np.testing.assert_allclose(found.sum(axis=1), expected.sum(axis=1), rtol=1e-12)
    np.testing.assert_allclose(found.prod(axis=1), expected.prod(axis=1), rtol=1e-12)


def test_what_jumps_is_lost_and_the_others_are_kept():
    """Past too many halvings with the last roots in hand, and which of them are stray; else NaN."""

    def roots(t):
        return np.array([-1 + 2j, -1 - 2j, -3.0, (-50.0 if t > 0.37 else -9.0)])

    found = follow(Known(roots), np.array([0.0, 1.0]), roots(0.0))[1]
    np.testing.assert_array_equal(found[:3], roots(1.0)[:3])
    assert np.isnan(found[3])
    with pytest.raises(ConvergenceError, match=r"beyond 0\.3") as stopped:
        follow(Known(roots, most_halvings=5), np.array([0.0, 1.0]), roots(0.0))
    np.testing.assert_array_equal(stopped.value.best[1], roots(0.0))
    assert stopped.value.residual[3]


RINGS, OTHER = -2 + 5j, -2 - 5j


@pytest.mark.parametrize(
    ("single", "pairs", "expected_single", "expected"),
    [
        ([], [[-1, RINGS]], [], [[RINGS, OTHER]]),  # the fast zero has met one that is not followed
        ([OTHER], [[-7, RINGS]], [-7], [[RINGS, OTHER]]),
        ([], [[-1, RINGS], [OTHER, -30]], [], [[-1, -30], [RINGS, OTHER]]),
        ([], [[-1, RINGS], [OTHER, -9 + 4j]], [], [[-9 + 4j, -9 - 4j], [RINGS, OTHER]]),
        ([], [[-30, -1]], [], [[-1, -30]]),
        ([], [[LOST, -1], [OTHER, RINGS]], [], [[-1, LOST], [RINGS, OTHER]]),
    ],
)
def test_zeros_that_ring_are_a_pair(single, pairs, expected_single, expected):
    found = in_pairs(np.array(single, complex), np.array(pairs, complex))
    np.testing.assert_array_equal(found[0], np.array(expected_single, complex))
    np.testing.assert_array_equal(found[1], np.array(expected, complex))


def test_names_are_given_up_and_the_box_is_complete_all_the_same():
    """128 modes of a rig that took 24,000 steps to name, 32 s: those that are lost are listed without a name."""
    arm = tfarm.load("tests/data/reproductions/laws_24.toml")
    damped = damped_modes(tfarm.modes(arm, 128), steps=1_000)
    inside = np.r_[damped.eigenvalues.ravel(), damped.single, damped.unassigned_pairs.ravel()]
    assert not damped.is_assigned.all()
    assert damped.box.holds(inside).sum() == damped.count
    assert damped.box.im_max > damped.natural_frequency[:100].max()


def test_a_long_list_of_modes_keeps_their_names():
    """40 modes of the lab arm with their eigenvalues, as 20 of them have: a reader's list is followed to its end."""
    lab = tfarm.load("sasaki2012-lab")
    long, short = (damped_modes(tfarm.modes(lab, count)) for count in (40, 20))
    assert long.is_assigned.all()
    np.testing.assert_allclose(long.eigenvalues[: len(short.index)], short.eigenvalues, rtol=1e-9)


def test_a_guess_without_a_slope_is_lost_and_the_others_are_named():
    """In compiled code a complex division by zero is an error: fifteen modes of this rig met one."""
    rig = some_rig(np.random.default_rng(60035))
    assert damped_modes(tfarm.modes(rig, 9)).is_assigned.sum() >= 7


def test_overdamped_modes_beyond_the_list_need_not_be_followed():
    """Without shear s^2 + C w^2 s + w^2 = 0 of each mode: the same zeros."""
    arm = tfarm.load("sasaki2012").with_numbers(damping=1e-3)
    table = tfarm.modes(arm, 7, theory="euler-bernoulli")
    found = damped_modes(table, reach=2.5)
    w = table.natural_frequency[1:]
    assert arm.damping * w[-3] < 2.0
    assert arm.damping * w[-1] > 2.5
    exact = [np.roots([1.0, arm.damping * each**2, each**2]) for each in w]
    exact = [sorted(pair, key=lambda s: (-s.imag, abs(s))) for pair in exact]
    np.testing.assert_allclose(found.eigenvalues[1:], exact, rtol=1e-8)
