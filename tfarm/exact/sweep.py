"""The free response of a chain in float64: the plane swept inwards from the payload, the hub's condition outwards.

At each s the plane of states (`compound`) is carried from the payload to the axis, where W = 0 leaves theta and the
moment on the hub; the condition W = 0 is carried back to the places that something is read at.  Every segment takes its
waves where one is fast and its transition functions where both are slow; each scale e^{t} is taken out and kept.  What
is read has the scales of the segments inside of it alone: the difference of two sums over all would cost their digits.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .chain import KIND, MARK, OF_ANGLE, OF_MOMENT, OFFSET, SEGMENT, SPRING, TO_M, TO_Q, TO_W
from .closed_form import transition_series
from .compiled import compiled, inlined
from .compound import (
    across_rows,
    across_waves,
    beyond_body,
    beyond_offset,
    beyond_spring,
    end_plane,
    inside_body,
    inside_offset,
    inside_spring,
    met,
    row_across,
    row_across_waves,
    transition_rows,
)
from .dispersion import dispersion, reciprocal
from .vector import DAMPING, SIGMA, A, B, G
from .waves import PARALLEL, POLE, impedance, is_low, magnitude, wave_functions

HELD = 14  # complex numbers of a segment that the way back takes up again
OVERFLOW, UNDERFLOW = 1e80, 1e-80  # a plane beyond is brought back to 1, by a power of two
LN_2 = math.log(2.0)
SMALL = 0.05  # an output below this share of its own terms has lost four bits: flagged


@inlined
def _functions(row: Any, s: complex, S: complex, over_d: complex) -> Any:
    """The transition matrix of a slow segment."""
    z_sum, z_product = S * (row[B] + row[A] * over_d), S * (row[A] * row[B] * S + row[G]) * over_d
    F0, F1, F2, F3, _, _ = transition_series(z_sum, z_product)
    return transition_rows(F0, F1, F2, F3, S, over_d, row[A], row[B], row[G], row[SIGMA])


@compiled
def _cross_segment(s: complex, row: Any, plane: Any, held: Any) -> tuple[complex, bool]:
    """Carry the plane (5,) across a segment, in place; keep its waves in `held`.  Scale, and if digits are lost."""
    to_w, to_m, to_q = row[TO_W], row[TO_M], row[TO_Q]
    p = plane[0] * to_w, plane[1] * (to_w * to_m), plane[2] * to_m, plane[3] * to_q, plane[4] * (to_m * to_q)
    S, d = s * s, 1.0 + row[DAMPING] * s
    over_d = reciprocal(d)
    lost, scale = False, complex(0.0, 0.0)
    if is_low(s, row):
        W, Psi, M, Q = _functions(row, s, S, over_d)
        p = across_rows(W, Psi, M, Q, p)
        held[0] = 0.0
    else:
        S, d, _, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(s, row)
        c1, s1, e1 = wave_functions(z1, t1, dt1)
        c2, s2, e2 = wave_functions(z2, t2, dt2)
        gap = z1 - z2
        p = across_waves(c1, s1, z1, v1, e1, c2, s2, z2, v2, e2, gS, d, S * (row[A] * over_d - row[B]), p)
        unit = reciprocal(gS * d * gap * gap)
        p = p[0] * unit, p[1] * unit, p[2] * unit, p[3] * unit, p[4] * unit
        scale = t1 + dt1 + t2 + dt2
        lost = magnitude(gap) < PARALLEL * (magnitude(z1) + magnitude(z2))
        held[0] = 1.0
        held[1], held[2], held[3], held[4], held[5], held[6] = c1, s1, z1, v1, e1, t1 + dt1
        held[7], held[8], held[9], held[10], held[11], held[12] = c2, s2, z2, v2, e2, t2 + dt2
        held[13] = gS
    plane[0], plane[1], plane[2] = p[0] / to_w, p[1] / (to_w * to_m), p[2] / to_m
    plane[3], plane[4] = p[3] / to_q, p[4] / (to_m * to_q)
    return scale, lost


@compiled
def _return_across(s: complex, row: Any, held: Any, f: Any) -> complex:
    """Carry the condition (4,) outwards across a segment, in place; its scale less that of the plane."""
    to_w, to_m, to_q = row[TO_W], row[TO_M], row[TO_Q]
    own = f[0] / to_w, f[1] + 0.0, f[2] / to_m, f[3] / to_q
    d = 1.0 + row[DAMPING] * s
    scale = complex(0.0, 0.0)
    if held[0] == 0.0:
        W, Psi, M, Q = _functions(row, s, s * s, reciprocal(d))
        own = row_across(W, Psi, M, Q, own)
    else:
        c1, s1, z1, v1, e1, t1 = held[1], held[2], held[3], held[4], held[5], held[6]
        c2, s2, z2, v2, e2, t2 = held[7], held[8], held[9], held[10], held[11], held[12]
        gS = held[13]
        if t1.real >= t2.real:
            ratio, scale = e1 * reciprocal(e2) if magnitude(e2) > 1e-140 else complex(0.0, 0.0), -t2
            c2, s2 = c2 * ratio, s2 * ratio
        else:
            ratio, scale = e2 * reciprocal(e1) if magnitude(e1) > 1e-140 else complex(0.0, 0.0), -t1
            c1, s1 = c1 * ratio, s1 * ratio
        own = row_across_waves(c1, s1, z1, v1, c2, s2, z2, v2, gS, d, own)
        unit = reciprocal(gS * d * (z1 - z2))
        own = own[0] * unit, own[1] * unit, own[2] * unit, own[3] * unit
    f[0], f[1], f[2], f[3] = own[0] * to_w, own[1], own[2] * to_m, own[3] * to_q
    return scale


@inlined
def _small(row: Any, s: complex, S: complex, p: Any) -> Any:
    """The plane inside an offset, a spring or a body."""
    if row[KIND] == OFFSET:
        return inside_offset(row[0], p)
    if row[KIND] == SPRING:
        return inside_spring(row[0] + row[2] * s, row[1] + 0.0 * s, p)
    return inside_body(row[0] * S + row[2], row[1] * S + row[3], p)


@compiled
def sweep(s: complex, rows: Any, ends: Any, plane: Any, planes: Any, powers: Any, held: Any) -> tuple[complex, bool]:
    """The plane (5,) at the axis and at each mark.  Its scale, and if digits are lost.

    `powers` (elements,): those of two that the plane was divided by after each.
    """
    S = s * s
    p = end_plane(ends[0] + ends[1] * S, ends[2] + 0.0 * S, ends[3] + ends[4] * S, ends[5] + 0.0 * S)
    plane[0], plane[1], plane[2], plane[3], plane[4] = p
    scale, lost = complex(0.0, 0.0), False
    for i in range(len(rows)):
        row = rows[i]
        if row[KIND] == SEGMENT:
            more, here = _cross_segment(s, row, plane, held[i])
            scale, lost = scale + more, lost or here
        elif row[KIND] == MARK:
            planes[int(row[0])] = plane
        else:
            p = plane[0], plane[1], plane[2], plane[3], plane[4]
            plane[0], plane[1], plane[2], plane[3], plane[4] = _small(row, s, S, p)
        largest = max(
            magnitude(plane[0]), magnitude(plane[1]), magnitude(plane[2]), magnitude(plane[3]), magnitude(plane[4])
        )
        powers[i] = 0
        if (largest > OVERFLOW or largest < UNDERFLOW) and largest > 0.0 and largest < np.inf:
            powers[i] = math.frexp(largest)[1]
            plane *= math.ldexp(1.0, -powers[i])
            scale += powers[i] * LN_2
    return scale, lost


@compiled
def go_back(
    s: complex, rows: Any, f: Any, planes: Any, scales: Any, shifts: Any, powers: Any, held: Any, states: Any
) -> None:
    """The state (4,) at each mark: the condition W = 0 of the axis carried outwards meets the planes.

    It is the state that goes with the plane at the axis divided by e^scale 2^shift (marks,).
    """
    S = s * s
    f[0], f[1], f[2], f[3] = 1.0, 0.0, 0.0, 0.0
    scale, shift, left = complex(0.0, 0.0), 0, len(scales)
    for i in range(len(rows) - 1, -1, -1):
        if left == 0:
            break
        row = rows[i]
        shift -= powers[i]
        if row[KIND] == SEGMENT:
            scale += _return_across(s, row, held[i], f)
            continue
        own = f[0], f[1], f[2], f[3]
        if row[KIND] == MARK:
            n = int(row[0])
            p = planes[n, 0], planes[n, 1], planes[n, 2], planes[n, 3], planes[n, 4]
            states[n, 0], states[n, 1], states[n, 2], states[n, 3] = met(own, p)
            scales[n], shifts[n] = scale, shift
            left -= 1
        elif row[KIND] == OFFSET:
            own = beyond_offset(row[0], own)
        elif row[KIND] == SPRING:
            own = beyond_spring(row[0] + row[2] * s, row[1] + 0.0 * s, own)
        else:
            own = beyond_body(row[0] * S + row[2], row[1] * S + row[3], own)
        f[0], f[1], f[2], f[3] = own
        largest = max(magnitude(f[0]), magnitude(f[1]), magnitude(f[2]), magnitude(f[3]))
        if largest > OVERFLOW or (largest < UNDERFLOW and largest > 0.0):
            power = math.frexp(largest)[1]
            f *= math.ldexp(1.0, -power)
            shift += power
    return


@inlined
def drive_of(s: complex, ends: Any, theta: complex, M: complex) -> complex:
    """The input behind a response with that hub angle and moment on the hub."""
    A0, B0 = OF_ANGLE, OF_MOMENT
    of_angle = ends[A0] + s * (ends[A0 + 1] + s * (ends[A0 + 2] + s * ends[A0 + 3]))
    return of_angle * theta - (ends[B0] + s * ends[B0 + 1]) * M


@inlined
def _drive_terms(s: complex, rows: Any, ends: Any, theta: complex, M: complex) -> float:
    """What the drive would be away from a pole: its two terms, and each with the other's size of motion."""
    A0, B0, last = OF_ANGLE, OF_MOMENT, rows[0]
    for row in rows:
        if row[KIND] == SEGMENT:
            last = row
    S = magnitude(s * s)
    of_angle = magnitude(ends[A0] + s * (ends[A0 + 1] + s * (ends[A0 + 2] + s * ends[A0 + 3])))
    of_moment = magnitude(ends[B0] + s * ends[B0 + 1])
    waves = impedance(S, last) / last[TO_M]
    crossed = of_angle * magnitude(M) / max(waves, 1.0) + of_moment * magnitude(theta) * waves
    return of_angle * magnitude(theta) + of_moment * magnitude(M) + crossed


