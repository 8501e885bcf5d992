"""Is the sampled loop stable?  Proven for every mode of a band, or said of the first N modes alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

from tfarm.arm import (
    ANGLE_GAIN,
    LISTED,
    MOMENT_GAIN,
    NAMES,
    PLANE,
    TAKEN_OFF,
    AnyLaw,
    Arm,
    HubFeedback,
    arm_and_law,
    cancelled,
    driven,
    unit_of,
)
from tfarm.arm.checks import whole
from tfarm.columns import JSON, REPORT, TERMINAL, Column, Table
from tfarm.crossing import Window
from tfarm.digits import general, plain, singly
from tfarm.dsp.chain import Chain, Sampling, chain_or_usual
from tfarm.dsp.circle import Band, complete_band
from tfarm.dsp.crossings import around, stable_factors, stable_windows
from tfarm.dsp.discretise import described_law, rule_in_words
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
from tfarm.dsp.modes import SAMPLED_MODE_COLUMNS, ModeTable, dominant, mode_table
from tfarm.dsp.sampled import Sampled, resized, sampled_loop
from tfarm.errors import ConvergenceError
from tfarm.records import record

WINDOW_DIGITS = 6  # of the ends of a window, where a person reads
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
    def is_settled(self) -> bool:
        """Whether no mode of the band, in the loop or not, and no slow real pole can change the verdict."""
        return self.band is not None

    @property
    def band_rad_s(self) -> float | None:
        """Up to where the verdict is proven [rad/s]; None where it is not."""
        return None if self.band is None else self.band.top

    @property
    def modes_used(self) -> int:
        """How many flexible modes the loop has."""
        return self.loop.plant.count

    @property
    def is_stable(self) -> bool:
        """Whether every pole lies inside the unit circle."""
        return self.loop.poles.is_stable

    @property
    def log_radius(self) -> float:
        """ln of the spectral radius, of every mode of the band, or of the first `modes_used` where nothing is proven.

        Few modes settle a verdict, but not the later digits of this number.
        """
        return self.full.poles.log_spectral_radius

    @property
    def full(self) -> Sampled:
        """The loop with every mode of the band, for other gains than these; that of the verdict where there is none."""
        return self.loop if self.band is None else self.band.full

    @property
    def word(self) -> str:
        """stable, marginal or unstable."""
        return self.sentence.split(":")[0]

    @property
    def sentence(self) -> str:
        """The verdict in words, beginning with stable, unstable or marginal."""
        growth, what = self.log_radius, self.slowest
        held = f" ({self.holds_for})"
        if growth > 0:
            return f"unstable: {what} grows by {_change(growth)} a sample{held}"
        if growth == 0:
            return f"marginal: {what} neither grows nor decays{held}"
        return f"stable: {what} decays most slowly, by {_change(growth)} a sample{held}"

    @property
    def slowest(self) -> str:
        """What has the largest radius: a mode, the hub, or a pole of the law."""
        return dominant(self.loop)

    @property
    def holds_for(self) -> str:
        """What the verdict holds for, in words."""
        if self.band is None:
            return f"holds for the first {self.modes_used} modes"
        return f"proven for every mode below {self.band.top:.3g} rad/s, not known beyond"


def _change(log_radius: float) -> str:
    """|z| - 1 in size, which for a small ln|z| is ln|z| itself; a factor where it is no small change."""
    return (
        f"{abs(math.expm1(log_radius)):.3g}"
        if log_radius < 1
        else f"a factor of {math.exp(min(log_radius, LARGEST_LOG)):.3g}"
    )


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

    number: str
    value: float
    windows: list[Window]

    @property
    def interval(self) -> Window | None:
        """The window that its value lies in."""
        return around(self.windows, self.value)

    def spans(self, how: Callable[[float, int], str]) -> str:
        """Its windows, each end in six digits."""
        return " ".join(f"({how(low, WINDOW_DIGITS)}, {how(high, WINDOW_DIGITS)})" for low, high in self.windows)


SAMPLED_NUMBER_COLUMNS = (  # of `SampledNumber`
    Column("number", "number of the law"),
    Column("value", "value", printed=singly(general, 6), digits=singly(plain, 5)),
    Column("interval", of=lambda row: row.interval and list(row.interval), on=(JSON,)),
    Column("windows", of=lambda row: [list(window) for window in row.windows], on=(JSON,)),
    Column("", "stable, the others held", of=lambda row: row.spans(general) or "none", on=(TERMINAL,)),
    Column("stable_windows", "stable, the others held", on=REPORT,
           of=lambda row: " ".join(repr(end) for window in row.windows for end in window) or "none",
           shown=lambda row: row.spans(plain) or "none"),
)  # fmt: skip


def sampled_numbers(loop: Sampled) -> list[SampledNumber]:
    """How far the gain of each part of the law may go, the others held."""
    names = [name for name in loop.law.part_gains if loop.number(name)]
    return [SampledNumber(name, loop.number(name), stable_windows(loop, name)) for name in names]


@dataclass(frozen=True)
@record
class Analysis:
    """A sampled loop: its verdict, and found when first read how far it is from its edges, and its modes one by one.

    `shown`, `delay` and `damping` are edges with the digits that are proven, or hold with other modes too;
    the damping is looked for with `damping_modes`.
    """

    verdict: Verdict
    damping_modes: int = UNDAMPED_MODES

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

    @cached_property
    def modes(self) -> ModeTable:
        """The modes one by one."""
        return mode_table(self.loop)

    @property
    def first_unstable_mode(self) -> int | None:
        """The lowest mode that grows."""
        grows = self.modes.index[self.modes.log_radius > 0]
        return int(grows[0]) if grows.size else None

    @cached_property
    def _delay(self) -> tuple[DelayMargin, Figure]:
        return shown_delay(self.loop, self.verdict.band)

    @property
    def delay(self) -> Figure:
        """The further delay that the loop bears [samples]."""
        return self._delay[1]

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

    @cached_property
    def factors(self) -> list[Window]:
        """Every interval of a factor on the whole law in which the loop is stable, with the modes of the verdict."""
        return stable_factors(self.loop)

    @property
    def gain_factors(self) -> Window | None:
        """The interval around 1 in which a factor on the law may lie; None where the loop is not stable."""
        return around(self.factors, 1.0)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Unstable poles of the law that its own zeros cancel."""
        return cancelled(self.loop.given)

    @property
    def rule(self) -> str:
        """How the law came to be one in z."""
        return rule_in_words(self.loop.given)

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


