"""The free response of a chain in ball arithmetic: the sweeps of `sweep`, with the error of every number enclosed.

Segments are crossed by their transition functions, entire in s^2/(1 + C s): no wave is separated (see `balls`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any

import flint

from .balls import rational, transition
from .chain import Layout
from .coefficients import EndCondition, Inertia
from .compiled import python_of
from .compound import (
    Plane,
    Row,
    across_rows,
    beyond_body,
    beyond_offset,
    beyond_spring,
    end_plane,
    inside_body,
    inside_offset,
    inside_spring,
    met,
    row_across,
    transition_rows,
)
from .elements import Body, Drive, Element, Mark, Offset, Segment, Spring

_end_plane, _inside_offset, _inside_spring = python_of(end_plane), python_of(inside_offset), python_of(inside_spring)
_inside_body, _across_rows, _transition_rows = (
    python_of(inside_body),
    python_of(across_rows),
    python_of(transition_rows),
)
_beyond_offset, _beyond_spring, _beyond_body = (
    python_of(beyond_offset),
    python_of(beyond_spring),
    python_of(beyond_body),
)
_row_across, _met = python_of(row_across), python_of(met)


def summed(z_sum: Any, z_product: Any, count: int) -> list[Any]:
    """F0..F3 at a segment's end by so many terms of their series in z1 + z2 and z1 z2: `Jet`s, or series of flint."""
    h, before, sums = 0 * z_sum + 1, 0 * z_sum, [0 * z_sum] * 4
    factorial = Fraction(1)
    for n in range(count):
        factorial = factorial / max(1, (2 * n) * (2 * n - 1))  # 1/(2 n)!
        terms = [factorial]
        for shift in (1, 2, 3):
            terms.append(terms[-1] / (2 * n + shift))
        sums = [total + h * rational(term) for total, term in zip(sums, reversed(terms), strict=True)]
        h, before = z_sum * h - z_product * before, h
    return sums


class Sweep:
    """The plane of a layout's chain at the axis and at its marks, at one s (a ball or a series of balls)."""

    def __init__(self, layout: Layout, s: Any, S: Any = None) -> None:
        self.layout, self.s, self.S = layout, s, s * s if S is None else S
        self._rows: dict[Segment, tuple[Row, ...]] = {}
        self.planes: dict[int, Plane] = {}
        p = _end_plane(*self._end(layout.chain.tip_mass), *self._end(layout.chain.tip_inertia))
        for each in layout.elements:
            if isinstance(each, Mark):
                self.planes[each.number] = p
            else:
                p = self._inside(each, p)
        self.theta, self.M, self.Q = p[:3]

    @cached_property
    def input(self) -> Any:
        """What the input must be for this response: zero at a pole."""
        return drive_of(self.layout.chain.drive, self.s, self.theta, self.M, self.exact)

    @cached_property
    def states(self) -> dict[int, Row]:
        """W, Psi, M and Q at each mark."""
        one, none = self.exact(1) + 0 * self.s, 0 * self.s
        f: Row = (one, none, none, none)
        found: dict[int, Row] = {}
        for each in reversed(self.layout.elements):
            if len(found) == len(self.planes):
                break
            if isinstance(each, Mark):
                found[each.number] = _met(f, self.planes[each.number])
            else:
                f = self._beyond(each, f)
        return found

    def output(self, one: Any) -> Any:
        """An output (`chain_values.Reading`) of this response, in SI units."""
        value, exact = self.theta * self.exact(one.theta), self.exact
        if one.is_current:  # what is left of the input after back-EMF turns the hub
            drive = self.layout.chain.drive
            value = (self.input - self.s * exact(drive.back_emf) * value) / (self.s * exact(drive.lag) + 1)
        if one.place is not None:
            mark = self.layout.places.index(one.place)
            for weight, part in zip(one.state, self.states[mark], strict=True):
                value = value + part * exact(weight) if weight else value
            if one.gauge:
                value = value / (self.s * exact(self.layout.read[mark].damping) + 1)
        for _ in range(one.power):
            value = value * self.s
        return value * exact(one.unit)

    def exact(self, number: Any) -> Any:
        """An exact number of an element as one that s can be multiplied by."""
        return rational(number)

    def _end(self, inertia: Inertia) -> tuple[Any, Any]:
        condition = EndCondition.of(inertia)
        return self.S * self.exact(condition.inertia) + self.exact(condition.rest), self.exact(condition.force)

    def _inside(self, element: Element, p: Plane) -> Plane:
        match element:
            case Segment():
                units = tuple(self.exact(unit) for unit in element.units)
                return out_of_own(_across_rows(*self._transition(element), into_own(p, *units)), *units)
            case Offset():
                return _inside_offset(self.exact(element.length), p)
            case Spring():
                return _inside_spring(*self._spring(element), p)
        return _inside_body(*self._body(element), p)

    def _beyond(self, element: Element, f: Row) -> Row:
        match element:
            case Segment():
                w, m, q = (self.exact(unit) for unit in element.units)
                own = _row_across(*self._transition(element), (f[0] / w, f[1], f[2] / m, f[3] / q))
                return own[0] * w, own[1], own[2] * m, own[3] * q
            case Offset():
                return _beyond_offset(self.exact(element.length), f)
            case Spring():
                return _beyond_spring(*self._spring(element), f)
        return _beyond_body(*self._body(element), f)

    def _transition(self, segment: Segment) -> tuple[Row, ...]:
        if segment not in self._rows:
            a, b, g, sigma = (self.exact(number) for number in segment[:4])
            S, over_d = self.S, 1 / (self.s * self.exact(segment.damping) + 1)
            z_sum, z_product = S * (over_d * a + b), S * (S * (a * b) + g) * over_d
            functions = self._functions(z_sum, z_product)
            self._rows[segment] = _transition_rows(*functions, S, over_d, a, b, g, sigma)
        return self._rows[segment]

    def _functions(self, z_sum: Any, z_product: Any) -> tuple[Any, ...]:
        """F0..F3 at the segment's end."""
        return transition(z_sum, z_product, flint.arb(1))

    def _spring(self, spring: Spring) -> tuple[Any, Any]:
        k = self.exact(spring.stiffness)
        return self.s * (k * self.exact(spring.damping)) + k, self.exact(spring.compliance)

    def _body(self, body: Any) -> tuple[Any, Any]:
        assert isinstance(body, Body)
        return (
            self.S * self.exact(body.mass) + self.exact(body.stiffness),
            self.S * self.exact(body.inertia) + self.exact(body.rotational_stiffness),
        )


def into_own(p: Plane, w: Any, m: Any, q: Any) -> Plane:
    """A plane in a segment's own units, which W, M and Q are multiplied by for it (`Segment.units`)."""
    return p[0] * w, p[1] * (w * m), p[2] * m, p[3] * q, p[4] * (m * q)


def out_of_own(p: Sequence[Any], w: Any, m: Any, q: Any) -> Plane:
    """The plane in the chain's units again."""
    return p[0] / w, p[1] / (w * m), p[2] / m, p[3] / q, p[4] / (m * q)


def drive_of(drive: Drive, s: Any, theta: Any, M: Any, number: Callable[[Any], Any] = rational) -> Any:
    """The input behind a response with that hub angle and moment on the hub."""
    A, B = map(number, drive.of_angle), map(number, drive.of_moment)
    A0, A1, A2, A3 = A
    B0, B1 = B
    return (((s * A3 + A2) * s + A1) * s + A0) * theta - (s * B1 + B0) * M
