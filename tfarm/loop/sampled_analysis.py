"""The analysis of a sampled loop: its verdict, and stability intervals, delay margin, modes and minimum damping."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, NamedTuple

from tfarm.arm import ANGLE_GAIN, MOMENT_GAIN, NAMES, AnyLaw, Arm
from tfarm.arm.chain import Chain
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.crossing import Window
from tfarm.loop.circle_crossings import FACTOR, interval_around, stable_windows, windows_on_circle
from tfarm.loop.curve import LoopAnalysis
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
)
from tfarm.loop.loop_margins import LoopMargins
from tfarm.loop.sampled import Sampled
from tfarm.loop.sampled_modes import ModeTable, mode_table
from tfarm.loop.sampled_verdict import UNDAMPED_MODES, Verdict, sampled_verdict
from tfarm.records import frozen
from tfarm.schema import Quantity


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
        numbers = self.loop.numbers
        if self.loop.is_of_gains:
            return [SampledNumber(n, numbers[n], each, self.interval(n)) for n, each in self.shown.items()]
        names = [name for name, value in numbers.items() if value]
        found = windows_on_circle(self.verdict.full, names) if names else {}
        return [
            SampledNumber(n, numbers[n], each, interval_around(each, numbers[n])) for n, each in found.items()
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
        named = zip(self.loop.in_z.signals, self.loop.rig.analog, strict=True)
        return [name for name, is_analog in named if not is_analog]

    @property
    def loop(self) -> Sampled:
        """The loop of the verdict."""
        return self.verdict.loop

    @cached_property
    def shown(self) -> Mapping[str, list[FigurePair]]:
        """The stability intervals of each gain at the hub, the others constant, by name."""
        found: dict[str, list[FigurePair]] = {name: [] for name in NAMES}
        for name in NAMES:
            # with such a hub the loop of the moment gain is algebraic
            if name != MOMENT_GAIN or not self.loop.arm.has_massless_hub:
                found[name] = shown_windows(self.loop, self.verdict.band, name)
        return found

    def interval(self, name: str) -> Window | None:
        """Return the stability interval around a gain; a gain of 0 on a free angle is the end of its own interval."""
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
        """The delay margin [samples]; of any law but gains at the hub with every mode of the range."""
        return self.delay_limit.figure

    @cached_property
    def delay_limit(self) -> Figure | Limit:
        """The delay margin [samples] to the last digit, with a test of its digits for gains at the hub."""
        if self.loop.is_of_gains:
            return delay_limit(self.loop, self.verdict.band)
        found = delay_margin(self.verdict.full)
        # four digits of the delay margin of a law that is more than gains at the hub
        return Figure(found.samples, 4, None, self.verdict.full.plant.count, found.is_bound)

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
        return [stable_windows(self.verdict.full.with_delay(each), FACTOR) for each in late.tolist()]

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
