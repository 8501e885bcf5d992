"""The free response of a chain in float64: the plane swept inwards from the payload, the hub's condition outwards.

At each s the plane of states (`waves`) is carried from the payload to the axis, where W = 0 determines theta and the
moment on the hub.  The condition W = 0 is carried back to the places of the outputs.  For a segment with a fast wave
the waves are used, else its transition functions; each scale e^{t} is factored out.  An output has the scales of the
segments inside of it alone, as a difference of two sums over all segments would lose digits.

Points are processed in blocks, component by component (`pieces`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.records import read_only

from .compiled import compiled, inlined
from .layout import (
    COMPLIANCE,
    GROUND,
    INERTIA,
    LENGTH,
    LOSS,
    MARK,
    MASS,
    NUMBER,
    OF_ANGLE,
    OF_MOMENT,
    OFFSET,
    ROW_KIND,
    SEGMENT,
    SPRING,
    STIFFNESS,
    TO_M,
    TO_Q,
    TO_W,
    TURNING_GROUND,
)
from .pieces import (
    BLOCK,
    FUNCTIONS_SIZE,
    NUMBERS_SIZE,
    PLANE_SIZE,
    ROW_SIZE,
    Kept,
    cross,
    cross_back,
    plane_at,
    put_plane,
    put_row,
    row_at,
    times,
)
from .waves import (
    SIGMA,
    A,
    B,
    G,
    beyond_body,
    beyond_offset,
    beyond_spring,
    end_plane,
    impedance,
    inside_body,
    inside_offset,
    inside_spring,
    magnitude,
    met,
    reciprocal,
    tip_conditions,
    transition_series,
    wave_sums,
)

OVERFLOW, UNDERFLOW = 1e80, 1e-80  # a plane beyond is rescaled by a power of two
LN_2 = math.log(2.0)
POLE = 1e-11  # a drive below this share of its terms is flagged, as it may be a pole
DIFFERENCE = 0.5  # an output below this share of its terms has lost a bit and is summed from the axis instead,
SMALL_DIFFERENCE = 0.05  # or else flagged below this share, with four lost bits
AXIS = read_only(np.array([[1.0], [0.0], [0.0], [0.0]]))  # the condition W = 0 there, at every point


class Work(NamedTuple):
    """Scratch arrays of a block: planes (2) here and beyond, and at marks; conditions (2); the scales of all.

    The plane was divided by 2^`powers` (elements, points) after each element; a mark's state times e^scale 2^shift has
    the scale of the plane at the axis.  `inner` are the planes at the inner side of each element, `inside` is W there
    of the last spring on the way back.  `lift` and `turn` are W - r theta and Psi - theta on the way back, r the
    distance from the axis, as long as all segments are `slow`; `yielded` are both at each mark, where `known`.
    `watched` are points next to a segment's shear cut-off.
    """

    planes: NDArray[np.complex128]
    scale: NDArray[np.complex128]
    powers: NDArray[np.int64]
    marked: NDArray[np.complex128]
    conditions: NDArray[np.complex128]
    faded: NDArray[np.complex128]
    scales: NDArray[np.complex128]
    shifts: NDArray[np.int64]
    theta: NDArray[np.complex128]
    inner: NDArray[np.complex128]
    inside: NDArray[np.complex128]
    lift: NDArray[np.complex128]
    turn: NDArray[np.complex128]
    slow: NDArray[np.bool_]
    yielded: NDArray[np.complex128]
    known: NDArray[np.bool_]
    watched: NDArray[np.bool_]
    kept: Kept


@compiled
def _work(rows: Any) -> Work:
    """Return the scratch arrays of a chain."""
    marks = segments = 0
    for j in range(len(rows)):
        marks += rows[j, ROW_KIND] == MARK
        segments += rows[j, ROW_KIND] == SEGMENT
    number = np.complex128
    kept = Kept(
        np.empty((segments, BLOCK), np.bool_),
        np.empty((segments, NUMBERS_SIZE), number),
        np.empty((segments, FUNCTIONS_SIZE), number),
        np.empty((segments, ROW_SIZE), number),
    )
    return Work(
        np.empty((2, PLANE_SIZE), number),
        np.empty(BLOCK, number),
        np.empty((len(rows), BLOCK), np.int64),
        np.empty((marks, PLANE_SIZE), number),
        np.empty((2, ROW_SIZE), number),
        np.empty(FUNCTIONS_SIZE, number),
        np.empty((marks, BLOCK), number),
        np.empty((marks, BLOCK), np.int64),
        np.empty(BLOCK, number),
        np.empty((len(rows), PLANE_SIZE), number),
        np.empty(BLOCK, number),
        np.empty(BLOCK, number),
        np.empty(BLOCK, number),
        np.empty(BLOCK, np.bool_),
        np.empty((marks, 2 * BLOCK), number),
        np.empty((marks, BLOCK), np.bool_),
        np.empty(BLOCK, np.bool_),
        kept,
    )


@compiled
def _sweep(points: Any, rows: Any, ends: Any, work: Work, lost: Any) -> None:
    """Compute the plane at the axis, work.planes[0], and at each mark, with its scale; mark lost digits."""
    plane, beyond, scale, number = work.planes[0], work.planes[1], work.scale, 0
    for i in range(BLOCK):
        S = points[i] * points[i]
        mass, shear, inertia, moment = tip_conditions(ends, S)
        put_plane(plane, i, end_plane(mass, shear + 0.0 * S, inertia, moment + 0.0 * S))
    scale[:], lost[:], work.watched[:] = 0.0, False, False
    for j in range(len(rows)):
        row = rows[j]
        if row[ROW_KIND] == SEGMENT:
            cross(points, row, plane, beyond, scale, lost, work.watched, work.kept, number)
            plane[:] = beyond
            number += 1
        elif row[ROW_KIND] == MARK:
            work.marked[int(row[NUMBER])] = plane
        else:
            _small(points, row, plane)
        work.inner[j] = plane
        _brought_back(plane, 5, work.powers[j])
        for i in range(BLOCK):
            scale[i] += work.powers[j, i] * LN_2


@compiled
def _small(points: Any, row: Any, plane: Any) -> None:
    """Compute the plane inside an offset, a spring or a body, in place."""
    for i in range(BLOCK):
        s, S, p = points[i], points[i] * points[i], plane_at(plane, i)
        if row[ROW_KIND] == OFFSET:
            p = inside_offset(row[LENGTH], p)
        elif row[ROW_KIND] == SPRING:
            p = inside_spring(row[STIFFNESS] + row[LOSS] * s, row[COMPLIANCE] + 0.0 * s, p)
        else:
            p = inside_body(row[MASS] * S + row[GROUND], row[INERTIA] * S + row[TURNING_GROUND], p)
        put_plane(plane, i, p)


@compiled
def _brought_back(buffer: Any, parts: int, powers: Any) -> None:
    """Divide each point's numbers by a power of two, in place, where they are near over- or underflow."""
    powers[:] = 0
    for i in range(BLOCK):
        largest = 0.0
        for j in range(parts):
            largest = max(largest, magnitude(buffer[BLOCK * j + i]))
        if 0.0 < largest < np.inf and not UNDERFLOW <= largest <= OVERFLOW:
            powers[i] = math.frexp(largest)[1]
            for j in range(parts):
                buffer[BLOCK * j + i] *= math.ldexp(1.0, -powers[i])


