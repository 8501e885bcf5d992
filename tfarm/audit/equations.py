"""Equations (1)-(14), and the appendix that solves them.

(1)-(14) are compared with Hamilton's principle, and with the Laplace transform of (1)-(7).  Of the appendix: its waves
in (8)-(14), its dispersion relation, its a_ij and Cramer's rule, and, as a whole in numbers, the matrix exponential of
the same beam's state.
"""

import re
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import mpmath
import sympy as sp

from tfarm.audit.formulas import (
    AT_ROOT,
    AT_TIP,
    PAPER_UNITS,
    Expression,
    L,
    at_running_point,
    balance_residual,
    clauses,
    d_dt,
    d_dx,
    difference,
    integral_parts,
    jet,
    jets,
    matrix_of_text,
    mismatch,
    parse_expression,
    remainder,
    residual_text,
    sides,
    symbol,
    symbols,
    x,
)
from tfarm.audit.rows import formula_of

DENSITY = (  # kinetic minus potential energy a length, from w = y + x theta and psi = phi + theta
    "rho*A/2*(y_t + x*theta_t)^2 + rho*I/2*(phi_t + theta_t)^2 - E*I/2*phi_x^2 - kappa*G*A/2*(y_x - phi)^2"
)
PAYLOAD = "m/2*(y_t(L,t) + L*theta_t)^2 + I_c/2*(phi_t(L,t) + theta_t)^2"


def equation(number: int) -> Expression:
    """Left minus right side of one of (1)-(14), as corrected."""
    return difference(formula_of(f"({number})"))


def along_arm(field: str, text: str) -> str:
    """(1), (2): against the Euler-Lagrange equation of y or phi along the arm."""
    l = parse_expression(DENSITY)
    rate = jet(field, t=1)
    slope = jet(field, x=1)
    euler = d_dt(sp.diff(l, rate)) + d_dx(sp.diff(l, slope)) - sp.diff(l, jet(field))
    return remainder(euler - difference(text))


def at_tip(field: str, text: str) -> str:
    """(4), (5): against the natural end condition, payload's inertia against the density's flux."""
    inertia = d_dt(sp.diff(parse_expression(PAYLOAD), jet(field, t=1, at=AT_TIP)))
    return remainder(
        at_running_point(inertia - difference(text)) - sp.diff(parse_expression(DENSITY), jet(field, x=1))
    )


def at_hub(text: str) -> str:
    """(3): against the balance of the whole arm's angular momentum, which has u as its only source."""
    theta_t = jet("theta", t=1)
    momentum = sp.Function("integral")(sp.diff(parse_expression(DENSITY), theta_t)) + sp.diff(
        parse_expression(PAYLOAD), theta_t
    )
    inside, outside = integral_parts(d_dt(momentum))
    of_link = sp.Function("integral")(sp.expand(inside.subs(accelerations()))) + outside.subs(
        accelerations(AT_TIP)
    )
    return balance_residual(symbol("I_h") * jet("theta", t=2) - symbol("u") + of_link - difference(text))


def at_clamp(field: str, text: str) -> str:
    """(6), (7): what the clamp would do by its force (or moment) on what the condition leaves free."""
    free = jet(field, t=1, at=AT_ROOT)
    reaction = -sp.diff(parse_expression(DENSITY), jet(field, x=1))
    solved = sp.solve(d_dt(difference(text)), free)
    return remainder(reaction * (solved[0] if solved else free))


def is_transform(number: int, text: str) -> str:
    """(8)-(14): against the Laplace transform of (1)-(7), which are linear, from rest."""
    f = equation(number - 7)
    names = {"y": "Y", "phi": "Phi", "theta": "Theta"}
    images = {
        s: symbol("s") ** j * jet(names[field], i, 0, at.replace(",t)", ",s)"))
        for s, field, i, j, at in jets(f)
    }
    return remainder(f.subs(images | {symbol("u"): symbol("U")}, simultaneous=True) - difference(text))


@cache
def accelerations(at: str = "") -> dict[Expression, Expression]:
    """Those of y and phi by (1), (2) along the arm, or by (4), (5) at the tip; of the hub that of theta by (3)."""
    fields, numbers = {"": ("y phi", (1, 2)), AT_TIP: ("y phi", (4, 5)), AT_ROOT: ("theta", (3,))}[at]
    found = sp.solve([equation(n) for n in numbers], [jet(each, t=2, at=at) for each in fields.split()])
    return dict(found)


