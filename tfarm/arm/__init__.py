"""What is analysed: the arm as frozen records, its TOML file and the presets."""

from tfarm.arm.driving import AnyLaw, arm_and_law, as_law, cancelled, must_not_be_algebraic, tracked
from tfarm.arm.feedback import (
    ANGLE_GAIN,
    AT_HUB,
    FED_BACK,
    GAINS,
    LISTED,
    MOMENT_GAIN,
    NAMES,
    PLANE,
    RATE_GAIN,
    SPELT_OUT,
    TAKEN_OFF,
    TWO_GAINS,
    Gain,
    HubFeedback,
    driven,
    input_words,
    law_of,
    laws_at,
    many_laws,
    shown_unit,
    unit_of,
    written_unit,
)
from tfarm.arm.law import Law
from tfarm.arm.link import Link
from tfarm.arm.plausible import implausible
from tfarm.arm.reading import load, presets
from tfarm.arm.records import Arm, must_be_arm, must_turn
from tfarm.arm.rig import Attachment, Gauge, Hub, Motor, Payload, RotarySpring
from tfarm.arm.sections import Section
from tfarm.arm.theories import THEORIES, WITH_ROTARY_INERTIA, WITH_SHEAR, Theory
from tfarm.arm.turning import INPUT_UNITS, INPUTS, Input
from tfarm.arm.writing import to_toml

__all__ = [
    "ANGLE_GAIN",
    "AT_HUB",
    "FED_BACK",
    "GAINS",
    "INPUTS",
    "INPUT_UNITS",
    "LISTED",
    "MOMENT_GAIN",
    "NAMES",
    "PLANE",
    "RATE_GAIN",
    "SPELT_OUT",
    "TAKEN_OFF",
    "THEORIES",
    "TWO_GAINS",
    "WITH_ROTARY_INERTIA",
    "WITH_SHEAR",
    "AnyLaw",
    "Arm",
    "Attachment",
    "Gain",
    "Gauge",
    "Hub",
    "HubFeedback",
    "Input",
    "Law",
    "Link",
    "Motor",
    "Payload",
    "RotarySpring",
    "Section",
    "Theory",
    "arm_and_law",
    "as_law",
    "cancelled",
    "driven",
    "implausible",
    "input_words",
    "law_of",
    "laws_at",
    "load",
    "many_laws",
    "must_be_arm",
    "must_not_be_algebraic",
    "must_turn",
    "presets",
    "shown_unit",
    "to_toml",
    "tracked",
    "unit_of",
    "written_unit",
]
