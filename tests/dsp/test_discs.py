"""Discs about a product's values on the unit circle, and the digits that a proven figure is shown with."""

import math

import mpmath
import numpy as np
import pytest

import tfarm
from tfarm.arm import HubFeedback
from tfarm.dsp import Chain, sampled_loop
from tfarm.dsp.circle import Circle, Discs, _Arcs, product
from tfarm.dsp.edges import Figure

ROOTS = {  # less 1
    "a constant": [],
    "a lag": [-0.3],
    "a notch next to z = 1": [-1e-4 + 1e-3j, -1e-4 - 1e-3j],
    "a cluster next to z = 1": [-1e-4, -1.1e-4, -9e-5 + 1e-5j, -9e-5 - 1e-5j],
    "degree 5": [-2.0, -1.7 + 0.4j, -1.7 - 0.4j, -1.0, 0.2],
}


@pytest.mark.parametrize("half", [1e-6, 1e-3, 0.1, 0.8])
@pytest.mark.parametrize("name", ROOTS)
def test_a_disc_holds_every_value_on_its_arc_and_is_no_larger_than_its_terms(name, half):
    """Values at points of the arc with forty digits; their largest distance from the middle is found, not bounded."""
    roots = np.array(ROOTS[name], dtype=complex)
    angles = np.array([0.0, 1e-4, 0.7, 2.0, math.pi])
    radius = np.full(angles.size, 2 * math.sin(half / 2))
    found = product(Discs(-np.expm1(-1j * angles), radius), roots)
    away = np.zeros(angles.size)
    with mpmath.workdps(40):
        for n, angle in enumerate(angles.tolist()):
            for share in np.linspace(-1, 1, 41).tolist():
                x = 1 - mpmath.expj(-mpmath.mpf(angle) - share * mpmath.mpf(half))
                exact = mpmath.fprod(x * (1 + mpmath.mpc(r)) - mpmath.mpc(r) for r in roots.tolist())
                away[n] = max(away[n], float(abs(exact - mpmath.mpc(found.middle[n].item()))))
    assert (away <= found.radius).all()
    sizes = abs(-np.expm1(-1j * angles)[:, None] * (1 + roots) - roots)
    most = (sizes + radius[:, None] * abs(1 + roots)).prod(axis=1)
    assert (found.radius <= most - sizes.prod(axis=1) + 1e-13 * (1 + most)).all()


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
