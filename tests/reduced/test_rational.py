"""AAA in s^2: the target of accuracy, losslessness, what the checks are for, and a function with known poles."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import tfarm
from tests.reduced.test_modal import norm_error
from tests.shared import refusal
from tests.strategies import some_arm
from tfarm import Hub, Payload
from tfarm.reduced import modal_model, rational_model, reduce
from tfarm.reduced.rational import aaa_poles

pytestmark = pytest.mark.kernels

HUB = ("root_moment", "hub_rate", "hub_angle")
ALL = (*HUB, "tip_displacement", "tip_deflection", "tip_acceleration", "root_shear")


def test_each_pair_of_poles_brings_digits(arm):
    w = np.linspace(1, 1000, 3001)
    errors = [norm_error(rational_model(arm, HUB, pairs, 1000.0), w).max() for pairs in (4, 5, 6, 7)]
    assert errors[0] < 1e-2
    assert all(after < 1e-2 * before for before, after in pairwise(errors))
    assert errors[3] < 1e-12


def test_lossless_to_the_bit(arm):
    """Poles on the axis, residues of the hub rate positive, and C = B' in energy coordinates (collocated)."""
    model = rational_model(arm, ("hub_rate", "hub_angle"), 6, 1000.0)
    assert (model.eigenvalues.real == 0).all()
    assert (model.residues[0].imag == 0).all()
    assert (model.residues[0].real > 0).all()  # b^2/2 of the rate at either pole
    A, B, C, D = model.matrices()
    flexible = A[2:, 2:]
    assert (flexible == -flexible.T).all()
    np.testing.assert_allclose(C[0, 2:], B[2:, 0], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(C[1, 2::2] * model.natural_frequency, B[3::2, 0], rtol=1e-12)  # rate of that angle
    assert (D == 0).all()


def test_modes_of_the_band_are_the_arm_s_own(arm):
    model = rational_model(arm, ALL, 7, 1000.0)
    own = model.index > 0
    exact = modal_model(arm, ALL, 3)
    assert list(model.index[:3]) == [1, 2, 3]
    assert (model.eigenvalues[own][:3] == exact.eigenvalues).all()
    assert (model.residues[:, :3] == exact.residues).all()
    assert (model.natural_frequency[~own] > 1000).all()


@pytest.mark.parametrize("seed", range(8))
def test_random_arms(seed):
    """At least as good as the modal model of the same order, lossless, and exact as s -> 0."""
    rng = np.random.default_rng(seed)
    arm = some_arm(rng, damping=0.0)
    names = ["root_moment", "tip_deflection", *([] if arm.is_locked else ["hub_rate"])]
    high = 0.7 * float(tfarm.modes(arm, 2).natural_frequency[-1])
    pairs = tfarm.spectrum.modes_below(arm, 1.02 * high) + 3
    model = rational_model(arm, names, pairs, high)
    w = np.linspace(0.05, 1.0, 500) * high
    assert (norm_error(model, w) <= norm_error(modal_model(arm, names, pairs), w) + 1e-12).all()
    assert (model.eigenvalues.real == 0).all()
    np.testing.assert_allclose(model(1e-4j * high), tfarm.transfer(arm, names)(1e-4j * high), rtol=1e-5)


def test_more_poles_than_digits_do_no_harm(arm):
    """Froissart doublets are dropped: further modes are taken exactly instead."""
    for order in (18, 24, 30):
        reduced = reduce(arm, HUB, order=order, method="aaa")
        assert reduced.worst_error < 2e-13
        assert reduced.order <= order
        assert reduced.order == order or "passed the checks" in reduced.note


def test_locked_hub_and_pinned_tip(arm):
    locked = replace(arm, hub=Hub(inertia=math.inf))
    assert reduce(locked, ("root_moment", "tip_displacement"), order=14).worst_error < 1e-6
    pinned = replace(arm, payload=Payload(mass=math.inf))
    assert reduce(pinned, ("hub_rate", "root_moment"), order=14).worst_error < 1e-7


def test_aaa_finds_the_poles_of_a_rational_function():
    """A Stieltjes function of three poles, sampled without noise, is recovered with its poles."""
    S = -np.linspace(0.01, 1.0, 200)
    poles, shares = np.array([1.5, 4.0, 30.0]), np.array([1.0, 0.3, 7.0])
    F = np.array([(shares * S[:, None] / (S[:, None] + poles)).sum(axis=1)])
    *_, found = aaa_poles(S, F, np.ones_like(F), 3)
    np.testing.assert_allclose(found, poles, rtol=1e-7)


@pytest.mark.parametrize(
    ("C", "pairs", "high", "key"), [(1e-4, 6, 1e3, "method"), (0, 3, 1e3, "pairs"), (0, 6, 1e9, "band")]
)
def test_what_is_refused(arm, C, pairs, high, key):
    assert refusal(rational_model, arm.with_numbers(damping=C), HUB, pairs, high).key == key