@compiled
def _go_back(points: Any, rows: Any, axis: Any, work: Work, differs: bool, lost: Any) -> None:
    """Compute the state at each mark, in place of its plane, from the condition of the axis carried outwards.

    That is axis . (W, Psi, M, Q) = 0; the hub angle is work.theta.
    """
    f, beyond, plane = work.conditions[0], work.conditions[1], work.planes[0]
    for i in range(BLOCK):
        put_row(f, i, (axis[0, i], axis[1, i], axis[2, i], axis[3, i]))
        work.theta[i] = axis[0, i] * plane[i] + axis[2, i] * plane[2 * BLOCK + i] - axis[3, i] * plane[3 * BLOCK + i]
    left, number, of_spring = len(work.marked), len(work.kept.low), False
    is_rigid = True
    scale, shift, raised = np.zeros(BLOCK, np.complex128), np.zeros(BLOCK, np.int64), np.zeros(BLOCK, np.int64)
    work.lift[:], work.turn[:], work.slow[:], reach = 0.0, 0.0, True, 0.0
    for j in range(len(rows) - 1, -1, -1):
        if left == 0:
            return
        row = rows[j]
        shift -= work.powers[j]
        of_spring = row[ROW_KIND] == SPRING or (of_spring and row[ROW_KIND] == MARK)
        is_rigid = is_rigid and row[ROW_KIND] != SPRING and row[ROW_KIND] != SEGMENT
        if differs or row[ROW_KIND] != SEGMENT:
            reach = _yield(points, row, f, work.inner[j], shift, reach, work)
        if row[ROW_KIND] == SEGMENT:
            number -= 1
            for i in range(BLOCK):
                work.slow[i] = work.slow[i] and work.kept.low[number, i]
            cross_back(points, row, f, beyond, scale, work.faded, work.kept, number)
            f[:] = beyond
        elif row[ROW_KIND] == MARK:
            left, mark = left - 1, int(row[NUMBER])
            work.scales[mark], work.shifts[mark] = scale, shift
            _meet(f, work.marked[mark])
            if number < len(work.kept.low):  # there W, M and Q may have lost digits
                for i in range(BLOCK):
                    lost[i] = lost[i] or work.watched[i]
            elif is_rigid:  # no spring or segment between the axis and the mark
                for i in range(BLOCK):
                    work.marked[mark, i] = times(work.theta[i], reach * math.ldexp(1.0, -shift[i]))
            elif of_spring:  # W is that inside of the spring
                for i in range(BLOCK):
                    work.marked[mark, i] = times(work.inside[i], math.ldexp(1.0, -shift[i]))
        else:
            _small_back(points, row, f)
        _brought_back(f, 4, raised)
        shift += raised


