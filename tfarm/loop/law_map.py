"""How many poles are unstable over two numbers of a law: D-decomposition where the characteristic function is linear.

In any one coefficient of a law, of its numerators or denominators, and in a factor on it, D is linear: D = A + g B.  So
each column of the map has its crossings of the imaginary axis solved for, as along a gain (`tfarm.crossing`), and one
count of unstable poles gives all the others.  In a delay it is not: that runs across the columns, each counted.  So
does a leading coefficient through 0 where no band tells all there: poles come to any band from above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import AnyLaw, Arm, Law, as_law
from tfarm.arrays import Complex, Real
from tfarm.crossing import Crossing, Crossings, counts_over, crossed, with_dips
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.exact.characteristic import LoopParts
from tfarm.records import record
from tfarm.spectrum.box import FIRST_POINTS, NEAREST_TO_ZERO, TRIED_HEIGHTS, turned
from tfarm.spectrum.scales import first_frequency

from .answers import law_answer
from .frequencies import grid
from .law_poles import law_box
from .law_stability import band_for, is_told_without
from .lines import ROUNDED, ascending, through_infinity, through_origin
from .loop import Loop
from .stability import MARGIN_OF_ZERO

LEADING = ".den.0"  # how the name of a leading coefficient ends
MOST_MAP_VALUES = 400  # along one number: each column is a line of crossings of its own
NEAR_ORIGIN = (1e-6, 5e-7)  # of the lowest frequency: where a real pole is looked for on its way through 0
FAR_RIGHT = (1e5, 1e6, 1e7)  # of w1: where one is looked for on its way through infinity
NEXT_TO_ZERO = 1e-6  # of the range: so near to 0 crossings are looked for again, with the digits of that width
CLOSER_LOOKS = 3  # at most: down to 1e-18 of the range, below which a number is none
ORDER_READ_AT = (2e-3, 1e-3)  # of w1: where the order of a zero at s = 0 is read off
SIMPLE = 3.0  # ratio of values at the first and the second: 2 of a simple zero, 4 of a double one
BESIDE_MEETING = 1e-3  # of the range: how far from such a place its counts are taken


@dataclass(frozen=True)
@record
class LawMap:
    """Unstable poles, `unstable` (len(y), len(x)), below `band` [rad/s] over two numbers of a law.

    `vary` names them as `Law.having` does.  `crossings` are those along y for each x: (value, frequency, change).
    """

    arm: Arm
    law: Law
    vary: tuple[str, str]
    x: Real
    y: Real
    unstable: NDArray[np.int64]
    band: float
    crossings: list[Crossings]

    @property
    def finding(self) -> str:
        """At how many points of the grid the loop is stable, in words."""
        return f"stable at {int(self.stable.sum())} of {self.stable.size} points"

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Where no pole below the band is right of the axis."""
        return np.asarray(self.unstable == 0)


def law_map_answer(found: LawMap) -> dict[str, Any]:
    """Unstable poles over the grid, rows of the second number, as plain lists."""
    return {
        "arm": found.arm.name,
        **law_answer(found.law, found.arm),
        "vary": list(found.vary),
        "x": found.x.tolist(),
        "y": found.y.tolist(),
        "unstable_roots": found.unstable.tolist(),
        "band_rad_s": found.band,
    }


