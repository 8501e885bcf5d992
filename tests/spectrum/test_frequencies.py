"""Every natural frequency and no other: against a Ritz model, against ball arithmetic, against the count."""

import math

import flint
import numpy as np
import pytest

from tests.models import Ritz
from tests.strategies import BOUNDARY_CASES, some_arm
from tfarm.arm import THEORIES
from tfarm.exact import balls
from tfarm.exact.layout import Layout
from tfarm.exact.system import system_of
from tfarm.spectrum.frequencies import count_below, counts_below, natural_frequencies

EPS = np.finfo(float).eps
UNITS = (1, 2, 4, 8)  # in the last place, between which a sign change is sought


def random_arms(seed, **kind):
    """An arm of each boundary case."""
    rng = np.random.default_rng(seed)
    return [some_arm(rng, case, damping=0.0, **kind) for case in BOUNDARY_CASES]


def test_random_arms_have_the_frequencies_of_a_ritz_model():
    """The first twelve flexible ones, whatever the ends, none missing and none made up.

    Eigenvalues 1/w^2 of the Ritz model are right to some eps of the largest; its own frequencies, converged with 40
    polynomials, come from no count and no search.
    """
    for arm in random_arms(0):
        k, rigid = system_of(arm), arm.has_rigid_mode
        omega = natural_frequencies(k, rigid + 1, rigid + 13)
        flexibility = Ritz(arm).flexibilities()[0][:13]
        rounding = EPS * (2000 + 10 * flexibility[0] / flexibility)
        assert (abs(omega * np.sqrt(flexibility) - 1) <= rounding)[:12].all(), arm
        between = math.sqrt(omega[11] * omega[12])
        assert count_below(k, between) == rigid + 12 == rigid + (flexibility > between**-2).sum(), arm


@pytest.mark.parametrize("theory", THEORIES)
def test_the_list_has_as_many_as_the_count(theory):
    """Below each frequency lie as many as its number less one; just above it as many as its number."""
    for arm in random_arms(100):
        k, rigid = system_of(arm, theory), int(arm.has_rigid_mode)
        omega = natural_frequencies(k, rigid + 1, rigid + 30)
        assert (np.diff(omega) >= 0).all()
        assert (omega > 0).all()
        clear = np.diff(omega) > 1e-8 * omega[1:]
        apart = np.r_[True, clear] & np.r_[clear, False]
        number = np.arange(rigid + 1, rigid + 31)
        below, above = (counts_below(k, omega * (1 + shift)) for shift in (-1e-9, 1e-9))
        np.testing.assert_array_equal(below[apart], number[apart] - 1)
        np.testing.assert_array_equal(above[apart], number[apart])


def test_the_count_never_falls():
    """N(w) on a fine grid, from far below the first frequency to beyond the cut-off."""
    for arm in random_arms(200):
        omega = np.geomspace(1e-3, 2, 2000) * arm.shear_cutoff
        counts = counts_below(system_of(arm), omega)
        assert counts[0] >= arm.has_rigid_mode
        assert (np.diff(counts) >= 0).all()


def sign(k, omega):
    """The sign of the real D(i omega) at an exact point, proven; the precision is raised until it is."""
    bits = 128
    while True:
        with balls.precision(bits):
            drive = balls.Sweep(Layout(k), flint.acb(0, omega)).input.real
            if not drive.contains(0):
                return 1 if drive > 0 else -1
        bits *= 2


def brackets(k, omega, units):
    """Whether D changes sign between `units` units in the last place below and above omega."""
    with balls.precision(256):
        ulp = units * flint.arb(math.ulp(omega))
        ends = flint.arb(omega) - ulp, flint.arb(omega) + ulp
    return sign(k, ends[0]) != sign(k, ends[1])


@pytest.mark.parametrize("slenderness", [(5, 500), (1, 10)])
def test_frequencies_are_right_to_the_last_digits(slenderness):
    """Eight units in the last place at most, and one for nearly all; (1, 10) is mostly above the cut-off."""
    within = []
    for arm in random_arms(5, slenderness=slenderness):
        k, rigid = system_of(arm), arm.has_rigid_mode
        omega = natural_frequencies(k, rigid + 1, rigid + 12).tolist()
        within += [next(n for n in (*UNITS, math.inf) if brackets(k, each, n)) for each in omega]
    assert max(within) <= 8
    assert np.mean(np.array(within) == 1) > 0.9


def test_the_thousandth_mode():
    arm = some_arm(np.random.default_rng(6), ("some", "some", "some"), damping=0.0)
    k = system_of(arm)
    for omega in natural_frequencies(k, 1000, 1004):
        assert brackets(k, float(omega), 8)
