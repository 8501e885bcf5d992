"""Limits of stability of a sampled loop, in each number of its law, in delay and in damping, with certified digits.

A number printed with n digits is an interval.  It is certified where the loop is certified stable at one end of it and
unstable at the other, for every mode of the band.  Else the number is converged for the first N modes, with the digits
that a loop of twice as many (or half as many, of many) confirms in the same way.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise
from typing import Annotated, TypeVar

import numpy as np
from scipy.optimize import brentq

from tfarm.arm import Arm
from tfarm.arm.chain import Chain
from tfarm.case import Case
from tfarm.digits import general
from tfarm.dsp.discretise import acting_law
from tfarm.dsp.plant import FORGOTTEN, OVERDAMPED, first_distinct
from tfarm.dsp.pulse import held_amplitude
from tfarm.loop.circle import Band, complete_band
from tfarm.loop.circle_crossings import stable_windows
from tfarm.loop.sampled import Sampled, sampled_loop, with_more_modes
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum import modes_below
from tfarm.spectrum.table import first_frequency

# samples: end of the search of a delay margin
LONGEST_DELAY_SAMPLES = 20.0
# of loops in which edges are searched
MOST_EDGE_MODES = 64

# whether a loop is stable (None: not shown), and the band [rad/s] of that proof
Proof = tuple[bool | None, float]
Test = Callable[[float], Proof]
Edge = TypeVar("Edge")


@frozen
class DelayMargin:
    """The smallest destabilising delay in `samples`; `is_bound` where no delay up to there destabilises the loop."""

    samples: float
    is_bound: bool


def delay_margin(loop: Sampled) -> DelayMargin:
    """Return the delay margin in samples, any fraction; 0 of an unstable loop.

    The step of the scan resolves the fastest mode that may become unstable; the margin is then solved for to 1e-10.
    """
    # of a scan of the delay
    most_steps = 2000
    now = loop.chain.sampling.delay_samples
    T = loop.chain.sampling.period

    def log_radius(more: float) -> float:
        return loop.with_delay(now + more).poles.log_spectral_radius

    if log_radius(0.0) >= 0:
        return DelayMargin(0.0, False)
    poles = loop.plant.poles
    # 4 times the first-order shift of a pole by the feedback: a mode with more damping stays stable
    reach = 4 * loop.push * abs(held_amplitude(poles, T))
    # the feedback may exceed their own damping
    risky = (reach > -poles.real * T) & (poles.imag > 0)
    fastest = (poles.imag[risky] * T).max(initial=np.pi / 4)
    # 12 steps a turn of the fastest mode that may be unstable; 0.1 samples: 18 degrees of a pole at z = -1
    step = float(min(0.1, 2 * np.pi / fastest / 12))
    scanned = step * np.arange(min(most_steps, int(LONGEST_DELAY_SAMPLES / step)) + 1)
    for low, high in pairwise(scanned.tolist()):
        later = loop.with_delay(now + high)
        # 1e-6 within the circle: an eigenvalue there is not polished, as even a double one has an error of 1e-7
        if (abs(later.eigenvalues) > 1 - 1e-6).any() and not later.is_stable:
            # a delay margin is known to 1e-10 samples
            is_between = log_radius(low) < 0
            samples = float(brentq(log_radius, low, high, xtol=1e-10)) if is_between else low
            return DelayMargin(samples, False)
    return DelayMargin(min(most_steps * step, LONGEST_DELAY_SAMPLES), True)


def required_damping(case: Case, *, count: int = 40) -> float:
    """Return the smallest C [s] from which on the loop of a case is stable (without the arm's own C).

    0 where it is stable without damping, inf where it is unstable up to 15 % of critical in the first mode.
    """
    return damping_edge(sampled_loop(case.on(case.arm.elastic), count=count))


def damping_edge(loop: Sampled) -> float:
    """Return the `required_damping` of an undamped loop, with its number of modes, to 1e-6.

    Decades are searched from the strongest C down, so that larger ones on that grid are stable too.
    """

    @cache
    def log_radius(C: float) -> float:
        return log_radius_with(loop, C, loop.plant.count)

    if loop.is_stable:
        return 0.0
    # 0.15 of critical in the first mode: the largest damping of the search
    high = 2 * 0.15 / first_frequency(loop.plant.arm)
    if log_radius(high) >= 0:
        return math.inf
    # 16 decades down from there
    for low in high / 10.0 ** np.arange(1, 16 + 1):
        if log_radius(low) >= 0:
            # a radius is nearly linear in C where C is small
            # C is solved for to 4e-7, and then raised by more, so that the loop is stable there
            C = float(brentq(log_radius, low, 10 * low, xtol=1e-7 * low, rtol=4e-7))
            return C * (1 + 1e-6)
    return float(low)


def log_radius_with(loop: Sampled, C: float, count: int) -> float:
    """Return the log spectral radius at C; where two damped modes are one there, at a C that differs by 1e-6."""

    def loop_at(nudge: float) -> Sampled:
        arm = loop.plant.arm.with_numbers(damping=C * (1 + nudge))
        # 2 modes are kept beyond the last one that does not decay within a sample
        return loop.on(arm, min(count, 2 + count_lasting_modes(arm, loop.chain)))

    # shares of C, tried in turn where two damped modes are one at it
    return first_distinct(loop_at, (0.0, 1e-6, -1e-6)).poles.log_spectral_radius


def count_lasting_modes(arm: Arm, chain: Chain) -> int:
    """Return the number of bending modes of a damped arm that outlive a sample and still ring.

    They have C w^2 T (1 - f)/2 below 40.  Overdamped modes have their slow poles next to -1/C, where those of the
    remainder are too.
    """
    C = arm.least_damping
    remaining = chain.sampling.period * (1 - chain.sampling.fraction)
    forgotten = math.sqrt(2 * FORGOTTEN / (C * remaining))
    return modes_below(arm, min(forgotten, OVERDAMPED / C))


def most_modes(arm: Arm, chain: Chain) -> int:
    """Return the largest number of modes of a loop, at most 128: half a second of work.

    Of a damped arm they are those that outlive a sample, and 4 that decay within it.
    """
    most = 128
    return min(most, 4 + count_lasting_modes(arm, chain)) if arm.least_damping else most


def whole_loop(case: Case) -> Sampled:
    """Return the loop of a case of a damped arm with `most_modes`, or with one mode where that is far overdamped."""
    criticals = case.arm.damping * first_frequency(case.arm) / 2
    most = most_modes(case.arm, acting_law(case)[1])
    # beyond 5 times critical in the first mode: all poles of bending lie left of any line, one mode is enough
    return sampled_loop(case, count=1 if criticals > 5.0 else max(1, most))


@frozen
class Figure:
    """A number with its significant `digits`: certified up to `band` [rad/s], or converged for the first `modes` modes.

    One of `band` and `modes` is None.  `is_bound` where no more than a lower bound is known.
    """

    value: Annotated[float, Quantity("value", help="value of the limit")]
    digits: Annotated[
        int, Quantity("digits", help="significant digits, certified or confirmed by another number of modes")
    ]
    band: Annotated[
        float | None,
        Quantity(
            "certified up to",
            "rad/s",
            key="up_to_rad_s",
            help="end of the frequency range in which every mode is taken into account",
        ),
    ]
    modes: Annotated[
        int | None,
        Quantity(
            "holds for the first modes",
            help="number of modes of the model where the limit is converged and not certified",
        ),
    ]
    is_bound: bool = False

    # as a limit: its digits need no test
    is_sharp = True

    @property
    def figure(self) -> Figure:
        """Itself, as a limit whose digits are known."""
        return self

    @property
    def is_settled(
        self,
    ) -> Annotated[
        bool,
        Quantity(
            "certified",
            key="certified",
            help="whether the limit is certified for every mode up to a frequency",
        ),
    ]:
        """Whether it is certified in a band."""
        return self.band is not None

    @property
    def text(
        self,
    ) -> Annotated[
        str, Quantity("in these digits", help="the value in its significant digits, ? where there are none")
    ]:
        """The number in these digits; "?" where there are none."""
        if self.value == 0.0 or math.isinf(self.value):
            return f"{self.value:g}"
        return f"{self.value:.{self.digits}g}" if self.digits else "?"

    def as_text(self, _: int) -> str:
        """Return the same, for tables; "≥ 20" of a lower bound, "not determined" without digits."""
        shown = f"≥ {self.text}" if self.is_bound else self.text.replace("?", "not determined")
        return shown if self.modes is None else f"{shown} (first {self.modes} modes)"


class LowerBound(float):
    """A number of which no more than a lower bound is known: "≥ 0.2" in tables, a number in JSON."""

    def as_text(self, digits: int) -> str:
        """Return the bound in some digits."""
        return f"≥ {general(self, digits)}"


# both edges of a stable interval
FigurePair = tuple[Figure, Figure]


@dataclass(frozen=True)
class Limit:
    """A limit of stability at `value`, with a loop stable `below` it or above, and a test of its digits.

    Significant are the most digits that are `proven` (at least two), or else that the `other` loop confirms.  An edge
    at 0 is tested at the distance `spare` from 0.
    """

    value: float
    digits: int
    modes: int
    proven: Test
    other: Test
    below: bool
    spare: float = 0.0

    is_bound = False

    @property
    def is_sharp(self) -> bool:
        """Whether all digits are proven."""
        return self._proof(self.digits) > 0.0

    @cached_property
    def figure(self) -> Figure:
        """The limit with its significant digits."""
        number = self._most_digits(self._proof, 2)
        if number:
            return Figure(self.value, number, self._proof(number), None)
        number = self._most_digits(lambda each: self._band(self.other, each), 1)
        return Figure(self.value, number, None, self.modes)

    @cached_property
    def _proof(self) -> Callable[[int], float]:
        """The band in which a number of digits is proven; 0: not proven."""
        return cache(lambda number: self._band(self.proven, number))

    def _most_digits(self, band: Callable[[int], float], least: int) -> int:
        """Return the most digits with a band, 0 for none; by bisection, as intervals of fewer contain the others."""
        if band(self.digits):
            return self.digits
        number = least - 1 + bisect_right(range(least, self.digits), False, key=lambda each: not band(each))
        return number if number >= least else 0

    def _band(self, test: Test, number: int) -> float:
        """Return the band in which the loop is stable at one end of the interval of these digits alone; 0: none."""
        if math.isinf(self.value):
            return 0.0
        rounded = float(f"{self.value:.{number}g}")
        half = 0.5 * 10.0 ** (math.floor(math.log10(abs(rounded))) - number + 1) if rounded else self.spare
        outwards = half if self.below else -half
        is_stable_inside, band = test(rounded - outwards)
        if not is_stable_inside:
            return 0.0
        is_stable_outside, narrower = test(rounded + outwards)
        return min(band, narrower) if is_stable_outside is False else 0.0


def shown_windows(loop: Sampled, band: Band | None, name: str) -> list[FigurePair]:
    """Return the stability intervals of a number, with more and more modes until all digits are certified."""
    # that are printed where all are certified
    gain_digits = 6

    def proof(value: float) -> Proof:
        return _proof(band, loop.with_number(name, value))

    def search(loop: Sampled) -> list[tuple[Limit, Limit]]:
        other = _comparison(loop)
        modes = loop.plant.count

        def confirmation(value: float) -> Proof:
            return other().with_number(name, value).is_stable, math.inf

        def edge(value: float, opposite: float, *, below: bool) -> Limit:
            # 1e-6 of the other edge of an interval: distance from 0 at which an edge at 0 is tested
            spare = 1e-6 * (abs(opposite) if opposite and math.isfinite(opposite) else 1.0)
            return Limit(value, gain_digits, modes, proof, confirmation, below=below, spare=spare)

        return [
            (edge(low, high, below=False), edge(high, low, below=True))
            for low, high in stable_windows(loop, name)
        ]

    def is_sharp(windows: list[tuple[Limit, Limit]]) -> bool:
        return all(edge.is_sharp for pair in windows for edge in pair)

    edges = _most_certain(loop, band, MOST_EDGE_MODES, search, is_sharp)
    return [(low.figure, high.figure) for low, high in edges]


def _most_certain(
    loop: Sampled,
    band: Band | None,
    most: int,
    search: Callable[[Sampled], Edge],
    is_sharp: Callable[[Edge], bool],
) -> Edge:
    """Return the edge with at most MOST_EDGE_MODES modes; in a certified band with twice as many until `is_sharp`."""
    loop = with_more_modes(loop, min(loop.plant.count, MOST_EDGE_MODES))
    result = search(loop)
    count = loop.plant.count
    most = min(most, _most(loop)) if band is not None else 0
    while count < most and not is_sharp(result):
        count = min(2 * count, most)
        result = search(with_more_modes(loop, count))
    return result


def _comparison(loop: Sampled) -> Callable[[], Sampled]:
    """Return the loop with another number of modes to compare with, made at its first use."""
    return cache(lambda: with_more_modes(loop, another(loop.plant.count, _most(loop))))


def another(count: int, most: int) -> int:
    """Return another number of modes to compare with: twice as many, or half as many where these are too many."""
    return 2 * count if 2 * count <= most else max(1, count // 2)


def _most(loop: Sampled) -> int:
    """Return the largest number of modes of a search of edges: modes that decay within a sample add nothing."""
    return min(MOST_EDGE_MODES, most_modes(loop.plant.arm, loop.chain))


def _proof(band: Band | None, loop: Sampled) -> Proof:
    """Return whether a loop is stable with every mode of a band, by its discs on the circle."""
    if band is None:
        return None, 0.0
    count = band.circle.count(loop.weights)
    return None if count is None else count == 0, band.top


def delay_limit(loop: Sampled, band: Band | None, digits: int = 4) -> Figure | Limit:
    """Return the delay margin [samples], with more and more modes until all its digits are certified.

    0 is as certain as the verdict that the loop is unstable.
    """
    now = loop.chain.sampling.delay_samples

    def proof(more: float) -> Proof:
        if band is None or more < 0:
            return None, 0.0
        later = band.loop.with_delay(now + more)
        return _proof(complete_band(later), later)

    def search(loop: Sampled) -> Figure | Limit:
        margin = delay_margin(loop)
        modes = loop.plant.count
        other = _comparison(loop)

        def confirmation(more: float) -> Proof:
            return None if more < 0 else other().with_delay(now + more).is_stable, math.inf

        if margin.samples == 0.0 and band:
            return Figure(0.0, digits, band.top, None)
        if margin.samples == 0.0 or margin.is_bound:
            return Figure(margin.samples, digits, None, modes, is_bound=margin.is_bound)
        return Limit(margin.samples, digits, modes, proof, confirmation, below=True)

    return _most_certain(loop, band, MOST_EDGE_MODES // 2, search, lambda limit: limit.is_sharp)


def damping_limit(loop: Sampled, count: int, digits: int = 4) -> Figure | Limit:
    """Return the damping [s] from which on a loop is stable, by a search with `count` modes."""
    count = min(count, MOST_EDGE_MODES)
    bare = loop.on(loop.plant.arm.elastic, count)
    # its delay is in the chain
    case = Case(bare.plant.arm, replace(loop.law, delay=0.0), loop.chain)
    C = damping_edge(bare)
    if C == 0.0:
        return Figure(C, digits, None, count)

    def proof(value: float) -> Proof:
        whole = whole_loop(case.on(case.arm.with_numbers(damping=value)))
        return _proof(complete_band(whole), whole)

    def confirmation(value: float) -> Proof:
        return log_radius_with(bare, value, another(count, MOST_EDGE_MODES)) < 0, math.inf

    return Limit(C, digits, count, proof, confirmation, below=False)
