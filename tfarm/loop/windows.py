"""Stability intervals of each number of a law, the others constant, from crossings along it and one count of poles.

Along a gain at the hub of a rig without damping, whose gauge reads the hub's moment, a theorem decides every mode
(`theorem`).  All of them reach the axis where K2 cancels the whole moment on the hub, or where K1 cancels the friction
of the hub.  A real pole passes through 0 where stiffness or inertia vanishes.  A delay has its margin instead.
"""

import math
from collections.abc import Callable, Iterable
from typing import Annotated, Literal, NamedTuple

import numpy as np

from tfarm.arm import MOMENT_GAIN, RATE_GAIN, shown_unit
from tfarm.crossing import Crossing, Crossings, Window, intervals, join_neighbours
from tfarm.errors import ConvergenceError
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.lines import LEADING, Along, LawTerms, critical, cross_axis, static_edge, unstable_below
from tfarm.loop.stability import Stability, band_of_family, is_known_without, verdict_on
from tfarm.loop.theorem import Energy, cancel_hub_moment
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum.gains import gain_unit, most_gain
from tfarm.spectrum.table import first_frequency

End = Literal["edge", "search bound", "no limit"]
ENDS = "an end with < or > is that of the search range: no limit was found up to there"


class Interval(NamedTuple):
    """A stability interval of one number, and the kind of each end."""

    low: Annotated[float, Quantity("from", help="lower end")]
    high: Annotated[float, Quantity("to", help="upper end")]
    low_is: Annotated[
        End, Quantity(help="kind of the lower end: poles on the axis, search range, or no limit")
    ] = "edge"
    high_is: Annotated[
        End, Quantity(help="kind of the upper end: poles on the axis, search range, or no limit")
    ] = "edge"

    def as_text(self, digits: int) -> str:
        """Return the interval; < or > marks an end that is only that of the search."""
        low = "< " * (self.low_is == "search bound") + f"{self.low:.{digits}g}"
        high = "> " * (self.high_is == "search bound") + f"{self.high:.{digits}g}"
        return f"({low}, {high})"


@frozen
class Windows:
    """Stability intervals of one number of a law, the others constant, at its `value` in the law.

    `around` is that with the value inside (None if that is unstable), `all` are those in `looked_at`.  `end` gives the
    kind of an end: poles on the axis ("edge"), an end of the search range `looked_at` without a limit ("search bound"),
    or infinity by a theorem ("no limit").  Crossings are those up to `band` [rad/s], inf where no pole crosses beyond.
    """

    name: Annotated[
        str, Quantity("gain or coefficient", key="number", help="number of the controller that varies")
    ]
    value: Annotated[float, Quantity("value", help="its value in the controller")]
    unit: Annotated[
        str, Quantity("unit", help="of a gain at the hub; empty of a pure number and of coefficients")
    ]
    around: Window | None
    all: tuple[Window, ...]
    looked_at: Annotated[
        Window,
        Quantity(
            "search range", digits=5, key="search_range", help="values between which limits were searched"
        ),
    ]
    crossings: Crossings
    band: Annotated[
        float, Quantity(key="up_to_rad_s", help="frequency up to which crossings were searched")
    ] = math.inf

    @property
    def interval(self) -> Annotated[Interval | None, Quantity("stable around it", digits=8, help=ENDS)]:
        """The interval around the value, with the kinds of its ends."""
        return None if self.around is None else self._with_kinds(self.around)

    @property
    def intervals(
        self,
    ) -> Annotated[list[Interval], Quantity("all stability intervals", digits=8, help=ENDS)]:
        """All intervals, with the kinds of their ends."""
        return list(map(self._with_kinds, self.all))

    def _with_kinds(self, pair: Window) -> Interval:
        """Return an interval, with the kinds of its ends."""
        return Interval(*pair, *map(self.end, pair))

    def end(self, value: float) -> End:
        """Return the kind of an end of one of the intervals."""
        if math.isinf(value):
            return "no limit"
        if value in self.looked_at:
            return "search bound"
        return "edge"


# ------------------------------------------------------------ intervals


