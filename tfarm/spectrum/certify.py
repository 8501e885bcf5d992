"""Proofs: every frequency enclosed, none missing, in ball arithmetic (python-flint).

Three facts together prove a list of n frequencies complete:

* n disjoint brackets, at both ends of which the sign of the real characteristic function D(i w) is certain and
  differs, hold at least one frequency each;
* one count N(w) just above the last bracket, each of whose signs and half waves is certain (see `counting` for
  why it is a count), says that n lie below w, a rigid-body mode included;
* so each bracket holds exactly one.

A ball that is too wide to decide makes the precision grow, and if that does not help it is an error: there
is no silent downgrade.  Exactly double frequencies change no sign and cannot be certified so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from tfarm.errors import CertificationError
from tfarm.exact.balls import precision, rational
from tfarm.exact.system import System
from tfarm.records import record

from .ball_axis import RealAxis, axis_precisions, secant

COUNTED_AT = tuple(Fraction(*share) for share in ((1, 2), (2, 5), (3, 5), (1, 7), (6, 7)))  # of a gap: tried in turn
COUNTING_BITS = (128, 512, 4096)  # of working precision, tried there: a count is certain unless it is on a half wave


@dataclass(frozen=True, slots=True)
@record
class Certificate:
    """Brackets (lower, upper) as decimal strings, and the count below a frequency that proves them complete."""

    brackets: tuple[tuple[str, str], ...]
    count: int
    below: str


def certify(k: System, omega: NDArray[np.float64], above: float, digits: int, rigid: int) -> Certificate:
    """Prove that the frequencies omega (ascending) are all there are below a point before `above`, the next one.

    Raises CertificationError saying what could not be proven.
    """
    k = k.with_damping(0.0)
    brackets = [_bracket(k, float(each), digits) for each in omega]
    for (_, upper), (lower, _), each in zip(brackets, brackets[1:], omega, strict=False):
        if upper > lower:
            raise CertificationError(
                f"the brackets of two frequencies near {each:.10g} rad/s overlap: ask for more digits"
            )
    count, below = _count_above(k, brackets[-1][1], above)
    if count != len(brackets) + rigid:
        raise CertificationError(
            f"{len(brackets) + rigid} frequencies were enclosed, but {count} lie below {below} rad/s"
        )
    texts = tuple((_text(lower), _text(upper)) for lower, upper in brackets)
    return Certificate(texts, count, below)


def _bracket(k: System, omega: float, digits: int) -> tuple[Fraction, Fraction]:
    """Neighbouring decimals of so many digits with a proven sign change of D between them."""
    exponent = math.floor(math.log10(omega)) - digits + 1
    unit = Fraction(10) ** exponent
    for bits in axis_precisions(digits):
        with precision(bits):
            axis = RealAxis(k)
            root = secant(axis, omega, digits)
            if root is None:
                continue
            number = (root / rational(unit)).floor().unique_fmpz()
            if number is None:
                continue
            lower, upper = int(number) * unit, (int(number) + 1) * unit
            if axis.drive(rational(lower)) * axis.drive(rational(upper)) < 0:
                return lower, upper
    raise CertificationError(
        f"no proven sign change in {digits} digits near {omega:.15g} rad/s: a double or a very close pair"
    )


def _count_above(k: System, last: Fraction, above: float) -> tuple[int, str]:
    """A proven count somewhere between the last bracket and the next frequency, and where."""
    gap = Fraction(above) - last
    for share in COUNTED_AT:
        point = Fraction(float(last + gap * share))
        for bits in COUNTING_BITS:
            with precision(bits):
                count = RealAxis(k).count(rational(point)) if point > last else None
                if count is not None:
                    return count, repr(float(point))
    raise CertificationError(f"no proven count between {float(last):.10g} and {above:.10g} rad/s")


def _text(value: Fraction) -> str:
    """An exact decimal string."""
    exponent = 0
    while value.denominator != 1:
        value, exponent = value * 10, exponent - 1
    digits = str(value.numerator)
    if not exponent:
        return digits
    digits = digits.rjust(1 - exponent, "0")
    return f"{digits[:exponent]}.{digits[exponent:]}"
