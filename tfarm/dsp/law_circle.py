"""How many poles a rig under a law in z has outside the unit circle, proven between the points of the circle too.

With w = 1/z, x = 1 - w, q~(w) = z^-n q(z) and p~_i(w) = z^-n p_i(z), n the order of the law, and H_i x^{n_i} the parts
of `circle`,

    x^k F z^-n = q~ x^k + sum over signals of p~_i(w) x^{k - n_i} (H_i x^{n_i})

is analytic on the circle and outside, and no pole of the law is one of it: its zeros outside are the unstable poles.  A
p~_i that vanishes at z = 1, as that of a difference does, is divided by x as often as its signal has poles there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from tfarm.arm.blocks import Block, Rational
from tfarm.arm.law import Law
from tfarm.dsp.circle import EPS, Circle, Discs, power
from tfarm.dsp.law_loop import FREE, SampledLaw
from tfarm.records import record

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

CHECKED = 64  # points of half the circle at which coefficients are held against the law's own values
SAFETY = 4.0  # times the largest difference there


@dataclass(frozen=True)
@record
class Polynomial:
    """c_0 + c_1 w + ..., right to `error` on the unit circle."""

    coefficients: Real
    error: float

    def on(self, w: Discs) -> Discs:
        """Its values for w in discs about points of the circle: two terms of Taylor's, the rest bounded."""
        c, j = self.coefficients, np.arange(self.coefficients.size)
        slope = abs(polyval(w.middle, (j * c)[1:])) if c.size > 1 else 0.0
        curve = float((j * (j - 1) * abs(c)).sum()) / 2
        rounding = self.error + EPS * c.size * float(abs(c).sum())
        middle = np.asarray(polyval(w.middle, c), dtype=np.complex128)
        return Discs(middle, w.radius * (slope + w.radius * curve) + rounding)

    def over_x(self) -> Polynomial | None:
        """Itself over 1 - w; None where it does not vanish at w = 1."""
        if abs(self.coefficients.sum()) > FREE * abs(self.coefficients).sum() + self.error:
            return None
        return Polynomial(np.cumsum(self.coefficients)[:-1], self.error * self.coefficients.size)


class LawCircle(Circle[SampledLaw]):
    """The upper half of the unit circle in arcs, under a law."""

    @cached_property
    def reduced(self) -> tuple[Polynomial, list[tuple[int, int, int, Polynomial]]]:
        """q~, and of each signal that is fed back its row, n_i, how often x was taken out of p~_i, and what is left."""
        whole, entries = polynomials(self.loop.law)
        used = []
        for row, (order, entry) in enumerate(zip(self.orders, entries, strict=True)):
            if not entry.coefficients.any():
                continue
            taken, shorter = 0, entry.over_x()
            while taken < order and shorter is not None:
                taken, entry = taken + 1, shorter
                shorter = entry.over_x()
            used.append((row, order, taken, entry))
        return whole, used

    def of_law(self) -> Discs:
        """The function on every arc."""
        x, (whole, used) = self.parts[0], self.reduced
        w = Discs(1 - x.middle, x.radius)
        k = max((order - taken for _, order, taken, _ in used), default=0)
        total = power(x, k) * whole.on(w)
        for row, order, taken, entry in used:
            total = total + power(x, k - order + taken) * entry.on(w) * self.parts[1 + row]
        return total

    def outside(self) -> int | None:
        """Poles of the loop outside the circle, z = 1 of a free angle apart; None if not shown."""
        return self.counted(self.of_law)


def polynomials(law: Law) -> tuple[Polynomial, list[Polynomial]]:
    """q~ of a law in z and p~_i of each of its signals, against its own values on the circle."""
    dens = [np.array(_denominator(part.block)) for part in law.parts]
    n = sum(den.size - 1 for den in dens)
    entries = {name: np.zeros(n + 1) for name in law.signals}
    for i, part in enumerate(law.parts):
        others = _product([den for j, den in enumerate(dens) if j != i])
        for name, num in zip(part.signals, _numerators(part.block, dens[i]), strict=True):
            if name in entries:
                entries[name] += -law.sign * np.convolve(num, others)
    z = np.exp(1j * np.linspace(0, np.pi, CHECKED))
    found, whole = law.polynomials(z)
    turned = z**-n
    return _checked(_product(dens), whole * turned, z), [
        _checked(entries[name], found[row] * turned, z) for row, name in enumerate(law.signals)
    ]


def _checked(coefficients: Real, values: Complex, z: Complex) -> Polynomial:
    """The polynomial in 1/z, its error from values on the circle."""
    there = polyval(1 / z, coefficients)
    return Polynomial(coefficients, SAFETY * float(abs(there - values).max()))


def _product(factors: list[Real]) -> Real:
    total = np.ones(1)
    for factor in factors:
        total = np.convolve(total, factor)
    return total


def _denominator(block: Block) -> Real:
    return np.array(block.den) if isinstance(block, Rational) else np.atleast_1d(np.poly(block.A)).real


def _numerators(block: Block, den: Real) -> list[Real]:
    """Of each signal, as many coefficients as the denominator has: det(z - A + B C) = den (1 + C (z - A)^-1 B)."""
    if isinstance(block, Rational):
        return [np.r_[np.zeros(len(block.den) - len(block.num)), block.num]]
    columns = zip(block.B.T, block.D[0], strict=True)
    return [np.atleast_1d(np.poly(block.A - np.outer(b, block.C[0]))).real + (d - 1) * den for b, d in columns]
