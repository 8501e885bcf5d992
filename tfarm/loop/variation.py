"""What a root locus runs over: a gain, one scale on all gains, or a parameter of the arm."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback
from tfarm.errors import ParameterError
from tfarm.exact.characteristic import Analytic, quick_characteristics
from tfarm.exact.coefficients import Coefficients
from tfarm.spectrum.continuation import Member

from .plant import Loop

Complex = NDArray[np.complexfloating[Any, Any]]
Real = NDArray[np.float64]

GAINS = {"K1": "N m s/rad", "K2": "1", "Kp": "N m/rad", "all": "1"}
PARAMETERS = {"payload_mass": "kg", "payload_inertia": "kg m^2", "hub_inertia": "kg m^2", "length": "m", "damping": "s"}
VARIED = GAINS | PARAMETERS  # what may be varied, and its unit


@dataclass(frozen=True)
class Variation:
    """The loops of an arm under a law, one of whose numbers varies: a gain, "all" (a scale on the law), or the arm's.

    Raises ParameterError for a name that is not in `VARIED`.
    """

    arm: Arm
    law: HubFeedback
    vary: str

    def __post_init__(self) -> None:
        if self.vary not in VARIED:
            raise ParameterError(key="vary", value=self.vary, remedy=f"use one of {', '.join(VARIED)}")

    @property
    def is_of_gains(self) -> bool:
        """Whether the arm stays as it is."""
        return self.vary in GAINS

    def at(self, value: float) -> Loop:
        """The loop where the varied number has that value.  Raises ParameterError where there is none."""
        arm, law = self.arm, self.law
        if self.vary == "all":
            return Loop(arm, HubFeedback(K1=value * law.K1, K2=value * law.K2, Kp=value * law.Kp))
        if self.is_of_gains:
            return Loop(arm, replace(law, **{self.vary: value}))
        room, name = ("link", self.vary) if self.vary in ("length", "damping") else self.vary.split("_")
        return Loop(replace(arm, **{room: replace(getattr(arm, room), **{name: value})}), law)

    @cached_property
    def zeros_at_origin(self) -> int:
        """How many zeros stay at s = 0 all the way: 2, 1 under a rate gain alone, 0 where the hub angle is held."""
        law, varied = self.law, self.vary
        if not self.arm.has_rigid_mode or law.Kp or varied == "Kp":
            return 0
        return 1 if law.K1 or varied == "K1" else 2

    def left_at_origin(self, value: float) -> int:
        """How many zeros are at s = 0 at that value."""
        if not self.arm.has_rigid_mode:
            return 0
        law = self.at(value).law
        return 0 if law.Kp else 1 if law.K1 else 2


class Evaluator:
    """The characteristic function of the loops at given values of what varies, at many points of many loops at once."""

    def __init__(self, variation: Variation, values: Real) -> None:
        self.variation = variation
        self.values = values
        of_gains = variation.is_of_gains
        self.loops = [variation.at(float(value)) for value in (values[:1] if of_gains else values)]
        self.laws = _laws(variation, self.loops[0].k, values) if of_gains else None

    def __call__(self, s: Complex, which: NDArray[np.int64], at_zero: int) -> Analytic:
        """D/s^at_zero and its slope at s (1-D), each under the loop of that number in `values`."""
        if self.laws is not None:
            return quick_characteristics(self.loops[0].k, s, self.laws[:, which], at_zero)
        parts = np.empty((3, s.size), complex)
        for number in np.unique(which):
            here, loop = which == number, self.loops[number]
            parts[:, here] = quick_characteristics(loop.k, s[here], dimensionless(loop), at_zero)
        return Analytic(*parts)


def member_of(loop: Loop, at_zero: int, free: float) -> Member:
    """The characteristic function D/s^at_zero of one loop, to be followed; exact zeros at s = 0 may be among the points."""
    k, law = loop.k, dimensionless(loop)
    singular = -1.0 / k.damping if k.damping else -math.inf

    def function(s: Complex) -> Analytic:
        value, slope, scale = quick_characteristics(k, s, law, at_zero)
        if at_zero:
            value, slope = np.where(s == 0, 0.0, value), np.where(s == 0, 1.0, slope)
        return Analytic(value, slope, scale)

    return Member(function, singular, free)


def dimensionless(loop: Loop) -> Real:
    """Kp, K1 and K2 of the loop as `quick_characteristics` takes them, (3, 1)."""
    gains = loop.gains
    return np.array([[float(gains.Kp)], [float(gains.K1)], [float(gains.K2)]])


def _laws(variation: Variation, k: Coefficients, values: Real) -> Real:
    """The dimensionless gains (3, n) at n values: linear in what varies."""
    law, unit = variation.law, float(k.length / k.EI)
    rows = {"Kp": law.Kp, "K1": law.K1, "K2": law.K2}
    if variation.vary == "all":
        laws = np.array([[gain] for gain in rows.values()]) * values
    else:
        laws = np.array([values if name == variation.vary else np.full(values.size, rows[name]) for name in rows])
    return laws * [[unit], [unit], [1.0]]
