"""The language the formulas are written in, and its reading into SymPy.

    rho*A*(y_tt + x*theta_tt) - kappa*G*A*(y_xx - phi_x) = 0
    V_t = theta_t*(a2*u + (a2 - a1)*E*I*phi_x(0,t)); a3 = a1

Clauses are separated by semicolons.  y_xt is a derivative of y at the running x, y_xt(L,t) the same at the tip, and
each is a symbol of its own (a jet coordinate).  theta, V and the gains do not depend on x, so that theta_x is 0.
Of the two arguments the one that is a place (0, L) is taken as the place, in whatever order they come.
integral(f) is the integral of f over x from 0 to L.

Calculus on jets: total derivatives, and identities between integrals along the arm and values at its ends.

A small checker of dimensions: every sum must add like to like, every exponential must be of a pure number.

A dimension is a product of powers of kg, m and s, as SymPy has it; those of the paper's symbols are in
`claims.toml`.
"""

import re
from collections.abc import Iterable
from functools import cache
from typing import Any

import sympy as sp

from tfarm.audit.rows import DATA

# sympy comes without types
Expression = Any
symbol = sp.Symbol
symbols: Any = sp.symbols
JET = re.compile(r"\b(y|phi|theta|Y|Phi|Theta|V|K2|a1)(?:_(x*t*))?(?!\w)(?:\(([0Lts]), ?([0Lts])\))?")
NAME = re.compile(r"[A-Za-z]\w*")
LETTERS = {"pm": r"\pm", "lambda_": r"\lambda", **{f"Delta_k{i}": rf"\Delta k_{{{i}}}" for i in (1, 2, 3, 4)}}
FUNCTIONS = {"sqrt": sp.sqrt, "exp": sp.exp, "oo": sp.oo}


def jet(field: str, x: int = 0, t: int = 0, at: str = "") -> Expression:
    """The derivative of a field, x times by x and t times by t; `at` is "", "(0,t)" or "(L,t)"."""
    of_time = ("theta", "Theta", "V", "K2", "a1")
    if x and field in of_time:
        return sp.Integer(0)
    orders = "x" * x + "t" * t
    return symbol(f"{field}{'_' + orders if orders else ''}{'' if field in of_time else at}")


def jets(f: Expression) -> list[tuple[Expression, str, int, int, str]]:
    """(symbol, field, order in x, order in t, place) of each jet in an expression."""
    found = ((s, match.groups(default="")) for s in f.free_symbols if (match := JET.fullmatch(s.name)))
    return [
        (
            s,
            field,
            orders.count("x"),
            orders.count("t"),
            f"({','.join(sorted(at))})" if at[0] else "",
        )  # the place first
        for s, (field, orders, *at) in found
    ]


x = symbol("x")
L = symbol("L")


@cache
def parse_expression(text: str) -> Expression:
    """The SymPy expression of a text without = or ;."""

    read = _read(text, sp.Function("integral"))
    return read.xreplace({s: jet(field, i, j, at) for s, field, i, j, at in jets(read)})


def _read(text: str, integral: Any, **how: Any) -> Expression:
    names: dict[str, Expression] = {**FUNCTIONS, "integral": integral}

    def stand_in(match: re.Match[str]) -> str:
        name = f"jet{len(names)}"
        names[name] = symbol(match[0])
        return name

    code = JET.sub(stand_in, text).replace("^", "**")
    # a keyword of Python
    code = re.sub(r"\blambda\b", "lambda_", code)
    names |= {name: symbol(name) for name in NAME.findall(code) if name not in names}
    return sp.parse_expr(code, local_dict=names, **how)


def tex(text: str) -> str:
    """The TeX of a statement, or of a formula by SymPy, in its own order; derivatives are indices, as in the text."""
    if text in DATA["tex"]:
        return str(DATA["tex"][text])

    def written(part: str) -> str:
        if part.startswith("|"):
            return str(sp.latex(matrix_of_text(part), mat_str="vmatrix", mat_delim=""))
        read = _read(part, lambda f: sp.Integral(f, (x, 0, L)), evaluate=False)
        heads = {s: s.name.partition("(") for s in read.free_symbols}
        names = {
            s: LETTERS.get(s.name, sp.latex(symbol(name)) + place + end)
            for s, (name, place, end) in heads.items()
        }
        return str(sp.latex(read, order="none", symbol_names=names))

    parts = re.split(r"( = | < |; )", text)
    found = "".join(
        part.replace("; ", r",\quad ") if n % 2 else written(part) for n, part in enumerate(parts) if part
    )
    return re.sub(r"\b1 (\\cdot )?(?=\\frac\{1\})", "", found.replace(r"+ \pm", r"\pm"))


def matrix_of_text(text: str) -> Expression:
    """The matrix of a text such as |a11 a12 / a21 a22|."""
    return sp.Matrix(
        [[parse_expression(entry) for entry in row.split()] for row in text.strip("|").split(" / ")]
    )


def clauses(text: str) -> list[str]:
    """The parts of a text between semicolons."""
    return [clause.strip() for clause in text.split(";")]


def sides(text: str) -> dict[Expression, Expression]:
    """Left and right side of each of a text's equations."""
    pairs = [clause.split(" = ") for clause in clauses(text) if " = " in clause]
    return {parse_expression(left): parse_expression(right) for left, right in pairs}


