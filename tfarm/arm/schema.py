"""From a parsed TOML table to the arm; the first problem becomes one ParameterError."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from tfarm.arm.choices import INPUTS, THEORIES
from tfarm.arm.records import MOST_PARTS, Arm
from tfarm.arm.tables import ARM_TABLES, SHAPE_TABLES, ArmTable
from tfarm.errors import MISSING, ParameterError, did_you_mean

LOOP_TABLES = ("sampling", "converters", "actuator", "slew", "law")  # of the loop: others read them
AT_THE_TOP = ("name", "assumptions", "theory", "input")  # no tables: they stand before the first


def arm_of_table(table: dict[str, Any]) -> Arm:
    """The arm that a parsed TOML table describes."""
    own = {key: value for key, value in table.items() if key not in LOOP_TABLES}
    if isinstance(own.get("link"), dict):
        own["link"] = [own["link"]]
    try:
        return ArmTable.model_validate(own).build()
    except ValidationError as error:
        links = own.get("link")
        alone = not isinstance(links, list) or len(links) < 2
        raise _in_one_line(error.errors(include_url=False), alone) from None


def _in_one_line(problems: Sequence[ErrorDetails], alone: bool) -> ParameterError:
    """The first problem; a key that is misspelt comes before the one that is then missing.

    `alone` is whether there is but one link, which then has no number.
    """
    problem = min(problems, key=lambda problem: problem["type"] != "extra_forbidden")
    place, kind = problem["loc"], problem["type"]
    key, value = _key(place, alone), problem["input"]
    if kind in ("missing", "too_short"):
        return ParameterError(key=key, value=MISSING, remedy=f"give {_expected(place)}")
    if kind == "union_tag_not_found":
        return ParameterError(key=f"{key}.shape", value=MISSING, remedy=f"give one of {', '.join(SHAPE_TABLES)}")
    if kind == "extra_forbidden":
        word, names = str(place[-1]), [name for name in place[:-1] if isinstance(name, str)]
        table = SHAPE_TABLES[names[2]] if names[:2] == ["link", "section"] else ARM_TABLES[names[0] if names else ""]
        meant = did_you_mean(word, table.model_fields)
        if names and word in AT_THE_TOP:
            meant = f"{word} belongs at the top of the file, before its first table"
        return ParameterError(key=key, value=value, remedy=f"unknown key; {meant}")
    if kind == "union_tag_invalid":
        shape = str(problem["ctx"]["tag"])
        remedy = f"unknown shape; {did_you_mean(shape, SHAPE_TABLES)}"
        return ParameterError(key=f"{key}.shape", value=shape, remedy=remedy)
    if kind == "too_long":
        return ParameterError(key=key, value=problem["ctx"]["actual_length"], remedy=f"at most {MOST_PARTS} are read")
    return ParameterError(key=key, value=value, remedy=f"wrong type; give {_expected(place)}")


def _key(place: Sequence[str | int], alone: bool) -> str:
    """The TOML key of a pydantic location, with the number of a [[table]] counted from 1."""
    if place[0] not in ("link", "attachment") or len(place) == 1:
        return ".".join(map(str, place))
    number = () if alone and place[0] == "link" else (int(place[1]) + 1,)
    return ".".join(map(str, (place[0], *number, *_without_shape(place)[1:])))


def _without_shape(place: Sequence[str | int]) -> tuple[str, ...]:
    """The names of a pydantic location: no numbers of a list, and no shape, which it has between section and key."""
    names = tuple(name for name in place if isinstance(name, str))
    return names[:2] + names[3:] if names[:2] == ("link", "section") else names


def _expected(place: Sequence[str | int]) -> str:
    """What a key should hold."""
    key = ".".join(_without_shape(place))
    known = {
        "name": 'a text such as name = "my-arm"',
        "assumptions": "a text in double quotes" if place[1:] else 'a list of texts such as ["density from a table"]',
        "theory": f"one of {', '.join(THEORIES)}, in double quotes",
        "input": f"one of {', '.join(INPUTS)}, in double quotes",
        "link.section.shape": f"one of {', '.join(SHAPE_TABLES)}",
        "link": "a table, headed [link], or [[link]] for each of several",
        "attachment": "a table for each, headed [[attachment]]",
        **dict.fromkeys(("hub", "clamp", "joint", "motor", "payload", "link.section"), f"a table, headed [{key}]"),
    }
    return known.get(key, "a number without quotes, in SI units")
