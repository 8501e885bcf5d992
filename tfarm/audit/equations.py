"""Equations (1)-(14), and the appendix that solves them.

(1)-(14) are compared with Hamilton's principle, and with the Laplace transform of (1)-(7).  Of the appendix: its waves
in (8)-(14), its dispersion relation, its a_ij and Cramer's rule, and, as a whole in numbers, the matrix exponential of
the same beam's state.
"""

import re
from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

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
    integral,
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


def energy_density() -> Expression:
    """Return kinetic minus potential energy a length, from w = y + x theta and psi = phi + theta."""
    return parse_expression(
        "rho*A/2*(y_t + x*theta_t)^2 + rho*I/2*(phi_t + theta_t)^2 - E*I/2*phi_x^2 - kappa*G*A/2*(y_x - phi)^2"
    )


def payload_energy() -> Expression:
    """Return the kinetic energy of the payload."""
    return parse_expression("m/2*(y_t(L,t) + L*theta_t)^2 + I_c/2*(phi_t(L,t) + theta_t)^2")


def equation(number: int) -> Expression:
    """Return left minus right side of one of (1)-(14), as corrected."""
    return difference(formula_of(f"({number})"))


def along_arm(field: str, text: str) -> str:
    """Compare (1), (2) with the Euler-Lagrange equation of y or phi along the arm."""
    l = energy_density()
    rate = jet(field, t=1)
    slope = jet(field, x=1)
    euler = d_dt(sp.diff(l, rate)) + d_dx(sp.diff(l, slope)) - sp.diff(l, jet(field))
    return remainder(euler - difference(text))


def at_tip(field: str, text: str) -> str:
    """Compare (4), (5) with the natural end condition, payload's inertia against the density's flux."""
    inertia = d_dt(sp.diff(payload_energy(), jet(field, t=1, at=AT_TIP)))
    flux = sp.diff(energy_density(), jet(field, x=1))
    return remainder(at_running_point(inertia - difference(text)) - flux)


def at_hub(text: str) -> str:
    """Compare (3) with the balance of the whole arm's angular momentum, which has u as its only source."""
    theta_t = jet("theta", t=1)
    of_link = integral(sp.diff(energy_density(), theta_t))
    of_payload = sp.diff(payload_energy(), theta_t)
    inside, outside = integral_parts(d_dt(of_link + of_payload))
    rate = integral(sp.expand(inside.subs(accelerations()))) + outside.subs(accelerations(AT_TIP))
    of_hub = symbol("I_h") * jet("theta", t=2)
    return balance_residual(of_hub - symbol("u") + rate - difference(text))


def at_clamp(field: str, text: str) -> str:
    """Return the power of the clamp's force or moment on a motion that (6) or (7) leaves free."""
    motion = jet(field, t=1, at=AT_ROOT)
    reaction = -sp.diff(energy_density(), jet(field, x=1))
    solutions = sp.solve(d_dt(difference(text)), motion)
    if solutions:
        motion = solutions[0]
    return remainder(reaction * motion)


def is_transform(number: int, text: str) -> str:
    """Compare (8)-(14) with the Laplace transform of (1)-(7), which are linear, from rest."""
    f = equation(number - 7)
    names = {"y": "Y", "phi": "Phi", "theta": "Theta"}
    images = {symbol("u"): symbol("U")}
    for s, field, i, j, at in jets(f):
        images[s] = symbol("s") ** j * jet(names[field], i, 0, at.replace(",t)", ",s)"))
    return remainder(f.subs(images, simultaneous=True) - difference(text))


@cache
def accelerations(at: str = "") -> dict[Expression, Expression]:
    """Return the accelerations of y and phi by (1), (2) along the arm or (4), (5) at the tip, or of theta by (3)."""
    fields = ("theta",) if at == AT_ROOT else ("y", "phi")
    numbers = {"": (1, 2), AT_TIP: (4, 5), AT_ROOT: (3,)}[at]
    found = sp.solve([equation(n) for n in numbers], [jet(each, t=2, at=at) for each in fields])
    return dict(found)


STIFFNESS = formula_of("(1)-(14): damping C")


