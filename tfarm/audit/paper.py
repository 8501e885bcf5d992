"""The audit of the paper: a row for each of its equations, its table and its appendix."""

from __future__ import annotations

from functools import cache
from typing import Any

from tfarm.columns import Table

from .appendix_rows import APPENDIX_CLAIMS, DAMPING_CLAIM
from .energy import ENERGY_CLAIMS
from .motion import MOTION_CLAIMS
from .rows import AUDIT_COLUMNS, AuditRow, Claim
from .table import TABLE_CLAIMS
from .tuner import TUNER_CLAIMS

PAPER = (
    "Self-Tuning Vibration Control of a Rotational Flexible Timoshenko Arm Using Neural Networks, "
    "Advances in Acoustics and Vibration, 2012, article 852780"
)


def claims() -> tuple[Claim, ...]:
    """Every claim, in the order of the paper."""
    return (*MOTION_CLAIMS, DAMPING_CLAIM, *ENERGY_CLAIMS, *TUNER_CLAIMS, *TABLE_CLAIMS, *APPENDIX_CLAIMS)


@cache
def audit() -> tuple[AuditRow, ...]:
    """Check every equation, as printed and as corrected.

    Raises CertificationError if a correction does not pass its own check.
    """
    return tuple(claim.row() for claim in claims())


def audit_answer() -> dict[str, Any]:
    """The answer of `tfarm audit --json`."""
    return {"paper": PAPER, "rows": Table(columns=AUDIT_COLUMNS, record=audit())}
