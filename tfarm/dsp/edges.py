"""Edges of a sampled loop with the digits that are shown: on both ends of the interval that they stand for.

A number printed with n digits stands for an interval.  It is settled where the loop is proven stable at the one end of
it and unstable at the other, for every mode of the band.  Where that cannot be shown the number holds for the first N
modes, and those digits are kept that a loop with twice as many (or half as many, of many) confirms in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

from tfarm.crossing import Window
from tfarm.dsp.band import Band, complete_band
from tfarm.dsp.circle import Circle
from tfarm.dsp.crossings import stable_windows
from tfarm.dsp.margins import (
    DelayMargin,
    damping_edge,
    delay_margin,
    log_radius_with,
    most_modes,
    whole_loop,
)
from tfarm.dsp.sampled import Sampled, resized
from tfarm.records import record
from tfarm.spectrum.damped import LITTLE, Branches

MOST_EDGE_MODES = 64  # edges are not looked for with more modes
GAIN_DIGITS, OTHER_DIGITS = 6, 4  # that are printed where all are settled
TOLD_FROM_ZERO = 1e-6  # of a window's other edge: what an edge at 0 is told from

Proof = tuple[bool | None, float]  # whether a loop is stable (None: not shown), and in which band [rad/s] that is shown
Test = Callable[[float], Proof]


@dataclass(frozen=True)
@record
class Figure:
    """A number with as many significant `digits` as hold: proven up to `band` [rad/s], or for the first `modes` modes.

    One of `band` and `modes` is None.
    """

    value: float
    digits: int
    band: float | None
    modes: int | None

    @property
    def is_settled(self) -> bool:
        """Whether it is proven in a band."""
        return self.band is not None

    def is_sharp(self, digits: int) -> bool:
        """Whether it is proven in that many."""
        return self.is_settled and (self.digits >= digits or self.value == 0.0)

    @property
    def text(self) -> str:
        """The number in these digits; "?" where not one holds."""
        if self.value == 0.0 or math.isinf(self.value):
            return f"{self.value:g}"
        return f"{self.value:.{self.digits}g}" if self.digits else "?"


@dataclass(frozen=True)
@record
class ShownWindows:
    """Stable intervals of a gain, and the two edges of each as `figures`."""

    windows: list[Window]
    figures: list[tuple[Figure, Figure]]

    @property
    def is_settled(self) -> bool:
        """Whether every edge is proven."""
        return all(edge.is_settled for pair in self.figures for edge in pair)


@dataclass(frozen=True)
class Edge:
    """A value at which stability turns: a loop is stable below it, or above.  `spare`: how far from 0 a 0 is tried."""

    value: float
    stable_below: bool
    spare: float = 0.0

    def figure(self, digits: int, modes: int, proven: Test | None, other: Test) -> Figure:
        """With the most digits that are `proven` (two at least), or else that hold in the `other` loop too."""
        number, band = self._most(proven, digits, 2) if proven else (0, 0.0)
        if number:
            return Figure(self.value, number, band, None)
        return Figure(self.value, self._most(other, digits, 1)[0], None, modes)

    def _most(self, test: Test, digits: int, least: int) -> tuple[int, float]:
        """So many digits that hold where one more (or `digits`) does not, and their band; 0 where not the `least` do.

        By bisection: an interval of fewer digits holds that of more, but for its rounding.
        """
        if band := self._turns(test, digits):
            return digits, band
        low, found, high = least - 1, 0.0, digits
        while high - low > 1:
            middle = (low + high + 1) // 2
            band = self._turns(test, middle)
            low, found, high = (middle, band, high) if band else (low, found, middle)
        return (low, found) if found else (0, 0.0)

    def _turns(self, test: Test, digits: int) -> float:
        """The band in which the loop is stable at one end of these digits' interval, not at the other; 0: none."""
        if math.isinf(self.value):
            return 0.0
        rounded = float(f"{self.value:.{digits}g}")
        half = 0.5 * 10.0 ** (math.floor(math.log10(abs(rounded))) - digits + 1) if rounded else self.spare
        low, high = rounded - half, rounded + half
        inside, outside = (low, high) if self.stable_below else (high, low)
        stable, band = test(inside)
        if not stable:
            return 0.0
        still, narrower = test(outside)
        return min(band, narrower) if still is False else 0.0


def shown_windows(loop: Sampled, band: Band | None, gain: str) -> ShownWindows:
    """The windows of one gain, with more modes than the loop's until their edges are proven to the last digit."""
    circle = None if band is None else band.circle()
    found = ShownWindows([], [])
    for each in _sizes(loop, band, MOST_EDGE_MODES):
        found = _windows(each, band, circle, gain)
        if all(edge.is_sharp(GAIN_DIGITS) for pair in found.figures for edge in pair):
            break
    return found


