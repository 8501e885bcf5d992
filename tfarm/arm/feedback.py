"""The paper's control law as a record: one gain for each output, and the table of gains and outputs.

    u = -Kp theta - K1 theta_t - K2 E I phi'(0) + r                                                            (19)

Sign convention: E I phi'(0) is the elastic moment that a strain gauge reads at the root, positive where it accelerates
the hub.  Under a static torque u it is -(J - I_h)/J u.  With a reversed gauge K2 has the opposite sign.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from tfarm.arm.checks import INPUT_UNITS, LARGEST_NUMBER, number
from tfarm.arm.records import Arm
from tfarm.errors import must_be_known, require
from tfarm.moved import FormerName


@dataclass(frozen=True, slots=True)
class Gain:
    """One entry of the law: its `name`, the `output` that it multiplies and its `letter`, and its SI `unit`."""

    name: str
    output: str
    unit: str
    letter: str


# in the order in which the outputs are fed back, everywhere
GAINS = (
    Gain("Kp", "hub_angle", "N m/rad", "theta"),
    Gain("K1", "hub_rate", "N m s/rad", "theta_t"),
    Gain("K2", "root_moment", "1", "M"),
)
# theorems on the loop are about gains on these
FED_BACK = AT_HUB = ("hub_angle", "hub_rate", "root_moment")
# in the order in which a person lists them
LISTED = tuple(sorted(GAINS, key=lambda gain: gain.name))
NAMES = ("K1", "K2", "Kp")
# the name of the gain on each output
ON = {gain.output: gain.name for gain in GAINS}
OUTPUT_OF = {gain.name: gain.output for gain in GAINS}
ANGLE_GAIN = "Kp"
RATE_GAIN = "K1"
MOMENT_GAIN = "K2"
# the gains of the paper's law: axes of the stability region
PLANE = (RATE_GAIN, MOMENT_GAIN)
# the name of that structure, as PD or lead
TWO_GAINS = "K1-K2"
# the law, subtracted from the input
TAKEN_OFF = "Kp theta - K1 theta_t - K2 M"
SPELT_OUT = "Kp theta - K1 theta_t - K2 E I phi'(0)"


@dataclass(frozen=True, slots=True, kw_only=True)
class HubFeedback:
    """Feedback at the hub: `K1` [N m s/rad] on the hub rate, `K2` [-] on the root moment, `Kp` [N m/rad] on the angle.

    Kp extends the paper's law (19), which has no feedback of the angle.  Raises ParameterError for a gain that is not
    finite or above 1e40; `check_gains` checks its size against the units of an arm.
    """

    K1: float = 0.0
    K2: float = 0.0
    Kp: float = 0.0

    def __post_init__(self) -> None:
        remedy = f"a gain is a finite number, at most {LARGEST_NUMBER:g} in size"
        for field in fields(self):
            value = number(field.name, getattr(self, field.name), remedy)
            require(abs(value) <= LARGEST_NUMBER, field.name, value, remedy)
            object.__setattr__(self, field.name, value)

    @property
    def row(self) -> tuple[float, ...]:
        """The gains in the order of `GAINS`, on the outputs in `FED_BACK`."""
        return self.Kp, self.K1, self.K2

    def __getitem__(self, name: str) -> float:
        """Return the gain of that name."""
        return getattr(self, name)

    @property
    def by_name(self) -> dict[str, float]:
        """The gains by name, in the order of a list."""
        return {name: self[name] for name in NAMES}

    @property
    def point(self) -> tuple[float, float]:
        """The coordinates of the law in the plane of `PLANE`: across, up."""
        return self.K1, self.K2

    def gain_text(self, name: str, how: Callable[[float], str], arm: Arm | None = None) -> str:
        """Return `K1 = 0.3`: the gain of that name, its value written by `how`, with its unit on an arm."""
        return f"{name} = {how(self[name])}{'' if arm is None else written_unit(name, arm)}"

    def with_number(self, name: str, value: float) -> HubFeedback:
        """Return the law with another value of one gain.  Raises ParameterError for an unknown one."""
        must_be_known("law", name, NAMES)
        return replace(self, **{name: value})

    having = FormerName("with_number")

    def times(self, factor: float) -> HubFeedback:
        """Return the law with every gain times a number."""
        return law_of([factor * each for each in self.row])


def unit_of(name: str, arm: Arm) -> str:
    """Return the SI unit of the gain of that name on an arm, by the arm's input [N m, A or V].

    K2 is a pure number for a torque, and in A/(N m) or V/(N m) for a motor.
    """
    (unit,) = (gain.unit for gain in GAINS if gain.name == name)
    unit_of_input = INPUT_UNITS["hub_torque" if arm.is_locked else arm.input]
    if unit == "1":
        return "1" if unit_of_input == "N m" else f"{unit_of_input}/(N m)"
    return unit.replace("N m", unit_of_input)


def shown_unit(name: str, arm: Arm) -> str:
    """Return the unit of that gain for the heading of a table, "" for a pure number."""
    unit = unit_of(name, arm)
    return "" if unit == "1" else unit


def written_unit(name: str, arm: Arm) -> str:
    """Return a space and the unit of that gain, "" for a pure number."""
    unit = shown_unit(name, arm)
    return f" {unit}" if unit else ""


def input_words(arm: Arm) -> str:
    """Return the input of an arm in words."""
    words = {"motor_voltage": "the motor's voltage [V]", "motor_current": "the motor's current [A]"}
    return words.get(arm.input, "the torque at the hub [N m]")


def law_of(row: ArrayLike) -> HubFeedback:
    """Return the law with these gains, in the order of `GAINS`."""
    Kp, K1, K2 = np.asarray(row, dtype=float).tolist()
    return HubFeedback(Kp=Kp, K1=K1, K2=K2)
