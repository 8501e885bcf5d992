"""Stable windows of each number of a law, the others held: from the crossings along it and one count of unstable poles.

Along a gain at the hub of a rig without damping, whose gauge reads the hub's moment, a theorem tells every mode at once
(`theorem`): all of them reach the axis where K2 takes the whole moment off the hub, or where K1 makes up for what the
hub loses, and a real pole passes through 0 where stiffness or inertia vanishes.  A delay has its margin instead.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, HubFeedback
from tfarm.crossing import Crossing, Crossings, Window, counts_over, joined
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.schema import Quantity
from tfarm.spectrum.table import first_frequency, gain_unit, most_gain

from .lines import LEADING, NEAR_ORIGIN, ROUNDED, along, critical, crossed, through_origin, unstable_below
from .loop import SLOWEST, Loop, grid
from .stability import Stability, band_of_family, is_known_without, verdict_on
from .theorem import TAKES, absorbed, theorem_of

End = Literal["edge", "search bound", "no limit"]
ENDS = "an end with < or > is that of the search range: no limit was found up to there"

WINDOW_REACH, FARTHER_REACH = 20.0, {MOMENT_GAIN: 50.0}  # how far windows are looked for, times `gain_unit`
BEYOND_STATIC = 2.0  # times J/(J - I_h), where K2 cancels the inertia: windows are looked for at least so far
BEYOND_LAW = 10.0  # times the number that there is: at least so far too
STATIC_AT = 1e-9  # of the lowest frequency: L there is that of an arm at rest


class Interval(NamedTuple):
    """Where a loop is stable along one number, and what its ends are."""

    low: Annotated[float, Quantity("from")]
    high: Annotated[float, Quantity("to")]
    low_is: Annotated[End, Quantity()] = "edge"
    high_is: Annotated[End, Quantity()] = "edge"

    def as_text(self, digits: int) -> str:
        """The interval; an end that is only that of the search has < or > before it."""
        low = "< " * (self.low_is == "search bound") + f"{self.low:.{digits}g}"
        high = "> " * (self.high_is == "search bound") + f"{self.high:.{digits}g}"
        return f"({low}, {high})"


class NumberInterval(NamedTuple):
    """A number of a law and how far it may go alone."""

    name: Annotated[str, Quantity("gain or coefficient", key="number")]
    value: Annotated[float, Quantity("value")]
    unit: Annotated[str, Quantity("unit")]
    interval: Annotated[Interval | None, Quantity("stable around it", digits=8, help=ENDS)]
    intervals: Annotated[list[Interval], Quantity("all stability intervals", digits=8, help=ENDS)]
    search_range: Annotated[Window, Quantity("search range", digits=5)]
    band: Annotated[float, Quantity(key="up_to_rad_s", help="frequency up to which crossings were looked for")]


@dataclass(frozen=True)
@record
class Windows:
    """Stable windows of one number of a law: that around the point (None if it is not stable) and all in `looked_at`.

    What an end of a window means says `end`: poles on the axis there ("edge"), an end of `looked_at`, up to which no
    limit was found and beyond which none was looked for ("search bound"), or infinity, which is a theorem ("no limit").
    Crossings are those up to `band` [rad/s], inf where no pole crosses beyond any.
    """

    name: str
    around: Window | None
    all: tuple[Window, ...]
    looked_at: Window
    crossings: Crossings
    band: float = math.inf

    def end(self, value: float) -> End:
        """What an end of one of the windows is."""
        return "no limit" if math.isinf(value) else "search bound" if value in self.looked_at else "edge"

    def about(self, value: float, unit: str = "") -> NumberInterval:
        """The windows as a row of results, around the value that the number has."""
        pairs = [Interval(low, high, self.end(low), self.end(high)) for low, high in self.all]
        here = None if self.around is None else Interval(*self.around, *map(self.end, self.around))
        return NumberInterval(self.name, value, unit, here, pairs, self.looked_at, self.band)


def windows_of(verdict: Stability, names: Iterable[str] | None = None) -> dict[str, Windows]:
    """The windows of each number of a law, or of those named, through the loop whose verdict is given.

    None of a law that is more than gains at the hub where a pole is on the axis for whatever numbers, of an arm with
    elastic links, all of whose modes meet on it, and of a number along which poles meet at s = 0 and cannot be counted.
    All are of poles up to one band: as high as both ends of each range ask for, or that of a verdict beyond which
    nothing is known.
    """
    loop, numbers = verdict.loop, verdict.loop.numbers
    if loop.gains is None and (verdict.verdict == "marginal" or loop.arm.has_elastic_link):
        return {}
    ranges = {name: looked_at(loop, name) for name in names or numbers}
    solved = {name: pair for name, pair in ranges.items() if pair[0] < pair[1] and not is_told_along(loop, name)}
    found, band = _crossings(verdict, solved)
    done: dict[str, Windows] = {}
    for name, limits in ranges.items():
        if limits[0] == limits[1]:
            done[name] = Windows(name, None, (), limits, Crossings.of([]))  # an algebraic loop but for 0
            continue
        if name not in found and name in solved:
            continue  # `Margins.intervals_note` names it
        try:
            if name in found:
                stable, crossings = _stable(verdict, name, limits, found[name], band), found[name].within(*limits)
            else:
                crossings = told_edges(loop, name, limits)
                stable = held_windows(loop, name, limits, crossings)
        except ConvergenceError:
            continue
        stable = [_with_proven_ends(loop, name, pair, limits) for pair in stable]
        around = _around(numbers[name], stable, is_at_edge=name == "Kp") if verdict.is_stable else None
        done[name] = Windows(name, around, tuple(stable), limits, crossings, band if name in found else math.inf)
    return done


def _around(value: float, stable: list[Window], *, is_at_edge: bool) -> Window | None:
    """The window that a value is in; that of Kp = 0 begins there, at the pole at 0, apart from which the verdict is."""
    inside = (pair for pair in stable if pair[0] < value < pair[1] or (is_at_edge and pair[0] == value == 0))
    return next(inside, None)


def looked_at(loop: Loop, name: str) -> Window:
    """The range of a number that is searched: well beyond what matters to the first mode, or ten times what it is.

    Of a leading coefficient from a tenth of what it is on, with its sign, where without it high modes are driven.
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
    """The crossings along each number in its range, all solved for at once, and the band [rad/s] they are up to."""
    loop, band = verdict.loop, verdict.band
    if not ranges:
        return {}, band
    if verdict.is_known_beyond or loop.gains is not None:
        ends = (loop.having(name, end) for name, pair in ranges.items() for end in critical(name, pair))
        band = max(band, band_of_family(ends)[0])
    omega = np.asarray(grid(loop.arm, band))

    def of(some: dict[str, Window]) -> dict[str, Crossings]:
        members = [lambda: loop] * len(some)
        return dict(zip(some, crossed(loop, along(loop, some), list(some.items()), omega, members), strict=True))

    try:
        return of(ranges), band
    except ConvergenceError:  # along one of them poles meet that cannot be counted
        found: dict[str, Crossings] = {}
        for name, pair in ranges.items():
            with suppress(ConvergenceError):
                found |= of({name: pair})
        return found, band


