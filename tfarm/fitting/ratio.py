"""The exact response from any signal of an arm to any other: the ratio of two of its transfer functions.

    H(s) = T_out(s)/T_in(s)

Its zeros are those of T_out, its poles the zeros of T_in: what rings where the signal T_in is held still.  The arm's
own poles are in neither.  Over an input of the hub (a torque, a voltage, the angle) H is a transfer function itself:
the angle as input and the angle as a signal that was measured give the same one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from tfarm.arm import INPUTS, Arm, Input
from tfarm.arrays import Complex
from tfarm.errors import ParameterError
from tfarm.records import record
from tfarm.response import TransferFunction, transfer
from tfarm.response.frequency import without_cancelled
from tfarm.response.signals import Signals
from tfarm.response.transfer import Roots

from .reading import check_signal

SOMEWHERE = 0.37 + 0.73j  # 1/s: a response that is not 0 throughout is not 0 there


@dataclass(frozen=True, slots=True, kw_only=True)
@record
class RatioRoots:
    """Poles and zeros [1/s] of a ratio with |Im s| <= `up_to` [rad/s], those at s = 0 apart: complete in these ranges.

    `common` are those that both signals have, which cancel; at s = 0 the ratio goes as s^`at_zero`.
    """

    poles: Complex
    zeros: Complex
    common: Complex
    at_zero: int
    up_to: float

    @property
    def resonances(self) -> Complex:
        """The poles that oscillate, Im s > 0, by |s|."""
        upper = self.poles[self.poles.imag > 0]
        return upper[np.argsort(abs(upper))]


@dataclass(frozen=True)
class Ratio:
    """The response `output`/`input` of an arm, exact.  Raises ParameterError for signals that the arm does not have."""

    arm: Arm
    output: str
    input: str

    def __post_init__(self) -> None:
        check_signal(self.output, "output")
        check_signal(self.input, "input")
        if self.output == self.input:
            raise ParameterError(key="input", value=self.input, remedy="a signal over itself is 1")
        for key, name, each in (("output", self.output, self.above), ("input", self.input, self.below)):
            if each is not None and each(SOMEWHERE) == 0:
                raise ParameterError(key=key, value=name, remedy="does not move on this arm: it is held")

    @property
    def is_driven(self) -> bool:
        """Whether the input drives the hub, as one of an arm does, so that the arm's modes are the poles."""
        return self.input in INPUTS

    @cached_property
    def driven(self) -> Arm:
        """The arm under the input that is meant: its own where the ratio is of two signals."""
        return replace(self.arm, input=cast("Input", self.input)) if self.is_driven else self.arm

    @cached_property
    def above(self) -> TransferFunction:
        """From the input that drives to the output."""
        return _transfer(self.driven, self.output)

    @cached_property
    def below(self) -> TransferFunction | None:
        """The same to the input that was measured; None where it is the one that drives."""
        return None if self.is_driven else _transfer(self.arm, self.input)

    @property
    def unit(self) -> str:
        """SI unit, such as m/s^2/rad."""
        below = self.above.input_unit if self.below is None else self.below.units[0]
        return f"{self.above.units[0]}/{f'({below})' if ' ' in below or '/' in below else below}"

    def __call__(self, s: Any) -> Any:
        """H(s) at a complex scalar or array of s [1/s]."""
        return self.above(s) if self.below is None else self.above(s) / self.below(s)

    def roots(self, up_to: float) -> RatioRoots:
        """Poles and zeros with |Im s| <= up_to [rad/s], as each transfer function has them, complete."""
        every = self.poles(up_to).values, self.above.zeros(up_to=up_to).values
        given_poles, given_zeros = (roots[roots != 0] for roots in every)
        poles, zeros = without_cancelled(given_poles, given_zeros)
        orders = Signals(self.driven, (self.output,)).orders[0]
        under = Signals(self.arm, (self.input,)).orders[0] if self.below is not None else self.above.system.at_rest
        return RatioRoots(
            poles=poles,
            zeros=zeros,
            common=np.array([pole for pole in given_poles if pole not in poles], complex),
            at_zero=orders - under,
            up_to=up_to,
        )

    def poles(self, up_to: float) -> Roots:
        """What would be its poles if the output showed them all; with those at s = 0."""
        return self.above.poles(up_to=up_to) if self.below is None else self.below.zeros(up_to=up_to)

    def residue(self, pole: complex, others: Complex) -> complex:
        """The residue at a simple pole: the mean of H (s - p) on a circle that no other of the roots is within.

        By the trapezoidal rule, whose error is (radius/distance)^16, 1e-10 at a quarter of it.
        """
        far = min((abs(pole - each) for each in others if each != pole), default=abs(pole))
        radius = min(far, abs(pole)) / 4
        turn = radius * np.exp(2j * np.pi * (np.arange(16) + 0.5) / 16)
        return complex(np.mean(self(pole + turn) * turn))


def _transfer(arm: Arm, name: str) -> TransferFunction:
    """To a signal with its place behind an @."""
    signals = Signals(arm, (name,))
    wanted = signals.outputs[0]
    return transfer(arm, wanted, x=signals.places[0] * arm.length if wanted.place == "x" else None)
