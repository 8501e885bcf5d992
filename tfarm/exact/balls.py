"""The exact solution in ball arithmetic (python-flint): every number has a bound on its error.

With z1 + z2 and z1 z2 from the dispersion relation, the functions F0..F3 of `waves` are the last column of the
exponential of a 4x4 companion matrix.  They are entire in s^2/(1 + C s), without separate waves: the cut-off, equal
waves and low frequencies cost digits alone, and the precision is raised until the required digits are certified.  The
sweeps are those of `sweep`, with the error of every number enclosed.
"""

import math
from collections.abc import Callable, Iterable
from fractions import Fraction
from functools import cached_property
from typing import Any, TypeVar

import flint

from tfarm.exact import sweep, waves
from tfarm.exact.compiled import python_of
from tfarm.exact.layout import KINDS, Layout, OutputFormula
from tfarm.exact.system import Mark, Place, Segment
from tfarm.exact.waves import SolutionPlane, SolutionRow

_end_plane, _met, _across_rows, _row_across = map(
    python_of, (waves.end_plane, waves.met, waves.across_rows, waves.row_across)
)
_transition_rows, across_waves, in_chain = map(
    python_of, (waves.transition_rows, waves.across_waves, waves.in_chain)
)
_inside_element = python_of(sweep.inside)
_beyond_element = python_of(sweep.carry_beyond)
# flint.acb or flint.arb, which come without types
Ball = Any
_Enclosure = TypeVar("_Enclosure")


# flint's working precision [bits], inside a `with` block
precision = flint.ctx.workprec


def first_success(
    bits: Iterable[int], attempt: Callable[[], _Enclosure | None], failure: Exception
) -> _Enclosure:
    """Return the first result other than None of attempts at working precisions [bits].  Raises `failure` else."""
    for working in bits:
        with precision(working):
            if (found := attempt()) is not None:
                return found
    raise failure


def fraction(value: Fraction | float) -> Any:
    """Return a fraction or float as a rational number (`flint.fmpq`)."""
    return flint.fmpq(*value.as_integer_ratio())


def rational(value: Fraction | float) -> Ball:
    """Return the ball of a fraction or float, at the working precision."""
    return flint.arb(fraction(value))


def point(s: complex) -> Ball:
    """Return the exact ball of a complex float."""
    return flint.acb(flint.arb(s.real), flint.arb(s.imag))


def root(z: Ball) -> Ball:
    """Return a square root with its branch cut away from the ball, of either sign, for even functions."""
    if z.real.mid() >= 0:
        return z.sqrt()
    return (-z).sqrt() * flint.acb(0, 1)


def transition(z_sum: Ball, z_product: Ball) -> tuple[Ball, ...]:
    """Return F0..F3, by the two waves where they certainly differ, else by the matrix exponential.

    That is of F'''' = (z1 + z2) F'' - z1 z2 F as a first-order system, with F'''(0) = 1.
    """
    spread = root(z_sum * z_sum / 4 - z_product)
    z1 = z_sum / 2 + spread
    z2 = z_sum / 2 - spread
    if (z1 - z2).contains(0) or z1.contains(0) or z2.contains(0):
        companion = flint.acb_mat([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [-z_product, 0, z_sum, 0]])
        return tuple(row[3] for row in companion.exp().tolist())
    t1 = root(z1)
    t2 = root(z2)
    (h1, c1) = t1.sinh_cosh()
    (h2, c2) = t2.sinh_cosh()
    over = 1 / (z1 - z2)
    return (
        (h1 / t1 - h2 / t2) * over,
        (c1 - c2) * over,
        (t1 * h1 - t2 * h2) * over,
        (z1 * c1 - z2 * c2) * over,
    )


def nearest_float(ball: Ball) -> complex:
    """Return the complex float at the middle of a ball."""
    return complex(float(ball.real.mid()), float(ball.imag.mid()))


def exact_middle(ball: Ball) -> Any:
    """Return the middle of a real ball as a rational number (`flint.fmpq`)."""
    whole, power = ball.mid().man_exp()
    return flint.fmpq(whole) * flint.fmpq(2) ** int(power)


def sum_series(z_sum: Any, z_product: Any, count: int) -> list[Any]:
    """Return F0..F3 at a segment's end by `count` terms of their series in z1 + z2 and z1 z2, series of flint."""
    h = 0 * z_sum + 1
    before = 0 * z_sum
    sums = [0 * z_sum] * 4
    for n in range(count):
        terms = (Fraction(1, math.factorial(2 * n + shift)) for shift in (3, 2, 1, 0))
        sums = [total + h * rational(term) for total, term in zip(sums, terms, strict=True)]
        h, before = z_sum * h - z_product * before, h
    return sums