@compiled
def _small_back(points: Any, row: Any, f: Any) -> None:
    """Compute the condition beyond an offset, a spring or a body, in place."""
    for i in range(BLOCK):
        s, S, own = points[i], points[i] * points[i], row_at(f, i)
        if row[ROW_KIND] == OFFSET:
            own = beyond_offset(row[LENGTH], own)
        elif row[ROW_KIND] == SPRING:
            own = beyond_spring(row[STIFFNESS] + row[LOSS] * s, row[COMPLIANCE] + 0.0 * s, own)
        else:
            own = beyond_body(row[MASS] * S + row[GROUND], row[INERTIA] * S + row[TURNING_GROUND], own)
        put_row(f, i, own)


@compiled
def _meet(f: Any, plane: Any) -> None:
    """Compute the state of a plane with a condition, in place of the plane's first four numbers."""
    for i in range(BLOCK):
        put_row(plane, i, met(row_at(f, i), plane_at(plane, i)))


@compiled
def _yield(points: Any, row: Any, f: Any, plane: Any, shift: Any, reach: float, work: Work) -> float:
    """Compute W - r theta and Psi - theta at the outer side of an element from those at its inner one; return r.

    r is the distance from the axis.  Valid while all segments are slow; M and Q are those of f and the inner plane.
    """
    if row[ROW_KIND] == MARK:
        mark = int(row[NUMBER])
        work.known[mark] = work.slow
        work.yielded[mark, :BLOCK], work.yielded[mark, BLOCK:] = work.lift, work.turn
        return reach
    for i in range(BLOCK):
        s, theta, lift, turn = points[i], work.theta[i], work.lift[i], work.turn[i]
        W, _, M, Q = met(row_at(f, i), plane_at(plane, i))
        if row[ROW_KIND] == SPRING:
            work.inside[i] = times(W, math.ldexp(1.0, shift[i]))
        M, Q = times(M, math.ldexp(1.0, shift[i])), times(Q, math.ldexp(1.0, shift[i]))
        if row[ROW_KIND] == SEGMENT:
            lift, turn = _beyond_slow(s, row, reach, theta, lift, turn, M, Q)
        elif row[ROW_KIND] == OFFSET:
            lift += row[LENGTH] * turn
        elif row[ROW_KIND] == SPRING:
            turn += row[COMPLIANCE] * reciprocal(row[STIFFNESS] + row[LOSS] * s) * M
        work.lift[i], work.turn[i] = lift, turn
    if row[ROW_KIND] == SEGMENT:
        return reach + 1.0 / row[TO_W]
    return reach + row[LENGTH] if row[ROW_KIND] == OFFSET else reach


