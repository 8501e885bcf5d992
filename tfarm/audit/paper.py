"""The audit of the paper: a row for each of its equations, its table and its appendix."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache
from typing import Any

from tfarm.columns import Table

from . import appendix_rows, energy_rows, motion, table, tuner
from .rows import ROWS, Claim, Row

PAPER = (
    "Self-Tuning Vibration Control of a Rotational Flexible Timoshenko Arm Using Neural Networks, "
    "Advances in Acoustics and Vibration, 2012, article 852780"
)


def claims() -> tuple[Claim, ...]:
    """Every claim, in the order of the paper."""
    return (
        *motion.claims(),
        appendix_rows.damping(),
        *energy_rows.claims(),
        *tuner.claims(),
        *table.claims(),
        *appendix_rows.claims(),
    )


@cache
def audit() -> tuple[Row, ...]:
    """Check every equation, as printed and as corrected.

    Raises CertificationError if a correction does not pass its own check.
    """
    return tuple(claim.row() for claim in claims())


def records(rows: Iterable[Row]) -> list[dict[str, str]]:
    """Rows as plain dictionaries, without the typeset formulas."""
    return list(Table(columns=ROWS, record=list(rows)))


def to_json(rows: Iterable[Row]) -> str:
    """Rows as a JSON array."""
    return json.dumps(records(rows), indent=2, ensure_ascii=False)


def audit_answer() -> dict[str, Any]:
    """The answer of `tfarm audit --json`."""
    return {"paper": PAPER, "rows": Table(columns=ROWS, record=audit())}
