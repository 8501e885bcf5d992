"""How many poles a rig under a law in z has outside the unit circle, proven between the points of the circle too.

With w = 1/z, x = 1 - w, q~(w) = z^-n q(z) and p~_i(w) = z^-n p_i(z), n the order of the law, and H_i x^{n_i} the parts
of `circle`,

    x^k F z^-n = q~ x^k + sum over signals of p~_i(w) x^{k - n_i} (H_i x^{n_i})

is analytic on the circle and outside, and no pole of the law is one of it: its zeros outside are the unstable poles.
q~ and p~_i that vanish at z = 1, as of an integrator or a difference, are divided by x, and so are all terms at last.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.polynomial.polynomial import polyval

from tfarm.dsp.circle import MACHINE_EPS, Circle, Discs, power
from tfarm.dsp.law_loop import SampledLaw
from tfarm.dsp.law_polynomials import Polynomial, polynomials


class LawCircle(Circle[SampledLaw]):
    """The upper half of the unit circle in arcs, under a law."""

    @cached_property
    def reduced(self) -> list[tuple[int, int, Polynomial]]:
        """Of q~, whose row is -1, and of the p~_i of each row: the power of x of its term, and what is left of it."""
        whole, entries = polynomials(self.loop.law)
        terms = [(-1, 0, whole), *((row, self.orders[row], each) for row, each in enumerate(entries))]
        used = []
        for row, order, each in terms:
            if each.coefficients.any():
                taken, left = each.at_one(self.loop.law.order)
                used.append((row, taken - order, left))
        least = min(power for _, power, _ in used)
        return [(row, power - least, left) for row, power, left in used]

    def of_law(self) -> Discs:
        """The function on every arc."""
        x = self.parts[0]
        w = Discs(1 - x.middle, x.radius)
        total = x.times(0.0)
        for row, exponent, left in self.reduced:
            term = power(x, exponent) * on_discs(left, w)
            total = total + (term if row < 0 else term * self.parts[1 + row])
        return total

    def outside(self) -> int | None:
        """Poles of the loop outside the circle, z = 1 of a free angle apart; None if not shown."""
        return self.counted(self.of_law)


def on_discs(polynomial: Polynomial, w: Discs) -> Discs:
    """Its values for w in discs about points of the circle: two terms of Taylor's, the rest bounded."""
    c, j = polynomial.coefficients, np.arange(polynomial.coefficients.size)
    slope = abs(polyval(w.middle, (j * c)[1:])) if c.size > 1 else 0.0
    curve = float((j * (j - 1) * abs(c)).sum()) / 2
    rounding = polynomial.error + MACHINE_EPS * c.size * float(abs(c).sum())
    middle = np.asarray(polyval(w.middle, c), dtype=np.complex128)
    return Discs(middle, w.radius * (slope + w.radius * curve) + rounding)
