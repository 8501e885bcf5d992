"""Cowper's shear factors by a road the code does not take: his flexure problem of elasticity, by collocation.

Cowper (1966), bending about y, depth along x: chi is harmonic,

    d chi/dn = -n_x (nu/2 x^2 + (1 - nu/2) y^2) - n_y (2 + nu) x y    on the boundary,
    K = 2 (1 + nu) Iy / ( nu/2 (Ix - Iy) - A/Iy Int x (chi + x y^2) dA ).

chi is fitted as a sum of Re z^n, n odd (also negative in a tube).
"""

import numpy as np
import pytest

from tfarm.arm import Section

EPS = 2.0**-52
GAUSS, WEIGHT = np.polynomial.legendre.leggauss(40)


def elastic_shear_factor(nu, boundary, area_rule, powers):
    """K, and the worst miss of the boundary condition."""
    x, y, nx, ny = boundary
    X, Y, dA = area_rule
    slopes = np.stack([(n * (x + 1j * y) ** (n - 1) * (nx + 1j * ny)).real for n in powers], axis=1)
    wanted = -nx * (nu / 2 * x**2 + (1 - nu / 2) * y**2) - ny * (2 + nu) * x * y
    amplitudes = np.linalg.lstsq(slopes, wanted, rcond=None)[0]
    chi = sum(a * ((X + 1j * Y) ** n).real for a, n in zip(amplitudes, powers, strict=True))
    A, Ix, Iy = dA.sum(), (dA * Y**2).sum(), (dA * X**2).sum()
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


SECTIONS = {
    "round": (Section.round(diameter=2), annulus(1, 0), (1, 3)),
    "tube": (Section.tube(outer_diameter=2, inner_diameter=1), annulus(1, 0.5), (1, 3, -1, -3)),
    "thin tube": (Section.tube(outer_diameter=2, inner_diameter=1.9), annulus(1, 0.95), (1, 3, -1, -3)),
    "square": (Section.rectangle(depth=2, width=2), rectangle(2, 2), range(1, 40, 2)),
    "deep rectangle": (Section.rectangle(depth=2, width=1), rectangle(2, 1), range(1, 40, 2)),
    "flat rectangle": (Section.rectangle(depth=1, width=2), rectangle(1, 2), range(1, 40, 2)),
}


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("case", SECTIONS)
def test_cowper_1966_from_elasticity(case, nu):
    """To rounding where the fit is exact, or else to its worst miss, at a rectangle's corners."""
    section, rules, powers = SECTIONS[case]
    K, miss = elastic_shear_factor(nu, *rules, powers)
    assert section.cowper_factor(nu) == pytest.approx(K, rel=miss + 256 * EPS)
