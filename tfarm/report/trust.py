"""Method and proofs, one page for all reports: proofs, published numbers, the audit, how to make it again, words."""

import platform
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from difflib import SequenceMatcher
from functools import partial
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

from latex2mathml.converter import convert
from markupsafe import Markup, escape

import tfarm
from tfarm.audit import AuditRow, published
from tfarm.audit.arm_proofs import (
    BRACKET_DIGITS,
    PROVEN_DIGITS,
    PROVEN_MODES,
    PROVEN_OUTPUTS,
    UNPROVEN,
    ArmProof,
)
from tfarm.audit.rows import is_zero
from tfarm.digits import powers, scientific, significant, unit
from tfarm.report.blocks import (
    DATA,
    PROMISES,
    PageSection,
    anchor,
    argument,
    keep,
    read_records,
    record_sheet,
    render,
    save_section,
    sheet,
    write_text,
)
from tfarm.report.page import ArmReport
from tfarm.response.frequency import BAND_POINTS
from tfarm.schema import Column, Table, save_table, table
from tfarm.schema.glossary import GLOSSARY_TERMS
from tfarm.schema.html import GREEK, LETTER


def save_proof(report: ArmReport, folder: Path) -> None:
    """proof.json."""
    keep(folder, "proof", asdict(report.proof))


def written_proofs(out: Path) -> Sequence[ArmProof]:
    """Return the proofs of all arms in the folder of reports, by name; what is none of ours is passed over."""
    return list(read_records(out, "proof", ArmProof).values())


# ------------------------------------------------------------ tables


def proof_tables(proofs: Sequence[ArmProof]) -> list[Table]:
    """The counts of natural frequencies, all proven digits of these, and the boxes of other eigenvalues, if any."""
    digits = {proof.name: proof.leading_digits or [""] * PROVEN_MODES for proof in proofs}
    columns = (
        Column("mode", "mode", of=range(1, PROVEN_MODES + 1)),
        *(
            Column(
                f"{name}_rad_s",
                name,
                "rad/s",
                of=own,
                shown=[f"{text}…" if text else UNPROVEN for text in own],
            )
            for name, own in digits.items()
        ),
    )
    return [
        sheet(
            "counts", table(proofs, ("name", "has_rigid_mode", "enclosed", "count", "count_below", "verdict"))
        ),
        sheet("digits", columns, modes=PROVEN_MODES, digits=BRACKET_DIGITS),
        record_sheet("boxes", [each for proof in proofs for each in proof.boxes], digits=PROVEN_DIGITS),
    ]


def published_tables(found: published.Validation) -> list[Table]:
    """The sources of printed numbers and how many of each agree; the numbers that differ, by reason; all of them."""
    agrees = [[row.agrees for row in found.rows if row.source == source.key] for source in found.sources]
    counts = Column("numbers", "numbers", of=map(len, agrees)), Column("agree", "agree", of=map(sum, agrees))
    return [
        sheet("sources", (*table(found.sources).columns, *counts)),
        record_sheet("differences", found.differences),
        record_sheet("published", found.rows),
    ]


TRUST_FOLDER = "trust"


def in_letters(text: str) -> Markup:
    """Return the audit's plain text with Greek letters, subscripts and exponents: theta_t^2 becomes θ<sub>t</sub>²."""
    greek = LETTER.sub(lambda name: GREEK[name[1]], powers(unit(str(escape(text)))))
    return Markup(
        re.sub(
            r"(?<![^\W\d_])([A-Za-zΑ-Ωα-ω])_([a-z]{1,2}|\d{1,2})(?![A-Za-z0-9])", r"\1<sub>\2</sub>", greek
        )
    )


def compared_formulas(printed: str, corrected: str) -> tuple[list[Markup], list[Markup]]:
    """Return both as MathML, a line each, the symbols in which they differ of the class "changed"."""
    both = [*_formula_lines(printed)], [*_formula_lines(corrected)]
    a, b = (
        [leaf for line in each for leaf in line.iter() if leaf.tag in ("mi", "mo", "mn", "mtext")]
        for each in both
    )
    matcher = SequenceMatcher(a=[leaf.text for leaf in a], b=[leaf.text for leaf in b], autojunk=False)
    for what, i, j, k, m in matcher.get_opcodes():
        for leaf in (*a[i:j], *b[k:m]) if what != "equal" else ():
            leaf.set("class", "changed")
    left, right = ([Markup(ElementTree.tostring(line, encoding="unicode")) for line in each] for each in both)
    return left, right


