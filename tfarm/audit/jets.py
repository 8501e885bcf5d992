"""Calculus on jets: total derivatives, and identities between integrals along the arm and values at its ends."""

from __future__ import annotations

import sympy as sp

from .formulas import Expression, jet, jet_parts, remainder, symbol

x, L = symbol("x"), symbol("L")
AT_TIP = "(L,t)"  # places of a jet
AT_ROOT = "(0,t)"


def d_dx(f: Expression) -> Expression:
    """Total derivative by the running x; values at the ends do not move."""
    moving = [(s, parts) for s in f.free_symbols if (parts := jet_parts(s)) and not parts[3]]
    return sp.diff(f, x) + sum(sp.diff(f, s) * jet(field, i + 1, j) for s, (field, i, j, _) in moving)


def d_dt(f: Expression) -> Expression:
    """Total derivative by time, also of integrals and of values at the ends."""
    inside, outside = integral_parts(f)
    rate = _d_dt(outside)
    return rate + sp.Function("integral")(_d_dt(inside)) if inside != 0 else rate


def _d_dt(f: Expression) -> Expression:
    moving = [(s, parts) for s in f.free_symbols if (parts := jet_parts(s)) and s.name != "a1"]
    return sum((sp.diff(f, s) * jet(field, i, j + 1, at) for s, (field, i, j, at) in moving), sp.Integer(0))


def integral_parts(f: Expression) -> tuple[Expression, Expression]:
    """(g, h) of f = integral(g) + h."""
    f = sp.expand(f)
    integrals = [a for a in f.atoms(sp.Function) if a.func.__name__ == "integral"]
    inside = sum((f.coeff(a) * a.args[0] for a in integrals), sp.Integer(0))
    return sp.expand(inside), f.subs(dict.fromkeys(integrals, 0))


def at_running_point(f: Expression) -> Expression:
    """Values at the tip as values at x: what holds for an arm of any length."""
    tip = {s: jet(*found[:3]) for s in f.free_symbols if (found := jet_parts(s)) and found[3] == AT_TIP}
    return f.subs(tip).subs(L, x)


def at_root(f: Expression) -> Expression:
    """f at x = 0, where y = phi = 0 at all times (6), (7)."""
    ends = {}
    for s in f.free_symbols:
        found = jet_parts(s)
        if found and found[3] in ("", AT_ROOT) and found[0] in ("y", "phi"):
            field, i, j, _ = found
            ends[s] = jet(field, i, j, AT_ROOT) if i else sp.Integer(0)
    return f.subs(ends).subs(x, 0)


def unbalanced(f: Expression) -> str:
    """What keeps f = integral(g) + h(tip, root) from vanishing for every motion: "0" if nothing does.

    Let the arm end at a running x.  f vanishes for every length if it does for length 0, and if its slope
    g + dh/dx vanishes: integration by parts, without having to guess what to integrate.
    """
    inside, outside = integral_parts(f)
    outside = at_running_point(outside)
    return remainder(inside + d_dx(outside), at_root(outside))
