"""The appendix: its waves in (8)-(14), its dispersion relation, its a_ij, and Cramer's rule.

The appendix as a whole in numbers, against the matrix exponential of the same beam's state.

The rows of the appendix, and of the damping that only the appendix has.
"""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import mpmath
import sympy as sp
from mpmath import mpf

from .formulas import (
    PAPER_UNITS,
    Expression,
    clauses,
    determinant,
    difference,
    jet_parts,
    mismatch,
    parsed,
    remainder,
    sides,
    symbol,
    symbols,
)
from .motion import LAPLACE
from .rows import Claim

Y_TERMS = (
    "Delta_k1/Delta*exp(lambda_1*x) + Delta_k2/Delta*exp(lambda_2*x)"
    " {0} Delta_k3/Delta*exp(-lambda_1*x) {0} Delta_k4/Delta*exp(-lambda_2*x) - x*Theta"
)
PHI_TERMS = (
    "(lambda_1 - rho*s^2/(lambda_1*kappa*G))*(k1*exp(lambda_1*x) - k3*exp(-lambda_1*x))"
    " + (lambda_2 - rho*s^2/(lambda_2*kappa*G))*(k2*exp(lambda_2*x) - k4*exp(-lambda_2*x)) - Theta"
)
WAVES_PRINTED = f"Y = {Y_TERMS.format('-')}; Phi = {PHI_TERMS}"
WAVES_MENDED = f"Y = {Y_TERMS.format('+')}; Phi = {PHI_TERMS}"
LAMBDA_PRINTED = (
    "lambda = pm*sqrt(1/2*((1/(E*(1 + C*s)) + 1/(kappa*G))*rho*s^2 + pm*(rho^2*s^4/(E^2*(1 + C*s)^2)"
    " - 2*rho^2*s^4/(E*(1 + C*s)*kappa*G) + rho^2*s^4/(kappa^2*G^2) - 4*rho*A*s^2/(E*I*(1 + C*s)))))"
)
LAMBDA = LAMBDA_PRINTED.replace("pm*(rho", "pm*sqrt(rho")
SHEAR_TERM = "a1{j} = (m*s^2 {sign} rho*A*s^2/lambda_{i})*exp({minus}lambda_{i}*L)"
MOMENT_TERM = (
    "a2{j} = {minus}(lambda_{i} - rho*s^2/(kappa*G*lambda_{i}))*(I_c*s^2 {sign} E*I*(1 + C*s)*lambda_{i})"
    "*exp({minus}lambda_{i}*L)"
)
HUB_TERM = (
    "a4{j} = {minus}(I_h*s^2*(lambda_{i} - rho*s^2/(kappa*G*lambda_{i}))"
    " {other} E*I*(1 + C*s)*(lambda_{i}^2 - rho*s^2/(kappa*G)))"
)
WAVES = (
    {"j": 1, "i": 1, "sign": "+", "other": "-", "minus": ""},
    {"j": 2, "i": 2, "sign": "+", "other": "-", "minus": ""},
    {"j": 3, "i": 1, "sign": "-", "other": "+", "minus": "-"},
    {"j": 4, "i": 2, "sign": "-", "other": "+", "minus": "-"},
)
ENTRIES = "; ".join(row.format(**wave) for row in (SHEAR_TERM, MOMENT_TERM, "a3{j} = 1", HUB_TERM) for wave in WAVES)
ENTRY_NAMES = tuple(tuple(f"a{i}{j}" for j in (1, 2, 3, 4)) for i in (1, 2, 3, 4))
RIGHT_SIDE = ("0", "0", "0", "U")
BEAM_DIGITS = 50  # of both roads; RESIDUAL_NOISE leaves half of them to rounding
BEAM_NAMES = ("rho", "A", "L", "E", "I", "kappa", "G", "C", "m", "I_c", "I_h", "s")
BEAMS = (  # payload and damping, orders of one, so that no term hides; s on and off the axis
    (1.3, 0.7, 1.1, 2.9, 0.31, 0.83, 1.7, 0.013, 0.37, 0.053, 0.23, 0.9 + 2.3j),
    (2.1, 0.45, 0.8, 5.3, 0.12, 0.77, 2.2, 0.21, 0.0, 0.11, 0.61, 4.7j),
)
BeamNumbers = dict[str, Any]


def _columns_replaced(column: int) -> str:
    """The paper's determinant with the right side in one column (0: in none), rows parted by /."""
    rows = (
        " ".join(new if j == column else old for j, old in enumerate(row, start=1))
        for row, new in zip(ENTRY_NAMES, RIGHT_SIDE, strict=True)
    )
    return " / ".join(rows)


