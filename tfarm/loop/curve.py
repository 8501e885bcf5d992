"""The verdict on a loop over either curve, and its loop function as a curve with margins.

The curve is that of Bode, Nichols and sensitivity plots, and of their files.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

import numpy as np

from tfarm.arm import Arm, Law
from tfarm.arm.stages import Consumer
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.crossing import Window
from tfarm.loop.loop import Loop
from tfarm.loop.loop_margins import LoopMargins, PhaseCrossover, margins_along
from tfarm.records import frozen
from tfarm.schema import At, Quantity
from tfarm.spectrum.table import first_frequency

IN_RANGE = Quantity(
    "margins in the frequency range",
    key="in_range",
    help="of L(iw) up to the end of the verdict's frequency range",
)


@frozen(kw_only=True)
class LoopCurve:
    """The loop function L(i w), or L(e^{i w T}) of a sampled loop, on a grid that resolves it: `omega`, `L` (n,).

    `margins` are those of a stable loop, else None.  `continuous` is the continuous-time loop of a sampled one.  A
    `note` names the damping of an arm that has none of its own.
    """

    arm: Arm
    law: Law
    stability: Annotated[str, Quantity("stability", help="stable, marginal or unstable")]
    period: Annotated[float | None, Quantity("sampling period", "s", help="of a sampled loop, else null")] = (
        None
    )
    note: Annotated[str, Quantity("note", help="damping with which an undamped arm is drawn")] = ""
    omega: Annotated[Real, Quantity("frequency", "rad/s", curve=True, help="frequencies of the curve")]
    L: Annotated[Complex, Quantity("L", curve=True, help="loop function at these frequencies")]
    margins: Annotated[LoopMargins | None, IN_RANGE]
    continuous: Annotated[
        LoopCurve | None, Quantity("continuous-time loop", help="of a sampled loop, else null")
    ] = None

    @property
    def gain_margin(
        self,
    ) -> Annotated[
        At | None,
        Quantity(
            "gain margin, upwards",
            "dB",
            key="gain_margin_db",
            help="increase of the loop gain up to which the loop stays stable; null unless it is stable",
        ),
    ]:
        """The gain margin [dB] upwards at its phase crossover."""
        if self.margins is None:
            return None
        return At(*gain_margin(self.margins, self.margins.gain[1]))

    @property
    def magnitude(
        self,
    ) -> Annotated[
        Real, Quantity("|L|", "dB", curve=True, key="magnitude_db", help="size of the loop function")
    ]:
        """|L| [dB]."""
        return decibels(self.L)

    @property
    def phase(
        self,
    ) -> Annotated[Real, Quantity("phase", "deg", curve=True, help="angle of L, above -360 to 0")]:
        """The angle of L in (-360, 0] deg: with -180 in the middle, as a Nichols chart has it."""
        return np.asarray(-np.mod(-np.degrees(np.angle(self.L)), 360.0))

    @property
    def sensitivity(
        self,
    ) -> Annotated[
        Real, Quantity("|S|", "dB", curve=True, key="sensitivity_db", help="size of S = 1/(1 + L)")
    ]:
        """|S| [dB]."""
        return -decibels(1 + self.L)

    @property
    def complementary(
        self,
    ) -> Annotated[
        Real, Quantity("|T|", "dB", curve=True, key="complementary_db", help="size of T = L/(1 + L)")
    ]:
        """|T| [dB]."""
        return self.magnitude + self.sensitivity

    @property
    def curve(self) -> LoopCurve:
        """Itself, as the curve of a record that has one."""
        return self

    @property
    def sides(self) -> tuple[LoopCurve, ...]:
        """The continuous-time loop, where there is one, and this one."""
        return (self,) if self.continuous is None else (self.continuous, self)


class LoopContour(NamedTuple):
    """Data of a loop for Nyquist's criterion: its contour runs up the curve, and closes through points `closing`.

    `grid` are frequencies [rad/s] that resolve L, `on_curve` those of the poles of L on the curve, `closed` the
    closed-loop poles s [1/s], Im s >= 0, apart from those at rest.  `unstable_open` poles of L are unstable, and
    `unstable` of the loop, `clear` of them by more than rounding; `near_axis` more may be on the curve.
    """

    grid: Real
    on_curve: Real
    closed: Complex
    closing: Complex
    unstable_open: int
    unstable: int
    clear: int
    near_axis: int


class LoopVerdict(ABC):
    """The verdict on a loop over either curve, with margins of a stable loop, and the curve of its loop function.

    `full` is the loop with every mode of the verdict's range, `consumer` states the stages of a sample in the verdict,
    `word` is stable, marginal or unstable.
    """

    consumer: ClassVar[Consumer]
    if TYPE_CHECKING:
        # a field here would come before those of each record in its tables
        word: str

    @property
    @abstractmethod
    def full(self) -> Loop:
        """The loop with every mode of the range."""

    @property
    @abstractmethod
    def is_stable(self) -> bool:
        """Whether every pole but that of a free hub angle is stable."""

    @property
    @abstractmethod
    def range_words(self) -> str:
        """The word of certainty and the range of the verdict."""

    @property
    @abstractmethod
    def time_constant(self) -> float | None:
        """Time constant [s] of the dominant pole, below 0 where it grows."""

    @property
    @abstractmethod
    def oscillating_poles(self) -> list[tuple[int, complex]]:
        """The oscillating poles s [1/s], Im s > 0, each with its mode, 0 without one."""

    @property
    @abstractmethod
    def frequencies(self) -> Real:
        """Frequencies [rad/s] that resolve L, ascending."""

    @property
    @abstractmethod
    def margins_end(self) -> float:
        """The end of the frequency range of margins [rad/s]."""

    @property
    @abstractmethod
    def contour(self) -> LoopContour:
        """Nyquist's contour of the loop, with the poles on both sides of the curve."""

    @abstractmethod
    def gain_limits(self, by_phase: tuple[PhaseCrossover, ...]) -> tuple[float, float]:
        """Return the factors on the law between which the loop is stable."""

    @cached_property
    def in_band(self) -> LoopMargins | None:
        """The margins in the frequency range; None unless the loop is stable."""
        if not self.is_stable:
            return None
        return margins_along(self.full, self.frequencies, self.margins_end, self.gain_limits)

    @cached_property
    def curve(self) -> LoopCurve:
        """The loop function on a grid that resolves it."""
        loop = self.full
        drawn = self.frequencies >= lowest_drawn(loop.arm, self.in_band)
        omega, L = refine_frequencies(loop.loop_function, self.frequencies[drawn])
        return LoopCurve(
            arm=loop.arm,
            law=loop.law,
            stability=self.word,
            period=loop.period,
            omega=omega,
            L=L,
            margins=self.in_band,
        )


