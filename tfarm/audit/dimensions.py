"""A small checker of dimensions: every sum must add like to like, every exponential must be of a pure number.

A dimension is a product of powers of kg, m and s, as SymPy has it; those of what stands in the paper's formulas are as
its equations need them.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from .formulas import Expression, jet_parts, sides

Dimension = Any  # sympy comes without types

KG, METRE, SECOND = sp.symbols("kg m s", positive=True)  # so that the root of a square is the unit itself
UNITS = {"kg": KG, "m": METRE, "s": SECOND, "N": KG * METRE / SECOND**2, "Pa": KG / (METRE * SECOND**2)}


class MismatchError(Exception):
    """Unlike things are added."""


def unit_dimension(text: str) -> Dimension:
    """The dimension of a unit such as "kg/m^3" or "N m s"; of no unit that of a pure number."""
    return sp.parse_expr(text.replace("^", "**").replace(" ", "*") or "1", local_dict=UNITS)


NEEDED = {
    "L": "m", "A": "m^2", "rho": "kg/m^3", "E": "Pa", "C": "s", "I_c": "kg m^2", "m": "kg", "kappa": "1", "G": "Pa",
    "I": "m^4", "I_h": "kg m^2",
}  # fmt: skip
OTHERS = {
    "s": "1/s", "x": "m", "pm": "1", "u": "N m", "U": "N m s", "K1": "N m s", "K2": "1", "a1": "1", "a2": "1",
    "a3": "1", "lambda_1": "1/m", "lambda_2": "1/m", "lambda_": "1/m", "k1": "m s", "k2": "m s", "k3": "m s",
    "k4": "m s",
}  # fmt: skip
FIELD_UNITS = {"y": "m", "phi": "1", "theta": "1", "V": "N m", "Y": "m s", "Phi": "s", "Theta": "s"}
PAPER_UNITS: dict[str, Dimension] = {name: unit_dimension(text) for name, text in (NEEDED | OTHERS).items()}


def spelled(dimension: Dimension) -> str:
    """A dimension in SI base units."""
    powers = dimension.as_powers_dict()
    each = ((name, powers[UNITS[name]]) for name in ("kg", "m", "s"))
    return " ".join(name if n == 1 else f"{name}^{n}" for name, n in each if n) or "1"


def dimension(f: Expression, units: dict[str, Dimension]) -> Dimension | None:
    """Dimension of an expression, None of a zero.  Raises MismatchError."""
    if f.is_Symbol:
        return units[f.name]
    if f.is_number:
        return None if f == 0 else sp.Integer(1)
    if f.is_Add:
        return _like([dimension(each, units) for each in f.args])
    if f.is_Mul:
        factors = [dimension(each, units) for each in f.args]
        return None if None in factors else sp.Mul(*factors)
    if f.is_Pow:
        return (dimension(f.base, units) or sp.Integer(1)) ** f.exp
    if isinstance(f, sp.exp):
        return _like([dimension(f.args[0], units), sp.Integer(1)])
    if f.func.__name__ == "integral":  # over x
        inside = dimension(f.args[0], units)
        return None if inside is None else inside * METRE
    raise TypeError(f"no dimension of {f}")


def _like(found: list[Dimension | None]) -> Dimension | None:
    kinds = {each for each in found if each is not None}
    if len(kinds) > 1:
        raise MismatchError(" + ".join(sorted(spelled(each) for each in kinds)))
    return kinds.pop() if kinds else None


def mismatch(f: Expression, units: dict[str, Dimension]) -> str:
    """What does not add up in an expression: "0" if all does."""
    try:
        dimension(f, units)
    except MismatchError as found:
        return str(found)
    return "0"


def units_in(f: Expression, units: dict[str, Dimension]) -> dict[str, Dimension]:
    """The dimension of every symbol of an expression; a derivative's is its field's by x and t."""
    found = dict(units)
    for s in f.free_symbols:
        parts = jet_parts(s)
        if parts and s.name not in units:
            field, i, j, _ = parts
            found[s.name] = unit_dimension(FIELD_UNITS[field]) / METRE**i / SECOND**j
    return found


def unlike(text: str, units: dict[str, Dimension]) -> str:
    """What does not add up in a text's equations: "0" if all sides and sums are of one dimension."""
    for left, right in sides(text).items():
        rest = left - right
        found = mismatch(rest, units_in(rest, units))
        if found != "0":
            return found
    return "0"