def _stable(verdict: Stability, name: str, limits: Window, found: Crossings, band: float) -> list[Window]:
    """The windows, from the verdict's count; where nothing is known beyond the band each is counted if need be.

    Then a pair of poles may leave the band through its top, or come from there, and the count at an end tells of it.
    """
    loop, value = verdict.loop, verdict.loop.numbers[name]
    if loop.gains is not None and loop.arm.loses_at_hub_alone:
        found = _without_rounding(loop, loop.gains, name, found)
    edges = np.unique([limits[0], *found.within(*limits).gain.tolist(), limits[1]])
    pairs = [(float(low), float(high)) for low, high in itertools.pairwise(edges)]
    middles = np.array([(low + high) / 2 for low, high in pairs])
    count, at = verdict.unstable_roots, value
    resting = [each.change for each in found if each.t == value and each.at == 0]
    is_known = verdict.verdict != "marginal"
    if is_known and resting in ([1], [-1]):  # the verdict is apart from that pole
        count += resting[0] > 0
    elif not (is_known and any(low < value < high for low, high in pairs)):
        at = float(middles[middles.size // 2])
        there = verdict_on(loop.having(name, at), band)
        count = 0 if there.is_stable else max(1, there.unstable_roots)
    (counts,) = counts_over(middles, [found], at, np.array([count]))
    if loop.gains is None and not verdict.is_known_beyond:

        def unstable_at(number: float) -> int:
            return unstable_below(loop.having(name, number), band)

        (carried,) = counts_over(np.array(limits), [found], at, np.array([count]))
        if carried.tolist() != [unstable_at(end) for end in limits]:
            counts = np.array([unstable_at(float(middle)) for middle in middles])
    stable = joined([pair for pair, number in zip(pairs, counts.tolist(), strict=True) if number == 0])
    if name == RATE_GAIN and loop.gains is not None and not loop.arm.hub_side_inertia:
        least = 0.0 - loop.arm.rate_loss  # where nothing is lost a pole of such a hub passes through infinity
        stable = [(max(start, least), end) for start, end in stable if end > least]
    return stable


def _without_rounding(loop: Loop, gains: HubFeedback, name: str, found: Crossings) -> Crossings:
    """The crossings along a gain without losses, where D is even in s but for the part of the rate gain.

    Poles are on the axis where that vanishes; while it does no other gain moves one off it.
    """
    at = 0.0 - loop.arm.rate_loss
    if name != RATE_GAIN:
        return found if at != gains.K1 else Crossings.of([])
    unit = gain_unit(loop.arm, name)
    return Crossings.of(each._replace(t=at) if abs(each.t - at) < unit else each for each in found)


# ------------------------------------------------------------ without damping, by a theorem


def is_told_along(loop: Loop, name: str) -> bool:
    """Whether a theorem without losses tells the loop, whatever value this gain takes."""
    if loop.gains is None or not loop.arm.loses_at_hub_alone or loop.arm.input_lags:
        return False
    return loop.arm.reads_hub_moment or (name != MOMENT_GAIN and loop.gains.K2 == 0)


def told_edges(loop: Loop, name: str, limits: Window) -> Crossings:
    """Where all modes at once, or a real pole, may cross along such a gain."""
    found = [] if (static := static_edge(loop, name, limits)) is None else [static]
    at = {MOMENT_GAIN: loop.arm.input_per_torque, RATE_GAIN: 0.0 - loop.arm.rate_loss}.get(name)
    if at is not None and not any(each.t == at for each in found):
        found.append(Crossing(at, math.inf, 1 if name == MOMENT_GAIN else -1))
    return Crossings.of(found).within(*limits)


def static_edge(loop: Loop, name: str, limits: Window) -> Crossing | None:
    """Where along a number a real pole passes through s = 0, if there is such a value."""
    near = SLOWEST * first_frequency(loop.arm) * np.array(NEAR_ORIGIN) + 0j
    (A,), (B,) = along(loop, {name: limits}).on(near)
    found = through_origin(A, B)
    return found._replace(t=0.0) if found and abs(found.t) <= ROUNDED * (limits[1] - limits[0]) else found


def held_windows(loop: Loop, name: str, limits: Window, edges: Crossings) -> list[Window]:
    """The windows of such a gain: where it takes energy from every mode, and nothing falls statically."""
    ends = np.unique([limits[0], *edges.within(*limits).gain.tolist(), limits[1]])
    pairs = [(float(low), float(high)) for low, high in itertools.pairwise(ends)]
    return joined([pair for pair in pairs if is_held(loop.having(name, (pair[0] + pair[1]) / 2))])


def is_held(loop: Loop) -> bool:
    """Whether a theorem leaves no pole right of the axis: every mode is damped, and nothing falls statically."""
    parts = absorbed(loop.arm, loop.law)
    if parts is None or not parts[0] < 1 or theorem_of(loop).energy != TAKES:
        return False
    small = np.array([STATIC_AT * first_frequency(loop.arm)], dtype=complex)
    return bool((1 + loop.loop_function(small)[0]).real > 0)


def _with_proven_ends(loop: Loop, name: str, pair: Window, limits: Window) -> Window:
    """Ends at the edge of the search replaced by infinity where a theorem says that nothing changes beyond it."""
    low, high = pair
    if loop.gains is None:
        return pair
    if name == MOMENT_GAIN:
        return (-math.inf if low == limits[0] and is_held(loop.having(name, low)) else low), high
    return low, (math.inf if high == limits[1] and is_held(loop.having(name, high)) else high)


def reach_words(found: Iterable[Windows]) -> str:
    """A sentence about window ends that are those of a band alone; empty where all are known."""
    bands = [each.band for each in found if math.isfinite(each.band)]
    if not bands:
        return ""
    return f"window ends are those of poles up to {max(bands):.4g} rad/s: beyond, some may cross inside them"
