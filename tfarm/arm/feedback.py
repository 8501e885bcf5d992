"""The control law, as a record: one gain an output, and the table of what each of them multiplies.

    u = -Kp theta - K1 theta_t - K2 E I phi'(0) + r                                                            (19)

Sign convention, everywhere in tfarm: E I phi'(0) is the elastic moment at the root as a strain gauge reads it, positive
where it accelerates the hub; a static torque u gives it the value -(J - I_h)/J u.  Reversing the gauge mirrors K2.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from tfarm.arm.checks import INPUT_UNITS, LARGEST_NUMBER, number
from tfarm.arm.records import Arm
from tfarm.errors import ParameterError


@dataclass(frozen=True, slots=True)
class Gain:
    """One entry of the law: its `name`, the `output` that it multiplies and its `letter`, and its SI `unit`."""

    name: str
    output: str
    unit: str
    letter: str


GAINS = (
    Gain("Kp", "hub_angle", "N m/rad", "theta"),
    Gain("K1", "hub_rate", "N m s/rad", "theta_t"),
    Gain("K2", "root_moment", "1", "M"),
)  # in the order in which the outputs are fed back, everywhere
FED_BACK = tuple(gain.output for gain in GAINS)
LISTED = tuple(sorted(GAINS, key=lambda gain: gain.name))  # in the order in which a person lists them
NAMES = tuple(gain.name for gain in LISTED)
AT_HUB = ("hub_angle", "hub_rate", "root_moment")  # what theorems on the loop are about: gains on these, the first
assert FED_BACK[: len(AT_HUB)] == AT_HUB
ON = {gain.output: gain.name for gain in GAINS}  # the name of the gain on each output
OUTPUT_OF = {name: output for output, name in ON.items()}
ANGLE_GAIN, RATE_GAIN, MOMENT_GAIN = (ON[output] for output in AT_HUB)
PLANE = (RATE_GAIN, MOMENT_GAIN)  # the gains of the paper's own law: across and up the map of a loop
TWO_GAINS = "-".join(PLANE)  # the structure of a law that is these, beside PD, lead, ...
TAKEN_OFF = " - ".join(f"{gain.name} {gain.letter}" for gain in GAINS)  # off the input of the arm, by the law
SPELT_OUT = re.sub(r"\bM(?= |$)", "E I phi'(0)", TAKEN_OFF)


@dataclass(frozen=True, slots=True, kw_only=True)
class HubFeedback:
    """Feedback at the hub: `K1` [N m s/rad] on the hub rate, `K2` [-] on the root moment, `Kp` [N m/rad] on the angle.

    Kp is an extension of the paper's law (19), which leaves the angle itself alone.  Raises ParameterError for what is
    no finite number or would overflow; whether a gain is too large for an arm is judged in that arm's own units, where
    the loop is closed.
    """

    K1: float = 0.0
    K2: float = 0.0
    Kp: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            remedy = f"a gain is a finite number, at most {LARGEST_NUMBER:g} in size"
            value = number(field.name, getattr(self, field.name), remedy)
            if not abs(value) <= LARGEST_NUMBER:
                raise ParameterError(key=field.name, value=value, remedy=remedy)
            object.__setattr__(self, field.name, value)

    @property
    def row(self) -> tuple[float, ...]:
        """The gains in the order of `GAINS`: what the outputs in `FED_BACK` are multiplied by."""
        return tuple(self[gain.name] for gain in GAINS)

    def __getitem__(self, name: str) -> float:
        """The gain of that name."""
        return getattr(self, name)

    @property
    def by_name(self) -> dict[str, float]:
        """The gains, as a person lists them."""
        return {name: self[name] for name in NAMES}

    @property
    def point(self) -> tuple[float, float]:
        """Where the law lies in the plane of its two gains: across, up."""
        across, up = (self[name] for name in PLANE)
        return across, up

    def at(self, across: float, up: float) -> HubFeedback:
        """The law with its gains of the plane at this point of it."""
        return replace(self, **dict(zip(PLANE, (across, up), strict=True)))

    def told(self, name: str, how: Callable[[float], str], arm: Arm | None = None) -> str:
        """`K1 = 0.3`: the gain of that name, its value written by `how`, with its unit on an arm."""
        return f"{name} = {how(self[name])}{'' if arm is None else written_unit(name, arm)}"

    def having(self, name: str, value: float) -> HubFeedback:
        """The law with another value of one gain."""
        return replace(self, **{name: value})

    def times(self, factor: float) -> HubFeedback:
        """Every gain times a number."""
        return HubFeedback(**{gain.name: factor * self[gain.name] for gain in GAINS})


def unit_of(name: str, arm: Arm) -> str:
    """The SI unit of the gain of that name on an arm whose loop closes through its own input: N m, A or V.

    K2, a pure number where a torque answers the moment, is A/(N m) or V/(N m) through a motor.
    """
    (unit,) = (gain.unit for gain in GAINS if gain.name == name)
    given = INPUT_UNITS["hub_torque" if arm.is_locked else arm.input]
    if unit == "1":
        return "1" if given == "N m" else f"{given}/(N m)"
    return unit.replace("N m", given)


def shown_unit(name: str, arm: Arm) -> str:
    """The unit of that gain as a table heads it: nothing of a pure number."""
    unit = unit_of(name, arm)
    return "" if unit == "1" else unit


def written_unit(name: str, arm: Arm) -> str:
    """What follows a value of that gain in a sentence: a space and its unit, nothing of a pure number."""
    unit = shown_unit(name, arm)
    return f" {unit}" if unit else ""


def input_words(arm: Arm) -> str:
    """What the loop of an arm closes through, in words."""
    words = {"motor_voltage": "the motor's voltage [V]", "motor_current": "the motor's current [A]"}
    return words.get(arm.input, "the torque at the hub [N m]")


def driven(arm: Arm) -> str:
    """A clause that says what u is, where it is no torque."""
    return f"; u is {input_words(arm)}" if shown_unit(MOMENT_GAIN, arm) else ""


def law_of(row: ArrayLike) -> HubFeedback:
    """The law with these gains, in the order of `GAINS`."""
    return HubFeedback(**{gain.name: float(value) for gain, value in zip(GAINS, np.asarray(row), strict=True)})
