"""Arms and laws as TOML that `load` and `load_law` read back to the last bit.

The numbers of an arm have keys, those of its TOML file, such as "link.2.section.width".
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

from tfarm.arm.blocks import Rational
from tfarm.arm.law import Law, Part
from tfarm.arm.link import Link
from tfarm.arm.records import Arm
from tfarm.arm.rig import differing
from tfarm.arm.schema import ARM_TABLES, arm_of_table
from tfarm.errors import ParameterError, must_be_known
from tfarm.files import write_file

LAW_DEFAULTS: dict[str, Any] = {  # of the keys of [law]
    "input": None, "delay": 0.0, "period": None, "sign": -1, "references": (), "rule": "tustin", "prewarp": 0.0,
}  # fmt: skip


def to_toml(arm: Arm) -> str:
    """Return the arm as a TOML file; equal arms have equal texts.

    The numbers of the paper's arm are always there, others only where they differ from their defaults.
    """
    named = {"theory": arm.theory, "input": arm.input}
    defaults = {"theory": "timoshenko", "input": None if arm.motor else "hub_torque"}  # required with a motor
    springs = {"clamp": arm.clamp, "joint": arm.joint}
    motor = {} if arm.motor is None else differing(arm.motor, always=2)
    if arm.motor is not None and arm.motor.back_emf_constant == arm.motor.torque_constant:  # its default
        del motor["back_emf_constant"]
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
        *([["[motor]", *_lines(motor)]] if motor else []),
        *(["[[attachment]]", *_lines(differing(each, always=1))] for each in arm.attachments),
        *([["[gauge]", f"x = {arm.gauge.x!r}", f"side = {_text(arm.gauge.side)}"]] if arm.gauge.x else []),
        ["[payload]", *_lines(differing(arm.payload, always=2))],
    ]
    return "\n\n".join("\n".join(table) for table in tables) + "\n"


def _lines(numbers: Mapping[str, float]) -> Iterable[str]:
    """Return lines of a table; the repr of a float, inf too, is valid TOML."""
    return (f"{name} = {value!r}" for name, value in numbers.items())


def _link(link: Link, heading: str) -> Iterable[list[str]]:
    """Yield the tables of a link and of its section, that with its dimensions or else its area and second moment."""
    names = ("length", "density", "youngs_modulus", "shear_modulus", "damping")
    yield [heading, *_lines({name: getattr(link, name) for name in names})]
    section = link.section
    numbers = dict(section.dimensions) or {"area": section.area, "second_moment": section.second_moment}
    if section.shear_factor is not None:
        numbers["shear_factor"] = section.shear_factor
    yield ["[link.section]", f"shape = {_text(section.shape)}", *_lines(numbers)]


def _text(text: str) -> str:
    """Return a TOML basic string, with the escapes of JSON."""
    return json.dumps(text, ensure_ascii=False)


def law_toml(law: Law) -> str:
    """Return the table [law] of a law; equal laws have equal texts.

    Raises ParameterError for a law with a state space, whose form is a .mat file, and for two blocks on one signal.
    """
    head = [f"name = {_text(law.name)}"]
    keys = ((key, getattr(law, key), usual) for key, usual in LAW_DEFAULTS.items())
    head += [f"{key} = {_value(value)}" for key, value, usual in keys if value != usual]
    names = [name for part in law.parts for name in part.signals]
    if len(set(names)) < len(names):
        raise ParameterError(key="law", value=law.name, remedy="two blocks on one signal: add them up first")
    tables = [["[law]", *head], *(list(_signal(part)) for part in law.parts)]
    return "\n\n".join("\n".join(table) for table in tables) + "\n"


def save_law(law: Law, path: Path) -> None:
    """Write a law as a TOML file.  Raises ParameterError where it cannot be written."""
    write_file(path, law_toml(law).encode(), key="--save")


def _signal(part: Part) -> Iterable[str]:
    """Yield the lines of the table of one signal; a name with a place is quoted."""
    block, name = part.block, part.signals[0]
    if not isinstance(block, Rational) or len(part.signals) > 1:
        raise ParameterError(
            key="law",
            value=name,
            remedy="save a state space as a .mat file: scipy.io.savemat(file, {'A': ..}), matrices = file in [law]",
        )
    yield f"[law.{json.dumps(name) if '@' in name else name}]"
    if len(block.num) == len(block.den) == 1 and block.den[0] == 1.0:
        yield f"gain = {block.num[0]!r}"
    else:
        yield f"num = {_value(block.num)}"
        yield f"den = {_value(block.den)}"


def _value(value: Any) -> str:
    """Return a TOML value; the repr of a float is valid TOML."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value) if isinstance(value, str) else repr(value)


class KeyedArms:
    """Arms with other values of some numbers of one arm, by their TOML keys.

    With Young's modulus alone the shear modulus changes too, at a constant Poisson's ratio.  Raises ParameterError,
    naming `what`, for an unknown key, with the nearest.
    """

    def __init__(self, arm: Arm, keys: Sequence[str], what: str = "free") -> None:
        self.arm, self.keys = arm, tuple(keys)
        self._table = tomllib.loads(to_toml(arm))
        known = list(_known(self._table))
        for key in keys:
            must_be_known(what, key, known)
        if repeated := {key for key in keys if keys.count(key) > 1}:
            raise ParameterError(key=what, value=min(repeated), remedy="is named twice; once is enough")

    def at(self, values: Mapping[str, float]) -> Arm:
        """Return the arm with other values of numbers.  Raises ParameterError for an illegal value."""
        table = deepcopy(self._table)
        for key, value in values.items():
            here, name = _table_of(table, key)
            place = key.removesuffix(name)
            if name == "youngs_modulus" and not {f"{place}shear_modulus", f"{place}poissons_ratio"} & set(values):
                here["shear_modulus"] *= value / here[name]
            if name == "poissons_ratio":
                del here["shear_modulus"]
            here[name] = value
        return arm_of_table(table)

    def value(self, key: str) -> float:
        """Return a number of the arm, from its file or its default."""
        place, name = _table_of(self._table, key)
        if name == "poissons_ratio":
            return float(place["youngs_modulus"] / (2 * place["shear_modulus"]) - 1)
        if name in place:
            return float(place[name])
        if name == "back_emf_constant":
            return float(place["torque_constant"])
        words = key.split(".")
        return float(ARM_TABLES[words[0]].model_fields[words[-1]].default)


def _known(table: Mapping[str, Any]) -> Iterator[str]:
    """Yield the keys of all numbers of an arm's file, also of those at their defaults."""
    alone = isinstance(table["link"], dict)
    links = [table["link"]] if alone else table["link"]
    for number, link in enumerate(links, start=1):
        place = "link" if alone else f"link.{number}"
        yield from (f"{place}.{name}" for name in ARM_TABLES["link"].model_fields if name != "section")
        yield from (f"{place}.section.{name}" for name, value in link["section"].items() if not isinstance(value, str))
    for number in range(1, 1 + len(table.get("attachment", ()))):
        yield from (f"attachment.{number}.{name}" for name in ARM_TABLES["attachment"].model_fields)
    for room in ("hub", "clamp", "joint", "payload", *(["motor"] if "motor" in table else [])):
        yield from (f"{room}.{name}" for name in ARM_TABLES[room].model_fields)


def _table_of(table: dict[str, Any], key: str) -> tuple[dict[str, Any], str]:
    """Return the innermost table of a key, a new one where there is none, and the name in it."""
    *places, name = key.split(".")
    here: Any = table
    for place in places:
        here = here[int(place) - 1] if isinstance(here, list) else here.setdefault(place, {})
    return here, name
