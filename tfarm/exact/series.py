"""Power series: `Jet`, whose numbers any formula runs on unchanged, and the expansions of outputs at s = 0.

The free response of a rig with its derivatives along any number of its parameters: jets through the same sweep.

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
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex
from tfarm.errors import ParameterError

from .balls import Sweep, into_own, out_of_own, precision, rational, summed
from .compiled import python_of
from .layout import Layout, Numbers, Reading, laid_out, readings
from .outputs import Output
from .system import Drive, Mark, Place, Segment, System
from .waves import SERIES_RADIUS, Plane, Row, across_waves, even_functions, met, row_across_waves, transition_series

SERIES_BITS = 512  # of the power series at s = 0, whose coefficients are sums of small differences
KNOWN_ZERO = 1e-80  # a coefficient below this share of the first is a zero that balls cannot know
SERIES_KEPT = 512  # expansions at s = 0 of rigs and outputs: more than a report of six rigs asks for
SLOW_POLE_STEPS = 8  # of Newton's method for a pole next to 0, each doubling its digits
SERIES_ORDER = 8  # of the power series: the drive begins at s^2 at most


class Jet:
    """c_0 + c_1 h + c_2 h^2 + ... to a fixed order; every coefficient is an array of the same shape."""

    __array_ufunc__ = None  # let NumPy arrays defer to the operators below

    def __init__(self, coefficients: Any) -> None:
        self.c: list[Any] = list(coefficients)

    @classmethod
    def variable(cls, at: Any, order: int) -> Jet:
        """s itself, expanded around `at`."""
        zero = np.zeros_like(at)
        return cls([at, zero + 1.0] + [zero] * (order - 1))

    def _other(self, other: Any) -> list[Any]:
        return other.c if isinstance(other, Jet) else [other] + [0.0] * (len(self.c) - 1)

    def __add__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([self.c[0] + other, *self.c[1:]])
        return Jet([a + b for a, b in zip(self.c, other.c, strict=True)])

    def __sub__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([self.c[0] - other, *self.c[1:]])
        return Jet([a - b for a, b in zip(self.c, other.c, strict=True)])

    def __rsub__(self, other: Any) -> Jet:
        return Jet([b - a for a, b in zip(self.c, self._other(other), strict=True)])

    def __neg__(self) -> Jet:
        return Jet([-a for a in self.c])

    def __mul__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([a if type(a) is float and a == 0.0 else a * other for a in self.c])
        b = other.c
        if len(b) == 2:  # most of the work: a slope that is the plain number 0.0 costs nothing
            (a0, a1), (b0, b1) = self.c, b
            if type(b1) is float:
                return Jet([a0 * b0, a1 if type(a1) is float else a1 * b0])
            slope = a0 * b1
            if type(a1) is not float:
                slope = slope + a1 * b0
            return Jet([a0 * b0, slope])
        return Jet([sum(self.c[i] * b[n - i] for i in range(n + 1)) for n in range(len(self.c))])

    def __truediv__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([a / other for a in self.c])
        b = other.c
        quotient: list[Any] = []
        for n, a in enumerate(self.c):
            rest = a - sum(quotient[i] * b[n - i] for i in range(n)) if n else a
            quotient.append(rest / b[0])
        return Jet(quotient)

    def __rtruediv__(self, other: Any) -> Jet:
        return Jet(self._other(other)) / self

    __radd__ = __add__
    __rmul__ = __mul__

    def shifted(self, by: int) -> Jet:
        """Divided by h^by, the first `by` coefficients being zero; the order falls by as much."""
        return Jet(self.c[by:])


class SlowSweep(Sweep):
    """The sweep with power series (`Jet`) in s at 0, whose coefficients are balls."""

    @classmethod
    def of(cls, layout: Layout, terms: int) -> SlowSweep:
        """The sweep to so many terms."""
        return cls(layout, Jet([rational(0), rational(1), *[rational(0)] * (terms - 2)]))

    def _functions(self, z_sum: Any, z_product: Any) -> tuple[Any, ...]:
        """F0..F3 by their series in z1 + z2 and z1 z2, which begin with s^2 both."""
        return tuple(summed(z_sum, z_product, 2 * len(self.s.c)))


def expansions_at_zero(
    chain: System, wanted: Sequence[Output], x: float = 0.0
) -> list[tuple[float, float, float, float]]:
    """Coefficients of s^-2, s^-1, 1 and s in each output's expansion at s = 0."""
    return [_series_at_zero(chain, each, x) for each in wanted]