def windows_of(verdict: Stability, names: Iterable[str] | None = None) -> dict[str, Windows]:
    """Return the stability intervals of each number of a law, or of those named, about the loop of a verdict.

    A law that is more than gains at the hub has none where a pole is on the axis for all numbers, or all modes of
    elastic links are.  A number has none along which poles meet at s = 0 and cannot be counted.  All are of poles up to
    one band: high enough for both ends of each range, or that of a verdict beyond which nothing is known.
    """
    loop = verdict.loop
    numbers = loop.numbers
    if not loop.is_of_gains and (verdict.word == "marginal" or loop.arm.has_elastic_link):
        return {}
    ranges = {name: looked_at(loop, name) for name in names or numbers}
    solved = {
        name: (low, high)
        for name, (low, high) in ranges.items()
        if low < high and not is_decided_along(loop, name)
    }
    lines, band = _lines(verdict, solved)
    done: dict[str, Windows] = {}
    for name, limits in ranges.items():
        value = numbers[name]
        unit = shown_unit(name, loop.arm) if loop.is_of_gains else ""
        reach = math.inf
        if name in lines:
            try:
                found = lines[name]()
                reach = band
                stable = _stable(verdict, name, limits, found, band)
            except ConvergenceError:
                # poles cannot be counted: `Margins.intervals_note` names the number
                continue
        else:
            found = theorem_edges(loop, name, limits)
            stable = theorem_windows(loop, name, limits, found)
        stable = [_with_proven_ends(loop, name, pair, limits) for pair in stable]
        # Kp = 0 is an end of its own interval: that is the pole at 0 which the verdict leaves out
        is_end = name == "Kp" and value == 0
        inside = ((low, high) for low, high in stable if low < value < high or (is_end and low == 0))
        around = next(inside, None) if verdict.is_stable else None
        done[name] = Windows(name, value, unit, around, tuple(stable), limits, found.within(*limits), reach)
    return done


def looked_at(loop: ContinuousLoop, name: str) -> Window:
    """Return the search range of a number: well beyond values that matter to the first mode, or ten times its value.

    Of a leading coefficient without which high modes are unstable: from a tenth of its value on, with its sign.
    """
    # times the number of the law
    beyond_law = 10.0
    arm = loop.arm
    value = loop.numbers[name]
    least = beyond_law * abs(value)
    if not loop.is_of_gains:
        if name.endswith(LEADING) and value and not is_known_without(loop, name):
            low, high = sorted((value / beyond_law, value * beyond_law))
            return low, high
        return -least, least
    if name != MOMENT_GAIN:
        reach = max(20.0 * gain_unit(arm, name), least)
    elif arm.has_massless_hub:
        return 0.0, 0.0
    else:
        reach = max(50.0 * gain_unit(arm, name), least)
        carried = arm.gauged_inertia
        if 0 < carried < math.inf:
            # 2.0 times J/(J - I_h), where K2 cancels the inertia
            reach = max(reach, 2.0 * arm.turned_inertia / carried)
    most = min(most_gain(arm, name), reach)
    return -most, most


def _lines(verdict: Stability, ranges: dict[str, Window]) -> tuple[dict[str, Callable[[], Crossings]], float]:
    """Return functions of the crossings along each number in its range, solved for at once, and their band [rad/s]."""
    loop = verdict.loop
    band = verdict.band
    if not ranges:
        return {}, band
    if verdict.is_known_beyond or loop.is_of_gains:
        loops: list[ContinuousLoop] = []
        for name, pair in ranges.items():
            loops += [loop.with_number(name, end) for end in critical(name, pair)]
        band = max(band, band_of_family(loops)[0])
    terms = LawTerms(loop.signals, loop.law, ranges)
    lines = [Along(lambda: loop, name, terms.line(name, *pair)) for name, pair in ranges.items()]
    return dict(zip(ranges, cross_axis(loop.arm, terms, band, lines), strict=True)), band


