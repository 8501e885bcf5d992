"""Stability intervals of each number of a law, the others constant, from crossings along it and one count of poles.

D is affine in each number of a numerator or denominator and in each gain, so that two laws give all along one number
and four, the corners of a plane, all over two:

    D = D00 + x D10 + y D01 + x y D11

It is not affine in a delay: there x is e^{-s tau}, the factor on the terms that are fed back.  Where poles cross the
imaginary axis is solved for (`tfarm.crossing`): there in pairs, at s = 0 and at infinity one by one.

Along a gain at the hub of a rig without damping, whose gauge reads the hub's moment, a theorem decides every mode
(`theorem`).  All of them reach the axis where K2 cancels the whole moment on the hub, or where K1 cancels the friction
of the hub.  A real pole passes through 0 where stiffness or inertia vanishes.  A delay has its margin instead.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, HubFeedback, Law, shown_unit
from tfarm.arrays import Complex, Real
from tfarm.crossing import Crossing, Crossings, Family, Window, counts_over, crossings, family_of, intervals, joined
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record
from tfarm.schema import Quantity
from tfarm.spectrum.box import FIRST_POINTS, NEAREST_TO_ZERO, TRIED_HEIGHTS, turned
from tfarm.spectrum.table import first_frequency, gain_unit, most_gain

from .loop import FAR_RIGHT, SLOWEST, Loop, grid
from .poles import box_of
from .stability import MARGIN_OF_ZERO, Stability, band_of_family, is_known_without, verdict_on
from .theorem import TAKES, absorbed, theorem_of

End = Literal["edge", "search bound", "no limit"]
SEARCH_RANGE = Quantity("search range", digits=5, key="search_range", help="values between which limits were searched")
ENDS = "an end with < or > is that of the search range: no limit was found up to there"

WINDOW_REACH, FARTHER_REACH = 20.0, {MOMENT_GAIN: 50.0}  # of the search range, times `gain_unit`
BEYOND_STATIC = 2.0  # times J/(J - I_h), where K2 cancels the inertia: least search range
BEYOND_LAW = 10.0  # times the number of the law: least search range too
STATIC_AT = 1e-9  # of the lowest frequency: L there is that of an arm at rest
LEADING = ".den.0"  # how the name of a leading coefficient ends
ORDER_READ_AT = (2e-3, 1e-3)  # of w1: where the order of a zero at s = 0 is read off
SIMPLE = 3.0  # ratio of values at the first and the second: 2 of a simple zero, 4 of a double one
NEXT_TO_MEETING = 1e-3  # of the range: how far from such a place its counts are taken
FINITE_LIMIT = 1.5  # times the gain at the farther of two small s: more at the nearer one is a gain without a limit
STILL_GROWS = 0.75  # of the step before: by more, of places ever farther right, a gain without a limit grows
LAST_APPLIED = (".0", ".gain", "gain")  # ends of names: a leading 0 moves the others, a factor is on what there is
NEAR_ORIGIN = (1e-6, 5e-7)  # of the lowest frequency: where a real pole is searched on its way through 0
ROUNDED = 4 * float(np.finfo(float).eps)  # of a range: a gain so small is 0


class Interval(NamedTuple):
    """A stability interval of one number, and the kind of each end."""

    low: Annotated[float, Quantity("from", help="lower end")]
    high: Annotated[float, Quantity("to", help="upper end")]
    low_is: Annotated[End, Quantity(help="kind of the lower end: poles on the axis, search range, or no limit")] = (
        "edge"
    )
    high_is: Annotated[End, Quantity(help="kind of the upper end: poles on the axis, search range, or no limit")] = (
        "edge"
    )

    def as_text(self, digits: int) -> str:
        """The interval; < or > marks an end that is only that of the search."""
        low = "< " * (self.low_is == "search bound") + f"{self.low:.{digits}g}"
        high = "> " * (self.high_is == "search bound") + f"{self.high:.{digits}g}"
        return f"({low}, {high})"


@dataclass(frozen=True)
@record
class Windows:
    """Stability intervals of one number of a law, the others constant, at its `value` in the law.

    `around` is that with the value inside (None if that is unstable), `all` are those in `looked_at`.  `end` gives the
    kind of an end: poles on the axis ("edge"), an end of the search range `looked_at` without a limit ("search bound"),
    or infinity by a theorem ("no limit").  Crossings are those up to `band` [rad/s], inf where no pole crosses beyond.
    """

    name: Annotated[str, Quantity("gain or coefficient", key="number", help="number of the controller that varies")]
    value: Annotated[float, Quantity("value", help="its value in the controller")]
    unit: Annotated[str, Quantity("unit", help="of a gain at the hub; empty of a pure number and of coefficients")]
    around: Window | None
    all: tuple[Window, ...]
    looked_at: Annotated[Window, SEARCH_RANGE]
    crossings: Crossings
    band: Annotated[float, Quantity(key="up_to_rad_s", help="frequency up to which crossings were searched")] = math.inf

    @property
    def interval(self) -> Annotated[Interval | None, Quantity("stable around it", digits=8, help=ENDS)]:
        """The interval around the value, with the kinds of its ends."""
        return None if self.around is None else self._shown(self.around)

    @property
    def intervals(self) -> Annotated[list[Interval], Quantity("all stability intervals", digits=8, help=ENDS)]:
        """All intervals, with the kinds of their ends."""
        return list(map(self._shown, self.all))

    def _shown(self, pair: Window) -> Interval:
        return Interval(*pair, *map(self.end, pair))

    def end(self, value: float) -> End:
        """The kind of an end of one of the intervals."""
        return "no limit" if math.isinf(value) else "search bound" if value in self.looked_at else "edge"


# ------------------------------------------------------------ the loops along one or two numbers


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


def along(loop: Loop, name: str, limits: Window) -> Family:
    """The line of loops along one number, all others constant, at places s."""
    low, high = _ends(loop.law, name, max(map(abs, limits)))
    laws = [loop.law.having(name, end) for end in (low, high)]

    def of(s: Complex) -> tuple[Complex, Complex]:
        terms = rows(loop, s)
        first, last = ((weights(law, s) * terms).sum(axis=0) for law in laws)
        slope = (last - first) / (high - low)
        return first - low * slope, slope

    def on(s: Complex) -> tuple[Complex, Complex]:
        A, B = of(s)
        return A[None], B[None]

    return Family(on, lambda _, s: of(s))


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
    loop: Loop, lines: Family, name: str, limits: Window, omega: Real, members: Sequence[Callable[[], Loop]]
) -> list[Crossings]:
    """Return the crossings of the axis along one number of each of some lines of loops, between its limits.

    Where the leading coefficient of a denominator changes its sign, a real pole passes through infinity.  `members`
    make a loop of each line: poles are counted on either side of a value at which two of them meet at s = 0.
    """
    low, high = limits
    span = high - low
    axis = Family(lambda w: lines.on(1j * w), lambda line, w: lines.at(line, 1j * w))
    found = crossings(axis, omega, with_dips=bool(loop.arm.least_damping))  # else h is rounding where modes rest
    w1 = first_frequency(loop.arm)
    A, B = lines.on(np.r_[float(omega[0]) * np.array(NEAR_ORIGIN), w1 * np.array([*ORDER_READ_AT, *FAR_RIGHT])] + 0j)
    done = []
    for here, N, P, member in zip(found, A, B, members, strict=True):
        rest = through_origin(N[:2], P[:2])
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
    omega, limits = np.asarray(grid(loop.arm, band)), (low, high)
    return crossed(loop, along(loop, name, limits), name, limits, omega, [lambda: loop])[0]


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


# ------------------------------------------------------------ intervals


def windows_of(verdict: Stability, names: Iterable[str] | None = None) -> dict[str, Windows]:
    """Return the stability intervals of each number of a law, or of those named, about the loop of a verdict.

    A law that is more than gains at the hub has none where a pole is on the axis for all numbers, or all modes of
    elastic links are.  A number has none along which poles meet at s = 0 and cannot be counted.  All are of poles up to
    one band: high enough for both ends of each range, or that of a verdict beyond which nothing is known.
    """
    loop, numbers = verdict.loop, verdict.loop.numbers
    if loop.gains is None and (verdict.verdict == "marginal" or loop.arm.has_elastic_link):
        return {}
    ranges = {name: looked_at(loop, name) for name in names or numbers}
    solved = {name: pair for name, pair in ranges.items() if pair[0] < pair[1] and not is_decided_along(loop, name)}
    found, band = _crossings(verdict, solved)
    done: dict[str, Windows] = {}
    for name, limits in ranges.items():
        value, unit = numbers[name], "" if loop.gains is None else shown_unit(name, loop.arm)
        if limits[0] == limits[1]:
            done[name] = Windows(name, value, unit, None, (), limits, Crossings.of([]))  # an algebraic loop but for 0
            continue
        if name not in found and name in solved:
            continue  # `Margins.intervals_note` names it
        try:
            if name in found:
                stable, crossings = _stable(verdict, name, limits, found[name], band), found[name].within(*limits)
            else:
                crossings = theorem_edges(loop, name, limits)
                stable = theorem_windows(loop, name, limits, crossings)
        except ConvergenceError:
            continue
        stable = [_with_proven_ends(loop, name, pair, limits) for pair in stable]
        # Kp = 0 is an end of its own interval: that is the pole at 0 which the verdict leaves out
        inside = (pair for pair in stable if pair[0] < value < pair[1] or (name == "Kp" and pair[0] == value == 0))
        around = next(inside, None) if verdict.is_stable else None
        reach = band if name in found else math.inf
        done[name] = Windows(name, value, unit, around, tuple(stable), limits, crossings, reach)
    return done


def looked_at(loop: Loop, name: str) -> Window:
    """The search range of a number: well beyond values that matter to the first mode, or ten times its value.

    Of a leading coefficient without which high modes are unstable: from a tenth of its value on, with its sign.
    """
    arm, value = loop.arm, loop.numbers[name]
    if loop.gains is None:
        if name.endswith(LEADING) and value and not is_known_without(loop, name):
            low, high = sorted((value / BEYOND_LAW, value * BEYOND_LAW))
            return low, high
        return -BEYOND_LAW * abs(value), BEYOND_LAW * abs(value)
    if name == MOMENT_GAIN and arm.has_massless_hub:
        return 0.0, 0.0
    reach = max(FARTHER_REACH.get(name, WINDOW_REACH) * gain_unit(arm, name), BEYOND_LAW * abs(value))
    carried = arm.gauged_inertia
    if name == MOMENT_GAIN and 0 < carried < math.inf:
        reach = max(reach, BEYOND_STATIC * arm.turned_inertia / carried)
    most = min(most_gain(arm, name), reach)
    return -most, most


def _crossings(verdict: Stability, ranges: dict[str, Window]) -> tuple[dict[str, Crossings], float]:
    """The crossings along each number in its range, but where poles cannot be counted; and their band [rad/s]."""
    loop, band = verdict.loop, verdict.band
    if not ranges:
        return {}, band
    if verdict.is_known_beyond or loop.gains is not None:
        ends = (loop.having(name, end) for name, pair in ranges.items() for end in critical(name, pair))
        band = max(band, band_of_family(ends)[0])
    found = {}
    for name, pair in ranges.items():
        with suppress(ConvergenceError):  # poles meet at s = 0 that cannot be counted
            found[name] = line_crossings(loop, name, *pair, band)
    return found, band


def spans(found: Crossings, limits: Window) -> list[Window]:
    """The intervals from each crossing between the limits to the next."""
    edges = np.unique([limits[0], *found.within(*limits).gain.tolist(), limits[1]])
    return list(itertools.pairwise(edges.tolist()))


def _stable(verdict: Stability, name: str, limits: Window, found: Crossings, band: float) -> list[Window]:
    """The stability intervals, from the verdict's count.

    Where nothing is known beyond the band, a pair of poles may pass through its top: then each interval is counted if
    the count at an end differs.
    """
    loop, value = verdict.loop, verdict.loop.numbers[name]
    if loop.gains is not None and loop.arm.loses_at_hub_alone:
        found = _without_rounding(loop, loop.gains, name, found)
    pairs, count, at = spans(found, limits), verdict.unstable_roots, value
    resting = [each.change for each in found if each.t == value and each.at == 0]
    is_known = verdict.verdict != "marginal"
    if is_known and resting in ([1], [-1]):  # the verdict leaves that pole out
        count += resting[0] > 0
    elif not (is_known and any(low < value < high for low, high in pairs)):
        at = sum(pairs[len(pairs) // 2]) / 2
        there = verdict_on(loop.having(name, at), band)
        count = 0 if there.is_stable else max(1, there.unstable_roots)
    stable = intervals(found, *limits, at, count)
    if loop.gains is None and not verdict.is_known_beyond:

        def unstable_at(number: float) -> int:
            return unstable_below(loop.having(name, number), band)

        (carried,) = counts_over(np.array(limits), [found], at, np.array([count]))
        if carried.tolist() != [unstable_at(end) for end in limits]:
            stable = joined([pair for pair in pairs if unstable_at(sum(pair) / 2) == 0])
    if name == RATE_GAIN and loop.gains is not None and not loop.arm.hub_side_inertia:
        least = 0.0 - loop.arm.rate_loss  # where friction is cancelled a pole of such a hub passes through infinity
        stable = [(max(start, least), end) for start, end in stable if end > least]
    return stable


def _without_rounding(loop: Loop, gains: HubFeedback, name: str, found: Crossings) -> Crossings:
    """The crossings along a gain without losses, where D is even in s but for the part of the rate gain.

    Poles are on the axis where that part vanishes, for all values of the other gains.
    """
    at = 0.0 - loop.arm.rate_loss
    if name != RATE_GAIN:
        return found if at != gains.K1 else Crossings.of([])
    unit = gain_unit(loop.arm, name)
    return Crossings.of(each._replace(t=at) if abs(each.t - at) < unit else each for each in found)


# ------------------------------------------------------------ without damping, by a theorem


def is_decided_along(loop: Loop, name: str) -> bool:
    """Whether a theorem without losses decides the stability of the loop for every value of this gain."""
    if loop.gains is None or not loop.arm.loses_at_hub_alone or loop.arm.input_lags:
        return False
    return loop.arm.reads_hub_moment or (name != MOMENT_GAIN and loop.gains.K2 == 0)


def theorem_edges(loop: Loop, name: str, limits: Window) -> Crossings:
    """The values of such a gain at which all modes at once, or a real pole, may cross."""
    found = [] if (static := static_edge(loop, name, limits)) is None else [static]
    at = {MOMENT_GAIN: loop.arm.input_per_torque, RATE_GAIN: 0.0 - loop.arm.rate_loss}.get(name)
    if at is not None and not any(each.t == at for each in found):
        found.append(Crossing(at, math.inf, 1 if name == MOMENT_GAIN else -1))
    return Crossings.of(found).within(*limits)


def static_edge(loop: Loop, name: str, limits: Window) -> Crossing | None:
    """The value of a number at which a real pole passes through s = 0, if there is one."""
    near = SLOWEST * first_frequency(loop.arm) * np.array(NEAR_ORIGIN) + 0j
    (A,), (B,) = along(loop, name, limits).on(near)
    found = through_origin(A, B)
    return found._replace(t=0.0) if found and abs(found.t) <= ROUNDED * (limits[1] - limits[0]) else found


def theorem_windows(loop: Loop, name: str, limits: Window, edges: Crossings) -> list[Window]:
    """The stability intervals of such a gain: there every mode is damped, and the static stiffness is positive."""
    return joined([pair for pair in spans(edges, limits) if is_held(loop.having(name, sum(pair) / 2))])


def is_held(loop: Loop) -> bool:
    """Whether a theorem excludes unstable poles: every mode is damped, and the static stiffness is positive."""
    parts = absorbed(loop.arm, loop.law)
    if parts is None or not parts[0] < 1 or theorem_of(loop).energy != TAKES:
        return False
    small = np.array([STATIC_AT * first_frequency(loop.arm)], dtype=complex)
    return bool((1 + loop.loop_function(small)[0]).real > 0)


def _with_proven_ends(loop: Loop, name: str, pair: Window, limits: Window) -> Window:
    """The interval with ends of the search replaced by infinity where a theorem holds beyond them."""
    low, high = pair
    if loop.gains is None:
        return pair
    if name == MOMENT_GAIN:
        return (-math.inf if low == limits[0] and is_held(loop.having(name, low)) else low), high
    return low, (math.inf if high == limits[1] and is_held(loop.having(name, high)) else high)


def reach_words(found: Iterable[Windows]) -> str:
    """A sentence about intervals that are known in a frequency range alone; empty where all are known."""
    bands = [each.band for each in found if math.isfinite(each.band)]
    if not bands:
        return ""
    return f"stability intervals are of poles up to {max(bands):.4g} rad/s: beyond, poles may cross inside them"
