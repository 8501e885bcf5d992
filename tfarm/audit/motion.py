"""Equations (1)-(14): against Hamilton's principle, and against the Laplace transform of (1)-(7)."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache, partial

import sympy as sp

from .formulas import (
    AT_ROOT,
    Expression,
    at_running_point,
    d_dt,
    d_dx,
    difference,
    jet,
    jet_parts,
    parsed,
    remainder,
    symbol,
    unbalanced,
)
from .rows import Claim

DENSITY = (  # kinetic minus potential energy a length, from w = y + x theta and psi = phi + theta
    "rho*A/2*(y_t + x*theta_t)^2 + rho*I/2*(phi_t + theta_t)^2 - E*I/2*phi_x^2 - kappa*G*A/2*(y_x - phi)^2"
)
PAYLOAD = "m/2*(y_t + x*theta_t)^2 + I_c/2*(phi_t + theta_t)^2"

TIME = {
    1: "rho*A*(y_tt + x*theta_tt) - kappa*G*A*(y_xx - phi_x) = 0",
    2: "rho*I*(phi_tt + theta_tt) - E*I*phi_xx - kappa*G*A*(y_x - phi) = 0",
    3: "I_h*theta_tt = E*I*phi_x(t,0) + u",
    4: "m*(y_tt(L,t) + L*theta_tt) = -kappa*G*A*(y_x(L,t) - phi(L,t))",
    5: "I_c*(phi_tt(L,t) + theta_tt) = -E*I*phi_x(L,t)",
    6: "y(0,t) = 0",
    7: "phi(0,t) = 0",
}
LAPLACE_PRINTED = {
    8: "rho*A*s^2*(Y + x*Theta) - kappa*G*A*(Y_xx - Theta_x) = 0",
    9: "rho*I*s^2*(Phi + Theta) - E*I*Phi_xx - kappa*G*A*(Y_x - Phi) = 0",
    10: "I_h*s^2*Theta = E*I*Phi_x(s,0) + U",
    11: "m*s^2*(Y(L,s) + L*Theta) = -kappa*G*A*(y_x(L,s) - Phi(L,s))",
    12: "I_c*s^2*(Phi(L,s) + Theta) = -E*I*Phi_x(L,s)",
    13: "Y(0,s) = 0",
    14: "Phi(0,t) = 0",
}
LAPLACE = LAPLACE_PRINTED | {
    8: "rho*A*s^2*(Y + x*Theta) - kappa*G*A*(Y_xx - Phi_x) = 0",
    11: "m*s^2*(Y(L,s) + L*Theta) = -kappa*G*A*(Y_x(L,s) - Phi(L,s))",
    14: "Phi(0,s) = 0",
}
TRANSFORMED = {"y": "Y", "phi": "Phi", "theta": "Theta"}


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
    s, images = symbol("s"), {symbol("u"): symbol("U")}
    for each in f.free_symbols:
        found = jet_parts(each)
        if found:
            field, i, j, at = found
            images[each] = s**j * jet(TRANSFORMED[field], i, 0, at.replace(",t)", ",s)"))
    return f.subs(images, simultaneous=True)


def is_transform(number: int, text: str) -> str:
    """(8)-(14): against the transform of (1)-(7)."""
    return remainder(transformed(difference(TIME[number - 7])) - difference(text))


def misplaced(text: str) -> str:
    """How many arguments stand in another order than (x, t) or (x, s)."""
    return str(sum(first in "ts" for first in re.findall(r"\(([0Lxts]),", text)))


@cache
def solved_motion() -> tuple[dict[Expression, Expression], ...]:
    """The accelerations of (1)-(5): along the arm, at the tip, of the hub."""
    tip = sp.solve([difference(TIME[4]), difference(TIME[5])], [jet("y", t=2, at="(L,t)"), jet("phi", t=2, at="(L,t)")])
    arm = sp.solve([difference(TIME[1]), difference(TIME[2])], [jet("y", t=2), jet("phi", t=2)])
    hub = sp.solve([difference(TIME[3])], [jet("theta", t=2)])
    return arm, tip, hub


CHECKS: dict[int, Callable[[str], str]] = {number: partial(is_transform, number) for number in LAPLACE} | {
    1: partial(along_arm, "y"),
    2: partial(along_arm, "phi"),
    3: at_hub,
    4: partial(at_tip, "y"),
    5: partial(at_tip, "phi"),
    6: partial(at_clamp, "y"),
    7: partial(at_clamp, "phi"),
}

HAMILTON = "Derived afresh by Hamilton's principle from w = y + x theta, psi = phi + theta (SymPy), at C = 0: "
MOTION_EVIDENCE = {
    1: HAMILTON + "the Euler-Lagrange equation of y.",
    2: HAMILTON + "the Euler-Lagrange equation of phi.",
    3: "Angular momentum of hub, arm and payload about the axis has u as its only source (SymPy, C = 0, any length). "
    "The arguments (t, 0) are read as x = 0; their order is a row of its own.",
    4: HAMILTON + "the natural end condition of y.",
    5: HAMILTON + "the natural end condition of phi.",
    6: "With y(0, t) = 0 the clamp's force does no work (SymPy).",
    7: "With phi(0, t) = 0 the clamp's moment does no work beyond the hub's (SymPy).",
    8: "Laplace transform of (1), from rest (SymPy). Theta does not depend on x, so the print drops the shear of phi. "
    "Capital Theta for Phi could also be the scan's misreading; the formula is wrong as it stands either way.",
    11: "Laplace transform of (4) (SymPy): y(L, s) is no transform. A small y for Y could also be the scan's.",
    14: "Laplace transform of (7) (SymPy): the argument is s, not t.",
}


MOTION_CLAIMS = (  # (1)-(14), and the order of arguments
    *(Claim(equation=f"({n})", printed=TIME[n], check=CHECKS[n], evidence=MOTION_EVIDENCE[n]) for n in TIME),
    *(
        Claim(
            equation=f"({n})",
            printed=printed,
            corrected="" if LAPLACE[n] == printed else LAPLACE[n],
            check=CHECKS[n],
            evidence=MOTION_EVIDENCE.get(n, f"Laplace transform of ({n - 7}), from rest, at C = 0 (SymPy)."),
        )
        for n, printed in LAPLACE_PRINTED.items()
    ),
    Claim(
        equation="(3), (10), (18), (19): order of arguments",
        printed="phi_x(t,0); Phi_x(s,0); phi_x(t,0); phi_x(t,0)",
        corrected="phi_x(0,t); Phi_x(0,s); phi_x(0,t); phi_x(0,t)",
        check=misplaced,
        evidence="Counted: (4)-(7), (11)-(14) and (17) have the place first, these four the time. Taken literally, the "
        "root moment in (3) would be the moment at x = t and time 0. Notation only.",
    ),
)
