"""A column: one quantity with its name, unit and cells; a table of them.

`tfarm.tables` makes terminals' tables, files and pages of a `Table`; `tfarm.schema` makes one of declared quantities.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from tfarm.digits import TEXTS, CellsOf


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
        return self.digits(self.values) if self.shown is None else self.shown

    @property
    def is_text(self) -> bool:
        """Whether a page sets it flush left."""
        return any(isinstance(value, str | tuple) for value in self.values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns of one length; a sequence of their rows as JSON has them.

    `stem` names its files; `title` and `caption` are those of the page.
    """

    columns: tuple[Column, ...]
    stem: str = ""
    title: str = ""
    caption: str = ""

    def __post_init__(self) -> None:
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
