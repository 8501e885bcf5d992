"""Records and tables on a terminal, by rich: no number is broken or cut there.

Where the terminal is too narrow, titles and long texts are folded.  If that is not enough, the columns that do not fit
follow in a block below, after the leading ones again.  In a pipe only texts are folded: a row of numbers is one line.
Of many points only the first and the last are shown.
"""

import io
import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

from rich.cells import cell_len, set_cell_size
from rich.console import Console, RenderableType
from rich.table import Table as RichTable
from rich.text import Text

from tfarm.schema.tables import Column, RecordSection, Table, sections

# spaces between two columns
COLUMN_GAP = 2
# columns of a pipe, and characters to which a text may be folded there
PIPE_WIDTH = 120


def show(record: Any, rows: Table | None = None, last: str = "") -> None:
    """Print a record as a person reads it, then a table of points and a last line of text, if there are any."""
    shown, left_out = (None, "") if rows is None else first_and_last(rows)
    for number, each in enumerate([*sections(record), RecordSection(table=shown)]):
        if each.pairs or each.table or each.drawing:
            print(end="\n" * bool(number))
            show_text(each.title)
        if each.pairs:
            print("\n".join(pair_lines(each.pairs, terminal_width())))
        if each.table is not None:
            show_table(each.table)
        if each.drawing:
            print(each.drawing)
    show_text(left_out)
    show_text(last)


def show_table(table: Table) -> None:
    """Print a table in the width of the terminal."""
    print("\n".join(table_lines(table, terminal_width())))


def show_text(text: str) -> None:
    """Print a text, folded in the width of the terminal."""
    if text:
        print("\n".join(render_lines(Text(text), terminal_width())))


def first_and_last(table: Table, most: int = 40) -> tuple[Table, str]:
    """Return the first and last rows of a table of points, and the option that writes all where some are left out.

    With labels, titles and the row of dots between, 40 rows fill a screen of 50 lines; in a pipe the text is the same.
    """
    number = len(table.columns[0].of)
    half = most // 2
    left_out = number - 2 * half
    # a row of dots takes the place of one
    if left_out <= 1:
        return table, ""
    columns: list[Column] = []

    def ends(values: Sequence[Any], *between: Any) -> list[Any]:
        return [*values[:half], *between, *values[-half:]]

    for column in table.columns:
        kept = replace(column, of=ends(column.of), shown=column.shown and ends(column.shown))
        dots = "..." if columns else f"... {left_out} rows"
        columns.append(replace(column, of=ends(column.of, None), shown=ends(kept.cells, dots)))
    return replace(
        table, columns=tuple(columns)
    ), f"rows left out: {left_out} of {number}; --csv FILE writes all"


def pair_lines(pairs: Sequence[tuple[str, str]], width: int | None) -> list[str]:
    """Return the lines of labels and values one below the other; long values are folded."""
    labels, values = zip(*pairs, strict=True)
    columns = Column("label", of=labels), Column("value", of=values, folds=True)
    # without their titles
    return table_lines(Table(columns=columns), width)[1:]


def terminal_width() -> int | None:
    """Return the columns of the terminal, or None where standard output is none."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def table_lines(table: Table, width: int | None = None) -> list[str]:
    """Return the lines of a table, each within `width` as far as its widest column allows; without one, for a pipe."""
    # characters to which a text may be folded
    least_folded = 20
    least_in_pipe = 48
    columns = table.columns
    is_pipe = width is None
    width = width or PIPE_WIDTH
    shortest = least_in_pipe if is_pipe else least_folded
    widths = [widest([each.heading, *each.cells]) for each in columns]
    # rich would take a second for two thousand rows
    if sum(widths) + COLUMN_GAP * (len(widths) - 1) <= width:
        aligned = map(aligned_cells, columns, widths)
        return [(" " * COLUMN_GAP).join(row).rstrip() for row in zip(*aligned, strict=True)]
    leading = columns[: table.leading]
    blocks: list[list[Column]] = [[*leading]]
    for column in columns[table.leading :]:
        is_wide = least_width([*blocks[-1], column], shortest) > width
        if is_wide and len(blocks[-1]) > len(leading) and not is_pipe:
            blocks.append([*leading])
        blocks[-1].append(column)
    lines: list[str] = []
    for block in blocks:
        grid = RichTable(box=None, pad_edge=False, padding=(0, COLUMN_GAP, 0, 0), header_style="")
        for column in block:
            size = least(column, shortest)
            side = "left" if column.is_text else "right"
            fixed = None if column.folds else size
            grid.add_column(Text(column.heading), justify=cast("Any", side), width=fixed, min_width=size)
        for row in zip(*(column.cells for column in block), strict=True):
            grid.add_row(*map(Text, row))
        lines += [""] * bool(lines) + render_lines(grid, max(width, least_width(block, shortest)))
    return lines


def aligned_cells(column: Column, width: int) -> list[str]:
    """Return heading and cells of a column in that width, words to the left and numbers to the right."""
    texts = (column.heading, *column.cells)
    if column.is_text:
        return [set_cell_size(each, width) for each in texts]
    return [" " * (width - cell_len(each)) + each for each in texts]


def render_lines(shown: RenderableType, width: int | None) -> list[str]:
    """Return the lines of a text or of a table of rich in that width; without one, in that of a pipe."""
    console = Console(file=io.StringIO(), width=width or PIPE_WIDTH, color_system=None, legacy_windows=False)
    with console.capture() as captured:
        console.print(shown, crop=False)
    return [line.rstrip() for line in captured.get().splitlines()]


def least_width(columns: Sequence[Column], shortest: int) -> int:
    """Return the characters that columns take at least."""
    return sum(least(column, shortest) for column in columns) + COLUMN_GAP * (len(columns) - 1)


def least(column: Column, shortest: int) -> int:
    """Return the characters below which a word or a number of a column, or a text of `shortest`, would be broken."""
    cells = widest(column.cells)
    if column.folds:
        cells = min(cells, max(shortest, widest(" ".join(column.cells).split())))
    return max(cells, widest(column.heading.split()))


def widest(texts: Sequence[str]) -> int:
    """Return the characters of the widest of some texts."""
    return max(map(cell_len, texts), default=0)
