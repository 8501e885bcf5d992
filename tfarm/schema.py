"""A quantity of a record is declared once, on its field or property, and every output reads it there.

    @dataclass(frozen=True)
    class Margins:
        delay: Annotated[float, Quantity("delay margin", "s", 4, "smallest further delay that destabilises the loop")]

JSON, CSV, terminals, pages, axes, the documentation and the comparison of two records have its name, unit, digits and
meaning from here.  `to_dict` and `sections` read a record, `table` records of one class, `compare` two of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from functools import cache, cached_property
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import numpy as np

from tfarm.columns import Column, Table
from tfarm.digits import general, within

SLUGS = {"s": "s", "m": "m", "rad/s": "rad_s", "Hz": "hz", "deg": "deg", "samples": "samples"}  # of units in keys
COMPLEX_ERROR = 2e-14  # of the size of a pole or zero: what rounding leaves in its parts (tests: 1e-14 to 50 digits)
RATIO_DIGITS = 6  # of the damping ratio of a listed pole
NO_VALUE = "-"
LONGEST_LINE = 40  # characters of a cell from which on it may be folded on a narrow terminal
LONGEST_COMPARED = 28  # characters of a text that is compared: a word or an interval, and no sentence
EMPTY = {"None", "", "[]", "()"}  # what is compared where neither has a value
SAME = 4e-14  # of a value: what two computations of it may differ by


@dataclass(frozen=True, slots=True)
class Quantity:
    """Label, unit, digits for a person and meaning of one entry of a record.

    `key` is its name in JSON and CSV, by default that of the attribute with its unit.  An entry without a label is in
    JSON alone.  A record (or dictionary) that is `flat` has its entries in the place of its own; the arrays that are a
    `curve` are of one length: columns in CSV, and not printed.  Where a number (`is_number`, by its type) has no value
    a person reads "-", and nothing where a text or a record has none.
    """

    label: str = ""
    unit: str = ""
    digits: int = 6
    help: str = ""
    key: str = ""
    flat: bool = False
    curve: bool = False
    is_number: bool = False


class At(NamedTuple):
    """A value and the frequency [rad/s] at which it occurs: two keys in JSON, two cells of a table."""

    value: float
    omega: float | None = None


def quantities(kind: Any) -> dict[str, Quantity]:
    """The quantities of a class of records by attribute: those of its fields, then those of its properties."""
    return _quantities(kind)


@cache
def _quantities(kind: Any) -> dict[str, Quantity]:
    hints = get_type_hints(kind, include_extras=True)
    for base in reversed(kind.__mro__):
        for name, member in vars(base).items():
            read: Any = getattr(member, "fget", None) or (member.func if isinstance(member, cached_property) else None)
            if read is not None and "Annotated" in str(read.__annotations__.get("return")):
                hints[name] = get_type_hints(read, include_extras=True)["return"]
    return {
        name: _completed(name, kind, of)
        for name, (kind, *marks) in ((name, get_args(hint) or (hint,)) for name, hint in hints.items())
        for of in marks
        if isinstance(of, Quantity)
    }


def _completed(name: str, kind: Any, of: Quantity) -> Quantity:
    is_number = bool({int, float, complex, At} & {kind, *get_args(kind)})
    return replace(of, is_number=is_number, key=of.key or (f"{name}_{SLUGS[of.unit]}" if of.unit in SLUGS else name))


def is_declared(value: Any) -> bool:
    """Whether a value is a record with quantities of its own."""
    return (is_dataclass(value) or hasattr(value, "_fields")) and bool(quantities(type(value)))


# ------------------------------------------------------------------------------------------------------------- JSON


def to_dict(record: Any) -> dict[str, Any]:
    """The quantities of a record by their keys, as JSON has them: a complex number is [real, imaginary]."""
    found: dict[str, Any] = {}
    for name, of in quantities(type(record)).items():
        own = getattr(record, name)
        value = to_json_value(own)
        if isinstance(own, At):
            plain = of.key.removesuffix(f"_{SLUGS.get(of.unit, '')}")
            found |= {of.key: own.value, f"{plain}_at_rad_s": own.omega}
        elif of.flat:
            found |= value or {}
        else:
            found[of.key] = value
    return found


def to_json_value(value: Any) -> Any:
    """One entry of `to_dict`.  Infinities stay; they are texts in `tfarm.tables.files.to_json`."""
    if _is_table(value):
        declared = quantities(type(value))
        columns = [to_json_value(getattr(value, name)) for name in declared]
        keys = [of.key for of in declared.values()]
        return [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]
    if is_declared(value):
        return to_dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return to_json_value(value.tolist()) if np.iscomplexobj(value) else value.tolist()
    if isinstance(value, complex):
        return None if math.isnan(value.real) else [value.real, value.imag]
    if isinstance(value, Mapping):
        return {str(key): to_json_value(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | range):
        return [to_json_value(entry) for entry in value]
    return value


def _is_table(value: Any) -> bool:
    """Whether a record is one of columns: its quantities are arrays with a value a row."""
    return bool(getattr(type(value), "is_table", False))


# ----------------------------------------------------------------------------------------------------------- tables


def table(rows: Any, names: Sequence[str] = (), *, stem: str = "", title: str = "", caption: str = "") -> Table:
    """A row a record (or an entry of a record of columns), a column a quantity: those with a label, or these.

    A column without any value is left out unless it is named.
    """
    if not (_is_table(rows) or rows):
        return Table(columns=(), stem=stem, title=title, caption=caption)
    declared = quantities(type(rows if _is_table(rows) else rows[0]))
    titles: dict[str, str] = getattr(rows, "titles", {})
    wanted = names or [name for name, of in declared.items() if of.label]
    found = ((replace(of := declared[name], label=titles.get(name, of.label)), _values(rows, name)) for name in wanted)
    columns = (
        _column(of, values)
        for of, values in found
        if names or not values or any(value is not None and str(value) for value in values)
    )
    return Table(columns=tuple(columns), stem=stem, title=title, caption=caption)


def _values(rows: Any, name: str) -> list[Any]:
    """One attribute of each row."""
    return list(getattr(rows, name)) if _is_table(rows) else [getattr(row, name) for row in rows]


def _column(of: Quantity, values: Sequence[Any]) -> Column:
    cells = [NO_VALUE if isinstance(value, list | tuple) and not value else text(value, of.digits) for value in values]
    folds = max(map(len, cells), default=0) > LONGEST_LINE
    return Column(of.key, of.label, of.unit, of=list(map(to_json_value, values)), shown=cells, folds=folds,
                  help=of.help)  # fmt: skip


def across(
    records: Mapping[str, Any], *, keys: Sequence[str] = (), stem: str = "", title: str = "", caption: str = ""
) -> Table:
    """A row a quantity that has one value, a column a record; the records are named, `keys` are those of columns."""
    found = [{label: (of, value) for label, of, value in entries(each)} for each in records.values()]
    every = dict.fromkeys(label for each in found for label in each)
    labels = [label for label in every if any(str(each[label][1]) not in EMPTY for each in found if label in each)]
    units = [next(each[label][0].unit for each in found if label in each) for label in labels]
    helps = [next(each[label][0].help for each in found if label in each) for label in labels]
    columns = [Column("quantity", "quantity", of=labels, helps=helps), Column("unit", "unit", of=units)]
    for key, name, each in zip(keys or records, records, found, strict=True):
        pairs = [each.get(label, (Quantity(), None)) for label in labels]
        values = [to_json_value(value.value if isinstance(value, At) and value.omega is None else value)
                  for _, value in pairs]  # fmt: skip
        cells = [with_unit(value, replace(of, unit="")) for of, value in pairs]
        columns.append(Column(key, name, of=values, shown=cells))
    return Table(columns=tuple(columns), stem=stem, title=title, caption=caption)


def entries(record: Any, under: str = "") -> Iterator[tuple[str, Quantity, Any]]:
    """Label, quantity and value of what has one value, in records inside the record too."""
    for name, of in quantities(type(record)).items():
        value, label = getattr(record, name), f"{under}{of.label}"
        if hasattr(value, "as_text") and not isinstance(value, Percent):
            if of.label:
                yield label, of, value.as_text(of.digits)
        elif is_declared(value) and not isinstance(value, At) and (of.flat or of.label):
            yield from entries(value, under if of.flat else f"{label}: ")
        elif of.label and not (of.curve or isinstance(value, np.ndarray | Mapping) or _is_list_of_records(value)):
            yield label, of, value


def roots_table(values: Any, of: Quantity, *, stem: str = "", title: str = "", caption: str = "") -> Table:
    """A row a complex number: its real and imaginary part, and of a pole or zero in 1/s its damping ratio."""
    parts = [_parts(complex(value), of.digits) for value in values]
    columns = [
        Column("re", f"Re {of.label}", of.unit, of=[value.real for value in values], shown=[re for re, _ in parts]),
        Column("im", f"Im {of.label}", of.unit.replace("1/s", "rad/s"), of=[value.imag for value in values],
               shown=[im for _, im in parts]),
    ]  # fmt: skip
    if of.unit == "1/s":
        columns.append(Column("damping_ratio", "damping ratio", of=[_ratio(value) for value in values]))
    return Table(columns=tuple(columns), stem=stem, title=title, caption=caption)


def _ratio(value: complex) -> str:
    """The damping ratio of a pole that oscillates."""
    return within(-value.real / abs(value), COMPLEX_ERROR, RATIO_DIGITS) if value.imag else NO_VALUE


def curve_table(record: Any, *, stem: str = "", title: str = "") -> Table:
    """The curves of a record, a row a point; complex ones in two columns.  Without any, the first list of records."""
    if hasattr(record, "csv_table"):
        own: Table = record.csv_table
        return own
    columns: list[Column] = []
    for value, of in _with_flat(record):
        if of.curve and np.iscomplexobj(value):
            for number, values in enumerate(np.atleast_2d(value)):
                after = f"_{number}" if np.ndim(value) > 1 else ""
                for part, numbers in (("re", values.real), ("im", values.imag)):
                    cells = ["" if math.isnan(each) else each for each in numbers.tolist()]
                    columns.append(Column(f"{part}_{of.key}{after}", f"{part} {of.label}{after}", of.unit, of=cells))
        elif of.curve:
            columns.append(Column(of.key, of.label, of.unit, of=value))
        elif not columns and _is_list_of_records(value):
            return table(value)
    return Table(columns=tuple(columns), stem=stem, title=title)


def _with_flat(record: Any) -> Iterator[tuple[Any, Quantity]]:
    """Values and quantities of a record, those of records that are flat in their place."""
    for name, of in quantities(type(record)).items():
        value = getattr(record, name)
        if of.flat and is_declared(value):
            yield from _with_flat(value)
        else:
            yield value, of


def _is_list_of_records(value: Any) -> bool:
    """Whether a value is the rows of a table; intervals are a text in one cell."""
    is_some = isinstance(value, list | tuple) and bool(value) and not hasattr(value[0], "as_text")
    return is_some and all(map(is_declared, value))


# --------------------------------------------------------------------------------------------------------- terminal


@dataclass(frozen=True, slots=True)
class Section:
    """What is read of a record one below the other: pairs of label and text, or a table, under a title."""

    title: str = ""
    pairs: list[tuple[str, str]] = field(default_factory=list)
    table: Table | None = None
    drawing: str = ""


def sections(record: Any, title: str = "") -> list[Section]:
    """A record as a person reads it: its single values first, then its tables and the records inside it."""
    own, later = Section(title), []
    for name, of in quantities(type(record)).items():
        value = getattr(record, name)
        if of.flat and is_declared(value):
            first, *rest = sections(value)
            own.pairs.extend(first.pairs)
            later += rest
        elif value is None or of.curve:
            if of.is_number and of.label:
                own.pairs.append((of.label, NO_VALUE))
        elif of.label:
            later += list(_parts_of(value, of, own.pairs))
    if hasattr(record, "drawing"):
        later.append(Section(drawing=record.drawing))
    return [own, *later]


def _parts_of(value: Any, of: Quantity, pairs: list[tuple[str, str]]) -> Iterator[Section]:
    """The sections of one entry; what is a single value joins the pairs instead."""
    if _is_table(value):
        yield Section(of.label, table=table(value))
    elif is_declared(value) and not isinstance(value, At) and not hasattr(value, "as_text"):
        yield from sections(value, of.label)
    elif _is_list_of_records(value):
        yield Section(of.label, table=table(value))
    elif isinstance(value, np.ndarray) and np.iscomplexobj(value) and value.size:
        yield Section(of.help or of.label, table=roots_table(value, of))
    elif shown := with_unit(value, of):
        pairs.append((of.label, shown))


def with_unit(value: Any, of: Quantity) -> str:
    """A value and its unit, and where it has one its frequency."""
    if isinstance(value, At):
        at = "" if value.omega is None else f" at {value.omega:.6g} rad/s"
        return with_unit(value.value, of) + at
    shown = text(value, of.digits)
    number, _, note = shown.partition(" (")  # of a figure, such as the modes for which it holds
    after = f" ({note}" if note else ""
    return f"{number} {of.unit}{after}" if of.unit and shown not in ("", NO_VALUE) else shown


def text(value: Any, digits: int = 6) -> str:
    """One value as a person reads it; "-" where there is none."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return NO_VALUE
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, str | int | np.integer):
        return str(value)
    if hasattr(value, "as_text"):
        return str(value.as_text(digits))
    if isinstance(value, float):
        return general(value, digits)
    if isinstance(value, complex):
        re, im = _parts(value, digits)
        return re if not value.imag else f"{re}{'' if im.startswith('-') else '+'}{im}i"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {text(entry, digits)}" for key, entry in value.items())
    entries = [text(entry, digits) for entry in value]
    if isinstance(value, tuple) and len(value) == 2 and not any(isinstance(entry, str | tuple) for entry in value):
        return f"({entries[0]}, {entries[1]})"
    return ", ".join(entries)


