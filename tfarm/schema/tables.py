"""Tables of declared quantities, the sections that a person reads of a record, and both as JSON and CSV.

Files have every digit of a double, infinities as "inf" and "-inf"; NaN does not occur.
"""

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tfarm.digits import TEXTS, CellsOf, round_to_error
from tfarm.schema.quantities import (
    COMPLEX_ERROR,
    EMPTY,
    NO_VALUE,
    At,
    Quantity,
    entries,
    is_declared,
    is_list_of_records,
    is_table,
    quantities_of,
    round_parts,
    text,
    to_json_value,
    with_flat,
    with_unit,
)


@dataclass(frozen=True, slots=True)
class Column:
    """One quantity: `key` in JSON and files (with the unit, as omega_rad_s), `title` and `unit` where a person reads.

    `of` are its values, `digits` makes cells of them; where that is not enough, `shown` are the cells.  `tint` is a
    background colour a cell; on a narrow terminal a column that `folds` is folded.  `help` is the meaning of the
    quantity, `helps` one a cell: tooltips of a page.
    """

    key: str
    title: str = ""
    unit: str = ""
    of: Any = ()
    digits: CellsOf = TEXTS
    shown: Sequence[str] | None = None
    tint: Sequence[str] = ()
    folds: bool = False
    help: str = ""
    helps: Sequence[str] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "of", self.of.tolist() if hasattr(self.of, "tolist") else list(self.of))

    @property
    def values(self) -> Sequence[Any]:
        """The values."""
        return self.of

    @property
    def cells(self) -> Sequence[str]:
        """The same as a page shows them."""
        return self.digits(self.of) if self.shown is None else self.shown

    @property
    def heading(self) -> str:
        """The title with the unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    @property
    def is_text(self) -> bool:
        """Whether it is set flush left: words, or lists of words."""
        first = [value[0] if isinstance(value, list) and value else value for value in self.of]
        return any(isinstance(value, str | tuple) for value in first)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns of one length; a sequence of their rows as JSON has them.

    `stem` names its files; `title` and `caption` are those of the page.  Blocks of a narrow terminal begin with the
    `leading` columns.
    """

    columns: tuple[Column, ...]
    stem: str = ""
    title: str = ""
    caption: str = ""
    leading: int = 1

    def __post_init__(self) -> None:
        keys = [column.key for column in self.columns]
        assert len(set(keys)) == len(keys), f"{self.stem}: two columns of one key in {keys}"
        assert len({len(column.of) for column in self.columns}) <= 1, (
            f"{self.stem}: columns of different lengths"
        )

    def __iter__(self) -> Iterator[dict[str, Any]]:
        keys = [column.key for column in self.columns]
        values = [column.of for column in self.columns]
        return (dict(zip(keys, row, strict=True)) for row in zip(*values, strict=True))


def table(
    rows: Any, names: Sequence[str] = (), *, parent: Any = None, stem: str = "", title: str = ""
) -> Table:
    """Return a row a record (or an entry of a record of columns), a column a quantity: those with a label, or these.

    A column without any value is left out unless it is named.  `parent` is the record that has these rows.
    """
    columns: list[Column] = []
    is_of_columns = is_table(rows)
    if is_of_columns or rows:
        declared = quantities_of(rows if is_of_columns else rows[0], parent)
        for name in names or [name for name, of in declared.items() if of.label]:
            values = list(getattr(rows, name)) if is_of_columns else [getattr(row, name) for row in rows]
            if names or not values or any(value is not None and str(value) for value in values):
                columns.append(_column(values, declared[name]))
    return Table(columns=tuple(columns), stem=stem, title=title)


def _column(values: Sequence[Any], of: Quantity) -> Column:
    """Return the column of a quantity."""
    cells = []
    for value in values:
        is_empty = isinstance(value, list | tuple) and not value
        cells.append(NO_VALUE if is_empty else text(value, of.digits))
    plain = list(map(to_json_value, values))
    return Column(of.key, of.label, of.unit, of=plain, shown=cells, folds=_folds(cells), help=of.help)