@compiled
def fill_free(s: Any, rows: Any, ends: Any, table: Any, found: Any, lost: Any) -> None:
    """Drive, scale and each output of the free response at s (1-D), a row each; whether digits are lost.

    A row of `table` is an output: its place (or -1), weights of W, Psi, M, Q there and of theta, power of s, C of the
    gauge, factor.  Digits are lost where two waves of a segment are nearly one, where an output is a small difference
    (a deflection at low frequency), and where the drive is: there it may be a pole.
    """
    marks = 0
    for i in range(len(rows)):
        marks += rows[i, KIND] == MARK
    plane, f = np.empty(5, np.complex128), np.empty(4, np.complex128)
    planes, states = np.empty((marks, 5), np.complex128), np.empty((marks, 4), np.complex128)
    scales, held = np.empty(marks, np.complex128), np.empty((len(rows), HELD), np.complex128)
    shifts, powers = np.empty(marks, np.int64), np.empty(len(rows), np.int64)
    for i in range(s.size):
        scale, lost[i] = sweep(s[i], rows, ends, plane, planes, powers, held)
        if marks:
            go_back(s[i], rows, f, planes, scales, shifts, powers, held, states)
        found[0, i], found[1, i] = drive_of(s[i], ends, plane[0], plane[1]), scale
        lost[i] = lost[i] or magnitude(found[0, i]) < POLE * _drive_terms(s[i], rows, ends, plane[0], plane[1])
        for o in range(len(table)):
            want = table[o]
            value = want[5] * plane[0]
            if want[0] >= 0.0:
                n = int(want[0])
                at = want[1] * states[n, 0] + want[2] * states[n, 1] + want[3] * states[n, 2] + want[4] * states[n, 3]
                decay, turn = math.ldexp(math.exp(scales[n].real), shifts[n]), scales[n].imag
                at *= complex(decay * math.cos(turn), decay * math.sin(turn))
                lost[i] = lost[i] or (want[5] != 0.0 and magnitude(value + at) < SMALL * magnitude(value))
                value += at
            for _ in range(int(want[6])):
                value *= s[i]
            found[2 + o, i] = want[8] * value * (reciprocal(1.0 + want[7] * s[i]) if want[7] else 1.0)
