"""A claim about one equation, and the row that its check makes of it.

The printed and the corrected formula are texts in one small language (`formulas`), and one check reads either of
them.  So a check has no input but the formula, and the verdict is not written down but follows:

* "ok": the formula as printed leaves no residual;
* "corrected": it leaves one, and the corrected formula none;
* "undecided": the same, but the paper does not decide between several readings, or the transcript itself shows damage
  at that place.  Then `corrected` is the reading used here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from tfarm.errors import CertificationError
from tfarm.schema import Quantity

STATEMENTS = {  # TeX of what is no formula: the learning rule, the network's inputs, Table 1
    "dw = -eta_c*g + alpha_c*dw_before": r"\Delta w^r_{pq}(t) = - \eta_c\,\frac{\partial E}{\partial w^r_{pq}(t)} + "
    r"\alpha_c\,\Delta w^r_{pq}(t-1)",
    "w_next = w - dw": r"w^r_{pq}(t+1) = w^r_{pq}(t) - \Delta w^r_{pq}(t)",
    "w_next = w + dw": r"w^r_{pq}(t+1) = w^r_{pq}(t) + \Delta w^r_{pq}(t)",
    "u(t), u(t-1), e(t), e(t-1), K, x(t), x(t-1)": "u(t), u(t-1), e(t), e(t-1), K, x(t), x(t-1)",
    "u(t), u(t-1), e(t), e(t-1), x(t), x(t-1)": "u(t), u(t-1), e(t), e(t-1), x(t), x(t-1)",
    "alpha_c changed dynamically; alpha_c = 0.6": r"\alpha_{c}\text{ changed dynamically};\quad \alpha_{c} = 0.6",
    "eta_c of each weight its own; eta_c = 0.8": r"\eta_{c}\text{ of each weight its own};\quad \eta_{c} = 0.8",
    "rho = 2.7667 kg/m^3": r"\rho = 2.7667\ \mathrm{kg/m^3}",
    "rho = 2766.7 kg/m^3": r"\rho = 2766.7\ \mathrm{kg/m^3}",
    "C: kg/s": r"C: \ \mathrm{kg/s}",
    "C: s": r"C: \ \mathrm{s}",
    "L: m; A: m^2; rho: kg/m^3; E: Pa; I_c: kg m^2; m: kg; kappa: 1; G: Pa": r"L: \ \mathrm{m};\quad "
    r"A: \ \mathrm{m^2};\quad \rho: \ \mathrm{kg/m^3};\quad E: \ \mathrm{Pa};\quad I_{c}: \ \mathrm{kg\,m^2};\quad "
    r"m: \ \mathrm{kg};\quad \kappa: \ \mathrm{1};\quad G: \ \mathrm{Pa}",
    "no value": r"\text{no value}",
    "I = 1.8e-9 m^4; rectangle 0.1 m x 0.006 m": r"I = 1.8\cdot 10^{-9}\ \mathrm{m^4};\quad "
    r"\text{rectangle 0.1 m x 0.006 m}",
    "I_h = 0.1 kg m^2": r"I_{h} = 0.1\ \mathrm{kg\,m^2}",
}  # fmt: skip


def tex(text: str) -> str:
    """The TeX of a statement, or of a text in the language of `formulas`."""
    from .formulas import tex as written  # SymPy takes half a second to load, and rows are shown without it

    return STATEMENTS.get(text) or written(text)


RESIDUAL_NOISE = 1e-25  # relative: numbers are compared at 50 digits


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditRow:
    """One equation as printed and as corrected, with the residual of each in the check that separates them."""

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
    """A statement about an equation.

    `check` gives the residual of a text, "0" or a number below RESIDUAL_NOISE if it is right.
    """

    equation: str
    printed: str
    check: Callable[[str], str]
    evidence: str
    corrected: str = ""  # empty: the print is right
    doubt: str = ""  # what cannot be decided
    measured: Callable[[], str] = str  # numbers that go with the evidence

    def row(self) -> AuditRow:
        """Run the check on both texts.  Raises CertificationError where the corrected one leaves a residual."""
        corrected = self.corrected or self.printed
        residual_printed = self.check(self.printed)
        residual_corrected = self.check(corrected) if self.corrected else residual_printed
        if not is_zero(residual_corrected):
            raise CertificationError(f"{self.equation}, as corrected, leaves {residual_corrected}")
        return AuditRow(
            equation=self.equation,
            verdict="undecided" if self.doubt else "ok" if is_zero(residual_printed) else "corrected",
            printed=self.printed,
            corrected=corrected,
            evidence=" ".join(part for part in (self.evidence, self.doubt, self.measured()) if part),
            residual_printed=residual_printed,
            residual_corrected=residual_corrected,
            printed_tex=tex(self.printed),
            corrected_tex=tex(corrected),
        )


def is_zero(residual: str) -> bool:
    """Whether a residual is "0", or a number below RESIDUAL_NOISE."""
    try:
        return abs(float(residual)) < RESIDUAL_NOISE
    except ValueError:
        return False
