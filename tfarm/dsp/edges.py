"""How far a sampled loop is from its edges, in each number of its law, in delay and in damping, and with what digits.

A number printed with n digits stands for an interval.  It is settled where the loop is proven stable at the one end of
it and unstable at the other, for every mode of the band.  Where that cannot be shown the number holds for the first N
modes, and those digits are kept that a loop with twice as many (or half as many, of many) confirms in the same way.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated

import numpy as np
from scipy.optimize import brentq

from tfarm.arm import AnyLaw, Arm
from tfarm.dsp.chain import Chain
from tfarm.dsp.circle import Band, Circle, complete_band
from tfarm.dsp.crossings import stable_windows
from tfarm.dsp.discretise import acting_law, with_all_gains
from tfarm.dsp.sampled import Sampled, resized, sampled_loop
from tfarm.dsp.sampling import FORGOTTEN, held_amplitude
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.schema import Quantity
from tfarm.spectrum import modes_below
from tfarm.spectrum.table import first_frequency

LONGEST_DELAY_SAMPLES = 20.0  # samples: the delay margin is looked for up to here
MOST_STEPS = 2000  # of a scan of the delay
LONGEST_SCAN_STEP, STEPS_A_TURN = 0.05, 12  # samples, and steps in a turn of the fastest mode that may be driven
PUSH_ROOM = 4  # times what the feedback pushes a pole by to first order: what damps itself more than that is not driven
DELAY_KNOWN = 1e-10  # samples: to so much a delay margin is solved for
CLEARLY = 1e-6  # within the circle: an eigenvalue there is not polished, as even a double one is right to 1e-7
KEPT_BEYOND = 2  # modes kept beyond the last one that outlives a sample
MODES_BEYOND = 4  # those of a whole loop that do not outlive a sample
MOST_LOOP_MODES = 128  # of a whole loop: half a second of work
SURELY_OVERDAMPED = 2.5  # C w from which on a mode surely is: following it further costs a hundred times as much
FAR_BEYOND = 5.0  # of critical in the first mode: all poles of bending lie left of any line, one mode shows it as well
STRONGEST = 0.15  # of critical in the first mode: no stronger damping is looked at
DAMPING_MODES = 40  # of the loop in which a required damping is looked for, where no number is said
DAMPING_DECADES = 16  # down from there
DAMPING_XTOL, DAMPING_RTOL, MADE_SURE = 1e-7, 4e-7, 1e-6  # relative: C is solved for to the first two, then raised
NUDGES = (0.0, 1e-6, -1e-6)  # of C, tried in turn where two damped modes are one at it
MOST_EDGE_MODES = 64  # edges are not looked for with more modes
GAIN_DIGITS, OTHER_DIGITS = 6, 4  # that are printed where all are settled
TOLD_FROM_ZERO = 1e-6  # of a window's other edge: what an edge at 0 is told from

Proof = tuple[bool | None, float]  # whether a loop is stable (None: not shown), and in which band [rad/s] that is shown
Test = Callable[[float], Proof]


@dataclass(frozen=True)
@record
class DelayMargin:
    """`samples` of further delay that the loop bears; `is_bound` where none up to there makes it unstable."""

    samples: float
    is_bound: bool


def delay_margin(loop: Sampled) -> DelayMargin:
    """How many samples of further delay, any fraction, until a stable loop is stable no more; 0 if it is not stable.

    Scanned finely enough for the fastest mode that the loop can drive unstable, then bisected to 1e-10.
    """
    now = loop.chain.sampling.delay_samples

    def log_radius(more: float) -> float:
        return loop.with_delay(now + more).poles.log_spectral_radius

    def grows(more: float) -> bool:
        later = loop.with_delay(now + more)
        near = abs(later.eigenvalues) > 1 - CLEARLY
        return bool(near.any()) and later.polished(near).log_spectral_radius >= 0

    if log_radius(0.0) >= 0:
        return DelayMargin(0.0, False)
    plant, T = loop.plant, loop.chain.sampling.period
    reach = PUSH_ROOM * loop.push * abs(held_amplitude(plant.poles, T))
    risky = (reach > -plant.poles.real * T) & (plant.poles.imag > 0)  # whose own damping the feedback could outweigh
    fastest = (plant.poles.imag[risky] * T).max(initial=np.pi / 4)
    step = float(min(LONGEST_SCAN_STEP, 2 * np.pi / fastest / STEPS_A_TURN))  # samples
    for i in range(1, MOST_STEPS + 1):
        if i * step > LONGEST_DELAY_SAMPLES:
            break
        low, high = (i - 1) * step, i * step
        if grows(high) and log_radius(high) >= 0:  # a pole on the circle but for rounding is on either side
            is_between = log_radius(low) < 0
            return DelayMargin(float(brentq(log_radius, low, high, xtol=DELAY_KNOWN)) if is_between else low, False)
    return DelayMargin(min(MOST_STEPS * step, LONGEST_DELAY_SAMPLES), True)


def required_damping(arm: Arm, law: AnyLaw, chain: Chain, *, count: int = DAMPING_MODES) -> float:
    """The smallest C [s] from which on the loop of this law is stable on this arm (its own C is set aside).

    0 where it is stable without damping, inf where none up to 15 % of critical in the first mode helps.
    """
    return damping_edge(sampled_loop(arm.elastic, law, chain, count=count))


def damping_edge(loop: Sampled) -> float:
    """`required_damping` of an undamped loop, with its number of modes.

    Every decade is looked at from the strongest C down, so that larger ones on that grid are stable too; the edge is
    found to 1e-6.
    """

    @cache
    def log_radius(C: float) -> float:
        return log_radius_with(loop, C, loop.plant.count)

    if loop.poles.is_stable:
        return 0.0
    high = 2 * STRONGEST / first_frequency(loop.plant.arm)
    if log_radius(high) >= 0:
        return math.inf
    for _ in range(DAMPING_DECADES):
        low = high / 10
        if log_radius(low) >= 0:  # a radius is nearly linear in C where C is small
            C = float(brentq(log_radius, low, high, xtol=DAMPING_XTOL * low, rtol=DAMPING_RTOL))
            return C * (1 + MADE_SURE)
        high = low
    return high


def log_radius_with(loop: Sampled, C: float, count: int) -> float:
    """The log spectral radius at C; where two damped modes are one there, at a C that differs by 1e-6.

    Modes that a strong C has settled before the next sample, or overdamped, are left to the remainder, but for a few.
    """
    arm = loop.plant.arm
    outliving = min(alive(arm.having(damping=C), loop.chain), modes_below(arm, SURELY_OVERDAMPED / C))
    for nudge in NUDGES:
        try:
            damped = loop.on(arm.having(damping=C * (1 + nudge)), min(count, KEPT_BEYOND + outliving))
        except ConvergenceError:
            if nudge < 0:
                raise
            continue
        return damped.poles.log_spectral_radius
    raise AssertionError("unreachable")


def alive(arm: Arm, chain: Chain) -> int:
    """How many bending modes of a damped arm outlive the rest of a sample: C w^2 T (1 - f)/2 below 40."""
    remaining = chain.sampling.period * (1 - chain.sampling.fraction)
    return modes_below(arm, math.sqrt(2 * FORGOTTEN / (arm.least_damping * remaining)))


def most_modes(arm: Arm, chain: Chain) -> int:
    """The most that a loop has: of a damped arm those that outlive a sample and ring, and a few; never more than 128.

    What is overdamped has its slow poles beside -1/C, where the remainder has them too.
    """
    if not arm.least_damping:
        return MOST_LOOP_MODES
    outliving = min(alive(arm, chain), modes_below(arm, SURELY_OVERDAMPED / arm.least_damping))
    return min(MOST_LOOP_MODES, MODES_BEYOND + outliving)


def whole_loop(arm: Arm, law: AnyLaw, chain: Chain) -> Sampled:
    """The loop of a damped arm with every mode that outlives a sample and a few, or the first 128.

    With one where the first is far overdamped.
    """
    criticals = arm.damping * first_frequency(arm) / 2
    most = most_modes(arm, acting_law(arm, with_all_gains(arm, law), chain)[1])
    return sampled_loop(arm, law, chain, count=1 if criticals > FAR_BEYOND else max(1, most))


@dataclass(frozen=True)
@record
class Figure:
    """A number with as many significant `digits` as hold: proven up to `band` [rad/s], or for the first `modes` modes.

    One of `band` and `modes` is None.
    """

    value: Annotated[float, Quantity("value")]
    digits: Annotated[int, Quantity("digits")]
    band: Annotated[float | None, Quantity("certified up to", "rad/s", key="up_to_rad_s")]
    modes: Annotated[int | None, Quantity("holds for the first modes")]

    @property
    def is_settled(self) -> Annotated[bool, Quantity("certified", key="certified")]:
        """Whether it is proven in a band."""
        return self.band is not None

    def is_sharp(self, digits: int) -> bool:
        """Whether it is proven in that many."""
        return self.is_settled and (self.digits >= digits or self.value == 0.0)

    @property
    def text(self) -> Annotated[str, Quantity("in these digits")]:
        """The number in these digits; "?" where not one holds."""
        if self.value == 0.0 or math.isinf(self.value):
            return f"{self.value:g}"
        return f"{self.value:.{self.digits}g}" if self.digits else "?"

    def as_text(self, _: int) -> str:
        """The same, for tables."""
        return self.text if self.modes is None else f"{self.text} (first {self.modes} modes)"


Interval = tuple[Figure, Figure]  # both edges of a stable interval


def figure(value: float, digits: int, modes: int, proven: Test, other: Test, *, below: bool, spare: float) -> Figure:
    """A value at which stability turns, a loop being stable `below` it, or above.

    With the most digits that are `proven` (two at least), or else that hold in the `other` loop too; a 0 is tried so
    far, `spare`, from 0.
    """

    def most(test: Test, least: int) -> tuple[int, float]:
        """So many digits that hold, and in which band; by bisection, as an interval of fewer holds that of more."""

        @cache
        def turns(number: int) -> float:
            """The band in which the loop is stable at one end of these digits' interval, not at the other; 0: none."""
            if math.isinf(value):
                return 0.0
            rounded = float(f"{value:.{number}g}")
            half = 0.5 * 10.0 ** (math.floor(math.log10(abs(rounded))) - number + 1) if rounded else spare
            inside, outside = (rounded - half, rounded + half) if below else (rounded + half, rounded - half)
            (stable, band), (still, narrower) = test(inside), (None, 0.0)
            if stable:
                still, narrower = test(outside)
            return min(band, narrower) if still is False else 0.0

        if turns(digits):
            return digits, turns(digits)
        number = least - 1 + bisect_right(range(least, digits), False, key=lambda each: not turns(each))
        return (number, turns(number)) if number >= least else (0, 0.0)

    number, band = most(proven, 2)
    if number:
        return Figure(value, number, band, None)
    return Figure(value, most(other, 1)[0], None, modes)


