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
integral: Any = sp.Function("integral")


def jet(field: str, x: int = 0, t: int = 0, at: str = "") -> Expression:
    """Return the derivative of a field, x times by x and t times by t; `at` is "", "(0,t)" or "(L,t)"."""
    of_time = ("theta", "Theta", "V", "K2", "a1")
    if x and field in of_time:
        return sp.Integer(0)
    name = field
    if x or t:
        name += "_" + "x" * x + "t" * t
    if field not in of_time:
        name += at
    return symbol(name)


def jets(f: Expression) -> list[tuple[Expression, str, int, int, str]]:
    """Return symbol, field, order in x, order in t, and place of each jet in an expression."""
    found = []
    for s in f.free_symbols:
        match = JET.fullmatch(s.name)
        if match:
            field, orders, *arguments = match.groups(default="")
            at = ""
            if arguments[0]:
                # the place first
                at = f"({','.join(sorted(arguments))})"
            found.append((s, field, orders.count("x"), orders.count("t"), at))
    return found


x = symbol("x")
L = symbol("L")


@cache
def parse_expression(text: str) -> Expression:
    """Return the SymPy expression of a text without = or ;."""
    read = _parse(text, integral)
    return read.xreplace({s: jet(field, i, j, at) for s, field, i, j, at in jets(read)})


def _parse(text: str, integral: Any, *, evaluate: bool = True) -> Expression:
    """Return the expression of a text, each jet as a symbol of its own, with that function for an integral."""
    names: dict[str, Expression] = {"sqrt": sp.sqrt, "exp": sp.exp, "oo": sp.oo, "integral": integral}

    def stand_in(match: re.Match[str]) -> str:
        name = f"jet{len(names)}"
        names[name] = symbol(match[0])
        return name

    code = JET.sub(stand_in, text).replace("^", "**")
    # a keyword of Python
    code = re.sub(r"\blambda\b", "lambda_", code)
    for name in re.findall(r"[A-Za-z]\w*", code):
        names.setdefault(name, symbol(name))
    return sp.parse_expr(code, local_dict=names, evaluate=evaluate)


def tex(text: str) -> str:
    """Return the TeX of a statement, or of a formula by SymPy, in its own order; derivatives are indices."""
    if text in DATA["tex"]:
        return str(DATA["tex"][text])
    letters = {"pm": r"\pm", "lambda_": r"\lambda"}
    letters |= {f"Delta_k{i}": rf"\Delta k_{{{i}}}" for i in (1, 2, 3, 4)}

    def formula(part: str) -> str:
        if part.startswith("|"):
            return str(sp.latex(matrix_of_text(part), mat_str="vmatrix", mat_delim=""))
        read = _parse(part, lambda f: sp.Integral(f, (x, 0, L)), evaluate=False)
        names: dict[Expression, str] = {}
        for s in read.free_symbols:
            name, place, end = s.name.partition("(")
            names[s] = letters.get(s.name, sp.latex(symbol(name)) + place + end)
        return str(sp.latex(read, order="none", symbol_names=names))

    found = ""
    for part in filter(None, re.split(r"( = | < |; )", text)):
        if part in (" = ", " < ", "; "):
            found += part.replace("; ", r",\quad ")
        else:
            found += formula(part)
    return re.sub(r"\b1 (\\cdot )?(?=\\frac\{1\})", "", found.replace(r"+ \pm", r"\pm"))


def matrix_of_text(text: str) -> Expression:
    """Return the matrix of a text such as |a11 a12 / a21 a22|."""
    rows = text.strip("|").split(" / ")
    return sp.Matrix([list(map(parse_expression, row.split())) for row in rows])


def clauses(text: str) -> list[str]:
    """Return the parts of a text between semicolons."""
    return [clause.strip() for clause in text.split(";")]


def sides(text: str) -> dict[Expression, Expression]:
    """Return left and right side of each of a text's equations."""
    pairs = [clause.split(" = ") for clause in clauses(text) if " = " in clause]
    return {parse_expression(left): parse_expression(right) for left, right in pairs}


def difference(text: str) -> Expression:
    """Return left minus right side of a text's first equation."""
    left, right = next(iter(sides(text).items()))
    return left - right


def remainder(*expressions: Expression) -> str:
    """Return the rest of expressions that should vanish: "0", or the rest, cut where it is long."""
    left = [each for each in map(sp.factor_terms, map(sp.expand, expressions)) if each != 0]
    if not left:
        return "0"
    if len(str(left)) > 160:
        left = [sp.factor(each) for each in left]
    text = "; ".join(map(str, left)).replace("**", "^")
    if len(text) <= 160:
        return text
    return f"{text[:150]} ... ({len(text)} characters)"


