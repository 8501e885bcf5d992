"""Is the sampled loop stable?  Proven for every mode of a band, or said of the first N modes alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Generic

from tfarm.arm import ANGLE_GAIN, LISTED, MOMENT_GAIN, RATE_GAIN, TAKEN_OFF, Arm, HubFeedback, driven, unit_of
from tfarm.arm.checks import whole
from tfarm.columns import Table
from tfarm.crossing import Window
from tfarm.dsp.band import Band, complete_band
from tfarm.dsp.chain import Chain, Sampling, chain_or_usual
from tfarm.dsp.law import SAMPLED_MODE_COLUMNS, ModeTable, growing_mode, mode_table
from tfarm.dsp.law_loop import SampledKind, SampledLaw
from tfarm.dsp.loop import check_loop, resized, sampled_loop
from tfarm.dsp.margins import DelayMargin, around, whole_loop
from tfarm.dsp.shown import Figure, ShownWindows, shown_damping, shown_delay, shown_windows
from tfarm.records import record

UNDAMPED_MODES = 20  # of an undamped arm, whose verdict is of the first modes alone
FEWEST_COMPARED = 8  # modes of the first loop with fewer, twice as many in each next
LARGEST_LOG = 700.0  # whose exponential is a double
RADIUS_AGREES = 1e-4  # of ln of the spectral radius: how well fewer modes must have it
RADIUS_NOISE = 1e-12  # and what it is known to at all
MOST_ASKED = 400  # modes that may be asked for


@dataclass(frozen=True)
@record
class Verdict(Generic[SampledKind]):
    """Whether a sampled loop is stable, apart from z = 1 of a hub angle that nothing regulates.

    `band` is the part of the arm for which it is proven (`tfarm.dsp.band`); None where nothing is, as at C = 0: then
    the verdict holds for the first `modes_used` modes, those of `loop`, and high ones may grow by 1e-9 a sample.
    """

    loop: SampledKind
    band: Band[SampledKind] | None = None

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
    def full(self) -> SampledKind:
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
        if isinstance(self.loop, SampledLaw):
            return self.loop.slowest
        mode = growing_mode(self.loop)
        return f"mode {mode}" if mode else "the hub"

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


def sampled_verdict(arm: Arm, gains: HubFeedback, chain: Chain | None = None, *, count: int | None = None) -> Verdict:
    """The verdict, with `count` modes, or as many as it takes (C > 0), or the first 20 (C = 0).

    As many as it takes: poles of the loop outside the circle are as many as are proven for its whole band, and the
    largest radius is that of the loop with every mode of the band.  Raises ParameterError for a locked hub, for I_h = 0
    with moment feedback (an algebraic loop), and a count outside 1..400.
    """
    chain = chain_or_usual(chain)
    if count is not None:
        count = whole("modes", count, 1, MOST_ASKED, f"a whole number of flexible modes from 1 to {MOST_ASKED}")
        return Verdict(sampled_loop(arm, gains, chain, count=count))
    if arm.has_elastic_link:
        return Verdict(sampled_loop(arm, gains, chain, count=UNDAMPED_MODES))
    check_loop(arm, gains)
    return settled_verdict(whole_loop(arm, gains, chain), lambda band: band.circle().count(gains))


def settled_verdict(largest: SampledKind, outside: Callable[[Band[SampledKind]], int | None]) -> Verdict[SampledKind]:
    """The verdict on a damped arm by as few modes as it takes, from the loop with all: `outside` counts its poles."""
    band = complete_band(largest)
    full = largest if band is None else band.full
    proven, radius = None if band is None else outside(band), full.poles.log_spectral_radius
    for loop in _growing(full):
        agrees = abs(loop.poles.log_spectral_radius - radius) <= RADIUS_AGREES * abs(radius) + RADIUS_NOISE
        if agrees and loop.poles.unstable == full.poles.unstable and proven in (None, loop.poles.unstable):
            break
    is_proven = proven is not None and (proven == 0) == (loop.poles.unstable == 0)
    return Verdict(loop, band if is_proven else None)


def _growing(full: SampledKind) -> Iterator[SampledKind]:
    """Loops of 8, 16, 32 ... modes, and the full one."""
    most = full.plant.count
    number = min(FEWEST_COMPARED, most // 2)
    while 0 < number < most:
        yield resized(full, number)
        number *= 2
    yield full


@dataclass(frozen=True)
@record
class Analysis:
    """Everything that is said of a sampled loop at its gains, with how far each edge is proven.

    `shown` has the stable intervals of each gain, the others held, by name.
    """

    verdict: Verdict
    shown: Mapping[str, ShownWindows]
    modes: ModeTable
    delay_margin: DelayMargin
    delay: Figure
    damping: Figure

    @property
    def K1_windows(self) -> list[Window]:
        """The stable intervals of the gain on the hub rate."""
        return self.shown[RATE_GAIN].windows

    @property
    def K2_windows(self) -> list[Window]:
        """The stable intervals of the gain on the root moment."""
        return self.shown[MOMENT_GAIN].windows

    def interval(self, name: str) -> Window | None:
        """The stable interval around a gain; one on the angle that is 0, where nothing holds that, is its end."""
        value, windows = self.verdict.loop.gains[name], self.shown[name].windows
        if name == ANGLE_GAIN and value == 0.0 and self.verdict.is_stable:
            return next((window for window in windows if window[0] <= 0.0 < window[1]), None)
        return around(windows, value)

    @property
    def required_damping(self) -> float:
        """The damping C [s] from which on the gains are stable."""
        return self.damping.value

    @property
    def first_unstable_mode(self) -> int | None:
        """The lowest mode that grows."""
        grows = self.modes.index[self.modes.log_radius > 0]
        return int(grows[0]) if grows.size else None


def analyse(arm: Arm, gains: HubFeedback, chain: Chain | None = None, *, count: int | None = None) -> Analysis:
    """Verdict, stable intervals of each gain, modes one by one, delay margin, and the damping that makes it safe."""
    chain = chain_or_usual(chain)
    verdict = sampled_verdict(arm, gains, chain, count=count)
    loop, band = verdict.loop, verdict.band
    without_loop = (MOMENT_GAIN,) if arm.has_massless_hub else ()
    return Analysis(
        verdict,
        {
            gain.name: ShownWindows([], []) if gain.name in without_loop else shown_windows(loop, band, gain.name)
            for gain in LISTED
        },
        mode_table(loop),
        *shown_delay(loop, band),
        shown_damping(arm, gains, chain, count=count or UNDAMPED_MODES),
    )


def verdict_answer(verdict: Verdict[Any], sampling: Sampling) -> dict[str, Any]:
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
    verdict, gains = analysis.verdict, analysis.verdict.loop.gains
    arm, sampling, shown = verdict.loop.plant.arm, verdict.loop.chain.sampling, analysis.shown.items()
    return {
        "arm": arm.name,
        "law": f"u = -{TAKEN_OFF}; a positive root moment M accelerates the hub{driven(arm)}",
        "input": arm.input,
        "gain_units": {gain.name: unit_of(gain.name, arm) for gain in LISTED},
        **gains.by_name,
        **verdict_answer(verdict, sampling),
        **{f"{name}_interval": (it := analysis.interval(name)) and list(it) for name, _ in shown},
        **{f"{name}_intervals": [list(window) for window in each.windows] for name, each in shown},
        "first_unstable_mode": analysis.first_unstable_mode,
        "delay_margin_samples": analysis.delay_margin.samples,
        "delay_margin_is_lower_bound": analysis.delay_margin.is_bound,
        "required_damping_s": analysis.required_damping,
        "shown": {
            **{f"{name}_intervals": [list(map(_figure, pair)) for pair in each.figures] for name, each in shown},
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
