"""Power series: `Jet`, whose numbers any formula runs on unchanged, and the expansions of outputs at s = 0."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from .balls import Sweep, precision, rational, summed
from .layout import Layout, readings
from .outputs import Output
from .system import System

SERIES_BITS = 512  # of the power series at s = 0, whose coefficients are sums of small differences
KNOWN_ZERO = 1e-80  # a coefficient below this share of the first is a zero that balls cannot know
SERIES_KEPT = 512  # expansions at s = 0 of rigs and outputs: more than a report of six rigs asks for
SLOW_POLE_STEPS = 8  # of Newton's method for a pole next to 0, each doubling its digits
SERIES_ORDER = 8  # of the power series: the drive begins at s^2 at most


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
            return Jet([a * other for a in self.c])
        return Jet([sum(self.c[i] * other.c[n - i] for i in range(n + 1)) for n in range(len(self.c))])

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


class SlowSweep(Sweep):
    """The sweep with power series (`Jet`) in s at 0, whose coefficients are balls."""

    @classmethod
    def of(cls, layout: Layout, terms: int) -> SlowSweep:
        """The sweep to so many terms."""
        return cls(layout, Jet([rational(0), rational(1), *[rational(0)] * (terms - 2)]))

    def _functions(self, z_sum: Any, z_product: Any) -> tuple[Any, ...]:
        """F0..F3 by their series in z1 + z2 and z1 z2, which begin with s^2 both."""
        return tuple(summed(z_sum, z_product, 2 * len(self.s.c)))


def expansions_at_zero(
    chain: System, wanted: Sequence[Output], x: float = 0.0
) -> list[tuple[float, float, float, float]]:
    """Coefficients of s^-2, s^-1, 1 and s in each output's expansion at s = 0."""
    return [_series_at_zero(chain, each, x) for each in wanted]


@lru_cache(SERIES_KEPT)  # loops, models and pages ask for the same few of a rig again and again
def _series_at_zero(chain: System, output: Output, x: float) -> tuple[float, float, float, float]:
    """The same of one output."""
    coefficients = [float(c.mid()) if hasattr(c, "mid") else float(c) for c in _quotient_at_zero(chain, output, x).c]
    padded = [0.0] * (2 - _leading(_drive_at_zero(chain))) + coefficients
    return padded[0], padded[1], padded[2], padded[3]


def _quotient_at_zero(chain: System, output: Output, x: float) -> Jet:
    """The output's expansion from s^-n on, n the order of the drive's zero, in balls."""
    drive = _drive_at_zero(chain)
    order = _leading(drive)
    with precision(SERIES_BITS):
        return Jet(_numerator_at_zero(chain, output, x).c[: SERIES_ORDER - order]) / drive.shifted(order)


def beside_slow_pole(chain: System, wanted: Sequence[Output], x: float) -> list[tuple[float, float]]:
    """Coefficients of 1 and s in each output's expansion at s = 0, without those of a single pole p next to 0.

    Of r/(s - p) they are c_k = -r/p^(k+1), beside which those of all other poles vanish from some n on: so what is left
    is c_k - p^(n-k) c_n, right to (p/w)^(n-k), w the next pole.  In float64 -r/p alone would drown it.
    """
    drive = _drive_at_zero(chain)
    first = _leading(drive)
    with precision(SERIES_BITS):
        of_drive = drive.shifted(first)
        p = rational(0)
        for _ in range(SLOW_POLE_STEPS):  # Newton's method on a power series that is nearly a line there
            p = p - sum(c * p**k for k, c in enumerate(of_drive.c)) / sum(
                k * c * p ** (k - 1) for k, c in enumerate(of_drive.c) if k
            )
        found = []
        for each in wanted:
            constant, slope, *others, last = _quotient_at_zero(chain, each, x).c[first:]
            power = p ** (len(others) + 1)
            found.append((float((constant - last * power * p).mid()), float((slope - last * power).mid())))
    return found


def order_at_zero(chain: System, wanted: Output, x: float = 0.0) -> int:
    """How often an output of the free response vanishes at s = 0."""
    with precision(SERIES_BITS):
        return _leading(_numerator_at_zero(chain, wanted, x))


@lru_cache(SERIES_KEPT)
def _drive_at_zero(chain: System) -> Jet:
    """The drive as a power series in s at 0, exact zeros told from rounding."""
    with precision(SERIES_BITS):
        return _cleared(SlowSweep.of(readings(chain, (), 0.0).layout, SERIES_ORDER).input)


def _numerator_at_zero(chain: System, output: Output, x: float) -> Jet:
    """An output of the free response so."""
    those = readings(chain, (output,), x)
    return _cleared(SlowSweep.of(those.layout, SERIES_ORDER).output(those.each[0]))


def _leading(series: Jet) -> int:
    """The number of the first coefficient that is not 0."""
    return next(n for n, coefficient in enumerate(series.c) if coefficient != 0)


def _cleared(jet: Jet) -> Jet:
    """The jet with exact zeros where only rounding is left."""
    sizes = [abs(rational(0) + c) for c in jet.c]
    largest = max(float(size.mid()) for size in sizes)
    return Jet(
        [rational(0) if float(size.mid()) < KNOWN_ZERO * largest else c for size, c in zip(sizes, jet.c, strict=True)]
    )
