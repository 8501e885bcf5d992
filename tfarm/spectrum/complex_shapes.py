"""Shapes of damped modes: the free response at an eigenvalue."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import characteristic
from tfarm.exact.elements import Place
from tfarm.exact.layout import Layout
from tfarm.exact.system import System
from tfarm.exact.values import free_fields

from .shapes import AT_HUB


def mode_field(k: System, s: complex, quantity: str, x: NDArray[np.float64]) -> Complex:
    """ "W", "Psi" or "M" (dimensionless lengths and moments) at the shares x, of unit modal mass in SI units.

    At an eigenvalue  D'(s) theta = a  (locked hub: D'(s) M = a),  a the mode's  2 s (mass) + (damping)  in the shape's
    own scale (reciprocity, differentiated); the shape is scaled to  a = 2 s, its tip moving up (turning, if pinned).
    """
    at, places = np.array([s]), [Place(Fraction(float(share))) for share in (*x, 1.0)]
    fields, angle, scale = free_fields(k, at, [*places, AT_HUB])
    drive = characteristic(k, at)
    slope, back = drive.slope[0], np.exp(scale - drive.scale)  # a system that is cut has another scale
    fields, theta = fields * back, complex((angle * back)[0])
    _, _, M, Q = fields[:, 0, -1]
    M = M + float(k.radius) * Q
    lag = 1.0 + float(k.drive.lag) * s
    A = np.polyval([float(each) for each in reversed(k.drive.of_angle)], s)
    if k.drive.turns and abs(A) > abs(lag):  # the hub's own balance: a heavy one hardly turns, and M keeps its digits
        theta = M * lag / A
    product = complex(slope * (theta / lag if k.drive.turns else M))
    if product == 0 or not np.isfinite(product):
        raise ConvergenceError(f"the hub does not feel the mode at {s:.6g} 1/s, or it is double", s, slope)
    values = fields[("W", "Psi", "M").index(quantity), 0, :-1]
    if quantity == "M":
        layout = Layout(k, tuple(dict.fromkeys(places)))
        damping = [layout.read[layout.places.index(each)].damping for each in places]
        values = values / (1.0 + s * np.array(damping))
    unit = np.sqrt(2 * s / product * float(k.length / k.EI))
    tip = fields[0 if isinstance(k.tip_mass, Fraction) else 1, 0, -2]
    return np.asarray((-unit if (unit * tip).real < 0 else unit) * values[:-1], dtype=complex)
