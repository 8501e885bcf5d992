"""A column: one quantity of a record with its name, unit and digits, declared once, beside the record; a table of them.

    FOUND = (
        Column("omega_rad_s", "frequency", "rad/s", of="omega", digits=singly(significant, 7)),
        Column("becomes", of="direction"),
    )

`tfarm.tables` makes terminals' tables, files and pages of a `Table`; `tfarm.schema` makes one of declared quantities.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import InitVar, dataclass, replace
from operator import attrgetter
from typing import Any

from tfarm.digits import TEXTS, CellsOf


@dataclass(frozen=True, slots=True)
class Column:
    """One quantity: `key` in JSON and files (with the unit, as omega_rad_s), `title` and `unit` where a person reads.

    `of` says where its values are: the name of an attribute (that of the key if left out), a function of the record,
    or the values themselves.  Of a list of records it is asked one by one.  `digits` makes cells of values; where
    these do not say it all, `shown` is, like `of`, the cells.  Neighbours of one `group` share a heading on a page;
    `tint` is, like `of`, a background colour a cell; on a narrow terminal a column that `folds` is folded.
    """

    key: str
    title: str = ""
    unit: str = ""
    of: Any = None
    digits: CellsOf = TEXTS
    shown: Any = None
    group: str = ""
    tint: Any = ()
    folds: bool = False

    def read(self, record: Any) -> Column:
        """The column with its values, cells and tints in the place of where they are."""
        values = _read(self.key if self.of is None else self.of, record)
        shown = None if self.shown is None else _read(self.shown, record)
        return replace(self, of=values, shown=shown, tint=_read(self.tint, record))

    @property
    def values(self) -> Sequence[Any]:
        """The values of a column that was read."""
        return self.of

    @property
    def cells(self) -> Sequence[str]:
        """The same as a page shows them."""
        return self.digits(self.values) if self.shown is None else self.shown

    @property
    def is_text(self) -> bool:
        """Whether a page sets it flush left."""
        return any(isinstance(value, str | tuple) for value in self.values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """The columns of a record, read; a sequence of its rows as JSON has them.

    `stem` names its files, `title` stands above, `caption` says what is to be seen and what it means.
    """

    columns: tuple[Column, ...]
    record: InitVar[Any] = None
    stem: str = ""
    title: str = ""
    caption: str = ""

    def __post_init__(self, record: Any) -> None:
        object.__setattr__(self, "columns", tuple(column.read(record) for column in self.columns))
        keys = [column.key for column in self.columns]
        assert len(set(keys)) == len(keys), f"{self.stem}: two columns of one key in {keys}"
        assert len({len(column.values) for column in self.columns}) <= 1, f"{self.stem}: columns of different lengths"

    def __len__(self) -> int:
        return len(self.columns[0].values)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, row: int) -> dict[str, Any]:
        """A row by its keys."""
        return {column.key: column.values[row] for column in self.columns}


def _read(how: Any, record: Any) -> list[Any]:
    """What `Column.of` means for a record, or for a list of records."""
    found = how
    if isinstance(how, str) or callable(how):
        of = attrgetter(how) if isinstance(how, str) else how
        found = [of(row) for row in record] if isinstance(record, list | tuple) else of(record)
    return found.tolist() if hasattr(found, "tolist") else list(found)
