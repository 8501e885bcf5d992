"""A table on a page: groups of columns, titles with units, cells with their tints."""

from __future__ import annotations

import itertools
import re

from markupsafe import Markup, escape

from tfarm.columns import PAGE, Column, Table
from tfarm.digits import unit

WIDE = 44  # characters of a text from which its cell is a wide one


def as_html(table: Table) -> Markup:
    """The table element, named by the table's title."""
    columns = table.on(PAGE)
    heads = Markup("").join(_head(column) for column in columns)
    cells = ([_cell(column, *pair) for pair in _tinted(column)] for column in columns)
    rows = Markup("").join(Markup("\n<tr>{}</tr>").format(Markup("").join(row)) for row in zip(*cells, strict=True))
    return Markup('<table aria-label="{}">\n<thead>\n{}<tr>{}</tr>\n</thead>\n<tbody>{}\n</tbody>\n</table>').format(
        table.title, _groups(columns), heads, rows
    )


def _groups(columns: list[Column]) -> Markup:
    """Shared headings over as many columns as they have; nothing where there is none."""
    runs = [(name, len(list(run))) for name, run in itertools.groupby(column.group for column in columns)]
    if not any(name for name, _ in runs):
        return Markup("")
    named = Markup(' class="named" scope="colgroup"')
    cells = (Markup('<th colspan="{}"{}>{}</th>').format(count, named * bool(name), name) for name, count in runs)
    return Markup('<tr class="group">{}</tr>\n').format(Markup("").join(cells))


def _head(column: Column) -> Markup:
    of = Markup('<span class="unit">{}</span>').format(column.unit) if column.unit else ""
    return Markup('<th scope="col" class="{}">{}{}</th>').format(_class(column, ""), symbol(column.title), of)


def _tinted(column: Column) -> list[tuple[str, str]]:
    return list(zip(column.cells, column.tint or itertools.repeat(""), strict=False))


def _cell(column: Column, text: str, tint: str) -> Markup:
    style = Markup(' style="background:{}"').format(tint) if tint else ""
    return Markup('<td class="{}"{}>{}</td>').format(_class(column, text), style, symbol(text))


def _class(column: Column, text: str) -> str:
    return "text" * column.is_text + " wide" * (len(text) > WIDE) + " tinted" * bool(column.tint)


def symbol(text: str) -> Markup:
    """A text with true subscripts and exponents: I_h becomes I<sub>h</sub>, m^2 becomes m²."""
    plain = unit(str(escape(text)))
    return Markup(re.sub(r"\b([A-Za-zθ])_([a-z0-9])\b", r"\1<sub>\2</sub>", plain))
