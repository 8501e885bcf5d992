"""The loops along one or two numbers of a law, and where their poles cross the imaginary axis (`tfarm.crossing`).

D is affine in each number of a numerator or denominator and in each gain, so that two laws give all along one number
and four, the corners of a plane, all over two:

    D = D00 + x D10 + y D01 + x y D11

It is not affine in a delay: there x is e^{-s tau}, the factor on the terms that are fed back.  On the axis poles cross
in pairs, at s = 0 and at infinity one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Law
from tfarm.arrays import Complex, Real
from tfarm.crossing import Crossing, Crossings, Family, crossings, family_of
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.spectrum.box import FIRST_POINTS, NEAREST_TO_ZERO, TRIED_HEIGHTS, turned
from tfarm.spectrum.table import first_frequency

from .loop import FAR_RIGHT, Loop, grid
from .poles import box_of
from .stability import MARGIN_OF_ZERO, is_known_without

LEADING = ".den.0"  # how the name of a leading coefficient ends
ORDER_READ_AT = (2e-3, 1e-3)  # of w1: where the order of a zero at s = 0 is read off
SIMPLE = 3.0  # ratio of values at the first and the second: 2 of a simple zero, 4 of a double one
NEXT_TO_MEETING = 1e-3  # of the range: how far from such a place its counts are taken
FINITE_LIMIT = 1.5  # times the gain at the farther of two small s: more at the nearer one is a gain without a limit
STILL_GROWS = 0.75  # of the step before: by more, of places ever farther right, a gain without a limit grows
LAST_APPLIED = (".0", ".gain", "gain")  # ends of names: a leading 0 moves the others, a factor is on what there is
NEAR_ORIGIN = (1e-6, 5e-7)  # of the lowest frequency: where a real pole is searched on its way through 0
ROUNDED = 4 * float(np.finfo(float).eps)  # of a range: a gain so small is 0


def with_numbers(law: Law, values: Mapping[str, float]) -> Law:
    """Return the law with other values of some of its numbers; factors act on the new values of the others."""

    def rank(name: str) -> int:
        return next((n for n, end in enumerate(LAST_APPLIED, 1) if name.endswith(end)), 0) + (name == "gain")

    for name in sorted(values, key=rank):
        law = law.having(name, values[name])
    return law


def weights(law: Law, s: Complex) -> Complex:
    """q and e^{-s tau} p_i at s (1 + signals, n): D is their sum with drive and numerators."""
    entries, whole = law.polynomials(s)
    return np.concatenate([whole[None], np.exp(-s * law.delay) * entries])


def rows(loop: Loop, s: Complex) -> Complex:
    """Drive and numerators at s (1 + signals, n), up to one factor at each s."""
    parts = loop.signals.parts(s)
    return np.concatenate([parts.drive[None], parts.numerators])


def _ends(law: Law, name: str, reach: float) -> tuple[float, float]:
    """Two values of a number; the first is 0 where the law exists there."""
    try:
        law.having(name, 0.0)
    except ParameterError:  # a denominator that is 0 everywhere
        return -reach, reach
    return 0.0, reach


def along(loop: Loop, ranges: Mapping[str, tuple[float, float]]) -> Family:
    """The lines of loops along each of some numbers, all others constant, at places s."""
    ends = {name: _ends(loop.law, name, max(map(abs, pair))) for name, pair in ranges.items()}
    laws = [([loop.law.having(name, end) for end in pair], pair) for name, pair in ends.items()]

    def of(line: int, s: Complex, terms: Complex) -> tuple[Complex, Complex]:
        pair, (low, high) = laws[line]
        first, last = ((weights(law, s) * terms).sum(axis=0) for law in pair)
        slope = (last - first) / (high - low)
        return first - low * slope, slope

    def on(s: Complex) -> tuple[Complex, Complex]:
        terms = rows(loop, s)
        A, B = zip(*(of(line, s, terms) for line in range(len(laws))), strict=True)
        return np.array(A), np.array(B)

    def at(line: NDArray[np.int64], s: Complex) -> tuple[Complex, Complex]:
        terms, found = rows(loop, s), np.empty((2, s.size), complex)
        for number in np.unique(line):
            here = line == number
            found[:, here] = of(number, s[here], terms[:, here])
        return found[0], found[1]

    return Family(on, at)


def columns(loop: Loop, names: tuple[str, str], x: Real, reach: tuple[float, float]) -> Family:
    """The lines of loops along the second of two numbers, one for each value x of the first, at places s."""
    first, second = names
    is_delay = first == "delay"  # then x is e^{-s tau}, 0 where nothing is fed back
    law = loop.law.having("delay", 0.0) if is_delay else loop.law
    low, high = (0.0, 1.0) if is_delay else _ends(law, first, reach[0])
    bottom, top = _ends(law, second, reach[1])
    across = [{} if is_delay else {first: each} for each in (low, high)]
    laws = [[with_numbers(law, fixed | {second: each}) for each in (bottom, top)] for fixed in across]

    def corners(s: Complex) -> Complex:
        terms = rows(loop, s)
        parts = np.array([[weights(each, s) * terms for each in pair] for pair in laws])
        if is_delay:
            parts[0, :, 1:] = 0.0
        D = parts.sum(axis=2)
        D01 = (D[:, 1] - D[:, 0]) / (top - bottom)
        D00 = D[:, 0] - bottom * D01
        by_x = [(each[1] - each[0]) / (high - low) for each in (D00, D01)]
        return np.array([D00[0] - low * by_x[0], by_x[0], D01[0] - low * by_x[1], by_x[1]])

    def factors(s: Complex) -> Complex:
        return np.exp(-x[:, None] * s) if is_delay else x[:, None] + 0j

    return family_of(corners, factors, x.size)


def crossed(
    loop: Loop,
    lines: Family,
    ranges: Sequence[tuple[str, tuple[float, float]]],
    omega: Real,
    members: Sequence[Callable[[], Loop]],
) -> list[Crossings]:
    """Return the crossings of the axis along each of some lines of loops, given the names and ranges of their numbers.

    Where the leading coefficient of a denominator changes its sign, a real pole passes through infinity.  `members`
    make a loop of each line: poles are counted on either side of a value at which two of them meet at s = 0.
    """
    axis = Family(lambda w: lines.on(1j * w), lambda line, w: lines.at(line, 1j * w))
    found = crossings(axis, omega, with_dips=bool(loop.arm.least_damping))  # else h is rounding where modes rest
    w1 = first_frequency(loop.arm)
    A, B = lines.on(np.r_[float(omega[0]) * np.array(NEAR_ORIGIN), w1 * np.array([*ORDER_READ_AT, *FAR_RIGHT])] + 0j)
    done = []
    for here, N, P, (name, (low, high)), member in zip(found, A, B, ranges, members, strict=True):
        rest, span = through_origin(N[:2], P[:2]), high - low
        if rest is not None and low <= rest.t <= high:
            (zero, half), (whole, part) = abs((N + rest.t * P)[2:4]), abs(P[2:4])
            is_single = zero * part < SIMPLE * half * whole
            more = rest.change if is_single else _change_at(member(), name, rest.t, span, here, float(omega[-1]))
            here.append(Crossing(rest.t, 0.0, more))
        if name.endswith(LEADING) and low < 0 < high:
            far = through_infinity(N[4:], P[4:])
            here += [] if far is None else [far._replace(t=0.0)]
        done.append(Crossings.of(e._replace(t=0.0) if abs(e.t) <= ROUNDED * span else e for e in here))
    return done


def line_crossings(loop: Loop, name: str, low: float, high: float, band: float) -> Crossings:
    """Return the crossings of the axis up to a band [rad/s] along one number of a loop's law between two values."""
    lines = along(loop, {name: (low, high)})
    return crossed(loop, lines, [(name, (low, high))], np.asarray(grid(loop.arm, band)), [lambda: loop])[0]


