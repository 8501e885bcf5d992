"""Outputs at any s: the fused kernel where it has all digits, ball arithmetic at the few points where it has not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex
from tfarm.errors import ParameterError

from .balls import nearest_float
from .chain import ElementChain
from .chain_values import expansions, free_outputs, free_slopes
from .enclosures import decimals, enclose, slope
from .fields import fields, from_root
from .free import free_response, low_frequency, low_frequency_tip
from .jets import Jet
from .outputs import Output, unit_scale
from .system import System
from .waves import evaluate

AT_A_POLE = 4 * float(np.finfo(float).eps)  # nearer than this share of |s|, no digit of the answer can be right
PROVEN_BITS = 60  # a little more than a float64 holds
_ENDS = {"theta": 0, "M": 1, "Q": 2, "W": 3, "Y": 4}
_FIELDS = {"Y": 0, "Phi": 1, "M": 2, "Q": 3}


def kernel_table(k: System, wanted: Sequence[Output]) -> NDArray[np.float64]:
    """The outputs as `waves.evaluate` reads them: worth keeping between calls."""
    if isinstance(k, ElementChain):
        return np.empty((0, 4))
    return np.array([
        (_ENDS.get(each.quantity, 0), each.power, each.gauge, float(unit_scale(each, k))) for each in wanted
    ])  # fmt: skip


def evaluate_outputs(
    k: System, wanted: Sequence[Output], table: NDArray[np.float64], s: Complex, x: float = 0.0
) -> Complex:
    """Outputs (rows) for a unit input at s (1-D), SI; x is a share of the length, for outputs along the arm.

    `table` is their `kernel_table`.  Raises ParameterError at a pole, naming it.
    """
    s = np.ascontiguousarray(s)
    values, suspects = np.empty((len(wanted), s.size), complex), np.empty(s.size, bool)
    with np.errstate(under="ignore", over="ignore", invalid="ignore", divide="ignore"):
        if isinstance(k, ElementChain):
            free = free_outputs(k, wanted, s, x)
            values, suspects = free.outputs / free.drive, free.lost
        else:
            evaluate(s, k.kernel, table, values, suspects)
            for row, each in ((row, each) for row, each in enumerate(wanted) if not each.is_at_end):
                field = fields(k, s, each.share(x))[0][_FIELDS[each.quantity]]
                values[row] = field * float(unit_scale(each, k)) * s**each.power
                values[row] /= 1.0 + k.damping * s if each.gauge else 1.0
    for i in np.flatnonzero(suspects | ~np.isfinite(values).all(axis=0)):
        values[:, i] = [value_with_care(k, each, complex(s[i]), x) for each in wanted]
    return values


def differentiate_outputs(k: System, wanted: Sequence[Output], s: Complex, x: float = 0.0) -> Complex:
    """The derivatives of the outputs (rows) with respect to s, by power series at the ends and by balls along x."""
    values = np.empty((len(wanted), s.size), complex)
    if isinstance(k, ElementChain):
        return _of_chain(k, wanted, s, x)
    with np.errstate(under="ignore", invalid="ignore", divide="ignore"):
        free, at = free_response(k, s), Jet.variable(s, 1)
        for row, each in enumerate(wanted):
            if each.is_at_end:
                numerator = free[_ENDS[each.quantity]] * _power(at, each.power) * float(unit_scale(each, k))
                ratio = numerator / free.drive
                values[row] = (ratio / (1.0 + k.damping * at) if each.gauge else ratio).c[1]
    suspects = free.parallel | (s == 0) | _at_pole(free.drive, s)
    for row, each in enumerate(wanted):
        for i in np.nonzero(suspects | (not each.is_at_end))[0]:
            values[row, i] = _slope_with_care(k, each, complex(s[i]), x)
    return values


def value_with_care(k: System, wanted: Output, s: complex, x: float = 0.0) -> complex:
    """One output at one s from a proven enclosure, or from the expansion at s = 0.

    Raises ParameterError at a pole, and where the value is larger than any float64.
    """
    _refuse_pole(k, wanted, s, x)
    if s == 0:
        return complex(expansion_at_zero(k, wanted, x)[2])
    value = nearest_float(enclose(k, wanted, s, bits=PROVEN_BITS, x=x))
    if not np.isfinite(value):
        raise ParameterError(
            key="s", value=s, remedy=f"{wanted.name} is larger than any float64 there; choose another s"
        )
    return value


def digits_of(k: System, wanted: Output, s: complex, digits: int, x: float = 0.0) -> tuple[str, str]:
    """Real and imaginary part as decimal strings, each with that many right digits."""
    _refuse_pole(k, wanted, s, x)
    return decimals(k, wanted, s, digits, x)


def expansion_at_zero(k: System, wanted: Output, x: float = 0.0) -> tuple[float, float, float, float]:
    """Coefficients of s^-2, s^-1, 1 and s in the output's expansion at s = 0."""
    return expansions_at_zero(k, [wanted], x)[0]


