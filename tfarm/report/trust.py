"""Why trust this: one page for all reports, with proofs, published numbers, the audit and how to make it all again.

What takes seconds (the audit, the published tables) is `Evidence`, made by one piece of the work; what belongs to an
arm (`trust_proofs.ArmProof`) is in its folder.  This module turns both into sections.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tfarm
from tfarm import audit
from tfarm.arm import load, presets
from tfarm.audit import published
from tfarm.columns import Column, Table
from tfarm.digits import scientific, significant, singly, worded
from tfarm.report.page import command_for_all, render
from tfarm.report.sections import DATA, Fact, PageSection, save_section
from tfarm.report.trust_audit import VERDICT_MARKS, audit_table, shown_row, verdict_counts
from tfarm.report.trust_proofs import (
    BRACKET_DIGITS,
    ArmProof,
    accuracy_table,
    boxes_tables,
    counts_table,
    digits_table,
    hash_of,
)
from tfarm.response.frequency import BAND_POINTS
from tfarm.tables.files import save_table

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
    files = save_table(audit_table(evidence.audit), folder / DATA)
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
    rows = evidence.published
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
            blocks=(sources_table(rows), differences_table(rows), published_table(rows)),
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


def differences_table(rows: Sequence[published.PublishedRow]) -> Table:
    """The printed numbers that ours does not round to, a row a reason."""
    groups: dict[tuple[str, str, str], list[published.PublishedRow]] = {}
    for row in rows:
        if not row.agrees:
            groups.setdefault((row.source, row.case, row.why), []).append(row)
    worst = [max((row.difference for row in each), key=abs) for each in groups.values()]
    return Table(
        stem="differences",
        title="Where ours differs, and why",
        caption="Largest difference: ours over printed, less one, of the modes named. All other numbers agree.",
        columns=(
            Column("source", "source", of=[source for source, _, _ in groups]),
            Column("case", "case", of=[case for _, case, _ in groups], digits=worded(published.lettered)),
            Column("modes", "modes", of=[", ".join(str(row.mode) for row in each) for each in groups.values()]),
            Column("largest_difference", "largest difference", of=worst, digits=singly(significant, 2)),
            Column("why", "why", of=[why for _, _, why in groups]),
        ),
    )


def published_table(rows: Sequence[published.PublishedRow]) -> Table:
    """Every printed number beside ours."""
    return Table(
        stem="published",
        title="All printed numbers, and ours",
        caption="✓ agrees to the last printed digit, ≠ differs, for the reason given above. Difference: ours over "
        "printed, less one.",
        record=list(rows),
        columns=published.PUBLISHED_COLUMNS,
    )


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
