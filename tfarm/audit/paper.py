"""The audit of the paper: a row for each equation, its table and its appendix.

(15)-(20) and the feedback: integration by parts with payload and with a1, a2, a3 free.  `rate` differentiates a V along
the motion (1)-(5), which `equations` has checked against Hamilton's principle, and `balance_residual` compares two such
rates for every motion at once.  Table 1: its values and units.  (21)-(23), and the network's inputs of section 5.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated, Any

import numpy as np
import sympy as sp
from scipy.linalg import expm

from tfarm.arm import HubFeedback, load
from tfarm.audit import equations
from tfarm.audit.equations import accelerations, equation
from tfarm.audit.formulas import (
    AT_ROOT,
    AT_TIP,
    PAPER_UNITS,
    Expression,
    balance_residual,
    base_units_text,
    clauses,
    d_dt,
    difference,
    integral,
    integral_parts,
    jet,
    jets,
    mismatch,
    parse_expression,
    remainder,
    residual_text,
    sides,
    symbol,
    symbols,
    tex,
    unit_dimension,
)
from tfarm.audit.rows import TEXTS, AuditRow, formula_of, is_zero
from tfarm.errors import CertificationError
from tfarm.loop.poles import closed_loop_poles
from tfarm.reduced import ModalModel, modal_model
from tfarm.schema import Quantity
from tfarm.spectrum import modes

# ------------------------------------------------------------ (15)-(20) and the feedback


def growth_per_period(model: ModalModel, K1: float, switched: tuple[tuple[float, float], ...]) -> float:
    """Return the growth per period of the loop (19) when K2 is switched: each value with its duration [ms]."""
    period = np.eye(model.order)
    for K2, duration in switched:
        period = expm(model.closed([K1, K2])[0] * duration / 1e3) @ period
    return float(abs(np.linalg.eigvals(period)).max())


def growth() -> dict[str, Any]:
    """Return the sharpness of K2 < 1 in numbers: a root within and one beyond."""
    arm = load("sasaki2012")
    # N m s/rad
    K1 = 0.3
    within, beyond = (closed_loop_poles(arm, HubFeedback(K1=K1, K2=K2), 3).values[-1] for K2 in (0.5, 1.1))
    return {"K1": K1, "within": within, "beyond": beyond}


def pumped_growth() -> dict[str, Any]:
    """Return the growth under a gain that varies between two stable values and drives the arm unstable."""
    # N m s/rad
    K1 = 0.3
    modes_of_arm = 8
    # K2, and for how long [ms]
    low = 0.1, 27.0
    high = 0.6, 25.0
    model = modal_model(load("sasaki2012"), ["hub_rate", "root_moment"], modes_of_arm)
    return {
        "K1": K1,
        "modes": modes_of_arm,
        "low": low,
        "high": high,
        "grows": growth_per_period(model, K1, (low, high)),
        "constant": max(growth_per_period(model, K1, (each,)) for each in (low, high)),
    }


a1, a2, a3, u = symbols("a1 a2 a3 u")
theta_t = jet("theta", t=1)


def rate(V: Expression, damping: Expression = 0) -> Expression:
    """Return dV/dt with the accelerations of (1)-(5); with damping, E phi_x becomes E (phi_x + C phi_xt) in them."""
    inside, outside = integral_parts(d_dt(V))
    inside = sp.expand(inside.subs(damped_accelerations("", damping)))
    for place in (AT_TIP, AT_ROOT):
        outside = sp.expand(outside.subs(damped_accelerations(place, damping)))
    return integral(inside) + outside


def damped_accelerations(place: str, damping: Expression) -> dict[Expression, Expression]:
    """Return `accelerations` with E phi_x + C E phi_xt for E phi_x, and so for the other strains."""
    E = symbol("E")
    found: dict[Expression, Expression] = {}
    for s, f in accelerations(place).items():
        strains: dict[Expression, Expression] = {}
        for strain, field, i, j, at in jets(f):
            if i:
                strains[E * strain] = E * (strain + damping * jet(field, i, j + 1, at))
        found[s] = sp.expand(f).subs(strains)
    return found


@cache
def energy_of(text: str) -> Expression:
    """Return V of a text."""
    return sides(text)[symbol("V")]


def energy() -> Expression:
    """Return V of (15)."""
    return energy_of(formula_of("(15)"))


def law_torque() -> Expression:
    """Return the torque of the control law (19)."""
    return sides(formula_of("(19)"))[u]


def read_claim(text: str) -> tuple[Expression, dict[Expression, Expression]]:
    """Return V_t of a text, and the conditions that come with it."""
    found = sides(text)
    return found.pop(jet("V", t=1)), found


def is_total_energy(text: str) -> str:
    """Check (15): with all weights one, the torque's power is all that changes the arm's energy."""
    ones = dict.fromkeys((a1, a2, a3), 1)
    return balance_residual(rate(energy_of(text).subs(ones)) - u * theta_t)


def is_derivative(text: str) -> str:
    """Compare (16) with d/dt of (15) as printed, before any equation of motion."""
    rate_of_printed = d_dt(energy_of(TEXTS["(15)"]["printed"]))
    value, _ = read_claim(text)
    return remainder(*integral_parts(rate_of_printed - value))


def is_substituted(text: str) -> str:
    """Compare (17) with (16) under the accelerations of (1)-(3)."""
    inside, outside = integral_parts(read_claim(formula_of("(16)"))[0])
    there, beyond = integral_parts(read_claim(text)[0])
    along_arm = inside.subs(accelerations())
    at_hub = outside.subs(accelerations(AT_ROOT))
    return remainder(along_arm - there, at_hub - beyond)


def is_power(text: str) -> str:
    """Compare (18) with dV/dt of (15) with its payload, integrated by parts."""
    value, conditions = read_claim(text)
    return balance_residual((rate(energy()) - value).subs(conditions))


def proven_gains(law: Expression) -> dict[str, Expression]:
    """Return the intervals of K1 and K2 for which some a1, a2 > 0 make the true dV/dt (a3 = a1) a negative square."""
    M = symbol("M(0)")
    slope = parse_expression("phi_x(0,t)")
    power = sp.expand(read_claim(formula_of("(18)"))[0].subs(u, law)).subs(slope, M / parse_expression("E*I"))
    # a1/a2, which must be positive
    weight = sp.solve(power.coeff(M), a1)[0] / a2
    damping = -sp.expand(power.subs(M, 0)) / (a2 * theta_t**2)
    positive = {"K1": damping, "K2": weight}
    return {gain: sp.solveset(sp.simplify(f) > 0, symbol(gain), sp.S.Reals) for gain, f in positive.items()}


def are_proven_gains(text: str) -> str:
    """Compare the gains that (19) allows with those for which dV/dt <= 0 can be proven with its law."""
    proven = proven_gains(sides(text)[u])
    wrong = []
    for clause in clauses(text)[1:]:
        low, name, high = clause.split(" < ")
        allowed = sp.Interval.open(parse_expression(low), parse_expression(high))
        sets = {"allowed, not proven": allowed - proven[name], "proven, not allowed": proven[name] - allowed}
        for fault, rest in sets.items():
            if rest is not sp.S.EmptySet:
                wrong.append(f"{fault}: {name} in {sp.pretty(rest, use_unicode=False)}")
    return "; ".join(wrong) or "0"


def is_decay(text: str) -> str:
    """Compare (20) with the true dV/dt under (19)."""
    value, stated = read_claim(text)
    weights = stated or read_claim(formula_of("(20)"))[1]
    change = rate(energy()).subs(u, law_torque()) - value
    return balance_residual(change.subs(a3, weights[a3]).subs(a1, weights[a1]))


def is_damped_decay(text: str) -> str:
    """Check section 3 with C > 0: dV/dt may be -a2 K1 theta_t^2 less what the material dissipates, no more."""
    weights = {a1: a2 * (1 - symbol("K2"))}
    lost = parse_expression("-a2*K1*theta_t^2 - a1*C*integral(E*I*phi_xt^2)")
    change = rate(energy().subs(a3, a1), symbol("C")).subs(u, sides(text)[u]) - lost
    return balance_residual(change.subs(weights))


def is_varied_decay(text: str) -> str:
    """Check the proof with weights that follow K2(t): a1 = a2 (1 - K2) brings in the rate of K2."""
    value, conditions = read_claim(text)
    weight = conditions[a1]
    K2_t = jet("K2", t=1)
    K2_t = conditions.get(K2_t, K2_t)
    law_rate = rate(energy()).subs(a3, a1).subs(u, law_torque())
    moving = sp.diff(energy().subs(a3, a1), a1) * sp.diff(weight, symbol("K2")) * K2_t
    return balance_residual((law_rate + moving - value).subs(a1, weight))


# ------------------------------------------------------------ Table 1, (21)-(23), section 5
PAPER = (
    "Self-Tuning Vibration Control of a Rotational Flexible Timoshenko Arm Using Neural Networks, "
    "Advances in Acoustics and Vibration, 2012, article 852780"
)


def quantity(clause: str) -> tuple[str, float, Expression]:
    """Return name, value and dimension of a text such as "rho = 2766.7 kg/m^3"."""
    name, _, rest = clause.partition(" = ")
    value, _, of = rest.partition(" ")
    return name, float(value), unit_dimension(of)


def is_aluminium(text: str) -> str:
    """Return the relative distance of rho from what aluminium alloys weigh, the material of E and G."""
    # kg/m^3: alloys from aluminium-lithium to those rich in copper and zinc
    aluminium_densities = (2550.0, 2900.0)
    name, value, dimension = quantity(text)
    if dimension != PAPER_UNITS[name]:
        return f"{name} in {base_units_text(dimension)}"
    low, high = aluminium_densities
    distance = max(1 - value / low, value / high - 1, 0.0)
    if not distance:
        return "0"
    return f"{distance:.4f}"


def are_units(text: str) -> str:
    """Check every sum in (1), (2), (4), (5) and (A.2) with the units of the text."""
    units = dict(PAPER_UNITS)
    for clause in clauses(text):
        name, unit = clause.split(": ")
        units[name] = unit_dimension(unit)
    formulas = (*map(equation, (1, 2, 4, 5)), difference(formula_of("(A.2)")))
    return residual_text(mismatch(formula, units) for formula in formulas)


def has_value(name: str, text: str) -> str:
    """Check that a parameter that (2), (3) and the a_ij need has a value of the right dimension."""
    for clause in clauses(text):
        if clause.startswith(f"{name} = "):
            _, value, dimension = quantity(clause)
            if value > 0 and dimension == PAPER_UNITS[name]:
                return "0"
            return f"{name} in {base_units_text(dimension)}"
    return f"{name} has no value"


def is_section(text: str) -> str:
    """Check that I has a value, and that of a rectangle "b m x h m" with the printed area."""
    residual = has_value("I", text)
    if residual != "0":
        return residual
    moment, rectangle = clauses(text)
    (_, value, _) = quantity(moment)
    sides = rectangle.removeprefix("rectangle ").split(" x ")
    width, depth = (quantity(f"side = {side}")[1] for side in sides)
    # the printed area is 6.0e-4 m^2
    off = max(abs(width * depth / 6.0e-4 - 1), abs(width * depth**3 / 12 / value - 1))
    # doubles read from decimals
    if off <= 1e-12:
        return "0"
    return f"{off:.2g}"


def density() -> dict[str, Any]:
    """Return the consequences of the density as printed."""
    # Pa, as printed
    printed_e = 6.8944e10
    printed, used = (
        modes(load(name), 3).natural_frequency[1:] for name in ("sasaki2012-as-printed", "sasaki2012")
    )
    speeds = [math.sqrt(printed_e / rho) / 1e3 for rho in (2.7667, 2766.7)]
    # the printed G is 2.6517e10 Pa
    return {"poisson": printed_e / (2 * 2.6517e10) - 1, "speeds": speeds, "ratios": printed / used}


def is_descent(increment: str, update: str) -> str:
    """Check that (21) with (22) is descent with momentum on the cost c w^2/2, whose gradient is c w.

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
    """Compare e of (23), the control signal of section 5, with the torque of (19), K for K2 and x for the moment."""
    x, e, a, b, u = symbols("x e a b u")
    moment = {parse_expression("phi_x(0,t)"): x / parse_expression("E*I"), symbol("K2"): symbol("K")}
    torque = law_torque().subs(moment)
    formulas = sides(text)
    # "control input": the torque, unless the text defines it
    signal = formulas[e].subs(u, formulas.get(u, torque))
    curvature = sp.hessian(formulas[symbol("E")], (x, e)) - sp.diag(a, b)
    return remainder(signal - torque, *curvature)