@inlined
def _beyond_slow(
    s: complex, row: Any, reach: float, theta: complex, lift: complex, turn: complex, M: complex, Q: complex
) -> tuple[complex, complex]:
    """Return W - r theta and Psi - theta at the outer end of a slow segment from the state at its inner one.

    It is `waves.transition_rows` from the other end, with the other sign of Psi and Q, minus the identity.
    """
    w, M, Q = row[TO_W], row[TO_M] * M, row[TO_Q] * Q
    lift, W, Psi = w * lift, w * (reach * theta + lift), theta + turn
    S, over_d, z_sum, z_product = wave_sums(s, row)
    aS, bS, gS = row[A] * S, row[B] * S, row[G] * S
    F0, F1, F2, _, F2_less_1, F3_less_1 = transition_series(z_sum, z_product)
    lift += turn + F2_less_1 * Psi + (F3_less_1 - aS * over_d * F1) * W + over_d * (F1 * M - F0 * Q)
    turn += (F3_less_1 - bS * F1) * Psi + over_d * ((F2 - bS * F0) * M - F1 * Q - gS * F0 * W)
    return (lift + row[SIGMA] * (F2 - aS * over_d * F0) * Q) / w, turn


@inlined
def drive_at(s: complex, ends: Any, theta: complex, M: complex) -> complex:
    """Return the input of a response with that hub angle and moment on the hub."""
    A0, B0 = OF_ANGLE, OF_MOMENT
    of_angle = ends[A0] + s * (ends[A0 + 1] + s * (ends[A0 + 2] + s * ends[A0 + 3]))
    return of_angle * theta - (ends[B0] + s * ends[B0 + 1]) * M


@inlined
def drive_terms(s: complex, segment: Any, ends: Any, theta: complex, M: complex) -> float:
    """Return the scale of the drive away from a pole: its two terms, and each with the motion of the other."""
    A0, B0 = OF_ANGLE, OF_MOMENT
    S = magnitude(s * s)
    of_angle = magnitude(ends[A0] + s * (ends[A0 + 1] + s * (ends[A0 + 2] + s * ends[A0 + 3])))
    of_moment = magnitude(ends[B0] + s * ends[B0 + 1])
    waves = impedance(S, segment) / segment[TO_M]
    crossed = of_angle * magnitude(M) / max(waves, 1.0) + of_moment * magnitude(theta) * waves
    return of_angle * magnitude(theta) + of_moment * magnitude(M) + crossed