def _stable(verdict: Stability, name: str, limits: Window, found: Crossings, band: float) -> list[Window]:
    """Return the stability intervals, from the verdict's count.

    Where nothing is known beyond the band, a pair of poles may pass through its top: then each interval is counted if
    the count at an end differs.
    """
    loop = verdict.loop
    value = loop.numbers[name]
    found = without_losses(loop, name, found)
    pairs = found.spans(*limits)
    count = verdict.unstable_roots
    at = value
    resting = [each.change for each in found if each.t == value and each.at == 0]
    is_known = verdict.word != "marginal"
    # the verdict leaves that pole out
    if is_known and resting in ([1], [-1]):
        count += resting[0] > 0
    elif not (is_known and any(low < value < high for low, high in pairs)):
        at = sum(pairs[len(pairs) // 2]) / 2
        there = verdict_on(loop.with_number(name, at), band)
        count = 0 if there.is_stable else max(1, there.unstable_roots)
    stable = intervals(found, *limits, at, count)
    if not (loop.is_of_gains or verdict.is_known_beyond):

        def unstable_at(number: float) -> int:
            return unstable_below(loop.with_number(name, number), band)

        carried = count + found.passed(np.array(limits)) - found.passed(at)
        if carried.tolist() != [unstable_at(end) for end in limits]:
            stable = join_neighbours([pair for pair in pairs if unstable_at(sum(pair) / 2) == 0])
    if name == RATE_GAIN and not loop.arm.hub_side_inertia:
        # where friction is cancelled a pole of such a hub passes through infinity
        least = 0.0 - loop.arm.rate_loss
        stable = [(max(start, least), end) for start, end in stable if end > least]
    return stable


def without_losses(loop: ContinuousLoop, name: str, found: Crossings) -> Crossings:
    """Return the crossings along a gain; where only the hub loses, all modes are at the gain that cancels the loss.

    There D is even in s but for the part of the rate gain: poles are on the axis where that part vanishes, for all
    values of the other gains.  Elsewhere they reach it where K2 cancels the whole moment on the hub.
    """
    if not loop.is_moved_at_hub_alone:
        return found
    arm = loop.arm
    at = 0.0 - arm.rate_loss
    reach = 1.0
    if name != RATE_GAIN and at == loop.numbers[RATE_GAIN]:
        return Crossings.of([])
    if name == MOMENT_GAIN and is_decided_along(loop, name):
        at = arm.input_per_torque
        reach = 1e-9
    elif name != RATE_GAIN:
        return found
    near = reach * gain_unit(arm, name)
    return Crossings.of(each._replace(t=at) if abs(each.t - at) < near else each for each in found)


# ------------------------------------------------------------ without damping, by a theorem


def is_decided_along(loop: ContinuousLoop, name: str) -> bool:
    """Return whether a theorem without losses decides the stability of the loop for every value of this gain."""
    if not loop.is_moved_at_hub_alone or loop.arm.input_lags:
        return False
    return loop.arm.reads_hub_moment or (name != MOMENT_GAIN and loop.numbers[MOMENT_GAIN] == 0)


def theorem_edges(loop: ContinuousLoop, name: str, limits: Window) -> Crossings:
    """Return the values of such a gain at which all modes at once, or a real pole, may cross."""
    found = [] if (static := static_edge(loop, name, limits)) is None else [static]
    at = {MOMENT_GAIN: loop.arm.input_per_torque, RATE_GAIN: 0.0 - loop.arm.rate_loss}.get(name)
    if at is not None and not any(each.t == at for each in found):
        found.append(Crossing(at, math.inf, 1 if name == MOMENT_GAIN else -1))
    return Crossings.of(found).within(*limits)


def theorem_windows(loop: ContinuousLoop, name: str, limits: Window, edges: Crossings) -> list[Window]:
    """Return the stability intervals of such a gain: every mode is damped, and the static stiffness is positive."""
    pairs = edges.spans(*limits)
    return join_neighbours(
        [pair for pair in pairs if is_proven_stable(loop.with_number(name, sum(pair) / 2))]
    )


def is_proven_stable(loop: ContinuousLoop) -> bool:
    """Return whether a theorem excludes unstable poles: every mode is damped, and the static stiffness is positive."""
    parts = cancel_hub_moment(loop)
    if parts is None or not parts[0] < 1 or loop.theorem.energy != Energy.LOSS:
        return False
    # 1e-9 of the lowest frequency: L there is that of an arm at rest
    small = np.array([1e-9 * first_frequency(loop.arm)], dtype=complex)
    return bool((1 + loop.loop_function(small)[0]).real > 0)


def _with_proven_ends(loop: ContinuousLoop, name: str, pair: Window, limits: Window) -> Window:
    """Return the interval with ends of the search replaced by infinity where a theorem holds beyond them."""
    end = 0 if name == MOMENT_GAIN else 1
    if (
        not loop.is_of_gains
        or pair[end] != limits[end]
        or not is_proven_stable(loop.with_number(name, pair[end]))
    ):
        return pair
    low, high = pair
    return (low, math.inf) if end else (-math.inf, high)


def reach_words(found: Iterable[Windows]) -> str:
    """Return a sentence about intervals that are known in a frequency range alone; empty where all are known."""
    bands = [each.band for each in found if math.isfinite(each.band)]
    if not bands:
        return ""
    reach = f"{max(bands):.4g} rad/s"
    return f"stability intervals are of poles up to {reach}: beyond, poles may cross inside them"
