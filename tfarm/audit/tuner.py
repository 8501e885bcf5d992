"""Equations (21)-(23) and the network's inputs of section 5."""

from __future__ import annotations

import sympy as sp

from .energy import CONTROL_LAW
from .formulas import (
    PAPER_UNITS,
    Dimension,
    clauses,
    difference,
    jet,
    parsed,
    remainder,
    sides,
    spelled,
    symbol,
    symbols,
    unit_dimension,
)
from .rows import Claim

INCREMENT = "dw = -eta_c*g + alpha_c*dw_before"
UPDATE_PRINTED = "w_next = w - dw"
UPDATE = "w_next = w + dw"
COST = "E = 1/2*a*x^2 + 1/2*b*e^2; e = u - K*x"
COST_READ = COST + "; u = -K1*theta_t"
GAIN_LAWS_PRINTED = "V_t = -K*theta_t^2; e = u - K*x"
GAIN_LAWS = "V_t = -a2*K1*theta_t^2; e = u - K2*x"
INPUT_SIGNALS_PRINTED = "u(t), u(t-1), e(t), e(t-1), K, x(t), x(t-1)"
INPUT_SIGNALS = "u(t), u(t-1), e(t), e(t-1), x(t), x(t-1)"
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
    signal = given[e].subs(u, given.get(u, torque))  # "control input": the torque, unless the text says otherwise
    cost = given[symbol("E")]
    curvature = sp.hessian(cost, (x, e)) - sp.diag(a, b)
    return remainder(signal - torque, *curvature)


def are_gain_units(text: str) -> str:
    """(20), (23): each gain's dimension by the equation it stands in; one name cannot have two."""
    x, theta_t = symbol("x"), jet("theta", t=1)
    needs: dict[str, set[Dimension]] = {}
    places = {jet("V", t=1): (theta_t**2, unit_dimension("N m s")), symbol("e"): (x, unit_dimension("1"))}
    for left, right in sides(text).items():
        factor, dimension = places[left]
        for name in (s.name for s in right.coeff(factor).free_symbols if s.name.startswith("K")):
            needs.setdefault(name, {PAPER_UNITS[name]} if name in PAPER_UNITS else set()).add(dimension)
    clashes = [f"{name}: {' and '.join(sorted(map(spelled, two)))}" for name, two in needs.items() if len(two) > 1]
    return "; ".join(clashes) or "0"


def surplus(text: str) -> str:
    """Signals beyond the neurons of the input layer."""
    return str(len(text.split(", ")) - INPUT_NEURONS)


def contradictions(text: str) -> str:
    """Statements about one quantity beyond the first."""
    return str(len(clauses(text)) - 1)


TUNER_CLAIMS = (  # the learning rule, the cost, and what section 5 says of them
    Claim(
        equation="(21)",
        printed=INCREMENT,
        check=lambda text: descends(text, UPDATE),
        evidence="Gradient descent with momentum, together with the mended (22) (SymPy, quadratic cost). The text "
        "after (21) gives the increment the other sign and no momentum: either (21) or (22) may be mended, here "
        "(22) is. The gradient needs dx/dK, how the arm's moment answers to the gain, which the paper does not "
        "give; its E is not Young's modulus.",
    ),
    Claim(
        equation="(22)",
        printed=UPDATE_PRINTED,
        corrected=UPDATE,
        check=lambda text: descends(INCREMENT, text),
        evidence="With (21) as printed w - dw climbs: on c w^2/2 the map of (w, dw) has det(I - M) = -eta c, a "
        "multiplier above 1 for every eta and alpha (SymPy). An increment is w(t+1) - w(t).",
    ),
    Claim(
        equation="(23)",
        printed=COST,
        corrected=COST_READ,
        check=is_cost,
        evidence='Below (23) u is "the control input", in section 5 a "reference signal" beside "control signals '
        'e". By (19) the torque is -K1 theta_t - K2 x (SymPy).',
        doubt="Two readings: u is the torque, then e = u - K x counts the moment feedback twice (to measure the "
        "distance from the law it would be u + K x); or u is the reference and e the torque, then (23) agrees with "
        "(19). The second is used.",
    ),
    Claim(
        equation="(20), (23): K",
        printed=GAIN_LAWS_PRINTED,
        corrected=GAIN_LAWS,
        check=are_gain_units,
        evidence="K in (20) is in N m s, K in (23) a pure number (dimension checker): two gains, a2 K1 and K2.",
    ),
    Claim(
        equation="section 5: inputs",
        printed=INPUT_SIGNALS_PRINTED,
        corrected=INPUT_SIGNALS,
        check=surplus,
        evidence=f"{INPUT_NEURONS} input neurons, seven signals named (counted).",
        doubt='Which is too many is not said; a network with "no inner feedback loop" speaks against K, its own '
        "output, and six neurons are read as the six without it.",
    ),
    Claim(
        equation="section 5: alpha_c",
        printed="alpha_c changed dynamically; alpha_c = 0.6",
        corrected="alpha_c = 0.6",
        check=contradictions,
        evidence="Section 4 changes the momentum dynamically, by no rule; section 5 has one best value (counted).",
        doubt="The constant 0.6 is used.",
    ),
    Claim(
        equation="section 5: eta_c",
        printed="eta_c of each weight its own; eta_c = 0.8",
        corrected="eta_c = 0.8",
        check=contradictions,
        evidence="Section 4 gives each weight a learning rate of its own, section 5 has one value (counted).",
        doubt="0.8 for all weights is used.",
    ),
)
