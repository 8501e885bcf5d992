"""What is analysed: the arm as frozen records, its TOML file and the presets."""

from tfarm.arm.feedback import HubFeedback
from tfarm.arm.plausible import implausible
from tfarm.arm.reading import load, presets
from tfarm.arm.records import Arm, Hub, Link, Payload, must_be_arm, must_turn
from tfarm.arm.sections import Section
from tfarm.arm.writing import to_toml

__all__ = [
    "Arm",
    "Hub",
    "HubFeedback",
    "Link",
    "Payload",
    "Section",
    "implausible",
    "load",
    "must_be_arm",
    "must_turn",
    "presets",
    "to_toml",
]
