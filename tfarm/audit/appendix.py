"""The appendix: its waves in (8)-(14), its dispersion relation, its a_ij, and Cramer's rule."""

from __future__ import annotations

from functools import cache

import sympy as sp

from .dimensions import PAPER_UNITS, mismatch
from .formulas import Expression, clauses, difference, jet_parts, parsed, remainder, sides, symbol, symbols
from .motion import LAPLACE

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
    found = {}
    for clause in clauses(text):
        name, rows = clause.split(" = ")
        entries = [[parsed(entry) for entry in row.split()] for row in rows.strip("|").split(" / ")]
        found[name] = sp.Matrix(entries).det(method="berkowitz")
    return found


def are_determinants(text: str) -> str:
    """Delta, Delta_k_i: k_i = Delta_k_i/Delta solves a k = (0, 0, 0, U) for any a_ij."""
    d = determinants(text)
    rows = zip(ENTRY_NAMES, RIGHT_SIDE, strict=True)
    left = []
    for row, right in rows:
        products = (parsed(a) * d[f"Delta_k{j}"] for j, a in enumerate(row, start=1))
        left.append(sum(products, sp.Integer(0)) - parsed(right) * d["Delta"])
    return remainder(*left)
