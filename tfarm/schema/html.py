"""A table on a page: titles with units, cells with their tints."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

from tfarm.digits import powers, unit

from .tables import Column, Table

COMPLEX = re.compile(r"(?<=[\d)])([+-])(\d[\d.]*(?:e[+-]?\d+)?)i\b")  # the imaginary part of a number
SIGN, INFINITE = re.compile(r"(?<![\w.)])-(?=[\d.]|inf\b)"), re.compile(r"\binf\b")  # of a number in a cell
TYPESET = {
    "theta_t^2": "(dθ/dt)²", "theta_t": "dθ/dt", "phi_xt(0)": "∂φ′(0)/∂t", " theta": " θ", "phi'(0)": "φ′(0)",
    "L(iw)": "L(iω)", "J w1": "J ω₁", "+-": "±",
    "(alpha_c, eta_c)": "momentum and learning rate", "w^2 rhoA": "ω^2 rhoA", "w L^2": "ω L^2",
}  # fmt: skip
GREEK = {
    "rho": "ρ", "kappa": "κ", "theta": "θ", "phi": "φ", "psi": "ψ", "lambda": "λ", "eta": "η", "alpha": "α", "nu": "ν",
    "omega": "ω", "Theta": "Θ", "Phi": "Φ", "Psi": "Ψ", "Delta": "Δ",
}  # fmt: skip
LETTER = re.compile(rf"(?<![A-Za-z])({'|'.join(GREEK)})(?=[AI]\b|[^A-Za-z]|$)")  # rho, and of rhoA and rhoI
ROOT = re.compile(r"\^\((1/\d)\)")
MINUS = re.compile(r"(?<= )-(?= ?[\w(])")  # of a formula in a sentence
WIDE_CELL = 44  # characters of a text from which its cell is a wide one


def as_html(table: Table) -> Markup:
    """The table element, named by the table's title."""
    if not table.columns:
        return Markup('<p class="caption">none</p>')
    rows = zip(*map(_column, table.columns), strict=True)
    head, *body = (Markup("<tr>{}</tr>").format(Markup("").join(row)) for row in rows)
    shape = Markup('<table aria-label="{}">\n<thead>\n{}\n</thead>\n<tbody>\n{}\n</tbody>\n</table>')
    return shape.format(table.title, head, Markup("\n").join(body))


def _column(column: Column) -> list[Markup]:
    """The heading with its key in JSON, then the cells: words to the left, long ones wide, some with a background."""
    text, tinted, cells = "text" * column.is_text, " tinted" * bool(column.tint), column.cells
    of = Markup('<span class="unit">{}</span>').format(unit(column.unit)) if column.unit else ""
    tag, scope = ("th", Markup(' scope="col"')) if column.title else ("td", "")
    shape = Markup('<{0}{1} class="{2}{3}" data-key="{4}"{5}>{6}{7}</{0}>')
    head = shape.format(tag, scope, text, tinted, column.key, _tooltip(column.help), with_symbols(column.title), of)
    styles = (
        Markup(' style="background:{}"').format(tint) if tint else "" for tint in column.tint or [""] * len(cells)
    )
    label = f"{column.title} [{column.unit}]" if column.unit else column.title
    cell = Markup('<td class="{}{}{}" data-label="{}"{}{}>{}</td>')
    helps = column.helps or [""] * len(cells)
    return [
        head,
        *(
            cell.format(
                text, " wide" * (len(words) > WIDE_CELL), tinted, label, style, _tooltip(meaning), with_symbols(words)
            )
            for words, style, meaning in zip(cells, styles, helps, strict=True)
        ),
    ]


def _tooltip(meaning: str) -> Markup:
    return Markup(' title="{}"').format(meaning) if meaning else Markup()


def with_symbols(text: str) -> Markup:
    """A text with Greek letters, true minus signs, subscripts and exponents: I_h becomes I<sub>h</sub>, m^2 m²."""
    text = COMPLEX.sub(lambda part: f"\u00a0{part[1].replace('-', '−')}\u00a0{part[2]}\u00a0i", text)
    for written, shown in TYPESET.items():
        text = text.replace(written, shown)
    plain = LETTER.sub(lambda name: GREEK[name[1]], powers(unit(str(escape(MINUS.sub("−", text))))))
    plain = ROOT.sub(r"<sup>\1</sup>", plain)
    plain = INFINITE.sub("∞", SIGN.sub("−", plain))
    return Markup(re.sub(r"\b([A-Za-zθ])_([a-z0-9])\b", r"\1<sub>\2</sub>", plain))
