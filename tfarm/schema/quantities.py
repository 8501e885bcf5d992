"""The declaration of a quantity, and its values in JSON and as a person reads them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, is_dataclass, replace
from functools import cache, cached_property
from typing import Any, NamedTuple, get_args, get_type_hints

import numpy as np

from tfarm.digits import general, within

SLUGS = {"s": "s", "m": "m", "rad/s": "rad_s", "Hz": "hz", "deg": "deg", "samples": "samples"}  # of units in keys
COMPLEX_ERROR = 2e-14  # of the size of a pole or zero: what rounding leaves in its parts (tests: 1e-14 to 50 digits)
NO_VALUE = "-"


@dataclass(frozen=True, slots=True)
class Quantity:
    """Label, unit, digits for a person and meaning of one entry of a record.

    `key` is its name in JSON and CSV, by default that of the attribute with its unit.  An entry without a label is in
    JSON alone.  A record (or dictionary) that is `flat` has its entries in the place of its own; the arrays that are a
    `curve` are of one length: columns in CSV, and not printed.  Where a number (`is_number`, by its type) has no value
    a person reads "-", and nothing where a text or a record has none.  `unit_of` is the attribute with the unit where
    that depends on the record, or on the one whose row it is.
    """

    label: str = ""
    unit: str = ""
    digits: int = 6
    help: str = ""
    key: str = ""
    flat: bool = False
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
        """The number with its unit."""
        return f"{general(100 * self, digits)} {self.unit}"


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
        name: replace(
            of,
            is_number=bool({int, float, complex, At} & {kind, *get_args(kind)}),
            key=of.key or (f"{name}_{SLUGS[of.unit]}" if of.unit in SLUGS else name),
        )
        for name, (kind, *marks) in ((name, get_args(hint) or (hint,)) for name, hint in hints.items())
        for of in marks
        if isinstance(of, Quantity)
    }


def quantities_of(record: Any, parent: Any = None) -> dict[str, Quantity]:
    """The quantities of a record with labels and units of its own: its `titles` by attribute, and each `unit_of`.

    `parent` is the record that has it as a row.
    """
    titles: Mapping[str, tuple[str, str]] = getattr(record, "titles", {})
    found = dict(quantities(type(record)))
    for name, of in found.items():
        if name in titles or of.unit_of:
            label, unit = titles.get(name, (of.label, getattr(record, of.unit_of, getattr(parent, of.unit_of, ""))))
            found[name] = replace(of, label=label, unit=unit)
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
    """Values and quantities of a record and the record itself, those of records that are flat in their place."""
    for name, of in quantities_of(record).items():
        value = getattr(record, name)
        if of.flat and is_declared(value):
            yield from with_flat(value)
        else:
            yield value, of, record


def entries(record: Any, under: str = "") -> Iterator[tuple[str, Quantity, Any]]:
    """Label, quantity and value of what has one value, in records inside the record too."""
    for value, of, _ in with_flat(record):
        label = f"{under}{of.label}"
        if hasattr(value, "as_text") and not isinstance(value, Percent):
            value = value.as_text(of.digits)
        if is_declared(value) and not isinstance(value, At):
            yield from entries(value, f"{label}: ") if of.label else ()
        elif of.label and not (of.curve or isinstance(value, np.ndarray | Mapping) or is_list_of_records(value)):
            yield label, of, value


# ------------------------------------------------------------------------------------------------------------- JSON


def to_dict(record: Any) -> dict[str, Any]:
    """The quantities of a record by their keys, as JSON has them: a complex number is [real, imaginary]."""
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
    """One entry of `to_dict`.  Infinities stay; they are texts in `to_json`."""
    if is_table(value):
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


# ------------------------------------------------------------------------------------------------------------- text


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
        re, im = parts(value, digits)
        return re if not value.imag else f"{re}{'' if im.startswith('-') else '+'}{im}i"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {text(entry, digits)}" for key, entry in value.items())
    shown = ", ".join(text(entry, digits) for entry in value)
    is_pair = isinstance(value, tuple) and len(value) == 2 and not any(isinstance(each, str | tuple) for each in value)
    return f"({shown})" if is_pair else shown


def parts(value: complex, digits: int) -> tuple[str, str]:
    """Both parts in digits that rounding leaves of the number's size."""
    error = COMPLEX_ERROR * abs(value)
    re, im = (within(part, error, digits) if error else "0" for part in (value.real, value.imag))
    return re, im
