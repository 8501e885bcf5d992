"""From an Arm back to TOML: what `load` reads, to the last bit."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

from tfarm.arm.link import Link
from tfarm.arm.records import Arm
from tfarm.arm.rig import Motor, differing


def to_toml(arm: Arm) -> str:
    """The arm as a TOML file; equal arms give equal text, so its hash names the inputs.

    The numbers of the paper's arm are always there, all else only where it differs from its default.
    """
    named = {"theory": arm.theory, "input": arm.input}
    defaults = {"theory": "timoshenko", "input": None if arm.motor else "hub_torque"}  # with a motor it is a choice
    springs = {"clamp": arm.clamp, "joint": arm.joint}
    tables = [
        [
            f"name = {_text(arm.name)}",
            "assumptions = [",
            *(f"    {_text(assumption)}," for assumption in arm.assumptions),
            "]",
            *(f"{key} = {_text(value)}" for key, value in named.items() if value != defaults[key]),
        ],
        *(table for link in arm.links for table in _link(link, "[[link]]" if arm.outer else "[link]")),
        ["[hub]", *_lines(differing(arm.hub, always=1))],
        *([f"[{key}]", *_lines(differing(spring, always=0))] for key, spring in springs.items() if not spring.is_rigid),
        *([] if arm.motor is None else [["[motor]", *_motor(arm.motor)]]),
        *(["[[attachment]]", *_lines(differing(each, always=1))] for each in arm.attachments),
        *([["[gauge]", f"x = {arm.gauge.x!r}", f"side = {_text(arm.gauge.side)}"]] if arm.gauge.x else []),
        ["[payload]", *_lines(differing(arm.payload, always=2))],
    ]
    return "\n\n".join("\n".join(table) for table in tables) + "\n"


def _lines(numbers: Mapping[str, float]) -> Iterable[str]:
    """Python's shortest exact digits are TOML's too, and so is inf."""
    return (f"{name} = {value!r}" for name, value in numbers.items())


def _link(link: Link, heading: str) -> Iterable[list[str]]:
    """The tables of a link and of its section: the dimensions of that, or else its area and second moment."""
    names = ("length", "density", "youngs_modulus", "shear_modulus", "damping")
    yield [heading, *_lines({name: getattr(link, name) for name in names})]
    section = link.section
    numbers = dict(section.dimensions) or {"area": section.area, "second_moment": section.second_moment}
    if section.shear_factor is not None:
        numbers["shear_factor"] = section.shear_factor
    yield ["[link.section]", f"shape = {_text(section.shape)}", *_lines(numbers)]


def _motor(motor: Motor) -> Iterable[str]:
    """The back-EMF constant stands there only where it is not the torque constant."""
    numbers = differing(motor, always=2)
    if motor.back_emf_constant == motor.torque_constant:
        del numbers["back_emf_constant"]
    return _lines(numbers)


def _text(text: str) -> str:
    """A TOML basic string: JSON's escapes are TOML's, and a record's texts hold only what prints."""
    return json.dumps(text, ensure_ascii=False)
