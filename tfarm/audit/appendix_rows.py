"""The rows of the appendix, and of the damping that only the appendix has."""

from __future__ import annotations

import re
from functools import partial

from . import appendix as a
from .numbers import BEAM_DIGITS, disagreement
from .rows import Claim
from .typesetting import tex

DAMPING_CLAIM = Claim(  # C, which (1)-(14) lack
    equation="(1)-(14): damping C",
    printed=a.STIFFNESS_PRINTED,
    corrected=a.STIFFNESS,
    check=partial(a.solves, a.WAVES_MENDED),
    evidence="The waves of the appendix, mended, in (8) and (9) with this bending stiffness (SymPy): with C they "
    "solve (9) only if E I carries 1 + C s, in (2), (3), (5) 1 + C d/dt. Without damping (1)-(14) stand as they "
    "are: C appears in the appendix and Table 1 only.",
)


def determinant_tex(text: str) -> str:
    """|a11 a12 / ...| as a determinant."""

    def between_bars(match: re.Match[str]) -> str:
        lines = match[1].split(" / ")
        rows = r" \\ ".join(" & ".join(map(tex, line.split())) for line in lines)
        return rf"\begin{{vmatrix}}{rows}\end{{vmatrix}}"

    names = [clause.split(" = ", 1) for clause in text.split("; ")]
    return r",\quad ".join(f"{tex(name)} = {re.sub(r'[|](.*)[|]', between_bars, right)}" for name, right in names)


APPENDIX_CLAIMS = (  # the waves, their numbers, the ends' matrix and Cramer's rule; last, all of it in numbers
    Claim(
        equation="(A.1)",
        printed=a.WAVES_PRINTED,
        corrected=a.WAVES_MENDED,
        check=a.solves,
        evidence="Inserted in (8) and (9), each k_i by itself, with lambda of the mended (A.2) (SymPy). The minus "
        "signs before k_3, k_4 belong in Phi only, and a_31 = ... = a_34 = 1, which is W(0) = 0, has them so "
        "too. k_i, used in Phi, is defined nowhere: Delta k_i/Delta. The text calls this the solution to (8), (9) "
        "and (10); it is that of (8)-(14).",
    ),
    Claim(
        equation="(A.2)",
        printed=a.LAMBDA_PRINTED,
        corrected=a.LAMBDA,
        check=a.is_dispersion,
        evidence="Dimensions, and lambda in the determinant of (8) and (9), both signs (SymPy): the inner bracket "
        "needs its square root; all else is right.",
        doubt="Undecided whether the paper or the transcript lost it: a brace is unmatched just there, so that "
        "either the print reads [...]^{1/2} inside, or it has no inner root and is wrong.",
    ),
    Claim(
        equation="a_ij",
        printed=a.ENTRIES,
        check=a.are_entries,
        evidence="All sixteen are the coefficients of k_j in (11), (12), (13), (10) with the mended (A.1), "
        "Theta = Psi(0) by (14), and E (1 + C s); U stands alone in row 4 (SymPy).",
    ),
    Claim(
        equation="Delta, Delta k_i",
        printed=a.DETERMINANTS,
        check=a.are_determinants,
        typeset=determinant_tex,
        evidence="Cramer's rule for any a_ij (SymPy, polynomial identity): sum_j a_ij Delta k_j = (0, 0, 0, U) "
        "Delta. The brackets are read as the bars of determinants.",
    ),
    Claim(
        equation="appendix as a whole",
        printed=f"{a.WAVES_PRINTED}; {a.LAMBDA_PRINTED}",
        corrected=f"{a.WAVES_MENDED}; {a.LAMBDA}",
        check=disagreement,
        evidence="Hub angle, tip displacement, tip rotation and root moment for a unit torque by (A.1), (A.2), the "
        f"a_ij and Cramer's rule, against the exponential of the beam's state matrix, {BEAM_DIGITS} digits, with "
        "payload and damping: largest relative difference (mpmath).",
    ),
)