def difference(text: str) -> Expression:
    """Left minus right side of a text's first equation."""
    left, right = next(iter(sides(text).items()))
    return left - right


def remainder(*expressions: Expression) -> str:
    """The rest of expressions that should vanish: "0", or the rest, cut where it is long."""
    left = [each for each in map(sp.factor_terms, map(sp.expand, expressions)) if each != 0]
    if not left:
        return "0"
    if len(str(left)) > 160:
        left = [sp.factor(each) for each in left]
    text = "; ".join(str(each).replace("**", "^") for each in left)
    if len(text) <= 160:
        return text
    return f"{text[:150]} ... ({len(text)} characters)"


# places of a jet
AT_TIP = "(L,t)"
AT_ROOT = "(0,t)"


def d_dx(f: Expression) -> Expression:
    """Total derivative by the running x; values at the ends do not move."""
    return sp.diff(f, x) + sum(
        sp.diff(f, s) * jet(field, i + 1, j) for s, field, i, j, at in jets(f) if not at
    )


def d_dt(f: Expression) -> Expression:
    """Total derivative by time, also of integrals and of values at the ends."""
    inside, outside = integral_parts(f)
    rate = _d_dt(outside)
    return rate + sp.Function("integral")(_d_dt(inside)) if inside != 0 else rate


def _d_dt(f: Expression) -> Expression:
    terms = (sp.diff(f, s) * jet(field, i, j + 1, at) for s, field, i, j, at in jets(f) if s.name != "a1")
    return sum(terms, sp.Integer(0))


def integral_parts(f: Expression) -> tuple[Expression, Expression]:
    """(g, h) of f = integral(g) + h."""
    f = sp.expand(f)
    integrals = [a for a in f.atoms(sp.Function) if a.func.__name__ == "integral"]
    inside = sum((f.coeff(a) * a.args[0] for a in integrals), sp.Integer(0))
    return sp.expand(inside), f.subs(dict.fromkeys(integrals, 0))


def at_running_point(f: Expression) -> Expression:
    """Values at the tip as values at x: for an arm of any length."""
    return f.subs({s: jet(field, i, j) for s, field, i, j, at in jets(f) if at == AT_TIP}).subs(L, x)


def balance_residual(f: Expression) -> str:
    """The rest of f = integral(g) + h(tip, root), which should vanish for every motion: "0" if it does.

    Let the arm end at a running x.  f vanishes for every length if it does for length 0, and if its slope
    g + dh/dx vanishes: integration by parts, without having to guess what to integrate.
    """
    inside, outside = integral_parts(f)
    at_length = at_running_point(outside)
    fields = [each for each in jets(at_length) if each[4] in ("", AT_ROOT) and each[1] in ("y", "phi")]
    # (6), (7)
    at_root = {s: jet(field, i, j, AT_ROOT) if i else sp.Integer(0) for s, field, i, j, _ in fields}
    return remainder(inside + d_dx(at_length), at_length.subs(at_root).subs(x, 0))


# so that the root of a square is the unit itself
KG, METRE, SECOND = sp.symbols("kg m s", positive=True)
UNITS = {"kg": KG, "m": METRE, "s": SECOND, "N": KG * METRE / SECOND**2, "Pa": KG / (METRE * SECOND**2)}


class MismatchError(Exception):
    """Unlike things are added."""


def unit_dimension(text: str) -> Expression:
    """The dimension of a unit such as "kg/m^3" or "N m s"; of no unit that of a pure number."""
    return sp.parse_expr(text.replace("^", "**").replace(" ", "*") or "1", local_dict=UNITS)


PAPER_UNITS: dict[str, Expression] = {name: unit_dimension(text) for name, text in DATA["units"].items()}


def base_units_text(dimension: Expression) -> str:
    """A dimension in SI base units."""
    powers = dimension.as_powers_dict()
    each = ((name, powers[UNITS[name]]) for name in ("kg", "m", "s"))
    return " ".join(name if n == 1 else f"{name}^{n}" for name, n in each if n) or "1"


def dimension(f: Expression, units: dict[str, Expression]) -> Expression:
    """The dimension of an expression.  Raises MismatchError."""
    if f.is_Symbol:
        return units[f.name]
    if f.is_number:
        return sp.Integer(1)
    parts = [dimension(each, units) for each in f.args]
    if f.is_Mul:
        return sp.Mul(*parts)
    if f.is_Pow:
        return parts[0] ** f.exp
    # over x
    if f.func.__name__ == "integral":
        return parts[0] * METRE
    kinds = {*parts, sp.Integer(1)} if isinstance(f, sp.exp) else set(parts)
    if len(kinds) > 1:
        raise MismatchError(" + ".join(sorted(base_units_text(each) for each in kinds)))
    return kinds.pop()


def mismatch(f: Expression, units: dict[str, Expression]) -> str:
    """The terms of different dimensions in a sum: "0" if there are none.

    The dimension of a derivative is that of its field by x and t.
    """
    of_fields = {
        s.name: unit_dimension(DATA["field_units"][field]) / METRE**i / SECOND**j
        for s, field, i, j, _ in jets(f)
        if s.name not in units
    }
    try:
        dimension(f, units | of_fields)
    except MismatchError as found:
        return str(found)
    return "0"


def residual_text(found: Iterable[str]) -> str:
    """Residuals that are not "0", in one text."""
    return "; ".join(each for each in found if each != "0") or "0"
