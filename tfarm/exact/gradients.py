"""The free response of a rig with its derivatives along any number of its parameters: jets through the same sweep.

Each number of a chain's elements is a jet of order one, its value with a row of slopes, one for each parameter; the
formulas of `compound` and `waves` carry the slopes by the rules of calculus, so that nothing but rounding is lost
(1e-9 of a value at worst: no double-double arithmetic here; the values themselves come from `values`).  Only
the way from a parameter to the elements' numbers is taken by differences, of exact fractions: to some 1e-10 of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex
from tfarm.errors import ParameterError

from .balls import Sweep, into_own, out_of_own
from .compiled import python_of
from .compound import Plane, Row, across_waves, met, row_across_waves
from .elements import Drive, Mark, Segment
from .layout import Numbers, Reading, laid_out
from .outputs import Output
from .series import Jet
from .system import System
from .waves import SERIES_RADIUS, even_functions, transition_series

_across_waves, _row_across_waves, _met = python_of(across_waves), python_of(row_across_waves), python_of(met)
_transition_series, _even_functions = python_of(transition_series), python_of(even_functions)


class Direction(NamedTuple):
    """A parameter a step below and a step above its value, as the chains of both, and what the two differ by."""

    below: System
    above: System
    shares_below: tuple[float, ...]  # where each output is then, as a share of the length
    shares_above: tuple[float, ...]
    width: float


class JetWave(NamedTuple):
    """A pair of waves of a segment, as jets: z = t^2, v = z - b S, cosh t and sinh t/t times the scale e = e^{-t}.

    The scale is a constant: it has no slopes, so that it drops out of a ratio with those of the numbers it is in.
    """

    z: Jet
    v: Jet
    c: Jet
    s: Jet
    e: Complex
    t: Complex


def response_gradients(
    chain: System, wanted: Sequence[Output], shares: Sequence[float], directions: Sequence[Direction], s: Complex
) -> tuple[Jet, list[Jet]]:
    """Drive and outputs (SI) of the free response at s (1-D), up to one factor that all of them share.

    Each is a jet: values (n,), and slopes (directions, n).  Raises ParameterError where a step along a direction makes
    another chain: an attachment that would pass a joint, a part that comes in.
    """
    those, s = _with_slopes(chain, wanted, shares, directions), np.asarray(s, dtype=complex)
    found = np.zeros((1 + len(wanted), 1 + len(directions), s.size), complex)
    with np.errstate(all="ignore"):
        for slow, here in _groups(those.layout, s):
            sweep = GradientSweep(those.layout, Jet([s[here], 0.0]), slow)
            for row, jet in enumerate([sweep.input, *(sweep.output(one) for one in those.each)]):
                found[row, 0, here] = jet.c[0]
                found[row, 1:, here] = np.broadcast_to(jet.c[1], (len(directions), here.size)).T
    drive, *outputs = (Jet([one[0], one[1:]]) for one in found)
    return drive, outputs


# ------------------------------------------------------------ from chains to jets


@dataclass(frozen=True)
class Slopes:
    """What `Readings` are, their numbers as jets along directions."""

    layout: Any
    each: tuple[Reading, ...]


@dataclass(frozen=True)
class _Laid:
    """A layout whose elements hold jets."""

    chain: Any
    elements: tuple[Any, ...]
    read: tuple[Any, ...]
    places: tuple[Any, ...]


class _Ends(NamedTuple):
    """Of a chain what a sweep reads besides its elements."""

    tip_mass: Any
    tip_inertia: Any
    drive: Drive


def _with_slopes(
    chain: System, wanted: Sequence[Output], shares: Sequence[float], directions: Sequence[Direction]
) -> Slopes:
    here = laid_out(chain, wanted, shares)
    below = [laid_out(each.below, wanted, each.shares_below) for each in directions]
    above = [laid_out(each.above, wanted, each.shares_above) for each in directions]
    widths = [each.width for each in directions]

    def jets(pick: Any) -> Any:
        return _jet(pick(here), [pick(one) for one in below], [pick(one) for one in above], widths)

    layout = _Laid(
        chain=_Ends(*(jets(lambda one, name=name: getattr(one.layout.chain, name)) for name in _Ends._fields)),
        elements=jets(lambda one: tuple(one.layout.elements)),
        read=jets(lambda one: one.layout.read),
        places=here.layout.places,
    )
    each = jets(lambda one: tuple(reading._replace(place=None) for reading in one.each))
    placed = zip(each, here.each, strict=True)
    return Slopes(layout, tuple(jet._replace(place=reading.place) for jet, reading in placed))


def _jet(here: Any, below: list[Any], above: list[Any], widths: list[float]) -> Any:
    """A number with its slopes as a jet, or what holds numbers with jets in their place."""
    around = [*below, *above]
    if isinstance(here, tuple):
        if any(type(other) is not type(here) or len(other) != len(here) for other in around):
            _refuse()
        parts = [
            _jet(one, [other[n] for other in below], [other[n] for other in above], widths)
            for n, one in enumerate(here)
        ]
        return type(here)(*parts) if hasattr(here, "_fields") else tuple(parts)
    if isinstance(here, Fraction | float) and math.isfinite(here):
        slopes = [
            float(Fraction(up) - Fraction(down)) / width if up != down else 0.0
            for down, up, width in zip(below, above, widths, strict=True)
        ]
        return Jet([float(here), np.array(slopes)[:, None] if any(slopes) else 0.0])
    if any(other != here for other in around):
        _refuse()
    return here


def _refuse() -> None:
    raise ParameterError(
        key="direction", value="a step", remedy="makes another chain: nothing may pass a joint or come in with it"
    )


def _groups(layout: Any, s: Complex) -> Iterator[tuple[list[bool], NDArray[np.int64]]]:
    """The points in groups, with which segments are slow at all of a group: their series are exact there."""
    segments = [each for each in layout.elements if isinstance(each, Segment)]
    S = s * s
    low = np.empty((len(segments), s.size), bool)
    for n, each in enumerate(segments):
        values: Any = each._replace(**{name: jet.c[0] for name, jet in each._asdict().items() if isinstance(jet, Jet)})
        z_sum, z_product = _sums(values, S, 1.0 + s * values.damping)
        low[n] = 0.7 * (abs(z_sum) + np.sqrt(abs(z_sum) ** 2 + 8 * abs(z_product))) < SERIES_RADIUS
    patterns, which = np.unique(low, axis=1, return_inverse=True)
    for number, pattern in enumerate(patterns.T):
        yield pattern.tolist(), np.flatnonzero(which == number)


# ------------------------------------------------------------ the sweep


class GradientSweep(Sweep):
    """The sweep at many s at once, with slopes.

    `slow` says of each segment, from the outermost, whether its series serve at all of these s, or its waves.
    """

    def __init__(self, layout: Any, s: Jet, slow: Sequence[bool]) -> None:
        segments = [each for each in layout.elements if isinstance(each, Segment)]
        self._slow = {id(each): is_slow for each, is_slow in zip(segments, slow, strict=True)}
        self._waves: dict[int, tuple[JetWave, JetWave]] = {}
        super().__init__(layout, s)

    def exact(self, number: Any) -> Any:
        """What it is: the layout's numbers are jets.  A fraction beside them would make arrays of objects."""
        return number if isinstance(number, Jet) else float(number)

    def numbers_of(self, layout: Any) -> Numbers:
        """The layout's numbers, those of the drive worked out; payload mass and inertia as they are."""
        chain = layout.chain
        of_angle, of_moment = (tuple(map(self.exact, each)) for each in (chain.drive.of_angle, chain.drive.of_moment))
        return Numbers(layout.elements, chain.tip_mass, chain.tip_inertia, of_angle, of_moment)

    @cached_property
    def states(self) -> dict[int, Row]:
        """W, Psi, M and Q at each mark, by the scale that the plane has at the axis."""
        found: dict[int, Row] = {}
        scale, none = Jet([1.0 + 0j, 0.0]), Jet([0j, 0.0])
        f: Row = (scale, none, none, none)
        for each in reversed(self.numbers.elements):
            if isinstance(each, Mark):
                W, Psi, M, Q = _met(f, self.planes[each.number])
                found[each.number] = W * scale, Psi * scale, M * scale, Q * scale
            else:
                f = self._beyond(each, f)
            if isinstance(each, Segment) and not self._slow[id(each)]:
                one, two = self._waves[id(each)]
                scale = scale * np.where(one.t.real >= two.t.real, two.e, one.e)  # of the slower
        return found

    def _end(self, inertia: Any) -> tuple[Any, Any]:
        if not isinstance(inertia, Jet):  # infinite
            return Jet([1.0 + 0j, 0.0]), Jet([0j, 0.0])
        share = 1.0 / (inertia + 1.0)
        return self.S * (inertia * share), share

    def _inside(self, element: Any, p: Plane) -> Plane:
        if not isinstance(element, Segment) or self._slow[id(element)]:
            return super()._inside(element, p)
        one, two, gS, d = self._separated(element)
        v_sum, own = self.S * (element.a / d - element.b), into_own(p, *element.units)
        inner = _across_waves(
            one.c, one.s, one.z, one.v, one.e, two.c, two.s, two.z, two.v, two.e, gS, d, v_sum, own
        )  # fmt: skip
        gap = one.z - two.z
        unit = 1.0 / (gS * d * gap * gap)
        return out_of_own([part * unit for part in inner], *element.units)

    def _beyond(self, element: Any, f: Row) -> Row:
        if not isinstance(element, Segment) or self._slow[id(element)]:
            return super()._beyond(element, f)
        w, m, q = element.units
        one, two, gS, d = self._separated(element)
        is_faster = one.t.real >= two.t.real  # c and s of both waves are taken by the scale of the faster
        first = np.exp(np.where(is_faster, 0.0, one.t - two.t))
        second = np.exp(np.where(is_faster, two.t - one.t, 0.0))
        own = f[0] / w, f[1], f[2] / m, f[3] / q
        own = _row_across_waves(
            one.c * first, one.s * first, one.z, one.v, two.c * second, two.s * second, two.z, two.v, gS, d, own
        )
        unit = 1.0 / (gS * d * (one.z - two.z))
        return own[0] * unit * w, own[1] * unit, own[2] * unit * m, own[3] * unit * q

    def _functions(self, z_sum: Any, z_product: Any) -> tuple[Any, ...]:
        return tuple(_transition_series(z_sum, z_product)[:4])

    def _separated(self, segment: Any) -> tuple[JetWave, JetWave, Jet, Jet]:
        """Both waves of a segment, g S and d."""
        gS, d = self.S * segment.g, self.s * segment.damping + 1.0
        if id(segment) not in self._waves:
            z_sum, z_product = _sums(segment, self.S, d)
            half = z_sum * 0.5
            spread = _root(half * half - z_product)
            sign = np.where((half.c[0] * np.conj(spread.c[0])).real >= 0, 1.0, -1.0)
            z1 = half + spread * sign
            z2 = z_product / z1
            self._waves[id(segment)] = _wave(z1, self.S * segment.b), _wave(z2, self.S * segment.b)
        return *self._waves[id(segment)], gS, d


