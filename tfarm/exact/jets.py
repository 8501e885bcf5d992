"""Truncated power series in s, for exact derivatives and expansions: the algebra of `waves` runs on them unchanged."""

from __future__ import annotations

from typing import Any

import numpy as np


class Jet:
    """c_0 + c_1 h + c_2 h^2 + ... to a fixed order; every coefficient is an array of the same shape."""

    __array_ufunc__ = None  # let NumPy arrays defer to the operators below

    def __init__(self, coefficients: Any) -> None:
        self.c: list[Any] = list(coefficients)

    @classmethod
    def variable(cls, at: Any, order: int) -> Jet:
        """s itself, expanded around `at`."""
        zero = np.zeros_like(at)
        return cls([at, zero + 1.0] + [zero] * (order - 1))

    def _other(self, other: Any) -> list[Any]:
        return other.c if isinstance(other, Jet) else [other] + [0.0] * (len(self.c) - 1)

    def __add__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([self.c[0] + other, *self.c[1:]])
        return Jet([a + b for a, b in zip(self.c, other.c, strict=True)])

    def __sub__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([self.c[0] - other, *self.c[1:]])
        return Jet([a - b for a, b in zip(self.c, other.c, strict=True)])

    def __rsub__(self, other: Any) -> Jet:
        return Jet([b - a for a, b in zip(self.c, self._other(other), strict=True)])

    def __neg__(self) -> Jet:
        return Jet([-a for a in self.c])

    def __mul__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([a if type(a) is float and a == 0.0 else a * other for a in self.c])
        b = other.c
        if len(b) == 2:  # most of the work: a slope that is the plain number 0.0 costs nothing
            (a0, a1), (b0, b1) = self.c, b
            if type(b1) is float:
                return Jet([a0 * b0, a1 if type(a1) is float else a1 * b0])
            slope = a0 * b1
            if type(a1) is not float:
                slope = slope + a1 * b0
            return Jet([a0 * b0, slope])
        return Jet([sum(self.c[i] * b[n - i] for i in range(n + 1)) for n in range(len(self.c))])

    def __truediv__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([a / other for a in self.c])
        b = other.c
        quotient: list[Any] = []
        for n, a in enumerate(self.c):
            rest = a - sum(quotient[i] * b[n - i] for i in range(n)) if n else a
            quotient.append(rest / b[0])
        return Jet(quotient)

    def __rtruediv__(self, other: Any) -> Jet:
        return Jet(self._other(other)) / self

    __radd__ = __add__
    __rmul__ = __mul__

    def shifted(self, by: int) -> Jet:
        """Divided by h^by, the first `by` coefficients being zero; the order falls by as much."""
        return Jet(self.c[by:])