DETERMINANTS = "; ".join(
    f"{name} = |{_columns_replaced(column)}|"
    for column, name in enumerate(("Delta", "Delta_k1", "Delta_k2", "Delta_k3", "Delta_k4"))
)
STIFFNESS_PRINTED = "E*I"
STIFFNESS = "E*(1 + C*s)*I"


def waves_of(text: str) -> tuple[Expression, Expression]:
    """Y and Phi of (A.1) in k_i, x, Theta."""
    k = {symbol(f"Delta_k{i}"): symbol(f"k{i}") * symbol("Delta") for i in (1, 2, 3, 4)}
    found = sides(text)
    return found[parsed("Y")].subs(k), found[parsed("Phi")].subs(k)


def inserted(number: int, text: str, stiffness: str = STIFFNESS) -> Expression:
    """An equation (8)-(14) with the waves of a text, and E as it is in the appendix."""
    Y, Phi = waves_of(text)
    equation, values = difference(LAPLACE[number]).subs(symbol("E"), parsed(stiffness) / symbol("I")), {}
    for s in equation.free_symbols:
        found = jet_parts(s)
        if found and found[0] in ("Y", "Phi"):
            field, i, _, at = found
            place = {"": symbol("x"), "(0,s)": sp.Integer(0), "(L,s)": symbol("L")}[at]
            values[s] = sp.diff(Y if field == "Y" else Phi, symbol("x"), i).subs(symbol("x"), place)
    return equation.subs(values)


@cache
def wave_determinant() -> Expression:
    """Determinant of (8) and (9) for waves e^{lambda x}: a polynomial in lambda."""
    a, b, l = symbols("a b lambda_")
    waves = {
        **{symbol(f"Y{'_' * bool(i)}{'x' * i}"): a * l**i for i in range(3)},
        **{symbol(f"Phi{'_' * bool(i)}{'x' * i}"): b * l**i for i in range(3)},
        symbol("Theta"): sp.Integer(0),
    }
    rows = [difference(LAPLACE[n]).subs(symbol("E"), parsed(STIFFNESS) / symbol("I")).subs(waves) for n in (8, 9)]
    return sp.Poly(sp.Matrix([[sp.expand(row).coeff(c) for c in (a, b)] for row in rows]).det(), l)


@cache
def relation() -> Expression:
    """The polynomial in lambda whose roots are those of the mended (A.2)."""
    square = next(iter(sides(LAMBDA).values())) ** 2
    return sp.expand(sp.Mul(*(symbol("lambda_") ** 2 - square.subs(symbol("pm"), sign) for sign in (1, -1))))


def solves(text: str, stiffness: str = STIFFNESS) -> str:
    """What the waves of a text leave in (8) and (9), for lambda as in the mended (A.2)."""
    left = []
    for number in (8, 9):
        residual = sp.expand(inserted(number, text, stiffness))
        ks = symbols("k1 k2 k3 k4")
        left.append(residual.subs(dict.fromkeys(ks, 0)))
        for j, k in enumerate(ks):
            l = symbols("lambda_1 lambda_2")[j % 2]
            coefficient = sp.expand(residual.coeff(k) * sp.exp((1 if j > 1 else -1) * l * symbol("x")))
            top = sp.expand(coefficient * l)
            on_waves = relation().subs(symbol("lambda_"), l)
            rest = sp.rem(sp.numer(sp.together(top)), on_waves, l)
            left.append(rest * k)
    return remainder(*left)


