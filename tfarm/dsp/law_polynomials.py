"""The polynomials of a law in z, in powers of w = 1/z, with what they may be wrong by on the unit circle.

q~(w) = z^-n q(z) and p~_i(w) = z^-n p_i(z), n the order of the law, q its common denominator and p_i/q its entries.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyval

from tfarm.arm import Law
from tfarm.arm.blocks import LawBlock, Rational
from tfarm.arrays import Complex, Real
from tfarm.records import record

VANISHED = 1e-12  # of its terms: what is left of a sum that should be 0, states of a law of order ten
CHECKED = 64  # points of half the circle at which coefficients are held against the law's own values
SAFETY = 4.0  # times the largest difference there


@dataclass(frozen=True)
@record
class Polynomial:
    """c_0 + c_1 w + ..., right to `error` on the unit circle."""

    coefficients: Real
    error: float

    def over_x(self) -> Polynomial | None:
        """Itself over 1 - w; None where it does not vanish at w = 1."""
        if abs(self.coefficients.sum()) > VANISHED * abs(self.coefficients).sum() + self.error:
            return None
        return Polynomial(np.cumsum(self.coefficients)[:-1], self.error * self.coefficients.size)

    def at_one(self, most: int) -> tuple[int, Polynomial]:
        """How often 1 - w divides it, at most so often, and what is left."""
        taken, left = 0, self
        while taken < most and (shorter := left.over_x()) is not None:
            taken, left = taken + 1, shorter
        return taken, left


def polynomials(law: Law) -> tuple[Polynomial, list[Polynomial]]:
    """q~ of a law in z and p~_i of each of its signals, against its own values on the circle."""
    blocks = [part.block for part in law.parts]
    dens = [
        np.array(each.den) if isinstance(each, Rational) else np.atleast_1d(np.poly(each.A)).real for each in blocks
    ]
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


def _numerators(block: LawBlock, den: Real) -> list[Real]:
    """Of each signal, as many coefficients as the denominator has: det(z - A + B C) = den (1 + C (z - A)^-1 B)."""
    if isinstance(block, Rational):
        return [np.r_[np.zeros(len(block.den) - len(block.num)), block.num]]
    columns = zip(block.B.T, block.D[0], strict=True)
    return [np.atleast_1d(np.poly(block.A - np.outer(b, block.C[0]))).real + (d - 1) * den for b, d in columns]
