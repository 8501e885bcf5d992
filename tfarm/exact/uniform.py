"""One uniform link in float64: hub and tip in closed form, the fast path of `values.free_outputs`.

With torque and hub angle free, the link's equations and tip conditions have one solution up to a factor: the 3x3 minors
of the paper's matrix.  `sweep` solves the same for any chain, in two to three times the time.

Points are processed in blocks, each in loops of arithmetic alone, which vectorise, and one with the two complex
exponentials of each point, the limit of speed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .compiled import compiled, inlined
from .layout import OF_ANGLE
from .pieces import (
    BLOCK,
    DT1,
    DT2,
    FUNCTIONS_SIZE,
    GS,
    NUMBERS_SIZE,
    S_SQUARED,
    T1,
    T2,
    Z1,
    Z2,
    D,
    all_wave_functions,
    all_wave_numbers,
    put_plane,
    take_where,
    waves_at,
)
from .sweep import POLE, drive_at, drive_terms, innermost
from .waves import (
    PARALLEL,
    SIGMA,
    A,
    B,
    G,
    Number,
    Plane,
    Row,
    Wave,
    is_low,
    magnitude,
    reciprocal,
    tip_conditions,
    transition_series,
    wave_sums,
)

LIFT = 2.0**100  # factor of W at the tip, which would underflow where s^2 W does not
TIP = 3  # its index among the numbers at the ends
DRIVE, SCALE, PARTS = 5, 6, 7  # the indices of drive and scale, and the number of all


@inlined
def from_waves(one: Wave, two: Wave, gS: Number, d: Number, tip: Row) -> Row:
    """Return (theta, M0, Q0, W1) of the free response, up to one common factor, from the two waves.

    The tip satisfies  tip_mass W + shear Q = 0  and  tip_inertia Psi + moment M = 0,  with (m s^2, 1) for a finite
    inertia and (1, 0) for an infinite one.  c, s are scaled by e = e^{-t}.  In the paper's appendix these are the 3x3
    minors: theta vanishes at the hub-locked frequencies and M0 at those of a pinned root.  There is no product of a
    wave with itself, which would cancel.
    """
    (c1, s1, z1, v1, e1), (c2, s2, z2, v2, e2) = one, two
    tip_mass, shear, tip_inertia, moment = tip
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


@inlined
def from_transition(s: complex, row: Any, tip: Row) -> Plane:
    """Return (theta, M0, Q0, W1, W1 - theta) of the free response, up to one factor, without wave numbers.

    F0 = (sinh t1 / t1 - sinh t2 / t2)/(z1 - z2) and its derivatives F1, F2, F3 along x at the tip are entire in s^2
    (C = 0) and give the state-transition matrix of (W, Psi, M, Q).  The tip's two conditions are solved by Cramer's
    rule; over_d = 1/(1 + C s).  For small |t|: for large ones products of a wave with itself cancel.
    """
    S, over_d, z_sum, z_product = wave_sums(s, row)
    F0, F1, F2, F3, F2_less_1, _ = transition_series(z_sum, z_product)
    a, g, sigma, (tip_mass, shear, tip_inertia, moment) = row[A], row[G], row[SIGMA], tip
    bS, gS = row[B] * S, g * S
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


@compiled
def fill_ends(s: Any, rows: Any, ends: Any, table: Any, per_input: bool, found: Any, lost: Any) -> None:
    """Compute drive, scale and each output of the free response at s (1-D), rows of `found`; mark lost digits.

    `rows` and `ends` are those of the layout.  A row of `table` is an output: the index of theta, M, Q, W or W - theta,
    power of s, C of its gauge, factor.  Outputs are those of a unit input with `per_input`, else times e^{-scale}.
    """
    points, low = np.empty(BLOCK, np.complex128), np.empty(BLOCK, np.bool_)
    numbers, functions = np.empty(NUMBERS_SIZE, np.complex128), np.empty(FUNCTIONS_SIZE, np.complex128)
    parts, of_slow = np.empty(PARTS * BLOCK, np.complex128), np.empty(PARTS * BLOCK, np.complex128)
    row = innermost(rows)
    small = 1.0  # against overflow of squares of the drive with a heavy hub
    for j in range(4):
        small = max(small, abs(ends[OF_ANGLE + j]))
    small = 1.0 / small
    for first in range(0, s.size, BLOCK):
        n, slow = min(BLOCK, s.size - first), 0
        points[:n], points[n:] = s[first : first + n], s[first]
        for i in range(BLOCK):
            low[i] = is_low(points[i], row)
            slow += low[i]
        if slow < BLOCK:
            all_wave_numbers(points, row, numbers)
            all_wave_functions(numbers, functions)
            _by_waves(ends, numbers, functions, parts)
        if slow:
            other = parts if slow == BLOCK else of_slow
            _by_series(points, row, ends, other)
            if slow < BLOCK:
                take_where(low, other, parts)
        _driven(points, row, ends, small, per_input, parts, lost[first : first + n])
        for i in range(n):
            at = first + i
            if not low[i]:
                z1, z2 = numbers[Z1 + i], numbers[Z2 + i]
                lost[at] = lost[at] or magnitude(z1 - z2) < PARALLEL * (magnitude(z1) + magnitude(z2))
        if not per_input:
            for i in range(n):
                found[0, first + i], found[1, first + i] = parts[DRIVE * BLOCK + i], parts[SCALE * BLOCK + i]
        for o in range(len(table)):
            _output(points, table[o], parts, n, found[o + 2 * (not per_input), first : first + n])


@compiled
def _by_waves(ends: Any, numbers: Any, functions: Any, parts: Any) -> None:
    """Compute theta, M, Q, W and W - theta times e^{-scale}, and scale, by the two waves."""
    for i in range(BLOCK):
        d, gS = numbers[D + i], numbers[GS + i]
        one, two = waves_at(numbers, functions, i)
        theta, M, Q, W = from_waves(one, two, gS, d, tip_conditions(ends, numbers[S_SQUARED + i]))
        gap = one[2] - two[2]
        unit = reciprocal(gS * d * gap * gap)
        put_plane(parts, i, (theta * unit, M * unit, Q * unit, (LIFT * W) * unit, (W - theta) * unit))
        parts[SCALE * BLOCK + i] = numbers[T1 + i] + numbers[DT1 + i] + numbers[T2 + i] + numbers[DT2 + i]


@compiled
def _by_series(points: Any, row: Any, ends: Any, parts: Any) -> None:
    """Compute the same by the series of the transition functions, at slow points."""
    for i in range(BLOCK):
        theta, M, Q, W, Y = from_transition(points[i], row, tip_conditions(ends, points[i] * points[i]))
        put_plane(parts, i, (theta, M, Q, LIFT * W, Y))
    parts[SCALE * BLOCK : PARTS * BLOCK] = 0.0  # in the loop above it would prevent vectorisation


@compiled
def _driven(points: Any, row: Any, ends: Any, small: float, per_input: bool, parts: Any, lost: Any) -> None:
    """Compute the drive of all points, mark lost digits, and with `per_input` divide all numbers by it."""
    for i in range(BLOCK):
        drive = drive_at(points[i], ends, parts[i], parts[BLOCK + i])
        parts[DRIVE * BLOCK + i] = drive
        if per_input:
            over = small * reciprocal(small * drive)
            for j in range(DRIVE):
                parts[j * BLOCK + i] *= over
    for i in range(lost.size):
        terms = drive_terms(points[i], row, ends, parts[i], parts[BLOCK + i])
        drive = complex(1.0, 0.0) if per_input else parts[DRIVE * BLOCK + i]
        lost[i] = not magnitude(drive) > POLE * terms


@inlined
def _output(points: Any, want: Any, parts: Any, n: int, value: Any) -> None:
    """Compute an output of the table at n points of a block."""
    start, power, C = BLOCK * int(want[0]), int(want[1]), want[2]
    factor = want[3] / LIFT if want[0] == TIP else want[3]
    for i in range(n):
        found = parts[start + i]
        found = found * points[i] if power == 1 else found
        found = found * (points[i] * points[i]) if power == 2 else found
        found = found * reciprocal(1.0 + C * points[i]) if C else found
        value[i] = factor * found
    for _ in range(power if power > 2 else 0):
        for i in range(n):
            value[i] *= points[i]