def is_dispersion(text: str) -> str:
    """(A.2): its dimensions, and lambda^2 in the determinant of (8) and (9)."""
    right = next(iter(sides(text).values()))
    square = sp.expand(right**2)
    polynomial = sum(c * square ** (n // 2) for (n,), c in wave_determinant().terms())
    signs = [sp.expand(sp.numer(sp.together(sp.expand(polynomial.subs(symbol("pm"), sign))))) for sign in (1, -1)]
    units = mismatch(right, PAPER_UNITS)
    root = "0" if signs == [0, 0] else "lambda is no root of the determinant of (8), (9)"
    return "; ".join(each for each in (units, root) if each != "0") or "0"


def conditions() -> list[Expression]:
    """(11), (12), (13), (10) with the waves, Theta = Psi(0) by (14): zero, zero, zero, U."""
    theta = sp.solve(inserted(14, WAVES_MENDED), symbol("Theta"))[0]
    rows = [inserted(number, WAVES_MENDED) for number in (11, 12, 13, 10)]
    return [sp.expand(row.subs(symbol("Theta"), theta)) for row in rows]


def are_entries(text: str) -> str:
    """a_ij: against the coefficients of k_j in the end conditions, and U against what is left there."""
    given, left = sides(text), []
    for i, row in enumerate(conditions(), start=1):
        left.append(row.subs(dict.fromkeys(symbols("k1 k2 k3 k4"), 0)) + (symbol("U") if i == 4 else 0))
        for j in (1, 2, 3, 4):
            gap = sp.together(sp.expand(row.coeff(symbol(f"k{j}")) - given[symbol(f"a{i}{j}")]))
            left.append(sp.expand(sp.numer(gap)))
    return remainder(*left)


def determinants(text: str) -> dict[str, Expression]:
    """Delta and Delta_k_i of a text, as polynomials in a_ij and U."""
    pairs = (clause.split(" = ") for clause in clauses(text))
    return {name: determinant(rows).det(method="berkowitz") for name, rows in pairs}


def are_determinants(text: str) -> str:
    """Delta, Delta_k_i: k_i = Delta_k_i/Delta solves a k = (0, 0, 0, U) for any a_ij."""
    d = determinants(text)
    rows = zip(ENTRY_NAMES, RIGHT_SIDE, strict=True)
    left = []
    for row, right in rows:
        products = (parsed(a) * d[f"Delta_k{j}"] for j, a in enumerate(row, start=1))
        left.append(sum(products, sp.Integer(0)) - parsed(right) * d["Delta"])
    return remainder(*left)


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


APPENDIX_CLAIMS = (  # the waves, their numbers, the ends' matrix and Cramer's rule; last, all of it in numbers
    Claim(
        equation="(A.1)",
        printed=WAVES_PRINTED,
        corrected=WAVES_MENDED,
        check=solves,
        evidence="Inserted in (8) and (9), each k_i by itself, with lambda of the mended (A.2) (SymPy). The minus "
        "signs before k_3, k_4 belong in Phi only, and a_31 = ... = a_34 = 1, which is W(0) = 0, has them so "
        "too. k_i, used in Phi, is defined nowhere: Delta k_i/Delta. The text calls this the solution to (8), (9) "
        "and (10); it is that of (8)-(14).",
    ),
    Claim(
        equation="(A.2)",
        printed=LAMBDA_PRINTED,
        corrected=LAMBDA,
        check=is_dispersion,
        evidence="Dimensions, and lambda in the determinant of (8) and (9), both signs (SymPy): the inner bracket "
        "needs its square root; all else is right.",
        doubt="Undecided whether the paper or the transcript lost it: a brace is unmatched just there, so that "
        "either the print reads [...]^{1/2} inside, or it has no inner root and is wrong.",
    ),
    Claim(
        equation="a_ij",
        printed=ENTRIES,
        check=are_entries,
        evidence="All sixteen are the coefficients of k_j in (11), (12), (13), (10) with the mended (A.1), "
        "Theta = Psi(0) by (14), and E (1 + C s); U stands alone in row 4 (SymPy).",
    ),
    Claim(
        equation="Delta, Delta k_i",
        printed=DETERMINANTS,
        check=are_determinants,
        evidence="Cramer's rule for any a_ij (SymPy, polynomial identity): sum_j a_ij Delta k_j = (0, 0, 0, U) "
        "Delta. The brackets are read as the bars of determinants.",
    ),
    Claim(
        equation="appendix as a whole",
        printed=f"{WAVES_PRINTED}; {LAMBDA_PRINTED}",
        corrected=f"{WAVES_MENDED}; {LAMBDA}",
        check=disagreement,
        evidence="Hub angle, tip displacement, tip rotation and root moment for a unit torque by (A.1), (A.2), the "
        f"a_ij and Cramer's rule, against the exponential of the beam's state matrix, {BEAM_DIGITS} digits, with "
        "payload and damping: largest relative difference (mpmath).",
    ),
)

DAMPING_CLAIM = Claim(  # C, which (1)-(14) lack
    equation="(1)-(14): damping C",
    printed=STIFFNESS_PRINTED,
    corrected=STIFFNESS,
    check=partial(solves, WAVES_MENDED),
    evidence="The waves of the appendix, mended, in (8) and (9) with this bending stiffness (SymPy): with C they "
    "solve (9) only if E I carries 1 + C s, in (2), (3), (5) 1 + C d/dt. Without damping (1)-(14) stand as they "
    "are: C appears in the appendix and Table 1 only.",
)