def _sizes(loop: Sampled, band: Band | None, most: int) -> Iterator[Sampled]:
    """The loop, at most MOST_EDGE_MODES of its modes, and where anything can be proven with 2, 4 ... times as many."""
    loop = loop if loop.plant.count <= MOST_EDGE_MODES else resized(loop, MOST_EDGE_MODES)
    yield loop
    most = min(most, _most(loop)) if band is not None else 0
    while loop.plant.count < most:
        before, loop = loop.plant.count, resized(loop, min(2 * loop.plant.count, most))
        if loop.plant.count <= before:  # two damped modes are one here
            return
        yield loop


def _windows(loop: Sampled, band: Band | None, circle: Circle | None, gain: str) -> ShownWindows:
    """The windows of this very loop."""
    other, modes = cache(lambda: resized(loop, another(loop.plant.count, _most(loop)))), loop.plant.count

    def proof(value: float) -> Proof:
        assert circle is not None
        assert band is not None
        count = circle.count(loop.having(**{gain: value}).weights)
        return None if count is None else count == 0, band.top

    def holds(value: float) -> Proof:
        return other().having(**{gain: value}).poles.is_stable, math.inf

    windows = stable_windows(loop, gain)
    figures = []
    for low, high in windows:
        edges = Edge(low, False, _near_zero(high)), Edge(high, True, _near_zero(low))
        first, second = (edge.figure(GAIN_DIGITS, modes, proof if circle else None, holds) for edge in edges)
        figures.append((first, second))
    return ShownWindows(windows, figures)


def _near_zero(other: float) -> float:
    return TOLD_FROM_ZERO * (abs(other) if other and math.isfinite(other) else 1.0)


def another(count: int, most: int) -> int:
    """Another number of modes to compare with: twice as many, or half as many where these are too many."""
    return 2 * count if 2 * count <= most else max(1, count // 2)


def _most(loop: Sampled) -> int:
    """The most that edges are looked for with: what a sample leaves nothing of is hard to follow and adds nothing."""
    return min(MOST_EDGE_MODES, most_modes(loop.plant.arm, loop.chain))


def proof_of(loop: Sampled) -> Proof:
    """Whether a loop is stable with every mode of its band."""
    band = complete_band(loop)
    if band is None:
        return None, 0.0
    count = band.circle().count(loop.weights)
    return None if count is None else count == 0, band.top


def shown_delay(loop: Sampled, band: Band | None) -> tuple[DelayMargin, Figure]:
    """The delay margin, and its samples as a figure, with more modes until it is proven to the last digit."""
    found = DelayMargin(0.0, False), Figure(0.0, 0, None, 0)
    for each in _sizes(loop, band, MOST_EDGE_MODES // 2):
        found = _delay(each, band)
        if found[0].is_bound or found[1].is_sharp(OTHER_DIGITS):
            break
    return found


def _delay(loop: Sampled, band: Band | None) -> tuple[DelayMargin, Figure]:
    """The delay margin of this very loop; the 0 of one that is unstable is as settled as its verdict."""
    margin, now, modes = delay_margin(loop), loop.chain.sampling.delay_samples, loop.plant.count
    if margin.samples == 0.0:
        return margin, Figure(0.0, OTHER_DIGITS, band.top if band else None, None if band else modes)
    if margin.is_bound:
        return margin, Figure(margin.samples, OTHER_DIGITS, None, modes)
    other = cache(lambda: resized(loop, another(modes, _most(loop))))

    def proof(more: float) -> Proof:
        return (None, 0.0) if band is None or more < 0 else proof_of(band.loop.with_delay(now + more))

    def holds(more: float) -> Proof:
        return None if more < 0 else other().with_delay(now + more).poles.is_stable, math.inf

    return margin, Edge(margin.samples, True).figure(OTHER_DIGITS, modes, proof, holds)


def shown_damping(loop: Sampled, count: int) -> Figure:
    """The damping from which on a loop is stable, looked for with so many modes, as a figure [s]."""
    count, branches = min(count, MOST_EDGE_MODES), Branches(LITTLE)
    bare, law = loop.on(loop.plant.arm.elastic, count), replace(loop.given, delay=0.0)  # which is in the chain's
    C = damping_edge(bare, branches)

    def proof(value: float) -> Proof:
        return proof_of(whole_loop(bare.plant.arm.having(damping=value), law, loop.chain, branches))

    def holds(value: float) -> Proof:
        return log_radius_with(bare, value, another(count, MOST_EDGE_MODES), branches) < 0, math.inf

    if C == 0.0:
        return Figure(C, OTHER_DIGITS, None, count)
    return Edge(C, False).figure(OTHER_DIGITS, count, proof, holds)