def law_map(arm: Arm, law: AnyLaw, vary: tuple[str, str], x: Real, y: Real, band: float | None = None) -> LawMap:
    """The map over two numbers of a law, x and y (1-D, ascending).

    Raises ParameterError for what is no number of the law, no loop or no range; ConvergenceError where poles cannot be
    counted.
    """
    law = as_law(law)
    if vary[0] == vary[1]:
        raise ParameterError(key="vary", value=list(vary), remedy="two different numbers of the law")
    x, y = ascending(vary[0], x, MOST_MAP_VALUES), ascending(vary[1], y, MOST_MAP_VALUES)
    own = Loop(arm, law)
    is_counted = vary[0] == "delay" or _turns_over(own, vary[0], x)
    if vary[1] == "delay" or (not is_counted and _turns_over(own, vary[1], y)):
        turned = law_map(arm, law, (vary[1], vary[0]), y, x, band)
        return LawMap(turned.arm, law, vary, x, y, turned.unstable.T.copy(), turned.band, [])
    if band is None:
        first, second = (
            (each[0], each[-1]) if _turns_over(own, name, each) else asked_at(name, (each[0], each[-1]))
            for name, each in zip(vary, (x, y), strict=True)
        )
        corners = [law.having(vary[0], a).having(vary[1], b) for a in first for b in second]
        band = max(band_for(own.under(each)) for each in corners)
    omega = np.asarray(grid(own.arm, band))
    known = own.signals.parts(1j * omega)
    columns = [
        law_crossings(own.under(law.having(vary[0], float(value))), vary[1], y, omega, known, band) for value in x
    ]
    at = _farthest(y, np.concatenate([y[:0], *(each.gain for each in columns)]))
    row = law.having(vary[1], float(y[at]))
    if is_counted:
        there = np.array([unstable_below(own.under(row.having(vary[0], float(value))), band) for value in x])
    else:
        across = law_crossings(own.under(row), vary[0], x, omega, known, band)
        there = _counted(own.under(row), vary[0], x, across, band)
    counts = counts_over(y, columns, float(y[at]), there)
    found = LawMap(own.arm, law, vary, x, y, counts.T.copy(), band, columns)
    _must_hold_at_corners(own, found)
    return found


