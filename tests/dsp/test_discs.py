"""Discs about a polynomial's values on the unit circle, and the digits that a proven figure is shown with."""

import math

import mpmath
import numpy as np
import pytest

import tfarm
from tfarm.arm import HubFeedback
from tfarm.dsp import Chain, sampled_loop
from tfarm.dsp.circle import Circle, Discs, _Arcs
from tfarm.dsp.law_circle import on_discs
from tfarm.dsp.law_polynomials import Polynomial
from tfarm.dsp.shown import Figure

RANDOM = np.random.default_rng(5).normal(size=6)
POLYNOMIALS = {
    "a constant": [3.0],
    "a line": [0.5, -2.0],
    "at rest twice": [1.0, -2.0, 1.0],  # (1 - w)^2: next to w = 1 all is curvature
    "degree 5": RANDOM.tolist(),
}


@pytest.mark.parametrize("half", [1e-3, 0.1, 0.8])
@pytest.mark.parametrize("name", POLYNOMIALS)
def test_a_disc_holds_every_value_on_its_arc_and_is_no_larger_than_its_terms(name, half):
    """Values by Horner's rule at points of the arc; their largest distance from the middle is found, not bounded."""
    c = np.array(POLYNOMIALS[name])
    middle = np.exp(1j * np.array([0.0, 0.7, 2.0, math.pi]))
    radius = np.full(4, 2 * math.sin(half / 2))
    found = on_discs(Polynomial(c, 0.0), Discs(middle, radius))
    points = middle[:, None] * np.exp(1j * np.linspace(-half, half, 401))
    away = abs(np.polyval(c[::-1], points) - found.middle[:, None]).max(axis=1)
    assert (away <= found.radius).all()
    rounding = 1e-14 * abs(c).sum()
    least = abs(np.polyval(np.polyder(c[::-1]), middle)) * radius if c.size > 1 else np.zeros(4)
    curve = half**2 * (np.arange(c.size) ** 2 * abs(c)).sum()
    assert (found.radius <= least + curve + rounding).all()


def test_the_error_of_its_coefficients_is_in_the_disc():
    exact, off = on_discs(Polynomial(RANDOM, 0.0), ONE), on_discs(Polynomial(RANDOM, 0.25), ONE)
    np.testing.assert_allclose(off.radius - exact.radius, 0.25, rtol=1e-12)


ONE = Discs(np.array([1.0 + 0j]), np.array([0.1]))


@pytest.mark.parametrize(
    ("figure", "sharp"),
    [
        (Figure(1.2345, 4, 500.0, None), [3, 4]),
        (Figure(1.2345, 4, None, 12), []),  # of the first modes alone: no digit is proven
        (Figure(0.0, 0, 500.0, None), [3, 4, 5]),  # nothing is left to be rounded
    ],
)
def test_a_figure_is_sharp_in_the_digits_that_are_proven(figure, sharp):
    assert [digits for digits in (3, 4, 5) if figure.is_sharp(digits)] == sharp


def test_a_disc_about_a_point_is_as_wide_as_rounding_next_to_a_pole_too():
    """The sum of r/(z - e^{pT}) with forty digits, z from 1e-9 rad beside a pole on."""
    arm, T = tfarm.load("sasaki2012-lab"), 0.01
    loop = sampled_loop(arm, HubFeedback(), Chain(), count=3)
    plant = loop.plant
    q = np.angle(loop.pulse.multipliers[0]) + np.array([1e-9, 1e-5, 0.3])
    circle = Circle(loop, np.ones(plant.poles.size, bool), np.zeros(3))
    found = circle._summed(_Arcs(q, q), plant.poles, plant.residues)
    with mpmath.workdps(40):
        z = [mpmath.expj(mpmath.mpf(each)) for each in q]
        b = [mpmath.exp(mpmath.mpc(each) * T) for each in plant.poles]
        for row, n in np.ndindex(found.middle.shape):
            exact = mpmath.fsum(r / (z[n] - each) for r, each in zip(plant.residues[row].tolist(), b, strict=True))
            assert abs(found.middle[row, n] - exact) <= found.radius[row, n]
    assert (found.radius < 1e-4 * abs(found.middle)).all()