def _change_at(loop: Loop, name: str, at: float, span: float, others: list[Crossing], band: float) -> int:
    """Return the change of the count at a value where two poles meet at s = 0, from counts on either side.

    Raises ConvergenceError where nothing is damped and modes cross at that value too, but for rounding.
    """
    at = 0.0 if abs(at) <= ROUNDED * span else at
    away = [abs(each.t - at) for each in others if each.t != at and math.isfinite(each.t)]
    step = min([NEXT_TO_MEETING * span, *(each / 2 for each in away)])
    try:
        below, above = (unstable_below(loop.having(name, at + side * step), band) for side in (-1, 1))
    except ConvergenceError as error:
        why = (
            f"{name}: at {at:.6g} two poles meet at s = 0 and undamped modes are on the axis, so poles cannot be "
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


def unstable_below(loop: Loop, band: float) -> int:
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


def critical(name: str, limits: tuple[float, float]) -> tuple[float, ...]:
    """Values of a number at which the band must be sufficient: its limits, and 0 of a leading coefficient."""
    low, high = limits
    return (low, 0.0, high) if name.endswith(LEADING) and low < 0 < high else limits


def turns_over(loop: Loop, name: str, limits: tuple[float, float]) -> bool:
    """Whether a leading coefficient passes through 0 between these values, where without it high modes are driven."""
    return name.endswith(LEADING) and limits[0] < 0 < limits[1] and not is_known_without(loop, name)
