"""JSON and CSV: every digit of a double, infinities as "inf" and "-inf"; NaN does not occur."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tfarm.columns import Column, Table
from tfarm.files import write_file


def to_json(answer: Any) -> str:
    """One JSON object in ASCII, which every pipe takes; a table in it is a list of its rows.  NaN raises ValueError."""
    return json.dumps(json_value(answer), allow_nan=False)


def json_value(value: Any) -> Any:
    """A value as JSON has it: a table as its rows, a tuple as a list, an infinity as a text."""
    if isinstance(value, float):
        if math.isnan(value):
            raise ValueError("an answer or a table holds a NaN")
        return float(value) if not math.isinf(value) else "inf" if value > 0 else "-inf"
    if isinstance(value, dict):
        return {key: json_value(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | Table):
        return [json_value(entry) for entry in value]
    return value


def as_json(table: Table) -> str:
    """{"table", "units", "rows": [{key: value}, ...]}, a line a row."""
    columns = table.columns
    rows = zip(*(json_value(column.values) for column in columns), strict=True)
    texts = (_dumped({column.key: value for column, value in zip(columns, row, strict=True)}) for row in rows)
    lines = ",\n  ".join(texts)
    head = _dumped({"table": table.title, "units": {column.key: column.unit for column in columns if column.unit}})
    return f'{head[:-1]}, "rows": [\n  {lines}\n]}}\n'


def _dumped(entries: dict[str, Any]) -> str:
    return json.dumps(entries, ensure_ascii=False, allow_nan=False)


def as_csv(table: Table, *, units: bool = False) -> str:
    """Comma-separated values, shortest exact digits; several values in a cell are separated by a space.

    With `units` these stand in brackets behind the keys.
    """
    stream, columns = io.StringIO(), table.columns
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([f"{column.key} [{column.unit}]" if units and column.unit else column.key for column in columns])
    writer.writerows(zip(*map(_csv_cells, columns), strict=True))
    return stream.getvalue()


def _csv_cells(column: Column) -> Sequence[str]:
    """The cells of a column; those of records, such as intervals, are texts, and JSON has their numbers."""
    if not any(map(_holds_records, column.values)):
        return list(map(_csv_cell, column.values))
    return [cell if value else "" for cell, value in zip(column.cells, column.values, strict=True)]


def _holds_records(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and any(map(_holds_records, value)))


def _csv_cell(value: Any) -> str:
    if value is None:
        return ""
    found = json_value(value)
    return " ".join(map(str, found)) if isinstance(found, list) else str(found)


def write_csv(table: Table, path: Path) -> None:
    """A command's table to the file asked for, in one step."""
    write_file(path, as_csv(table, units=True).encode(), key="--csv")


RENDERERS = {"csv": as_csv, "json": as_json}


def save_table(table: Table, folder: Path, kinds: Sequence[str] = tuple(RENDERERS)) -> tuple[str, ...]:
    """A report's table as CSV and JSON, or one of these: the names of the files."""
    for kind in kinds:
        (folder / f"{table.stem}.{kind}").write_text(RENDERERS[kind](table), encoding="utf-8", newline="")
    return tuple(f"{table.stem}.{kind}" for kind in kinds)
