"""The appendix as a whole in numbers, against the matrix exponential of the same beam's state."""

from __future__ import annotations

from functools import cache
from typing import Any

import mpmath
import sympy as sp
from mpmath import mpf

from .appendix import DETERMINANTS, ENTRIES, ENTRY_NAMES, determinants, waves_of
from .formulas import sides, symbol, symbols

BEAM_DIGITS = 50  # of both roads; RESIDUAL_NOISE leaves half of them to rounding
BEAM_NAMES = ("rho", "A", "L", "E", "I", "kappa", "G", "C", "m", "I_c", "I_h", "s")
BEAMS = (  # payload and damping, orders of one, so that no term hides; s on and off the axis
    (1.3, 0.7, 1.1, 2.9, 0.31, 0.83, 1.7, 0.013, 0.37, 0.053, 0.23, 0.9 + 2.3j),
    (2.1, 0.45, 0.8, 5.3, 0.12, 0.77, 2.2, 0.21, 0.0, 0.11, 0.61, 4.7j),
)
BeamNumbers = dict[str, Any]


def disagreement(text: str) -> str:
    """Largest relative difference of hub angle, tip motion and root moment between the two roads."""
    with mpmath.workdps(BEAM_DIGITS):
        worst = mpf(0)
        for point in BEAMS:
            values = {name: mpmath.mpmathify(str(v).strip("()")) for name, v in zip(BEAM_NAMES, point, strict=True)}
            pairs = zip(by_appendix(text, values), by_transition(values), strict=True)
            worst = max(worst, *(abs(mine / other - 1) for mine, other in pairs))
        return str(mpmath.nstr(worst, 2))


def by_transition(v: BeamNumbers) -> list[Any]:
    """theta, w(L), psi(L), M(0) for a unit torque, from exp(A(s) L) of the state (w, psi, Q, M)."""
    EI, kGA = v["E"] * (1 + v["C"] * v["s"]) * v["I"], v["kappa"] * v["G"] * v["A"]
    s2 = v["s"] ** 2
    rhoA, rhoI = v["rho"] * v["A"], v["rho"] * v["I"]
    rows = [[0, 1, 1 / kGA, 0], [0, 0, 0, 1 / EI], [rhoA * s2, 0, 0, 0], [0, rhoI * s2, -1, 0]]
    T = mpmath.expm(mpmath.matrix(rows) * v["L"])
    by_theta, by_shear, by_torque = (
        T * mpmath.matrix(start) for start in ([0, 1, 0, v["I_h"] * s2], [0, 0, 1, 0], [0, 0, 0, -1])
    )

    def tip(c: Any) -> list[Any]:
        return [c[2] + v["m"] * s2 * c[0], c[3] + v["I_c"] * s2 * c[1]]

    ends = mpmath.matrix([list(pair) for pair in zip(tip(by_theta), tip(by_shear), strict=True)])
    theta, shear = mpmath.lu_solve(ends, -mpmath.matrix(tip(by_torque)))
    end = by_theta * theta + by_shear * shear + by_torque
    return [theta, end[0], end[1], v["I_h"] * s2 * theta - 1]


@cache
def _compiled_entries() -> tuple[Any, Any]:
    """Functions of BEAM_NAMES and the lambdas, and of a_ij and U: the paper's a_ij and its determinants."""
    given = sides(ENTRIES)
    arguments = symbols(" ".join((*BEAM_NAMES, "lambda_1", "lambda_2")))
    names = [symbol(name) for row in ENTRY_NAMES for name in row]
    entries = sp.lambdify(arguments, [given[name] for name in names], "mpmath")
    return entries, sp.lambdify([*names, symbol("U")], list(determinants(DETERMINANTS).values()), "mpmath")


def by_appendix(text: str, v: BeamNumbers) -> list[Any]:
    """The same by (A.1), (A.2) of a text, the a_ij and Cramer's rule."""
    named = {key.name: right for key, right in sides(text).items()}
    square = sp.expand((named["lambda_"] / symbol("pm")) ** 2)
    squares = sp.lambdify([*symbols(" ".join(BEAM_NAMES)), symbol("pm")], square, "mpmath")
    given = [*v.values(), *(mpmath.sqrt(squares(*v.values(), sign)) for sign in (1, -1))]
    entries, cramer = _compiled_entries()
    Delta, *Delta_k = cramer(*entries(*given), 1)
    given += [each / Delta for each in Delta_k]
    Y, Phi = waves_of(text)
    x, Theta = symbols("x Theta")
    at_root = sp.solve(Phi.subs(x, 0), Theta)[0]  # by (14)
    turned, moved = (motion.subs(Theta, at_root) for motion in (Phi + Theta, Y + x * Theta))
    arguments = symbols(" ".join((*BEAM_NAMES, "lambda_1", "lambda_2", "k1", "k2", "k3", "k4", "x")))
    psi, w, slope = (sp.lambdify(arguments, f, "mpmath") for f in (turned, moved, sp.diff(turned, x)))
    moment = v["E"] * (1 + v["C"] * v["s"]) * v["I"] * slope(*given, 0)
    return [psi(*given, 0), w(*given, v["L"]), psi(*given, v["L"]), moment]
