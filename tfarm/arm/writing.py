"""From an Arm back to TOML: what `load` reads, to the last bit."""

from __future__ import annotations

import json
from collections.abc import Iterable

from tfarm.arm.records import Arm
from tfarm.arm.sections import Section


def to_toml(arm: Arm) -> str:
    """The arm as a TOML file; equal arms give equal text, so its hash names the inputs."""
    link = arm.link
    return (
        f"name = {_text(arm.name)}\n"
        f"assumptions = [{', '.join(map(_text, arm.assumptions))}]\n"
        + "\n[link]\n"
        + _lines(
            ("length", link.length),
            ("density", link.density),
            ("youngs_modulus", link.youngs_modulus),
            ("shear_modulus", link.shear_modulus),
            ("damping", link.damping),
        )
        + "\n[link.section]\n"
        + f"shape = {_text(link.section.shape)}\n"
        + _lines(*_section(link.section))
        + "\n[hub]\n"
        + _lines(("inertia", arm.hub.inertia))
        + "\n[payload]\n"
        + _lines(("mass", arm.payload.mass), ("inertia", arm.payload.inertia))
    )


def _section(section: Section) -> Iterable[tuple[str, float]]:
    """The numbers that define a section: its dimensions, or else its area and second moment."""
    yield from section.dimensions or (("area", section.area), ("second_moment", section.second_moment))
    if section.shear_factor is not None:
        yield "shear_factor", section.shear_factor


def _lines(*pairs: tuple[str, float]) -> str:
    return "".join(f"{key} = {value!r}\n" for key, value in pairs)


def _text(text: str) -> str:
    """A TOML basic string: JSON's escapes are TOML's, and a record's texts hold only what prints."""
    return json.dumps(text, ensure_ascii=False)
