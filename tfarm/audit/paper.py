"""Table 1, its values and units; equations (21)-(23) and the network's inputs of section 5; the audit of the paper.

The audit has a row for each equation of the paper, its table and its appendix.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated

import sympy as sp

from tfarm.arm import load
from tfarm.schema import Quantity
from tfarm.spectrum import modes

from . import energy, equations
from .energy import CONTROL_LAW
from .equations import TIME
from .formulas import (
    NEEDED,
    PAPER_UNITS,
    Expression,
    clauses,
    difference,
    jet,
    mismatch,
    parsed,
    remainder,
    sides,
    spelled,
    symbol,
    symbols,
    unit_dimension,
    unlike,
)
from .rows import TEXTS, AuditRow, Claim, formula_of

ALUMINIUM_DENSITIES = (2550.0, 2900.0)  # kg/m^3: alloys from aluminium-lithium to those rich in copper and zinc
PRINTED_E = 6.8944e10  # Pa, as printed
PRINTED_G = 2.6517e10  # Pa
PRINTED_A = 6.0e-4  # m^2
PAPER = (
    "Self-Tuning Vibration Control of a Rotational Flexible Timoshenko Arm Using Neural Networks, "
    "Advances in Acoustics and Vibration, 2012, article 852780"
)


def statements_beyond_the_first(text: str) -> str:
    """How many statements follow the first."""
    return str(len(clauses(text)) - 1)


def quantity(clause: str) -> tuple[str, float, Expression]:
    """Name, value and dimension of a text such as "rho = 2766.7 kg/m^3"."""
    name, _, rest = clause.partition(" = ")
    value, _, of = rest.partition(" ")
    return name, float(value), unit_dimension(of)


def is_aluminium(text: str) -> str:
    """rho: the relative distance from what aluminium alloys weigh, the material of E and G."""
    name, value, dimension = quantity(text)
    if dimension != PAPER_UNITS[name]:
        return f"{name} in {spelled(dimension)}"
    low, high = ALUMINIUM_DENSITIES
    distance = max(1 - value / low, value / high - 1, 0.0)
    return f"{distance:.4f}" if distance else "0"


def is_unit_of_damping(text: str) -> str:
    """C: the dimensions of 1 + C s."""
    return mismatch(parsed("1 + C*s"), PAPER_UNITS | {"C": unit_dimension(text.partition(": ")[2])})


def are_units(text: str) -> str:
    """Every sum in (1), (2), (4), (5) and (A.2) with the units of the text."""
    given = {name: unit_dimension(of) for name, of in (clause.split(": ") for clause in clauses(text))}
    found = [
        unlike(formula, PAPER_UNITS | given) for formula in (*(TIME[n] for n in (1, 2, 4, 5)), formula_of("(A.2)"))
    ]
    return "; ".join(each for each in found if each != "0") or "0"


def is_given(name: str, text: str) -> str:
    """Whether a parameter that (2), (3) and the a_ij need has a value of the right dimension."""
    for clause in (clause for clause in clauses(text) if clause.startswith(f"{name} = ")):
        _, value, dimension = quantity(clause)
        return "0" if value > 0 and dimension == unit_dimension(NEEDED[name]) else f"{name} in {spelled(dimension)}"
    return f"{name} has no value"


def is_section(text: str) -> str:
    """I: given, and that of a rectangle "b m x h m" with the printed area."""
    given = is_given("I", text)
    if given != "0":
        return given
    (_, value, _), sides = quantity(clauses(text)[0]), clauses(text)[1].removeprefix("rectangle ").split(" x ")
    width, depth = (quantity(f"side = {side}")[1] for side in sides)
    off = max(abs(width * depth / PRINTED_A - 1), abs(width * depth**3 / 12 / value - 1))
    return f"{off:.2g}" if off > 1e-12 else "0"  # doubles read from decimals


def density_in_numbers() -> str:
    """What the density printed would mean."""
    printed, used = (modes(load(name), 3).natural_frequency[1:] for name in ("sasaki2012-as-printed", "sasaki2012"))
    ratios = ", ".join(f"{ratio:.1f}" for ratio in printed / used)
    speeds = [math.sqrt(PRINTED_E / rho) / 1e3 for rho in (2.7667, 2766.7)]
    return (
        f"E/(2 G) - 1 = {PRINTED_E / (2 * PRINTED_G) - 1:.4f}, Poisson's ratio of aluminium. As printed, sound would "
        f"run along the arm at {speeds[0]:.0f} km/s (corrected: {speeds[1]:.2f}; diamond: about 18), and the first "
        f"natural frequencies would be {ratios} times as high (hub inertia 0.1 kg m^2)."
    )


INCREMENT = formula_of("(21)")
UPDATE = formula_of("(22)")
INPUT_NEURONS = 6  # neurons, section 5


def descends(increment: str, update: str) -> str:
    """What keeps (21) with (22) from being descent with momentum on the cost c w^2/2, whose gradient is c w.

    With M the map (w, dw_before) -> (w_next, dw): det(I - M) = eta c > 0 (were it negative, w would grow without
    end for every eta), det M = alpha (the memory), and w_next - w is the increment dw by its name.
    """
    w, dw, before, c = symbols("w dw dw_before c")
    step = difference(increment)
    dw_of = sp.solve(step, dw)[0].subs(symbol("g"), c * w)
    w_of = sides(update)[symbol("w_next")]
    M = sp.Matrix([w_of.subs(dw, dw_of), dw_of]).jacobian([w, before])
    eta, alpha = symbols("eta_c alpha_c")
    return remainder((sp.eye(2) - M).det() / (eta * c) - 1, M.det() - alpha, w_of - w - dw)


def is_cost(text: str) -> str:
    """(23): e, the control signal of section 5, against the torque of (19) with K for K2, x for the moment; and E."""
    x, e, a, b, u = symbols("x e a b u")
    moment = {parsed("phi_x(0,t)"): x / parsed("E*I"), symbol("K2"): symbol("K")}
    torque = sides(CONTROL_LAW)[u].subs(moment)
    given = sides(text)
    signal = given[e].subs(u, given.get(u, torque))  # "control input": the torque, unless the text defines it
    curvature = sp.hessian(given[symbol("E")], (x, e)) - sp.diag(a, b)
    return remainder(signal - torque, *curvature)


def are_gain_units(text: str) -> str:
    """(20), (23): each gain's dimension by its equation; one name cannot have two."""
    x, theta_t = symbol("x"), jet("theta", t=1)
    needs: dict[str, set[Expression]] = {}
    places = {jet("V", t=1): (theta_t**2, unit_dimension("N m s")), symbol("e"): (x, unit_dimension("1"))}
    for left, right in sides(text).items():
        factor, dimension = places[left]
        for name in (s.name for s in right.coeff(factor).free_symbols if s.name.startswith("K")):
            needs.setdefault(name, {PAPER_UNITS[name]} if name in PAPER_UNITS else set()).add(dimension)
    clashes = [f"{name}: {' and '.join(sorted(map(spelled, two)))}" for name, two in needs.items() if len(two) > 1]
    return "; ".join(clashes) or "0"


