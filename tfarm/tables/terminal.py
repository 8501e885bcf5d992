"""Tables for a terminal: no number is ever cut.

In a pipe every row is one line.  On a terminal that is too narrow titles and long texts are folded; if that is not
enough, the columns that do not fit follow in a block below, with the first column again.
"""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Sequence
from itertools import zip_longest

from rich.cells import cell_len

from tfarm.columns import Column, Table

COLUMN_GAP = 2  # spaces between two columns
LEAST_FOLDED = 20  # characters to which a text may be folded


def show(table: Table) -> None:
    """Print it, in the width of the terminal or, in a pipe, in as many characters as it takes."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize
    print("\n".join(table_lines(table, width)))


def show_pairs(pairs: Sequence[tuple[str, str]]) -> None:
    """Labels and values one below the other; on a terminal a long value goes on below itself."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize
    indent = max((len(label) for label, _ in pairs), default=0) + COLUMN_GAP
    for label, value in pairs:
        lines = textwrap.wrap(value, max(width - indent, LEAST_FOLDED), break_long_words=False) or [""]
        print("\n".join([f"{label:{indent}}{lines[0]}", *(" " * indent + line for line in lines[1:])]))


def table_lines(table: Table, width: int) -> list[str]:
    """The lines of the table, within a width as far as its widest column allows."""
    columns = table.columns
    cells = [column.cells for column in columns]
    titles, rows = [heading(column) for column in columns], list(zip(*cells, strict=True))
    fold = [i for i, column in enumerate(columns) if column.folds]
    words = [i for i, column in enumerate(columns) if column.is_text]
    widths = _widths(titles, rows, fold, width)
    printed: list[str] = []
    for block in _blocks(widths, width):
        printed += [""] * bool(printed)
        for row in (titles, *rows):
            printed += _row(row, widths, words, block)
    return printed


def _widths(titles: Sequence[str], rows: Sequence[Sequence[str]], fold: Sequence[int], width: int) -> list[int]:
    """Of each column: as its cells want it, folded where that does not fit."""
    columns = list(zip(*rows, strict=True)) or [() for _ in titles]
    cells = [max(map(cell_len, column), default=0) for column in columns]
    natural = [max(cell_len(title), cell) for title, cell in zip(titles, cells, strict=True)]
    if _total(natural) <= width:
        return natural
    words = [max(map(len, title.split()), default=0) for title in titles]
    widths = [max(pair) for pair in zip(words, cells, strict=True)]
    rest = width - _total([w for i, w in enumerate(widths) if i not in fold]) - COLUMN_GAP * len(fold)
    for left, i in zip(range(len(fold), 0, -1), sorted(fold, key=lambda i: widths[i]), strict=True):
        widths[i] = min(widths[i], max(rest // left, LEAST_FOLDED, words[i]))
        rest -= widths[i]
    return widths


def _row(row: Sequence[str], widths: Sequence[int], words: Sequence[int], block: Sequence[int]) -> list[str]:
    """A row's lines: numbers to the right, texts to the left."""
    parts = [textwrap.wrap(row[i], widths[i]) if cell_len(row[i]) > widths[i] else [row[i]] for i in block]
    to_left = [i in words for i in block]
    lines = []
    for texts in zip_longest(*parts, fillvalue=""):
        cells = (
            text + pad if left else pad + text
            for i, text, left in zip(block, texts, to_left, strict=True)
            for pad in [" " * (widths[i] - cell_len(text))]
        )
        lines.append((" " * COLUMN_GAP).join(cells).rstrip())
    return lines


def heading(column: Column) -> str:
    """The title with its unit."""
    return f"{column.title} [{column.unit}]" if column.unit else column.title


def _blocks(widths: Sequence[int], width: int) -> list[list[int]]:
    """The columns of each block, the first in all of them."""
    blocks = [[0] if widths else []]
    for i in range(1, len(widths)):
        if len(blocks[-1]) > 1 and _total([widths[j] for j in (*blocks[-1], i)]) > width:
            blocks.append([0])
        blocks[-1].append(i)
    return blocks


def _total(widths: Sequence[int]) -> int:
    return sum(widths) + COLUMN_GAP * (len(widths) - 1)
