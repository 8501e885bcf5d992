"""Why trust this: one page for all reports, with proofs, published numbers, the audit and how to make it all again."""

from __future__ import annotations

import platform
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from importlib.metadata import version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from latex2mathml.converter import convert
from markupsafe import Markup, escape

import tfarm
from tfarm import audit
from tfarm.arm import load, presets
from tfarm.audit import AuditRow, published
from tfarm.audit.rows import is_zero
from tfarm.columns import Column, Table
from tfarm.digits import powers, scientific, unit
from tfarm.report.modes_section import BRACKET_DIGITS
from tfarm.report.page import command_for_all, render
from tfarm.report.sections import DATA, Fact, PageSection, save_section
from tfarm.report.trust_proofs import ArmProof, accuracy_table, boxes_tables, counts_table, digits_table, hash_of
from tfarm.response.frequency import BAND_POINTS
from tfarm.schema import table
from tfarm.tables.files import save_table

AUDIT_COLUMNS = (
    "equation", "verdict", "printed", "corrected", "residual_printed", "residual_corrected", "evidence",
)  # fmt: skip
VERDICT_MARKS = {"ok": ("✓", "right as printed"), "corrected": ("≠", "corrected"), "undecided": ("?", "undecided")}
GREEK_LETTERS = dict(
    zip(
        ("rho", "kappa", "theta", "phi", "psi", "lambda", "eta", "alpha", "nu", "Theta", "Phi", "Psi", "Delta"),
        "ρκθφψληανΘΦΨΔ",
        strict=True,
    )
)
MathElement = ElementTree.Element
STATEMENT_END = re.compile(r"(?<=[,;])\\quad\s*")
LEAVES = ("mi", "mo", "mn", "mtext")
LONG_TEX = 300  # characters of a line from which it is set smaller
TRUST_FOLDER = "trust"
PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "mpmath",
    "python-flint",
    "sympy",
    "control",
    "matplotlib",
    "latex2mathml",
    "vl-convert-python",
)
PROOFS_WORDS = (
    "Modes are counted before they are looked for: a chain of signs in the manner of Wittrick and Williams (1971) "
    "gives the number of natural frequencies below any frequency. Here both that count and the change of sign in each "
    "enclosure are decided in ball arithmetic (python-flint), where every number carries a rigorous bound of its "
    "error: what follows is a proof, not an estimate. Where the enclosures are as many as the count, none is missing."
)
ACCURACY_WORDS = (
    f"The plots are computed in double precision from a closed form without cancellation. At {BAND_POINTS} "
    "frequencies of each response, from a tenth of the first natural frequency to beyond the tenth, it was compared "
    "with ball arithmetic at 30 proven digits. The error is counted in the change of G that a relative change of its "
    "argument brings about, |G₆₄/G − 1| / (1 + |s G′/G|): near an undamped resonance no more can be asked of any "
    "number format. One unit in the last place of a double is 2.2 × 10⁻¹⁶."
)
PUBLISHED_WORDS = (
    "Natural frequencies of beams as others have printed them. Each beam is an arm here: a free pin is a hub without "
    "inertia, a clamp a locked hub, a support at the tip an infinite payload mass. Ours agrees with a printed number "
    "if it rounds to its last digit; where it does not, the reason stands beside it. A difference without a reason "
    "would have stopped this page."
)


def shown_row(row: AuditRow) -> dict[str, Any]:
    """A row of the audit, typeset; `corrected` is empty where the print is right."""
    is_right = row.printed == row.corrected
    both = (row.printed_tex, row.corrected_tex)
    printed, corrected = (formulas(both[0]), []) if is_right else compared_formulas(*both)
    return {
        "anchor": anchor(row.equation),
        "equation": in_letters(row.equation),
        "verdict": row.verdict,
        "mark": VERDICT_MARKS[row.verdict][0],
        "words": VERDICT_MARKS[row.verdict][1],
        "printed": printed,
        "corrected": corrected,
        "left_printed": _left(row.residual_printed),
        "left_corrected": _left(row.residual_corrected),
        "evidence": in_letters(row.evidence),
    }


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


