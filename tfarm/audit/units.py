"""Dimensions of what stands in the paper's formulas, as its equations need them."""

from __future__ import annotations

from .dimensions import Dimension, mismatch, unit_dimension
from .formulas import Expression, jet_parts, sides

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


def units_in(f: Expression, units: dict[str, Dimension]) -> dict[str, Dimension]:
    """The dimension of every symbol of an expression; a derivative's is its field's by x and t."""
    found = dict(units)
    for s in f.free_symbols:
        parts = jet_parts(s)
        if parts and s.name not in units:
            field, i, j, _ = parts
            kg, m, second = unit_dimension(FIELD_UNITS[field])
            found[s.name] = (kg, m - i, second - j)
    return found


def unlike(text: str, units: dict[str, Dimension]) -> str:
    """What does not add up in a text's equations: "0" if all sides and sums are of one dimension."""
    for left, right in sides(text).items():
        rest = left - right
        found = mismatch(rest, units_in(rest, units))
        if found != "0":
            return found
    return "0"
