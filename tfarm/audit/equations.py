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

from .formulas import (
    AT_ROOT,
    PAPER_UNITS,
    Expression,
    at_running_point,
    clauses,
    d_dt,
    d_dx,
    determinant,
    difference,
    jet,
    jets,
    mismatch,
    parsed,
    remainder,
    sides,
    symbol,
    symbols,
    unbalanced,
)
from .rows import formula_of

DENSITY = (  # kinetic minus potential energy a length, from w = y + x theta and psi = phi + theta
    "rho*A/2*(y_t + x*theta_t)^2 + rho*I/2*(phi_t + theta_t)^2 - E*I/2*phi_x^2 - kappa*G*A/2*(y_x - phi)^2"
)
PAYLOAD = "m/2*(y_t + x*theta_t)^2 + I_c/2*(phi_t + theta_t)^2"

TIME = {n: formula_of(f"({n})") for n in range(1, 8)}
LAPLACE = {n: formula_of(f"({n})") for n in range(8, 15)}


def euler(field: str) -> Expression:
    """Left side of the Euler-Lagrange equation of y or phi along the arm."""
    l, rate, slope = parsed(DENSITY), jet(field, t=1), jet(field, x=1)
    return d_dt(sp.diff(l, rate)) + d_dx(sp.diff(l, slope)) - sp.diff(l, jet(field))


def along_arm(field: str, text: str) -> str:
    """(1), (2): against the Euler-Lagrange equation."""
    return remainder(euler(field) - difference(text))


def at_tip(field: str, text: str) -> str:
    """(4), (5): against the natural end condition, payload's inertia against the density's flux."""
    natural = d_dt(sp.diff(parsed(PAYLOAD), jet(field, t=1))) - sp.diff(parsed(DENSITY), jet(field, x=1))
    return remainder(natural - at_running_point(difference(text)))


def at_hub(text: str) -> str:
    """(3): against the balance of the whole arm's angular momentum, which has u as its only source."""
    theta_t = jet("theta", t=1)
    accelerations = [jet("y", t=2), jet("phi", t=2)]
    solved = sp.solve([euler("y"), euler("phi")], accelerations)
    held = {field: d_dt(sp.diff(parsed(PAYLOAD), jet(field, t=1))) for field in ("y", "phi")}
    end = [held[field] - sp.diff(parsed(DENSITY), jet(field, x=1)) for field in ("y", "phi")]
    arm = sp.expand(d_dt(sp.diff(parsed(DENSITY), theta_t)).subs(solved))
    payload = sp.expand(d_dt(sp.diff(parsed(PAYLOAD), theta_t)).subs(sp.solve(end, accelerations)))
    balance = symbol("I_h") * jet("theta", t=2) - symbol("u") + sp.Function("integral")(arm) + payload
    return unbalanced(balance - difference(text))


def at_clamp(field: str, text: str) -> str:
    """(6), (7): what the clamp would do by its force (or moment) on what the condition leaves free."""
    free, reaction = jet(field, t=1, at=AT_ROOT), -sp.diff(parsed(DENSITY), jet(field, x=1))
    solved = sp.solve(d_dt(difference(text)), free)
    return remainder(reaction * (solved[0] if solved else free))


def transformed(f: Expression) -> Expression:
    """Laplace transform of a linear expression that starts from rest."""
    names = {"y": "Y", "phi": "Phi", "theta": "Theta"}
    images = {s: symbol("s") ** j * jet(names[field], i, 0, at.replace(",t)", ",s)")) for s, field, i, j, at in jets(f)}
    return f.subs(images | {symbol("u"): symbol("U")}, simultaneous=True)


def is_transform(number: int, text: str) -> str:
    """(8)-(14): against the transform of (1)-(7)."""
    return remainder(transformed(difference(TIME[number - 7])) - difference(text))


@cache
def solved_motion() -> tuple[dict[Expression, Expression], ...]:
    """The accelerations of (1)-(5): along the arm, at the tip, of the hub."""
    tip = sp.solve([difference(TIME[4]), difference(TIME[5])], [jet("y", t=2, at="(L,t)"), jet("phi", t=2, at="(L,t)")])
    arm = sp.solve([difference(TIME[1]), difference(TIME[2])], [jet("y", t=2), jet("phi", t=2)])
    hub = sp.solve([difference(TIME[3])], [jet("theta", t=2)])
    return arm, tip, hub


def places_after_time(text: str) -> str:
    """How many derivatives have their arguments in the order of time and place."""
    return str(len(re.findall(r"\([ts],", text)))


WAVES = formula_of("(A.1)")
ENTRIES = formula_of("a_ij")
ENTRY_NAMES = tuple(tuple(f"a{i}{j}" for j in (1, 2, 3, 4)) for i in (1, 2, 3, 4))
RIGHT_SIDE = ("0", "0", "0", "U")
BEAM_DIGITS = 50  # of both methods; RESIDUAL_NOISE leaves half of them to rounding
BEAM_NAMES = ("rho", "A", "L", "E", "I", "kappa", "G", "C", "m", "I_c", "I_h", "s")
BEAMS = (  # payload and damping, orders of one, so that no term hides; s on and off the axis
    (1.3, 0.7, 1.1, 2.9, 0.31, 0.83, 1.7, 0.013, 0.37, 0.053, 0.23, 0.9 + 2.3j),
    (2.1, 0.45, 0.8, 5.3, 0.12, 0.77, 2.2, 0.21, 0.0, 0.11, 0.61, 4.7j),
)