class LoopAnalysis(ABC):
    """Verdict, margins and limits of stability of a loop over either curve."""

    verdict: LoopVerdict

    @property
    def curve(self) -> LoopCurve:
        """The loop function on a grid that resolves it."""
        return self.verdict.curve

    @property
    @abstractmethod
    def stability_intervals(self) -> Sequence[Any]:
        """A row for each number of the law: the intervals in which the loop is stable, the others constant."""

    @property
    @abstractmethod
    def delay_margin_seconds(self) -> float | None:
        """The smallest further delay [s] that destabilises the loop, as far as it is known."""

    @abstractmethod
    def factor_intervals(self, delays: Real) -> list[Sequence[Window]]:
        """Return the intervals of a factor on the law in which the loop is stable, at each further delay [s] (n,)."""


def next_limits(factors: Iterable[float]) -> tuple[float, float]:
    """Return the factors next to 1 on both sides, 0 and infinity where there are none."""
    factors = list(factors)
    lower = max((t for t in factors if 0 <= t < 1), default=0.0)
    upper = min((t for t in factors if t > 1), default=math.inf)
    return lower, upper


def refine_frequencies(L: Callable[[Complex], Complex], omega: Real, rounds: int = 6) -> tuple[Real, Complex]:
    """Return frequencies (n,), more of them where L or 1 + L (s = i w) changes by much between two, and L there."""
    for number in range(rounds):
        values = np.asarray(L(1j * omega), dtype=np.complex128)
        known = np.isfinite(values) & ((values != 0) | (not values.any()))
        omega = omega[known]
        values = values[known]
        sizes = np.array([values, 1 + values])
        steps = abs(np.diff(np.log(np.where(sizes == 0, 1.0, sizes))))
        (coarse,) = np.nonzero((steps[0] > 0.15) | (steps[1] > 0.4))
        if number < rounds - 1:
            # each once, by rounding too
            omega = np.union1d(omega, np.sqrt(omega[coarse] * omega[coarse + 1]))
    return omega, values


def lowest_drawn(arm: Arm, band: LoopMargins | None) -> float:
    """Return a frequency [rad/s] below the first crossing and the first mode: further down L does not change."""
    crossovers = () if band is None else (*band.gain_crossovers, *band.phase_crossovers)
    lowest = min((w for w, _ in crossovers if w > 0), default=math.inf)
    return float(min(first_frequency(arm), lowest)) / 20.0


def decibels(values: Complex | Real | float) -> Real:
    """Return the size of values [dB]."""
    return np.asarray(20 * np.log10(np.maximum(np.abs(values), LEAST_SIZE)))


def gain_margin(band: LoopMargins, factor: float) -> tuple[float, float | None]:
    """Return the size [dB] of a factor that ends stability, and the frequency [rad/s] at which it does."""
    # a larger margin is none
    if not 1e-9 < factor < 1e9:
        return math.inf, None
    near = (w for w, t in band.phase_crossovers if abs(t / factor - 1) < 1e-6)
    return abs(20 * math.log10(factor)), next(near, None)