def waves_of(text: str) -> dict[str, Expression]:
    """Return Y and Phi of (A.1) in k_i, x, Theta."""
    k = {symbol(f"Delta_k{i}"): symbol(f"k{i}") * symbol("Delta") for i in (1, 2, 3, 4)}
    formulas = sides(text)
    return {name: formulas[symbol(name)].subs(k) for name in ("Y", "Phi")}


def insert_waves(number: int, waves: dict[str, Expression], stiffness: str = STIFFNESS) -> Expression:
    """Return an equation (8)-(14) with Y and Phi of `waves`, and E as it is in the appendix."""
    places = {"": x, "(0,s)": sp.Integer(0), "(L,s)": L}
    read = equation(number).subs(symbol("E"), parse_expression(stiffness) / symbol("I"))
    values: dict[Expression, Expression] = {}
    for s, field, i, _, at in jets(read):
        if field in waves:
            values[s] = sp.diff(waves[field], x, i).subs(x, places[at])
    return read.subs(values)


@cache
def wave_determinant() -> Expression:
    """Return the determinant of (8) and (9) for waves e^{lambda x}: a polynomial in lambda."""
    a, b, l = symbols("a b lambda_")
    wave = sp.exp(l * x)
    rows = []
    for number in (8, 9):
        residual = insert_waves(number, {"Y": a * wave, "Phi": b * wave}).subs(symbol("Theta"), 0)
        row = sp.expand(residual / wave)
        rows.append([row.coeff(a), row.coeff(b)])
    return sp.Poly(sp.Matrix(rows).det(), l)


@cache
def relation() -> Expression:
    """Return the polynomial in lambda whose roots are those of the corrected (A.2)."""
    l = symbol("lambda_")
    plus, minus = branches(sides(formula_of("(A.2)"))[l] ** 2)
    return sp.expand((l**2 - plus) * (l**2 - minus))


def branches(f: Expression) -> tuple[Expression, Expression]:
    """Return an expression with + and with - for its double sign."""
    return f.subs(symbol("pm"), 1), f.subs(symbol("pm"), -1)


def solves(text: str, stiffness: str = STIFFNESS) -> str:
    """Return the residuals of (8) and (9) with the waves of a text, for lambda as in the corrected (A.2)."""
    left = []
    ks = symbols("k1 k2 k3 k4")
    for number in (8, 9):
        residual = sp.expand(insert_waves(number, waves_of(text), stiffness))
        left.append(residual.subs(dict.fromkeys(ks, 0)))
        for k, sign, l in zip(ks, (-1, -1, 1, 1), symbols("lambda_1 lambda_2") * 2, strict=True):
            top = sp.expand(sp.expand(residual.coeff(k) * sp.exp(sign * l * x)) * l)
            polynomial = sp.numer(sp.together(top))
            left.append(sp.rem(polynomial, relation().subs(symbol("lambda_"), l), l) * k)
    return remainder(*left)