def _folds(cells: Sequence[str]) -> bool:
    """Whether a column of these cells may be folded."""
    # characters of a cell from which on it may be folded on a narrow terminal
    longest_line = 40
    return max(map(len, cells), default=0) > longest_line


def across(records: Mapping[str, Any], *, keys: Sequence[str] = (), title: str = "") -> Table:
    """Return a row a quantity with one value, a column a record; the records are named, `keys` are those of columns."""
    found = []
    known: dict[str, Quantity] = {}
    filled = set()
    for record in records.values():
        own = {label: (of, value) for label, of, value in entries(record)}
        found.append(own)
        known |= {label: of for label, (of, _) in own.items()}
        filled |= {label for label, (_, value) in own.items() if str(value) not in EMPTY}
    labels = [label for label in known if label in filled]
    columns = [
        Column("quantity", "quantity", of=labels, helps=[known[label].help for label in labels]),
        Column("unit", "unit", of=[known[label].unit for label in labels]),
    ]
    for key, name, each in zip(keys or records, records, found, strict=True):
        pairs = [each.get(label, (Quantity(), None)) for label in labels]
        values = [
            to_json_value(value.value if isinstance(value, At) and value.omega is None else value)
            for _, value in pairs
        ]
        cells = [with_unit(value, replace(of, unit="")) for of, value in pairs]
        columns.append(Column(key, name, of=values, shown=cells, folds=_folds(cells)))
    return Table(columns=tuple(columns), title=title, leading=2)


def roots_table(values: Any, of: Quantity) -> Table:
    """Return a row a complex number: its real and imaginary part, and of a pole or zero in 1/s its damping ratio."""
    # of the damping ratio of a listed pole
    ratio_digits = 6
    roots = [complex(value) for value in values]
    shown = [round_parts(root, of.digits) for root in roots]
    unit = of.unit.replace("1/s", "rad/s")
    columns = [
        Column("re", f"Re {of.label}", of.unit, of=[s.real for s in roots], shown=[re for re, _ in shown]),
        Column("im", f"Im {of.label}", unit, of=[s.imag for s in roots], shown=[im for _, im in shown]),
    ]
    if of.unit == "1/s":
        ratios = [
            round_to_error(-s.real / abs(s), COMPLEX_ERROR, ratio_digits) if s.imag else NO_VALUE
            for s in roots
        ]
        columns.append(Column("damping_ratio", "damping ratio", of=ratios))
    return Table(columns=tuple(columns))


def curve_table(record: Any) -> Table:
    """Return the curves of a record, a row a point, complex ones in two columns; else the first list of records."""
    if hasattr(record, "csv_table"):
        return record.csv_table
    columns: list[Column] = []
    for value, of, _ in with_flat(record):
        if of.curve and np.iscomplexobj(value):
            for number, values in enumerate(np.atleast_2d(value)):
                after = f"_{number}" if np.ndim(value) > 1 else ""
                for part, numbers in (("re", values.real), ("im", values.imag)):
                    cells = ["" if math.isnan(each) else each for each in numbers.tolist()]
                    columns.append(
                        Column(f"{part}_{of.key}{after}", f"{part} {of.label}{after}", of.unit, of=cells)
                    )
        elif of.curve:
            columns.append(Column(of.key, of.label, of.unit, of=value))
        elif not columns and is_list_of_records(value):
            return table(value)
    return Table(columns=tuple(columns))


# --------------------------------------------------------------------------------------------------------- sections


@dataclass(frozen=True, slots=True)
class RecordSection:
    """Part of a record as a person reads it, under a title: pairs of label and text, a table or a drawing."""

    title: str = ""
    pairs: list[tuple[str, str]] = field(default_factory=list)
    table: Table | None = None
    drawing: str = ""


