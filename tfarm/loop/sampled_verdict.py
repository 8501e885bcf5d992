"""Stability of the sampled loop: certified for every mode of a band, or converged for the first N modes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, NAMES, AnyLaw, Arm
from tfarm.arm.chain import Chain, Sampling
from tfarm.arm.checks import whole
from tfarm.arm.stages import Consumer
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.crossing import Window
from tfarm.dsp.discretise import RULE, rule_in_words
from tfarm.dsp.stages import admit_case, not_covered
from tfarm.errors import ConvergenceError
from tfarm.loop.circle import Band, complete_band
from tfarm.loop.circle_crossings import FACTOR, interval_around, stable_windows, windows_on_circle
from tfarm.loop.curve import LoopAnalysis, LoopContour, LoopVerdict, next_limits
from tfarm.loop.edges import (
    DelayMargin,
    Figure,
    FigurePair,
    Limit,
    LowerBound,
    damping_limit,
    delay_limit,
    delay_margin,
    shown_windows,
    whole_loop,
)
from tfarm.loop.loop_margins import LoopMargins, PhaseCrossover
from tfarm.loop.sampled import OfLoop, Sampled, sampled_loop, with_more_modes
from tfarm.loop.sampled_modes import ModeTable, dominant, mode_table
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.spectrum import modes

SAMPLED_LOOP = Consumer(
    "sampled loop",
    acts=("anti-alias filter", "hub rate", "law", "hold", "delay", "hub damping", "plant"),
    named=("encoder", "amplifier steps", "amplifier range", "DAC steps", "DAC range", "torque limit"),
    partly=("arithmetic",),
    none=("reference", "volts"),
)
# of an undamped arm, whose verdict is of the first modes alone
UNDAMPED_MODES = 20
# of ln of the spectral radius: its largest error with fewer modes
RADIUS_AGREES = 1e-4
# origins of a sampling period
DEFAULT_PERIOD = "tfarm's default period"


@frozen
class Verdict(OfLoop, LoopVerdict):
    """Whether a sampled loop is stable, without z = 1 of a free hub angle.

    `band` is the part of the arm for which it is certified (`loop.circle`).  Without one, as at C = 0, the verdict
    holds for the first `modes_used` modes, those of `loop`, and high ones may grow by 1e-9 a sample.  It `is_converged`
    where that loop's count of unstable poles and largest radius are those of the loop with every mode searched.
    """

    loop: Sampled
    band: Band | None = None
    is_converged: bool = False

    consumer = SAMPLED_LOOP

    @property
    def rule(self) -> Annotated[str, RULE]:
        """The discretisation of the law."""
        return rule_in_words(self.loop.law)

    @property
    def is_settled(
        self,
    ) -> Annotated[
        bool,
        Quantity(key="certified", help="whether the verdict is certified for every mode up to a frequency"),
    ]:
        """Whether the verdict is certified for every mode of the band and every slow real pole."""
        return self.band is not None

    @property
    def band_rad_s(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            "certified up to",
            "rad/s",
            key="up_to_rad_s",
            help="end of the frequency range in which the verdict is certified",
        ),
    ]:
        """End of the range in which the verdict is certified [rad/s]; None without one."""
        return None if self.band is None else self.band.top

    @property
    def is_stable(
        self,
    ) -> Annotated[bool, Quantity(key="stable", help="whether every pole lies inside the unit circle")]:
        """Whether every pole lies inside the unit circle."""
        return self.loop.poles.is_stable

    @property
    def log_radius(
        self,
    ) -> Annotated[
        float,
        Quantity(
            key="log_spectral_radius",
            help="ln of the largest |z| of the closed-loop poles; below 0 of a stable loop",
        ),
    ]:
        """ln of the spectral radius, of every mode of the band, or of the first `modes_used` without a band.

        The verdict needs few modes, but not the later digits of this number.
        """
        return self.full.poles.log_spectral_radius

    @property
    def spectral_radius(
        self,
    ) -> Annotated[
        float,
        Quantity(
            "spectral radius",
            digits=12,
            help="largest |z| of the closed-loop poles but z = 1 of a free hub angle; below 1 if stable",
        ),
    ]:
        """Largest |z|; infinity where it overflows."""
        # of 700 the exponential is a double
        return math.exp(self.log_radius) if self.log_radius < 700.0 else math.inf

    @property
    def unstable_poles(
        self,
    ) -> Annotated[int, Quantity("unstable poles", help="closed-loop poles outside the unit circle")]:
        """Number of poles outside the unit circle."""
        return self.loop.poles.unstable

    @property
    def full(self) -> Sampled:
        """The loop with every mode of the band, for other gains; that of the verdict without a band."""
        return self.loop if self.band is None else self.band.full

    @property
    def word(  # type: ignore[override]
        self,
    ) -> Annotated[
        str,
        Quantity(
            "stability",
            key="verdict",
            help="stable, marginal (largest |z| = 1 within its rounding error) or unstable",
        ),
    ]:
        """stable, marginal or unstable."""
        growth = self.log_radius
        if growth > 0:
            return "unstable"
        if growth < 0:
            return "stable"
        return "marginal"

    @property
    def sentence(
        self,
    ) -> Annotated[
        str, Quantity(key="verdict_in_words", help="stability, its certainty and the dominant pole")
    ]:
        """Stability, its certainty, and the dominant pole."""
        return f"{self.word} ({self.holds_for}); dominant pole: {self.slowest}"

    @property
    def slowest(
        self,
    ) -> Annotated[
        str,
        Quantity(
            "dominant pole",
            key="dominant",
            help="origin of the pole of largest |z|: a mode, the hub or the controller",
        ),
    ]:
        """Origin of the pole of largest radius: a mode, the hub, or a pole of the law."""
        return dominant(self.loop)

    @property
    def holds_for(
        self,
    ) -> Annotated[
        str,
        Quantity(
            "certainty",
            key="certainty",
            help="frequency range or number of modes for which the verdict was shown",
        ),
    ]:
        """The modes for which the verdict is certified."""
        shown = f"{'converged for' if self.is_converged else 'model of'} the first {self.modes_used} modes"
        shown = shown if self.band is None else f"certified up to {self.band.top:.3g} rad/s"
        return f"{shown}, not determined beyond{not_covered(self.consumer, self.loop.chain)}"

    @property
    def range_words(self) -> str:
        """The same in short."""
        if self.band is not None:
            return f"certified to {self.band.top:.3g} rad/s"
        return f"{'converged' if self.is_converged else 'approximate'}, first {self.modes_used} modes"

    @property
    def time_constant(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            "dominant time constant",
            "s",
            help="time constant of the pole of largest |z|, negative of a growing one",
        ),
    ]:
        """Time constant of the dominant pole, below 0 where it grows."""
        if self.log_radius:
            return -self.loop.chain.sampling.period / self.log_radius
        return None

    @property
    def oscillating_poles(self) -> list[tuple[int, complex]]:
        """The oscillating poles s = ln(z)/T by mode, each at the frequency that is nearest to that of its mode."""
        return [*unaliased_poles(self.full).items()]

    @property
    def frequencies(self) -> Real:
        """The grid of the circle, w = q/T."""
        return self.full.rig.grid.q / self.full.period

    @property
    def margins_end(self) -> float:
        """Half the sampling rate."""
        return math.pi / self.full.period

    @cached_property
    def contour(self) -> LoopContour:
        """Around the upper half of the circle, as s = ln(z)/T, and outside the poles on it."""
        # of ln|z|: an open-loop pole so near to the circle is on it
        on_circle = 1e-12
        loop = self.full
        poles = self.full.poles
        s = np.log(1 + loop.rig.open_loop[loop.rig.open_loop != -1])
        is_near = abs(s.real) <= on_circle
        closed = np.asarray(poles.log_radius + 1j * abs(np.angle(poles.z)), dtype=np.complex128)
        return LoopContour(
            grid=self.frequencies,
            on_curve=np.unique(s.imag[is_near & (s.imag >= 0) & (s.imag < math.pi)]) / loop.period,
            closed=closed / loop.period,
            closing=np.empty(0, complex),
            unstable_open=int((s.real > on_circle).sum()),
            unstable=poles.unstable,
            clear=poles.unstable,
            near_axis=int((poles.log_radius == 0).sum()),
        )

    @cached_property
    def factors(self) -> list[Window]:
        """Every stability interval of a factor on the whole law, with the modes of the verdict."""
        return stable_windows(self.loop, FACTOR)

    def gain_limits(self, by_phase: tuple[PhaseCrossover, ...]) -> tuple[float, float]:
        """Return the stability interval of that factor, or what the phase crossovers show."""
        return interval_around(self.factors, 1.0) or next_limits(t for _, t in by_phase)


def unaliased_poles(loop: Sampled) -> dict[int, complex]:
    """Return the poles s = ln(z)/T [1/s], Im s > 0, by mode, each at the frequency nearest to that of its mode.

    Of several poles of a mode it is the least damped one.
    """
    poles = loop.poles
    table = modes(loop.arm, max(1, int(loop.poles.mode.max(initial=1))))
    rounding = 1e-9 * abs(poles.z)
    # a real z < 0 oscillates at half the sampling rate, one > 0 never does, whatever rounding leaves of Im z
    upper = (poles.z.imag > rounding) | ((poles.z.real < 0) & (abs(poles.z.imag) <= rounding))
    mode = poles.mode[upper]
    q = abs(np.angle(poles.z[upper]))
    own = np.where(mode > 0, np.interp(mode, table.index, table.natural_frequency) * loop.period, q)
    turns = 2 * math.pi * np.round((own + [[-1], [1]] * q) / (2 * math.pi))
    aliases = abs([[1], [-1]] * q + turns)
    nearest = abs(aliases - own).argmin(axis=0)
    s = (poles.log_radius[upper] + 1j * aliases[nearest, np.arange(q.size)]) / loop.period
    order = np.argsort(s.real / abs(s))
    return dict(zip(mode[order].tolist(), s[order].tolist(), strict=True))


def sampled_verdict(case: Case, *, count: int | None = None) -> Verdict:
    """Return the verdict on a case, with `count` modes, or enough of them (C > 0), or the first 20 (C = 0).

    They are enough when the number of poles outside the circle is that certified for the whole band, and the largest
    radius that of the loop with every mode of the band.  Raises ParameterError as `sampled_loop` does, and for a count
    outside 1..400.
    """
    # and its rounding error
    radius_noise = 1e-12
    # modes that may be asked for
    most_count = 400
    case = admit_case(SAMPLED_LOOP, case)
    if count is not None:
        count = whole(
            "modes", count, 1, most_count, f"a whole number of flexible modes from 1 to {most_count}"
        )
        return Verdict(sampled_loop(case, count=count))
    if case.arm.has_elastic_link:
        return Verdict(sampled_loop(case, count=UNDAMPED_MODES))
    largest = whole_loop(case)
    band = complete_band(largest)
    full = largest if band is None else band.full
    proven = None if band is None else band.circle.count(full.weights)
    radius = full.poles.log_spectral_radius

    def agrees(fewer: Sampled) -> bool:
        is_near = abs(fewer.poles.log_spectral_radius - radius) <= RADIUS_AGREES * abs(radius) + radius_noise
        return (
            is_near and fewer.poles.unstable == full.poles.unstable and proven in (None, fewer.poles.unstable)
        )

    # 8 modes of the smallest loop, twice as many in each next
    few = min(8, full.plant.count // 2)
    most = full.plant.count
    loops = (with_more_modes(full, few << n) for n in range(most.bit_length()) if 0 < few << n < most)
    loop = next(filter(agrees, loops), full)
    is_proven = (
        proven is not None and loop.poles.is_determined and (proven == 0) == (loop.poles.unstable == 0)
    )
    return Verdict(loop, band if is_proven else None, is_converged=loop is not full)


class SampledNumber(NamedTuple):
    """One number of a law, the gain of a part or a factor on it, and its stability intervals at the samples."""

    number: Annotated[str, Quantity("gain or coefficient", help="name of a number of the controller")]
    value: Annotated[float, Quantity("value", help="present value of the number")]
    windows: Annotated[
        Sequence[Window | FigurePair],
        Quantity(
            "stability intervals",
            key="intervals",
            help="all intervals of the number in which the loop is stable, the others constant",
        ),
    ]
    interval: Annotated[Window | None, Quantity(help="the interval that contains the present value")]


@frozen
class Analysis(LoopAnalysis):
    """A sampled loop: its verdict, and, computed when first read, its limits of stability and its modes.

    `shown`, `delay` and `damping` are limits with their certified digits, or those that other modes confirm; the
    damping is searched with `damping_modes`.
    """

    verdict: Annotated[Verdict, Quantity(flat=True, help="stability of the loop")]
    damping_modes: int = UNDAMPED_MODES

    @property
    def in_band(self) -> LoopMargins | None:
        """The margins up to half the sampling rate; None unless the loop is stable."""
        return self.verdict.in_band

    @cached_property
    def stability_intervals(
        self,
    ) -> Annotated[
        list[SampledNumber],
        Quantity(
            "stability intervals",
            first=True,
            help="stability intervals of each number of the controller, the others constant",
        ),
    ]:
        """One row for each gain at the hub, or number of another law, the others constant."""
        if not self.loop.is_of_gains:
            values = {name: value for name, value in self.loop.numbers.items() if value}
            found = windows_on_circle(self.loop, [*values]) if values else {}
            return [
                SampledNumber(n, values[n], each, interval_around(each, values[n]))
                for n, each in found.items()
            ]
        return [
            SampledNumber(n, self.loop.number(n), each, self.interval(n)) for n, each in self.shown.items()
        ]

    @property
    def delay_margin_samples(
        self,
    ) -> Annotated[
        float,
        Quantity(
            unit="samples",
            key="delay_margin_samples",
            help="smallest additional delay that destabilises the loop, in samples",
        ),
    ]:
        """The further delay in samples, to the last digit."""
        return self.delay_limit.value

    @property
    def delay_margin_seconds(
        self,
    ) -> Annotated[
        float,
        Quantity(
            "delay margin",
            "s",
            4,
            key="delay_margin_s",
            help="smallest additional loop delay that destabilises the loop; 0 of an unstable loop",
        ),
    ]:
        """The further delay in seconds."""
        seconds = self.delay_limit.value * self.loop.chain.sampling.period
        return LowerBound(seconds) if self.is_lower_bound else seconds

    @property
    def is_lower_bound(
        self,
    ) -> Annotated[
        bool,
        Quantity(
            "delay margin: lower bound",
            key="delay_margin_is_lower_bound",
            help="whether the search ended at the margin with the loop still stable",
        ),
    ]:
        """Whether no further delay up to the margin destabilises the loop."""
        return self.delay_limit.is_bound

    @property
    def free_hub_angle(
        self,
    ) -> Annotated[
        str | None,
        Quantity(
            "free hub angle",
            help="pole at z = 1 of a hub angle without feedback, which the verdict leaves out",
        ),
    ]:
        """The pole at z = 1 that the verdict leaves out."""
        return "its pole at z = 1 is left out" if self.loop.has_free_angle else None

    @property
    def unfiltered_signals(
        self,
    ) -> Annotated[list[str], Quantity(help="signals of the controller without an analog anti-alias filter")]:
        """Signals without an anti-alias filter."""
        return [
            name
            for name, analog in zip(self.loop.in_z.signals, self.loop.rig.analog, strict=True)
            if not analog
        ]

    @property
    def loop(self) -> Sampled:
        """The loop of the verdict."""
        return self.verdict.loop

    @cached_property
    def shown(self) -> Mapping[str, list[FigurePair]]:
        """The stability intervals of each gain at the hub, the others constant, by name."""
        without_loop = (MOMENT_GAIN,) if self.loop.plant.arm.has_massless_hub else ()
        return {
            name: [] if name in without_loop else shown_windows(self.loop, self.verdict.band, name)
            for name in NAMES
        }

    def interval(self, name: str) -> Window | None:
        """The stability interval around a gain; a gain of 0 on a free angle is the end of its own interval."""
        value = self.loop.number(name)
        windows = self.windows[name]
        if name == ANGLE_GAIN and value == 0.0 and self.verdict.is_stable:
            return next((window for window in windows if window[0] <= 0.0 < window[1]), None)
        return interval_around(windows, value)

    @property
    def windows(self) -> Mapping[str, list[Window]]:
        """The same intervals without the digits of their edges."""
        return {name: [(low.value, high.value) for low, high in each] for name, each in self.shown.items()}

    @cached_property
    def modes(
        self,
    ) -> Annotated[
        ModeTable, Quantity("modes", help="effect of the controller on each mode, in ln|z| per sample")
    ]:
        """The modes one by one."""
        return mode_table(self.loop)

    @property
    def first_unstable_mode(
        self,
    ) -> Annotated[
        int | None,
        Quantity(
            "first unstable mode", help="lowest mode whose closed-loop pole lies outside the unit circle"
        ),
    ]:
        """The lowest unstable mode."""
        return min(self.modes.index[self.modes.log_radius > 0].tolist(), default=None)

    @cached_property
    def delay(
        self,
    ) -> Annotated[
        Figure,
        Quantity(
            "delay margin in samples",
            key="delay_margin",
            help="smallest additional delay that destabilises the loop, over the sampling period",
        ),
    ]:
        """The delay margin [samples]; of any law but gains at the hub with the modes of the verdict."""
        return self.delay_limit.figure

    @cached_property
    def delay_limit(self) -> Figure | Limit:
        """The delay margin [samples] to the last digit, with a test of its digits for gains at the hub."""
        if self.loop.is_of_gains:
            return delay_limit(self.loop, self.verdict.band)
        found = delay_margin(self.loop)
        # four digits of the delay margin of a law that is more than gains at the hub
        return Figure(found.samples, 4, None, self.verdict.modes_used, found.is_bound)

    @property
    def delay_margin(self) -> DelayMargin:
        """The delay margin, to the last digit."""
        return DelayMargin(self.delay_limit.value, self.is_lower_bound)

    @cached_property
    def minimum_damping(
        self,
    ) -> Annotated[
        Figure | None,
        Quantity(
            "minimum structural damping for stability",
            "s",
            help="Kelvin-Voigt damping C of the link from which on the loop is stable",
        ),
    ]:
        """The damping C [s] from which on the loop is stable, for gains at the hub."""
        return None if self.damping_limit is None else self.damping_limit.figure

    @cached_property
    def damping_limit(self) -> Figure | Limit | None:
        """The same with a test of its digits, which takes as long as the search."""
        if self.loop.is_of_gains:
            return damping_limit(self.loop, self.damping_modes)
        return None

    def factor_intervals(self, delays: Real) -> list[Sequence[Window]]:
        """Return the intervals of a positive factor on the law at each further delay [s] (n,)."""
        sampling = self.loop.chain.sampling
        late = sampling.delay_samples + delays / sampling.period
        return [stable_windows(self.loop.with_delay(each), FACTOR) for each in late.tolist()]

    @property
    def stable_gain_factors(
        self,
    ) -> Annotated[
        list[Window] | None,
        Quantity(
            "stable factors on the controller",
            help="all intervals of a factor on the whole controller in which the loop is stable",
        ),
    ]:
        """All intervals, of a controller that is more than gains at the hub."""
        return None if self.loop.is_of_gains else self.verdict.factors

    @property
    def gain_factors(
        self,
    ) -> Annotated[
        Window | None,
        Quantity(
            "gain margin, factors down and up",
            help="interval around 1 of a factor on the whole controller in which the loop is stable",
        ),
    ]:
        """The stability interval around 1 of a factor on the law; None unless the loop is stable."""
        return interval_around(self.verdict.factors, 1.0)

    @property
    def warnings(
        self,
    ) -> Annotated[
        tuple[str, ...],
        Quantity("warnings", help="unstable poles of the controller that its own zeros cancel"),
    ]:
        """Unstable poles of the law that its own zeros cancel."""
        return self.loop.warnings


def sampled(arm: Arm, law: AnyLaw, chain: Chain | None = None, *, count: int | None = None) -> Analysis:
    """Return the verdict on the sampled loop, stability intervals, delay margin, modes and minimum structural damping.

    `count` is the number of flexible modes, by default enough for the verdict.  Raises ParameterError for a locked hub,
    an algebraic loop, an unknown signal, and a law in z whose period is not the chain's.
    """
    return Analysis(sampled_verdict(Case(arm, law, chain), count=count), count or UNDAMPED_MODES)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledBrief:
    """Whether a loop is stable at a chain's sampling, without z = 1 of a free hub angle.

    `is_stable` and `spectral_radius` are None where that is not determined; `words` then have the reason.
    `period_from` is the origin of the sampling period, "" where that is not known.
    """

    period: Annotated[float, Quantity(unit="s", help="sampling period of the controller")]
    delay_samples: Annotated[float, Quantity(help="delay of the loop in samples")]
    period_from: str
    is_stable: Annotated[
        bool | None, Quantity(key="stable", help="whether every pole lies inside the unit circle")
    ]
    spectral_radius: Annotated[
        float | None,
        Quantity("spectral radius", help="largest |z| of the closed-loop poles; below 1 of a stable loop"),
    ]
    words: Annotated[str, Quantity("sampled loop", key="in_words", help="verdict at the sampling period")]

    @property
    def period_is_default(
        self,
    ) -> Annotated[bool, Quantity(help="whether the sampling period is tfarm's own")]:
        """Whether it is tfarm's: neither of the law, nor of a file or an option."""
        return self.period_from == DEFAULT_PERIOD

    @property
    def short(self) -> str:
        """The verdict in a few words, for a legend or a card."""
        if self.is_stable is None:
            verdict = "undecided"
        elif self.is_stable:
            verdict = "stable"
        else:
            verdict = "UNSTABLE"
        return f"{verdict} when sampled every {1e3 * self.period:g} ms"


