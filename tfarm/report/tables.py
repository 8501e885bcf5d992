"""A table once, written three ways: cells for the page, CSV and JSON with every digit."""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.floating[Any]]
Value = float | int | str | tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One quantity: `values` for the files, `cells` (the same, for reading) for the page.

    `key` carries the unit, as natural_frequency_rad_s; `title` and `unit` head the column; neighbours of one
    `group` share a heading; `tint` is a background colour a cell.
    """

    key: str
    title: str
    values: Sequence[Value]
    cells: Sequence[str]
    unit: str = ""
    group: str = ""
    tint: Sequence[str] = ()

    @property
    def is_text(self) -> bool:
        """Whether it is set flush left."""
        return any(isinstance(value, str | tuple) for value in self.values)


def text_column(key: str, title: str, texts: Sequence[str], group: str = "") -> Column:
    """A column of words."""
    return Column(key=key, title=title, values=texts, cells=texts, group=group)


def number_column(
    key: str,
    title: str,
    unit: str,
    values: Real,
    cells: Sequence[str],
    *,
    group: str = "",
    tint: Sequence[str] = (),
) -> Column:
    """A column of numbers, with the texts that the page shows for them."""
    return Column(key=key, title=title, unit=unit, values=values.tolist(), cells=cells, group=group, tint=tint)


def data_column(key: str, title: str, unit: str, values: Real) -> Column:
    """A column of numbers for files alone."""
    return Column(key=key, title=title, unit=unit, values=values.tolist(), cells=())


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns of one length.  `stem` names its files; `caption` says what is to be seen and what it means."""

    stem: str
    title: str
    caption: str
    columns: tuple[Column, ...]
    is_data: bool = field(default=False)  # the numbers of a picture: files only, not shown on the page

    def __post_init__(self) -> None:
        lengths = {len(part) for column in self.columns for part in (column.values, column.cells)}
        assert len(lengths) <= 1 or self.is_data, f"{self.stem}: columns of different lengths"

    @property
    def rows(self) -> list[list[tuple[Column, str, str]]]:
        """Of each row: column, cell and tint."""
        count = len(self.columns[0].cells)
        return [[(c, c.cells[i], c.tint[i] if c.tint else "") for c in self.columns] for i in range(count)]

    @property
    def groups(self) -> list[tuple[str, int]]:
        """Shared headings with the number of columns under each; empty where there is none."""
        runs = [(name, len(list(run))) for name, run in itertools.groupby(c.group for c in self.columns)]
        return runs if any(name for name, _ in runs) else []

    def as_csv(self) -> str:
        """Comma-separated values, shortest exact digits; several values in a cell are separated by a space."""
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([column.key for column in self.columns])
        writer.writerows(zip(*([_csv_cell(value) for value in column.values] for column in self.columns), strict=True))
        return stream.getvalue()

    def as_json(self) -> str:
        """{"table", "units", "rows": [{key: value}, ...]}; infinities are "inf" and "-inf"."""
        keys = [column.key for column in self.columns]
        rows = zip(*([json_value(value) for value in column.values] for column in self.columns), strict=True)
        lines = ",\n  ".join(json.dumps(dict(zip(keys, row, strict=True)), ensure_ascii=False) for row in rows)
        head = json.dumps({"table": self.title, "units": self._units()}, ensure_ascii=False)
        return f'{head[:-1]}, "rows": [\n  {lines}\n]}}\n'

    def _units(self) -> dict[str, str]:
        return {column.key: column.unit for column in self.columns if column.unit}


def json_value(value: Value) -> Any:
    """A value as JSON has it: a double, a text, a list; never NaN."""
    if isinstance(value, tuple):
        return [json_value(part) for part in value]
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return int(value)
    assert not math.isnan(value), "a table holds no NaN"
    return float(value) if math.isfinite(value) else ("inf" if value > 0 else "-inf")


def _csv_cell(value: Value) -> str:
    if isinstance(value, tuple):
        return " ".join(_csv_cell(part) for part in value)
    plain = json_value(value)
    return plain if isinstance(plain, str) else repr(plain)