@compiled
def fill_free(s: Any, rows: Any, ends: Any, axis: Any, table: Any, found: Any, lost: Any) -> None:
    """Compute drive, scale and each output of the free response at s (1-D), rows of `found`; mark lost digits.

    It satisfies axis . (W, Psi, M, Q) = 0 on the hub's axis, W = 0 for `AXIS`; `axis` (4, n) has one column, or one for
    each point.  A row of `table` is an output: its place (or -1), weights of W, Psi, M, Q there and of theta, power of
    s, C of the gauge, factor.  Digits are lost where two waves of a segment are nearly one, where an output is a small
    difference of fast waves, and where the drive is one, near a pole.
    """
    differs = False
    for o in range(len(table)):
        differs = differs or (table[o, 0] >= 0.0 and table[o, 5] != 0.0)
    work, values = _work(rows), np.empty((1 + len(table), BLOCK), np.complex128)
    points, lost_here, axes = np.empty(BLOCK, np.complex128), np.empty(BLOCK, np.bool_), np.empty((4, BLOCK))
    for first in range(0, s.size, BLOCK):
        n = min(BLOCK, s.size - first)
        points[:n] = s[first : first + n]
        points[n:] = points[0]
        _sweep(points, rows, ends, work, lost_here)
        for i in range(BLOCK):
            axes[:, i] = axis[:, min(first + min(i, n - 1), axis.shape[1] - 1)]
        _go_back(points, rows, axes, work, differs, lost_here)
        _drive(points, innermost(rows), ends, work.planes[0], values[0], lost_here)
        for o in range(len(table)):
            _output(points, table[o], work, values[1 + o], lost_here)
        found[0, first : first + n], found[1, first : first + n] = values[0, :n], work.scale[:n]
        found[2:, first : first + n] = values[1:, :n]
        lost[first : first + n] = lost_here[:n]


@inlined
def innermost(rows: Any) -> Any:
    """Return the row of the segment at the hub."""
    last = rows[0]
    for j in range(len(rows)):
        if rows[j, ROW_KIND] == SEGMENT:
            last = rows[j]
    return last


@compiled
def _drive(points: Any, segment: Any, ends: Any, plane: Any, drive: Any, lost: Any) -> None:
    """Compute the drive at every point of a block; digits are lost where it is small."""
    for i in range(BLOCK):
        drive[i] = drive_at(points[i], ends, plane[i], plane[BLOCK + i])
    for i in range(BLOCK):
        terms = drive_terms(points[i], segment, ends, plane[i], plane[BLOCK + i])
        lost[i] = lost[i] or magnitude(drive[i]) < POLE * terms


@compiled
def _output(points: Any, want: Any, work: Work, value: Any, lost: Any) -> None:
    """Compute an output of the table at every point of a block; digits are lost where it is a small difference."""
    of_theta, power, C, unit = want[5], int(want[6]), want[7], want[8]
    for i in range(BLOCK):
        value[i] = times(work.theta[i], of_theta)
    if want[0] >= 0.0:
        mark = int(want[0])
        states, scale, shift = work.marked[mark], work.scales[mark], work.shifts[mark]
        for i in range(BLOCK):
            at = times(states[i], want[1]) + times(states[BLOCK + i], want[2])
            at += times(states[2 * BLOCK + i], want[3]) + times(states[3 * BLOCK + i], want[4])
            if scale[i] != 0.0 or shift[i]:
                decay, turn = math.ldexp(math.exp(scale[i].real), shift[i]), scale[i].imag
                at *= complex(decay * math.cos(turn), decay * math.sin(turn))
            size = magnitude(value[i])
            value[i] += at
            if of_theta != 0.0 and magnitude(value[i]) < DIFFERENCE * size:
                if work.known[mark, i]:
                    value[i] = times(work.yielded[mark, i], want[1]) + times(work.yielded[mark, BLOCK + i], want[2])
                else:
                    lost[i] = lost[i] or magnitude(value[i]) < SMALL_DIFFERENCE * size
    for _ in range(power):
        for i in range(BLOCK):
            value[i] *= points[i]
    for i in range(BLOCK):
        value[i] = times(value[i] * reciprocal(1.0 + C * points[i]), unit) if C else times(value[i], unit)
