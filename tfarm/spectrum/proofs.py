"""Proofs in ball arithmetic (python-flint): every frequency or eigenvalue enclosed, none missing.

Three facts prove a list of n natural frequencies complete:

* n disjoint brackets have at least one frequency each, as the sign of the real characteristic function D(i w) is
  certain at both ends and differs;
* one count N(w) just above the last bracket, with certain signs and half waves (see `frequencies`), is n, the
  rigid-body mode included;
* so each bracket has exactly one.

Where a ball is too wide the precision grows, up to an error.  Exactly double frequencies change no sign and cannot be
certified so.

Off the axis there are two more:

*One zero in a disc.*  On |s - m| <= r the function differs from its tangent at m by no more than |D''/2| r^2, with D''
enclosed over the disc.  If |D'(m)| r exceeds that and |D(m)| together, D has by Rouche's theorem as many zeros in the
disc as the tangent: one.  A disc around a real m holds a real one, since zeros come in conjugate pairs.

*The number in a box.*  The argument principle on its upper half, the lower being a mirror image: the contour is cut
into pieces so short that D, enclosed over each, is off zero.  Then it is in a half-plane, and the change of its
argument is the principal argument of end over start.  The sum over the half contour encloses pi times one integer.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import combinations, pairwise
from typing import Annotated

import flint
import numpy as np
from numpy.typing import NDArray

from tfarm.errors import CertificationError
from tfarm.exact.balls import Ball, exact_middle, first_success, point, precision, rational
from tfarm.exact.characteristic import Feedback, characteristic_over, tangent
from tfarm.exact.system import System
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.box import Box
from tfarm.spectrum.frequencies import RealAxis, axis_precisions, secant


@frozen(slots=True)
class Certificate:
    """Brackets (lower, upper) as decimal strings, and the count below a frequency that proves them complete."""

    brackets: tuple[tuple[str, str], ...]
    count: Annotated[int, Quantity("frequencies in all", help="certified count, with the rigid-body mode")]
    below: Annotated[str, Quantity("below", "rad/s", help="frequency at which they are counted")]


def certify(k: System, omega: NDArray[np.float64], above: float, digits: int, rigid: int) -> Certificate:
    """Certify that the frequencies omega (ascending) are all those below a point before `above`, the next one.

    Raises CertificationError with the fact that failed.
    """
    k = k.with_damping(0.0)
    brackets = [_bracket(k, float(each), digits) for each in omega]
    for (_, upper), (lower, _), each in zip(brackets, brackets[1:], omega, strict=False):
        if upper > lower:
            raise CertificationError(
                f"the brackets of two frequencies near {each:.10g} rad/s overlap: more digits are needed"
            )
    count, below = _count_above(k, brackets[-1][1], above)
    if count != len(brackets) + rigid:
        raise CertificationError(
            f"{len(brackets) + rigid} frequencies were enclosed, but {count} lie below {below} rad/s"
        )
    texts = tuple((_text(lower), _text(upper)) for lower, upper in brackets)
    return Certificate(texts, count, below)


def _bracket(k: System, omega: float, digits: int) -> tuple[Fraction, Fraction]:
    """Return neighbouring decimals of that many digits with a certified sign change of D between them."""
    exponent = math.floor(math.log10(omega)) - digits + 1
    axis = RealAxis(k)
    unit = Fraction(10) ** exponent

    def attempt() -> tuple[Fraction, Fraction] | None:
        root = secant(axis, omega, digits)
        if root is None:
            return None
        number = (root / rational(unit)).floor().unique_fmpz()
        if number is None:
            return None
        lower = int(number) * unit
        upper = (int(number) + 1) * unit
        if axis.drive(rational(lower)) * axis.drive(rational(upper)) < 0:
            return (lower, upper)
        return None

    text = (
        f"no certified sign change in {digits} digits near {omega:.15g} rad/s: a double or a very close pair"
    )
    return first_success(axis_precisions(digits), attempt, CertificationError(text))


def _count_above(k: System, last: Fraction, above: float) -> tuple[int, str]:
    """Return a certified count between the last bracket and the next frequency, and its frequency."""
    # of working precision there: a count is certain unless it is on a half wave
    counting_bits = (128, 512, 4096)
    axis = RealAxis(k)
    gap = Fraction(above) - last
    # shares of the gap
    for share in ("1/2", "2/5", "3/5", "1/7", "6/7"):
        point = Fraction(float(last + gap * Fraction(share)))
        if point <= last:
            continue
        for bits in counting_bits:
            with precision(bits):
                count = axis.count(rational(point))
            if count is not None:
                return count, repr(float(point))
    raise CertificationError(f"no certified count between {float(last):.10g} and {above:.10g} rad/s")


def _text(value: Fraction) -> str:
    """Return a positive number as an exact decimal string."""
    # of an exact decimal: more than any bracket has
    most_decimals = 20_000
    with localcontext(prec=most_decimals):
        return f"{Decimal(value.numerator) / value.denominator:f}"


@dataclass(frozen=True, slots=True)
class Disc:
    """A closed disc of the complex plane with exactly one zero, a simple one: middle and radius as decimal strings."""

    re: Annotated[str, Quantity("Re s", "1/s", help="real part of the middle of the disc", key="re")]
    im: Annotated[str, Quantity("Im s", "rad/s", help="imaginary part of the middle of the disc", key="im")]
    radius: Annotated[str, Quantity("radius", "1/s", help="of a disc with exactly one eigenvalue")]

    @property
    def is_real(self) -> bool:
        """Whether the zero is real, to the last digit."""
        return float(self.im) == 0


def proven_count(k: System, box: Box, law: Feedback | None = None, *, most_pieces: int = 6000) -> int:
    """Return the certified number of zeros of D in a box symmetric about the real axis, with multiplicity.

    Zeros at s = 0 are included.  Each side of the contour has at most `most_pieces`, some 10 s of CPU time; the presets
    need up to 2,000.  Raises CertificationError where a zero is too near the contour, for too many pieces,
    and with -1/C inside.
    """
    if k.damping and box.re_min <= -1.0 / k.damping:
        raise CertificationError(f"a box from {box.re_min:g} 1/s on contains the accumulation point -1/C")
    turned = edge_change(lambda s: characteristic_over(k, s, law), box, most_pieces)
    number = (turned / flint.arb.pi()).unique_fmpz()
    if number is None:
        raise CertificationError("the change of arg D around the box is no certain multiple of pi")
    return int(number)


def edge_change(value_over: Callable[[Ball], Ball], box: Box, most_pieces: int = 6000) -> Ball:
    """Return the change of the argument along the upper half of the edge of a box, where a function is off zero.

    `value_over` encloses it over a ball.  Raises CertificationError as `proven_count` does.
    """
    right = box.re_max
    left = box.re_min
    top = box.im_max
    corners = [complex(right, 0), complex(right, top), complex(left, top), complex(left, 0)]
    # 96 of working precision along a contour
    with precision(96):
        turned = flint.arb(0)
        for a, b in pairwise(corners):
            turned += _argument_change(value_over, point(a), point(b), most_pieces)
    return turned


def _argument_change(value_over: Callable[[Ball], Ball], a: Ball, b: Ball, most_pieces: int) -> Ball:
    """Return the change of the argument along the side from a to b."""
    # 1 / 32 of a side of the contour, before adaptation: time alone
    total = flint.arb(0)
    start = 0.0
    step = 1 / 32
    pieces = 0
    here = a
    value = value_over(a)
    while start < 1:
        end = min(start + step, 1.0)
        there = (a + (b - a) * end).mid()
        over = value_over(here.union(there))
        pieces += 1
        if pieces > most_pieces:
            raise CertificationError(
                f"the edge of the box needs more than {most_pieces} pieces: certify a shorter list"
            )
        if not over.is_finite() or over.contains(0):
            step /= 2
            # 2.0 ** (-26): share of a side of the contour: a shorter piece means a zero on it
            if step < 2.0 ** (-26):
                raise CertificationError(f"a zero lies on the edge of the box, near {complex(here):.6g}")
            continue
        end_value = value_over(there)
        total += (end_value / value).log().imag
        start = end
        here = there
        value = end_value
        # after a good one; tuned: with 2 every second step was too long
        step *= 1.125
    return total


def enclose_zero(k: System, near: complex, digits: int, law: Feedback | None = None) -> Disc:
    """Return a disc with one zero, its radius one unit in the last of `digits` significant digits of |s| or less.

    Raises CertificationError where none is certified, as around a double zero.
    """

    def attempt() -> Disc | None:
        middle = _newton(k, law, near, digits)
        if middle is None:
            return None
        exponent = math.floor(math.log10(abs(complex(middle.mid())))) - digits + 1
        unit = Fraction(10) ** exponent
        exact = (exact_middle(part) for part in (middle.real, middle.imag))
        re, im = (round(Fraction(int(part.p), int(part.q)) / unit) for part in exact)
        centre = flint.acb(rational(re * unit), rational(im * unit))
        if not _holds_one(k, law, centre, rational(unit)):
            return None
        re_text, im_text = (f"{Decimal(f'{number}E{exponent}'):f}" for number in (re, im))
        return Disc(re_text, im_text, f"{float(unit):.0e}")

    text = f"no certified disc of {digits} digits around {near:.12g} 1/s: a double zero, or close to one"
    return first_success(axis_precisions(digits), attempt, CertificationError(text))


def _newton(k: System, law: Feedback | None, near: complex, digits: int) -> Ball | None:
    """Return the zero by Newton's method on the middles of balls, or None; real starts stay real."""
    s = point(near)
    # 40 of Newton's method on middles of balls, at most: each doubles the digits
    for _ in range(40):
        parts = tangent(k, s, flint.arb(0), law)
        if parts is None or parts[1].contains(0):
            return None
        move = (parts[0] / parts[1]).mid()
        s = (s - move).mid()
        if near.imag == 0:
            s = flint.acb(s.real)
        # 3 digits of its convergence beyond those of the disc
        if abs(move) < abs(s) * rational(Fraction(1, 10 ** (digits + 3))):
            return s
    return None


def _holds_one(k: System, law: Feedback | None, m: Ball, r: Ball) -> bool:
    """Whether the disc of radius r around m has one zero, by Rouche's theorem with the tangent at m."""
    parts = tangent(k, m, r, law)
    if parts is None:
        return False
    value, slope, half_curvature = (abs(part) for part in parts)
    return bool(slope * r > value + half_curvature * r * r)


def disjoint(discs: Sequence[Disc]) -> bool:
    """Whether no two discs touch."""
    parts = [(Fraction(d.re), Fraction(d.im), Fraction(d.radius)) for d in discs]
    return all((x - u) ** 2 + (y - v) ** 2 > (r + q) ** 2 for (x, y, r), (u, v, q) in combinations(parts, 2))