def sections(record: Any, title: str = "") -> list[RecordSection]:
    """Return a record as a person reads it: tables declared `first`, single values, other tables, records inside."""
    own = RecordSection(title)
    first: list[RecordSection] = []
    later: list[RecordSection] = []
    for value, of, owner in with_flat(record):
        if not of.label:
            continue
        if value is None or of.curve:
            own.pairs.extend([(of.label, NO_VALUE)] * of.is_number)
        elif is_table(value) or is_list_of_records(value):
            (first if of.first else later).append(RecordSection(of.label, table=table(value, parent=owner)))
        elif is_declared(value) and not isinstance(value, At) and not hasattr(value, "as_text"):
            later += sections(value, of.label)
        elif isinstance(value, np.ndarray) and np.iscomplexobj(value) and value.size:
            later.append(RecordSection(of.help or of.label, table=roots_table(value, of)))
        elif shown := with_unit(value, of):
            own.pairs.append((of.label, shown))
    if isinstance(whole := getattr(record, "table", None), Table):
        later.append(RecordSection(whole.title, table=whole))
    if hasattr(record, "drawing"):
        later.append(RecordSection(drawing=record.drawing))
    return [*first, own, *later]


# ------------------------------------------------------------------------------------------------------------ files


def to_json(answer: Any, **how: Any) -> str:
    """Return one JSON object in ASCII, which every pipe takes; a table in it is a list of its rows.

    `how` are further options of `json.dumps`.  NaN raises ValueError.
    """
    try:
        return json.dumps(answer, allow_nan=False, default=list, **how)
    except ValueError:
        # of an infinity, which is a text in JSON, or of a NaN
        return json.dumps(json_value(answer), allow_nan=False, **how)


def json_value(value: Any) -> Any:
    """Return a value as JSON has it: a table as its rows, a tuple as a list, an infinity as a text."""
    if isinstance(value, float):
        if math.isnan(value):
            raise ValueError("an answer or a table holds a NaN")
        return float(value) if math.isfinite(value) else str(value)
    if isinstance(value, dict):
        return {key: json_value(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | Table):
        return [json_value(entry) for entry in value]
    return value


def as_json(table: Table) -> str:
    """Return {"table", "units", "rows": [{key: value}, ...]} as JSON."""
    units = {column.key: column.unit for column in table.columns if column.unit}
    whole = {"table": table.title, "units": units, "rows": table}
    return f"{to_json(whole, ensure_ascii=False)}\n"


def as_csv(table: Table, *, units: bool = False) -> str:
    """Return comma-separated values, shortest exact digits; several values in a cell are separated by a space.

    With `units` these stand in brackets behind the keys.
    """
    stream = io.StringIO()
    columns = table.columns
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(
        [f"{column.key} [{column.unit}]" if units and column.unit else column.key for column in columns]
    )
    writer.writerows(zip(*map(_csv_cells, columns), strict=True))
    return stream.getvalue()


def _csv_cells(column: Column) -> Sequence[str]:
    """Return the cells of a column; those of records, such as intervals, are texts, and JSON has their numbers."""
    if any(map(_holds_records, column.of)):
        return [cell if value else "" for cell, value in zip(column.cells, column.of, strict=True)]
    found = ("" if value is None else json_value(value) for value in column.of)
    return [" ".join(map(str, each)) if isinstance(each, list) else str(each) for each in found]


def _holds_records(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and any(map(_holds_records, value)))


def save_table(table: Table, folder: Path, kinds: Sequence[str] = ("csv", "json")) -> tuple[str, ...]:
    """Write a report's table as CSV and JSON, or one of these; return the names of the files."""
    names = tuple(f"{table.stem}.{kind}" for kind in kinds)
    for name, kind in zip(names, kinds, strict=True):
        content = as_csv(table) if kind == "csv" else as_json(table)
        (folder / name).write_text(content, encoding="utf-8", newline="")
    return names
