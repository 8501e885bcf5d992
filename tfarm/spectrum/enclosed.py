"""Poles and residues of an arm, or of every arm of a box, in ball arithmetic, with a bound on the poles left out.

The drive D and the numerators N of the outputs are affine in each key of a box, in the mass of the payload, say, up to
a factor that both have.  So at each s their values lie between those of the arms at its corners, and

* a disc around a pole m of the middle arm has one pole of every arm, by Rouche's theorem with the tangent at m;
* D is off zero on the edge of the band: every arm has as many poles in it as the middle arm, where they are counted;
* a residue N(p)/D'(p) is enclosed by Taylor's theorem at m.

All other poles below Im s = top lie left of the line Re s = -c.  Their share of a pulse transfer function is x times
the moments of `loop.left_poles`, so that the sizes of its values over all samples add up to

    2/pi times the integral of |G(s)/s| e^{Re s (1-f) T}/(1 - e^{Re s T}) |ds|

at most, up the line to the top and from there to the left, until e^-45 is left.  G is enclosed on each piece of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from functools import cached_property, reduce
from itertools import pairwise
from typing import Any, NamedTuple

import flint
import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import MACHINE_EPS, Complex, Real
from tfarm.errors import CertificationError
from tfarm.exact.balls import Ball, nearest_float, point, precision, rational
from tfarm.exact.characteristic import InseparableError, WideSweep, characteristic_over, tangent
from tfarm.exact.layout import Layout, lay_out
from tfarm.exact.outputs import Output
from tfarm.exact.series import SERIES_BITS, SERIES_ORDER, SlowSweep
from tfarm.exact.system import System, system_of
from tfarm.records import frozen
from tfarm.spectrum.box import Box
from tfarm.spectrum.proofs import edge_change, proven_count

# of working precision
BITS = 128
# in which drive and outputs are affine
AFFINE_KEYS = re.compile(
    r"payload\.(mass|inertia)|hub\.(inertia|friction|stiffness)"
    r"|attachment\.\d+\.(mass|inertia|stiffness|rotational_stiffness)"
)


class EnclosedNumbers(NamedTuple):
    """Numbers within `radius` of `middle`, arrays of one shape."""

    middle: Any
    radius: Real


@frozen
class EnclosedPlant:
    """Poles p (n,) of a band at the samples, conjugates listed too, in the letters of `dsp.pulse`.

    `residues` and `shares`, the same over p, are (outputs, n), `at_rest` the coefficients of s^-2, s^-1 and 1.
    """

    multipliers: EnclosedNumbers
    early: EnclosedNumbers
    late: EnclosedNumbers
    residues: EnclosedNumbers
    shares: EnclosedNumbers
    at_rest: EnclosedNumbers


@frozen
class EnclosedArms:
    """The arms between those at the `corners`, around a `middle` one, with outputs at shares of the length."""

    middle: Arm
    corners: tuple[Arm, ...]
    outputs: tuple[Output, ...]
    shares: tuple[float, ...]

    @cached_property
    def layouts(self) -> list[Layout]:
        """The layout of each corner with the outputs."""
        return [lay_out(system_of(each), self.outputs, self.shares) for each in self.corners]

    def between(self, values: Callable[[Layout], Sequence[Any]]) -> list[Ball]:
        """Return balls around values of drive and numerators of every arm, from those of the corners."""
        columns = zip(*map(values, self.layouts), strict=True)
        factors = [_factor(each.chain) for each in self.layouts]
        return [reduce(_union, (v * f for v, f in zip(column, factors, strict=True))) for column in columns]

    def count(self, line: float, top: float) -> int:
        """Return the number of poles of each arm with Re s > -line and |Im s| < top, but for s = 0.

        Raises CertificationError.
        """
        k = system_of(self.middle)
        box = Box(-line, line, -top, top)
        if len(self.corners) > 1:
            edge_change(lambda s: self.between(lambda each: [characteristic_over(each.chain, s)])[0], box)
        return proven_count(k, box) - k.at_rest

    def tail(self, line: float, top: float, period: float, remaining: float) -> Real:
        """Return the bound (outputs,) on the summed sizes of the response of all poles left of the line, below the top.

        Raises CertificationError where an output is not enclosed.
        """
        up = [0.0, *np.geomspace(line / 10, top, 40).tolist()]
        # along the top from 0.01 of 1/remaining on, until e^-45 = 3e-20 is left
        away = np.geomspace(0.01 / remaining, 45.0 / remaining, 24).tolist()
        edge = [complex(-line, w) for w in up] + [complex(-line - c, top) for c in away]
        # with the number of halvings that a piece may take for a narrower value
        pieces = [(a, b, 2) for a, b in pairwise(map(point, edge))]
        total = np.zeros(len(self.outputs))
        number = 0
        with precision(BITS):
            T = rational(period)
            while pieces:
                a, b, halvings = pieces.pop()
                number += 1
                # some 20 for each of the first: 2 s
                if number > 4000:
                    raise CertificationError(f"the outputs are not enclosed near {nearest_float(a):.4g} 1/s")
                s = a.union(b)
                values = self._values(s)
                is_known = all(_upper(abs(each)) <= 2 * abs(nearest_float(each)) for each in values)
                if not values or (halvings > 0 and not is_known):
                    middle = ((a + b) / 2).mid()
                    pieces += [(a, middle, halvings - 1), (middle, b, halvings - 1)]
                    continue
                decay = (s.real * rational(remaining)).exp() / (1 - (s.real * T).exp())
                total += [_upper(abs(each / s) * decay * abs(b - a)) for each in values]
        return np.asarray(2 / np.pi * total)

    def _values(self, s: Ball) -> list[Ball]:
        """Return the transfer functions over a wide ball; none where they are not enclosed."""
        d = s - s.mid()
        # of the Taylor series: a lower one takes shorter pieces
        order = 12
        try:
            drive, *outputs = (flint.acb_poly(each)(d) for each in self._taylor(s.mid(), s, order))
        except InseparableError:
            return []
        if drive.contains(0):
            return []
        found = [each / drive for each in outputs]
        return found if all(each.is_finite() for each in found) else []

    def _taylor(self, m: Ball, s: Ball, order: int) -> list[list[Ball]]:
        """Return the terms at m of drive and numerators, the last one over s, up to a factor that all have.

        Raises InseparableError.
        """

        def terms(layout: Layout) -> list[Ball]:
            near = WideSweep(layout, flint.acb_series([m, 1], prec=order), 0.0)
            wide = WideSweep(layout, flint.acb_series([s, 1], prec=order + 1), 0.0)
            scale = near.phase[0]
            found: list[Ball] = []
            grown = [(each.phase - scale).exp() for each in (near, wide)]
            here, over = (
                [sweep.input * factor, *(sweep.output(one) * factor for one in layout.each)]
                for sweep, factor in zip((near, wide), grown, strict=True)
            )
            for a, b in zip(here, over, strict=True):
                found += [*(a[n] for n in range(order)), b[order]]
            return found

        found = self.between(terms)
        return [found[n : n + order + 1] for n in range(0, len(found), order + 1)]

    def plant(self, poles: Complex, period: float, remaining: float) -> EnclosedPlant:
        """Return the plant of all arms at the samples, with poles next to these, without the conjugates in the list.

        Raises CertificationError.
        """
        rows = []
        with precision(BITS):
            T = rational(period)
            t = rational(remaining)
            for m in poles.tolist():
                p = self._pole(m)
                own = [(p * T).exp(), ((p * t).exp() - 1) / p, ((p * T).exp() - (p * t).exp()) / p]
                residues = self._residues(m, p)
                rows.append([*own, *residues, *(each / p for each in residues)])
        found = enclosed_numbers(rows)
        is_pair = poles.imag != 0
        middle = np.r_[found.middle, found.middle[is_pair].conj()].T
        radius = np.r_[found.radius, found.radius[is_pair]].T
        ends = [1, 2, 3, 3 + len(self.outputs)]
        own = [*map(EnclosedNumbers, np.split(middle, ends), np.split(radius, ends))]
        first, early, late = (EnclosedNumbers(each.middle[0], each.radius[0]) for each in own[:3])
        return EnclosedPlant(first, early, late, own[3], own[4], self._at_rest())

    def _pole(self, m: complex) -> Ball:
        """Return a ball with one pole of each arm next to m."""
        middle = point(m)
        r = flint.arb(0)

        def parts(layout: Layout) -> Sequence[Ball]:
            return tangent(layout.chain, middle, r) or [flint.acb("nan")] * 3

        # growing to what the tangent asks for: twice, for narrow boxes
        for _ in range(12):
            value, slope, half = map(abs, self.between(parts))
            if slope * r > value + half * r * r:
                return flint.acb(flint.arb(middle.real, r), flint.arb(middle.imag, r) if m.imag else 0)
            if not slope > 0:
                break
            r = ((value + half * r * r) / slope).upper() * rational(1.1)
            # a wider disc may reach -1/C
            if not r < abs(middle) / 10:
                break
        raise CertificationError(f"no disc around {m:.6g} 1/s has one pole of every arm")

    def _residues(self, m: complex, p: Ball) -> list[Ball]:
        """Return the residues at a pole p next to m."""
        d = p - point(m)
        try:
            drive, *outputs = self._taylor(point(m), p, 3)
        except InseparableError:
            raise CertificationError(f"no residue next to {m:.6g} 1/s") from None
        slope = (3 * drive[3] * d + 2 * drive[2]) * d + drive[1]
        return [(((e * d + c) * d + b) * d + a) / slope for a, b, c, e in outputs]

    def _at_rest(self) -> EnclosedNumbers:
        """Return the coefficients of s^-2, s^-1 and 1 (outputs, 3) of each output at s = 0."""
        first = system_of(self.middle).at_rest

        def terms(layout: Layout) -> list[Ball]:
            sweep = SlowSweep(layout, flint.arb_series([0, 1], prec=SERIES_ORDER))
            every = [sweep.input, *(sweep.output(one) for one in layout.each)]
            return [each[n] for each in every for n in range(first + 3)]

        with precision(SERIES_BITS):
            found = self.between(terms)
            size = first + 3
            if found[first].contains(0):
                raise CertificationError("the arms of the box differ too much")
            drive = flint.arb_series(found[first:size], prec=3)
            rows = []
            for n in range(size, len(found), size):
                quotient = flint.arb_series(found[n : n + 3], prec=3) / drive
                rows.append([flint.arb(0)] * (2 - first) + [quotient[k] for k in range(first + 1)])
        return enclosed_numbers(rows)


def _union(a: Ball, b: Ball) -> Ball:
    return a.union(b)


def _factor(k: System) -> Ball:
    """Return the factor by which drive and numerators are affine in the payload (`end_condition`)."""
    ends = (each for each in (k.tip_mass, k.tip_inertia) if math.isfinite(each))
    return rational(math.prod(1 + each for each in ends))


def enclosed_numbers(rows: Sequence[Sequence[Ball]]) -> EnclosedNumbers:
    """Return rows of balls as floats with the radii around them.  Raises CertificationError for one without bounds."""
    middle = np.array([[nearest_float(flint.acb(each)) for each in row] for row in rows])
    pairs = zip(np.ravel(np.array(rows, dtype=object)).tolist(), middle.ravel().tolist(), strict=True)
    radius = np.array([_upper(abs(each - point(m))) for each, m in pairs]).reshape(middle.shape)
    if not np.isfinite(radius).all():
        raise CertificationError("the arms of the box differ too much")
    return EnclosedNumbers(middle, radius)


def _upper(ball: Ball) -> float:
    """Return a float above a real ball."""
    return float(ball.upper()) * (1 + 2 * MACHINE_EPS)