WAVES = formula_of("(A.1)")
# of both methods; RESIDUAL_NOISE leaves half of them to rounding
BEAM_DIGITS = 50
BEAM_NAMES = ["rho", "A", "L", "E", "I", "kappa", "G", "C", "m", "I_c", "I_h", "s"]
BEAMS = (  # payload and damping, orders of one, so that no term hides; s on and off the axis
    "1.3 0.7 1.1 2.9 0.31 0.83 1.7 0.013 0.37 0.053 0.23 0.9+2.3j",
    "2.1 0.45 0.8 5.3 0.12 0.77 2.2 0.21 0.0 0.11 0.61 4.7j",
)
STIFFNESS = formula_of("(1)-(14): damping C")


def waves_of(text: str) -> dict[str, Expression]:
    """Y and Phi of (A.1) in k_i, x, Theta."""
    k = {symbol(f"Delta_k{i}"): symbol(f"k{i}") * symbol("Delta") for i in (1, 2, 3, 4)}
    return {name: sides(text)[symbol(name)].subs(k) for name in ("Y", "Phi")}


def inserted(number: int, waves: dict[str, Expression], stiffness: str = STIFFNESS) -> Expression:
    """An equation (8)-(14) with Y and Phi, and E as it is in the appendix."""
    places = {"": x, "(0,s)": sp.Integer(0), "(L,s)": L}
    read = equation(number).subs(symbol("E"), parse_expression(stiffness) / symbol("I"))
    fields = (each for each in jets(read) if each[1] in waves)
    return read.subs({s: sp.diff(waves[field], x, i).subs(x, places[at]) for s, field, i, _, at in fields})


@cache
def wave_determinant() -> Expression:
    """Determinant of (8) and (9) for waves e^{lambda x}: a polynomial in lambda."""
    a, b, l = symbols("a b lambda_")
    wave = sp.exp(l * x)
    rows = [inserted(n, {"Y": a * wave, "Phi": b * wave}).subs(symbol("Theta"), 0) / wave for n in (8, 9)]
    return sp.Poly(sp.Matrix([[sp.expand(row).coeff(c) for c in (a, b)] for row in rows]).det(), l)


@cache
def relation() -> Expression:
    """The polynomial in lambda whose roots are those of the corrected (A.2)."""
    square = next(iter(sides(formula_of("(A.2)")).values())) ** 2
    return sp.expand(sp.Mul(*(symbol("lambda_") ** 2 - square.subs(symbol("pm"), sign) for sign in (1, -1))))


def solves(text: str, stiffness: str = STIFFNESS) -> str:
    """The residuals of (8) and (9) with the waves of a text, for lambda as in the corrected (A.2)."""
    left = []
    ks = symbols("k1 k2 k3 k4")
    for number in (8, 9):
        residual = sp.expand(inserted(number, waves_of(text), stiffness))
        left.append(residual.subs(dict.fromkeys(ks, 0)))
        for k, sign, l in zip(ks, (-1, -1, 1, 1), symbols("lambda_1 lambda_2") * 2, strict=True):
            top = sp.expand(sp.expand(residual.coeff(k) * sp.exp(sign * l * x)) * l)
            left.append(sp.rem(sp.numer(sp.together(top)), relation().subs(symbol("lambda_"), l), l) * k)
    return remainder(*left)


