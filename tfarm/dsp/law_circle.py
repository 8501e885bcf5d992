"""How many poles a rig under a law in z has outside the unit circle, proven between the points of the circle too.

With x = 1 - 1/z, n the order of the law, q and p_i its polynomials in z, and H_i x^{n_i} the parts of `circle`,

    x^k F z^-n = q z^-n x^k + sum over signals of p_i z^-n x^{k - n_i} (H_i x^{n_i})

is analytic on the circle and outside, and no pole of the law is one of it: its zeros outside are the unstable poles.
Of a root r the factor (z - r)/z is r x + 1 - r.  Those that are x, as of an integrator or a difference, are taken
together, and so is what all terms have of them in common.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tfarm.arrays import Complex
from tfarm.dsp.circle import MACHINE_EPS, Circle, Discs, power
from tfarm.dsp.law_loop import SampledLaw

ROUNDINGS = 8  # of a factor: of its root, of its middle, and of the products


class LawCircle(Circle[SampledLaw]):
    """The upper half of the unit circle in arcs, under a law."""

    @cached_property
    def terms(self) -> list[tuple[int, float, int, int, Complex]]:
        """Of q, whose row is -1, and of each p_i, times z^-n: row, factor, powers of x and of 1/z, roots less 1, not 0.

        The power of x is that of the term less the least of all.
        """
        factors = self.loop.factors
        found = [(-1, 1.0, 0, factors.poles)]
        for part in factors.parts:
            others = [each.poles for each in factors.parts if each is not part]
            for column in part.columns:
                row = factors.signals.index(column.signal)
                found.append((row, column.gain, self.orders[row], np.r_[column.zeros, *others]))
        found = [each for each in found if each[1]]
        powers = [int((roots == 0).sum()) - order for _, _, order, roots in found]
        return [
            (row, gain, exponent - min(powers), factors.poles.size - roots.size, roots[roots != 0])
            for exponent, (row, gain, _, roots) in zip(powers, found, strict=True)
        ]

    def of_law(self) -> Discs:
        """The function on every arc."""
        x = self.parts[0]
        z_inverse, total = Discs(1 - x.middle, x.radius), x.times(0.0)
        for row, gain, exponent, late, roots in self.terms:
            term = power(x, exponent) * product(x, roots) * power(z_inverse, late)
            total = total + (term if row < 0 else term * self.parts[1 + row]).times(gain)
        return total

    def outside(self) -> int | None:
        """Poles of the loop outside the circle, z = 1 of a free angle apart; None if not shown."""
        return self.counted(self.of_law)


def product(x: Discs, roots: Complex) -> Discs:
    """prod((z - r)/z) for x = 1 - 1/z in discs, each root r given as r - 1."""
    factors = x.middle[:, None] * (1 + roots) - roots
    sizes = abs(factors)
    blur = MACHINE_EPS * ROUNDINGS * (abs(x.middle)[:, None] * abs(1 + roots) + abs(roots))
    most = (sizes + x.radius[:, None] * abs(1 + roots) + blur).prod(axis=1)
    return Discs(factors.prod(axis=1), most - sizes.prod(axis=1) + MACHINE_EPS * ROUNDINGS * (1 + roots.size) * most)