# places of a jet
AT_TIP = "(L,t)"
AT_ROOT = "(0,t)"


def d_dx(f: Expression) -> Expression:
    """Return the total derivative by the running x; values at the ends do not move."""
    found = sp.diff(f, x)
    for s, field, i, j, at in jets(f):
        if not at:
            found += sp.diff(f, s) * jet(field, i + 1, j)
    return found


def d_dt(f: Expression) -> Expression:
    """Return the total derivative by time, also of integrals and of values at the ends."""
    inside, outside = integral_parts(f)
    found = _rate_of_jets(outside)
    if inside != 0:
        found += integral(_rate_of_jets(inside))
    return found


def _rate_of_jets(f: Expression) -> Expression:
    """Return the derivative by time of an expression without integrals; the weight a1 is constant."""
    found = sp.Integer(0)
    for s, field, i, j, at in jets(f):
        if s.name != "a1":
            found += sp.diff(f, s) * jet(field, i, j + 1, at)
    return found


def integral_parts(f: Expression) -> tuple[Expression, Expression]:
    """Return g and h of f = integral(g) + h."""
    f = sp.expand(f)
    integrals = f.atoms(integral)
    inside = sum((f.coeff(a) * a.args[0] for a in integrals), sp.Integer(0))
    return sp.expand(inside), f.subs(dict.fromkeys(integrals, 0))


def at_running_point(f: Expression) -> Expression:
    """Return an expression with values at x for those at the tip: for an arm of any length."""
    return f.subs({s: jet(field, i, j) for s, field, i, j, at in jets(f) if at == AT_TIP}).subs(L, x)


def balance_residual(f: Expression) -> str:
    """Return the rest of f = integral(g) + h(tip, root), which should vanish for every motion: "0" if it does.

    Let the arm end at a running x.  f vanishes for every length if it does for length 0, and if its slope
    g + dh/dx vanishes: integration by parts, without having to guess what to integrate.
    """
    inside, outside = integral_parts(f)
    at_length = at_running_point(outside)
    at_root: dict[Expression, Expression] = {}
    for s, field, i, j, at in jets(at_length):
        if at in ("", AT_ROOT) and field in ("y", "phi"):
            # (6), (7)
            at_root[s] = jet(field, i, j, AT_ROOT) if i else sp.Integer(0)
    return remainder(inside + d_dx(at_length), at_length.subs(at_root).subs(x, 0))


class MismatchError(Exception):
    """Unlike things are added."""


@cache
def unit_dimension(text: str) -> Expression:
    """Return the dimension of a unit such as "kg/m^3" or "N m s"; of no unit that of a pure number."""
    # so that the root of a square is the unit itself
    kg, m, s = symbols("kg m s", positive=True)
    force = kg * m / s**2
    units = {"kg": kg, "m": m, "s": s, "N": force, "Pa": force / m**2}
    return sp.parse_expr(text.replace("^", "**").replace(" ", "*") or "1", local_dict=units)


PAPER_UNITS: dict[str, Expression] = {name: unit_dimension(text) for name, text in DATA["units"].items()}


def base_units_text(dimension: Expression) -> str:
    """Return a dimension in SI base units, as a text."""
    powers = dimension.as_powers_dict()
    found = []
    for name in ("kg", "m", "s"):
        n = powers[unit_dimension(name)]
        if n == 1:
            found.append(name)
        elif n:
            found.append(f"{name}^{n}")
    return " ".join(found) or "1"


def dimension(f: Expression, units: dict[str, Expression]) -> Expression:
    """Return the dimension of an expression.  Raises MismatchError."""
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
    if f.func == integral:
        return parts[0] * unit_dimension("m")
    kinds = set(parts)
    if isinstance(f, sp.exp):
        kinds.add(sp.Integer(1))
    if len(kinds) > 1:
        raise MismatchError(" + ".join(sorted(map(base_units_text, kinds))))
    return kinds.pop()


def mismatch(f: Expression, units: dict[str, Expression]) -> str:
    """Return the terms of different dimensions in a sum: "0" if there are none.

    The dimension of a derivative is that of its field by x and t.
    """
    units = dict(units)
    for s, field, i, j, _ in jets(f):
        if s.name not in units:
            of_field = unit_dimension(DATA["field_units"][field])
            units[s.name] = of_field / unit_dimension("m") ** i / unit_dimension("s") ** j
    try:
        dimension(f, units)
    except MismatchError as found:
        return str(found)
    return "0"


def residual_text(found: Iterable[str]) -> str:
    """Return the residuals that are not "0", in one text."""
    return "; ".join(each for each in found if each != "0") or "0"
