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
from tfarm.exact.coefficients import Coefficients, coefficients
from tfarm.records import record
from tfarm.spectrum.continuation import Member

from .plant import Loop

Complex = NDArray[np.complexfloating[Any, Any]]
Real = NDArray[np.float64]

GAINS = {"K1": "N m s/rad", "K2": "1", "Kp": "N m/rad", "all": "1"}
PARAMETERS = {"payload_mass": "kg", "payload_inertia": "kg m^2", "hub_inertia": "kg m^2", "length": "m", "damping": "s"}
VARIED = GAINS | PARAMETERS  # what may be varied, and its unit


@dataclass(frozen=True)
@record
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

    def system(self, value: float) -> tuple[Coefficients, Real]:
        """Coefficients of the arm, and Kp, K1, K2 without dimensions (3, 1), where the varied number has that value."""
        if self.is_of_gains:
            return self._k, self.laws(np.array([value]))
        k = coefficients(self.at(value).arm)
        unit = float(k.length / k.EI)
        return k, np.array([[unit * self.law.Kp], [unit * self.law.K1], [self.law.K2]])

    def singular(self, value: float) -> float:
        """-1/C where the varied number has that value, -inf at C = 0."""
        C = value if self.vary == "damping" else self.arm.link.damping
        return -1.0 / C if C else -math.inf

    def laws(self, values: Real) -> Real:
        """The dimensionless gains (3, n) at n values of a gain: linear in it."""
        law = self.law
        rows = {"Kp": self._unit * law.Kp, "K1": self._unit * law.K1, "K2": law.K2}
        if self.vary == "all":
            return np.array([[gain] for gain in rows.values()]) * values
        unit = 1.0 if self.vary == "K2" else self._unit
        return np.array([unit * values if name == self.vary else np.full(values.size, rows[name]) for name in rows])

    @cached_property
    def _k(self) -> Coefficients:
        return coefficients(self.arm)

    @cached_property
    def _unit(self) -> float:
        return float(self._k.length / self._k.EI)

    @cached_property
    def zeros_at_origin(self) -> int:
        """How many zeros stay at s = 0 all the way: 2, 1 under a rate gain alone, 0 where the hub angle is held."""
        law, varied = self.law, self.vary
        if not self.arm.has_rigid_mode or law.Kp or varied == "Kp":
            return 0
        return 1 if law.K1 or varied == "K1" else 2

    def left_at_origin(self, values: Real) -> NDArray[np.int64]:
        """How many zeros are at s = 0 at each of the values."""
        if not self.arm.has_rigid_mode:
            return np.zeros(values.size, np.int64)
        law, scale = self.law, values if self.vary == "all" else np.ones(values.size)
        K1, Kp = (values if self.vary == name else scale * getattr(law, name) for name in ("K1", "Kp"))
        return np.where(Kp != 0, 0, np.where(K1 != 0, 1, 2))


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

    return Member(function, variation.singular(value), free)
