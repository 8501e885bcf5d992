"""A table on a page: titles with units, cells with their tints."""

import re
from itertools import repeat

from jinja2 import Environment
from markupsafe import Markup, escape

from tfarm.digits import powers, unit
from tfarm.schema.tables import Table

GREEK = {
    "rho": "ρ",
    "kappa": "κ",
    "theta": "θ",
    "phi": "φ",
    "psi": "ψ",
    "lambda": "λ",
    "eta": "η",
    "alpha": "α",
    "nu": "ν",
    "omega": "ω",
    "Theta": "Θ",
    "Phi": "Φ",
    "Psi": "Ψ",
    "Delta": "Δ",
}
# rho, and of rhoA and rhoI
LETTER = re.compile(rf"(?<![A-Za-z])({'|'.join(GREEK)})(?=[AI]\b|[^A-Za-z]|$)")

TABLE = Environment(autoescape=True).from_string("""<table aria-label="{{ table.title }}">
<thead>
<tr>
{%- for column, kinds in columns %}
{%- set tag = "th" if column.title else "td" %}<{{ tag }}{% if column.title %} scope="col"{% endif %}
{{- "" }} class="{{ kinds|join }}" data-key="{{ column.key }}"{% if column.help %} title="{{ column.help }}"{% endif %}>
{{- symbols(column.title) }}{% if column.unit %}<span class="unit">{{ unit(column.unit) }}</span>{% endif %}</{{ tag }}>
{%- endfor %}</tr>
</thead>
<tbody>
{% for row in rows %}<tr>
{%- for words, tint, help in row %}
{%- set column, kinds = columns[loop.index0] %}<td class="{{ kinds|join(" wide" if words|length > wide else "") }}"
{{- "" }} data-label="{{ column.heading }}"{% if tint %} style="background:{{ tint }}"{% endif %}
{%- if help %} title="{{ help }}"{% endif %}>{{ symbols(words) }}</td>
{%- endfor %}</tr>
{% endfor %}</tbody>
</table>""")


def as_html(table: Table) -> Markup:
    """Return the table element, named by the table's title: words to the left, long ones wide, some tinted."""
    # characters of a text from which its cell is a wide one
    wide_cell = 44
    if not table.columns:
        return Markup('<p class="caption">none</p>')
    columns = []
    cells = []
    for each in table.columns:
        columns.append((each, ("text" * each.is_text, " tinted" * bool(each.tint))))
        cells.append(zip(each.cells, each.tint or repeat(""), each.helps or repeat(""), strict=False))
    rows = zip(*cells, strict=True)
    return Markup(
        TABLE.render(table=table, columns=columns, rows=rows, symbols=with_symbols, unit=unit, wide=wide_cell)
    )


def with_symbols(text: str) -> Markup:
    """Return a text with Greek letters, true minus signs, subscripts and exponents: I_h as I<sub>h</sub>, m^2 as m²."""
    typeset = {
        "theta_t^2": "(dθ/dt)²",
        "theta_t": "dθ/dt",
        "phi_xt(0)": "∂φ′(0)/∂t",
        " theta": " θ",
        "phi'(0)": "φ′(0)",
        "L(iw)": "L(iω)",
        "J w1": "J ω₁",
        "+-": "±",
        "(alpha_c, eta_c)": "momentum and learning rate",
        "w^2 rhoA": "ω^2 rhoA",
        "w L^2": "ω L^2",
    }
    imaginary_part = r"(?<=[\d)])([+-])(\d[\d.]*(?:e[+-]?\d+)?)i\b"
    minus_of_formula = r"(?<= )-(?= ?[\w(])"
    minus_of_number = r"(?<![\w.)])-(?=[\d.]|inf\b)"
    text = re.sub(
        imaginary_part, lambda part: f"\u00a0{part[1].replace('-', '−')}\u00a0{part[2]}\u00a0i", text
    )
    for written, shown in typeset.items():
        text = text.replace(written, shown)
    plain = powers(unit(str(escape(re.sub(minus_of_formula, "−", text)))))
    plain = LETTER.sub(lambda name: GREEK[name[1]], plain)
    plain = re.sub(r"\^\((1/\d)\)", r"<sup>\1</sup>", plain)
    plain = re.sub(r"\binf\b", "∞", re.sub(minus_of_number, "−", plain))
    return Markup(re.sub(r"\b([A-Za-zθ])_([a-z0-9])\b", r"\1<sub>\2</sub>", plain))