def _parts(value: complex, digits: int) -> tuple[str, str]:
    """Both parts in digits that rounding leaves of the number's size."""
    error = COMPLEX_ERROR * abs(value)
    re, im = (within(part, error, digits) if error else "0" for part in (value.real, value.imag))
    return re, im


# ------------------------------------------------------------------------------------------------------- comparison


class Percent(float):
    """A ratio that a person reads in per cent."""

    unit = "%"

    def as_text(self, digits: int) -> str:
        """The number with its unit."""
        return f"{general(100 * self, digits)} {self.unit}"


class PercentagePoints(Percent):
    """The difference of two of these."""

    unit = "percentage points"


class Difference(NamedTuple):
    """One quantity of two records."""

    quantity: Annotated[str, Quantity("quantity", help="quantity of both records, in a table after its row")]
    unit: Annotated[str, Quantity("unit", help="unit of both values and of their difference")]
    one: Annotated[Any, Quantity("first", digits=8, help="value of the first record")]
    other: Annotated[Any, Quantity("second", digits=8, help="value of the second record")]

    @property
    def difference(self) -> Annotated[float | None, Quantity("difference", digits=4, help="second less first")]:
        """Second less first, in the unit; what rounding may leave is 0, and what is no number has none."""
        one, other = self.one, self.other
        if one is None or other is None or not (_is_number(one) and _is_number(other)):
            return None
        gap = 0.0 if one == other else float(other - one)
        if not math.isfinite(gap):
            return None
        gap = 0.0 if abs(gap) <= SAME * abs(one) else gap
        return PercentagePoints(gap) if isinstance(one, Percent) else gap