class Sweep:
    """The plane of a layout at the axis and at its marks, at one s (a ball or a series of balls).

    `exact` converts an exact number to the arithmetic of s.
    """

    exact: Callable[[Any], Any] = staticmethod(rational)

    def __init__(self, layout: Layout, s: Any, S: Any = None) -> None:
        self.layout = layout
        self.s = s
        self.S = s * s if S is None else S
        key = self.exact, flint.ctx.prec
        self.elements, tip_mass, tip_inertia, self.A, self.B = layout.numbers(key, self.exact)
        self._rows: dict[int, tuple[SolutionRow, ...]] = {}
        self.planes: dict[Place, SolutionPlane] = {}
        p = _end_plane(*self._end(tip_mass), *self._end(tip_inertia))
        for each in self.elements:
            if isinstance(each, Mark):
                self.planes[each.place] = self._plane_at_mark(p)
            else:
                p = self._plane_inside(each, p)
        self.theta, self.M, self.Q = p[:3]

    @cached_property
    def input(self) -> Any:
        """The input of this response: zero at a pole."""
        return self.of_angle * self.theta - self.of_moment * self.M

    @property
    def of_angle(self) -> Any:
        """The sum of A_n s^n (see `system`)."""
        s = self.s
        A = self.A
        return ((s * A[3] + A[2]) * s + A[1]) * s + A[0]

    @property
    def of_moment(self) -> Any:
        """The sum of B_n s^n."""
        return self.s * self.B[1] + self.B[0]

    @cached_property
    def states(self) -> dict[Place, SolutionRow]:
        """W, Psi, M and Q at each mark."""
        one = self.exact(1) + 0 * self.s
        none = 0 * self.s
        return self.states_under(self.carry_out((one, none, none, none)))

    def states_under(self, conditions: dict[Place, SolutionRow]) -> dict[Place, SolutionRow]:
        """Return the state of the plane at each mark that satisfies the condition there."""
        return {place: _met(f, self.planes[place]) for place, f in conditions.items()}

    def carry_out(self, f: SolutionRow) -> dict[Place, SolutionRow]:
        """Return the condition f z = 0 of the axis at each mark."""
        found: dict[Place, SolutionRow] = {}
        for each in reversed(self.elements):
            if len(found) == len(self.planes):
                break
            if isinstance(each, Mark):
                found[each.place] = f
            else:
                f = self._row_beyond(each, f)
        return found

    def output(self, one: OutputFormula) -> Any:
        """Return an output of this response, in SI units."""
        value = self.numerator(one)
        if one.C:
            value = value / (self.s * self.exact(one.C) + 1)
        return value

    def numerator(self, one: OutputFormula) -> Any:
        """Return an output times 1 + C s."""
        exact = self.exact
        value = self.theta * exact(one.theta)
        if one.input:
            value = value + self.input * one.input + self.s * self.theta * exact(one.rate)
        if one.place is not None:
            value = value + self.states[one.place][one.field]
        for _ in range(one.power):
            value = value * self.s
        return value * exact(one.unit)

    def _end(self, condition: Any) -> tuple[Any, Any]:
        """Return the factors of motion and force in a condition at the tip."""
        rest, inertia, force = condition
        return self.S * inertia + rest, force

    def _plane_at_mark(self, p: SolutionPlane) -> SolutionPlane:
        """Return the plane in the scale that states at a mark have."""
        return p

    def _plane_inside(self, element: Any, p: SolutionPlane) -> SolutionPlane:
        """Return the plane at the inner end of an element from that at its outer one."""
        if isinstance(element, Segment):
            return _across_rows(*self._transition(element), p)
        return _inside_element(KINDS[type(element)], element, self.s, self.S, p)

    def _row_beyond(self, element: Any, f: SolutionRow) -> SolutionRow:
        """Return the condition at the outer end of an element from that at its inner one."""
        if isinstance(element, Segment):
            return _row_across(*self._transition(element), f)
        return _beyond_element(KINDS[type(element)], element, self.s, self.S, f)

    def _transition(self, segment: Any) -> tuple[SolutionRow, ...]:
        """Return the transition matrix of a segment, computed once."""
        if id(segment) not in self._rows:
            l = segment.length
            (over_d, z_sum, z_product) = self._sums(segment)
            F0, F1, F2, F3 = self._functions(z_sum, z_product)
            functions = F0 * (l * l * l), F1 * (l * l), F2 * l, F3
            over_EI = over_d / segment.stiffness
            self._rows[id(segment)] = _transition_rows(functions, self.S, over_EI, segment.of_chain)
        return self._rows[id(segment)]

    def _sums(self, segment: Any) -> tuple[Any, Any, Any]:
        """Return 1/d, z_1 + z_2 and z_1 z_2 of a segment."""
        a, b, g = segment[:3]
        S = self.S
        over_d = 1 / (self.s * segment.damping + 1)
        return over_d, S * (over_d * a + b), S * (S * (a * b) + g) * over_d

    def _functions(self, z_sum: Any, z_product: Any) -> tuple[Any, ...]:
        """Return F0..F3 at the segment's end."""
        return transition(z_sum, z_product)
