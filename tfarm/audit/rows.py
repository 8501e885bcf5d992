"""A claim about one equation, and the row that its check turns it into.

The printed and the corrected formula are texts in one small language (`formulas`), and one check reads either of
them.  So a check never knows which of the two it was given, and the verdict is not written down but follows:

* "ok": the formula as printed leaves no residual;
* "corrected": it leaves one, and the corrected formula none;
* "undecided": the same, but which of several readings the paper meant cannot be told from it, or the
  transcript itself shows damage at that place.  Then `corrected` is the reading used here.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from tfarm.errors import CertificationError
from tfarm.schema import Quantity


def tex(text: str) -> str:
    """The TeX of a text in the language of `formulas`."""
    from .formulas import tex as written  # SymPy takes half a second to load, and rows are shown without it

    return written(text)


def in_words(text: str) -> str:
    """The TeX of statements that are no formulas: "rho = 2766.7 kg/m^3", "C: s", or words."""
    found = []
    for clause in text.split("; "):
        name, sign, rest = clause.partition(" = ") if " = " in clause else clause.partition(": ")
        if not sign:
            name, _, rest = clause.partition(" ")
            found.append(rf"{tex(name)}\text{{ {rest}}}" if "_" in name else rf"\text{{{clause}}}")
            continue
        number, _, unit = rest.partition(" ") if sign == " = " else ("", "", rest)
        number = re.sub(r"e([-+]?\d+)", r"\\cdot 10^{\1}", number)
        unit = unit.replace(" ", r"\,")
        found.append(rf"{tex(name)}{sign}{number}\ \mathrm{{{unit}}}" if unit else f"{tex(name)}{sign}{number}")
    return r";\quad ".join(found)


RESIDUAL_NOISE = 1e-25  # relative: numbers are compared at 50 digits


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditRow:
    """One equation as printed and as corrected, with what each leaves in the check that tells them apart."""

    equation: Annotated[str, Quantity("equation")]
    verdict: Annotated[str, Quantity("verdict")]
    printed: Annotated[str, Quantity()]
    corrected: Annotated[str, Quantity()]
    evidence: Annotated[str, Quantity()]
    residual_printed: Annotated[str, Quantity("residual as printed")]
    residual_corrected: Annotated[str, Quantity("as corrected")]
    printed_tex: str
    corrected_tex: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What is said of an equation.

    `check` gives the residual of a text, "0" or a number below RESIDUAL_NOISE if it is right.
    """

    equation: str
    printed: str
    check: Callable[[str], str]
    evidence: str
    corrected: str = ""  # empty: the print is right
    doubt: str = ""  # what cannot be decided
    measured: Callable[[], str] | None = None  # numbers that go with the evidence
    typeset: Callable[[str], str] = tex

    def row(self) -> AuditRow:
        """Run the check on both texts.  Raises CertificationError where the corrected one leaves a residual."""
        corrected = self.corrected or self.printed
        residual_printed = self.check(self.printed)
        residual_corrected = self.check(corrected) if self.corrected else residual_printed
        if not is_zero(residual_corrected):
            raise CertificationError(f"{self.equation}, as corrected, leaves {residual_corrected}")
        numbers = "" if self.measured is None else self.measured()
        return AuditRow(
            equation=self.equation,
            verdict="undecided" if self.doubt else "ok" if is_zero(residual_printed) else "corrected",
            printed=self.printed,
            corrected=corrected,
            evidence=" ".join(part for part in (self.evidence, self.doubt, numbers) if part),
            residual_printed=residual_printed,
            residual_corrected=residual_corrected,
            printed_tex=self.typeset(self.printed),
            corrected_tex=self.typeset(corrected),
        )


def is_zero(residual: str) -> bool:
    """Whether a residual says that nothing is left: "0", or a number below RESIDUAL_NOISE."""
    try:
        return abs(float(residual)) < RESIDUAL_NOISE
    except ValueError:
        return False
