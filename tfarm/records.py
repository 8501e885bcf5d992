"""Frozen records with arrays: read-only arrays, an `==` of all entries, a short repr, HTML.

A repr begins with the finding: the entries or properties of a record with a name in `SHOWN_FIRST`.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from fractions import Fraction
from functools import cached_property, partial, wraps
from html import escape
from operator import is_
from typing import Any, TypeVar, dataclass_transform, overload

import numpy as np

_Class = TypeVar("_Class", bound=type[Any])
_AnyRecord = TypeVar("_AnyRecord")

# the finding
SHOWN_FIRST = ("verdict", "word", "text", "finding", "unstable", "worst_error")
# types without arrays
PLAIN = frozenset({float, int, str, bool, type(None), Fraction})
# another in each process, as the hash of every record with a text
OF_TEXTS = hash("tfarm")


def record(cls: _Class) -> _Class:
    """Decorate a class below `@dataclass(frozen=True)`.

    Arrays in its fields (also in tuples, lists and dictionaries) and in its cached properties become read-only views.
    Two records of a class are equal where all their entries are, NaN to NaN.  The repr is short, with the finding first
    and without defaults; a notebook shows the same as a table.  The pairs of names and texts of a method `as_typed`
    come before the other entries.
    """
    after = cls.__dict__.get("__post_init__")

    def after_init(self: Any) -> None:
        if after is not None:
            after(self)
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if (view := read_only(value)) is not value:
                object.__setattr__(self, name, view)

    for value in vars(cls).values():
        if isinstance(value, cached_property):
            value.func = _read_only_result(value.func)
    of_class: Any = cls
    of_class.__post_init__ = after_init
    of_class.__eq__ = _equal
    of_class.__hash__ = _hash
    of_class.__repr__ = _repr
    of_class._repr_html_ = vars(cls).get("_repr_html_", _repr_html)
    return cls


@overload
def frozen(cls: type[_AnyRecord], /) -> type[_AnyRecord]: ...


@overload
def frozen(
    *, kw_only: bool = False, slots: bool = False
) -> Callable[[type[_AnyRecord]], type[_AnyRecord]]: ...


@dataclass_transform(frozen_default=True)
def frozen(cls: Any = None, /, **how: bool) -> Any:
    """Decorate a class: a frozen dataclass that is a `record`."""
    if cls is None:
        return partial(frozen, **how)
    return dataclass(frozen=True, **how)(record(cls))


def read_only(value: Any) -> Any:
    """Return the value with read-only views of its arrays; itself where it has none."""
    if type(value) in PLAIN:
        return value
    if isinstance(value, np.ndarray):
        if value.flags.writeable:
            value = value.view()
            value.flags.writeable = False
        return value
    entries: Any = ()
    if isinstance(value, dict):
        entries = value.values()
    elif isinstance(value, tuple | list):
        entries = value
    if all(type(each) in PLAIN for each in entries):
        return value
    views = list(map(read_only, entries))
    if all(map(is_, views, entries)):
        return value
    if isinstance(value, dict):
        return dict(zip(value, views, strict=True))
    if hasattr(value, "_fields"):
        return type(value)(*views)
    return type(value)(views)


def _read_only_result(function: Any) -> Any:
    """Return a function of a record whose result is read-only."""
    return wraps(function)(lambda self: read_only(function(self)))


def _equal(self: Any, other: Any) -> Any:
    """Return whether two records are of one class with the same entries."""
    if type(self) is not type(other):
        return NotImplemented
    return all(
        _same(getattr(self, each.name), getattr(other, each.name)) for each in fields(self) if each.compare
    )


def _same(one: Any, other: Any) -> bool:
    """Whether two entries are equal: arrays in shape and every number, containers entry by entry, NaN to NaN."""
    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        one = np.asarray(one)
        other = np.asarray(other)
        return np.array_equal(one, other, equal_nan={one.dtype.kind, other.dtype.kind} <= {"f", "c"})
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, tuple | list):
        return type(one) is type(other) and len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other or (one != one and other != other))


def _hash(self: Any) -> int:
    """Return the hash of the entries, computed once a process: caches ask for that of an arm again and again."""
    kept: dict[str, Any] = getattr(self, "__dict__", {})
    of_texts, value = kept.get("_hash", (None, 0))
    if of_texts != OF_TEXTS:
        value = hash((type(self), *(_key(getattr(self, each.name)) for each in fields(self) if each.compare)))
        kept["_hash"] = OF_TEXTS, value
    return int(value)


def _key(value: Any) -> Any:
    """Return a hashable value that is equal for equal entries."""
    if isinstance(value, tuple | list):
        return tuple(map(_key, value))
    if isinstance(value, np.ndarray | dict) or value != value:
        return None
    return value


def _repr(self: Any) -> str:
    """Return the class and the shown entries in a line or two of a terminal."""
    text = ", ".join(f"{name}={shown}" for name, shown in _entries(self))
    return f"{type(self).__name__}({_cut(text, 200)})"


def _cut(text: str, longest: int) -> str:
    """Return a text in at most that many characters."""
    return text if len(text) <= longest else f"{text[: longest - 4]} ..."


def _repr_html(self: Any) -> str:
    """Return a table with a row for each entry, the finding first, for a notebook."""
    row = '<tr><th scope="row" style="text-align:left">{}</th><td style="text-align:left">{}</td></tr>'
    rows = "".join(row.format(escape(name), escape(shown)) for name, shown in _entries(self))
    return f"<table><caption>{escape(type(self).__name__)}</caption><tbody>{rows}</tbody></table>"


def _entries(self: Any) -> Iterator[tuple[str, str]]:
    """Yield the shown names and texts: the finding, those of `as_typed`, then the fields other than defaults."""
    found = _finding_names(self)
    for name in found:
        yield name, _short_text(getattr(self, name), 100)
    if hasattr(type(self), "as_typed"):
        yield from self.as_typed()
    for each in fields(self):
        if each.repr and each.name not in found and not _is_default(self, each):
            yield each.name, _short_text(getattr(self, each.name))


def _is_default(self: Any, entry: Field[Any]) -> bool:
    """Whether an entry has its default."""
    default = entry.default if entry.default_factory is MISSING else entry.default_factory()
    return default is not MISSING and _same(getattr(self, entry.name), default)


def _finding_names(self: Any) -> list[str]:
    """Return the names in `SHOWN_FIRST` of a record's fields, and of its properties that are no records themselves."""
    own = self.__dataclass_fields__
    # a record with a word has no other verdict
    names = SHOWN_FIRST[1:] if "word" in own else SHOWN_FIRST
    return [name for name in names if name in own or not is_dataclass(getattr(self, name, self))]


def _short_text(value: Any, longest: int = 60) -> str:
    """Return an entry in a few characters: six digits of a number, an array's shape; a record's finding or name."""
    # numbers of an array or a list that are shown
    few = 3
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= few:
            return f"[{', '.join(map(_short_text, value.tolist()))}]"
        return f"<array {value.shape}>"
    if isinstance(value, float | complex):
        return f"{value:.6g}"
    if isinstance(value, dict):
        words: Iterable[str] = map(str, value)
        if 0 < len(value) <= few and all(isinstance(each, float) for each in value.values()):
            words = (f"{key}={_short_text(each)}" for key, each in value.items())
        return f"<{', '.join(words)}>"
    if isinstance(value, tuple | list):
        if len(value) <= few:
            return f"({', '.join(map(_short_text, value))})"
        return f"({len(value)} entries)"
    if is_dataclass(value) and not isinstance(value, type):
        named = [each.name for each in fields(value) if each.name == "name" and not _is_default(value, each)]
        known = _finding_names(value) or named
        text = _short_text(getattr(value, known[0])) if known else repr(value)
        return text if len(text) <= 80 else f"{type(value).__name__}(...)"
    return _cut(repr(value), longest)
