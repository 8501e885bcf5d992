"""The root moment that a slew leaves behind, from the exact closed-loop poles and residues: no simulation.

A reference slew of the hub angle with bang-bang acceleration +-a over a time T enters as r = J theta_ref_tt, what
friction and back-EMF take at its rate, and what the law makes of the reference.  Once it has ended, each pole p answers
with  residue(p) R(p) e^{p t}, R the Laplace transform of r: the response of the moment after T is that sum, and its
root-mean-square over one period of the first mode is what is left.  Real poles count too: under moment feedback the
slow one of rate gain and inertia answers, as the reference is made for the arm's own inertia and not for the effective
one.
"""

from __future__ import annotations

import numpy as np

from tfarm.arm import FED_BACK, Arm, must_turn
from tfarm.arrays import Complex, Real
from tfarm.exact.characteristic import dimensionless, float_units, loop_parts, loop_system, quick_characteristics
from tfarm.spectrum.scales import first_frequency

from .damping import band_and_real_poles, is_oscillating

RISE, TURN = 1.0, 1.15  # the paper's slew: rise time [s] and angle [rad]
MOST_EXPONENT = 100.0  # e^100 = 3e43 is more than any stable loop leaves, and its square no overflow
PERIOD_SAMPLES = 64  # of the period after the slew


def residual_moment(
    arm: Arm, laws: Real, number: int, known: Arm | None = None, *, rise: float = RISE, turn: float = TURN
) -> Real:
    """Root-mean-square of the root moment [N m] over the first mode's period after the slew, for `laws` (gains, n).

    Of the first `number` modes and of real poles; the rigid arm's moment is 0 there.  `known` is the arm that the slew
    of `turn` [rad] in `rise` [s] is made for, the arm itself unless given.  Raises ParameterError for an arm
    that cannot turn.
    """
    must_turn(arm)
    poles = band_and_real_poles(arm, laws, number)  # (n, slots)
    period = 2 * np.pi / first_frequency(arm)
    t = period * np.arange(PERIOD_SAMPLES) / PERIOD_SAMPLES
    rows, columns = np.nonzero(~np.isnan(poles))
    s = poles[rows, columns]
    amplitude = np.zeros(poles.shape, complex)
    amplitude[rows, columns] = residues(arm, s, laws[:, rows]) * command(known or arm, s, laws[:, rows], rise, turn)
    amplitude *= np.where(is_oscillating(poles), 2.0, 1.0)  # with its conjugate
    with np.errstate(under="ignore"):
        moment = (amplitude[..., None] * _exp(np.nan_to_num(poles)[..., None] * t)).real.sum(axis=1)
    return np.asarray(np.sqrt((moment**2).mean(axis=1)))


def _exp(z: Complex) -> Complex:
    """e^z; that of an unstable pole is limited, which leaves more than any other but does not overflow."""
    return np.asarray(np.exp(np.minimum(z.real, MOST_EXPONENT) + 1j * z.imag))


def residues(arm: Arm, s: Complex, laws: Real) -> Complex:
    """Residues of root moment over r [N m s^-1 a unit of input] at closed-loop poles s, each of its own law (1-D)."""
    k, row = loop_system(arm), FED_BACK.index("root_moment")
    rows = dimensionless(k, laws)
    moment = loop_parts(k, s).numerators[row] * float_units(k)[row]
    return np.asarray(moment / quick_characteristics(k, s, rows).slope)


def command(arm: Arm, s: Complex, laws: Real, rise: float = RISE, turn: float = TURN) -> Complex:
    """R(s) e^{s rise}: R the Laplace transform of r until `rise` [s] and, the angle held by its gain, after it."""
    acceleration = 4 * turn / rise**2
    with np.errstate(under="ignore"):
        bang = acceleration * (_exp(s * rise / 2) - 1) ** 2 / s
    rate = bang / s
    by_angle, by_rate = (laws[FED_BACK.index(name)] for name in ("hub_angle", "hub_rate"))
    return np.asarray(arm.turned_inertia * bang + (arm.rate_loss + by_rate) * rate + by_angle * rate / s)