def is_dispersion(text: str) -> str:
    """Check the dimensions of (A.2), and its lambda^2 in the determinant of (8) and (9)."""
    right = next(iter(sides(text).values()))
    square = sp.expand(right**2)
    polynomial = sum(c * square ** (n // 2) for (n,), c in wave_determinant().terms())
    root = "0"
    if any(numerator_of(sp.expand(each)) != 0 for each in branches(polynomial)):
        root = "lambda is no root of the determinant of (8), (9)"
    return residual_text([mismatch(right, PAPER_UNITS), root])


def numerator_of(f: Expression) -> Expression:
    """Return the numerator of an expression over one denominator, multiplied out."""
    return sp.expand(sp.numer(sp.together(f)))


def are_entries(text: str) -> str:
    """Compare a_ij with the coefficients of k_j in (11), (12), (13), (10), and U with the rest there.

    Theta is Psi(0) by (14).
    """
    formulas = sides(text)
    waves = waves_of(formula_of("(A.1)"))
    left = []
    theta = sp.solve(insert_waves(14, waves), symbol("Theta"))[0]
    for i, number in enumerate((11, 12, 13, 10), start=1):
        row = sp.expand(insert_waves(number, waves).subs(symbol("Theta"), theta))
        rest = row.subs(dict.fromkeys(symbols("k1 k2 k3 k4"), 0))
        if number == 10:
            rest += symbol("U")
        left.append(rest)
        for j in (1, 2, 3, 4):
            gap = row.coeff(symbol(f"k{j}")) - formulas[symbol(f"a{i}{j}")]
            left.append(numerator_of(sp.expand(gap)))
    return remainder(*left)


def determinants(text: str) -> dict[str, Expression]:
    """Return Delta and Delta_k_i of a text, as polynomials in a_ij and U."""
    pairs = (clause.split(" = ") for clause in clauses(text))
    return {name: matrix_of_text(rows).det(method="berkowitz") for name, rows in pairs}


def are_determinants(text: str) -> str:
    """Check that k_i = Delta_k_i/Delta solves a k = (0, 0, 0, U) for any a_ij."""
    d = determinants(text)
    a = sp.Matrix(4, 4, lambda i, j: symbol(f"a{i + 1}{j + 1}"))
    k = sp.Matrix([d[f"Delta_k{j}"] for j in (1, 2, 3, 4)])
    return remainder(*(a * k - sp.Matrix([0, 0, 0, symbol("U")]) * d["Delta"]))


class Beam(NamedTuple):
    """Numbers of an arm by the paper's letters, and s."""

    rho: Any
    A: Any
    L: Any
    E: Any
    I: Any
    kappa: Any
    G: Any
    C: Any
    m: Any
    I_c: Any
    I_h: Any
    s: Any


def disagreement(text: str) -> str:
    """Return the largest relative difference of hub angle, tip motion and root moment between the two methods."""
    # payload and damping, orders of one, so that no term hides; s on and off the axis
    beams = (
        "1.3 0.7 1.1 2.9 0.31 0.83 1.7 0.013 0.37 0.053 0.23 0.9+2.3j",
        "2.1 0.45 0.8 5.3 0.12 0.77 2.2 0.21 0.0 0.11 0.61 4.7j",
    )
    differences = []
    # digits of both methods; what counts as zero leaves half of them to rounding
    with mpmath.workdps(50):
        for numbers in beams:
            beam = Beam(*map(mpmath.mpmathify, numbers.split()))
            pairs = zip(by_appendix(text, beam), by_transition(beam), strict=True)
            differences += [abs(one / other - 1) for one, other in pairs]
        return str(mpmath.nstr(max(differences), 2))


def by_transition(beam: Beam) -> list[Any]:
    """Return theta, w(L), psi(L), M(0) for a unit torque, from exp(A(s) L) of the state (w, psi, Q, M)."""
    rho, A, length, E, I, kappa, G, C, m, I_c, I_h, s = beam
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


def by_appendix(text: str, beam: Beam) -> list[Any]:
    """Return the same by (A.1), (A.2) of a text, the a_ij and Cramer's rule, to the working precision of mpmath."""
    values = {symbol(name): sp.sympify(value) for name, value in beam._asdict().items()}
    values[symbol("U")] = sp.Integer(1)

    def number(f: Expression) -> Expression:
        return f.evalf(mpmath.mp.dps, subs=values)

    squares = branches(sp.expand((sides(text)[symbol("lambda_")] / symbol("pm")) ** 2))
    lambdas = [number(sp.sqrt(square)) for square in squares]
    values |= zip(symbols("lambda_1 lambda_2"), lambdas, strict=True)
    values |= {name: number(right) for name, right in sides(formula_of("a_ij")).items()}
    Delta, *Delta_k = map(number, determinants(formula_of("Delta, Delta k_i")).values())
    values |= {symbol(f"k{i}"): each / Delta for i, each in enumerate(Delta_k, start=1)}
    Y, Phi = waves_of(text).values()
    Theta = symbol("Theta")
    # by (14)
    at_root = sp.solve(Phi.subs(x, 0), Theta)[0]
    psi = (Phi + Theta).subs(Theta, at_root)
    w = (Y + x * Theta).subs(Theta, at_root)
    moment = parse_expression(STIFFNESS) * sp.diff(psi, x)
    ends = (psi.subs(x, 0), w.subs(x, L), psi.subs(x, L), moment.subs(x, 0))
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
    "(1)-(14): damping C": partial(solves, formula_of("(A.1)")),
    "(A.1)": solves,
    "(A.2)": is_dispersion,
    "a_ij": are_entries,
    "Delta, Delta k_i": are_determinants,
    "appendix as a whole": disagreement,
}
