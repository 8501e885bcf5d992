"""From a preset's name or a file's path to an Arm.

A file is data: it is measured before it is parsed, and never run.
"""

from __future__ import annotations

import os
import re
import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

from tfarm.arm.records import Arm
from tfarm.errors import ParameterError, did_you_mean
from tfarm.files import read_file

PRESETS = files("tfarm.arm") / "presets"
MOST_BYTES = 64 * 1024
# tomllib takes seconds on one dotted key of 40 KB and recurses on every bracket; an arm's file needs
# a line of text and a depth of two.
LONGEST_LINE, MOST_DOTS, DEEPEST = 8192, 64, 16


@cache
def presets() -> tuple[str, ...]:
    """The names of the arms that come with tfarm."""
    return tuple(sorted(p.name.removesuffix(".toml") for p in PRESETS.iterdir() if p.name.endswith(".toml")))


def load(name_or_path: str | os.PathLike[str]) -> Arm:
    """The arm of a preset's name or of a TOML file's path."""
    name = _text_of(name_or_path)
    if not isinstance(name_or_path, os.PathLike) and name in presets():
        return _arm_of(PRESETS.joinpath(f"{name}.toml").read_bytes(), f"{name}.toml")
    if not isinstance(name_or_path, os.PathLike) and not _looks_like_a_path(name):
        remedy = f"no such preset: {did_you_mean(name, presets())}; or give the path of a .toml file"
        raise ParameterError(key="arm", value=name, remedy=remedy)
    return _arm_of(_read(name), name)


def load_tables(name_or_path: str | os.PathLike[str]) -> tuple[dict[str, Any], str]:
    """The parsed TOML behind a preset's name or a path, and the file's name: for rooms with tables of their own."""
    name = _text_of(name_or_path)
    if not isinstance(name_or_path, os.PathLike) and name in presets():
        data, name = PRESETS.joinpath(f"{name}.toml").read_bytes(), f"{name}.toml"
    else:
        data = _read(name)
    try:
        return _table_of(_decoded(data)), name
    except ParameterError as error:
        raise error.in_file(name) from None


def _text_of(name_or_path: object) -> str:
    name = os.fspath(name_or_path) if isinstance(name_or_path, os.PathLike) else name_or_path
    if not isinstance(name, str) or not name.strip() or "\0" in name:
        remedy = f"give a preset ({', '.join(presets())}) or a path"
        raise ParameterError(key="arm", value=name, remedy=remedy)
    return name


def _looks_like_a_path(name: str) -> bool:
    separators = {"/", "\\", os.sep}
    return name.endswith(".toml") or bool(separators & set(name)) or os.path.lexists(name)


def _read(path: str) -> bytes:
    return read_file(path, MOST_BYTES, key="arm", what="a .toml file")


def _arm_of(data: bytes, file: str) -> Arm:
    from tfarm.arm.schema import arm_of_table  # here, because pydantic takes a while to import

    try:
        return arm_of_table(_table_of(_decoded(data)))
    except ParameterError as error:
        raise error.in_file(file) from None


def _decoded(data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        bad, remedy = data[error.start : error.start + 1], "is not UTF-8; save the file as UTF-8"
        raise ParameterError(key=f"byte {error.start}", value=bad, remedy=remedy) from None


def _table_of(text: str) -> dict[str, Any]:
    """The TOML table, after a look at what would choke the parser."""
    _check_lines(text)
    _check_depth(text)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _no_toml(text, str(error)) from None
    except (ValueError, RecursionError):
        remedy = "an integer of thousands of digits, or brackets nested too deep"
        raise ParameterError(key="TOML", value=text, remedy=remedy) from None


def _no_toml(text: str, complaint: str) -> ParameterError:
    """The parser's complaint with the line it is about, the last one where it names none."""
    what, _, where = complaint.rstrip(")").partition(" (at ")
    number = re.match(r"line (\d+)", where)
    line = text.split("\n")[int(number[1]) - 1 if number else -1]
    return ParameterError(key=where or "TOML", value=line, remedy=f"is not TOML: {what}")


def _check_lines(text: str) -> None:
    for i, line in enumerate(text.split("\n"), 1):
        if len(line) > LONGEST_LINE:
            remedy = f"{len(line)} characters in a line; at most {LONGEST_LINE}"
            raise ParameterError(key=f"line {i}", value=line, remedy=remedy)
        if line.count(".") > MOST_DOTS:
            remedy = f"{line.count('.')} dots in a line; at most {MOST_DOTS}"
            raise ParameterError(key=f"line {i}", value=line, remedy=remedy)


def _check_depth(text: str) -> None:
    depth = 0
    for bracket in re.finditer(r"[\[\]{}]", text):
        depth = depth + 1 if bracket[0] in "[{" else max(depth - 1, 0)
        if depth > DEEPEST:
            i = text.count("\n", 0, bracket.start()) + 1
            remedy = f"more than {DEEPEST} brackets open; an arm's file needs no nesting"
            raise ParameterError(key=f"line {i}", value=text.split("\n")[i - 1], remedy=remedy)
