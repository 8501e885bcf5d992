"""The paper, equation by equation: as printed, as corrected, and the check that tells them apart.

for row in tfarm.audit.audit():
    print(row.equation, row.verdict, row.residual_printed, row.residual_corrected)
"""

from .paper import PAPER, audit, audit_answer, claims, records, to_json
from .rows import Claim, Row, is_zero

__all__ = ["PAPER", "Claim", "Row", "audit", "audit_answer", "claims", "is_zero", "records", "to_json"]
