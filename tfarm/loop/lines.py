"""The loops along one or two numbers of a law: the lines of D, and where its zeros cross the imaginary axis.

D is affine in each number of a numerator or denominator and in each gain, and in two of them bilinear:

    D = D00 + x D10 + y D01 + x y D11

It is not affine in a delay: there x is e^{-s tau}, the factor on the terms that are fed back.  Where poles cross the
axis is solved for (`tfarm.crossing`): there in pairs, at s = 0 and at infinity one by one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Law
from tfarm.arm.blocks import Rational
from tfarm.arm.feedback import OUTPUT_OF
from tfarm.arrays import Complex, Real, Whole
from tfarm.crossing import Crossing, Crossings, Family, Window, crossings
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import LoopParts
from tfarm.spectrum.box import FIRST_POINTS, NEAREST_TO_ZERO, TRIED_HEIGHTS, turned
from tfarm.spectrum.table import first_frequency

from .continuous import FAR_RIGHT, SLOWEST, ContinuousLoop, grid
from .poles import box_of
from .stability import MARGIN_OF_ZERO, is_known_without

NUMBER = re.compile(r"(.+?)(?:\.gain|\.(num|den)\.(\d+))?")  # the name of one: its signal, polynomial and place
LEADING = ".den.0"  # how the name of a leading coefficient ends
ORDER_READ_AT = (2e-3, 1e-3)  # of w1: where the order of a zero at s = 0 is read off
SIMPLE = 3.0  # ratio of values at the first and the second: 2 of a simple zero, 4 of a double one
NEXT_TO_MEETING = 1e-3  # of the range: how far from such a place its counts are taken
FINITE_LIMIT = 1.5  # times the gain at the farther of two small s: more at the nearer one is a gain without a limit
STILL_GROWS = 0.75  # of the step before: by more, of places ever farther right, a gain without a limit grows
NEAR_ORIGIN = (1e-6, 5e-7)  # of the lowest frequency: where a real pole is searched on its way through 0
ROUNDED = 4 * float(np.finfo(float).eps)  # of a range: a gain so small is 0


def with_numbers(law: Law, values: Mapping[str, float]) -> Law:
    """Return the law with other values of some of its numbers.

    Factors act on the new values of the others; a leading 0 moves the other coefficients, and is set after them.
    """
    for name in sorted(values, key=lambda name: (name == "gain", name.endswith("gain"), name.endswith(".0"))):
        law = law.having(name, values[name])
    return law


class Place(NamedTuple):
    """A number of a law in its `part`, or in all of them (-1): one unit of it adds

    of_q s^power   to the denominator q,   of_p s^power + of_all p   to the numerator p;   `value` is that in the law
    """

    part: int
    power: int
    of_q: float
    of_p: float
    of_all: float
    value: float


def place_of(law: Law, name: str) -> Place:
    """Return the place of a number, named as `Law.having` does."""
    if name == "gain":
        return Place(-1, 0, 0.0, 0.0, 1.0, 1.0)
    match = NUMBER.fullmatch(OUTPUT_OF.get(name, name))
    assert match  # of any text
    signal, of, count = match.groups()
    part = next(n for n, part in enumerate(law.parts) if part.signals == (signal,))
    block = law.parts[part].block
    if count is not None:
        row = getattr(block, of)
        return Place(part, len(row) - 1 - int(count), float(of == "den"), float(of == "num"), 0.0, row[int(count)])
    if isinstance(block, Rational) and len(block.num) == len(block.den) == 1:
        return Place(part, 0, 0.0, block.den[0], 0.0, block.num[0] / block.den[0])
    return Place(part, 0, 0.0, 0.0, 1.0, 1.0)


class Parts(NamedTuple):
    """D = drive prod(q_j) + sum of f_j prod(q_m, m not j) over the parts j of a law, at places s.

    f_j = e^{-s tau} sum of p_ji numerator_i; `read` is that with p = 1, of a part on one signal.
    """

    s: Complex
    drive: Complex
    q: Complex
    f: Complex
    read: Complex

    @property
    def whole(self) -> Complex:
        """D."""
        q, f = self.q[0], self.f[0]
        for next_q, next_f in zip(self.q[1:], self.f[1:], strict=True):
            f = f * next_q + next_f * q  # f/q + next_f/next_q
            q = q * next_q
        return np.asarray(self.drive * q + f)

    def having(self, place: Place, value: float | Real) -> Parts:
        """The same with another value of one number of the law."""
        here, q, f = self._unit(place)
        step = value - place.value
        read = np.where(here, self.read * (1 + step * place.of_all), self.read)
        return Parts(self.s, self.drive, self.q + step * q, self.f + step * f, read)

    def line(self, place: Place) -> tuple[Complex, Complex]:
        """D with the number 0, and its change with it."""
        here, q, f = self._unit(place)
        rest = self._replace(q=self.q - place.value * q, f=self.f - place.value * f)
        is_all = np.less(place.part, 0)
        others = np.where(is_all, self.q, np.where(here, q, self.q))
        return rest.whole, Parts(self.s, np.where(is_all, 0.0, self.drive), others, np.where(here, f, self.f), f).whole

    def _unit(self, place: Place) -> tuple[NDArray[np.bool_], Complex, Complex]:
        """The parts that a number is in, and what one unit of it adds to q and f."""
        number = np.arange(len(self.q)).reshape(-1, *(1,) * self.s.ndim)
        here = (number == place.part) | np.less(place.part, 0)
        term = here * self.s**place.power
        return here, place.of_q * term, place.of_p * term * self.read + place.of_all * here * self.f


def parts_of(law: Law, rig: LoopParts, s: Complex) -> Parts:
    """The parts of a law on the signals of a rig, at places s."""
    late = -law.sign * np.exp(-s * law.delay)
    read = dict(zip(law.signals, late * rig.numerators, strict=True))
    p = [zip(part.signals, part.block.numerators(s), strict=True) for part in law.parts]
    f = [sum((value * read[name] for name, value in each if name in read), 0 * late) for each in p]
    q = [part.block.denominator(s) for part in law.parts]
    first = [read.get(part.signals[0], late) for part in law.parts]
    return Parts(s, rig.drive, np.array(q), np.array(f), np.array(first))


def _parts_at(loop: ContinuousLoop, s: Complex) -> Parts:
    """The parts of the law of a loop at places s."""
    return parts_of(loop.law, loop.signals.parts(s), s)


def along(loop: ContinuousLoop, names: Iterable[str]) -> Family:
    """The lines of loops along each of some numbers of a law, the others constant, at places s."""
    table = [np.array(column) for column in zip(*(place_of(loop.law, name) for name in names), strict=True)]
    return lambda line, s: _parts_at(loop, s).line(Place._make(column[line] for column in table))


def columns(loop: ContinuousLoop, names: tuple[str, str], x: Real, reach: float) -> Family:
    """The lines of loops along the second of two numbers, one for each value x of the first, at places s.

    D is affine in the first too, found at 0 and at `reach`; a delay x is a factor e^{-s x} on the law.
    """
    is_delay = names[0] == "delay"
    loop, reach = (loop.having("delay", 0.0), 1.0) if is_delay else (loop, reach)
    first, second = (place_of(loop.law, name) for name in ("gain" if is_delay else names[0], names[1]))

    def on(line: Whole, s: Complex) -> tuple[Complex, Complex]:
        parts, share = _parts_at(loop, s), (np.exp(-x[line] * s) if is_delay else x[line]) / reach
        (A, B), (far_A, far_B) = (parts.having(first, value).line(second) for value in (0.0, reach))
        return A + share * (far_A - A), B + share * (far_B - B)

    return on


class Line(NamedTuple):
    """The loops along one number of a law between two limits; `member` makes one of them."""

    member: Callable[[], ContinuousLoop]
    name: str
    low: float
    high: float


def crossed(arm: Arm, family: Family, lines: Sequence[Line], omega: Real) -> Iterator[Callable[[], Crossings]]:
    """Return for each line what makes its crossings of the axis, between its limits.

    It raises ConvergenceError where poles meet at s = 0 that cannot be counted.
    """
    with_dips = bool(arm.least_damping)  # else h is rounding where modes rest
    found = crossings(lambda line, w: family(line, 1j * w), len(lines), omega, with_dips=with_dips)
    s = np.r_[float(omega[0]) * np.array(NEAR_ORIGIN), first_frequency(arm) * np.array([*ORDER_READ_AT, *FAR_RIGHT])]
    A, B = family(np.arange(len(lines))[:, None], s[None] + 0j)
    for line, each, N, P in zip(lines, found, A, B, strict=True):
        yield partial(_with_real_poles, line, each, N, P, float(omega[-1]))


def _with_real_poles(line: Line, found: list[Crossing], N: Complex, P: Complex, band: float) -> Crossings:
    """The crossings of pairs along a line, those of real poles at s = 0 and infinity added, from N and P there.

    Poles are counted on either side of a value at which two of them meet at s = 0.  Where the leading coefficient of a
    denominator changes its sign, a real pole passes through infinity.
    """
    _, name, low, high = line
    rest = through_origin(N[:2], P[:2])
    if rest is not None and low <= rest.t <= high:
        (zero, half), (whole, part) = abs((N + rest.t * P)[2:4]), abs(P[2:4])
        is_single = zero * part < SIMPLE * half * whole
        found.append(rest if is_single else rest._replace(change=_change_at(line, rest.t, found, band)))
    if 0.0 in critical(name, (low, high))[1:-1] and (far := through_infinity(N[4:], P[4:])) is not None:
        found.append(far._replace(t=0.0))
    return Crossings.of(e._replace(t=0.0) if abs(e.t) <= ROUNDED * (high - low) else e for e in found)


def line_crossings(loop: ContinuousLoop, name: str, low: float, high: float, band: float) -> Crossings:
    """Return the crossings of the axis up to a band [rad/s] along one number of a loop's law between two values.

    Raises ConvergenceError where poles meet at s = 0 that cannot be counted.
    """
    line = Line(lambda: loop, name, low, high)
    (found,) = crossed(loop.arm, along(loop, [name]), [line], np.asarray(grid(loop.arm, band)))
    return found()


def _change_at(line: Line, at: float, others: list[Crossing], band: float) -> int:
    """Return the change of the count at a value where two poles meet at s = 0, from counts on either side.

    Raises ConvergenceError where nothing is damped and modes cross at that value too, but for rounding.
    """
    span, loop = line.high - line.low, line.member()
    at = 0.0 if abs(at) <= ROUNDED * span else at
    away = [abs(each.t - at) for each in others if each.t != at and math.isfinite(each.t)]
    step = min([NEXT_TO_MEETING * span, *(each / 2 for each in away)])
    try:
        below, above = (unstable_below(loop.having(line.name, at + side * step), band) for side in (-1, 1))
    except ConvergenceError as error:
        why = (
            f"{line.name}: at {at:.6g} two poles meet at s = 0 and undamped modes are on the axis, so poles cannot be "
            "counted; give the link a little damping, or a range without that value"
        )
        raise ConvergenceError(why, error.best, error.residual) from error
    return above - below


def through_origin(N: Complex, P: Complex) -> Crossing | None:
    """A real pole through s = 0, from N and P at two small real s, the second half the first; None without a limit."""
    if not P.all():
        return None
    far, near = -(N / P).real
    if not abs(near) < FINITE_LIMIT * abs(far):
        return None
    return Crossing(float(2 * near - far) + 0.0, 0.0, 1 if far > near else -1)


def through_infinity(N: Complex, P: Complex) -> Crossing | None:
    """A real pole through infinity, from N and P at three real s far right, as `FAR_RIGHT`; None without a limit."""
    with np.errstate(over="ignore", invalid="ignore"):  # a law of high order is beyond any number there
        if not P.all() or not np.isfinite(N / P).all():
            return None
        first, second, third = -(N / P).real
    before, last = second - first, third - second
    if not abs(last) < STILL_GROWS * abs(before):
        return None
    return Crossing(float(third + last * last / (before - last)), math.inf, 1 if before < 0 else -1)


def unstable_below(loop: ContinuousLoop, band: float) -> int:
    """Return the number of poles right of the axis with |Im s| < band, from the turns of D around that region.

    The next of `TRIED_HEIGHTS` is taken where a pole is on its upper edge.  Raises ConvergenceError where one is on the
    axis, to working precision.
    """
    if loop.resting_zeros:
        raise ConvergenceError("a pole is at s = 0, neither stable nor unstable: take other values", loop, 0.0)
    right, nearest = box_of(loop, band).re_max, MARGIN_OF_ZERO if loop.arm.least_damping else NEAREST_TO_ZERO
    for factor in TRIED_HEIGHTS:
        top = factor * band
        side, above = right + 1j * np.linspace(0.0, top, FIRST_POINTS), np.linspace(right, 0.0, FIRST_POINTS) + 1j * top
        path = np.r_[side, above[1:-1], 1j * np.asarray(grid(loop.arm, top))[::-1], 0.0]
        try:
            return round(turned(loop.function, path, abs(right + 1j * top), nearest) / math.pi)
        except ConvergenceError as error:
            if factor == TRIED_HEIGHTS[-1] or error.best.real == 0:
                raise
    raise AssertionError("unreachable")


def critical(name: str, limits: Window) -> tuple[float, ...]:
    """Values of a number at which the band must be sufficient: its limits, and 0 of a leading coefficient."""
    low, high = limits
    return (low, 0.0, high) if name.endswith(LEADING) and low < 0 < high else limits


def turns_over(loop: ContinuousLoop, name: str, limits: Window) -> bool:
    """Whether a leading coefficient passes through 0 between these values, where without it high modes are driven."""
    return 0.0 in critical(name, limits)[1:-1] and not is_known_without(loop, name)


def static_edge(loop: ContinuousLoop, name: str, limits: Window) -> Crossing | None:
    """The value of a number at which a real pole passes through s = 0, if there is one."""
    near = SLOWEST * first_frequency(loop.arm) * np.array(NEAR_ORIGIN) + 0j
    A, B = along(loop, [name])(np.zeros(1, int), near)
    found = through_origin(A, B)
    return found._replace(t=0.0) if found and abs(found.t) <= ROUNDED * (limits[1] - limits[0]) else found
