"""Every natural frequency and no other: against a Ritz model, against ball arithmetic, against the count."""

import math

import flint
import numpy as np
import pytest
from scipy.optimize import brentq

import tfarm
from tests.models import Ritz
from tests.strategies import BOUNDARY_CASES, arm_of, some_arm
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


def steel(slenderness, *, hub=0.0, mass=math.inf, inertia=0.0):
    return arm_of(
        length=1.0, slenderness=slenderness, width=1.0, density=7800.0, E=2e11, nu=0.3, damping=0.0,
        hub=hub, mass=mass, inertia=inertia,
    )  # fmt: skip


def orthogonality(modes):
    """The largest entry of the flexible modes' mass matrix less the identity."""
    mass = modes._shapes.mass_matrix()
    return abs(mass - np.eye(len(mass))).max()


def pinned_pinned(arm, n):
    """Both frequencies of half wave n: rhoI/kGA w^4 - (1 + q (EI/kGA + rhoI/rhoA)) w^2 + q^2 EI/rhoA = 0."""
    link, q = arm.link, (n * math.pi / arm.link.length) ** 2
    a, b = link.rhoI / link.kGA, 1 + q * (link.EI / link.kGA + link.rhoI / link.rhoA)
    c = q * q * link.EI / link.rhoA
    upper = (b + math.sqrt(b * b - 4 * a * c)) / (2 * a)
    return math.sqrt(c / (a * upper)), math.sqrt(upper)


@pytest.mark.parametrize("slenderness", [1.5, 3.3, 40.0])
def test_pinned_pinned_has_two_spectra_and_the_cut_off(slenderness):
    """In closed form: two frequencies a half wave, and W = 0, Psi = const at the cut-off."""
    arm = steel(slenderness)
    branches = [pinned_pinned(arm, n) for n in range(1, 60)]
    everything = np.sort(np.r_[np.ravel(branches), arm.shear_cutoff])[:50]
    np.testing.assert_allclose(tfarm.modes(arm, 50).natural_frequency, everything, rtol=16 * EPS)


@pytest.mark.parametrize(("bending", "shear"), [(3, 1), (4, 1), (4, 2), (6, 3)])
def test_where_the_two_spectra_cross_both_are_listed(bending, shear):
    """L/h such that half wave `bending` of one spectrum meets half wave `shear` of the other."""

    def gap(slenderness):
        arm = steel(slenderness)
        return pinned_pinned(arm, bending)[0] / pinned_pinned(arm, shear)[1] - 1

    arm = steel(brentq(gap, 1.0, 40.0, xtol=1e-15))
    omega, _ = pinned_pinned(arm, bending)
    k = system_of(arm)
    assert count_below(k, omega * (1 + 1e-12)) - count_below(k, omega * (1 - 1e-12)) == 2
    modes = tfarm.modes(arm, bending + shear + 3)
    pair = abs(modes.natural_frequency / omega - 1) < 1e-14
    assert pair.sum() == 2
    x = np.linspace(0, 1, 9)
    assert orthogonality(modes) < 1e4 * EPS
    shapes = modes.shape(x)[pair]
    for half_waves in (bending, shear):  # both lie in the plane of the two
        wave = np.sin(half_waves * math.pi * x)
        coordinates, *_ = np.linalg.lstsq(shapes.T, wave, rcond=None)
        assert abs(shapes.T @ coordinates - wave).max() < 1e4 * EPS


@pytest.mark.parametrize("inertia", [1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("where", ["hub", "inertia"])
def test_a_light_body_splits_the_crossing(where, inertia):
    """One of the pair can keep its place, the other moves in proportion: right to the last bit at any gap."""

    def gap(slenderness):
        arm = steel(slenderness)
        return pinned_pinned(arm, 4)[0] / pinned_pinned(arm, 1)[1] - 1

    arm = steel(brentq(gap, 1.0, 40.0, xtol=1e-15), **{where: inertia})
    k = system_of(arm)
    omega, _ = pinned_pinned(arm, 4)
    pair = [float(f) for f in natural_frequencies(k, 1, 9) if abs(f / omega - 1) < 2e-3]
    assert len(pair) == 2
    assert all(brackets(k, each, 4) for each in pair)


def clamped(slenderness):
    return steel(slenderness, hub=math.inf, inertia=math.inf)


def test_a_true_crossing_of_symmetric_and_antisymmetric_modes():
    """Clamped at both ends, modes 21 and 22 cross near L/h = 5.957.

    There D(i w) has a double zero, which float64 alone would see to 1e-9 only: half the digits.
    """

    def signed_gap(slenderness):
        modes = tfarm.modes(clamped(slenderness), 22)
        lower, upper = modes.natural_frequency[-2:]
        left, right = modes.shape(np.array([0.3, 0.7]))[-2]
        return math.copysign(upper / lower - 1, left * right)

    crossing = brentq(signed_gap, 5.957, 5.9575, xtol=1e-12)
    left, right = crossing - 1e-8, crossing + 1e-8  # a straight line there, and clear of where rounding has the sign
    crossing = left - signed_gap(left) * (right - left) / (signed_gap(right) - signed_gap(left))
    for away in (1e-11, 1e-9, 1e-7, 1e-5):
        modes = tfarm.modes(clamped(crossing + away), 22)
        lower, upper = modes.natural_frequency[-2:]
        assert upper / lower - 1 == pytest.approx(0.0495276 * away, rel=1e-4, abs=8 * EPS)
        k = system_of(modes.arm)
        assert brackets(k, lower, 8)
        assert brackets(k, upper, 8)
        assert orthogonality(modes) < 1e4 * EPS
    at = tfarm.modes(clamped(crossing), 22)
    assert at.natural_frequency[-1] / at.natural_frequency[-2] - 1 < 8 * EPS
    assert orthogonality(at) < 1e4 * EPS
