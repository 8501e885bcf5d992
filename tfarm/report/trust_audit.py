"""The audit of the paper as the page shows it: formulas printed and corrected side by side, verdicts in words.

Formulas for the page: TeX to MathML, which every current browser sets and reads aloud without any help.

MathML has no line breaks of its own, so long formulas are broken here: between statements, and at the plus and minus
signs that stand outside every bracket.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from xml.etree import ElementTree

from latex2mathml.converter import convert
from markupsafe import Markup, escape

from tfarm.audit import AuditRow
from tfarm.audit.rows import AUDIT_COLUMNS, is_zero
from tfarm.columns import Table
from tfarm.digits import powers, unit

VERDICT_MARKS = {"ok": ("✓", "right as printed"), "corrected": ("≠", "corrected"), "undecided": ("?", "undecided")}
GREEK_LETTERS = dict(
    zip(
        ("rho", "kappa", "theta", "phi", "psi", "lambda", "eta", "alpha", "nu", "Theta", "Phi", "Psi", "Delta"),
        "ρκθφψληανΘΦΨΔ",
        strict=True,
    )
)
WIDEST_BESIDE = 46  # characters of the widest line up to which two formulas stand side by side
MathElement = ElementTree.Element
STATEMENT_END = re.compile(r"([,;]\\quad)\s*")
OPENS, CLOSES = ("\\left", "\\begin", "{"), ("\\right", "\\end", "}")
TEX_TOKEN = re.compile(r"\\left|\\right|\\begin|\\end|[{}]|[^\\{}]|\\[A-Za-z]+|\\.")
SUM_SIGN = re.compile(r" [-+] ")
LEAVES = ("mi", "mo", "mn", "mtext")
WIDEST_LINE = 92  # characters of a line, as `width` estimates them: what fits beside the margins of a desktop's page
SHORT_STATEMENT = 24  # statements up to that width share a line, as far as it goes
INDENT_TEX = r"\qquad "


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


def formulas(tex: str) -> list[Markup]:
    """The TeX as MathML, a line each."""
    return [_text(line) for line in _set(tex)]


def compared_formulas(printed: str, corrected: str) -> tuple[list[Markup], list[Markup]]:
    """Both as MathML, a line each, the symbols in which they differ of the class "changed"."""
    both = _set(printed), _set(corrected)
    left, right = ([leaf for line in each for leaf in line.iter() if leaf.tag in LEAVES] for each in both)
    matcher = SequenceMatcher(a=[leaf.text for leaf in left], b=[leaf.text for leaf in right], autojunk=False)
    for what, i, j, k, m in matcher.get_opcodes():
        if what != "equal":
            for leaf in (*left[i:j], *right[k:m]):
                leaf.set("class", "changed")
    return [_text(line) for line in both[0]], [_text(line) for line in both[1]]


def formula_lines(tex: str) -> list[str]:
    """The TeX of each line: a statement, several short ones, or as many terms of a long one as fit."""
    found = []
    for group in _groups(tex):
        line = ""
        for term in _terms(group):
            if line and width(line + term) > WIDEST_LINE:
                found.append(line)
                line = INDENT_TEX
            line += term
        found.append(line)
    return found


def width(tex: str) -> int:
    """About how many characters wide a line is set; the two halves of a fraction share their place."""

    def wider(halves: re.Match[str]) -> str:
        return "x" * max(width(halves[1]), width(halves[2]))

    text = re.sub(r"\\begin\{vmatrix\}.*?\\end\{vmatrix\}", "x" * 16, tex, flags=re.DOTALL)
    text = re.sub(r"\\frac\{((?:[^{}]|\{[^{}]*\})*)\}\{((?:[^{}]|\{[^{}]*\})*)\}", wider, text)
    text = re.sub(r"\\(?:mathrm|text|left|right|sqrt|,|quad|qquad)", "", text)
    text = re.sub(r"\\[A-Za-z]+ ?", "x", text)
    return len(re.sub(r"[{}^_]", "", text))


def _groups(tex: str) -> Iterator[str]:
    """Statements, neighbours that are short together."""
    group = last = ""
    for statement in STATEMENT_END.split(tex)[::2]:
        are_short = max(width(last), width(statement)) <= SHORT_STATEMENT
        if group and not (are_short and width(group + statement) <= 2 * SHORT_STATEMENT):
            yield group
            group = ""
        group += rf",\quad {statement}" if group else statement
        last = statement
    yield group


def _terms(statement: str) -> Iterator[str]:
    """The terms of a sum, each with its sign in front; what is in brackets stays together."""
    depth, start = 0, 0
    for match in TEX_TOKEN.finditer(statement):
        token, place = match.group(), match.start()
        depth += (token in OPENS) - (token in CLOSES)
        if depth == 0 and place > start and SUM_SIGN.match(statement, place):
            yield statement[start:place]
            start = place
    yield statement[start:]


def _set(tex: str) -> list[MathElement]:
    """A formula a line, without the name space that a file of XML would need and a page of HTML does not."""
    found = []
    for line in formula_lines(tex):
        upright = re.sub(r"\\mathrm\{(\w)\}", r"\\text{\1}", line.strip())  # a single letter would be slanted
        root = ElementTree.fromstring(re.sub(r' xmlns="[^"]*"', "", convert(upright, display="block"), count=1))
        if width(line) > WIDEST_LINE:
            root.set("class", "long")
        _mend(root)
        found.append(root)
    return found


def _mend(root: MathElement) -> None:
    """Where the converter errs: plus-minus is an operator, infinity is none, a determinant's bars are as high as it."""
    for row in root.iter("mrow"):
        before = None
        for leaf in row:
            if leaf.text == "±":
                leaf.tag = "mo"
                leaf.set("form", "prefix" if before is None or before.tag == "mo" else "infix")
            elif leaf.text == "∞":
                leaf.tag = "mi"
            elif leaf.text == "|":
                is_right = before is not None and before.tag == "mtable"
                leaf.attrib = {"form": "postfix" if is_right else "prefix", "stretchy": "true", "symmetric": "true"}
            before = leaf


def _text(line: MathElement) -> Markup:
    return Markup(ElementTree.tostring(line, encoding="unicode"))
