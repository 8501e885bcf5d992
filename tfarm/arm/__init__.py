"""What is analysed: the arm as frozen records, its TOML file and the presets."""

from tfarm.arm.feedback import (
    FED_BACK,
    GAINS,
    LISTED,
    NAMES,
    Gain,
    HubFeedback,
    driven,
    law_of,
    many_laws,
    through,
    unit_of,
    written_unit,
)
from tfarm.arm.link import Link
from tfarm.arm.plausible import implausible
from tfarm.arm.reading import load, presets
from tfarm.arm.records import INPUT_UNITS, INPUTS, Arm, Input, must_be_arm, must_turn
from tfarm.arm.rig import Attachment, Gauge, Hub, Motor, Payload, RotarySpring
from tfarm.arm.sections import Section
from tfarm.arm.theories import THEORIES, WITH_ROTARY_INERTIA, WITH_SHEAR, Theory
from tfarm.arm.writing import to_toml

__all__ = [
    "FED_BACK",
    "GAINS",
    "INPUTS",
    "INPUT_UNITS",
    "LISTED",
    "NAMES",
    "THEORIES",
    "WITH_ROTARY_INERTIA",
    "WITH_SHEAR",
    "Arm",
    "Attachment",
    "Gain",
    "Gauge",
    "Hub",
    "HubFeedback",
    "Input",
    "Link",
    "Motor",
    "Payload",
    "RotarySpring",
    "Section",
    "Theory",
    "driven",
    "implausible",
    "law_of",
    "load",
    "many_laws",
    "must_be_arm",
    "must_turn",
    "presets",
    "through",
    "to_toml",
    "unit_of",
    "written_unit",
]
