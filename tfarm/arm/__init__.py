"""What is analysed: the arm as frozen records, its TOML file and the presets."""

from tfarm.arm.feedback import FED_BACK, GAINS, LISTED, NAMES, Gain, HubFeedback, law_of, many_laws
from tfarm.arm.plausible import implausible
from tfarm.arm.reading import load, presets
from tfarm.arm.records import Arm, Hub, Link, Payload, must_be_arm, must_turn
from tfarm.arm.sections import Section
from tfarm.arm.writing import to_toml

__all__ = [
    "FED_BACK",
    "GAINS",
    "LISTED",
    "NAMES",
    "Arm",
    "Gain",
    "Hub",
    "HubFeedback",
    "Link",
    "Payload",
    "Section",
    "implausible",
    "law_of",
    "load",
    "many_laws",
    "must_be_arm",
    "must_turn",
    "presets",
    "to_toml",
]
