"""What one line of the bench holds, and how the lines are printed and kept."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

PACKAGES = ("tfarm", "numpy", "numba", "scipy", "mpmath", "python-flint", "cxroots", "scikit-fem", "control")


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A number asked for: `measured` is to be at most `limit`, both in `unit`."""

    measured: float
    limit: float
    unit: str

    @property
    def met(self) -> bool:
        """Whether it was, this time."""
        return bool(self.measured <= self.limit)

    def __str__(self) -> str:
        return f"{self.measured:.3g} of {self.limit:g} {self.unit}: {'met' if self.met else 'NOT MET'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One measurement: median `seconds` for each of n points or modes, and the largest error against a proven value.

    `ratio` is to what `to` names, which took `to_seconds` a point or mode, measured in turn in the same process.
    tfarm's times are those of a first call, its caches empty; of a `warm` row those of a call to what is made already.
    """

    group: str
    what: str
    n: int
    each: str
    seconds: float
    ratio: float | None = None
    to: str = ""
    to_seconds: float | None = None
    error: float | None = None
    target: Target | None = None
    note: str = ""
    warm: bool = False

    @property
    def record(self) -> dict[str, object]:
        """The row as it is kept in JSON."""
        met = None if self.target is None else self.target.met
        return {**asdict(self), "met": met}


def show(rows: Sequence[Row], console: Console) -> None:
    """Print one table a group, the notes below it."""
    for group in dict.fromkeys(row.group for row in rows):
        console.print(group, style="bold", highlight=False)
        table = Table(header_style="", box=SIMPLE, pad_edge=False)
        for heading in ("what", "n", "time each", "ratio", "largest error", "target"):
            table.add_column(heading, justify="left" if heading in ("what", "target") else "right")
        notes: list[str] = []
        for row in (row for row in rows if row.group == group):
            if row.note and row.note not in notes:
                notes.append(row.note)
            mark = f" [{notes.index(row.note) + 1}]" if row.note else ""
            table.add_row(*_cells(row, mark))
        console.print(table)
        for number, note in enumerate(notes, 1):
            console.print(f"[{number}] {note}", markup=False, highlight=False, soft_wrap=True)
        console.print()


def keep(rows: Sequence[Row], path: Path) -> None:
    """Write the rows as JSON, with the versions they were measured with."""
    versions = {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}
    text = json.dumps({"versions": versions, "rows": [row.record for row in rows]}, indent=1, allow_nan=False)
    path.parent.mkdir(exist_ok=True)
    beside = path.with_suffix(".part")
    beside.write_text(text + "\n", encoding="utf-8")
    beside.replace(path)


def duration(seconds: float) -> str:
    """Three digits and a unit: 62.1 ns, 1.37 ms."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def _cells(row: Row, mark: str) -> tuple[str, ...]:
    ratio = ""
    if row.ratio is not None and row.to_seconds is not None:
        figures = f"{row.ratio:.2f}" if row.ratio < 100 else f"{row.ratio:,.0f}"
        ratio = f"{figures} x {row.to} ({duration(row.to_seconds)})"
    error = "" if row.error is None else f"{row.error:.1e}"
    target = "" if row.target is None else str(row.target)
    each = f"{duration(row.seconds)}/{row.each}"
    return (row.what + ", warm" * row.warm + mark).replace("[", r"\["), f"{row.n:,}", each, ratio, error, target
