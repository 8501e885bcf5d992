"""What a law does to every mode of any rig, by its sign alone: passivity and negative imaginary systems.

A hub torque does work on its own angle: the transfer function from torque to hub rate is positive real (passive) for
any rig, with any losses.  So a positive real law on the rate cannot drive a mode, and where no mode hides from the hub
and the law takes energy at every frequency, it damps each one.  To the angle the same rig is negative imaginary, and a
law u = -C theta with -C strictly negative imaginary leaves it stable if and only if k_theta + C(0) > 0 (Lanzon and
Petersen 2008; positive position feedback is of that kind).

Both need hub torque on the hub's own angle or rate, no delay, no inductance, no sampling.  The signs of real
polynomials are decided in exact arithmetic, by Sturm's theorem: no frequency is passed over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from tfarm.arm import Law
from tfarm.arm.blocks import Rational
from tfarm.records import record

if TYPE_CHECKING:
    Poly = Any  # of sympy, over the rationals: it comes without types, and is imported where it is used

MOST_EXACT_DEGREE = 40  # degree: exact arithmetic with such polynomials takes a moment


@dataclass(frozen=True)
@record
class Signs:
    """What a law in s on hub angle and hub rate is: its `kind`, and in words why.

    "strictly passive": Re of the law on the rate is above 0 at all frequencies; "passive": nowhere below;
    "negative imaginary": -C strictly so on the angle, with C(0) = `at_rest` [N m/rad]; "" where none of these is shown.
    """

    kind: Literal["strictly passive", "passive", "negative imaginary", ""]
    reason: str
    at_rest: float = 0.0


def signs_of(law: Law, friction: float = 0.0) -> Signs:
    """The sign of a law, with the hub's friction [input per rad/s] counted to it."""
    if law.delay:
        return Signs("", "a delay turns every sign with frequency")
    if law.is_discrete or not set(law.signals) <= {"hub_angle", "hub_rate"}:
        return Signs("", "the sign of a law tells something where it reads the hub's own angle or rate")
    if not all(isinstance(part.block, Rational) for part in law.parts):
        return Signs("", "matrices are not looked at: give transfer functions")
    if law.order > MOST_EXACT_DEGREE:
        return Signs("", f"of a law of more than {MOST_EXACT_DEGREE} states the sign is not looked for")
    num, den = polynomial([0.0]), polynomial([1.0])  # of the whole law as one fraction on the angle
    for part in law.parts:
        assert isinstance(part.block, Rational)  # seen above
        p, q = polynomial(part.block.num) * -law.sign, polynomial(part.block.den)
        if part.signals == ("hub_rate",):
            p = p * polynomial([1.0, 0.0])
        num, den = num * q + p * den, den * q
    return (
        _positive_real(num + polynomial([friction, 0.0]) * den, den)
        or _negative_imaginary(num, den)
        or Signs("", "neither passive nor negative imaginary")
    )


def _positive_real(num: Poly, den: Poly) -> Signs | None:
    """Whether C(s)/s, the law on the rate, is positive real, and with Re > 0 on the whole axis but 0; None if not.

    It is if Re >= 0 on the axis, no pole lies right of it, and those on it are simple with a residue above 0: of these
    only one at 0 is granted, the C(0) of an angle that is held.
    """
    at_rest = num.eval(0) / den.eval(0) if den.eval(0) else None
    if at_rest is None or not is_hurwitz(den) or at_rest < 0:
        return None
    if num.degree() > den.degree() + 2 or (num.degree() == den.degree() + 2 and num.LC() / den.LC() < 0):
        return None
    sign = definite(on_axis(num, den)[1])  # Re C(i w)/(i w) = Im C(i w)/w
    if sign == "above":
        words = "the law on the hub's rate takes energy at every frequency (strictly positive real)"
        return Signs("strictly passive", words, float(at_rest))
    if sign:
        words = "the law on the hub's rate gives energy at no frequency (positive real)"
        return Signs("passive", words, float(at_rest))
    return None


def _negative_imaginary(num: Poly, den: Poly) -> Signs | None:
    """Whether -C is strictly negative imaginary on the angle: C stable and proper, Im C(i w) > 0 for all w > 0."""
    if not is_hurwitz(den) or num.degree() > den.degree() or definite(on_axis(num, den)[1]) != "above":
        return None
    words = "the law on the hub's angle, with its sign changed, is strictly negative imaginary"
    return Signs("negative imaginary", words, float(num.eval(0) / den.eval(0)))


# ------------------------------------------------------------ polynomials, exactly


def polynomial(coefficients: Sequence[float]) -> Poly:
    """The polynomial in w with these doubles as coefficients, descending, exactly."""
    from sympy import QQ, Poly, Rational, Symbol

    return Poly([Rational(*float(each).as_integer_ratio()) for each in coefficients], Symbol("w"), domain=QQ)


def on_axis(num: Poly, den: Poly) -> tuple[Poly, Poly]:
    """Real part, and imaginary part over w, of num(i w) conj den(i w): polynomials in v = w^2."""
    (a, b), (c, d) = _split(num), _split(den)
    v = polynomial([1.0, 0.0])
    return a * c + v * b * d, b * c - a * d


def _split(poly: Poly) -> tuple[Poly, Poly]:
    """p(i w) = a(v) + i w b(v), v = w^2."""
    ascending = poly.all_coeffs()[::-1]
    even, odd = ([(-1) ** n * each for n, each in enumerate(ascending[k::2])][::-1] or [0] for k in (0, 1))
    return poly.from_list(even, *poly.gens, domain=poly.domain), poly.from_list(odd, *poly.gens, domain=poly.domain)


def definite(poly: Poly) -> Literal["above", "not below", "zero", ""]:
    """The sign of a polynomial on v > 0: "above" 0 everywhere, "not below" it, "zero", or "" where it is below."""
    if poly.is_zero:
        return "zero"
    if poly.LC() < 0:
        return ""
    factors = poly.sqf_list()[1]
    with_roots = [order for each, order in factors if int(each.count_roots(0, None)) > int(each.eval(0) == 0)]
    if any(order % 2 for order in with_roots):
        return ""
    return "not below" if with_roots else "above"


def is_hurwitz(poly: Poly) -> bool:
    """Whether all roots lie left of the axis, by Routh's table."""
    row, other = poly.all_coeffs()[0::2], poly.all_coeffs()[1::2]
    if not row[0]:
        return False
    while other:
        if not other[0] * row[0] > 0:
            return False
        padded = [*other, 0]
        rest = [row[n + 1] - row[0] / other[0] * padded[n + 1] for n in range(len(row) - 1)]
        row, other = other, rest
    return True
