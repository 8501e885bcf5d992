"""The loop function as a curve with its margins: of Bode, Nichols and sensitivity plots, and of their files."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch
from typing import Annotated, Any

import numpy as np

from tfarm.arm import AnyLaw, Arm
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.records import record
from tfarm.schema import At, Quantity
from tfarm.spectrum.table import first_frequency

from .margins import BELOW_SLOWEST, IN_RANGE, LoopMargins, Margins, dense

MOST_FACTOR = 1e9  # on the controller: a larger gain margin is none
SAME_FACTOR = 1e-6  # relative: by no more the gain margin differs from the factor at its phase crossover
LONGEST_STEP, LONGEST_OF_S, FINER_ROUNDS = 0.15, 0.4, 6  # of ln L and ln S, and rounds in which longer steps are halved


@dataclass(frozen=True, kw_only=True)
@record
class LoopCurve:
    """The loop function L(i w), or L(e^{i w T}) of a sampled loop, on a grid that resolves it: `omega`, `L` (n,).

    `margins` are those of a stable loop, else None.  `continuous` is the continuous-time loop of a sampled one.  A
    `note` names the damping of an arm that has none of its own.
    """

    arm: Arm
    law: AnyLaw
    stability: Annotated[str, Quantity("stability", help="stable, marginal or unstable")]
    period: Annotated[float | None, Quantity("sampling period", "s", help="of a sampled loop, else null")] = None
    note: Annotated[str, Quantity("note", help="damping with which an undamped arm is drawn")] = ""
    omega: Annotated[Real, Quantity("frequency", "rad/s", curve=True, help="frequencies of the curve")]
    L: Annotated[Complex, Quantity("L", curve=True, help="loop function at these frequencies")]
    margins: Annotated[LoopMargins | None, IN_RANGE]
    continuous: Annotated[LoopCurve | None, Quantity("continuous-time loop", help="of a sampled loop, else null")] = (
        None
    )

    @property
    def gain_margin(self) -> Annotated[At | None, Quantity("gain margin, upwards", "dB", key="gain_margin_db",
            help="increase of the loop gain up to which the loop stays stable; null unless it is stable")]:  # fmt: skip
        """The gain margin [dB] upwards at its phase crossover."""
        return None if self.margins is None else At(*gain_margin(self.margins, self.margins.gain[1]))

    @property
    def magnitude(self) -> Annotated[Real, Quantity("|L|", "dB", curve=True, key="magnitude_db",
            help="size of the loop function")]:  # fmt: skip
        """|L| [dB]."""
        return decibels(self.L)

    @property
    def phase(self) -> Annotated[Real, Quantity("phase", "deg", curve=True, help="angle of L, above -360 to 0")]:
        """The angle of L in (-360, 0] deg: with -180 in the middle, as a Nichols chart has it."""
        return np.asarray(-np.mod(-np.degrees(np.angle(self.L)), 360.0))

    @property
    def sensitivity(self) -> Annotated[Real, Quantity("|S|", "dB", curve=True, key="sensitivity_db",
            help="size of S = 1/(1 + L)")]:  # fmt: skip
        """|S| [dB]."""
        return -decibels(1 + self.L)

    @property
    def complementary(self) -> Annotated[Real, Quantity("|T|", "dB", curve=True, key="complementary_db",
            help="size of T = L/(1 + L)")]:  # fmt: skip
        """|T| [dB]."""
        return self.magnitude + self.sensitivity

    @property
    def sides(self) -> tuple[LoopCurve, ...]:
        """The continuous-time loop, where there is one, and this one."""
        return (self,) if self.continuous is None else (self.continuous, self)


def refined(L: Callable[[Complex], Complex], omega: Real) -> tuple[Real, Complex]:
    """Frequencies (n,), more of them where L or 1 + L (s = i w) changes by much from one to the next, and L there."""
    for number in range(FINER_ROUNDS):
        values = np.asarray(L(1j * omega), dtype=np.complex128)
        known = np.isfinite(values) & ((values != 0) | (not values.any()))
        omega, values = omega[known], values[known]
        sizes = np.array([values, 1 + values])
        steps = abs(np.diff(np.log(np.where(sizes == 0, 1.0, sizes))))
        (coarse,) = np.nonzero((steps[0] > LONGEST_STEP) | (steps[1] > LONGEST_OF_S))
        if number < FINER_ROUNDS - 1:
            omega = np.union1d(omega, np.sqrt(omega[coarse] * omega[coarse + 1]))  # each once, by rounding too
    return omega, values


def lowest_drawn(arm: Arm, band: LoopMargins | None) -> float:
    """A frequency [rad/s] below the first crossing and the first mode: further down L does not change."""
    crossed = [] if band is None else [w for w, _ in (*band.gain_crossovers, *band.phase_crossovers) if w > 0]
    return float(min([first_frequency(arm), *crossed])) / BELOW_SLOWEST


def decibels(values: Complex | Real | float) -> Real:
    """The size of values [dB]."""
    return np.asarray(20 * np.log10(np.maximum(np.abs(values), LEAST_SIZE)))


def gain_margin(band: LoopMargins, factor: float) -> tuple[float, float | None]:
    """Size [dB] of a factor that ends stability, and the frequency [rad/s] at which it does."""
    if not 1 / MOST_FACTOR < factor < MOST_FACTOR:
        return math.inf, None
    near = [w for w, t in band.phase_crossovers if abs(t / factor - 1) < SAME_FACTOR]
    return abs(20 * math.log10(factor)), near[0] if near else None


@singledispatch
def curve_of(found: Any) -> Any:
    """The curve of the margins of a continuous-time loop around every steep place; a curve is its own."""
    return found


@curve_of.register
def _(found: Margins) -> LoopCurve:
    verdict, omega = found.stability, dense(found.stability)
    loop = verdict.loop
    omega, L = refined(loop.loop_function, omega[omega >= lowest_drawn(loop.arm, found.in_band)])
    return LoopCurve(
        arm=loop.arm, law=loop.law, stability=verdict.verdict, omega=omega, L=L, margins=found.in_band
    )  # fmt: skip
