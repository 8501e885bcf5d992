"""The declaration of a quantity, its values in JSON and as a person reads them, and two records compared."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass, replace
from functools import cache, cached_property
from typing import Annotated, Any, NamedTuple, get_args, get_type_hints

import numpy as np

from tfarm.digits import general, round_to_error

# of units in keys
SLUGS = {"s": "s", "m": "m", "rad/s": "rad_s", "Hz": "hz", "deg": "deg", "samples": "samples"}
# of the size of a pole or zero: what rounding leaves in its parts (tests: 1e-14 to 50 digits)
COMPLEX_ERROR = 2e-14
NO_VALUE = "-"
# what is compared where neither has a value
EMPTY = {"None", "", "[]", "()"}


@dataclass(frozen=True, slots=True)
class Quantity:
    """Label, unit, digits for a person and meaning of one entry of a record.

    `key` is its name in JSON and CSV, by default that of the attribute with its unit.  An entry without a label is in
    JSON alone.  A record (or dictionary) that is `flat` has its entries in the place of its own; a table that is
    `first` is read before all other entries; the arrays that are a `curve` are of one length: columns in CSV, and not
    printed.  Where a number (`is_number`, by its type) has no value a person reads "-", and nothing where a text or a
    record has none.  `unit_of` is the attribute with the unit where that depends on the record, or on the one whose row
    it is.
    """

    label: str = ""
    unit: str = ""
    digits: int = 6
    help: str = ""
    key: str = ""
    flat: bool = False
    first: bool = False
    curve: bool = False
    is_number: bool = False
    unit_of: str = ""


class At(NamedTuple):
    """A value and the frequency [rad/s] at which it occurs: two keys in JSON, two cells of a table."""

    value: float
    omega: float | None = None


class Percent(float):
    """A ratio that a person reads in per cent."""

    unit = "%"

    def as_text(self, digits: int) -> str:
        """Return the number with its unit."""
        return f"{general(100 * self, digits)} {self.unit}"


def quantities(kind: Any) -> dict[str, Quantity]:
    """Return the quantities of a class of records by attribute: those of its fields, then those of its properties."""
    return _quantities(kind)


@cache
def _quantities(kind: Any) -> dict[str, Quantity]:
    hints = get_type_hints(kind, include_extras=True)
    for base in reversed(kind.__mro__):
        for name, member in vars(base).items():
            read: Any = None
            if isinstance(member, cached_property):
                read = member.func
            elif isinstance(member, property):
                read = member.fget
            if read is not None and "Annotated" in str(read.__annotations__.get("return")):
                hints[name] = get_type_hints(read, include_extras=True)["return"]
    found = {}
    for name, hint in hints.items():
        for of in getattr(hint, "__metadata__", ()):
            if isinstance(of, Quantity):
                kind = get_args(hint)[0]
                is_number = bool({int, float, complex, At} & {kind, *get_args(kind)})
                key = of.key or (f"{name}_{SLUGS[of.unit]}" if of.unit in SLUGS else name)
                found[name] = replace(of, is_number=is_number, key=key)
    return found


def quantities_of(record: Any, parent: Any = None) -> dict[str, Quantity]:
    """Return the quantities of a record with its own labels and units: its `titles` by attribute, and each `unit_of`.

    `parent` is the record that has it as a row.
    """
    titles: Mapping[str, tuple[str, str]] = getattr(record, "titles", {})
    found = dict(quantities(type(record)))
    for name, of in found.items():
        if name in titles:
            label, unit = titles[name]
            found[name] = replace(of, label=label, unit=unit)
        elif of.unit_of:
            unit = getattr(record, of.unit_of, getattr(parent, of.unit_of, ""))
            found[name] = replace(of, unit=unit)
    return found


def is_declared(value: Any) -> bool:
    """Whether a value is a record with quantities of its own."""
    return (is_dataclass(value) or hasattr(value, "_fields")) and bool(quantities(type(value)))


def is_table(value: Any) -> bool:
    """Whether a record is one of columns: its quantities are arrays with a value a row."""
    return bool(getattr(type(value), "is_table", False))


def is_list_of_records(value: Any) -> bool:
    """Whether a value is the rows of a table; intervals are a text in one cell."""
    is_some = isinstance(value, list | tuple) and bool(value) and not hasattr(value[0], "as_text")
    return is_some and all(map(is_declared, value))


def with_flat(record: Any) -> Iterator[tuple[Any, Quantity, Any]]:
    """Yield values and quantities of a record and the record itself, those of flat records in their place."""
    for name, of in quantities_of(record).items():
        value = getattr(record, name)
        if of.flat and is_declared(value):
            yield from with_flat(value)
        else:
            yield value, of, record


def entries(record: Any, under: str = "") -> Iterator[tuple[str, Quantity, Any]]:
    """Yield label, quantity and value of each entry that has one value, of records inside the record too."""
    for value, of, _ in with_flat(record):
        label = f"{under}{of.label}"
        if hasattr(value, "as_text") and not isinstance(value, Percent):
            value = value.as_text(of.digits)
        if is_declared(value) and not isinstance(value, At):
            yield from entries(value, f"{label}: ") if of.label else ()
        elif of.label and not (
            of.curve or isinstance(value, np.ndarray | Mapping) or is_list_of_records(value)
        ):
            yield label, of, value


# ------------------------------------------------------------------------------------------------------------- JSON


def to_dict(record: Any) -> dict[str, Any]:
    """Return the quantities of a record by their keys, as JSON has them: a complex number is [real, imaginary]."""
    found: dict[str, Any] = {}
    for name, of in quantities(type(record)).items():
        value = getattr(record, name)
        if isinstance(value, At):
            plain = of.key.removesuffix(f"_{SLUGS.get(of.unit, '')}")
            found |= {of.key: value.value, f"{plain}_at_rad_s": value.omega}
        elif of.flat:
            found |= to_json_value(value) or {}
        else:
            found[of.key] = to_json_value(value)
    return found


def to_json_value(value: Any) -> Any:
    """Return one entry of `to_dict`.  Infinities stay; they are texts in `to_json`."""
    if value is None or type(value) in (float, int, str, bool):
        return value
    if is_table(value):
        columns = to_dict(value)
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if is_declared(value):
        return to_dict(value)
    if isinstance(value, np.ndarray | np.generic):
        plain = value.tolist()
        return to_json_value(plain) if np.iscomplexobj(value) else plain
    if isinstance(value, complex):
        return None if math.isnan(value.real) else [value.real, value.imag]
    if isinstance(value, Mapping):
        return {str(key): to_json_value(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | range):
        return [to_json_value(entry) for entry in value]
    return value


# ------------------------------------------------------------------------------------------------------------- text


def with_unit(value: Any, of: Quantity) -> str:
    """Return a value and its unit, and where it has one its frequency."""
    if isinstance(value, At):
        at = "" if value.omega is None else f" at {value.omega:.6g} rad/s"
        return with_unit(value.value, of) + at
    shown = text(value, of.digits)
    # of a figure, such as the modes for which it holds
    number, _, note = shown.partition(" (")
    after = f" ({note}" if note else ""
    if of.unit and shown not in ("", NO_VALUE):
        return f"{number} {of.unit}{after}"
    return shown


def text(value: Any, digits: int = 6) -> str:
    """Return one value as a person reads it; "-" where there is none."""
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
        re, im = round_parts(value, digits)
        if not value.imag:
            return re
        return f"{re}{'' if im.startswith('-') else '+'}{im}i"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {text(entry, digits)}" for key, entry in value.items())
    shown = ", ".join(text(entry, digits) for entry in value)
    is_pair = isinstance(value, tuple) and len(value) == 2
    if is_pair and not any(isinstance(each, str | tuple) for each in value):
        return f"({shown})"
    return shown


def round_parts(value: complex, digits: int) -> tuple[str, str]:
    """Return both parts in digits that rounding leaves of the number's size."""
    error = COMPLEX_ERROR * abs(value)
    re, im = (round_to_error(part, error, digits) if error else "0" for part in (value.real, value.imag))
    return re, im