DETERMINANTS = formula_of("Delta, Delta k_i")
STIFFNESS = formula_of("(1)-(14): damping C")


def waves_of(text: str) -> tuple[Expression, Expression]:
    """Y and Phi of (A.1) in k_i, x, Theta."""
    k = {symbol(f"Delta_k{i}"): symbol(f"k{i}") * symbol("Delta") for i in (1, 2, 3, 4)}
    found = sides(text)
    return found[parsed("Y")].subs(k), found[parsed("Phi")].subs(k)


def inserted(number: int, text: str, stiffness: str = STIFFNESS) -> Expression:
    """An equation (8)-(14) with the waves of a text, and E as it is in the appendix."""
    waves = dict(zip(("Y", "Phi"), waves_of(text), strict=True))
    places = {"": symbol("x"), "(0,s)": sp.Integer(0), "(L,s)": symbol("L")}
    equation = difference(LAPLACE[number]).subs(symbol("E"), parsed(stiffness) / symbol("I"))
    fields = (each for each in jets(equation) if each[1] in waves)
    x = symbol("x")
    return equation.subs({s: sp.diff(waves[field], x, i).subs(x, places[at]) for s, field, i, _, at in fields})


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
    """The polynomial in lambda whose roots are those of the corrected (A.2)."""
    square = next(iter(sides(formula_of("(A.2)")).values())) ** 2
    return sp.expand(sp.Mul(*(symbol("lambda_") ** 2 - square.subs(symbol("pm"), sign) for sign in (1, -1))))


def solves(text: str, stiffness: str = STIFFNESS) -> str:
    """The residuals of (8) and (9) with the waves of a text, for lambda as in the corrected (A.2)."""
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
    theta = sp.solve(inserted(14, WAVES), symbol("Theta"))[0]
    rows = [inserted(number, WAVES) for number in (11, 12, 13, 10)]
    return [sp.expand(row.subs(symbol("Theta"), theta)) for row in rows]


def are_entries(text: str) -> str:
    """a_ij: against the coefficients of k_j in the end conditions, and U against the rest there."""
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
    """Largest relative difference of hub angle, tip motion and root moment between the two methods."""
    with mpmath.workdps(BEAM_DIGITS):
        values = [[mpmath.mpmathify(str(v).strip("()")) for v in point] for point in BEAMS]
        beams = [dict(zip(BEAM_NAMES, point, strict=True)) for point in values]
        pairs = (pair for v in beams for pair in zip(by_appendix(text, v), by_transition(v), strict=True))
        return str(mpmath.nstr(max(abs(one / other - 1) for one, other in pairs), 2))


def by_transition(v: dict[str, Any]) -> list[Any]:
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


def by_appendix(text: str, v: dict[str, Any]) -> list[Any]:
    """The same by (A.1), (A.2) of a text, the a_ij and Cramer's rule."""
    values = {symbol(name): sp.sympify(value) for name, value in v.items()} | {symbol("U"): sp.Integer(1)}

    def number(f: Expression) -> Expression:
        return f.evalf(BEAM_DIGITS, subs=values)

    square = sp.expand((sides(text)[symbol("lambda_")] / symbol("pm")) ** 2)
    values |= {symbol(f"lambda_{i}"): number(sp.sqrt(square.subs(symbol("pm"), sign))) for i, sign in ((1, 1), (2, -1))}
    values |= {name: number(right) for name, right in sides(ENTRIES).items()}
    Delta, *Delta_k = map(number, determinants(DETERMINANTS).values())
    values |= {symbol(f"k{i}"): each / Delta for i, each in enumerate(Delta_k, start=1)}
    Y, Phi = waves_of(text)
    x, L, Theta = symbols("x L Theta")
    at_root = sp.solve(Phi.subs(x, 0), Theta)[0]  # by (14)
    psi, w = (motion.subs(Theta, at_root) for motion in (Phi + Theta, Y + x * Theta))
    ends = (psi.subs(x, 0), w.subs(x, L), psi.subs(x, L), (parsed(STIFFNESS) * sp.diff(psi, x)).subs(x, 0))
    return [mpmath.mpmathify(number(f)) for f in ends]


CHECKS: dict[str, Callable[[str], str]] = {
    "(1)": partial(along_arm, "y"),
    "(2)": partial(along_arm, "phi"),
    "(3)": at_hub,
    "(4)": partial(at_tip, "y"),
    "(5)": partial(at_tip, "phi"),
    "(6)": partial(at_clamp, "y"),
    "(7)": partial(at_clamp, "phi"),
    **{f"({number})": partial(is_transform, number) for number in LAPLACE},
    "(3), (10), (18), (19): order of arguments": places_after_time,
    "(1)-(14): damping C": partial(solves, WAVES),
    "(A.1)": solves,
    "(A.2)": is_dispersion,
    "a_ij": are_entries,
    "Delta, Delta k_i": are_determinants,
    "appendix as a whole": disagreement,
}
