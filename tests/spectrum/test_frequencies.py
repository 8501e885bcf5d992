"""Every natural frequency and no other: against a Ritz model, against ball arithmetic, against the count."""

import numpy as np
import pytest

from tests.spectrum.ritz import (
    SLENDERNESS,
    against_count,
    against_ritz,
    arms_for_places,
    brackets,
    last_places,
    random_arms,
)
from tests.strategies import some_arm
from tfarm.arm import THEORIES
from tfarm.exact.system import system_of
from tfarm.spectrum.frequencies import Counter, natural_frequencies

EPS = np.finfo(float).eps


def test_random_arms_have_the_frequencies_of_a_ritz_model():
    """The first twelve flexible ones, whatever the ends.  `python -m tests.spectrum.ritz 1000` for more."""
    for arm in random_arms(0, 27):
        assert not against_ritz(arm), arm


@pytest.mark.parametrize("theory", THEORIES)
def test_the_list_has_as_many_as_the_count(theory):
    """Below each frequency lie as many as its number less one; just above it as many as its number."""
    for arm in random_arms(100, 27):
        assert not against_count(arm, theory), arm


def test_the_count_never_falls():
    """N(w) on a fine grid, from far below the first frequency to beyond the cut-off."""
    for arm in random_arms(200, 27):
        omega = np.geomspace(1e-3, 2, 2000) * arm.shear_cutoff
        counts = Counter(system_of(arm))(omega)
        assert counts[0] >= arm.has_rigid_mode
        assert (np.diff(counts) >= 0).all()


@pytest.mark.parametrize("slenderness", SLENDERNESS)
def test_frequencies_are_right_to_the_last_digits(slenderness):
    """Eight units in the last place at most, and one for nearly all; (1, 10) is mostly above the cut-off."""
    within = [units for arm in arms_for_places(slenderness, 27) for units in last_places(arm)]
    assert max(within) <= 8
    assert np.mean(np.array(within) == 1) > 0.9


def test_the_thousandth_mode():
    arm = some_arm(np.random.default_rng(6), ("some", "some", "some"), damping=0.0)
    k = system_of(arm)
    for omega in natural_frequencies(k, 1000, 1004):
        assert brackets(k, float(omega), 8)
