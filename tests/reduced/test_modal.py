"""The modal model against contour integrals, identities of the physics, limits, and its own order of convergence."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

import tfarm
from tests.shared import refusal, thinned
from tests.spectrum.test_double import pinned_pinned, steel
from tests.strategies import BOUNDARY_CASES, some_arm
from tfarm import ConvergenceError, Hub, ParameterError
from tfarm.arm import Arm, Link, Section
from tfarm.reduced import modal_model, reduce, relaxed_model, slow_model
from tfarm.response import transfer

pytestmark = pytest.mark.kernels

ENDS = ("hub_angle", "hub_rate", "tip_displacement", "tip_deflection", "tip_acceleration", "root_moment", "root_shear")
ALONG = ("deflection", "rotation", "moment", "shear")
EPS = np.finfo(float).eps


def by_contour(G, p, radius, points=64):
    """(1 / 2 pi i) times the integral of G around p: the trapezoid rule, geometrically convergent."""
    arrow = radius * np.exp(2j * np.pi * (np.arange(points) + 0.5) / points)
    return (G(p + arrow) * arrow).mean(axis=-1)


def by_matrices(model, s):
    """C (s - A)^-1 B + D at s (n,): (outputs, n)."""
    A, B, C, D = model.matrices()
    return (C @ np.linalg.solve(s[:, None, None] * np.eye(len(A)) - A, B) + D)[..., 0].T


def norm_error(model, w):
    """|dG| less what its sum rounds, over |G| + |w G'|: the largest of each output."""
    G, s = tfarm.transfer(model.arm, model.outputs, x=model.x), 1j * w
    exact = G(s)
    gap = abs(model(s) - exact) - 8 * EPS * model.magnitude(s)
    return (gap / (abs(exact) + abs(w * G.derivative(s)))).max(axis=1)


@pytest.mark.parametrize("preset", ["sasaki2012", "sasaki2012-lab", "stocky-steel"])
@pytest.mark.parametrize("names", [ENDS, ALONG])
def test_residues_are_the_contour_integrals_of_the_exact_function(preset, names):
    arm = tfarm.load(preset)
    x = 0.37 * arm.link.length if names is ALONG else None
    model = modal_model(arm, names, 5, x)
    G = tfarm.transfer(arm, names, x=x)
    for k in range(5):
        p, radius = model.eigenvalues[k, 0], 0.2 * model.natural_frequency[0]
        size = abs(G(p + radius)) * radius  # what the integral sums
        assert (abs(by_contour(G, p, radius) - model.residues[:, k, 0]) <= 200 * EPS * size).all()


def test_hub_angle_residues_are_squares_of_the_participation(arm):
    model = modal_model(arm, ("hub_angle", "root_moment"), 20)
    b = tfarm.modes(arm, 20).hub_participation[1:]
    w = model.natural_frequency
    np.testing.assert_allclose(model.residues[0, :, 0] * 2j * w, b**2, rtol=1e-12)
    np.testing.assert_allclose(model.participation, abs(b), rtol=1e-12)
    moment = -arm.hub.inertia * w**2 * b**2  # modal moment -I_h w^2 b, times b
    np.testing.assert_allclose(model.residues[1, :, 0] * 2j * w, moment, rtol=1e-12)


@pytest.mark.parametrize("preset", ["sasaki2012", "sasaki2012-lab"])
def test_the_model_is_exact_at_zero_frequency(preset):
    arm = tfarm.load(preset)
    model = modal_model(arm, ENDS, 3)
    G = tfarm.transfer(arm, ENDS)
    J = arm.total_inertia
    np.testing.assert_allclose(model.rigid[0], [1 / J, 0], rtol=1e-14)
    np.testing.assert_allclose(model.rigid[1], [0, 1 / J], rtol=1e-14)
    s = 1e-5j
    np.testing.assert_allclose(model(s)[5], -(J - arm.hub.inertia) / J, rtol=1e-8)
    np.testing.assert_allclose(model(s), G(s), rtol=1e-8)


def test_state_space_and_partial_fractions_are_one_model(arm, lab):
    for each in (arm, lab, replace(arm, hub=Hub(inertia=math.inf))):
        names = [name for name in ENDS if not (each.is_locked and name == "hub_rate")]
        model = modal_model(each, names, 4)
        assert len(model.states) == model.order
        s = np.array([0.3 + 57.1j, -2.0 + 400j, 12.0])
        np.testing.assert_allclose(by_matrices(model, s), model(s), rtol=1e-10)
        np.testing.assert_allclose(model(np.array([[1j, 2j]]))[:, 0, 1], model(2j))


def test_lossless_to_the_bit_at_no_damping(arm):
    A, _, _, _ = modal_model(arm, "root_moment", 30).matrices()
    assert (A == -A.T).all()


def test_order_of_convergence(arm):
    """The tail of the hub angle: b^2 = (modal moment)^2/(I_h w^2)^2 with moments ~ w and w ~ k^2, so sum of k^-12."""
    w = np.geomspace(0.1, 100, 200)
    errors = [norm_error(modal_model(arm, "hub_angle", count), w)[0] for count in (3, 6, 12)]
    assert all(before / after > 2**8 for before, after in pairwise(errors))


