"""The loops along one or two numbers of a law: the lines of D, and where its zeros cross the imaginary axis.

D is affine in each number of a numerator or denominator and in each gain, and in two of them bilinear:

    D = D00 + x D10 + y D01 + x y D11

It is not affine in a delay: there x is e^{-s tau}, the factor on the terms that are fed back.  Where poles cross the
axis is solved for (`tfarm.crossing`): there in pairs, at s = 0 and at infinity one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from functools import partial
from typing import NamedTuple

import numpy as np

from tfarm.arm import Arm, Law
from tfarm.arm.feedback import OUTPUT_OF
from tfarm.arrays import MACHINE_EPS, Complex, Real
from tfarm.crossing import Crossing, Crossings, Grid, Line, Window, crossings
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import LoopParts
from tfarm.loop.continuous import FAR_RIGHT, SLOWEST, ContinuousLoop, grid, rig_parts
from tfarm.loop.poles import box_of
from tfarm.loop.stability import MARGIN_OF_ZERO
from tfarm.response.signals import Signals
from tfarm.spectrum.box import FIRST_POINTS, NEAREST_TO_ZERO, TRIED_HEIGHTS, argument_change
from tfarm.spectrum.table import first_frequency

# how the name of a leading coefficient ends
LEADING = ".den.0"


def with_numbers(law: Law, values: Mapping[str, float]) -> Law:
    """Return the law with other values of some of its numbers.

    Factors act on the new values of the others.
    """
    for name in sorted(values, key=lambda name: (name == "gain", name.endswith("gain"))):
        law = law.with_number(name, values[name])
    return law


class LawTerms:
    """The terms of D = weights @ terms of a law on some signals, affine in each number of the law that is named.

    They are drive prod(q_j), and of each part j of the law f_j prod(q_m, m not j), its plain gain apart as its weight:

        f_j = e^{-s tau} sum of p_ji numerator_i

    Those of weight 0 that follow are D of laws with coefficients next to 0: D is affine in these too.
    """

    def __init__(self, signals: Signals, law: Law, names: Iterable[str]) -> None:
        self.signals = signals
        self.law = law
        self.gains = law.part_gains
        self.weights = np.ones(1 + len(law.parts))
        for name, (part, value) in self.gains.items():
            self.weights[1 + part] = value
            self.law = self.law.with_number(name, 1.0)
        self.others = {}
        for name in names:
            if self.part(name) is None and name != "gain":
                value = law.numbers.get(name, 0.0)
                # not 0, as a leading 0 moves the other coefficients
                small = value * 2.0**-30 or 1.0
                part = [each.signals for each in law.parts].index((name.rsplit(".", 2)[0],))
                self.others[name] = value, small, part, self.law.with_number(name, small).parts[part].block

    def of(self, s: Complex, rig: LoopParts) -> Complex:
        """Return the terms (rows, ...) at places s, from the parts of the signals there."""
        law = self.law
        shares, whole = law.shares(s)
        late = np.exp(-s * law.delay) * rig.numerators
        rows = [rig.drive * whole, *(shares * late).sum(axis=1)]
        D = np.tensordot(self.weights, rows, 1)
        for _, _, number, block in self.others.values():
            part = law.parts[number]
            (signal,) = part.signals
            fed_back = -law.sign * late[law.signals.index(signal)] * whole * block.numerators(s)[0]
            without = D - rows[1 + number]
            rows.append((without * block.denominator(s) + fed_back) / part.block.denominator(s))
        return np.array(rows)

    def at(self, s: Complex) -> Complex:
        """Return the terms (rows, n) at places s (n,)."""
        return self.of(s, self.signals.parts(s))

    def on_axis(self, omega: Real) -> Complex:
        """Return the terms at s = i omega (n,); without losses free of rounding, as terms even in s are real there."""
        s = 1j * omega
        drive, numerators, scale = rig_parts(self.signals, s)
        if self.signals.system.is_real_on_axis:
            turn = np.exp(1j * scale.imag)
            odd = [[each.power % 2] for each in self.signals.outputs]
            numerators = np.where(odd, 1j * (numerators * turn).imag, (numerators * turn).real)
            drive = (drive * turn).real + 0j
        return self.of(s, LoopParts(drive, numerators, scale))

    def line(self, name: str, low: float = -math.inf, high: float = math.inf) -> Line:
        """Return the line of a number of the law."""
        weights = np.r_[self.weights, np.zeros(len(self.others))]
        part = self.part(name)
        # a factor on the law
        if name == "gain":
            return Line.of(weights, np.r_[0.0, weights[1:]], 1.0, low, high)
        if part is not None:
            return Line.of(weights, np.eye(weights.size)[1 + part], weights[1 + part], low, high)
        value, small, *_ = self.others[name]
        other = np.eye(weights.size)[self.weights.size + list(self.others).index(name)]
        return Line.of(other, (weights - other) / (value - small), small, low, high)

    def with_number(self, name: str, value: float) -> LawTerms:
        """Return the same with another value of the gain of a part."""
        other = copy(self)
        part = self.part(name)
        assert part is not None
        other.weights = self.weights.copy()
        other.weights[1 + part] = value
        return other

    def part(self, name: str) -> int | None:
        """Return the part whose weight is a number; None of any other."""
        plain = OUTPUT_OF.get(name, name).removesuffix(".gain")
        return next((self.gains[key][0] for key in (plain, f"{plain}.gain") if key in self.gains), None)


class Along(NamedTuple):
    """The loops along one number of a law; `member` makes one of them."""

    member: Callable[[], ContinuousLoop]
    name: str
    line: Line


def cross_axis(
    arm: Arm, terms: LawTerms, band: float, loops: Sequence[Along]
) -> Iterator[Callable[[], Crossings]]:
    """Yield for each line a function that returns its crossings of the axis, between its limits.

    That raises ConvergenceError where poles meet at s = 0 that cannot be counted.
    """
    # of w1: where the order of a zero at s = 0 is read off
    order_read_at = (2e-3, 1e-3)
    # else h is rounding where modes rest
    with_dips = bool(arm.least_damping)
    curve = Grid(np.asarray(grid(arm, band)), terms.on_axis)
    found = crossings(curve, [each.line for each in loops], with_dips=with_dips)
    others = first_frequency(arm) * np.array([*order_read_at, *FAR_RIGHT])
    rows = terms.at(np.r_[near_origin(curve.places[0]), others] + 0j)
    for along, pairs in zip(loops, found, strict=True):
        line = along.line
        yield partial(_with_real_poles, along, pairs, line.others @ rows, line.alone @ rows, band)


def near_origin(lowest: float) -> Real:
    """Return two s where a real pole is searched on its way through 0, the second half the first.

    `lowest` is the lowest frequency of a grid [rad/s].
    """
    return lowest * np.array([1e-6, 5e-7])


def _with_real_poles(along: Along, found: list[Crossing], N: Complex, P: Complex, band: float) -> Crossings:
    """Return the crossings of pairs along a line, and those of real poles at s = 0 and infinity, from N and P there.

    Poles are counted on either side of a value at which two of them meet at s = 0.  Where the leading coefficient of a
    denominator changes its sign, a real pole passes through infinity.
    """
    low, high = limits = along.line[2:]
    rest = through_origin(N[:2], P[:2], limits)
    if rest is not None and low <= rest.t <= high:
        (zero, half) = abs((N + rest.t * P)[2:4])
        (whole, part) = abs(P[2:4])
        # ratio of values at the first and the second: 2 of a simple zero, 4 of a double one
        is_single = zero * part < 3.0 * half * whole
        found.append(rest if is_single else rest._replace(change=_change_at(along, rest.t, found, band)))
    change = through_infinity(N[4:], P[4:])
    if change and 0.0 in critical(along.name, limits)[1:-1]:
        found.append(Crossing(0.0, math.inf, change))
    return Crossings.of(each._replace(t=round_on_line(each.t, limits)) for each in found)


def round_on_line(t: float, limits: Window) -> float:
    """Return a number along a line; one that is 0 but for the rounding of its range is 0."""
    return 0.0 if abs(t) <= 4 * MACHINE_EPS * (limits[1] - limits[0]) else t


def line_crossings(loop: ContinuousLoop, name: str, low: float, high: float, band: float) -> Crossings:
    """Return the crossings of the axis up to a band [rad/s] along one number of a loop's law between two values.

    Raises ConvergenceError where poles meet at s = 0 that cannot be counted.
    """
    terms = LawTerms(loop.signals, loop.law, [name])
    (found,) = cross_axis(loop.arm, terms, band, [Along(lambda: loop, name, terms.line(name, low, high))])
    return found()


def _change_at(along: Along, at: float, others: list[Crossing], band: float) -> int:
    """Return the change of the count at a value where two poles meet at s = 0, from counts on either side.

    Raises ConvergenceError where nothing is damped and modes cross at that value too, but for rounding.
    """
    loop = along.member()
    name = along.name
    away = [abs(each.t - at) for each in others if each.t != at and math.isfinite(each.t)]
    # 1e-3 of the range: how far from such a place its counts are taken
    step = min([1e-3 * (along.line.high - along.line.low), *(each / 2 for each in away)])
    try:
        below, above = (unstable_below(loop.with_number(name, at + side * step), band) for side in (-1, 1))
    except ConvergenceError as error:
        why = (
            f"{name}: at {at:.6g} two poles meet at s = 0 and undamped modes are on the axis, so poles cannot be "
            "counted; give the link a little damping, or a range without that value"
        )
        raise ConvergenceError(why, error.best, error.residual) from error
    return above - below


def through_origin(N: Complex, P: Complex, limits: Window) -> Crossing | None:
    """Return the crossing of a real pole through s = 0, from N and P at two small real s; None without a limit.

    The second s is half the first.
    """
    if not P.all():
        return None
    far, near = -(N / P).real
    # 1.5 times the gain at the farther of two small s: more at the nearer one is a gain without a limit
    if not abs(near) < 1.5 * abs(far):
        return None
    return Crossing(round_on_line(float(2 * near - far), limits), 0.0, 1 if far > near else -1)


def through_infinity(N: Complex, P: Complex) -> int:
    """Return the change of the count by a real pole through infinity, from N and P at `FAR_RIGHT`; 0: none."""
    # a law of high order is beyond any number there
    with np.errstate(all="ignore"):
        before, last = np.diff(-(N / P).real)
        # by more than 0.75 of the step before, of places ever farther right, a gain without a limit grows
        has_limit = abs(last) < 0.75 * abs(before)
    return (1 if before < 0 else -1) if has_limit else 0


def unstable_below(loop: ContinuousLoop, band: float) -> int:
    """Return the number of poles right of the axis with |Im s| < band, from the turns of D around that region.

    The next of `TRIED_HEIGHTS` is taken where a pole is on its upper edge.  Raises ConvergenceError where one is on the
    axis, to working precision.
    """
    if loop.resting_zeros:
        raise ConvergenceError(
            "a pole is at s = 0, neither stable nor unstable: take other values", loop, 0.0
        )
    right = box_of(loop, band).re_max
    nearest = MARGIN_OF_ZERO if loop.arm.least_damping else NEAREST_TO_ZERO
    for factor in TRIED_HEIGHTS:
        top = factor * band
        side = right + 1j * np.linspace(0.0, top, FIRST_POINTS)
        above = np.linspace(right, 0.0, FIRST_POINTS) + 1j * top
        path = np.r_[side, above[1:-1], 1j * np.asarray(grid(loop.arm, top))[::-1], 0.0]
        try:
            return round(argument_change(loop.function, path, abs(right + 1j * top), nearest) / math.pi)
        except ConvergenceError as error:
            if factor == TRIED_HEIGHTS[-1] or error.best.real == 0:
                raise
    raise AssertionError("unreachable")


def critical(name: str, limits: Window) -> tuple[float, ...]:
    """Return values of a number at which the band must be sufficient: its limits, and 0 of a leading coefficient."""
    low, high = limits
    if name.endswith(LEADING) and low < 0 < high:
        return (low, 0.0, high)
    return limits


def static_edge(loop: ContinuousLoop, name: str, limits: Window) -> Crossing | None:
    """Return the value of a number at which a real pole passes through s = 0, if there is one."""
    terms = LawTerms(loop.signals, loop.law, [name])
    line = terms.line(name)
    rows = terms.at(near_origin(SLOWEST * first_frequency(loop.arm)) + 0j)
    return through_origin(line.others @ rows, line.alone @ rows, limits)
