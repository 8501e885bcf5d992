"""Is the sampled loop stable?  Proven for every mode of a band, or said of the first N modes alone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, NamedTuple

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, NAMES, PLANE, AnyLaw, Arm, HubFeedback, arm_and_law, cancelled
from tfarm.arm.checks import whole
from tfarm.crossing import Window
from tfarm.dsp.chain import Chain, Sampling, chain_or_usual
from tfarm.dsp.circle import Band, complete_band
from tfarm.dsp.crossings import around, stable_factors, stable_windows
from tfarm.dsp.discretise import rule_in_words
from tfarm.dsp.edges import (
    DelayMargin,
    Figure,
    Interval,
    delay_margin,
    shown_damping,
    shown_delay,
    shown_windows,
    whole_loop,
)
from tfarm.dsp.modes import ModeTable, dominant, mode_table
from tfarm.dsp.sampled import Sampled, resized, sampled_loop
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.response.controller import Controller, controller
from tfarm.schema import Quantity

LAW_DELAY_DIGITS = 4  # of the delay margin of a law that is more than gains at the hub
UNDAMPED_MODES = 20  # of an undamped arm, whose verdict is of the first modes alone
FEWEST_COMPARED = 8  # modes of the first loop with fewer, twice as many in each next
LARGEST_LOG = 700.0  # whose exponential is a double
RADIUS_AGREES = 1e-4  # of ln of the spectral radius: how well fewer modes must have it
RADIUS_NOISE = 1e-12  # and what it is known to at all
MOST_ASKED = 400  # modes that may be asked for
PERIOD_SHARES = (0.1, 0.5, 1.0, 2.0, 5.0)  # of the chain's own period


@dataclass(frozen=True)
@record
class Verdict:
    """Whether a sampled loop is stable, apart from z = 1 of a hub angle that nothing regulates.

    `band` is the part of the arm for which it is proven (`tfarm.dsp.circle`); None where nothing is, as at C = 0: then
    the verdict holds for the first `modes_used` modes, those of `loop`, and high ones may grow by 1e-9 a sample.
    """

    loop: Sampled
    band: Band | None = None

    @property
    def controller(self) -> Annotated[Controller, Quantity(flat=True)]:
        """Arm and law in words, as results name them."""
        return controller(self.loop.given, self.loop.plant.arm)

    @property
    def rule(self) -> Annotated[str, Quantity("discretisation")]:
        """How the law came to be one in z."""
        return rule_in_words(self.loop.given)

    @property
    def sampling(self) -> Annotated[Sampling, Quantity(flat=True)]:
        """Period and delay."""
        return self.loop.chain.sampling

    @property
    def is_settled(self) -> Annotated[bool, Quantity(key="certified")]:
        """Whether no mode of the band, in the loop or not, and no slow real pole can change the verdict."""
        return self.band is not None

    @property
    def band_rad_s(self) -> Annotated[float | None, Quantity("certified up to", "rad/s", key="up_to_rad_s")]:
        """Up to where the verdict is proven [rad/s]; None where it is not."""
        return None if self.band is None else self.band.top

    @property
    def modes_used(self) -> Annotated[int, Quantity("flexible modes")]:
        """How many flexible modes the loop has."""
        return self.loop.plant.count

    @property
    def is_stable(self) -> Annotated[bool, Quantity(key="stable")]:
        """Whether every pole lies inside the unit circle."""
        return self.loop.poles.is_stable

    @property
    def log_radius(self) -> Annotated[float, Quantity(key="log_spectral_radius")]:
        """ln of the spectral radius, of every mode of the band, or of the first `modes_used` where nothing is proven.

        Few modes settle a verdict, but not the later digits of this number.
        """
        return self.full.poles.log_spectral_radius

    @property
    def spectral_radius(self) -> Annotated[float, Quantity("spectral radius", digits=12)]:
        """Largest |z|."""
        return math.exp(self.log_radius)

    @property
    def unstable_poles(self) -> Annotated[int, Quantity("unstable poles")]:
        """Outside the unit circle."""
        return self.loop.poles.unstable

    @property
    def full(self) -> Sampled:
        """The loop with every mode of the band, for other gains than these; that of the verdict where there is none."""
        return self.loop if self.band is None else self.band.full

    @property
    def word(self) -> Annotated[str, Quantity("stability", key="verdict")]:
        """stable, marginal or unstable."""
        growth = self.log_radius
        return "unstable" if growth > 0 else "stable" if growth < 0 else "marginal"

    @property
    def sentence(self) -> Annotated[str, Quantity(key="verdict_in_words")]:
        """Stability, and of which modes it is known."""
        return f"{self.word} ({self.holds_for}); dominant pole: {self.slowest}"

    @property
    def slowest(self) -> Annotated[str, Quantity("dominant pole", key="dominant")]:
        """What has the largest radius: a mode, the hub, or a pole of the law."""
        return dominant(self.loop)

    @property
    def holds_for(self) -> Annotated[str, Quantity("certainty", key="certainty")]:
        """The modes for which the verdict is certified."""
        if self.band is None:
            return f"converged for the first {self.modes_used} modes, not determined beyond"
        return f"certified up to {self.band.top:.3g} rad/s, not determined beyond"

    @property
    def time_constant(self) -> Annotated[float | None, Quantity("dominant time constant", "s")]:
        """That of the dominant pole, below 0 where it grows."""
        return -self.loop.chain.sampling.period / self.log_radius if self.log_radius else None


def sampled_verdict(arm: Arm, law: AnyLaw, chain: Chain | None = None, *, count: int | None = None) -> Verdict:
    """The verdict, with `count` modes, or as many as it takes (C > 0), or the first 20 (C = 0).

    As many as it takes: poles of the loop outside the circle are as many as are proven for its whole band, and the
    largest radius is that of the loop with every mode of the band.  Raises ParameterError for what `sampled_loop`
    refuses, and a count outside 1..400.
    """
    chain = chain_or_usual(chain)
    if count is not None:
        count = whole("modes", count, 1, MOST_ASKED, f"a whole number of flexible modes from 1 to {MOST_ASKED}")
        return Verdict(sampled_loop(arm, law, chain, count=count))
    if arm.has_elastic_link:
        return Verdict(sampled_loop(arm, law, chain, count=UNDAMPED_MODES))
    return settled_verdict(whole_loop(arm, law, chain))


def settled_verdict(largest: Sampled) -> Verdict:
    """The verdict on a damped arm by as few modes as it takes, from the loop with all."""
    band = complete_band(largest)
    full = largest if band is None else band.full
    proven, radius = None if band is None else band.circle().count(full.weights), full.poles.log_spectral_radius
    for loop in _growing(full):
        agrees = abs(loop.poles.log_spectral_radius - radius) <= RADIUS_AGREES * abs(radius) + RADIUS_NOISE
        if agrees and loop.poles.unstable == full.poles.unstable and proven in (None, loop.poles.unstable):
            break
    is_proven = proven is not None and (proven == 0) == (loop.poles.unstable == 0)
    return Verdict(loop, band if is_proven else None)


def _growing(full: Sampled) -> Iterator[Sampled]:
    """Loops of 8, 16, 32 ... modes, and the full one."""
    most = full.plant.count
    number = min(FEWEST_COMPARED, most // 2)
    while 0 < number < most:
        yield resized(full, number)
        number *= 2
    yield full


class SampledNumber(NamedTuple):
    """One number of a law, the gain of a part or a factor on it, and how far it may go alone at the samples."""

    number: Annotated[str, Quantity("gain or coefficient")]
    value: Annotated[float, Quantity("value")]
    windows: Annotated[Sequence[Window | Interval], Quantity("stability intervals", key="intervals")]
    interval: Annotated[Window | None, Quantity()]


def sampled_numbers(loop: Sampled) -> list[SampledNumber]:
    """How far the gain of each part of the law may go, the others held."""
    names = [name for name in loop.law.part_gains if loop.number(name)]
    return [number_of(name, loop.number(name), stable_windows(loop, name)) for name in names]


def number_of(name: str, value: float, windows: list[Window]) -> SampledNumber:
    """A number with the interval that its value lies in."""
    return SampledNumber(name, value, windows, around(windows, value))


@dataclass(frozen=True)
@record
class Analysis:
    """A sampled loop: its verdict, and found when first read how far it is from its edges, and its modes one by one.

    `shown`, `delay` and `damping` are edges with the digits that are proven, or hold with other modes too;
    the damping is looked for with `damping_modes`.
    """

    verdict: Annotated[Verdict, Quantity(flat=True)]
    damping_modes: int = UNDAMPED_MODES

    @property
    def stability_intervals(self) -> Annotated[list[SampledNumber], Quantity("stability intervals")]:
        """A row a gain at the hub, or a number of another law, the others held."""
        if not self.loop.is_of_gains:
            return self.numbers
        return [SampledNumber(n, self.loop.number(n), each, self.interval(n)) for n, each in self.shown.items()]

    @property
    def delay_margin_samples(self) -> Annotated[float, Quantity(unit="samples", key="delay_margin_samples")]:
        """The further delay in samples, to the last digit."""
        return self.delay_margin.samples

    @property
    def delay_margin_seconds(self) -> Annotated[float, Quantity("delay margin", "s", 4, key="delay_margin_s")]:
        """The further delay in seconds."""
        return self.delay_margin.samples * self.loop.chain.sampling.period

    @property
    def is_lower_bound(self) -> Annotated[bool, Quantity("delay margin or more", key="delay_margin_is_lower_bound")]:
        """Whether no further delay up to there makes the loop unstable."""
        return self.delay_margin.is_bound

    @property
    def free_hub_angle(self) -> Annotated[str | None, Quantity("free hub angle")]:
        """The pole at z = 1 from which the verdict is apart."""
        return "its pole at z = 1 is left out" if self.loop.has_free_angle else None

    @property
    def unfiltered_signals(self) -> Annotated[list[str], Quantity()]:
        """Signals without an anti-alias filter."""
        return [name for name, analog in zip(self.loop.in_z.signals, self.loop.analog, strict=True) if not analog]

    @property
    def loop(self) -> Sampled:
        """The loop of the verdict."""
        return self.verdict.loop

    @cached_property
    def shown(self) -> Mapping[str, list[Interval]]:
        """The stable intervals of each gain at the hub, the others held, by name."""
        without_loop = (MOMENT_GAIN,) if self.loop.plant.arm.has_massless_hub else ()
        return {
            name: [] if name in without_loop else shown_windows(self.loop, self.verdict.band, name) for name in NAMES
        }

    def interval(self, name: str) -> Window | None:
        """The stable interval around a gain; one on the angle that is 0, where nothing holds that, is its end."""
        value, windows = self.loop.number(name), self.windows[name]
        if name == ANGLE_GAIN and value == 0.0 and self.verdict.is_stable:
            return next((window for window in windows if window[0] <= 0.0 < window[1]), None)
        return around(windows, value)

    @property
    def windows(self) -> Mapping[str, list[Window]]:
        """The same intervals without the digits of their edges."""
        return {name: [(low.value, high.value) for low, high in each] for name, each in self.shown.items()}

    @property
    def modes(self) -> Annotated[ModeTable, Quantity("modes", help="ln|z| per sample")]:
        """The modes one by one."""
        return self._modes

    @cached_property
    def _modes(self) -> ModeTable:
        return mode_table(self.loop)

    @property
    def first_unstable_mode(self) -> Annotated[int | None, Quantity("first unstable mode")]:
        """The lowest mode that grows."""
        grows = self.modes.index[self.modes.log_radius > 0]
        return int(grows[0]) if grows.size else None

    @cached_property
    def _delay(self) -> tuple[DelayMargin, Figure]:
        return shown_delay(self.loop, self.verdict.band)

    @property
    def delay(self) -> Annotated[Figure, Quantity("delay margin in samples", key="delay_margin")]:
        """The further delay that the loop can take [samples]; of a law with the modes of the verdict."""
        if self.loop.is_of_gains:
            return self._delay[1]
        return Figure(self.delay_margin.samples, LAW_DELAY_DIGITS, None, self.verdict.modes_used)

    @cached_property
    def delay_margin(self) -> DelayMargin:
        """The further delay that the loop bears; of any law but gains at the hub with the modes of the verdict."""
        return self._delay[0] if self.loop.is_of_gains else delay_margin(self.loop)

    @cached_property
    def damping(self) -> Figure:
        """The damping C [s] from which on the loop is stable."""
        return shown_damping(self.loop, self.damping_modes)

    @property
    def required_damping(self) -> float:
        """The damping C [s] from which on the loop is stable."""
        return self.damping.value

    @property
    def minimum_damping(self) -> Annotated[Figure | None, Quantity("minimum structural damping for stability", "s")]:
        """The same with its digits, for gains at the hub."""
        return self.damping if self.loop.is_of_gains else None

    @cached_property
    def factors(self) -> list[Window]:
        """Every interval of a factor on the whole law in which the loop is stable, with the modes of the verdict."""
        return stable_factors(self.loop)

    @property
    def stable_gain_factors(self) -> Annotated[list[Window] | None, Quantity("stable factors on the controller")]:
        """All intervals, of a controller that is more than gains at the hub."""
        return None if self.loop.is_of_gains else self.factors

    @property
    def gain_factors(self) -> Annotated[Window | None, Quantity("gain margin, factors down and up")]:
        """The interval around 1 in which a factor on the law may lie; None where the loop is not stable."""
        return around(self.factors, 1.0)

    @property
    def warnings(self) -> Annotated[tuple[str, ...], Quantity("warnings")]:
        """Unstable poles of the law that its own zeros cancel."""
        return cancelled(self.loop.given)

    @property
    def rule(self) -> str:
        """How the law came to be one in z."""
        return self.verdict.rule

    @cached_property
    def numbers(self) -> list[SampledNumber]:
        """How far the gain of each part of the law may go, the others held, with the modes of the verdict."""
        return sampled_numbers(self.loop)


def sampled(arm: Arm, law: AnyLaw, chain: Chain | None = None, *, count: int | None = None) -> Analysis:
    """Is the sampled loop stable?  With stable intervals of each number of the law, the further delay that it bears,
    its modes one by one, and the structural damping that makes it stable.

    `count` is the number of flexible modes, as many as it takes if not given.  Raises ParameterError for a locked hub,
    an algebraic loop, an unknown signal, and a law in z whose period is not the chain's.
    """
    arm, law = arm_and_law(arm, law)
    return Analysis(sampled_verdict(arm, law, chain, count=count), count or UNDAMPED_MODES)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledBrief:
    """Whether a loop holds at a chain's sampling, apart from z = 1 of a free hub angle.

    `is_stable` and `log_radius`, ln of the spectral radius, are None where the loop could not be judged; `sentence`
    then says why.
    """

    sampling: Sampling
    is_stable: Annotated[bool | None, Quantity(key="stable")]
    log_radius: float | None
    sentence: str

    @property
    def period(self) -> Annotated[float, Quantity(unit="s")]:
        """The sampling period."""
        return self.sampling.period

    @property
    def period_is_default(self) -> Annotated[bool, Quantity()]:
        """Whether it is tfarm's, not the rig's own."""
        return self.sampling.period == Sampling().period

    @property
    def delay_samples(self) -> Annotated[float, Quantity()]:
        """The delay of the chain."""
        return self.sampling.delay_samples

    @property
    def spectral_radius(self) -> Annotated[float | None, Quantity("spectral radius")]:
        """Largest |z|, infinity where it is no double."""
        size = self.log_radius
        return None if size is None else math.exp(size) if size < LARGEST_LOG else math.inf

    @property
    def at(self) -> str:
        """The clock in words, and whether it is only tfarm's default: a file that names no period has that."""
        T, delay = self.sampling.period, self.sampling.delay_samples
        late = f", {delay:g} samples late" if delay else ""
        default = " (tfarm's default period)" if Sampling().period == T else ""
        return f"sampled every {1e3 * T:g} ms{late}{default}"

    @property
    def short(self) -> str:
        """The verdict in a few words, for a legend or a card."""
        verdict = "undecided" if self.is_stable is None else "stable" if self.is_stable else "UNSTABLE"
        return f"{verdict} when sampled every {1e3 * self.sampling.period:g} ms"

    @property
    def words(self) -> Annotated[str, Quantity("sampled loop", key="in_words")]:
        """Sampling period and verdict, in capitals where the loop is not stable."""
        word, _, rest = self.sentence.partition(" ")
        return f"{word if self.is_stable else word.upper()} {rest}, {self.at}"


