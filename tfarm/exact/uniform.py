"""One uniform link in float64: hub and tip in closed form, the fast path of `values.free_outputs`.

With torque and hub angle free, the link's equations and tip conditions have one solution up to a factor: the 3x3 minors
of the paper's matrix.  `sweep` solves the same for any chain, in two to three times the time.

Points are processed in blocks, each in loops of arithmetic alone, which vectorise, and one with the two complex
exponentials of each point, the limit of speed.
"""

from typing import Any

import numpy as np

from .compiled import compiled, inlined
from .layout import CHAIN_A, OF_ANGLE
from .pieces import (
    BLOCK,
    BY_SERIES,
    ONE,
    PHASE,
    PLANE_SIZE,
    S_SQUARED,
    TWO,
    WAVES_SIZE,
    fill_waves,
    finish,
    mark_parallel,
    mark_slow,
    put,
    take_low,
    waves_at,
)
from .sweep import POLE, drive_at, innermost
from .waves import (
    Number,
    Plane,
    Row,
    Wave,
    across_rows,
    across_waves,
    end_plane,
    magnitude,
    reciprocal,
    tip_conditions,
    transition_rows,
    transition_series,
    wave_sums,
)

LIFT = 2.0**100  # factor of W at the tip, which would underflow where s^2 W does not
TIP, DRIVE, SCALE, PARTS = 3, 5, 6, 7  # the indices of W at the tip, drive and scale among the numbers at the ends


@inlined
def from_waves(one: Wave, two: Wave, gS: Number, d: Number, tip: Row) -> Row:
    """Return (theta, M0, Q0, W1) of the free response times g S d (z1 - z2)^2 e^{-(t1 + t2)}, from the two waves.

    The tip satisfies  tip_mass W + shear Q = 0  and  tip_inertia Psi + moment M = 0,  with (m s^2, 1) for a finite
    inertia and (1, 0) for an infinite one.  In the paper's appendix these are the 3x3 minors: theta vanishes at the
    hub-locked frequencies and M0 at those of a pinned root.
    """
    (c1, s1, z1, _, e1), (c2, s2, z2, _, e2), (_, shear, inertia, moment) = one, two, tip
    theta, M0, Q0, _, _ = across_waves(one, two, gS, d, end_plane(*tip))
    r1, r2 = inertia * c1 + moment * d * z1 * s1, inertia * c2 + moment * d * z2 * s2
    return theta, M0, Q0, shear * gS * (z1 - z2) * (r1 * e2 - r2 * e1)


@inlined
def from_transition(s: complex, row: Any, tip: Row) -> Plane:
    """Return (theta, M0, Q0, W1, W1 - theta) of the free response, up to one factor, without wave numbers.

    For small |t|: for large ones products of a wave with itself cancel.
    """
    S, over_d, z_sum, z_product = wave_sums(s, row)
    F0, F1, F2, F3, F2_less_1, _ = transition_series(z_sum, z_product)
    rows = transition_rows((F0, F1, F2, F3), S, over_d, row[CHAIN_A:])
    theta, M, Q, _, _ = across_rows(*rows, end_plane(*tip))
    (_, of_Psi, of_M, of_Q), (_, shear, inertia, moment) = rows[0], tip
    at_tip = shear * (inertia * of_M - moment * of_Psi)  # not theta F2 + rest: that cancels for a heavy payload
    return theta, M, Q, at_tip, theta * F2_less_1 + of_M * M - of_Q * Q


@compiled
def fill_ends(s: Any, rows: Any, ends: Any, table: Any, per_input: bool, found: Any, lost: Any) -> None:
    """Compute drive, scale and each output of the free response at s (1-D), rows of `found`; mark lost digits.

    `rows` and `ends` are those of the layout.  A row of `table` is an output: the index of theta, M, Q, W or W - theta,
    power of s, unit, C of its gauge.  Outputs are those of a unit input with `per_input`, else times e^{-scale}.
    """
    points, low, flags = np.empty(BLOCK, np.complex128), np.empty(BLOCK, np.bool_), np.empty(BLOCK, np.bool_)
    parts, waves, row = np.empty(PLANE_SIZE, np.complex128), np.empty(WAVES_SIZE, np.complex128), innermost(rows)
    small = 1.0 / max(1.0, ends[OF_ANGLE + 1], ends[OF_ANGLE + 2])  # against overflow of squares of a heavy hub's drive
    for first in range(0, s.size, BLOCK):
        n = min(BLOCK, s.size - first)
        for i in range(BLOCK):
            points[i] = s[first + i] if i < n else s[first]
        slow = mark_slow(points, row, low)
        if slow < BLOCK:
            fill_waves(points, row, waves)
            _by_waves(ends, waves, parts)
        if slow:
            at = 0 if slow == BLOCK else BY_SERIES
            _by_series(points, row, ends, parts[at:])
            take_low(low, parts, at, PARTS)
        _driven(points, row, ends, small, per_input, parts, flags)
        if slow < BLOCK:
            mark_parallel(waves, low, flags)
        for i in range(n):
            found[0, first + i], found[1, first + i] = parts[DRIVE * BLOCK + i], parts[SCALE * BLOCK + i]
            lost[first + i] = flags[i]
        for o in range(len(table)):
            source, power = parts[BLOCK * int(table[o, 0]) :], int(table[o, 1])
            unit = table[o, 2] / LIFT if table[o, 0] == TIP else table[o, 2]
            finish(points, source, power, unit, table[o, 3], found[2 + o, first : first + n])


@inlined
def _by_waves(ends: Any, waves: Any, parts: Any) -> None:
    """Compute theta, M, Q, W and W - theta times e^{-scale}, and scale, by the two waves."""
    for i in range(BLOCK):
        one, two, gS, d = waves_at(waves, i)
        theta, M, Q, W = from_waves(one, two, gS, d, tip_conditions(ends, waves[S_SQUARED + i]))
        gap = one[2] - two[2]
        unit = reciprocal(gS * d * gap * gap)
        put(parts, i, (theta * unit, M * unit, Q * unit, (LIFT * W) * unit, (W - theta) * unit))
        parts[SCALE * BLOCK + i] = waves[ONE + PHASE + i] + waves[TWO + PHASE + i]


@inlined
def _by_series(points: Any, row: Any, ends: Any, parts: Any) -> None:
    """Compute the same by the series of the transition functions, at slow points."""
    for i in range(BLOCK):
        theta, M, Q, W, Y = from_transition(points[i], row, tip_conditions(ends, points[i] * points[i]))
        put(parts, i, (theta, M, Q, LIFT * W, Y))
    for i in range(BLOCK):  # in the loop above it would prevent vectorisation
        parts[SCALE * BLOCK + i] = 0.0


@inlined
def _driven(points: Any, row: Any, ends: Any, small: float, per_input: bool, parts: Any, lost: Any) -> None:
    """Compute the drive of all points, mark lost digits, and with `per_input` divide all numbers by it."""
    for i in range(BLOCK):
        drive, terms = drive_at(points[i], row, ends, parts[i], parts[BLOCK + i])
        parts[DRIVE * BLOCK + i] = drive
        lost[i] = not magnitude(drive) > POLE * terms
        if per_input:
            over = small * reciprocal(small * drive)
            for j in range(DRIVE):
                parts[j * BLOCK + i] *= over