# ------------------------------------------------------------------------------------------------------- comparison


class PercentagePoints(Percent):
    """The difference of two ratios that a person reads in per cent."""

    unit = "percentage points"


class Difference(NamedTuple):
    """One quantity of two records."""

    quantity: Annotated[str, Quantity("quantity", help="quantity of both records, in a table after its row")]
    unit: Annotated[str, Quantity("unit", help="unit of both values and of their difference")]
    one: Annotated[Any, Quantity("first", digits=8, help="value of the first record")]
    other: Annotated[Any, Quantity("second", digits=8, help="value of the second record")]
    # of the records
    names: tuple[str, str] = ("first", "second")

    @property
    def titles(self) -> dict[str, tuple[str, str]]:
        """The titles of the values: the names of the records."""
        return {"one": (self.names[0], ""), "other": (self.names[1], "")}

    @property
    def difference(
        self,
    ) -> Annotated[float | None, Quantity("difference", digits=4, help="second less first")]:
        """Second less first, in the unit; what rounding may leave is 0, and what is no number has none."""
        # of a value: what two computations of it may differ by
        same = 4e-14
        one = self.one
        other = self.other
        if any(isinstance(each, bool) or not isinstance(each, int | float) for each in (one, other)):
            return None
        gap = 0.0 if one == other else float(other - one)
        if not math.isfinite(gap):
            return None
        gap = 0.0 if abs(gap) <= same * abs(one) else gap
        return PercentagePoints(gap) if isinstance(one, Percent) else gap


def compare_records(one: Any, other: Any, names: tuple[str, str] | None = None) -> list[Difference]:
    """Return the quantities that two records have, or the records in two lists, row by row.

    Records in lists, and rows of tables, are paired by their first quantity, a name or a number.
    """
    rows = _of_rows(one, other) if isinstance(one, list) else _of_records(one, other)
    if names is None:
        return list(rows)
    return [each._replace(names=names) for each in rows]


def _of_records(one: Any, other: Any) -> Iterator[Difference]:
    """Yield differences of the quantities of two records, then those of their tables."""
    # characters of a text that is compared: a word or an interval, and no sentence
    longest_compared = 28
    others = {label: value for label, _, value in entries(other)}
    for label, of, value in entries(one):
        both = [each.value if isinstance(each, At) else each for each in (value, others.get(label))]
        is_short = of.is_number or len(str(value)) < longest_compared
        if label in others and is_short and not set(map(str, both)) <= EMPTY:
            yield Difference(label, of.unit, both[0], both[1])
    for (value, of, _), (match, *_) in zip(with_flat(one), with_flat(other), strict=False):
        if of.label and is_list_of_records(value) and is_list_of_records(match):
            yield from _of_rows(value, match)


def _of_rows(some: Sequence[Any], others: Sequence[Any]) -> Iterator[Difference]:
    """Yield differences of rows; a text that is the same in both rows is none."""
    if not some:
        return
    key, of = next(iter(quantities(type(some[0])).items()))
    by_key = {getattr(row, key): row for row in others}
    for row in some:
        at = getattr(row, key)
        name = at if isinstance(at, str) else f"{of.label} {text(at)}"
        for each in _of_records(row, by_key[at]) if at in by_key else ():
            if each.quantity != of.label and not (isinstance(each.one, str) and each.one == each.other):
                yield each._replace(quantity=f"{name}: {each.quantity}")
