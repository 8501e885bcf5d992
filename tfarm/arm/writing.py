"""From an Arm back to TOML: what `load` reads, to the last bit."""

from __future__ import annotations

import json
from collections.abc import Iterable

from tfarm.arm.records import Arm
from tfarm.arm.sections import Section


def to_toml(arm: Arm) -> str:
    """The arm as a TOML file; equal arms give equal text, so its hash names the inputs."""
    link = arm.link
    lines = [
        f"name = {_text(arm.name)}",
        "assumptions = [",
        *(f"    {_text(assumption)}," for assumption in arm.assumptions),
        "]",
        "",
        "[link]",
        *_numbers(link, "length", "density", "youngs_modulus", "shear_modulus", "damping"),
        "",
        "[link.section]",
        f"shape = {_text(link.section.shape)}",
        *_section(link.section),
        "",
        "[hub]",
        *_numbers(arm.hub, "inertia"),
        "",
        "[payload]",
        *_numbers(arm.payload, "mass", "inertia"),
        "",
    ]
    return "\n".join(lines)


def _numbers(record: object, *names: str) -> Iterable[str]:
    """Python's shortest exact digits are TOML's too, and so is inf."""
    return (f"{name} = {getattr(record, name)!r}" for name in names)


def _section(section: Section) -> Iterable[str]:
    """The numbers that define a section: its dimensions, or else its area and second moment."""
    if section.dimensions:
        yield from (f"{name} = {value!r}" for name, value in section.dimensions)
    else:
        yield from _numbers(section, "area", "second_moment")
    if section.shear_factor is not None:
        yield from _numbers(section, "shear_factor")


def _text(text: str) -> str:
    """A TOML basic string: JSON's escapes are TOML's, and a record's texts hold only what prints."""
    return json.dumps(text, ensure_ascii=False)