def verdict_answer(verdict: Verdict, sampling: Sampling) -> dict[str, Any]:
    """What is said of any sampled loop: the clock, the verdict, and how far it holds."""
    return {
        "period_s": sampling.period,
        "delay_samples": sampling.delay_samples,
        "verdict": verdict.word,
        "verdict_in_words": verdict.sentence,
        "stable": verdict.is_stable,
        "spectral_radius": math.exp(verdict.log_radius),
        "log_spectral_radius": verdict.log_radius,
        "unstable_poles": verdict.loop.poles.unstable,
        "modes_used": verdict.modes_used,
        "settled": verdict.is_settled,
        "band_rad_s": verdict.band_rad_s,
    }


def sampled_answer(analysis: Analysis) -> dict[str, Any]:
    """The analysis as a dictionary of plain numbers, texts, lists and the table of its modes."""
    verdict, gains = analysis.verdict, analysis.loop.gains
    arm, sampling, windows = verdict.loop.plant.arm, verdict.loop.chain.sampling, analysis.windows.items()
    return {
        "arm": arm.name,
        "law": f"u = -{TAKEN_OFF}; a positive root moment M accelerates the hub{driven(arm)}",
        "input": arm.input,
        "gain_units": {gain.name: unit_of(gain.name, arm) for gain in LISTED},
        **gains.by_name,
        **verdict_answer(verdict, sampling),
        **{f"{name}_interval": (it := analysis.interval(name)) and list(it) for name, _ in windows},
        **{f"{name}_intervals": [list(window) for window in each] for name, each in windows},
        "first_unstable_mode": analysis.first_unstable_mode,
        "delay_margin_samples": analysis.delay_margin.samples,
        "delay_margin_is_lower_bound": analysis.delay_margin.is_bound,
        "required_damping_s": analysis.required_damping,
        "shown": {
            **{
                f"{name}_intervals": [list(map(_figure, pair)) for pair in each]
                for name, each in analysis.shown.items()
            },
            "delay_margin_samples": _figure(analysis.delay),
            "required_damping_s": _figure(analysis.damping),
        },
        "modes": Table(columns=SAMPLED_MODE_COLUMNS, record=analysis.modes),
    }


def _figure(figure: Figure) -> dict[str, Any]:
    """What is shown of a number: in how many digits, and for which modes these hold."""
    return {
        "text": figure.text,
        "digits": figure.digits,
        "settled": figure.is_settled,
        "band_rad_s": figure.band,
        "modes": figure.modes,
    }


def sampled_law_answer(analysis: Analysis) -> dict[str, Any]:
    """The analysis as a dictionary of plain numbers, texts and lists."""
    verdict, loop = analysis.verdict, analysis.loop
    sampling, bound = loop.chain.sampling, analysis.delay_margin
    return {
        "arm": loop.plant.arm.name,
        **described_law(loop.given, loop.plant.arm),
        **verdict_answer(verdict, sampling),
        "nearest": verdict.slowest,
        "warnings": list(analysis.warnings),
        "free_hub_angle": loop.has_free_angle,
        "stable_gain_factors": [list(window) for window in analysis.factors],
        "gain_factors": None if analysis.gain_factors is None else list(analysis.gain_factors),
        "windows": Table(columns=SAMPLED_NUMBER_COLUMNS, record=analysis.numbers),
        "delay_margin_samples": bound.samples,
        "delay_margin_s": bound.samples * sampling.period,
        "delay_margin_is_lower_bound": bound.is_bound,
        "unfiltered_signals": [name for name, analog in zip(loop.in_z.signals, loop.analog, strict=True) if not analog],
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledBrief:
    """Whether a loop holds at a chain's sampling, apart from z = 1 of a free hub angle.

    `is_stable` and `log_radius`, ln of the spectral radius, are None where the loop could not be judged; `sentence`
    then says why.
    """

    sampling: Sampling
    is_stable: bool | None
    log_radius: float | None
    sentence: str

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
    def words(self) -> str:
        """The clock and the verdict, loud where the gains do not hold."""
        verdict, _, rest = self.sentence.partition(":")
        return f"{self.at} these gains are {verdict if self.is_stable else verdict.upper()}:{rest}"

    @property
    def answer(self) -> dict[str, Any]:
        """The brief as a dictionary of plain numbers and texts."""
        size = self.log_radius
        radius = None if size is None else math.exp(size) if size < LARGEST_LOG else math.inf
        return {
            "period_s": self.sampling.period,
            "period_is_default": self.sampling.period == Sampling().period,
            "delay_samples": self.sampling.delay_samples,
            "stable": self.is_stable,
            "spectral_radius": radius,
            "in_words": self.words,
        }


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