def is_dispersion(text: str) -> str:
    """(A.2): its dimensions, and lambda^2 in the determinant of (8) and (9)."""
    right = next(iter(sides(text).values()))
    square = sp.expand(right**2)
    polynomial = sum(c * square ** (n // 2) for (n,), c in wave_determinant().terms())
    signs = [
        sp.expand(sp.numer(sp.together(sp.expand(polynomial.subs(symbol("pm"), sign))))) for sign in (1, -1)
    ]
    root = "0" if signs == [0, 0] else "lambda is no root of the determinant of (8), (9)"
    return residual_text([mismatch(right, PAPER_UNITS), root])


def are_entries(text: str) -> str:
    """a_ij: against the coefficients of k_j in (11), (12), (13), (10), and U against the rest there.

    Theta is Psi(0) by (14).
    """
    given = sides(text)
    waves = waves_of(WAVES)
    left = []
    theta = sp.solve(inserted(14, waves), symbol("Theta"))[0]
    for i, number in enumerate((11, 12, 13, 10), start=1):
        row = sp.expand(inserted(number, waves).subs(symbol("Theta"), theta))
        left.append(row.subs(dict.fromkeys(symbols("k1 k2 k3 k4"), 0)) + (symbol("U") if i == 4 else 0))
        for j in (1, 2, 3, 4):
            gap = sp.together(sp.expand(row.coeff(symbol(f"k{j}")) - given[symbol(f"a{i}{j}")]))
            left.append(sp.expand(sp.numer(gap)))
    return remainder(*left)


def determinants(text: str) -> dict[str, Expression]:
    """Delta and Delta_k_i of a text, as polynomials in a_ij and U."""
    pairs = (clause.split(" = ") for clause in clauses(text))
    return {name: matrix_of_text(rows).det(method="berkowitz") for name, rows in pairs}


def are_determinants(text: str) -> str:
    """Delta, Delta_k_i: k_i = Delta_k_i/Delta solves a k = (0, 0, 0, U) for any a_ij."""
    d = determinants(text)
    a = sp.Matrix(4, 4, lambda i, j: symbol(f"a{i + 1}{j + 1}"))
    k = sp.Matrix([d[f"Delta_k{j}"] for j in (1, 2, 3, 4)])
    return remainder(*(a * k - sp.Matrix([0, 0, 0, symbol("U")]) * d["Delta"]))


def disagreement(text: str) -> str:
    """Largest relative difference of hub angle, tip motion and root moment between the two methods."""
    with mpmath.workdps(BEAM_DIGITS):
        beams = [dict(zip(BEAM_NAMES, map(mpmath.mpmathify, beam.split()), strict=True)) for beam in BEAMS]
        pairs = (pair for v in beams for pair in zip(by_appendix(text, v), by_transition(v), strict=True))
        return str(mpmath.nstr(max(abs(one / other - 1) for one, other in pairs), 2))


def by_transition(v: dict[str, Any]) -> list[Any]:
    """theta, w(L), psi(L), M(0) for a unit torque, from exp(A(s) L) of the state (w, psi, Q, M)."""
    rho, A, length, E, I, kappa, G, C, m, I_c, I_h, s = (v[name] for name in BEAM_NAMES)
    s2 = s**2
    EI = E * (1 + C * s) * I
    rows = [
        [0, 1, 1 / (kappa * G * A), 0],
        [0, 0, 0, 1 / EI],
        [rho * A * s2, 0, 0, 0],
        [0, rho * I * s2, -1, 0],
    ]
    T = mpmath.expm(mpmath.matrix(rows) * length)
    free = mpmath.matrix([[0, 0], [1, 0], [0, 1], [I_h * s2, 0]])
    torque = mpmath.matrix([0, 0, 0, -1])
    tip = mpmath.matrix([[m * s2, 0, 1, 0], [0, I_c * s2, 0, 1]]) * T
    # theta and Q(0)
    found = mpmath.lu_solve(tip * free, -tip * torque)
    w, psi, _, _ = T * (free * found + torque)
    return [found[0], w, psi, I_h * s2 * found[0] - 1]


def by_appendix(text: str, v: dict[str, Any]) -> list[Any]:
    """The same by (A.1), (A.2) of a text, the a_ij and Cramer's rule."""
    values = {symbol(name): sp.sympify(value) for name, value in v.items()} | {symbol("U"): sp.Integer(1)}

    def number(f: Expression) -> Expression:
        return f.evalf(BEAM_DIGITS, subs=values)

    square = sp.expand((sides(text)[symbol("lambda_")] / symbol("pm")) ** 2)
    values |= {
        symbol(f"lambda_{i}"): number(sp.sqrt(square.subs(symbol("pm"), sign)))
        for i, sign in ((1, 1), (2, -1))
    }
    values |= {name: number(right) for name, right in sides(formula_of("a_ij")).items()}
    Delta, *Delta_k = map(number, determinants(formula_of("Delta, Delta k_i")).values())
    values |= {symbol(f"k{i}"): each / Delta for i, each in enumerate(Delta_k, start=1)}
    Y, Phi = waves_of(text).values()
    Theta = symbol("Theta")
    # by (14)
    at_root = sp.solve(Phi.subs(x, 0), Theta)[0]
    psi, w = (motion.subs(Theta, at_root) for motion in (Phi + Theta, Y + x * Theta))
    ends = (
        psi.subs(x, 0),
        w.subs(x, L),
        psi.subs(x, L),
        (parse_expression(STIFFNESS) * sp.diff(psi, x)).subs(x, 0),
    )
    return [mpmath.mpmathify(number(f)) for f in ends]


CHECKS: dict[str, Callable[[str], str]] = {
    "(1)": partial(along_arm, "y"),
    "(2)": partial(along_arm, "phi"),
    "(3)": at_hub,
    "(4)": partial(at_tip, "y"),
    "(5)": partial(at_tip, "phi"),
    "(6)": partial(at_clamp, "y"),
    "(7)": partial(at_clamp, "phi"),
    **{f"({number})": partial(is_transform, number) for number in range(8, 15)},
    "(3), (10), (18), (19): order of arguments": lambda text: str(len(re.findall(r"\([ts],", text))),
    "(1)-(14): damping C": partial(solves, WAVES),
    "(A.1)": solves,
    "(A.2)": is_dispersion,
    "a_ij": are_entries,
    "Delta, Delta k_i": are_determinants,
    "appendix as a whole": disagreement,
}