def expansions_at_zero(k: System, wanted: Sequence[Output], x: float = 0.0) -> list[tuple[float, float, float, float]]:
    """The expansions at s = 0 of several outputs, from one free response."""
    if isinstance(k, ElementChain):
        return expansions(k, wanted, x)
    s = Jet.variable(0.0, 7)
    *state, drive = low_frequency(k, s)
    order = next(n for n, coefficient in enumerate(drive.c) if coefficient != 0)

    def quantity(each: Output) -> Jet:
        constant, at = each.constant(k, x), each.share(x)
        if constant is not None:
            return constant * drive
        if each.is_at_end:
            return state[_ENDS[each.quantity]]
        if at < 1:
            return from_root(k, s * s, 1.0 + k.damping * s, tuple(state[:3]), at)[_FIELDS[each.quantity]]
        return state[_ENDS["Y"]] if each.quantity == "Y" else low_frequency_tip(k, s)[_FIELDS[each.quantity] - 1]

    def expand(each: Output) -> tuple[float, float, float, float]:
        quotient = Jet((quantity(each) * _power(s, each.power)).c[: 8 - order]) / drive.shifted(order)
        quotient = quotient / Jet((1.0 + k.damping * s).c[: 8 - order]) if each.gauge else quotient
        series = [0.0] * (2 - order) + [float(c) * float(unit_scale(each, k)) for c in quotient.c]
        return series[0], series[1], series[2], series[3]

    return [expand(each) for each in wanted]


def _of_chain(k: ElementChain, wanted: Sequence[Output], s: Complex, x: float) -> Complex:
    """The derivatives of a chain's outputs: N'/D - N D'/D^2, by balls where digits are lost."""
    with np.errstate(all="ignore"):
        free, slopes = free_slopes(k, wanted, s, x)
        values: Complex = (slopes.outputs - free.outputs * slopes.drive / free.drive) / free.drive
    for i in np.flatnonzero(free.lost | (s == 0) | ~np.isfinite(values).all(axis=0)):
        values[:, i] = [_slope_with_care(k, each, complex(s[i]), x) for each in wanted]
    return values


def _power(s: Any, power: int) -> Any:
    """s^power for any kind of number."""
    product = s if power else 1.0 + 0.0 * s
    for _ in range(power - 1):
        product = product * s
    return product


def _at_pole(drive: Jet, s: Complex) -> NDArray[np.bool_]:
    value, slope = drive.c
    return abs(value) < AT_A_POLE * abs(s) * abs(slope)  # both 0 where s^2 underflows: no pole there


def _refuse_pole(k: System, wanted: Output, s: complex, x: float) -> None:
    """Raise ParameterError if s is a pole to the last digit that a float64 holds."""
    if wanted.constant(k, x) is not None:
        return
    if s == 0:
        if any(expansion_at_zero(k, wanted, x)[:2]):
            raise ParameterError(key="s", value=0, remedy="a pole: the arm turns as a rigid body there; choose s != 0")
        return
    at = np.array([s])
    if isinstance(k, ElementChain):
        drive = Jet([part.drive for part in free_slopes(k, (), at, 0.0)])
    else:
        drive = free_response(k, at).drive
    if _at_pole(drive, at)[0]:
        name = f"a natural frequency, {abs(s):.10g} rad/s" if s.real == 0 else f"an eigenvalue, {s:.10g} 1/s"
        raise ParameterError(key="s", value=s, remedy=f"a pole: {name}; the response is infinite there, move s")


def _slope_with_care(k: System, wanted: Output, s: complex, x: float) -> complex:
    _refuse_pole(k, wanted, s, x)
    if s == 0:
        return complex(expansion_at_zero(k, wanted, x)[3])
    return nearest_float(slope(k, wanted, s, x=x))
