"""Power series of drive and outputs in s at 0, in balls: expansions, and how often each vanishes there."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import flint

from .balls import Ball, Sweep, precision, rational, summed
from .layout import Layout, readings
from .outputs import Output
from .system import Place, System

SERIES_BITS = 512  # of the power series at s = 0, whose coefficients are sums of small differences
KNOWN_ZERO = 1e-80  # a coefficient below this share of the first is a zero that balls cannot know
SERIES_KEPT = 512  # expansions at s = 0 of rigs and outputs: more than a report of six rigs asks for
SLOW_POLE_STEPS = 8  # of Newton's method for a pole next to 0, each doubling its digits
SERIES_ORDER = 8  # of the power series: the drive begins at s^2 at most


class SlowSweep(Sweep):
    """The sweep with power series in s at 0, whose coefficients are balls."""

    def _functions(self, z_sum: Any, z_product: Any) -> tuple[Any, ...]:
        """F0..F3 by their series in z1 + z2 and z1 z2, which begin with s^2 both."""
        return tuple(summed(z_sum, z_product, 2 * SERIES_ORDER))


def expansions_at_zero(
    chain: System, wanted: Sequence[Output], x: float = 0.0
) -> list[tuple[float, float, float, float]]:
    """Coefficients of s^-2, s^-1, 1 and s in each output's expansion at s = 0."""
    return [_series_at_zero(chain, each, x) for each in wanted]


@lru_cache(SERIES_KEPT)  # loops, models and pages ask for the same few of a rig again and again
def _series_at_zero(chain: System, output: Output, x: float) -> tuple[float, float, float, float]:
    """The same of one output."""
    coefficients = [float(c.mid()) for c in _quotient_at_zero(chain, output, x)]
    padded = [0.0] * (2 - _leading(_drive_at_zero(chain))) + coefficients
    return padded[0], padded[1], padded[2], padded[3]


def _quotient_at_zero(chain: System, output: Output, x: float) -> list[Ball]:
    """The output's expansion from s^-n on, n the order of the drive's zero."""
    drive = _drive_at_zero(chain)
    kept = SERIES_ORDER - _leading(drive)
    with precision(SERIES_BITS):
        of_output = flint.arb_series(_numerator_at_zero(chain, output, x)[:kept], prec=kept)
        found = of_output / flint.arb_series(drive[-kept:], prec=kept)
        return [found[n] for n in range(kept)]


def beside_slow_pole(chain: System, wanted: Sequence[Output], x: float) -> list[tuple[float, float]]:
    """Coefficients of 1 and s in each output's expansion at s = 0, without those of a single pole p next to 0.

    Of r/(s - p) they are c_k = -r/p^(k+1), beside which those of all other poles vanish from some n on: so what is left
    is c_k - p^(n-k) c_n, right to (p/w)^(n-k), w the next pole.  In float64 -r/p alone would drown it.
    """
    drive = _drive_at_zero(chain)
    first = _leading(drive)
    with precision(SERIES_BITS):
        p = rational(0)
        for _ in range(SLOW_POLE_STEPS):  # Newton's method on a power series that is nearly a line there
            p = p - sum(c * p**k for k, c in enumerate(drive[first:])) / sum(
                k * c * p ** (k - 1) for k, c in enumerate(drive[first:]) if k
            )
        found = []
        for each in wanted:
            constant, slope, *others, last = _quotient_at_zero(chain, each, x)[first:]
            power = p ** (len(others) + 1)
            found.append((float((constant - last * power * p).mid()), float((slope - last * power).mid())))
    return found


@lru_cache(SERIES_KEPT)
def order_at_zero(chain: System, wanted: Output, x: float = 0.0) -> int:
    """How often an output of the free response vanishes at s = 0."""
    with precision(SERIES_BITS):
        return _leading(_numerator_at_zero(chain, wanted, x))


@lru_cache(SERIES_KEPT)
def _drive_at_zero(chain: System) -> list[Ball]:
    """The coefficients of the drive as a power series in s at 0, exact zeros told from rounding."""
    with precision(SERIES_BITS):
        return _cleared(_swept(chain, ()).input)


def _numerator_at_zero(chain: System, output: Output, x: float) -> list[Ball]:
    """Those of an output of the free response."""
    those = readings(chain, (output,), x)
    return _cleared(_swept(chain, those.layout.places).output(those.each[0]))


@lru_cache(SERIES_KEPT)  # angle, rate and drive are read from one sweep
def _swept(chain: System, places: tuple[Place, ...]) -> SlowSweep:
    """The sweep of a chain marked at these places."""
    return SlowSweep(Layout(chain, places), flint.arb_series([0, 1], prec=SERIES_ORDER))


def _leading(coefficients: Sequence[Ball]) -> int:
    """The number of the first that is not 0, or of them all."""
    return next((n for n, coefficient in enumerate(coefficients) if coefficient != 0), len(coefficients))


def _cleared(series: Any) -> list[Ball]:
    """Its coefficients, with exact zeros where only rounding is left."""
    coefficients = [series[n] for n in range(SERIES_ORDER)]
    sizes = [abs(float(c.mid())) for c in coefficients]
    return [rational(0) if size < KNOWN_ZERO * max(sizes) else c for size, c in zip(sizes, coefficients, strict=True)]
