"""A table on a page: groups of columns, titles with units, cells with their tints."""

from __future__ import annotations

import itertools
import re

from markupsafe import Markup, escape

from tfarm.columns import Column, Table
from tfarm.digits import powers, unit

SIGN, INFINITE = re.compile(r"(?<![\w.)])-(?=[\d.]|inf\b)"), re.compile(r"\binf\b")  # of a number in a cell
WIDE_CELL = 44  # characters of a text from which its cell is a wide one


def as_html(table: Table) -> Markup:
    """The table element, named by the table's title; shared headings, where there are any, over their columns."""
    columns = table.columns
    if not columns:
        return Markup('<p class="caption">none</p>')
    runs = [(name, len(list(run))) for name, run in itertools.groupby(column.group for column in columns)]
    groups = Markup("")
    if any(name for name, _ in runs):
        headed, bare = (
            Markup('<th colspan="{}" class="named" scope="colgroup">{}</th>'),
            Markup('<td colspan="{}"></td>'),
        )
        cells = (headed.format(count, name) if name else bare.format(count) for name, count in runs)
        groups = Markup('<tr class="group">{}</tr>\n').format(Markup("").join(cells))
    heads, *rows = (
        Markup("<tr>{}</tr>").format(Markup("").join(row)) for row in zip(*map(_column, columns), strict=True)
    )
    body = Markup("\n").join([Markup("<tbody>"), *rows, Markup("</tbody>")])
    shape = Markup('<table aria-label="{}">\n<thead>\n{}{}\n</thead>\n{}\n</table>')
    return shape.format(table.title, groups, heads, body)


def _column(column: Column) -> list[Markup]:
    """The heading with its key in JSON, then the cells: words to the left, long ones wide, some with a background."""
    text, tinted, cells = "text" * column.is_text, " tinted" * bool(column.tint), column.cells
    of = Markup('<span class="unit">{}</span>').format(column.unit) if column.unit else ""
    tag, scope = ("th", Markup(' scope="col"')) if column.title else ("td", "")
    shape = Markup('<{0}{1} class="{2}{3}" data-key="{4}">{5}{6}</{0}>')
    head = shape.format(tag, scope, text, tinted, column.key, with_symbols(column.title), of)
    styles = (
        Markup(' style="background:{}"').format(tint) if tint else "" for tint in column.tint or [""] * len(cells)
    )
    label = f"{column.title} [{column.unit}]" if column.unit else column.title
    cell = Markup('<td class="{}{}{}" data-label="{}"{}>{}</td>')
    return [
        head,
        *(
            cell.format(text, " wide" * (len(words) > WIDE_CELL), tinted, label, style, with_symbols(words))
            for words, style in zip(cells, styles, strict=True)
        ),
    ]


def with_symbols(text: str) -> Markup:
    """A text with true subscripts and exponents: I_h becomes I<sub>h</sub>, m^2 becomes m², 1e-4 becomes 1 × 10⁻⁴."""
    plain = SIGN.sub("−", powers(unit(str(escape(text)))))
    plain = INFINITE.sub("∞", plain)
    return Markup(re.sub(r"\b([A-Za-zθ])_([a-z0-9])\b", r"\1<sub>\2</sub>", plain))
