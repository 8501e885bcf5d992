"""The language the formulas are written in, and its reading into SymPy.

    rho*A*(y_tt + x*theta_tt) - kappa*G*A*(y_xx - phi_x) = 0
    V_t = theta_t*(a2*u + (a2 - a1)*E*I*phi_x(0,t)); a3 = a1

Clauses are parted by semicolons.  y_xt is a derivative of y at the running x, y_xt(L,t) the same at the tip, and
each is a symbol of its own (a jet coordinate).  theta, V and the gains do not depend on x, so that theta_x is 0.
Of the two arguments the one that is a place (0, L, x) is taken as the place, in whatever order they come.
integral(f) is the integral of f over x from 0 to L.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import sympy as sp

Expression = Any  # sympy comes without types

OF_TIME = ("theta", "Theta", "V", "K2", "a1")
JET = re.compile(r"\b(y|phi|theta|Y|Phi|Theta|V|K2|a1)(?:_(x*t*))?(?!\w)(?:\(([0Lxts]), ?([0Lxts])\))?")
NAME = re.compile(r"[A-Za-z]\w*")
FUNCTIONS = {"sqrt": sp.sqrt, "exp": sp.exp, "integral": sp.Function("integral"), "oo": sp.oo}


@cache
def symbol(name: str) -> Expression:
    """The one symbol of that name."""
    return sp.Symbol(name)


def symbols(names: str) -> list[Expression]:
    """Several, their names parted by blanks."""
    return [symbol(name) for name in names.split()]


def jet(field: str, x: int = 0, t: int = 0, at: str = "") -> Expression:
    """The derivative of a field, x times by x and t times by t; `at` is "", "(0,t)" or "(L,t)"."""
    if x and field in OF_TIME:
        return sp.Integer(0)
    orders = "x" * x + "t" * t
    return symbol(f"{field}{'_' + orders if orders else ''}{'' if field in OF_TIME else at}")


def jet_parts(s: Expression) -> tuple[str, int, int, str] | None:
    """(field, orders in x and t, place) of a jet symbol, None of any other."""
    match = JET.fullmatch(s.name)
    if match is None:
        return None
    field, orders, place, time = match.groups()
    orders = orders or ""
    return field, orders.count("x"), orders.count("t"), f"({place},{time})" if place else ""


@cache
def parsed(text: str) -> Expression:
    """The SymPy expression of a text without = or ;."""
    names: dict[str, Expression] = dict(FUNCTIONS)

    def stand_in(match: re.Match[str]) -> str:
        field, orders, first, second = match.groups()
        orders = orders or ""
        place, time = (first, second) if first in (None, "0", "L", "x") else (second, first)
        name = f"jet{len(names)}"
        names[name] = jet(field, orders.count("x"), orders.count("t"), f"({place},{time})" if place else "")
        return name

    code = JET.sub(stand_in, text).replace("^", "**")
    code = re.sub(r"\blambda\b", "lambda_", code)  # a keyword of Python
    names |= {name: symbol(name) for name in NAME.findall(code) if name not in names}
    return sp.parse_expr(code, local_dict=names)


def clauses(text: str) -> list[str]:
    """The parts of a text between semicolons."""
    return [clause.strip() for clause in text.split(";")]


def sides(text: str) -> dict[Expression, Expression]:
    """Left and right side of each of a text's equations."""
    pairs = [clause.split(" = ") for clause in clauses(text) if " = " in clause]
    return {parsed(left): parsed(right) for left, right in pairs}


def difference(text: str) -> Expression:
    """Left minus right side of a text's first equation."""
    left, right = next(iter(sides(text).items()))
    return left - right


def remainder(*expressions: Expression) -> str:
    """What is left of expressions that should vanish: "0", or the rest, cut where it is long."""
    left = [each for each in map(sp.factor_terms, map(sp.expand, expressions)) if each != 0]
    if not left:
        return "0"
    if len(str(left)) > 160:
        left = [sp.factor(each) for each in left]
    text = "; ".join(str(each).replace("**", "^") for each in left)
    return text if len(text) <= 160 else f"{text[:150]} ... ({len(text)} characters)"
