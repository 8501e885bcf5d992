"""By which factor on a whole law, or on one of its parts, a pole of its sampled loop comes to the unit circle.

On z = e^{iq} the loop is A + g B, A = q(z), B = sum of p_i(z) H_i(z), g the factor: `tfarm.crossing` on the circle.
With a factor on one part the others are in A.  The grid is that of the plant's poles (`boundary`), with points around
each pole and zero of the law.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
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

LEAST_LAW_FACTOR = 1e-9  # that is looked at: with less a law is none
MOST_LAW_FACTOR = 1e9  # with more its gain is beyond any number


def law_grid(loop: SampledLaw) -> CircleGrid:
    """The grid of the plant, and points around the poles and zeros of the law."""
    grid = circle_grid(loop)
    q, angles = [], grid.q
    roots = 1 + np.r_[loop.factors.poles, loop.factors.zeros]
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
    """The positive factors on the law at which poles are on the circle, `at` which angle [rad a sample]."""
    found = part_crossings(law_grid(loop), range(len(loop.law.parts)))
    return Crossings.of(each for each in found if each.t > LEAST_LAW_FACTOR)


def part_crossings(grid: CircleGrid, varied: Sequence[int]) -> Crossings:
    """Where poles are on the circle as one factor, of either sign, grows on some parts of the law, the others held."""
    loop = grid.loop
    assert isinstance(loop, SampledLaw)
    places = range(len(loop.law.parts))
    held = [0, *(1 + place for place in places if place not in varied)]
    moved = [1 + place for place in varied]

    def split(terms: tuple[Any, Complex]) -> tuple[Complex, Complex]:
        """A and B times the offset of each point, of its rows: q, then each part."""
        return terms[1][held].sum(axis=0), terms[1][moved].sum(axis=0)

    found, first = crossed_on(grid, split)
    others, alone = (
        loop.near_one([place for place in places if (place in varied) == is_varied]) for is_varied in (False, True)
    )
    lowest, at_one = _lowest([others[0], *others[1]])
    least, moving = _lowest(alone[1])
    if least <= lowest:  # A and B go there as the same power of x = 1 - 1/z, or A as a higher one: it is there at 0
        found.append(Crossing(real_gain(at_one, moving) if least == lowest else 0.0, 0.0, first))
    return Crossings.of(each for each in found if abs(each.t) < MOST_LAW_FACTOR)


def _lowest(terms: Sequence[tuple[int, float]]) -> tuple[float, float]:
    """The lowest power of x in a sum of c x^n, and its coefficient."""
    lowest = min((order for order, _ in terms), default=math.inf)
    return lowest, sum(value for order, value in terms if order == lowest)


def stable_factors(loop: SampledLaw) -> list[Window]:
    """Every open interval of positive factors on the law in which the loop is stable, as its poles confirm."""
    return confirmed(crossing_factors(loop), 0.0, math.inf, lambda factor: loop.times(factor).poles.is_stable)


def stable_numbers(loop: SampledLaw) -> dict[str, list[Window]]:
    """Every open interval of each of `Law.part_gains`, the others held, in which the loop is stable, by its name."""
    grid, places, found = law_grid(loop), range(len(loop.law.parts)), {}
    for name, (part, value) in loop.asked.part_gains.items():
        if not value:
            continue

        def holds(factor: float, part: int = part) -> bool:
            return loop.weighted([factor if place == part else 1.0 for place in places]).poles.is_stable

        windows = confirmed(part_crossings(grid, [part]), -math.inf, math.inf, holds)
        found[name] = sorted(min((value * low, value * high), (value * high, value * low)) for low, high in windows)
    return found
