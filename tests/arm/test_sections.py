import math
from dataclasses import replace

import numpy as np
import pytest

from tfarm.arm import Section
from tfarm.errors import ParameterError

EPS = 2.0**-52


def test_a_thin_tube_keeps_its_digits():
    """Wall t: A -> pi D t, I -> pi D^3 t/8, with relative corrections t/D and 3 t/D; no cancellation."""
    D, t = 1.0, 2.0**-30
    tube = Section.tube(outer_diameter=D, inner_diameter=D - 2 * t)
    assert tube.area == pytest.approx(math.pi * (D - t) * t, rel=4 * EPS)
    assert tube.second_moment == pytest.approx(math.pi * D**3 * t / 8 * (1 - 3 * t / D), rel=1e-15)


rectangle_of, tube_of, general_of = Section.rectangle, Section.tube, Section.general
BAD = {  # pattern of the message
    "link.section.width = 0.*positive, finite": lambda: rectangle_of(width=0, depth=1),
    "link.section.diameter = nan.*nan is none": lambda: Section.round(diameter=math.nan),
    "inner_diameter = 0.1: .*less than its outer diameter, 0.1 m": lambda: tube_of(
        outer_diameter=1e-1, inner_diameter=0.1
    ),
    "link.section.area = 0.*positive, finite area": lambda: general_of(area=0, second_moment=1e-9, shear_factor=0.8),
    "second_moment = -1e-09.*in m.4": lambda: general_of(area=1e-4, second_moment=-1e-9, shear_factor=0.8),
    "shear_factor is missing.*0.8333": lambda: Section(shape="general", area=1e-4, second_moment=1e-9),
    "shear_factor = 1.2.*6/5 is entered as 5/6": lambda: rectangle_of(width=1, depth=1, shear_factor=1.2),
    "shear_factor = 0.0.*above 0, up to 1": lambda: rectangle_of(width=1, depth=1, shear_factor=0.0),
    "shape = 'rond'.*did you mean .round.\\?": lambda: Section(shape="rond", area=1, second_moment=1),
    "dimensions = ...*outer_diameter and inner_diameter": lambda: Section(shape="tube", area=1, second_moment=1),
    "link.section.area = 1.0.*Section.general": lambda: replace(Section.round(diameter=0.1), area=1.0),
    "second_moment.*check the unit": lambda: Section.round(diameter=1e-12),
}


@pytest.mark.parametrize("message", BAD)
def test_a_bad_section_is_refused_in_words_of_physics(message):
    with pytest.raises(ParameterError, match=message):
        BAD[message]()


GAUSS, WEIGHT = np.polynomial.legendre.leggauss(40)


def elastic_shear_factor(section, nu, boundary, area_rule, powers):
    """K, and the worst miss of the boundary condition, by collocation; area and second moment by quadrature.

    Cowper (1966), bending about y, depth along x: chi is harmonic,

        d chi/dn = -n_x (nu/2 x^2 + (1 - nu/2) y^2) - n_y (2 + nu) x y    on the boundary,
        K = 2 (1 + nu) Iy / ( nu/2 (Ix - Iy) - A/Iy Int x (chi + x y^2) dA ).

    chi is fitted as a sum of Re z^n, n odd (also negative in a tube).
    """
    x, y, nx, ny = boundary
    X, Y, dA = area_rule
    slopes = np.stack([(n * (x + 1j * y) ** (n - 1) * (nx + 1j * ny)).real for n in powers], axis=1)
    wanted = -nx * (nu / 2 * x**2 + (1 - nu / 2) * y**2) - ny * (2 + nu) * x * y
    amplitudes = np.linalg.lstsq(slopes, wanted, rcond=None)[0]
    chi = sum(a * ((X + 1j * Y) ** n).real for a, n in zip(amplitudes, powers, strict=True))
    A, Ix, Iy = dA.sum(), (dA * Y**2).sum(), (dA * X**2).sum()
    assert (section.area, section.second_moment) == pytest.approx((A, Iy), rel=64 * EPS)
    K = 2 * (1 + nu) * Iy / (nu / 2 * (Ix - Iy) - A / Iy * (dA * X * (chi + X * Y**2)).sum())
    return K, np.abs(slopes @ amplitudes - wanted).max()


def annulus(outer, inner):
    """Boundary points with normals, and a quadrature rule, for radii outer > inner >= 0."""
    t = 2 * np.pi * np.arange(64) / 64
    rims = [(outer * np.cos(t), outer * np.sin(t), np.cos(t), np.sin(t))]
    if inner > 0:
        rims.append((inner * np.cos(t), inner * np.sin(t), -np.cos(t), -np.sin(t)))
    r = inner + (outer - inner) * (GAUSS + 1) / 2
    dA = np.outer(np.full(64, 2 * np.pi / 64), WEIGHT * (outer - inner) / 2 * r)
    boundary = [np.concatenate(parts) for parts in zip(*rims, strict=True)]
    return boundary, (np.outer(np.cos(t), r), np.outer(np.sin(t), r), dA)


def rectangle(depth, width):
    """The same for a rectangle: the sides at x = +-depth/2 and y = +-width/2."""
    a, b, one, zero = depth / 2, width / 2, np.ones(40), np.zeros(40)
    sides = [(a * one, b * GAUSS, one, zero), (a * GAUSS, b * one, zero, one)]
    sides += [tuple(-part for part in side) for side in sides]
    X, Y = np.meshgrid(a * GAUSS, b * GAUSS)
    boundary = [np.concatenate(parts) for parts in zip(*sides, strict=True)]
    return boundary, (X, Y, a * b * np.outer(WEIGHT, WEIGHT))


ELASTIC = {
    "round": (Section.round(diameter=2), annulus(1, 0), (1, 3)),
    "tube": (Section.tube(outer_diameter=2, inner_diameter=1), annulus(1, 0.5), (1, 3, -1, -3)),
    "thin tube": (Section.tube(outer_diameter=2, inner_diameter=1.9), annulus(1, 0.95), (1, 3, -1, -3)),
    "square": (Section.rectangle(depth=2, width=2), rectangle(2, 2), range(1, 40, 2)),
    "deep rectangle": (Section.rectangle(depth=2, width=1), rectangle(2, 1), range(1, 40, 2)),
    "flat rectangle": (Section.rectangle(depth=1, width=2), rectangle(1, 2), range(1, 40, 2)),
}


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("case", ELASTIC)
def test_cowper_1966_from_elasticity(case, nu):
    """To rounding where the fit is exact, or else to its worst miss, at a rectangle's corners."""
    section, rules, powers = ELASTIC[case]
    K, miss = elastic_shear_factor(section, nu, *rules, powers)
    assert section.cowper_factor(nu) == pytest.approx(K, rel=miss + 256 * EPS)
