"""The numbers of an arm by their keys in its TOML file, "link.2.section.width": which there are, and other values."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from typing import Any

from tfarm.arm.records import Arm
from tfarm.arm.schema import arm_of_table
from tfarm.arm.tables import ARM_TABLES
from tfarm.arm.writing import to_toml
from tfarm.errors import ParameterError, must_be_known


class KeyedArms:
    """The arms that an arm becomes as some of its numbers run, by their TOML keys.

    Poisson's ratio stays where Young's modulus runs alone: the shear modulus goes along.  Raises ParameterError, naming
    `what`, for a key that the arm does not have, with the nearest.
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
        """The arm with those numbers in their places.  Raises ParameterError where it is none."""
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
        """The arm's own number: what its file says, or its default."""
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
    """The keys of all numbers that the arm's file holds or could hold."""
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
    """The innermost table of a key, made where it is not there, and the name in it."""
    *places, name = key.split(".")
    here: Any = table
    for place in places:
        here = here[int(place) - 1] if isinstance(here, list) else here.setdefault(place, {})
    return here, name
