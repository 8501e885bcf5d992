"""Shapes of damped modes: the free response at an eigenvalue, in balls, so that no digit is lost along the arm."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex
from tfarm.errors import ConvergenceError
from tfarm.exact.balls import State, nearest_float, point, precision
from tfarm.exact.chain import ElementChain
from tfarm.exact.chain_values import free_fields
from tfarm.exact.characteristic import characteristic
from tfarm.exact.coefficients import EndCondition
from tfarm.exact.elements import Place
from tfarm.exact.free import free_response
from tfarm.exact.system import System

SHAPE_BITS = 128  # of working precision: twice what a float64 holds, and more for waves that cancel
BITS_A_UNIT = 8  # of the exponent by which waves grow along the arm, 1.44 bits each: room for products of several


def mode_field(k: System, s: complex, quantity: str, x: NDArray[np.float64]) -> Complex:
    """ "W", "Psi" or "M" (dimensionless lengths and moments) at the shares x, of unit modal mass in SI units.

    At an eigenvalue  D'(s) theta = a  (locked hub: D'(s) M0 = a),  a the mode's  2 s (mass) + (damping)  in the shape's
    own scale (reciprocity, differentiated); the shape is scaled to  a = 2 s, its tip moving up (turning, if pinned).
    """
    if isinstance(k, ElementChain):
        return _of_chain(k, s, quantity, x)
    at = np.array([s])
    free = free_response(k, at)
    theta, M0, slope = (complex(part) for part in (free.theta.c[0][0], free.M.c[0][0], characteristic(k, at).slope[0]))
    hub = EndCondition.of(k.hub_inertia)
    turning, force = float(hub.inertia) * s * s, float(hub.force)
    by_moment = k.is_locked or abs(turning) > force  # a heavy hub hardly turns: M0 keeps its digits
    if by_moment:
        theta = M0 if k.is_locked else M0 * force / turning
    if theta == 0 or slope == 0:
        raise ConvergenceError(f"the hub does not feel the mode at {s:.6g} 1/s, or it is double", s, slope)
    unit = np.sqrt(2 * s / (theta * slope) * float(k.length / k.EI)) * (M0 if by_moment else theta)
    with precision(SHAPE_BITS + BITS_A_UNIT * math.ceil(abs(np.real(free.scale[0])))):
        state = State(k, point(s))
        one = state.M0 if by_moment else state.theta
        values = [nearest_float(_at(state, quantity, float(share)) / one) for share in x]
        tip = nearest_float(_at(state, "W" if isinstance(k.tip_mass, Fraction) else "Psi", 1.0) / one)
    unit = -unit if (unit * tip).real < 0 else unit
    return unit * np.array(values, dtype=complex)


def _of_chain(k: ElementChain, s: complex, quantity: str, x: NDArray[np.float64]) -> Complex:
    """`mode_field` of a chain: the reciprocity is that of torque and hub angle, or of hub angle and moment if held."""
    at, places = np.array([s]), [Place(Fraction(float(share))) for share in (*x, 1.0)]
    fields, theta, scale = free_fields(k, at, [*places, Place(Fraction(0), "inner")])
    drive = characteristic(k, at)
    slope, back = drive.slope[0], np.exp(scale - drive.scale)  # a chain that is cut has another scale
    fields, theta = fields * back, theta * back
    _, _, M, Q = fields[:, 0, -1]
    lag = 1.0 + float(k.drive.lag) * s
    product = complex(slope * (theta[0] / lag if k.drive.turns else M + float(k.radius) * Q))
    if product == 0 or not np.isfinite(product):
        raise ConvergenceError(f"the hub does not feel the mode at {s:.6g} 1/s, or it is double", s, slope)
    values = fields[("W", "Psi", "M").index(quantity), 0, :-1]
    if quantity == "M":
        damping = [segment.damping for segment in k.at(tuple(dict.fromkeys(places))).read]
        values = values / (1.0 + s * np.array([damping[list(dict.fromkeys(places)).index(each)] for each in places]))
    unit = np.sqrt(2 * s / product * float(k.length / k.EI))
    tip = fields[0 if isinstance(k.tip_mass, Fraction) else 1, 0, -2]
    return np.asarray((-unit if (unit * tip).real < 0 else unit) * values[:-1], dtype=complex)


def _at(state: State, quantity: str, x: float) -> Any:
    if quantity == "W":
        return state.field("Y", x) + x * state.theta
    if quantity == "Psi":
        return state.field("Phi", x) + state.theta
    return state.field("M", x) / state.d