def shown_windows(loop: Sampled, band: Band | None, name: str) -> list[Interval]:
    """The stable intervals of a number, with more modes than the loop's until they are proven to the last digit."""
    circle, found = None if band is None else band.circle(), []
    for each in _sizes(loop, band, MOST_EDGE_MODES):
        found = _windows(each, band, circle, name)
        if all(edge.is_sharp(GAIN_DIGITS) for pair in found for edge in pair):
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


def _windows(loop: Sampled, band: Band | None, circle: Circle | None, name: str) -> list[Interval]:
    """The intervals of this very loop."""
    other = _with_others(loop)

    def proof(value: float) -> Proof:
        count = None if circle is None else circle.count(loop.having(**{name: value}).weights)
        return None if count is None else count == 0, 0.0 if band is None else band.top

    def edge(value: float, opposite: float, *, below: bool) -> Figure:
        return figure(
            value, GAIN_DIGITS, loop.plant.count, proof,
            lambda each: (other().having(**{name: each}).poles.is_stable, math.inf),
            below=below, spare=_near_zero(opposite),
        )  # fmt: skip

    return [(edge(low, high, below=False), edge(high, low, below=True)) for low, high in stable_windows(loop, name)]


def _near_zero(other: float) -> float:
    return TOLD_FROM_ZERO * (abs(other) if other and math.isfinite(other) else 1.0)


