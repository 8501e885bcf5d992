"""A small checker of dimensions: every sum must add like to like, every exponential must be of a pure number."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from .formulas import Expression

Dimension = tuple[Fraction, Fraction, Fraction]  # powers of kg, m, s
PURE_NUMBER: Dimension = (Fraction(0), Fraction(0), Fraction(0))
BASE = {"kg": (1, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "N": (1, 1, -2), "Pa": (1, -1, -2), "1": (0, 0, 0)}


class MismatchError(Exception):
    """Unlike things are added."""


def unit_dimension(text: str) -> Dimension:
    """The dimension of a unit such as "kg/m^3" or "N m s"."""
    total = PURE_NUMBER
    over = 1
    for token in text.replace("/", " / ").split():
        if token == "/":
            over = -1
            continue
        name, _, power = token.partition("^")
        exponent = over * int(power or 1)
        total = _plus(total, *(Fraction(exponent * n) for n in BASE[name]))
    return total


def spelled(dimension: Dimension) -> str:
    """A dimension in SI base units."""
    powers = zip(("kg", "m", "s"), dimension, strict=True)
    return " ".join(name if n == 1 else f"{name}^{n}" for name, n in powers if n) or "1"


def dimension(f: Expression, units: dict[str, Dimension]) -> Dimension | None:
    """Dimension of an expression, None of a zero.  Raises MismatchError."""
    if f.is_Symbol:
        return units[f.name]
    if f.is_number:
        return None if f == 0 else PURE_NUMBER
    if f.is_Add:
        return _like([dimension(each, units) for each in f.args])
    if f.is_Mul:
        return _product([dimension(each, units) for each in f.args])
    if f.is_Pow:
        base = dimension(f.base, units) or PURE_NUMBER
        power = Fraction(int(f.exp.p), int(f.exp.q))
        return (base[0] * power, base[1] * power, base[2] * power)
    if isinstance(f, sp.exp):
        return _like([dimension(f.args[0], units), PURE_NUMBER])
    if f.func.__name__ == "integral":  # over x
        inside = dimension(f.args[0], units)
        return None if inside is None else _plus(inside, *(Fraction(n) for n in BASE["m"]))
    raise TypeError(f"no dimension of {f}")


def _plus(a: Dimension, *b: Fraction) -> Dimension:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _product(factors: list[Dimension | None]) -> Dimension | None:
    total = PURE_NUMBER
    for factor in factors:
        if factor is None:
            return None
        total = _plus(total, *factor)
    return total


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
