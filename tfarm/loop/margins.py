"""Verdict, margins and stability intervals of the continuous-time loop.

Margins of an unstable loop have no meaning.  At C = 0 the loop function has poles on the axis at ever higher frequency,
so that any delay, however short, destabilises some mode: the exact delay margin is 0.  With K2 != 0 the exact disk
margin is 0 too and the peak sensitivity infinite; with K2 = 0 the hub is passive, and both are finite.  The margins up
to a band are listed in addition, with the band.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated

from tfarm.arm import AnyLaw, Arm
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.crossing import Window
from tfarm.loop.curve import IN_RANGE, LoopAnalysis
from tfarm.loop.loop_margins import (
    DELAY_MARGIN,
    DISK_MARGIN,
    PEAK_COMPLEMENTARY,
    PEAK_SENSITIVITY,
    GainCrossover,
    LoopMargins,
    PhaseCrossover,
)
from tfarm.loop.plane import plane
from tfarm.loop.plane_axes import cell_middles
from tfarm.loop.stability import Stability, is_quiet, stability
from tfarm.loop.theorem import Lyapunov, Signs, lyapunov, signs_of_loop
from tfarm.loop.windows import Windows, reach_words, windows_of
from tfarm.records import frozen
from tfarm.schema import Quantity


@frozen
class Margins(LoopAnalysis):
    """Verdict and margins of a loop; `windows` are the stability intervals of each number of the law, by its name.

    `in_band` are the margins up to the verdict's band; `exact_delay`, `exact_disk` and `exact_peak` those of the whole
    infinite-dimensional loop.  All four are None unless the loop is stable.  The exact ones are None, not determined,
    where at C > 0 nothing bounds |L| beyond the band (the hub's inertia does, where there is some).
    """

    stability: Annotated[Stability, Quantity(flat=True)]

    # is searched at the samples alone
    damping_limit = None

    @property
    def verdict(self) -> Stability:  # type: ignore[override]
        """The verdict."""
        return self.stability

    @property
    def in_band(self) -> Annotated[LoopMargins | None, IN_RANGE]:
        """The margins up to the verdict's band."""
        return self.stability.in_band

    @property
    def exact_delay(
        self,
    ) -> Annotated[
        float | None, replace(DELAY_MARGIN, label=f"{DELAY_MARGIN.label}, exact", key="delay_margin_s")
    ]:
        """The delay margin [s]."""
        return self._exact[0]

    @property
    def exact_disk(
        self,
    ) -> Annotated[
        float | None, replace(DISK_MARGIN, label=f"{DISK_MARGIN.label}, exact", key="disk_margin")
    ]:
        """The disk margin."""
        return self._exact[1]

    @property
    def exact_peak(
        self,
    ) -> Annotated[float | None, replace(PEAK_SENSITIVITY, label=f"{PEAK_SENSITIVITY.label}, exact")]:
        """The peak sensitivity."""
        return self._exact[2]

    @cached_property
    def _exact(self) -> tuple[float | None, float | None, float | None]:
        """Delay margin, disk margin and peak sensitivity of the whole loop; None: not determined."""
        found = self.in_band
        loop = self.stability.loop
        if found is None:
            return None, None, None
        arm = loop.arm
        gains = loop.gains
        of_disk = (found.disk, found.peak_sensitivity)
        is_damped = not arm.is_undamped
        if is_damped and is_quiet(loop, self.stability.band):
            return found.delay, *of_disk
        if gains is None:
            return None, None, None
        if not is_damped and loop.theorem.energy is not None:
            if gains.K2:
                return 0.0, 0.0, math.inf
            # 1 + L = 1 + (Kp + i K1 w) theta, theta real: no dip deepens with w
            return 0.0 if loop.feeds_back else found.delay, *of_disk
        # with a rate gain alone L is in the right half-plane
        is_passive = is_damped and gains.K2 == gains.Kp == 0 and not arm.input_lags
        return (None, *of_disk) if is_passive else (None, None, None)

    @property
    def delay_margin_seconds(self) -> float | None:
        """The delay margin [s], or that in the frequency range where the exact one is not determined."""
        if self.in_band is not None and self.exact_delay is None:
            return self.in_band.delay
        return self.exact_delay

    def factor_intervals(self, delays: Real) -> list[Sequence[Window]]:
        """Return the intervals of a factor on the law, 0 to 4, at each further delay [s] (n,), from a map of both."""
        loop = self.stability.loop
        factors = cell_middles(0.0, 4.0, 40)
        return list(plane(loop, ("delay", "gain"), loop.law.delay + delays, factors).stable_intervals)

    @cached_property
    def windows(self) -> dict[str, Windows]:
        """Stability intervals of each number of the law, found when they are read: a result card has no use for them.

        Raises ConvergenceError where poles cannot be counted along one.
        """
        return windows_of(self.stability)

    @property
    def exact_complementary(
        self,
    ) -> Annotated[float | None, replace(PEAK_COMPLEMENTARY, label=f"{PEAK_COMPLEMENTARY.label}, exact")]:
        """Peak of T = 1 - S of the whole infinite-dimensional loop: not determined, or infinite, where that of S is."""
        is_open = self.exact_peak is None or math.isinf(self.exact_peak)
        if is_open or self.in_band is None:
            return self.exact_peak
        return self.in_band.peak_complementary

    @property
    def gain_margin(
        self,
    ) -> Annotated[
        tuple[float, float] | None,
        Quantity("gain margin, factors down and up", help="factors on L between which the loop stays stable"),
    ]:
        """Factors on the whole law between which the loop is stable."""
        return None if self.in_band is None else self.in_band.gain

    @property
    def lyapunov(
        self,
    ) -> Annotated[
        Lyapunov | None,
        Quantity("Lyapunov function of the paper", help="energy argument for constant gains at the hub"),
    ]:
        """The proof by energy, for gains at the hub."""
        loop = self.stability.loop
        return lyapunov(loop) if loop.is_of_gains else None

    @property
    def passivity(
        self,
    ) -> Annotated[
        Signs | None,
        Quantity(
            "passivity of the controller", help="sign of the controller from hub angle or rate to torque"
        ),
    ]:
        """The sign of a law that is more than gains at the hub."""
        loop = self.stability.loop
        return None if loop.is_of_gains else signs_of_loop(loop)

    @property
    def stability_intervals(
        self,
    ) -> Annotated[
        list[Windows],
        Quantity(
            "stability intervals", first=True, help="of each gain or coefficient alone, the others constant"
        ),
    ]:
        """One row for each number of the law, the others constant; without K2 on a free pin, where it has no loop."""
        return list(self.windows.values())

    @property
    def intervals_note(
        self,
    ) -> Annotated[
        str | None,
        Quantity("limits of the intervals", help="frequency range in which the intervals are known"),
    ]:
        """Frequency range of the intervals where nothing is known beyond it.

        A theorem on the sign of a law, and small gain, hold for that law, not for one with another number.
        """
        loop = self.stability.loop
        words = reach_words(self.windows.values())
        if loop.is_of_gains:
            return None if self.stability.is_known_beyond else words or None
        if not self.windows and loop.arm.has_elastic_link:
            return "no stability intervals: with an undamped link all modes meet on the axis"
        uncounted = [name for name in loop.law.numbers if self.windows and name not in self.windows]
        if uncounted:
            words += f"; poles not counted along {', '.join(uncounted)}"
        return words or None

    @property
    def gain_crossovers(
        self,
    ) -> Annotated[
        tuple[GainCrossover, ...],
        Quantity("gain crossovers, abs(L) = 1", help="all in the frequency range, ascending"),
    ]:
        """All in the frequency range, ascending; empty unless the loop is stable."""
        return () if self.in_band is None else self.in_band.gain_crossovers

    @property
    def phase_crossovers(
        self,
    ) -> Annotated[
        tuple[PhaseCrossover, ...],
        Quantity("phase crossovers, L < 0", help="all in the frequency range, ascending"),
    ]:
        """All in the frequency range, ascending; empty unless the loop is stable."""
        return () if self.in_band is None else self.in_band.phase_crossovers


def margins(arm: Arm, law: AnyLaw, band: float | None = None) -> Margins:
    """Return the verdict, the stability intervals of each number of the law, and the margins of the loop.

    Raises ParameterError where there is no loop, ConvergenceError where poles cannot be counted, or where with damping
    one is on the axis to working precision.
    """
    return Margins(stability(Case(arm, law), band))
