"""Columns of numbers from a text file, as laboratories write them.

Comma, semicolon or tab separate the columns, whichever the header has; behind the last two a decimal comma is read.  A
byte order mark, Windows line ends, empty lines and lines that begin with # are passed over.  A unit in brackets behind
a name, "t [s]", is not part of it.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arm.reading import decoded
from tfarm.arrays import Real
from tfarm.errors import MISSING, ParameterError, naming
from tfarm.files import read_file
from tfarm.records import record

MOST_RECORD_BYTES = 256 * 1024 * 1024  # of a record; an hour of two signals at 1 kHz as text has 150 MB


@dataclass(frozen=True, slots=True)
@record
class Sheet:
    """Columns `values` (columns, rows) with their `names` and `units` ("" where there is none) and each row's line."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Real
    lines: tuple[int, ...]
    digest: str

    def __getitem__(self, name: str) -> Real:
        return self.values[self.names.index(name)]

    def get(self, name: str) -> Real | None:
        """The column of that name, if there is one."""
        return dict(zip(self.names, self.values, strict=True)).get(name)

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def refuse(self, name: str, wrong: NDArray[np.bool_], remedy: str) -> None:
        """Raise ParameterError for the first row (rows,) in which a column is wrong, naming its line."""
        if wrong.any():
            at = int(wrong.argmax())
            raise ParameterError(key=f"line {self.lines[at]}, {name}", value=float(self[name][at]), remedy=remedy)


def digest_of(data: bytes) -> str:
    """The SHA-256 of a file's bytes."""
    return hashlib.sha256(data).hexdigest()


def read_sheet(path: str | os.PathLike[str], key: str) -> Sheet:
    """The columns of a text file.

    Raises ParameterError naming the line for a missing or doubled name, a row of another length, or what is no finite
    number; naming `key` where the file cannot be read.
    """
    data = read_file(path, MOST_RECORD_BYTES, key=key, what="a .csv file")
    with naming(path):
        return sheet_of(data)


def sheet_of(data: bytes) -> Sheet:
    """The columns of a text file's bytes; errors name no file."""
    text = decoded(data, "is not UTF-8 text; save the file as CSV in UTF-8")
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise ParameterError(key="header", value=MISSING, remedy="the file is empty; begin with the names of columns")
    head = lines[0][1]
    separator = next((each for each in "\t;" if each in head), ",")
    names, units = _header(_cells(head, separator))
    rows = []
    for number, line in lines[1:]:
        cells = _cells(line, separator)
        if len(cells) != len(names):
            remedy = f"{len(cells)} columns where the header names {len(names)}"
            raise ParameterError(key=f"line {number}", value=line, remedy=remedy)
        rows.append(cells if separator == "," else [cell.replace(",", ".") for cell in cells])
    if not rows:
        raise ParameterError(key="rows", value=0, remedy="a header and nothing below it")
    numbers = tuple(number for number, _ in lines[1:])
    return Sheet(names, units, _numbers(names, numbers, rows).T, numbers, digest_of(data))


def _header(cells: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units; a first line of numbers is a header left out."""
    found = [re.fullmatch(r"(.*?)\s*(?:\[(.*)\])?", cell.strip()) for cell in cells]
    names = tuple(each[1] if each else cell for each, cell in zip(found, cells, strict=True))
    units = tuple((each[2] or "").strip() if each else "" for each in found)
    if any(_is_number(name) for name in names):
        remedy = "the first line holds numbers; begin the file with the names of its columns"
        raise ParameterError(key="header", value=MISSING, remedy=remedy)
    for place, name in enumerate(names, start=1):
        if not name or name in names[: place - 1]:
            remedy = "each column has a name of its own"
            raise ParameterError(key=f"header, column {place}", value=name, remedy=remedy)
    return names, units


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(separator)]


def _numbers(names: Sequence[str], lines: Sequence[int], rows: list[list[str]]) -> Real:
    """The cells (rows, columns) as numbers, all at once; one by one only to say which of them is none."""
    try:
        values = np.array(rows, dtype=float)
    except ValueError:
        values = np.full((1, 1), np.nan)
    if np.isfinite(values).all() and all(cell.isascii() and "_" not in cell for row in rows for cell in row):
        return values
    at, name, cell = next(
        (number, name, cell)
        for number, row in zip(lines, rows, strict=True)
        for name, cell in zip(names, row, strict=True)
        if not _is_number(cell)
    )
    remedy = "no finite number; leave the row out, or write numbers as 50, 0.5 or 5e1"
    raise ParameterError(key=f"line {at}, {name}", value=cell, remedy=remedy)


def _is_number(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text))) and text.isascii() and "_" not in text
    except ValueError:
        return False
