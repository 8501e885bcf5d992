"""Every natural frequency and no other: against a Ritz model, against ball arithmetic, against the count."""

import math
from dataclasses import replace

import flint
import numpy as np
import pytest

import tfarm
from tests.models import Ritz
from tests.strategies import BOUNDARY_CASES, some_arm
from tfarm import Hub
from tfarm.exact import balls
from tfarm.exact.coefficients import THEORIES, coefficients
from tfarm.spectrum.counting import Counter
from tfarm.spectrum.search import count_below, natural_frequencies

EPS = np.finfo(float).eps
BATCHES = 5


def random_arms(batch, count):
    """Each boundary case in turn."""
    rng = np.random.default_rng(batch)
    return [some_arm(rng, BOUNDARY_CASES[(batch + i) % len(BOUNDARY_CASES)], damping=0.0) for i in range(count)]


@pytest.mark.parametrize("batch", range(BATCHES))
def test_random_arms_have_the_frequencies_of_a_ritz_model(batch):
    """The first twelve flexible ones: so none is missing and none is made up, whatever the ends.

    Eigenvalues 1/w^2 of the Ritz model are right to some eps of the largest; its own frequencies, converged with 40
    polynomials, come from no count and no search.  `python -m tests.spectrum.proofs 1000` for more.
    """
    for arm in random_arms(batch, 270 // BATCHES):
        k, rigid = coefficients(arm), arm.has_rigid_mode
        omega = natural_frequencies(k, rigid + 1, rigid + 13)
        flexibility = Ritz(arm).flexibilities()[0][:13]
        rounding = EPS * (2000 + 10 * flexibility[0] / flexibility)
        wrong = abs(omega * np.sqrt(flexibility) - 1) > rounding
        assert not wrong[:12].any(), f"mode {np.nonzero(wrong)[0] + 1} of {arm}"
        between = math.sqrt(omega[11] * omega[12])
        assert count_below(k, between) == rigid + 12 == rigid + (flexibility > between**-2).sum()


@pytest.mark.parametrize("theory", THEORIES)
@pytest.mark.parametrize("batch", range(2))
def test_the_list_is_what_the_count_says(batch, theory):
    """Below each frequency lie as many as its number less one; just above it as many as its number."""
    for arm in random_arms(100 + batch, 135):
        k, rigid = coefficients(arm, theory), int(arm.has_rigid_mode)
        omega = natural_frequencies(k, rigid + 1, rigid + 30)
        assert (np.diff(omega) >= 0).all()
        assert (omega > 0).all()
        apart = np.r_[True, np.diff(omega) > 1e-8 * omega[1:]] & np.r_[np.diff(omega) > 1e-8 * omega[1:], False]
        number = np.arange(rigid + 1, rigid + 31)
        count = Counter(k)
        assert (count(omega * (1 - 1e-9))[apart] == number[apart] - 1).all()
        assert (count(omega * (1 + 1e-9))[apart] == number[apart]).all()


def test_the_count_never_falls():
    """N(w) on a fine grid, from far below the first frequency to beyond the cut-off."""
    for arm in random_arms(200, 54):
        omega = np.geomspace(1e-3, 2, 2000) * arm.shear_cutoff
        counts = Counter(coefficients(arm))(omega)
        assert counts[0] >= arm.has_rigid_mode
        assert (np.diff(counts) >= 0).all()


def sign(k, omega):
    """The sign of the real D(i omega) at an exact point, proven; the precision is raised until it is."""
    bits = 128
    while True:
        with balls.precision(bits):
            drive = balls.State(k, flint.acb(0, omega)).input.real
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
    rng, within = np.random.default_rng(5), []
    for i in range(81):
        arm = some_arm(rng, BOUNDARY_CASES[i % 27], damping=0.0, slenderness=slenderness)
        k, rigid = coefficients(arm), arm.has_rigid_mode
        omega = natural_frequencies(k, rigid + 1, rigid + 12)
        within += [next(n for n in (1, 2, 4, 8, math.inf) if brackets(k, float(each), n)) for each in omega]
    assert max(within) <= 8
    assert np.mean(np.array(within) == 1) > 0.9


def test_the_thousandth_mode():
    arm = some_arm(np.random.default_rng(6), ("some", "some", "some"), damping=0.0)
    k = coefficients(arm)
    for omega in natural_frequencies(k, 1000, 1004):
        assert brackets(k, float(omega), 8)


def test_poles_and_zeros_of_the_hub_angle_interlace():
    """Holding the hub moves every frequency up, but not beyond the next one."""
    for arm in random_arms(300, 54):
        if not arm.is_locked:
            locked = replace(arm, hub=Hub(inertia=math.inf))
            poles, zeros = (natural_frequencies(coefficients(each), 1, 25) for each in (arm, locked))
            slack = 1 + 16 * EPS  # a mode that the hub does not feel is both
            assert (poles <= zeros * slack).all()
            assert (zeros[:-1] <= poles[1:] * slack).all()


def test_only_a_zero_of_the_hub_angle_vanishes_there():
    """At a hub-locked frequency the hub does not answer a torque: theta is as small there as its slope allows."""
    arm = some_arm(np.random.default_rng(8), ("some", "some", "zero"), damping=0.0)
    G = tfarm.transfer(arm, "hub_angle")
    for omega in natural_frequencies(coefficients(replace(arm, hub=Hub(inertia=math.inf))), 1, 8):
        assert abs(G(1j * omega)) <= 16 * EPS * omega * abs(G.derivative(1j * omega))
