"""What a root locus runs over: a gain, one scale on all gains, or a parameter of the arm."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import LISTED, NAMES, RATE_GAIN, Arm, HubFeedback, as_law
from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError
from tfarm.exact.characteristic import Analytic, gains_of, loop_system, quick_characteristics, zeros_at_origin
from tfarm.exact.system import System
from tfarm.records import record
from tfarm.spectrum.continuation import Member

from .lines import NO_FEEDBACK, Line
from .loop import Loop

OF_THE_LAW = {gain.name: gain.unit for gain in LISTED} | {"all": "1"}  # units, as of the arm's below
ARM_PARAMETERS = {
    "payload_mass": "kg", "payload_inertia": "kg m^2", "hub_inertia": "kg m^2", "length": "m", "damping": "s"
}  # fmt: skip
ENDS_BEFORE = 0.05  # of 1/C: nearer to -1/C, where real zeros accumulate, no zero is followed from the right
VARIABLES = OF_THE_LAW | ARM_PARAMETERS  # what may be varied, and its unit


@dataclass(frozen=True)
@record
class Variation:
    """The loops of an arm under a law, one of whose numbers varies: a gain, "all" (a scale on the law), or the arm's.

    `beside` is another law, which acts too and does not vary.  Raises ParameterError for a name that is not in
    `VARIABLES`.
    """

    arm: Arm
    law: HubFeedback
    vary: str
    beside: HubFeedback = NO_FEEDBACK

    def __post_init__(self) -> None:
        if self.vary not in VARIABLES:
            raise ParameterError(key="vary", value=self.vary, remedy=f"use one of {', '.join(VARIABLES)}")

    @property
    def is_of_gains(self) -> bool:
        """Whether the arm stays as it is."""
        return self.vary in OF_THE_LAW

    def at(self, value: float) -> Loop:
        """The loop where the varied number has that value.  Raises ParameterError where there is none."""
        if self.is_of_gains:
            return Loop(self.arm, as_law(self.line.at(value)))
        return Loop(self.arm.having(**{self.vary: value}), as_law(self.beside.plus(self.law)))

    @property
    def line(self) -> Line:
        """The laws, where a gain or their scale varies."""
        if self.vary == "all":
            return Line(self.beside, self.law)
        return Line(self.beside.plus(self.law.having(self.vary, 0.0)), NO_FEEDBACK.having(self.vary, 1.0))

    def system(self, value: float) -> tuple[System, Real]:
        """The arm's system, and gains without dimensions (gains, 1), where the varied number has that value."""
        if self.is_of_gains:
            return self._k, self.laws(np.array([value]))
        k = loop_system(self.at(value).arm)
        return k, np.array([[float(gain)] for gain in gains_of(k, self.beside.plus(self.law))])

    def singular(self, value: float) -> float:
        """-1/C where the varied number has that value, -inf at C = 0."""
        C = value if self.vary == "damping" else self.arm.damping
        return -1.0 / C if C else -math.inf

    def laws(self, values: Real) -> Real:
        """The dimensionless gains (gains, n) at n values of a gain: linear in it."""
        rows = (gains_of(self._k, law) for law in (self.line.base, self.line.direction))
        base, way = (np.array([[float(gain)] for gain in row]) for row in rows)
        return np.asarray(base + way * values)

    @cached_property
    def _k(self) -> System:
        return loop_system(self.arm)

    @cached_property
    def zeros_at_origin(self) -> int:
        """How many zeros stay at s = 0 all the way: 2, 1 under a rate gain alone, 0 where the hub angle is held."""
        law = self.law.having(self.vary, 1.0) if self.vary in NAMES else self.law
        return zeros_at_origin(self._k, [max(map(abs, pair)) for pair in zip(law.row, self.beside.row, strict=True)])

    def left_at_origin(self, values: Real) -> NDArray[np.int64]:
        """How many zeros are at s = 0 at each of the values."""
        one = self.beside.plus(self.law).row
        rows = self.laws(values).T.tolist() if self.is_of_gains else [one] * values.size
        return np.array([zeros_at_origin(self._k, row) for row in rows], dtype=np.int64)


def must_be_way(start: float, stop: float) -> None:
    """Raise ParameterError for two values that are not the ends of a locus."""
    for key, value in (("from", start), ("to", stop)):
        if not math.isfinite(value):
            raise ParameterError(key=key, value=value, remedy="a finite number")
    if start == stop:
        raise ParameterError(key="to", value=stop, remedy="the range is empty: a locus runs to another value")


def must_keep_losing(variation: Variation, start: float, stop: float) -> None:
    """Raise ParameterError for a way on which a hub that weighs nothing loses nothing: there D loses its highest power.

    A real pole passes through infinity where the rate gain takes off what the hub loses.
    """
    arm = variation.arm
    if not (variation.is_of_gains and arm.rate_loss and arm.lossless_hub.has_massless_hub):
        return
    for key, value in (("from", start), ("to", stop)):
        if (variation.at(value).gains or NO_FEEDBACK)[RATE_GAIN] <= -arm.rate_loss:
            remedy = f"with hub.inertia = 0 a pole passes through infinity at {RATE_GAIN} = {-arm.rate_loss:.6g}"
            raise ParameterError(key=key, value=value, remedy=f"{remedy}: stay above it, or give the hub an inertia")


def free_of_loss(arm: Arm) -> tuple[Arm, HubFeedback]:
    """An arm whose hub loses less, and the law that takes as much beside any other: a rate gain.

    That is b + N^2 b_m and the back-EMF.  Behind an inductance it is the back-EMF alone: friction acts at once.
    Not of a hub that weighs nothing: without its friction the moment would be fed back in an algebraic loop.
    """
    if arm.lossless_hub.has_massless_hub:
        return arm, NO_FEEDBACK
    if arm.motor is None or not arm.input_lags:
        return arm.lossless_hub, NO_FEEDBACK.having(RATE_GAIN, arm.rate_loss)
    motor = replace(arm.motor, back_emf_constant=0.0)
    return replace(arm, motor=motor), NO_FEEDBACK.having(RATE_GAIN, arm.motor.gear_ratio * arm.motor.back_emf_constant)


class Evaluator:
    """The characteristic function of the loops at given values of what varies, at many points of many loops at once."""

    def __init__(self, variation: Variation, values: Real) -> None:
        self.values = values
        self.k = variation.system(float(values[0]))[0]
        self.laws = variation.laws(values) if variation.is_of_gains else None
        self.systems = [] if variation.is_of_gains else [variation.system(float(value)) for value in values]

    def __call__(self, s: Complex, which: NDArray[np.int64], at_zero: int) -> Analytic:
        """D/s^at_zero and its slope at s (1-D), each under the loop of that number in `values`."""
        if self.laws is not None:
            return quick_characteristics(self.k, s, self.laws[:, which], at_zero)
        parts = np.empty((3, s.size), complex)
        for number in np.unique(which):
            here = which == number
            k, law = self.systems[number]
            parts[:, here] = quick_characteristics(k, s[here], law, at_zero)
        return Analytic(*parts)


def member_of(variation: Variation, value: float, at_zero: int, free: float) -> Member:
    """The characteristic function D/s^at_zero of one loop, to be followed; exact zeros at s = 0 may be asked for."""
    k, law = variation.system(value)

    def function(s: Complex) -> Analytic:
        value, slope, scale = quick_characteristics(k, s, law, at_zero)
        if at_zero:
            value, slope = np.where(s == 0, 0.0, value), np.where(s == 0, 1.0, slope)
        return Analytic(value, slope, scale)

    return Member(function, variation.singular(value), free, ENDS_BEFORE)
