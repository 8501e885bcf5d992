"""Arms of presets and TOML files.  The size and nesting of a file are checked before it is parsed."""

from __future__ import annotations

import os
import re
import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

from tfarm.arm.records import Arm
from tfarm.errors import ParameterError, did_you_mean, naming, require
from tfarm.files import read_file

PRESETS = files("tfarm.arm") / "presets"
MOST_ARM_BYTES = 64 * 1024  # of an arm's file; that of 64 segments has 15 KB
# tomllib needs seconds for one dotted key of 40 KB and recurses on every bracket; an arm's file has short lines and a
# depth of two.
LONGEST_LINE = 8192  # characters
MOST_DOTS = 64  # in a line
MOST_BRACKETS = 16  # brackets open at once


@cache
def presets() -> tuple[str, ...]:
    """Return the names of the arms that come with tfarm."""
    return tuple(sorted(p.name.removesuffix(".toml") for p in PRESETS.iterdir() if p.name.endswith(".toml")))


def load(name_or_path: str | os.PathLike[str]) -> Arm:
    """Return the arm of a preset's name or of a TOML file's path.  Raises ParameterError, naming the file."""
    return arm_in(*load_tables(name_or_path))


def arm_in(table: dict[str, Any], file: str) -> Arm:
    """Return the arm of the parsed TOML of a file of that name."""
    from tfarm.arm.schema import arm_of_table  # here, as the import of pydantic is slow

    with naming(file):
        return arm_of_table(table)


def load_tables(name_or_path: str | os.PathLike[str]) -> tuple[dict[str, Any], str]:
    """Return the parsed TOML of a preset's name or a path, and the file's name."""
    is_named = not isinstance(name_or_path, os.PathLike)
    name: Any = name_or_path if is_named else os.fspath(name_or_path)
    is_text = isinstance(name, str) and bool(name.strip()) and "\0" not in name
    require(is_text, "arm", name, f"give a preset ({', '.join(presets())}) or a path")
    if is_named and name in presets():
        data, name = PRESETS.joinpath(f"{name}.toml").read_bytes(), f"{name}.toml"
    elif is_named and not ({"/", "\\", os.sep} & set(name) or name.endswith(".toml") or os.path.lexists(name)):
        remedy = f"no such preset: {did_you_mean(name, presets())}; or give the path of a .toml file"
        raise ParameterError(key="arm", value=name, remedy=remedy)
    else:
        data = read_file(name, MOST_ARM_BYTES, key="arm", what="a .toml file")
    with naming(name):
        return _table_of(data), name


def decoded(data: bytes, remedy: str) -> str:
    """Return the text of a file in UTF-8.  Raises ParameterError, naming the first other byte, with the remedy."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        bad = data[error.start : error.start + 1]
        raise ParameterError(key=f"byte {error.start}", value=bad, remedy=remedy) from None


def _table_of(data: bytes) -> dict[str, Any]:
    """Return the TOML table of a file.

    Raises ParameterError for lines and brackets that would slow the parser down, and for its errors, each with its
    line, the last one where the error has none.
    """
    text = decoded(data, "is not UTF-8; save the file as UTF-8")
    lines, depth, remedy = (
        text.split("\n"),
        0,
        f"more than {MOST_BRACKETS} brackets open; an arm's file needs no nesting",
    )
    for i, line in enumerate(lines, 1):
        for number, what, most in ((len(line), "characters", LONGEST_LINE), (line.count("."), "dots", MOST_DOTS)):
            require(number <= most, f"line {i}", line, f"{number} {what} in a line; at most {most}")
        for bracket in re.findall(r"[\[\]{}]", line):
            depth = depth + 1 if bracket in "[{" else max(depth - 1, 0)
            require(depth <= MOST_BRACKETS, f"line {i}", line, remedy)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        what, _, where = str(error).rstrip(")").partition(" (at ")
        at = re.match(r"line (\d+)", where)
        line = lines[int(at[1]) - 1 if at else -1]
        raise ParameterError(key=where or "TOML", value=line, remedy=f"is not TOML: {what}") from None
    except (ValueError, RecursionError):
        remedy = "an integer of thousands of digits, or brackets nested too deep"
        raise ParameterError(key="TOML", value=text, remedy=remedy) from None