def _set(tex: str) -> list[MathElement]:
    """A formula a line, without the name space that a file of XML would need and a page of HTML does not."""
    found = []
    for line in STATEMENT_END.split(tex):
        upright = re.sub(r"\\mathrm\{(\w)\}", r"\\text{\1}", line.strip())  # a single letter would be slanted
        root = ElementTree.fromstring(re.sub(r' xmlns="[^"]*"', "", convert(upright, display="block"), count=1))
        if len(line) > LONG_TEX:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What the whole package shows for itself: the audit of the paper, and the tables of others."""

    audit: tuple[audit.AuditRow, ...]
    published: tuple[published.PublishedRow, ...]


def gather() -> Evidence:
    """Run the audit and the comparison with published tables: some seconds.

    Raises CertificationError where one of them fails.
    """
    return Evidence(audit=audit.audit(), published=published.validate())


def write_trust(evidence: Evidence, proofs: Sequence[ArmProof], folder: Path) -> None:
    """index.html and its tables, into a folder of their own."""
    folder.mkdir()
    sections = {s.anchor: save_section(s, folder) for s in _sections(evidence, proofs)}
    plain = table(evidence.audit, AUDIT_COLUMNS, stem="audit", title="The paper, equation by equation")
    files = save_table(plain, folder / DATA)
    page = render(
        "trust.html",
        title="Why trust this",
        sections=sections,
        short=_short(evidence, proofs),
        counts=[
            (*VERDICT_MARKS[verdict], verdict, number) for verdict, number in verdict_counts(evidence.audit).items()
        ],
        equations=[shown_row(row) for row in evidence.audit],
        audit_files=files,
        paper=audit.PAPER,
        command=command_for_all([(proof.name, _is_preset(proof)) for proof in proofs]),
    )
    (folder / "index.html").write_text(page, encoding="utf-8", newline="")


def _sections(evidence: Evidence, proofs: Sequence[ArmProof]) -> list[PageSection]:
    rows, found = evidence.published, published.Validation(evidence.published)
    agree, of = sum(row.agrees for row in rows), len({row.source for row in rows})
    facts = (
        Fact(label="numbers compared", value=str(len(rows)), beside=f"from {of} sources"),
        Fact(label="agree to the last printed digit", value=str(agree)),
        Fact(label="differ, with the reason", value=str(len(rows) - agree)),
    )
    return [
        PageSection(
            anchor="proofs",
            title="Proofs",
            words=(PROOFS_WORDS,),
            blocks=(digits_table(proofs), counts_table(proofs), *boxes_tables(proofs)),
        ),
        PageSection(
            anchor="accuracy", title="Measured accuracy", words=(ACCURACY_WORDS,), blocks=(accuracy_table(proofs),)
        ),
        PageSection(
            anchor="published",
            title="Published numbers",
            words=(PUBLISHED_WORDS,),
            facts=facts,
            blocks=(sources_table(rows), differences_table(found), published_table(found)),
        ),
        PageSection(anchor="again", title="Make it again", blocks=(inputs_table(proofs), versions_table())),
    ]


def _short(evidence: Evidence, proofs: Sequence[ArmProof]) -> dict[str, Any]:
    """The numbers of the five sentences at the top."""
    proven = [proof for proof in proofs if not proof.failure]
    errors = [error for proof in proofs for _, error in proof.errors]
    found = verdict_counts(evidence.audit)
    return {
        "frequencies": sum(len(proof.brackets) for proof in proven),
        "arms": len(proven),
        "unproven": [proof.name for proof in proofs if proof.failure],
        "digits": BRACKET_DIGITS,
        "points": BAND_POINTS,
        "worst": scientific(max(errors), 2) if errors else "",
        "published": len(evidence.published),
        "agree": sum(row.agrees for row in evidence.published),
        "rows": len(evidence.audit),
        **found,
    }


# ------------------------------------------------------------ published tables


def sources_table(rows: Sequence[published.PublishedRow]) -> Table:
    """Where the numbers were printed, how they came here, and how many agree."""
    sources = [s for s in published.ALL if any(row.source == s.key for row in rows)]
    of = [[row for row in rows if row.source == source.key] for source in sources]
    return Table(
        stem="sources",
        title="Sources",
        caption="Few of the originals lay open on the desk; the last column says how each table was read. Where "
        "no table but a frequency equation was published, the equation's roots stand for printed numbers.",
        record=sources,
        columns=(
            Column("source", "source", of="key"),
            Column("numbers", "numbers", of=[len(each) for each in of]),
            Column("agree", "agree", of=[sum(row.agrees for row in each) for each in of]),
            Column("citation", "where it was printed"),
            Column("reached", "how it was read"),
        ),
    )


def differences_table(found: published.Validation) -> Table:
    """The printed numbers that ours does not round to, a row a reason."""
    caption = "Largest difference: ours over printed, less one, of the modes named. All other numbers agree."
    return table(found.differences, stem="differences", title="Where ours differs, and why", caption=caption)


def published_table(found: published.Validation) -> Table:
    """Every printed number and ours."""
    caption = "Relative difference: ours over printed, less one; the reasons are given above."
    return table(found.rows, stem="published", title="All printed numbers, and ours", caption=caption)


# ------------------------------------------------------------ making it again


def inputs_table(proofs: Sequence[ArmProof]) -> Table:
    """The hash of each arm's file."""
    names, hashes = [proof.name for proof in proofs], [proof.sha256 for proof in proofs]
    return Table(
        stem="inputs",
        title="Inputs",
        caption="SHA-256 of each arm's file, arm.toml in its folder: all that its page depends on.",
        columns=(
            Column("arm", "arm", of=names),
            Column("is", "where from", of=["comes with tfarm" if _is_preset(p) else "a file" for p in proofs]),
            Column("sha256", "SHA-256 of arm.toml", of=hashes),
        ),
    )


def versions_table() -> Table:
    """The versions that computed this."""
    found = {"tfarm": tfarm.__version__, "python": platform.python_version()}
    found |= {package: version(package) for package in PACKAGES}
    return Table(
        stem="versions",
        title="Versions",
        caption="With these versions, on one machine, two runs give the same bytes: no dates, no timings, fixed seeds.",
        columns=(
            Column("package", "package", of=list(found)),
            Column("version", "version", of=list(found.values())),
        ),
    )


def _is_preset(proof: ArmProof) -> bool:
    """Whether the arm's file is, byte for byte, that of a preset."""
    return proof.name in presets() and hash_of(load(proof.name)) == proof.sha256
