"""Published natural frequencies against the exact ones: their number, ours, the difference, and why there is one.

A row agrees if ours, rounded to the last printed digit, is what they printed.  One that does not must say why
(`literature.Case.why`), and one that does must not: neither a difference nor an excuse stands alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.columns import JSON, REPORT, Column, Table
from tfarm.digits import TEXTS, general, powers, significant, singly, worded
from tfarm.errors import CertificationError
from tfarm.spectrum import modes

from .literature import ANGULAR, CYCLIC, REDUCED, RIG_SOURCES, SOURCES, WAVE_NUMBER, Case, Source

__all__ = [
    "SOURCES",
    "Case",
    "PublishedRow",
    "Source",
    "agrees",
    "case_rows",
    "computed",
    "validate",
    "validate_answer",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedRow:
    """One printed number and ours; `difference` is ours/printed - 1, `why` empty where ours agrees."""

    source: str
    case: str
    quantity: str
    mode: int
    printed: str
    ours: float
    difference: float
    agrees: bool
    why: str


def lettered(text: str) -> str:
    """Words with formulas in plain letters, with Greek ones."""
    return powers(text.replace("rhoA", "ρA").replace("w^2", "ω^2").replace("w L", "ω L"))


ALL = (*SOURCES, *RIG_SOURCES)
PUBLISHED_COLUMNS = (
    Column("source", "source", on=(JSON, *REPORT)),
    Column("case", "case", digits=worded(lettered), printed=TEXTS, folds=True),
    Column("quantity", "quantity", digits=worded(lettered), printed=TEXTS, folds=True),
    Column("mode", "mode"),
    Column("agrees", on=(JSON,)),
    Column("agrees", of=lambda row: "yes" if row.agrees else "no", digits=worded({"yes": "✓", "no": "≠"}.__getitem__),
           on=REPORT),
    Column("printed", "printed"),
    Column("ours", "ours", digits=singly(significant, 11), head="exact", printed=singly(general, 10)),
    Column("difference", "difference", digits=singly(significant, 2), printed=singly(lambda x: f"{x:+.1e}")),
    Column("why", on=(JSON,)),
)  # fmt: skip


def validate(sources: tuple[Source, ...] = ALL) -> tuple[PublishedRow, ...]:
    """Every row of every source.

    Raises CertificationError naming the rows that differ beyond their printed digits without a reason, or that give
    a reason and agree.
    """
    found = tuple(row for source in sources for case in source.cases for row in case_rows(source.key, case))
    wrong = [row for row in found if row.agrees == bool(row.why)]
    if wrong:
        texts = (
            f"{row.source}, {row.case}, mode {row.mode}: printed {row.printed}, exact {row.ours:.10g}"
            + (", which agrees though a reason is given" if row.agrees else ", and no reason is given")
            for row in wrong
        )
        raise CertificationError("; ".join(texts))
    return found


def case_rows(key: str, case: Case) -> list[PublishedRow]:
    """The rows of one column of a table."""
    return [
        PublishedRow(
            source=key,
            case=case.name,
            quantity=case.quantity,
            mode=mode,
            printed=printed,
            ours=ours,
            difference=ours / float(printed) - 1,
            agrees=agrees(ours, printed),
            why=case.why.get(mode, ""),
        )
        for mode, (printed, ours) in enumerate(zip(case.printed, computed(case).tolist(), strict=True), start=1)
    ]


def computed(case: Case) -> NDArray[np.float64]:
    """The exact solution's numbers for a column, in its quantity."""
    link, count = case.arm.link, len(case.printed)
    table = modes(case.arm, count, theory=case.theory)
    omega, hertz = table.natural_frequency[-count:], table.natural_frequency_hz[-count:]
    reduced = omega * link.length**2 * np.sqrt(link.rhoA / link.EI)
    return {CYCLIC: hertz, ANGULAR: omega, REDUCED: reduced, WAVE_NUMBER: np.sqrt(reduced)}[case.quantity]


def agrees(ours: float, printed: str) -> bool:
    """Whether ours lies within half a unit of the last printed digit."""
    number = Decimal(printed)
    unit = Decimal(1).scaleb(int(number.as_tuple().exponent))
    return abs(Decimal(ours) - number) <= unit / 2


def validate_answer() -> dict[str, Any]:
    """The sources and the table of rows, with how many agree and how many are explained.

    Raises CertificationError as `validate` does.
    """
    found = validate()
    return {
        "sources": [{"key": s.key, "citation": s.citation, "reached": s.reached} for s in ALL],
        "rows": Table(columns=PUBLISHED_COLUMNS, record=found),
        "agree": sum(row.agrees for row in found),
        "explained": sum(bool(row.why) for row in found),
    }