@lru_cache(SERIES_KEPT)  # loops, models and pages ask for the same few of a rig again and again
def _series_at_zero(chain: System, output: Output, x: float) -> tuple[float, float, float, float]:
    """The same of one output."""
    coefficients = [float(c.mid()) if hasattr(c, "mid") else float(c) for c in _quotient_at_zero(chain, output, x).c]
    padded = [0.0] * (2 - _leading(_drive_at_zero(chain))) + coefficients
    return padded[0], padded[1], padded[2], padded[3]


def _quotient_at_zero(chain: System, output: Output, x: float) -> Jet:
    """The output's expansion from s^-n on, n the order of the drive's zero, in balls."""
    drive = _drive_at_zero(chain)
    order = _leading(drive)
    with precision(SERIES_BITS):
        return Jet(_numerator_at_zero(chain, output, x).c[: SERIES_ORDER - order]) / drive.shifted(order)


def beside_slow_pole(chain: System, wanted: Sequence[Output], x: float) -> list[tuple[float, float]]:
    """Coefficients of 1 and s in each output's expansion at s = 0, without those of a single pole p next to 0.

    Of r/(s - p) they are c_k = -r/p^(k+1), beside which those of all other poles vanish from some n on: so what is left
    is c_k - p^(n-k) c_n, right to (p/w)^(n-k), w the next pole.  In float64 -r/p alone would drown it.
    """
    drive = _drive_at_zero(chain)
    first = _leading(drive)
    with precision(SERIES_BITS):
        of_drive = drive.shifted(first)
        p = rational(0)
        for _ in range(SLOW_POLE_STEPS):  # Newton's method on a power series that is nearly a line there
            p = p - sum(c * p**k for k, c in enumerate(of_drive.c)) / sum(
                k * c * p ** (k - 1) for k, c in enumerate(of_drive.c) if k
            )
        found = []
        for each in wanted:
            constant, slope, *others, last = _quotient_at_zero(chain, each, x).c[first:]
            power = p ** (len(others) + 1)
            found.append((float((constant - last * power * p).mid()), float((slope - last * power).mid())))
    return found


@lru_cache(SERIES_KEPT)
def order_at_zero(chain: System, wanted: Output, x: float = 0.0) -> int:
    """How often an output of the free response vanishes at s = 0."""
    with precision(SERIES_BITS):
        return _leading(_numerator_at_zero(chain, wanted, x))


@lru_cache(SERIES_KEPT)
def _drive_at_zero(chain: System) -> Jet:
    """The drive as a power series in s at 0, exact zeros told from rounding."""
    with precision(SERIES_BITS):
        return _cleared(_swept(chain, ()).input)


def _numerator_at_zero(chain: System, output: Output, x: float) -> Jet:
    """An output of the free response so."""
    those = readings(chain, (output,), x)
    return _cleared(_swept(chain, those.layout.places).output(those.each[0]))


@lru_cache(SERIES_KEPT)  # angle, rate and drive are read from one sweep
def _swept(chain: System, places: tuple[Place, ...]) -> SlowSweep:
    """The sweep of a chain marked at these places."""
    return SlowSweep.of(Layout(chain, places), SERIES_ORDER)


def _leading(series: Jet) -> int:
    """The number of the first coefficient that is not 0, or of them all."""
    return next((n for n, coefficient in enumerate(series.c) if coefficient != 0), len(series.c))


def _cleared(jet: Jet) -> Jet:
    """The jet with exact zeros where only rounding is left."""
    sizes = [abs(rational(0) + c) for c in jet.c]
    largest = max(float(size.mid()) for size in sizes)
    return Jet(
        [rational(0) if float(size.mid()) < KNOWN_ZERO * largest else c for size, c in zip(sizes, jet.c, strict=True)]
    )


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
