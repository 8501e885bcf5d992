"""The closed form of the exact solution, as algebra: one set of formulas for every type of number.

Everything is dimensionless in the arm's length L and bending stiffness EI: deflection W/L, rotation Psi, moment
M L/EI, shear force Q L^2/EI, torque u L/EI, while s stays in 1/s.  With S = s^2 and d = 1 + C s, two waves
e^{+-t_j x}, z_j = t_j^2, solve the dispersion relation

    (d z - a S)(z - b S) + g S = 0      a = rho L^2/E   b = rho L^2/(kappa G)   g = rho A L^4/(E I)

which is (A.2) of the paper (with its inner square root) without fractions.  Written with v_j = z_j - b S
and the even functions c_j = cosh t_j, S_j = sinh t_j / t_j nothing is singular at the shear cut-off (t_2 = 0).

Floats, complex arrays, power series (`Jet`) and balls run through the same lines; numba melts them into its loops.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .compiled import inlined

Number = Any  # float, complex, ndarray, Jet or ball

SERIES_RADIUS = 6.0  # |z_j| below which the series are used
SERIES_TERMS = 14  # the first term left out is below 15 * 6^14/28! = 4e-18
INVERSE_FACTORIAL = np.array([1.0 / math.factorial(n) for n in range(2 * SERIES_TERMS + 2)])


@inlined
def tip_conditions(ends: Any, S: Number) -> tuple[Number, Number, Number, Number]:
    """tip_mass, shear, tip_inertia and moment of the tip's conditions at S = s^2, of the numbers of its ends.

    Rest, inertia and force of the mass come first and those of the inertia next (see `coefficients.EndCondition`).
    """
    return ends[0] + ends[1] * S, ends[2], ends[3] + ends[4] * S, ends[5]


@inlined
def hub_condition(ends: Any, S: Number, theta: Number, M0: Number) -> Number:
    """(inertia s^2 + rest) theta - force M0: what vanishes at a natural frequency, of the three numbers after those."""
    return (ends[6] + ends[7] * S) * theta - ends[8] * M0


@inlined
def from_waves(
    c1: Number,
    s1: Number,
    z1: Number,
    v1: Number,
    e1: Number,
    c2: Number,
    s2: Number,
    z2: Number,
    v2: Number,
    e2: Number,
    gS: Number,
    d: Number,
    tip_mass: Number,
    shear: Number,
    tip_inertia: Number,
    moment: Number,
) -> tuple[Number, Number, Number, Number]:
    """(theta, M0, Q0, W1) of the free response, up to one common factor, from the two waves.

    The tip obeys  tip_mass W + shear Q = 0  and  tip_inertia Psi + moment M = 0,  that is (m s^2, 1) for
    a finite inertia and (1, 0) for an infinite one.  c, s are scaled by e = e^{-t}.  In the notation of the
    paper's appendix these are its 3x3 minors: theta vanishes at the hub-locked frequencies and
    M0 at those of a pinned root.  No product of a wave with itself is left: it would cancel.
    """  # fmt: skip
    So1, So2 = tip_mass * z1 * s1 + shear * gS * c1, tip_mass * z2 * s2 + shear * gS * c2
    Se1, Se2 = tip_mass * c1 + shear * gS * s1, tip_mass * c2 + shear * gS * s2
    r1, r2 = tip_inertia * c1 + moment * d * z1 * s1, tip_inertia * c2 + moment * d * z2 * s2
    Me1, Me2 = v1 * (tip_inertia * s1 + moment * d * c1), v2 * (tip_inertia * s2 + moment * d * c2)
    bare = (tip_mass * tip_inertia - shear * moment * d * gS) * (e1 * e2)
    N1 = So2 * Me1 - v2 * r2 * Se1 + v2 * bare
    N2 = So1 * Me2 - v1 * r1 * Se2 + v1 * bare
    theta = N1 * v1 + N2 * v2
    M0 = d * (z1 - z2) * (So1 * r2 * v2 - So2 * r1 * v1)
    Q0 = gS * (N1 + N2)
    W1 = shear * gS * (z1 - z2) * (r1 * e2 - r2 * e1)
    return theta, M0, Q0, W1


def tip_from_waves(
    c1: Number,
    s1: Number,
    z1: Number,
    v1: Number,
    e1: Number,
    c2: Number,
    s2: Number,
    z2: Number,
    v2: Number,
    e2: Number,
    gS: Number,
    d: Number,
    tip_mass: Number,
    shear: Number,
    tip_inertia: Number,
    moment: Number,
) -> tuple[Number, Number]:
    """(lift, turn) of the free response's tip, up to the factor of `from_waves`: what its two conditions leave open.

    W = shear lift, Q = -tip_mass lift, Psi = moment turn, M = -tip_inertia turn.
    """
    So1, So2 = tip_mass * z1 * s1 + shear * gS * c1, tip_mass * z2 * s2 + shear * gS * c2
    r1, r2 = tip_inertia * c1 + moment * d * z1 * s1, tip_inertia * c2 + moment * d * z2 * s2
    return gS * (z1 - z2) * (r1 * e2 - r2 * e1), d * (z1 - z2) * (v1 * So2 * e1 - v2 * So1 * e2)


@inlined
def from_transition(
    F0: Number,
    F1: Number,
    F2: Number,
    F3: Number,
    F2_less_1: Number,
    S: Number,
    over_d: Number,
    a: float,
    b: float,
    g: float,
    sigma: float,
    tip_mass: Number,
    shear: Number,
    tip_inertia: Number,
    moment: Number,
) -> tuple[Number, Number, Number, Number, Number]:
    """(theta, M0, Q0, W1, W1 - theta) of the free response, up to one factor, without wave numbers.

    F0 = (sinh t1 / t1 - sinh t2 / t2)/(z1 - z2) and its derivatives F1, F2, F3 along x at the tip are entire in
    s^2 (C = 0) and give the state-transition matrix of (W, Psi, M, Q); the tip's two conditions are solved by
    Cramer's rule; over_d = 1/(1 + C s).  Best for small |t|: for large ones products of a wave with itself cancel.
    """  # fmt: skip
    bS, gS = b * S, g * S
    bend = F2 - bS * F0
    turn = F3 - bS * F1
    lift = sigma * F2 - (1 + sigma * a * S) * over_d * F0
    row1_theta = shear * gS * F1 + tip_mass * F2
    row1_M0 = (shear * gS * F0 + tip_mass * F1) * over_d
    row1_Q0 = shear * (F3 - a * S * over_d * F1) + tip_mass * lift
    row2_theta = moment * S * (a * bend - g * F0) + tip_inertia * turn
    row2_M0 = moment * turn + tip_inertia * over_d * bend
    row2_Q0 = -moment * F2 - tip_inertia * over_d * F1
    theta = row1_Q0 * row2_M0 - row1_M0 * row2_Q0
    M0 = row1_theta * row2_Q0 - row1_Q0 * row2_theta
    Q0 = row1_M0 * row2_theta - row1_theta * row2_M0
    rest = M0 * F1 * over_d + Q0 * lift
    W1 = shear * (moment * F2 + tip_inertia * over_d * F1)  # not theta F2 + rest: that cancels for a heavy payload
    return theta, M0, Q0, W1, theta * F2_less_1 + rest


def tip_from_transition(
    F0: Number,
    F1: Number,
    F2: Number,
    F3: Number,
    S: Number,
    over_d: Number,
    a: float,
    sigma: float,
    tip_mass: Number,
    shear: Number,
    tip_inertia: Number,
    moment: Number,
) -> tuple[Number, Number]:
    """`tip_from_waves` up to the factor of `from_transition`, without wave numbers."""
    turn = shear * (F3 - a * S * over_d * F1) + tip_mass * (sigma * F2 - (1 + sigma * a * S) * over_d * F0)
    return moment * F2 + tip_inertia * over_d * F1, turn


@inlined
def fields_from_root(
    x: Number,
    F0: Number,
    F1: Number,
    F2: Number,
    F3: Number,
    F2_less_x: Number,
    F3_less_1: Number,
    S: Number,
    over_d: Number,
    a: float,
    b: float,
    g: float,
    sigma: float,
    theta: Number,
    M0: Number,
    Q0: Number,
) -> tuple[Number, Number, Number, Number]:
    """Deflection W - x theta, rotation Psi - theta, moment M and shear force Q at x from the root's values.

    F0..F3 are the transition functions at x.  For |t| x small; further out the waves separate better.
    """  # fmt: skip
    bS, gS, aS = b * S, g * S, a * S
    Y = theta * F2_less_x + over_d * (M0 * F1 - Q0 * F0) + Q0 * sigma * (F2 - aS * over_d * F0)
    Phi = theta * (F3_less_1 - bS * F1) + over_d * (M0 * (F2 - bS * F0) - Q0 * F1)
    M = theta * (aS * (F2 - bS * F0) - gS * F0) + M0 * (F3 - bS * F1) - Q0 * F2
    Q = gS * (theta * F1 + over_d * M0 * F0) + Q0 * (F3 - aS * over_d * F1)
    return Y, Phi, M, Q


@inlined
def _series(shift: int, z_sum: Number, z_product: Number) -> tuple[Number, Number]:
    """sum over k of h_k/(2k + shift)!, whole and less its first term.

    h_k, the complete homogeneous polynomial of z1 and z2, obeys h_k = (z1 + z2) h_{k-1} - z1 z2 h_{k-2}: Clenshaw.
    """
    now = rest = after = 0.0 * z_sum
    for n in range(SERIES_TERMS):
        rest = z_sum * now - z_product * after
        now, after = INVERSE_FACTORIAL[2 * (SERIES_TERMS - 1 - n) + shift] + rest, now
    return now, rest


@inlined
def transition_series(z_sum: Number, z_product: Number) -> tuple[Number, Number, Number, Number, Number, Number]:
    """F0, F1, F2, F3 at the tip, F2 - 1 and F3 - 1 as series, exact to 1e-17 for |z| < 6."""
    F0, _ = _series(3, z_sum, z_product)
    F1, _ = _series(2, z_sum, z_product)
    F2, F2_less_1 = _series(1, z_sum, z_product)
    F3, F3_less_1 = _series(0, z_sum, z_product)
    return F0, F1, F2, F3, F2_less_1, F3_less_1


@inlined
def even_functions(z: Number) -> tuple[Number, Number]:
    """cosh sqrt z and sinh sqrt z / sqrt z by Horner's rule; ten terms are exact to 1e-19 for |z| < 1."""
    c = s = 1.0 + 0.0 * z
    for k in range(10, 0, -1):
        c = 1.0 + z * c / ((2 * k - 1) * (2 * k))
        s = 1.0 + z * s / ((2 * k) * (2 * k + 1))
    return c, s
