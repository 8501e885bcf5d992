"""The paper, equation by equation: as printed, as corrected, and the check that separates them.

for row in tfarm.audit.audit():
    print(row.equation, row.verdict, row.residual_printed, row.residual_corrected)

paper       the audit: (15)-(23), the feedback, Table 1 and section 5; the list of all claims
equations   the checks of (1)-(14) and of the appendix that solves them
formulas    the language of the formulas in SymPy: derivatives, integrals along the arm, dimensions
rows        the texts of the claims (`claims.toml`), and the row that a check makes of one
kept        the audit kept on disk
published   published natural frequencies (`literature.toml`) against the exact ones
arm_proofs  proofs on one arm: its modes and poles enclosed and counted, its responses compared

What needs SymPy is loaded when it is asked for: a report's processes want this room for its studies of assumptions.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from tfarm.audit.kept import kept_audit
from tfarm.audit.rows import AuditRow, is_zero

if TYPE_CHECKING:
    from tfarm.audit.paper import PAPER, Audit, Claim, audit, claims

__all__ = ["PAPER", "Audit", "AuditRow", "Claim", "audit", "claims", "is_zero", "kept_audit"]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'tfarm.audit' has no attribute {name!r}")
    return getattr(import_module("tfarm.audit.paper"), name)
