"""The exact response from any signal of an arm to any other: the ratio of two of its transfer functions.

    H(s) = T_out(s)/T_in(s)

Its zeros are those of T_out, its poles the zeros of T_in: the resonances while the signal T_in is held at zero.  The
arm's own poles are in neither.  Over an input of the hub (a torque, a voltage, the angle) H is a transfer function
itself: the angle as input and the angle as a signal that was measured give the same one.
"""

from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, cast

import numpy as np

from tfarm.arm import INPUTS, Arm, Input
from tfarm.arrays import Complex
from tfarm.errors import ConvergenceError, ParameterError, require
from tfarm.exact.outputs import unit_over
from tfarm.fitting.data import Measured, check_signal, noise_of
from tfarm.fitting.held import held_parts
from tfarm.fitting.resonances import (
    PARTNERS_BEYOND,
    must_be_in_unit,
)
from tfarm.records import frozen
from tfarm.response import TransferFunction, transfer
from tfarm.response.frequency import HERTZ, without_cancelled
from tfarm.response.signals import Signals, locate_output
from tfarm.response.transfer import Roots
from tfarm.schema import Quantity


@frozen(slots=True, kw_only=True)
class RatioRoots:
    """Poles and zeros [1/s] of a ratio with 0 <= Im s <= `up_to` [rad/s], none at s = 0: complete in this range.

    `common` are those that both signals have, which cancel; at s = 0 the ratio goes as s^`at_zero`.
    """

    poles: Annotated[Complex, Quantity("s", "1/s", help="poles of the ratio", key="poles")]
    zeros: Annotated[Complex, Quantity("s", "1/s", help="zeros of the ratio", key="zeros")]
    common: Annotated[Complex, Quantity("s", "1/s", 6, "common to both signals: they cancel", "common")]
    at_zero: Annotated[int, Quantity(key="power_at_zero", help="order n of the response s^n near s = 0")]
    up_to: Annotated[
        float,
        Quantity(
            "poles and zeros up to",
            "rad/s",
            6,
            "imaginary part up to which the lists are complete",
            "roots_up_to_rad_s",
        ),
    ]


def upper_half(roots: Complex) -> Complex:
    """Return those with Im s >= 0 but s = 0, ascending in size: the others are their mirror images."""
    upper = roots[(roots.imag >= 0) & (roots != 0)]
    return upper[np.argsort(abs(upper), kind="stable")]


@frozen
class Ratio:
    """The response `output`/`input` of an arm, exact; of samples where the input is `held` over that period [s].

    Raises ParameterError for signals that the arm does not have.
    """

    arm: Arm
    output: str
    input: str
    held: float | None = None

    def __post_init__(self) -> None:
        check_signal(self.output, "output")
        check_signal(self.input, "input")
        require(self.output != self.input, "input", self.input, "a signal over itself is 1")
        for key, name, each in (("output", self.output, self.above), ("input", self.input, self.below)):
            # a response that is not 0 throughout is not 0 at this s [1/s]
            is_moving = each is None or each(0.37 + 0.73j)
            require(is_moving, key, name, "does not move on this arm: it is held")
        of_input = f"is of a commanded input, not of the signal {self.input}: leave it out"
        require(self.held is None or self.is_driven, "held", self.held, of_input)
        remedy = "drives no locked hub; name what was measured: hub_angle where the angle drives it, or another signal"
        is_felt = not self.is_driven or not self.driven_arm.is_locked or self.input == "hub_angle"
        require(is_felt, "input", self.input, remedy)

    @property
    def is_driven(self) -> bool:
        """Whether the input drives the hub, as one of an arm does, so that the arm's modes are the poles."""
        return self.input in INPUTS

    @cached_property
    def driven_arm(self) -> Arm:
        """The arm under the input of the ratio: its own where the ratio is of two signals."""
        if self.is_driven:
            return replace(self.arm, input=cast("Input", self.input))
        return self.arm

    @cached_property
    def above(self) -> TransferFunction:
        """From the input that drives to the output."""
        return transfer_to(self.driven_arm, self.output)

    @cached_property
    def below(self) -> TransferFunction | None:
        """The same to the input that was measured; None where it is the one that drives."""
        return None if self.is_driven else transfer_to(self.arm, self.input)

    @property
    def unit(self) -> str:
        """SI unit, such as m/s^2/rad."""
        below = self.above.input_unit if self.below is None else self.below.units[0]
        return unit_over(self.above.units[0], below)

    def __call__(self, s: Any) -> Any:
        """Return H(s) at a complex scalar or array of s [1/s]."""
        value = self.above(s) if self.below is None else self.above(s) / self.below(s)
        if self.held is None:
            return value
        hold, images = held_parts(self.driven_arm, self.output, self.held, s)
        return value * hold + images

    def roots(self, up_to: float) -> RatioRoots:
        """Return poles and zeros with |Im s| <= up_to [rad/s], as each transfer function has them, complete."""
        own_poles = upper_half(self.poles(up_to).values)
        own_zeros = upper_half(self.above.zeros(up_to=up_to).values)
        poles, zeros = without_cancelled(own_poles, own_zeros)
        if self.below is None:
            below = self.above.system.at_rest
        else:
            below = Signals(self.arm, (self.input,)).orders[0]
        return RatioRoots(
            poles=poles,
            zeros=zeros,
            common=own_poles[~np.isin(own_poles, poles)],
            at_zero=Signals(self.driven_arm, (self.output,)).orders[0] - below,
            up_to=up_to,
        )

    def poles(self, up_to: float) -> Roots:
        """Return its poles if the output had them all; with those at s = 0."""
        if self.below is None:
            return self.above.poles(up_to=up_to)
        return self.below.zeros(up_to=up_to)

    def residue(self, pole: complex, roots: RatioRoots) -> complex:
        """Return the residue at a simple pole: the mean of H (s - p) on a circle that no other of the roots is within.

        By the trapezoidal rule, whose error is (radius/distance)^16, 1e-10 at a quarter of it.
        """
        upper = np.r_[roots.poles, roots.zeros, 0.0]
        others = np.r_[upper, upper.conj()]
        radius = abs(pole - others[others != pole]).min() / 4
        turn = radius * np.exp(2j * np.pi * (np.arange(16) + 0.5) / 16)
        return complex(np.mean(self(pole + turn) * turn))


def transfer_to(arm: Arm, name: str) -> TransferFunction:
    """Return the transfer function from an arm's input to a signal with its place after an @."""
    wanted, x = locate_output(name, arm.length)
    return transfer(arm, wanted, x=x if wanted.place == "x" else None)


def check_unit(arm: Arm, measured: Measured) -> None:
    """Raise ParameterError where the file's frequencies are in another unit than its header has (`must_be_in_unit`).

    Nothing is checked where the arm's poles up to there are not found.
    """
    ratio = ratio_of(arm, measured)
    with suppress(ConvergenceError):
        poles = ratio.poles(PARTNERS_BEYOND * HERTZ * measured.omega[-1]).values
        must_be_in_unit(measured, noise_of(measured).sigma, poles)


def ratio_of(arm: Arm, measured: Measured) -> Ratio:
    """Return the exact response of what was measured; ParameterError, naming it, where the arm has no such response."""
    try:
        return Ratio(arm, measured.output, measured.input, measured.held)
    except ParameterError as error:
        raise ParameterError(
            key=f"{measured.name} {error.key}", value=error.value, remedy=error.remedy, file=error.file
        ) from None
