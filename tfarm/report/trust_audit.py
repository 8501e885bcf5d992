"""The audit of the paper as the page shows it: formulas printed and corrected side by side, verdicts in words."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from tfarm.audit import AuditRow
from tfarm.audit.rows import AUDIT_COLUMNS, is_zero
from tfarm.columns import Table
from tfarm.digits import powers, unit
from tfarm.report.trust_math import compared_formulas, formula_lines, formulas, width

VERDICT_MARKS = {"ok": ("✓", "right as printed"), "corrected": ("≠", "corrected"), "undecided": ("?", "undecided")}
GREEK_LETTERS = dict(
    zip(
        ("rho", "kappa", "theta", "phi", "psi", "lambda", "eta", "alpha", "nu", "Theta", "Phi", "Psi", "Delta"),
        "ρκθφψληανΘΦΨΔ",
        strict=True,
    )
)
WIDEST_BESIDE = 46  # characters of the widest line up to which two formulas stand side by side


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """One equation of the paper on the page; `corrected` is empty where the print is right."""

    anchor: str
    equation: Markup
    verdict: str
    mark: str
    words: str
    printed: list[Markup]
    corrected: list[Markup]
    is_wide: bool
    left_printed: str
    left_corrected: str
    evidence: Markup


def shown_row(row: AuditRow) -> Shown:
    """A row of the audit, typeset."""
    mark, words = VERDICT_MARKS[row.verdict]
    is_right = row.printed == row.corrected
    texts = (row.printed_tex,) if is_right else (row.printed_tex, row.corrected_tex)
    printed, corrected = (formulas(texts[0]), []) if is_right else compared_formulas(*texts)
    return Shown(
        anchor=anchor(row.equation),
        equation=in_letters(row.equation),
        verdict=row.verdict,
        mark=mark,
        words=words,
        printed=printed,
        corrected=corrected,
        is_wide=is_right or max(width(line) for tex in texts for line in formula_lines(tex)) > WIDEST_BESIDE,
        left_printed=_left(row.residual_printed),
        left_corrected=_left(row.residual_corrected),
        evidence=in_letters(row.evidence),
    )


def in_letters(text: str) -> Markup:
    """The audit's plain text with Greek letters, subscripts and exponents: theta_t^2 becomes θ<sub>t</sub>²."""
    greek = re.sub(
        rf"(?<![A-Za-z])({'|'.join(GREEK_LETTERS)})(?![A-Za-z])",
        lambda name: GREEK_LETTERS[name[1]],
        powers(unit(str(escape(text)))),
    )
    return Markup(
        re.sub(r"(?<![^\W\d_])([A-Za-zΑ-Ωα-ω])_([a-z]{1,2}|\d{1,2})(?![A-Za-z0-9])", r"\1<sub>\2</sub>", greek)
    )


def anchor(equation: str) -> str:
    """A name for links: "(A.1)" becomes "eq-a-1"."""
    return "eq-" + re.sub(r"[^a-z0-9]+", "-", equation.lower()).strip("-")


def verdict_counts(rows: Sequence[AuditRow]) -> dict[str, int]:
    """How many rows have each verdict, in the order of VERDICTS."""
    found = Counter(row.verdict for row in rows)
    return {verdict: found[verdict] for verdict in VERDICT_MARKS}


def audit_table(rows: Sequence[AuditRow]) -> Table:
    """Every row in plain text, for the files."""
    title = "The paper, equation by equation"
    return Table(stem="audit", title=title, columns=AUDIT_COLUMNS, record=list(rows))


def _left(residual: str) -> str:
    """What a formula leaves in the check, in words."""
    if residual == "0":
        return "nothing"
    return f"nothing but rounding at 50 digits, {powers(residual)}" if is_zero(residual) else residual