def _formula_lines(tex: str) -> Iterator[ElementTree.Element]:
    """Yield a formula a line, without the name space that a file of XML would need and a page of HTML does not."""
    for line in re.split(r"(?<=[,;])\\quad\s*", tex):
        # a single letter would be slanted
        upright = re.sub(r"\\mathrm\{(\w)\}", r"\\text{\1}", line.strip())
        root = ElementTree.fromstring(
            re.sub(r' xmlns="[^"]*"', "", convert(upright, display="block"), count=1)
        )
        # which is set smaller
        root.attrib |= {"class": "long"} if len(line) > 300 else {}
        for row in root.iter("mrow"):
            for before, leaf in pairwise([ElementTree.Element("mo"), *row]):
                _correct(leaf, before)
        yield root


def _correct(leaf: ElementTree.Element, before: ElementTree.Element) -> None:
    """Plus-minus is an operator, infinity is none, and a determinant's bars are as high as it, by what is `before`."""
    if leaf.text == "±":
        leaf.tag = "mo"
        leaf.set("form", "prefix" if before.tag == "mo" else "infix")
    elif leaf.text == "∞":
        leaf.tag = "mi"
    elif leaf.text == "|":
        is_right = before.tag == "mtable"
        leaf.attrib = {"form": "postfix" if is_right else "prefix", "stretchy": "true", "symmetric": "true"}


def write_trust(
    audited: Sequence[AuditRow],
    printed: Sequence[published.PublishedRow],
    proofs: Sequence[ArmProof],
    folder: Path,
) -> None:
    """index.html and its tables, into a folder of their own."""
    audit_columns = (
        "equation",
        "verdict",
        "printed",
        "corrected",
        "residual_printed",
        "residual_corrected",
        "evidence",
    )
    packages = (
        "numpy",
        "scipy",
        "numba",
        "mpmath",
        "python-flint",
        "sympy",
        "control",
        "matplotlib",
        "latex2mathml",
    )
    folder.mkdir()
    found = published.Validation(tuple(printed))
    versions = {
        "tfarm": tfarm.__version__,
        "python": platform.python_version(),
        **{p: version(p) for p in packages},
    }
    worst = {output: [dict(proof.errors).get(output) for proof in proofs] for output in PROVEN_OUTPUTS}
    accuracy = (
        Column("arm", "arm", of=[proof.name for proof in proofs]),
        Column(
            "band_rad_s",
            "from … to, rad/s",
            of=[" … ".join(significant(x, 4) for x in p.band) for p in proofs],
        ),
        *(
            Column(
                output,
                output.replace("_", " "),
                of=own,
                shown=["zero throughout" if error is None else scientific(error, 2) for error in own],
            )
            for output, own in worst.items()
        ),
    )
    columns = (
        Column("package", "package", of=list(versions)),
        Column("version", "version", of=versions.values()),
    )
    again = [sheet("inputs", table(proofs, ("name", "source", "sha256"))), sheet("versions", columns)]
    blocks = {
        "proofs": proof_tables(proofs),
        "accuracy": [sheet("accuracy", accuracy)],
        "published": published_tables(found),
        "again": again,
    }
    sections = {name: save_section(PageSection(blocks=own), folder) for name, own in blocks.items()}
    save_table(
        table(audited, audit_columns, stem="audit", title="The paper, equation by equation"), folder / DATA
    )
    errors = [error for proof in proofs for _, error in proof.errors]
    names = " ".join(argument(proof.name, proof.source == "preset") for proof in proofs)
    write_text(
        folder / "index.html",
        render(
            "trust.html",
            title="Method and proofs",
            sections=sections,
            proofs=proofs,
            digits=BRACKET_DIGITS,
            points=BAND_POINTS,
            worst=scientific(max(errors), 2) if errors else "",
            found=found,
            equations=[(row, *compared_formulas(row.printed_tex, row.corrected_tex)) for row in audited],
            anchor=partial(anchor, "eq"),
            in_letters=in_letters,
            is_zero=is_zero,
            glossary=[term for term in GLOSSARY_TERMS if term.name in PROMISES],
            word_id=partial(anchor, "word"),
            command=f"tfarm report {names} --out reports",
        ),
    )