def are_gain_units(text: str) -> str:
    """Compare the dimensions of each gain by (20) and (23); one name cannot have two."""
    needs: dict[str, set[Expression]] = {}
    for left, factor, unit in ((jet("V", t=1), theta_t**2, "N m s"), (symbol("e"), symbol("x"), "1")):
        of = unit_dimension(unit)
        for s in sides(text)[left].coeff(factor).free_symbols:
            if s.name.startswith("K"):
                needs.setdefault(s.name, {PAPER_UNITS.get(s.name, of)}).add(of)
    clashes = []
    for name, dimensions in needs.items():
        if len(dimensions) > 1:
            clashes.append(f"{name}: {' and '.join(sorted(map(base_units_text, dimensions)))}")
    return "; ".join(clashes) or "0"


def is_damping_unit(text: str) -> str:
    """Check the unit of C, that of C in 1 + C s."""
    unit = unit_dimension(text.partition(": ")[2])
    return mismatch(parse_expression("1 + C*s"), PAPER_UNITS | {"C": unit})


def count_statements(known: int, separator: str, text: str) -> str:
    """Return the number of statements, signals of section 5 or the like in a text beyond those known."""
    return str(len(text.split(separator)) - known)


CHECKS: dict[str, Callable[[str], str]] = {
    **equations.CHECKS,
    "(15)": is_total_energy,
    "(16)": is_derivative,
    "(17)": is_substituted,
    "(18)": is_power,
    "(19)": are_proven_gains,
    "(20)": is_decay,
    "(18)-(20): damping C > 0": is_damped_decay,
    "(18)-(20): constant gains, varied by the tuner": is_varied_decay,
    "(21)": lambda text: is_descent(text, formula_of("(22)")),
    "(22)": lambda text: is_descent(formula_of("(21)"), text),
    "(23)": is_cost,
    "(20), (23): K": are_gain_units,
    # six input neurons
    "section 5: inputs": partial(count_statements, 6, ", "),
    "section 5: alpha_c": partial(count_statements, 1, ";"),
    "section 5: eta_c": partial(count_statements, 1, ";"),
    "Table 1 (rho)": is_aluminium,
    "Table 1 (C's unit)": is_damping_unit,
    "Table 1 (other units)": are_units,
    "Table 1 (I)": is_section,
    "Table 1 (I_h)": partial(has_value, "I_h"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A statement about an equation.

    `check` gives the residual of a text, "0" or a number that is zero but for rounding if it is right.
    """

    equation: str
    printed: str
    check: Callable[[str], str]
    evidence: str
    # empty: the print is right
    corrected: str = ""
    # what cannot be decided
    doubt: str = ""
    # numbers that the evidence has
    measured: Callable[[], dict[str, Any]] = dict

    def row(self) -> AuditRow:
        """Run the check on both texts.  Raises CertificationError where the corrected one leaves a residual."""
        corrected = self.printed
        residual_printed = residual_corrected = self.check(self.printed)
        if self.corrected:
            corrected = self.corrected
            residual_corrected = self.check(corrected)
        if not is_zero(residual_corrected):
            raise CertificationError(f"{self.equation}, as corrected, leaves {residual_corrected}")
        verdict = "ok" if is_zero(residual_printed) else "corrected"
        if self.doubt:
            verdict = "undecided"
        return AuditRow(
            equation=self.equation,
            verdict=verdict,
            printed=self.printed,
            corrected=corrected,
            evidence=f"{self.evidence.format(**self.measured())} {self.doubt}".strip(),
            residual_printed=residual_printed,
            residual_corrected=residual_corrected,
            printed_tex=tex(self.printed),
            corrected_tex=tex(corrected),
        )


def claims() -> tuple[Claim, ...]:
    """Return every claim, in the order of the paper."""
    measured = {
        "(19)": growth,
        "(18)-(20): constant gains, varied by the tuner": pumped_growth,
        "Table 1 (rho)": density,
    }
    return tuple(
        Claim(**texts, check=CHECKS[name], measured=measured.get(name, dict)) for name, texts in TEXTS.items()
    )


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
    rows: Annotated[
        tuple[AuditRow, ...], Quantity("equations", help="verdict and residuals, a row an equation")
    ]
