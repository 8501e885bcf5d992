"""The root moment that a slew leaves behind, from the exact closed-loop poles and residues: no simulation.

A reference slew of the hub angle with bang-bang acceleration +-a over a time T enters as r = J theta_ref_tt + K1
theta_ref_t + Kp theta_ref.  Once it has ended, each pole p answers with  residue(p) R(p) e^{p t}, R the Laplace
transform of r: the response of the moment after T is that sum, and its root-mean-square over one period of the first
mode is what is left.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.exact.characteristic import Gains, loop_parts, quick_characteristics
from tfarm.exact.coefficients import coefficients
from tfarm.spectrum import modes

from .damping import band_poles

Complex = NDArray[np.complexfloating[Any, Any]]
Real = NDArray[np.float64]

RISE, TRAVEL = 1.0, 1.15  # the paper's slew: rise time [s] and tip travel [m]
SAMPLES = 64  # of the period after the slew


def residual_moment(arm: Arm, K1: Real, K2: Real, Kp: Real, number: int) -> Real:
    """Root-mean-square of the root moment [N m] over the first mode's period after the slew, for each law."""
    poles = band_poles(arm, K1, K2, Kp, number)
    rows, columns = np.nonzero(~np.isnan(poles))
    s = poles[rows, columns]
    laws = K1[rows], K2[rows], Kp[rows]
    amplitude = np.zeros(poles.shape, complex)
    amplitude[rows, columns] = residues(arm, s, *laws) * command(arm, s, laws[0], laws[2])
    period = 2 * np.pi / float(modes(arm, 1).natural_frequency[-1])
    t = RISE + period * np.arange(SAMPLES) / SAMPLES
    with np.errstate(under="ignore"):
        ringing = 2 * (amplitude[..., None] * np.exp(np.nan_to_num(poles)[..., None] * t)).real.sum(axis=1)
    return np.asarray(np.sqrt((ringing**2).mean(axis=1)))


def residues(arm: Arm, s: Complex, K1: Real, K2: Real, Kp: Real) -> Complex:
    """Residues of root moment over r [N m s^-1 per N m] at closed-loop poles s, each of its own law (1-D)."""
    k = coefficients(arm)
    unit = Gains.of(k, 1.0, 1.0, 1.0)
    law = np.stack([float(unit.Kp) * Kp, float(unit.K1) * K1, K2])
    return np.asarray(loop_parts(k, s)[2] / quick_characteristics(k, s, law).slope)


def command(arm: Arm, s: Complex, K1: Real, Kp: Real) -> Complex:
    """Laplace transform of r for the slew, at s: what it is until `RISE`, and the angle held by Kp after it."""
    acceleration = 4 * TRAVEL / (arm.link.length * RISE**2)
    bang = acceleration * (1 - np.exp(-s * RISE / 2)) ** 2 / s
    rate = bang / s
    return np.asarray(arm.total_inertia * bang + K1 * rate + Kp * rate / s)