def signals_beyond_the_neurons(text: str) -> str:
    """How many signals are named beyond the neurons of the input layer."""
    return str(len(text.split(", ")) - INPUT_NEURONS)


CHECKS: dict[str, Callable[[str], str]] = {
    **equations.CHECKS,
    **energy.CHECKS,
    "(21)": lambda text: descends(text, UPDATE),
    "(22)": lambda text: descends(INCREMENT, text),
    "(23)": is_cost,
    "(20), (23): K": are_gain_units,
    "section 5: inputs": signals_beyond_the_neurons,
    "section 5: alpha_c": statements_beyond_the_first,
    "section 5: eta_c": statements_beyond_the_first,
    "Table 1 (rho)": is_aluminium,
    "Table 1 (C's unit)": is_unit_of_damping,
    "Table 1 (other units)": are_units,
    "Table 1 (I)": is_section,
    "Table 1 (I_h)": partial(is_given, "I_h"),
}
MEASURED = {
    "(19)": energy.growth_text,
    "(18)-(20): constant gains, varied by the tuner": energy.pumped_text,
    "Table 1 (rho)": density_in_numbers,
}


def claims() -> tuple[Claim, ...]:
    """Every claim, in the order of the paper."""
    return tuple(Claim(**texts, check=CHECKS[name], measured=MEASURED.get(name, str)) for name, texts in TEXTS.items())


@cache
def audit() -> tuple[AuditRow, ...]:
    """Check every equation, as printed and as corrected.

    Raises CertificationError if a correction does not pass its own check.
    """
    return tuple(claim.row() for claim in claims())


@dataclass(frozen=True)
class Audit:
    """The paper, equation by equation."""

    paper: Annotated[str, Quantity("paper", help="the article whose equations are checked")]
    rows: Annotated[tuple[AuditRow, ...], Quantity("equations", help="verdict and residuals, a row an equation")]