def sampled_brief(case: Case) -> SampledBrief:
    """Return the verdict on a case in short.  Raises ParameterError where the arm has no such loop."""
    try:
        return brief_of(sampled_verdict(case), case)
    except ConvergenceError as error:
        return brief_of(error, case)


def brief_of(found: Verdict | ConvergenceError, case: Case) -> SampledBrief:
    """A verdict on a case in short, or the reason that there is none; in capitals where the loop is not stable."""
    laws_period = "the controller's period"
    T = case.chain.sampling.period
    delay = case.chain.sampling.delay_samples
    origin = case.chain.period_from or (DEFAULT_PERIOD if Sampling().period == T else "")
    origin = laws_period if case.law.is_discrete else origin
    verdict = None if isinstance(found, ConvergenceError) else found
    word, _, rest = (f"undecided: {found}" if verdict is None else verdict.sentence).partition(" ")
    is_stable = None if verdict is None else verdict.is_stable
    late = f", {delay:g} sample{'s' * (delay != 1)} late" if delay else ""
    at = f"sampled every {1e3 * T:g} ms{late}{origin and f' ({origin})'}"
    return SampledBrief(
        period=T,
        delay_samples=delay,
        period_from=origin,
        is_stable=is_stable,
        spectral_radius=None if verdict is None else verdict.spectral_radius,
        words=f"{word if is_stable else word.upper()} {rest}, {at}",
    )