def sampled_brief(arm: Arm, law: AnyLaw, chain: Chain) -> SampledBrief:
    """The verdict on a law at the clock of a chain.  Raises ParameterError where the arm has no such loop."""
    try:
        verdict = sampled_verdict(arm, law, chain)
    except ConvergenceError as error:
        return SampledBrief(sampling=chain.sampling, is_stable=None, log_radius=None, sentence=f"undecided: {error}")
    return brief_of(verdict, chain)


def brief_of(verdict: Verdict, chain: Chain) -> SampledBrief:
    """A verdict in short."""
    return SampledBrief(
        sampling=chain.sampling,
        is_stable=verdict.is_stable,
        log_radius=float(verdict.log_radius),
        sentence=verdict.sentence,
    )


class AtPeriod(NamedTuple):
    """The verdict at one sample period [s], and every stable interval of each gain, by name."""

    period: float
    verdict: Verdict
    windows: Mapping[str, list[Window]]


def at_periods(arm: Arm, gains: HubFeedback, chain: Chain) -> tuple[AtPeriod, ...]:
    """The gains from a tenth to five times the chain's own period.  Raises ParameterError for an arm without a loop."""
    rows = []
    for share in PERIOD_SHARES:
        period = float(f"{share * chain.sampling.period:.12g}")  # 1 ms, and no 1.0000000000000002 ms
        verdict = sampled_verdict(arm, gains, replace(chain, sampling=replace(chain.sampling, period=period)))
        rows.append(AtPeriod(period, verdict, {name: stable_windows(verdict.full, name) for name in PLANE}))
    return tuple(rows)
