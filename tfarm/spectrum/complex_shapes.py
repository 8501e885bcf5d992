"""Shapes of damped modes: the free response at an eigenvalue, in balls, so that no digit is lost along the arm."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.errors import ConvergenceError
from tfarm.exact.balls import State, nearest, point, precision
from tfarm.exact.characteristic import characteristic
from tfarm.exact.coefficients import Coefficients
from tfarm.exact.free import free_response

Complex = NDArray[np.complexfloating[Any, Any]]


def mode_field(k: Coefficients, s: complex, quantity: str, x: NDArray[np.float64]) -> Complex:
    """ "W", "Psi" or "M" (dimensionless lengths and moments) at the shares x, of unit modal mass in SI units.

    At an eigenvalue  D'(s) theta = a,  the mode's  2 s (mass) + (damping)  in the shape's own scale (reciprocity,
    differentiated); the shape is scaled to  a = 2 s, its tip moving up.
    """
    at = np.array([s])
    free = free_response(k, at)
    theta, slope = complex(free.theta.c[0][0]), complex(characteristic(k, at).slope[0])
    if theta == 0 or slope == 0:
        raise ConvergenceError(f"the hub does not feel the mode at {s:.6g} 1/s, or it is double", s, slope)
    unit = np.sqrt(2 * s / (theta * slope) * float(k.length / k.EI)) * theta
    with precision(128 + 8 * math.ceil(abs(np.real(free.scale[0])))):
        state = State(k, point(s))
        values = [nearest(_at(state, quantity, float(share)) / state.theta) for share in x]
        tip = nearest(_at(state, "W", 1.0) / state.theta) or nearest(_at(state, "Psi", 1.0) / state.theta)
    unit = -unit if (unit * tip).real < 0 else unit
    shape: Complex = unit * np.array(values, dtype=complex)
    return shape


def _at(state: State, quantity: str, x: float) -> Any:
    if quantity == "W":
        return state.field("Y", x) + x * state.theta
    if quantity == "Psi":
        return state.field("Phi", x) + state.theta
    return state.field("M", x) / state.d
