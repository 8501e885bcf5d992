"""The arm and its controller as frozen records, their TOML tables and the presets.

records     Arm: hub, link, payload and the other parts of a rig
parts       the parts as records: sections, links, hub, springs, motor, attachments, payload
checks      checks of single numbers and texts, inputs and beam theories
materials   materials of links
feedback    HubFeedback: the paper's law, and the table of its gains
law         Law: a linear law from named signals to the input
blocks      the blocks of a law: ratios of polynomials and state spaces
chain       Chain: sampling, converters, actuator, slew and its reference
stages      what happens in one sample, stage by stage
schema      the tables of an arm's file and their keys
law_tables  the table [law] of a file
reading     arms of presets and files, and warnings of implausible values
writing     arms and laws as TOML, arms by their keys
"""

from tfarm.arm.checks import INPUT_UNITS, INPUTS, THEORIES, WITH_ROTARY_INERTIA, WITH_SHEAR, Input, Theory
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
    input_words,
    law_of,
    shown_unit,
    unit_of,
    written_unit,
)
from tfarm.arm.law import AnyLaw, Law, arm_and_law, as_law, must_not_be_algebraic, warn_of_cancellations
from tfarm.arm.parts import Attachment, Gauge, Hub, Link, Motor, Payload, RotarySpring, Section
from tfarm.arm.reading import implausible, load, presets
from tfarm.arm.records import Arm, must_be_arm, must_have_free_hub, must_turn
from tfarm.arm.writing import to_toml
from tfarm.moved import moved

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
    "implausible",
    "input_words",
    "law_of",
    "load",
    "must_be_arm",
    "must_have_free_hub",
    "must_not_be_algebraic",
    "must_turn",
    "presets",
    "shown_unit",
    "to_toml",
    "unit_of",
    "warn_of_cancellations",
    "written_unit",
]

# names that this room had up to version 1.0
__getattr__ = moved(
    __name__,
    {"cancelled": "tfarm.arm:warn_of_cancellations", "full_law": "tfarm.case", "tracked": "tfarm.case"},
)
