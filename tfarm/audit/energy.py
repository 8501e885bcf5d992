"""Equations (15)-(20) and the feedback: integration by parts with payload and with a1, a2, a3 free.

`rate` differentiates a V along the motion (1)-(5), which `equations` has checked against Hamilton's principle, and
`unbalanced` compares two such rates for every motion at once.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import sympy as sp
from scipy.linalg import expm

from tfarm.arm import HubFeedback, load
from tfarm.loop.poles import closed_loop_poles
from tfarm.reduced import modal_model

from .equations import solved_motion
from .formulas import (
    Expression,
    clauses,
    d_dt,
    integral_parts,
    jet,
    parsed,
    remainder,
    sides,
    symbol,
    symbols,
    unbalanced,
)
from .rows import formula_of, printed

K1 = 0.3  # N m s/rad
MODES = 8  # of the arm whose gain is switched


def pumped(*switched: tuple[float, float]) -> float:
    """Growth per period of the loop (19) on the default arm when K2 is switched: each value with its duration [s]."""
    A, B, C, D = modal_model(load("sasaki2012"), ["hub_rate", "root_moment"], MODES).matrices()
    period = np.eye(len(A))
    for K2, duration in switched:
        gains = np.array([K1, K2])
        period = expm((A - np.outer(B, gains @ C / (1 + gains @ D))) * duration) @ period
    return float(abs(np.linalg.eigvals(period)).max())


def growth_text() -> str:
    """The sharpness of K2 < 1 in numbers."""
    laws = (HubFeedback(K1=K1, K2=K2) for K2 in (0.5, 1.1))
    roots = (closed_loop_poles(load("sasaki2012"), law, 3).values[-1] for law in laws)
    within, beyond = (f"{s.real:.4f} + {s.imag:.4f}j" for s in roots)
    return (
        f"Default arm, K1 = {K1}: a root at s = {within} 1/s for K2 = 0.5, at {beyond} 1/s for K2 = 1.1 (closed-loop "
        "poles)."
    )


def pumped_text() -> str:
    """A gain that varies between two stable values and drives the arm unstable."""
    low, high = (0.1, 0.027), (0.6, 0.025)
    constant = max(pumped(low), pumped(high))
    return (
        f"Counterexample: default arm, K1 = {K1}, {MODES} modes, continuous time: K2 = {low[0]} for "
        f"{1e3 * low[1]:.0f} ms and {high[0]} for {1e3 * high[1]:.0f} ms grows by {pumped(low, high):.3f} a "
        f"period, either gain alone by {constant:.6f}, which is the angle at rest."
    )


V_PRINTED = printed("(15)")
V = formula_of("(15)")
RATE = formula_of("(16)")
POWER_FLOW = formula_of("(18)")
CONTROL_LAW = formula_of("(19)")
DECAY = formula_of("(20)")
a1, a2, a3, u, theta_t = (*symbols("a1 a2 a3 u"), jet("theta", t=1))
M0 = parsed("E*I*phi_x(0,t)")


def rate(energy_of: Expression, damping: Expression = 0) -> Expression:
    """dV/dt with the accelerations of (1)-(5); with damping, E phi_x becomes E (phi_x + C phi_xt) in them."""
    E, places = symbol("E"), [(i, at) for i in (1, 2) for at in ("", "(L,t)", "(0,t)")]
    rates = {jet("phi", i, 0, at): jet("phi", i, 0, at) + damping * jet("phi", i, 1, at) for i, at in places}
    arm, tip, hub = (
        {s: sp.expand(f).coeff(E, 0) + E * sp.expand(f).coeff(E, 1).subs(rates, simultaneous=True)
         for s, f in solved.items()}
        for solved in solved_motion()
    )  # fmt: skip
    inside, outside = integral_parts(d_dt(energy_of))
    outside = sp.expand(sp.expand(outside.subs(tip)).subs(hub))
    return sp.Function("integral")(sp.expand(inside.subs(arm))) + outside


@cache
def energy_of(text: str) -> Expression:
    """V of a text."""
    return sides(text)[symbol("V")]


def claimed(text: str) -> tuple[Expression, dict[Expression, Expression]]:
    """V_t of a text, and the conditions that come with it."""
    found = sides(text)
    return found.pop(jet("V", t=1)), found


def is_total_energy(text: str) -> str:
    """(15): with all weights one, the torque's power is all that changes the arm's energy."""
    ones = dict.fromkeys((a1, a2, a3), 1)
    return unbalanced(rate(energy_of(text).subs(ones)) - u * theta_t)


def is_derivative(text: str) -> str:
    """(16): against d/dt of (15) as printed, before any equation of motion."""
    value, _ = claimed(text)
    return remainder(*integral_parts(d_dt(energy_of(V_PRINTED)) - value))


def is_substituted(text: str) -> str:
    """(17): (16) with the accelerations of (1)-(3)."""
    value, _ = claimed(text)
    arm, _, hub = solved_motion()
    inside, outside = integral_parts(claimed(RATE)[0])
    there, beyond = integral_parts(value)
    return remainder(inside.subs(arm) - there, outside.subs(hub) - beyond)


def is_power(text: str) -> str:
    """(18): against dV/dt of (15) with its payload, integrated by parts."""
    value, conditions = claimed(text)
    return unbalanced((rate(energy_of(V)) - value).subs(conditions))


def proven_gains(law: Expression) -> dict[str, Expression]:
    """The intervals of K1 and K2 for which some a1, a2 > 0 make the true dV/dt (a3 = a1) a negative square."""
    M, slope = symbol("M(0)"), parsed("phi_x(0,t)")
    power = sp.expand(claimed(POWER_FLOW)[0].subs(u, law)).subs(slope, M / parsed("E*I"))
    weight = sp.solve(power.coeff(M), a1)[0] / a2  # a1/a2, which must be positive
    damping = -sp.expand(power.subs(M, 0)) / (a2 * theta_t**2)
    positive = {"K1": damping, "K2": weight}
    return {gain: sp.solveset(sp.simplify(f) > 0, symbol(gain), sp.S.Reals) for gain, f in positive.items()}


def are_proven_gains(text: str) -> str:
    """(19): the gains that the text allows against those for which dV/dt <= 0 can be proven with its law."""
    proven, wrong = proven_gains(sides(text)[u]), []
    for clause in clauses(text)[1:]:
        low, name, high = clause.split(" < ")
        allowed = sp.Interval.open(parsed(low), parsed(high))
        sets = {"allowed, not proven": allowed - proven[name], "proven, not allowed": proven[name] - allowed}
        for what, rest in ((what, rest) for what, rest in sets.items() if rest is not sp.S.EmptySet):
            ends = "(" if rest.left_open else "[", ")" if rest.right_open else "]"
            wrong.append(f"{what}: {name} in {ends[0]}{rest.start}, {rest.end}{ends[1]}")
    return "; ".join(wrong) or "0"


def is_decay(text: str) -> str:
    """(20): (19) in the true dV/dt."""
    value, stated = claimed(text)
    weights = stated or claimed(DECAY)[1]
    change = rate(energy_of(V)).subs(u, sides(CONTROL_LAW)[u]) - value
    return unbalanced(change.subs(a3, weights[a3]).subs(a1, weights[a1]))


def is_damped_decay(text: str) -> str:
    """Section 3 with C > 0: dV/dt may be -a2 K1 theta_t^2 less what the material dissipates, no more."""
    weights = {a1: a2 * (1 - symbol("K2"))}
    lost = parsed("-a2*K1*theta_t^2 - a1*C*integral(E*I*phi_xt^2)")
    change = rate(energy_of(V).subs(a3, a1), symbol("C")).subs(u, sides(text)[u]) - lost
    return unbalanced(change.subs(weights))


def is_varied_decay(text: str) -> str:
    """The proof with weights that follow K2(t): a1 = a2 (1 - K2) brings in the rate of K2."""
    value, conditions = claimed(text)
    weight = conditions[a1]
    K2_t = conditions.get(jet("K2", t=1), jet("K2", t=1))
    law_rate = rate(energy_of(V)).subs(a3, a1).subs(u, sides(CONTROL_LAW)[u])
    moving = sp.diff(energy_of(V).subs(a3, a1), a1) * sp.diff(weight, symbol("K2")) * K2_t
    return unbalanced((law_rate + moving - value).subs(a1, weight))


CHECKS: dict[str, Callable[[str], str]] = {
    "(15)": is_total_energy,
    "(16)": is_derivative,
    "(17)": is_substituted,
    "(18)": is_power,
    "(19)": are_proven_gains,
    "(20)": is_decay,
    "(18)-(20): damping C > 0": is_damped_decay,
    "(18)-(20): constant gains, varied by the tuner": is_varied_decay,
}
