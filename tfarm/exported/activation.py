"""exp and log of an exported tuner: the functions that its C source has too, operation by operation.

    e^x = 2^k e^r,   k = x/ln 2 to the nearest whole number,   r = (x - k h) - k l,   |r| <= ln(2)/2

with ln 2 = h + l, h of so few bits that k h is exact (Cody and Waite, Software Manual for the Elementary Functions,
1980), e^r by Taylor's polynomial, coefficients 1/n!, and 2^k as a product of powers of 1/2.

    ln(1 + y) = n ln 2 + 2 atanh s,   2 atanh s = f - s (f - R),   s = f/(2 + f),   R = sum over j >= 1 of 2 s^2j/(2j + 1)

with n = 0, f = y, or from y = sqrt(2) - 1 on n = 1, f = (y - 1)/2 (the form of FDLIBM's e_log.c).  The coefficients
are those of the two series, rounded to the precision; their first terms left out are below a tenth of its half unit.

The largest errors are `ULPS` units in the last place.  Every number has one precision: literals of Python would make
doubles of single-precision operands.
"""

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from tfarm.arrays import Real
from tfarm.exact.compiled import compiled

ULPS = {"exp": 1.5, "log": 2.0}  # bounds of the errors: of e^x, x from `lowest` to 0, and of ln(1 + y), y from 0 to 1
LN_2 = Fraction(math.log(2.0)) + Fraction(2319046813846299558, 10**35)  # 35 digits: math.log(2) and its remainder


class Activation(NamedTuple):
    """Constants of `exponential` and `logarithm` in one precision.

    e^x is 0 up to `lowest`; adding and subtracting `shift` rounds to a whole number; ln 2 = `high` + `low`; series in
    ascending order.
    """

    zero: float
    half: float
    one: float
    two: float
    lowest: float
    shift: float
    inverse: float
    high: float
    low: float
    turn: float
    taylor: Real
    atanh: Real


def activation(real: Any) -> Activation:
    """The constants for np.float64 or np.float32."""
    is_double = real is np.float64
    bits, lowest, terms, odd = (42, -708.0, 14, 10) if is_double else (16, -87.0, 8, 4)
    high = Fraction(round(LN_2 * 2**bits), 2**bits)
    shift = 1.5 * 2 ** np.finfo(real).nmant
    scalars = 0.0, 0.5, 1.0, 2.0, lowest, shift, 1 / math.log(2.0), high, LN_2 - high, math.sqrt(2.0) - 1
    taylor = [1 / math.factorial(n) for n in range(terms)]
    return Activation(
        *(real(float(each)) for each in scalars),
        np.array(taylor, dtype=real),
        np.array([2 / (2 * j + 1) for j in range(1, odd + 1)], dtype=real),
    )


@compiled
def polynomial(x: float, coefficients: Real) -> float:
    """The sum of coefficients[n] x^n, by Horner's rule."""
    total = coefficients[coefficients.size - 1]
    for n in range(coefficients.size - 2, -1, -1):
        total = total * x + coefficients[n]
    return total


@compiled
def exponential(x: float, of: Activation) -> float:
    """e^x for x <= 0; NaN stays NaN."""
    if not x > of.lowest:
        return of.zero if x == x else x
    k = (x * of.inverse + of.shift) - of.shift
    result = polynomial((x - k * of.high) - k * of.low, of.taylor)
    power, n = of.half, int(-k)
    while n > 0:  # at most ten times
        if n % 2 == 1:
            result *= power
        power *= power
        n //= 2
    return result


@compiled
def logarithm(y: float, of: Activation) -> float:
    """ln(1 + y) for 0 <= y <= 1."""
    is_small = y < of.turn
    f = y if is_small else of.half * (y - of.one)
    s = f / (of.two + f)
    square = s * s
    below = s * (f - square * polynomial(square, of.atanh))
    return f - below if is_small else of.high + (f - (below - of.low))


@compiled
def sigmoid(z: float, of: Activation) -> float:
    """1/(1 + e^-z)."""
    small = exponential(-z if z > of.zero else z, of)
    return (of.one if z > of.zero else small) / (of.one + small)


@compiled
def softplus(z: float, of: Activation) -> float:
    """ln(1 + e^z)."""
    is_positive = z > of.zero
    tail = logarithm(exponential(-z if is_positive else z, of), of)
    return z + tail if is_positive else tail
