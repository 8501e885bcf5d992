"""Power series of drive and outputs in s at 0, in balls: expansions, and the order of each zero there."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import flint

from tfarm.exact.balls import Ball, Sweep, precision, rational, sum_series
from tfarm.exact.layout import Layout, readings
from tfarm.exact.outputs import Output
from tfarm.exact.system import Place, System

# of the power series at s = 0, whose coefficients are sums of small differences
SERIES_BITS = 512
# share of the largest coefficient, below which one is an exact zero
KNOWN_ZERO = 1e-80
# expansions at s = 0 of rigs and outputs: those of a report of six rigs
SERIES_KEPT = 512
# of the power series: the drive begins at s^2 at most
SERIES_ORDER = 8


class SlowSweep(Sweep):
    """The sweep with power series in s at 0, whose coefficients are balls."""

    def _functions(self, z_sum: Any, z_product: Any) -> tuple[Any, ...]:
        """Return F0..F3 by their series in z1 + z2 and z1 z2, which both begin with s^2."""
        return tuple(sum_series(z_sum, z_product, 2 * SERIES_ORDER))


@lru_cache(SERIES_KEPT)  # loops, models and pages need the same few of a rig
def expansion_at_zero(chain: System, output: Output, x: float = 0.0) -> tuple[float, float, float, float]:
    """Return the coefficients of s^-2, s^-1, 1 and s in an output's expansion at s = 0."""
    missing = 2 - _order(_series_at_zero(chain))
    coefficients = [float(c.mid()) for c in _quotient_at_zero(chain, output, x)]
    double_pole, pole, constant, slope, *_ = [0.0] * missing + coefficients
    return double_pole, pole, constant, slope


def _quotient_at_zero(chain: System, output: Output, x: float) -> list[Ball]:
    """Return the output's expansion from s^-n on, n the order of the drive's zero."""
    drive = _series_at_zero(chain)
    kept = SERIES_ORDER - _order(drive)
    with precision(SERIES_BITS):
        of_output = flint.arb_series(_series_at_zero(chain, output, x)[:kept], prec=kept)
        found = of_output / flint.arb_series(drive[-kept:], prec=kept)
        return [found[n] for n in range(kept)]


@lru_cache(SERIES_KEPT)
def constant_of(chain: System, wanted: Output, x: float) -> int | None:
    """Return the quantity for unit input, dimensionless, where that is 0, 1 or -1 at every s; else None.

    An end condition fixes it, such as the moment at a free tip: its series is the input's times that number.
    """
    layout = readings(chain, (wanted.base,), x)
    (one,) = layout.each
    with precision(SERIES_BITS):
        sweep = _slow_sweep(chain, layout.places)
        unit = rational(one.unit)
        found = sweep.numerator(one)
        size = max(abs((sweep.input * unit)[n]) for n in range(SERIES_ORDER))
        for value in (0, 1, -1):
            rest = found - sweep.input * (unit * value)
            if all(abs(rest[n]) < KNOWN_ZERO * size for n in range(SERIES_ORDER)):
                return value
    return None


def without_slow_pole(chain: System, wanted: Sequence[Output], x: float) -> list[tuple[float, float]]:
    """Return the coefficients of 1 and s in each output's expansion at s = 0, without those of a pole p next to 0.

    Those of r/(s - p) are c_k = -r/p^(k+1), and dominate from some n on.  So the rest is c_k - p^(n-k) c_n, with an
    error of (p/w)^(n-k), w the next pole.  In float64 it would be lost in -r/p.
    """
    # of Newton's method for a pole next to 0, each doubling its digits
    slow_pole_steps = 8
    drive = _series_at_zero(chain)
    first = _order(drive)
    with precision(SERIES_BITS):
        p: Ball = rational(0)
        D: Any = flint.arb_poly(drive[first:])
        # Newton's method on a power series that is nearly a line there
        for _ in range(slow_pole_steps):
            p = p - D(p) / D.derivative()(p)
        found = []
        for each in wanted:
            constant, slope, *others, last = _quotient_at_zero(chain, each, x)[first:]
            of_pole = last * p ** (len(others) + 1)
            rest = constant - of_pole * p, slope - of_pole
            found.append((float(rest[0].mid()), float(rest[1].mid())))
    return found


def order_at_zero(chain: System, wanted: Output, x: float = 0.0) -> int:
    """Return the order of the zero of an output of the free response at s = 0."""
    return _order(_series_at_zero(chain, wanted, x))


@lru_cache(SERIES_KEPT)
def _series_at_zero(chain: System, wanted: Output | None = None, x: float = 0.0) -> list[Ball]:
    """Return the power series at s = 0 of an output of the free response, else of the drive, with exact zeros."""
    layout = readings(chain, [wanted] if wanted else (), x)
    with precision(SERIES_BITS):
        sweep = _slow_sweep(chain, layout.places)
        if wanted is None:
            series = sweep.input
        else:
            series = sweep.output(layout.each[0])
        coefficients = [series[n] for n in range(SERIES_ORDER)]
        sizes = [abs(float(c.mid())) for c in coefficients]
        small = KNOWN_ZERO * max(sizes)
        return [rational(0) if size < small else c for size, c in zip(sizes, coefficients, strict=True)]


@lru_cache(SERIES_KEPT)  # one sweep has angle, rate and drive
def _slow_sweep(chain: System, places: tuple[Place, ...]) -> SlowSweep:
    """Return the sweep of a chain marked at these places."""
    return SlowSweep(Layout(chain, places), flint.arb_series([0, 1], prec=SERIES_ORDER))


def _order(coefficients: Sequence[Ball]) -> int:
    """Return the index of the first coefficient that is not 0, or their number."""
    return next((n for n, coefficient in enumerate(coefficients) if coefficient != 0), len(coefficients))