def _sums(segment: Any, S: Any, d: Any) -> tuple[Any, Any]:
    """z1 + z2 and z1 z2 of a segment."""
    over_d = 1.0 / d
    return S * (over_d * segment.a + segment.b), S * (S * (segment.a * segment.b) + segment.g) * over_d


def _root(z: Jet) -> Jet:
    """The principal square root."""
    root = np.sqrt(z.c[0])
    return Jet([root, z.c[1] / (2 * root)])


def _wave(z: Jet, bS: Jet) -> JetWave:
    """A pair of waves by its z; the derivative of sinh t/t is (cosh t - sinh t/t)/(2 z), a series where z is small."""
    t = _root(z)
    e, is_far = np.exp(-t.c[0]), abs(z.c[0]) > 1.0
    far, near = np.where(is_far, z.c[0], 1.0), np.where(is_far, 0.0, z.c[0])
    c, s = _even_functions(near)
    c = np.where(is_far, (1 + e * e) / 2, e * c)
    s = np.where(is_far, (1 - e * e) / (2 * np.where(is_far, t.c[0], 1.0)), e * s)
    by_z = np.where(is_far, (c - s) / (2 * far), e * sinhc_slope(near))
    slope = z.c[1]
    return JetWave(z, z - bS, Jet([c, s / 2 * slope]), Jet([s, by_z * slope]), e, t.c[0])


def sinhc_slope(z: Complex) -> Complex:
    """d/dz of sinh sqrt z / sqrt z, by its series for |z| <= 1."""
    slope = np.zeros_like(z)
    for n in range(10, 0, -1):
        slope = (n + z * slope) / ((2 * n) * (2 * n + 1))
    return slope
