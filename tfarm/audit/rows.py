"""The texts of the claims about equations, and the row that a check makes of one.

The printed and the corrected formula are texts of `claims.toml` in one small language (`formulas`), and one check
reads either of them.  So a check has no input but the formula, and the verdict is not written down but follows:

* "ok": the formula as printed leaves no residual;
* "corrected": it leaves one, and the corrected formula none;
* "undecided": the same, but the paper does not decide between several readings, or the transcript itself shows damage
  at that place.  Then `corrected` is the reading used here.
"""

import tomllib
from dataclasses import dataclass
from importlib.resources import files
from typing import Annotated

from tfarm.schema import Quantity

DATA = tomllib.loads((files("tfarm.audit") / "claims.toml").read_text("utf-8"))
# in the order of the paper
TEXTS: dict[str, dict[str, str]] = {each["equation"]: each for each in DATA["claim"]}


def formula_of(equation: str) -> str:
    """Return the formula that passes the check of its equation: as corrected, or as printed."""
    return TEXTS[equation].get("corrected") or TEXTS[equation]["printed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditRow:
    """One equation as printed and as corrected, with the residual of each in the check that separates them."""

    equation: Annotated[str, Quantity("equation", help="number of the equation in the paper")]
    verdict: Annotated[
        str, Quantity("verdict", help="ok, corrected, or undecided where the paper leaves several readings")
    ]
    printed: Annotated[str, Quantity(help="formula as the paper prints it")]
    corrected: Annotated[
        str, Quantity(help="formula that passes the check; the printed one where that is right")
    ]
    evidence: Annotated[str, Quantity(help="check that separates the two formulas, and its result")]
    residual_printed: Annotated[
        str, Quantity("residual as printed", help="remainder of the printed formula in the check; 0 is right")
    ]
    residual_corrected: Annotated[
        str, Quantity("as corrected", help="remainder of the corrected formula in the same check")
    ]
    printed_tex: str
    corrected_tex: str


def is_zero(residual: str) -> bool:
    """Whether a residual is "0", or a number that is zero but for rounding."""
    # relative: numbers are compared at 50 digits
    noise = 1e-25
    try:
        return abs(float(residual)) < noise
    except ValueError:
        return False
