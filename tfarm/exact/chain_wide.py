"""The free response of a chain over a whole piece of a contour: `wide_balls` for segment after segment.

A fast segment is crossed by its two waves, kept apart and scaled; a slow one by the power series of its transition
functions, whose tail is bounded.  Everything is a Taylor series in s, with balls for coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import flint

from .balls import Ball, rational
from .chain import ElementChain
from .chain_balls import Sweep, drive_of, into_own, out_of_own, summed
from .chain_values import readings
from .compiled import python_of
from .compound import Plane, Row, across_waves, transition_rows
from .elements import Element, Segment
from .outputs import Output

Series = Any  # flint.acb_series, which comes without types
Waves = Callable[[Segment, Series, Series], tuple[tuple[Series, ...], tuple[Series, ...]] | None]

_across_waves, _transition_rows = python_of(across_waves), python_of(transition_rows)

SLOW_WAVES = 6.0  # |z1| + |z2| below which a segment is crossed by power series
WIDE_TERMS = 40  # of them: of arguments up to twice that the tail is below 1e-60


class InseparableError(Exception):
    """Two waves of a segment may be one over this ball, or a wave has no definite square root there."""


class WideSweep(Sweep):
    """The sweep at a Taylor series s; `phase` is the series of t1 + t2 of all segments that waves have crossed."""

    def __init__(self, layout: Any, s: Series, waves: Waves) -> None:
        self._waves, self.phase = waves, 0 * s
        super().__init__(layout, s)

    def _inside(self, element: Element, p: Plane) -> Plane:
        if not isinstance(element, Segment) or self._is_slow(element):
            return super()._inside(element, p)
        units = tuple(rational(unit) for unit in element.units)
        a, b, g = (rational(number) for number in element[:3])
        S, d = self.S, self.s * rational(element.damping) + 1
        pair = self._waves(element, S, d)
        if pair is None:
            raise InseparableError
        one, two = pair
        gap = one[2] - two[2]
        unit = gap * gap * d * S * g
        if unit[0].contains(0):
            raise InseparableError
        inner = _across_waves(*one[:5], *two[:5], S * g, d, S * (a / d - b), into_own(p, *units))
        self.phase = self.phase + one[5] + two[5]
        return out_of_own([part / unit for part in inner], *units)

    def _is_slow(self, segment: Segment) -> bool:
        z_sum, z_product = self._sums(segment)
        return bool(abs(z_sum[0]).mid() + 2 * abs(z_product[0]).mid().sqrt() < SLOW_WAVES)

    def _sums(self, segment: Segment) -> tuple[Series, Series]:
        a, b, g = (rational(number) for number in segment[:3])
        over_d = 1 / (self.s * rational(segment.damping) + 1)
        return self.S * (over_d * a + b), self.S * (self.S * (a * b) + g) * over_d

    def _transition(self, segment: Segment) -> tuple[Row, ...]:
        if not self._is_slow(segment):
            raise InseparableError
        return super()._transition(segment)

    def _functions(self, z_sum: Series, z_product: Series) -> tuple[Series, ...]:
        """F0..F3 as truncated power series, the tail added as a ball to every coefficient.

        In the sum of the sizes of the coefficients, h_k of `closed_form` is at most (k + 1) q^k with q = |z1 + z2| +
        |z1 z2|^(1/2), and the terms left out below sum to less than twice the first of them.
        """
        q = _size(z_sum) + _size(z_product).sqrt()
        tail = (WIDE_TERMS + 1) * q**WIDE_TERMS * rational(Fraction(2, math.factorial(2 * WIDE_TERMS)))
        if not q < WIDE_TERMS**2:  # then each term is less than half of the one before
            raise InseparableError
        ball = flint.acb(flint.arb(0, tail.upper()), flint.arb(0, tail.upper()))
        terms_kept = z_sum.prec
        rest = flint.acb_series([ball] * terms_kept, prec=terms_kept)
        return tuple(total + rest for total in summed(z_sum, z_product, WIDE_TERMS))


def _size(series: Series) -> Ball:
    """The sum of the sizes of a series' coefficients."""
    total = flint.arb(0)
    for coefficient in series.coeffs():
        total += abs(coefficient)
    return total.upper() if hasattr(total, "upper") else total


def swept(
    chain: ElementChain, s: Series, wanted: Sequence[Output], waves: Waves
) -> tuple[Series, list[Series], Series] | None:
    """Drive, outputs (SI, of the free response) and phase at the series s; None where waves cannot be told apart."""
    those = readings(chain, tuple(wanted), 0.0)
    try:
        sweep = WideSweep(those.layout, s, waves)
        places = those.layout.places
        states = sweep.states if places else {}
    except InseparableError:
        return None
    outputs = []
    for one, C in zip(those.each, those.gauges, strict=True):
        value = sweep.theta * rational(one.theta)
        if one.place is not None:
            state = states[places.index(one.place)]
            for weight, part in zip(one.state, state, strict=True):
                value = value + part * rational(weight) if weight else value
        for _ in range(one.power):
            value = value * s
        outputs.append(value / (s * rational(C) + 1) * rational(one.unit))
    return drive_of(chain.drive, s, sweep.theta, sweep.M), outputs, sweep.phase
