"""What the commands print for a person, and tables written to files."""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from tfarm.arm import Arm
from tfarm.files import write_file


def print_presets(arms: list[Arm]) -> None:
    """A line an arm, with its assumptions."""
    console = Console()
    for arm in arms:
        console.print(f"[bold]{arm.name}[/bold]", highlight=False)
        for text in arm.assumptions:
            console.print(f"  - {text}", highlight=False, markup=False)


def print_modes(answer: dict[str, Any]) -> None:
    """The modal table."""
    table = _table(("mode", "rad/s", "Hz", "hub participation b", "modal moment [N m]", "nodes [m]"))
    for mode in answer["modes"]:
        frequency = mode["natural_frequency_rad_s"]
        table.add_row(
            str(mode["index"]),
            frequency if isinstance(frequency, str) else f"{frequency:.12g}",
            f"{mode['natural_frequency_hz']:.9g}",
            f"{mode['hub_participation']:.6g}",
            f"{mode['modal_moment']:.6g}",
            " ".join(f"{x:.4f}" for x in mode["nodes_m"]) or "-",
        )
    _show(table)
    if "proof" in answer:
        proof = answer["proof"]
        print(f"proven: each frequency enclosed, and {proof['count']} in all below {proof['below_rad_s']} rad/s")
    print(f"{answer['arm']}: the first {answer['count']} flexible modes, none missing ({answer['theory']} theory)")


def print_response(answer: dict[str, Any]) -> None:
    """The values, one row a point."""
    table = _table(("Re s [1/s]", "Im s [1/s]", f"Re {answer['output']} [{_unit(answer)}]", "Im"))
    for point, value in zip(answer["s"], answer["value"], strict=True):
        table.add_row(*(f"{part:.12g}" for part in point), *(_text(part) for part in value))
    _show(table)


def print_audit(answer: dict[str, Any]) -> None:
    """A row an equation: the verdict, and what it was and should be where the paper is corrected."""
    print(answer["paper"])
    table = _table(("equation", "verdict", "residual as printed", "as corrected"))
    for row in answer["rows"]:
        residuals = (Text(str(row[name])[:60]) for name in ("residual_printed", "residual_corrected"))
        table.add_row(Text(row["equation"]), row["verdict"], *residuals)
    _show(table)


def write_csv(answer: dict[str, Any], path: Path) -> None:
    """The response as a table in a file, written beside and then renamed."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    unit = _unit(answer)
    writer.writerow(["re_s [1/s]", "im_s [1/s]", f"re_{answer['output']} [{unit}]", f"im_{answer['output']} [{unit}]"])
    for point, value in zip(answer["s"], answer["value"], strict=True):
        writer.writerow([*point, *value])
    write_file(path, text.getvalue().encode(), key="--csv")


@contextmanager
def progress() -> Iterator[Callable[[int, int, str], None] | None]:
    """A progress bar on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, total, text: bar.update(task, completed=done, total=total, description=text)


def _unit(answer: dict[str, Any]) -> str:
    return f"{answer['unit']} / {answer['input_unit']}"


def _text(part: float | str) -> str:
    return part if isinstance(part, str) else f"{part:.12g}"


def _table(columns: tuple[str, ...]) -> Table:
    table = Table(box=None, pad_edge=False)
    for column in columns:
        table.add_column(Text(column), justify="right", no_wrap=True)
    return table


def _show(table: Table) -> None:
    """Whole rows, whatever the width of the terminal."""
    Console(width=None if sys.stdout.isatty() else 10_000, soft_wrap=True).print(table)