def _with_others(loop: Sampled) -> Callable[[], Sampled]:
    """The loop with another number of modes to compare with, made when first asked for."""
    return cache(lambda: resized(loop, another(loop.plant.count, _most(loop))))


def another(count: int, most: int) -> int:
    """Another number of modes to compare with: twice as many, or half as many where these are too many."""
    return 2 * count if 2 * count <= most else max(1, count // 2)


def _most(loop: Sampled) -> int:
    """The most that edges are looked for with: what a sample leaves nothing of is hard to follow and adds nothing."""
    return min(MOST_EDGE_MODES, most_modes(loop.plant.arm, loop.chain))


def _proof_of(loop: Sampled) -> Proof:
    """Whether a loop is stable with every mode of its band."""
    band = complete_band(loop)
    count = None if band is None else band.circle().count(loop.weights)
    return None if count is None else count == 0, 0.0 if band is None else band.top


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
    other = _with_others(loop)

    def proof(more: float) -> Proof:
        return (None, 0.0) if band is None or more < 0 else _proof_of(band.loop.with_delay(now + more))

    def holds(more: float) -> Proof:
        return None if more < 0 else other().with_delay(now + more).poles.is_stable, math.inf

    return margin, figure(margin.samples, OTHER_DIGITS, modes, proof, holds, below=True, spare=0.0)


def shown_damping(loop: Sampled, count: int) -> Figure:
    """The damping from which on a loop is stable, looked for with so many modes, as a figure [s]."""
    count = min(count, MOST_EDGE_MODES)
    bare, law = loop.on(loop.plant.arm.elastic, count), replace(loop.given, delay=0.0)  # which is in the chain's
    C = damping_edge(bare)
    if C == 0.0:
        return Figure(C, OTHER_DIGITS, None, count)

    def proof(value: float) -> Proof:
        return _proof_of(whole_loop(bare.plant.arm.having(damping=value), law, loop.chain))

    def holds(value: float) -> Proof:
        return log_radius_with(bare, value, another(count, MOST_EDGE_MODES)) < 0, math.inf

    return figure(C, OTHER_DIGITS, count, proof, holds, below=False, spare=0.0)
