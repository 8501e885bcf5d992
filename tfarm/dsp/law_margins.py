"""By which factor on a whole law a pole of its sampled loop comes to the unit circle, and how much delay it bears.

On z = e^{iq} the loop is A + g B, A = q(z), B = sum of p_i(z) H_i(z), g the factor: `tfarm.crossing` on the circle.
The grid is that of the plant's poles (`boundary`), with points around each pole and zero of the law.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tfarm.arrays import Complex
from tfarm.crossing import Crossing, Crossings, Window, confirmed
from tfarm.dsp.boundary import (
    BRIGHT,
    NARROWEST_WIDTH,
    WIDTH_SHARE,
    CircleGrid,
    circle_grid,
    crossed_on,
    geometric,
    real_gain,
)
from tfarm.dsp.law_loop import SampledLaw
from tfarm.dsp.law_polynomials import polynomials

LEAST_LAW_FACTOR = 1e-9  # that is looked at: with less a law is none
MOST_LAW_FACTOR = 1e9  # with more its gain is beyond any number
BLURRED = 1e-6  # rad: nearer to z = 1 a polynomial with two roots there is lost in rounding


def law_grid(loop: SampledLaw) -> CircleGrid:
    """The grid of the plant, and points around the poles and zeros of the law."""
    grid = circle_grid(loop)
    q, angles = [], grid.q
    _, entries = polynomials(loop.law)
    zeros = [np.roots(np.trim_zeros(each.coefficients, "f")) for each in entries]
    roots = np.concatenate([loop.law.poles, *zeros])
    for root in roots[(abs(roots) > BRIGHT) & (roots.imag >= 0)]:  # the upper of each pair
        width, at = max(WIDTH_SHARE * abs(1 - abs(root)), NARROWEST_WIDTH), abs(np.angle(root))
        near = geometric(math.pi, width)
        q.append(np.r_[at - near, at + near])
    more = np.concatenate([np.empty(0), *q])
    more = np.unique(more[(more > 0) & (more < math.pi)])
    nearest = np.clip(np.searchsorted(angles, more), 0, angles.size - 1)
    base = np.r_[grid.base, grid.base[nearest]]
    shift = np.r_[grid.shift, more - grid.angles[grid.base[nearest]]]
    order = np.argsort(np.r_[angles, more], kind="stable")
    return CircleGrid(loop, base[order], shift[order])


def crossing_factors(loop: SampledLaw) -> Crossings:
    """The positive factors on the law at which poles are on the circle, `at` which angle [rad a sample].

    A polynomial of the law that vanishes at z = 1 is known to an absolute error alone next to it.
    """
    grid = law_grid(loop)
    whole, entries = polynomials(loop.law)
    if any(each.coefficients.any() and each.at_one(1)[0] for each in (whole, *entries)):
        grid = grid.above(BLURRED)
    found, first = crossed_on(grid, _split)
    (n, open_loop), fed_back = loop.near_one
    lowest = min((order for order, _ in fed_back), default=n + 1)
    if lowest == n:  # A and B go there as the same power of x = 1 - 1/z: a single pole may be at z = 1
        at_one = sum(value for order, value in fed_back if order == lowest)
        found.append(Crossing(real_gain(open_loop, at_one), 0.0, first))
    return Crossings.of(each for each in found if LEAST_LAW_FACTOR < each.t < MOST_LAW_FACTOR)


def _split(terms: tuple[Any, Complex]) -> tuple[Complex, Complex]:
    """A and B times the offset of each point."""
    both = terms[1]
    return both[0], both[1]


def stable_factors(loop: SampledLaw) -> list[Window]:
    """Every open interval of positive factors on the law in which the loop is stable, as its poles confirm."""
    return confirmed(crossing_factors(loop), 0.0, math.inf, lambda factor: loop.times(factor).poles.is_stable)