NAMES = ("first", "second")  # of two records that have none


class Differences(list[Difference]):
    """Quantities of two records, which are named in the table."""

    def __init__(self, rows: Iterable[Difference], names: tuple[str, str]) -> None:
        super().__init__(rows)
        self.titles = dict(zip(("one", "other"), names, strict=True))


def compare(one: Any, other: Any, names: tuple[str, str] = NAMES) -> Differences:
    """The quantities that both records have, row by row; rows of a table are paired by their first quantity."""
    return Differences(_differences(one, other), names)


def compare_rows(
    some: Sequence[Any], others: Sequence[Any], names: tuple[str, str] = ("first", "second")
) -> Differences:
    """The quantities of records in two lists, paired by their first one, a name or a number."""
    return Differences(_differences_of_rows(some, others), names)


def _differences(one: Any, other: Any) -> Iterator[Difference]:
    others = {label: value for label, _, value in entries(other)}
    for label, of, value in entries(one):
        both = [each.value if isinstance(each, At) else each for each in (value, others.get(label))]
        is_short = of.is_number or len(str(value)) < LONGEST_COMPARED
        if label in others and is_short and not set(map(str, both)) <= EMPTY:
            yield Difference(label, of.unit, *both)
    for (value, of), (match, _) in zip(_with_flat(one), _with_flat(other), strict=False):
        if of.label and _is_list_of_records(value) and _is_list_of_records(match):
            yield from _differences_of_rows(value, match)


def _differences_of_rows(some: Sequence[Any], others: Sequence[Any]) -> Iterator[Difference]:
    """Differences of rows; a text that is the same in both rows is none."""
    if not some:
        return
    key, of = next(iter(quantities(type(some[0])).items()))
    by_key = {getattr(row, key): row for row in others}
    for row in some:
        at = getattr(row, key)
        for each in _differences(row, by_key[at]) if at in by_key else ():
            if each.quantity != of.label and not (isinstance(each.one, str) and each.one == each.other):
                row_name = at if isinstance(at, str) else f"{of.label} {text(at)}"
                yield each._replace(quantity=f"{row_name}: {each.quantity}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