def _counted(loop: Loop, name: str, x: Real, across: Crossings, band: float) -> NDArray[np.int64]:
    """Unstable poles at each x, from one count in the middle; where a pole rests there, farthest from the crossings."""
    is_resting = loop.under(loop.law.having(name, float(x[x.size // 2]))).resting_zeros
    start = float(x[_farthest(x, across.gain) if is_resting else x.size // 2])
    begin = unstable_below(loop.under(loop.law.having(name, start)), band)
    return np.asarray(counts_over(x, [across], start, np.array([begin]))[0])


def _farthest(values: Real, crossings: Real) -> int:
    """Which of the values is farthest from all crossings; the middle one where there are none."""
    return int(np.argmax(abs(values[:, None] - crossings).min(axis=1))) if crossings.size else values.size // 2


def _must_hold_at_corners(loop: Loop, found: LawMap) -> None:
    """Refuse a map by ConvergenceError where poles came into the band or left it through its top, on the way."""
    for i, j in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
        at = (float(found.x[i]), float(found.y[j]))
        law = found.law.having(found.vary[0], at[0]).having(found.vary[1], at[1])
        try:
            count = unstable_below(loop.under(law), found.band)
        except ConvergenceError:  # a pole on the axis to working precision, which is on either side
            continue
        if count != found.unstable[j, i]:
            where = ", ".join(f"{name} = {value:.6g}" for name, value in zip(found.vary, at, strict=True))
            why = f"at {where} {count} poles below {found.band:.4g} rad/s are unstable, not {found.unstable[j, i]}"
            remedy = "on the way there some passed the band's top: ask for a smaller range"
            raise ConvergenceError(f"{why}; {remedy}", found, abs(count - int(found.unstable[j, i])))


def asked_at(name: str, limits: tuple[float, float]) -> tuple[float, ...]:
    """At which values of a number a band has to tell all: its ends, and of a leading coefficient 0 between them."""
    low, high = limits
    return (low, 0.0, high) if name.endswith(LEADING) and low < 0 < high else limits


def _turns_over(loop: Loop, name: str, values: Real) -> bool:
    """Whether a leading coefficient passes through 0 between these values, where without it high modes are driven."""
    return name.endswith(LEADING) and bool(values[0] < 0 < values[-1]) and not is_told_without(loop, name)


def unstable_below(loop: Loop, band: float) -> int:
    """Poles right of the axis with |Im s| < band: by how often D turns around the upper half of that region.

    Where one is on its upper edge the next of `TRIED_HEIGHTS` is taken.  Raises ConvergenceError where one is on the
    axis, to working precision.
    """
    if loop.resting_zeros:
        raise ConvergenceError("a pole is at s = 0, neither stable nor not: take other values", loop, 0.0)
    right, nearest = law_box(loop, band).re_max, MARGIN_OF_ZERO if loop.arm.least_damping else NEAREST_TO_ZERO
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


def law_crossings(loop: Loop, name: str, values: Real, omega: Real, known: LoopParts, band: float) -> Crossings:
    """The crossings of the axis along one number of a loop's law, between its first and last value.

    `known` are the parts of the loop's signals at `omega`.  Where the leading coefficient of a denominator changes its
    sign a real pole passes through infinity.  Next to 0 a value has lost the digits of the range, and far up the axis,
    where the number is as good as 0 at all points, even the signs are rounding: there a narrower range is looked at.
    """
    found = list(_crossings_in(loop, name, values, omega, known, band))
    for _ in range(CLOSER_LOOKS):
        near = NEXT_TO_ZERO * float(values[-1] - values[0])
        values = np.array([max(values[0], -near), min(values[-1], near)])
        if not any(each.t and _is_next_to_zero(each, values) for each in found):
            break
        closer = _crossings_in(loop, name, values, omega, known, band)
        found = [each for each in found if not _is_next_to_zero(each, values)]
        found += [each for each in closer if _is_next_to_zero(each, values)]
    return Crossings.of(found)


def _is_next_to_zero(crossing: Crossing, values: Real) -> bool:
    """Whether it lies between these values, and is of a pair of poles, neither at s = 0 nor at infinity."""
    return bool(0 < crossing.at < math.inf and values[0] < crossing.t < values[-1])


def _crossings_in(loop: Loop, name: str, values: Real, omega: Real, known: LoopParts, band: float) -> Crossings:
    """The same with the digits of the range: D = A + t B, 0 < t < 1 along it."""
    low, span = float(values[0]), float(values[-1] - values[0])
    first, last = (loop.under(loop.law.having(name, float(end))) for end in (values[0], values[-1]))

    def parts(s: Complex, of_rig: LoopParts | None = None) -> tuple[Complex, Complex]:
        of_rig = first.signals.parts(s) if of_rig is None else of_rig
        A = first.characteristic(s, of_rig)
        return A, last.characteristic(s, of_rig) - A

    places, on_axis = omega, parts(1j * omega, known)
    if loop.arm.least_damping:  # else modes may lie on the axis whatever the law, and h is rounding there
        places, on_axis = with_dips(omega, lambda w: parts(1j * w), on_axis)
    t, at, change = crossed(places, lambda w: parts(1j * w), on_axis)
    found = [Crossing(*each) for each in zip(low + span * t, at, change, strict=True)]
    slow = np.r_[float(omega[0]) * np.array(NEAR_ORIGIN), first_frequency(loop.arm) * np.array(ORDER_READ_AT)] + 0j
    A, B = parts(slow)
    rest = through_origin(A[:2], B[:2])
    if rest is not None and 0 < rest.t < 1:
        zero, half = abs((A + rest.t * B)[2:])
        is_single = zero < SIMPLE * half
        more = rest.change if is_single else _change_at(loop, name, low, span, rest.t, found, band)
        found.append(Crossing(low + span * rest.t, 0.0, more))
    if name.endswith(LEADING) and low < 0 < low + span:
        with np.errstate(over="ignore", invalid="ignore"):  # a law of high order is beyond any number there
            far = through_infinity(*parts(first_frequency(loop.arm) * np.array(FAR_RIGHT) + 0j))
        found += [] if far is None else [far._replace(t=0.0)]
    return Crossings.of(each._replace(t=0.0) if abs(each.t) <= ROUNDED * span else each for each in found)


def _change_at(loop: Loop, name: str, low: float, span: float, t: float, others: list[Crossing], band: float) -> int:
    """By how much the count grows at t where two poles meet at s = 0, from counts on either side.

    Without losses modes may cross at that value, but for rounding: it is no place to count at, and is refused.
    """
    at = low + span * t
    at = 0.0 if abs(at) <= ROUNDED * span else at
    away = [abs(each.t - at) for each in others if each.t != at]
    step = min([BESIDE_MEETING * span, *(each / 2 for each in away)])
    beside = [loop.under(loop.law.having(name, at + side * step)) for side in (-1, 1)]
    try:
        below, above = (unstable_below(each, band) for each in beside)
    except ConvergenceError as error:
        why = (
            f"at {name} = {at:.6g} two poles meet at s = 0, and beside it others are on the axis, where nothing is "
            "damped: they cannot be counted; give the link a little damping, or a range without that value"
        )
        raise ConvergenceError(why, error.best, error.residual) from error
    return above - below