@pytest.mark.parametrize("case", thinned([(each,) for each in BOUNDARY_CASES], 3))
def test_every_boundary_case_converges(case):
    rng = np.random.default_rng([7, *(ord(kind[0]) for kind in case)])
    arm = some_arm(rng, case, damping=0.0)
    names = ("root_moment", "tip_deflection", "root_shear")
    few, many = modal_model(arm, names, 4), modal_model(arm, names, 120)
    w = np.geomspace(0.01, 2.3, 60) * few.natural_frequency[0]
    error, better = norm_error(few, w), norm_error(many, w)
    assert (better <= 0.05 * error + 1e-12).all()


@pytest.mark.parametrize("apart", [1e-7, 0.0])
def test_next_to_another_frequency_a_residue_is_right_and_of_a_double_one_refused(apart):
    """Pinned at both ends, where half wave 4 of one spectrum meets half wave 2 of the other."""

    def crossing(arm):
        """The two frequencies that meet at one slenderness."""
        return pinned_pinned(arm, 4)[0], pinned_pinned(arm, 2)[1]

    arm = steel(brentq(lambda r: np.subtract(*crossing(steel(r))), 1.0, 40.0, xtol=1e-15) * (1 + apart))
    w = crossing(arm)[0]
    outputs = ("hub_angle", "tip_deflection", "root_shear")
    if not apart:
        assert "another one is too close" in str(refusal(modal_model, arm, outputs, 12, kind=ConvergenceError))
        return
    model = modal_model(arm, outputs, 12)
    inside = abs(model.natural_frequency / w - 1) < 1e-6
    G, radius = tfarm.transfer(arm, outputs), 0.01 * w
    size = abs(G(1j * w + radius)) * radius
    assert inside.sum() == 2
    assert (abs(by_contour(G, 1j * w, radius) - model.residues[:, inside, 0].sum(axis=1)) < 1e-7 * size).all()


def test_locked_hub(arm):
    locked = replace(arm, hub=Hub(inertia=math.inf))
    model = modal_model(locked, ("root_moment", "hub_angle"), 10)
    assert model.rigid_states == 0
    np.testing.assert_allclose(model.participation, abs(tfarm.modes(locked, 10).modal_moment), rtol=1e-10)
    np.testing.assert_allclose(model(3.0j)[1], 1.0, rtol=1e-14)
    with pytest.raises(ParameterError, match="hub_rate"):
        modal_model(locked, "hub_rate", 3)


@pytest.mark.parametrize("count", [-1, 1001, 2.5, True, "3"])
def test_count_is_checked(arm, count):
    assert refusal(modal_model, arm, "root_moment", count).key == "count"


@pytest.mark.parametrize("pole", [0, 2])
def test_poles_are_refused(arm, pole):
    model = modal_model(arm, "hub_angle", 2)
    assert "pole" in str(refusal(model, np.r_[0.0, model.eigenvalues.ravel()][pole]))


def test_a_relaxed_model_is_exact_to_first_order(lab):
    """Value and slope at s -> 0 of the root moment, and one more pole, at -1/C."""
    model = relaxed_model(lab, ("root_moment", "tip_deflection"), 4)
    G = tfarm.transfer(lab, model.outputs)
    h = 0.01
    slope = (model(h) - model(-h)) / (2 * h)
    np.testing.assert_allclose(model(1e-6), G.static, rtol=1e-9)
    np.testing.assert_allclose(slope, G.derivative(0.0), rtol=1e-4, atol=1e-9)
    assert (model.order, model.states[-1]) == (9, "relaxation")
    # E/(1 + C s) has the state C x' = u - x
    assert model.matrices()[1][-1, 0] == pytest.approx(1 / lab.damping, rel=1e-15)
    s = np.array([3 + 200j])
    np.testing.assert_allclose(by_matrices(model, s), model(s), rtol=1e-11)


def test_relaxation_goes_where_the_static_remainder_cannot(lab):
    w = np.geomspace(0.1, 1000, 300)
    plain, relaxed = (norm_error(make(lab, "root_moment", 20), w)[0] for make in (modal_model, relaxed_model))
    assert plain > 1e-5
    assert relaxed < 3e-7


@pytest.mark.parametrize(("make", "words"), [(relaxed_model, "nothing relaxes"), (slow_model, "nothing is slow")])
def test_without_damping_nothing_is_slow(make, words, arm):
    assert words in str(refusal(make, arm, "root_moment", 3))


def test_slow_poles_stand_for_the_overdamped_modes_that_are_left_out():
    """A strongly damped rod: modes alone, and one relaxing state, are off by 1e-3; slow poles have seven digits."""
    rod = Section.round(diameter=0.004)
    link = Link(length=0.4, density=1100.0, youngs_modulus=5e6, shear_modulus=1.7e6, damping=2e-3, section=rod)
    arm, names, omega = Arm(link=link, hub=Hub(inertia=1e-4)), ["root_moment", "hub_rate"], np.geomspace(0.5, 300, 160)
    exact = transfer(arm, names)(1j * omega)
    size = abs(exact) + abs(np.gradient(exact, np.log(omega), axis=1))

    def error(model):
        return (abs(model(1j * omega) - exact) / size).max()

    few, slow = modal_model(arm, names, 14), slow_model(arm, names, 14)
    assert min(error(few), error(relaxed_model(arm, names, 14))) > 1e-3
    assert error(slow) < 1e-7
    assert slow.order == few.order + 14
    assert slow(1e-3j)[0] == pytest.approx(transfer(arm, "root_moment")(1e-3j), rel=1e-9)
    assert reduce(arm, names, error=1e-6, band=(0.5, 300.0)).worst_error <= 1e-6
