"""The free response of a chain in float64: the plane swept inwards from the payload, the hub's condition outwards.

At each s the plane of states (`waves`) is carried from the payload to the axis, where W = 0 determines theta and the
moment on the hub.  The condition W = 0 is carried back to the places of the outputs.  For a segment with a fast wave
the waves are used, else its transition functions; each scale e^{t} is factored out.  An output has the scales of the
segments inside of it alone, as a difference of two sums over all segments would lose digits.

Points are processed in blocks, component by component (`pieces`).
"""

import math
from typing import Any

import numpy as np

from tfarm.exact.compiled import compiled, inlined
from tfarm.exact.layout import BODY, MARK, OF_ANGLE, OF_MOMENT, OFFSET, SEGMENT, SPRING
from tfarm.exact.pieces import (
    BLOCK,
    LIFT,
    PLANE_SIZE,
    SERIES,
    TURN,
    WAVES_SIZE,
    BlockBuffers,
    cross,
    cross_back,
    finish_output,
    plane_at,
    row_at,
    rows_at,
    times,
    write_point,
)
from tfarm.exact.waves import (
    Number,
    SolutionPlane,
    SolutionRow,
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
)
from tfarm.records import read_only

# the condition W = 0 there, at every point
AXIS = read_only(np.array([[1.0], [0.0], [0.0], [0.0]]))


@inlined
def _work(rows: int) -> BlockBuffers:
    """Return the scratch arrays of a chain of that number of rows."""
    number = np.complex128
    by_row = (rows, BLOCK)
    return BlockBuffers(
        np.empty((rows + 1, PLANE_SIZE), number),
        np.empty((rows, WAVES_SIZE), number),
        np.empty(by_row, np.int64),
        np.empty(by_row, number),
        np.empty(by_row, np.int64),
        np.empty(by_row, np.bool_),
        np.empty(PLANE_SIZE, number),
        np.empty(BLOCK, number),
        np.empty(BLOCK, number),
    )


@inlined
def _sweep(points: Any, rows: Any, ends: Any, work: BlockBuffers, lost: Any) -> None:
    """Compute the plane inside of each element, and the scale of that at the axis; mark lost digits."""
    ln_2 = math.log(2.0)
    for i in range(BLOCK):
        write_point(work.planes[0], i, end_plane(*tip_conditions(ends, points[i] * points[i])))
        work.scale[i] = 0.0
        lost[i] = False
    for j in range(len(rows)):
        row = rows[j]
        outer = work.planes[j]
        inner = work.planes[j + 1]
        for i in range(BLOCK):
            work.powers[j, i] = 0
        if row.kind == SEGMENT:
            cross(points, row, j, work, lost)
        elif row.kind == MARK:
            for i in range(BLOCK):
                write_point(inner, i, plane_at(outer, i))
            continue
        else:
            for i in range(BLOCK):
                s = points[i]
                write_point(inner, i, inside(row.kind, row, s, s * s, plane_at(outer, i)))
        _rescale(inner, 5, work.powers[j])
        for i in range(BLOCK):
            work.scale[i] += work.powers[j, i] * ln_2


@inlined
def inside(kind: int, row: Any, s: Number, S: Number, p: SolutionPlane) -> SolutionPlane:
    """Return the plane inside an offset, a spring, a body or a mark."""
    if kind == OFFSET:
        return inside_offset(row.length, p)
    if kind == SPRING:
        return inside_spring(s * row.damping + row.stiffness, 0 * s + row.compliance, p)
    if kind == BODY:
        return inside_body(S * row.mass + row.stiffness, S * row.inertia + row.rotational_stiffness, p)
    return p


@inlined
def carry_beyond(kind: int, row: Any, s: Number, S: Number, f: SolutionRow) -> SolutionRow:
    """Return the condition beyond an offset, a spring or a body."""
    if kind == OFFSET:
        return beyond_offset(row.length, f)
    if kind == SPRING:
        return beyond_spring(s * row.damping + row.stiffness, 0 * s + row.compliance, f)
    return beyond_body(S * row.mass + row.stiffness, S * row.inertia + row.rotational_stiffness, f)


@inlined
def _rescale(buffer: Any, parts: int, powers: Any) -> None:
    """Divide each point's numbers by a power of two, added to `powers`, where they are near over- or underflow."""
    beyond = 0
    for i in range(BLOCK):
        size = 0.0
        for j in range(parts):
            z = buffer[BLOCK * j + i]
            size += abs(z.real) + abs(z.imag)
        beyond += not 1e-80 <= size <= 1e80
    if beyond == 0:
        return
    for i in range(BLOCK):
        largest = 0.0
        for j in range(parts):
            largest = max(largest, magnitude(buffer[BLOCK * j + i]))
        if 0.0 < largest < np.inf and not 1e-80 <= largest <= 1e80:
            power = math.frexp(largest)[1]
            powers[i] += power
            for j in range(parts):
                buffer[BLOCK * j + i] *= math.ldexp(1.0, -power)


@inlined
def _go_back(points: Any, rows: Any, outermost: int, work: BlockBuffers, differs: bool, lost: Any) -> None:
    """Compute the state at each mark, in place of its plane, from the condition of the axis carried outwards."""
    axis = work.planes[len(rows)]
    back = work.back
    reach = 0.0
    is_root = True
    scale = np.zeros(BLOCK, np.complex128)
    shift = np.zeros(BLOCK, np.int64)
    for i in range(BLOCK):
        work.theta[i] = met(row_at(back, i), plane_at(axis, i))[1]
        # W = 0 on the axis, of a mode also where another condition determines it
        back[LIFT + i] = 0.0
        back[TURN + i] = 0.0
    for j in range(len(rows) - 1, outermost - 1, -1):
        row = rows[j]
        if row.kind == MARK:
            for i in range(BLOCK):
                work.scales[j, i] = scale[i]
                work.shifts[j, i] = shift[i]
            _meet(work.planes[j + 1], work, is_root, reach, shift)
            continue
        if row.kind == SEGMENT:
            if differs:
                _beyond_segment(points, row, j, work, reach, shift)
            cross_back(points, row, j, work, scale)
            reach = reach + row.length
            is_root = False
        else:
            _carry_rigid(points, row, work.planes[j + 1], back, shift)
            if row.kind == OFFSET:
                reach += row.length
        for i in range(BLOCK):
            shift[i] -= work.powers[j, i]
        _rescale(back, 4, shift)


@inlined
def _meet(state: Any, work: BlockBuffers, is_root: bool, reach: float, shift: Any) -> None:
    """Compute the state of a mark, its plane's with the condition there, and W - r theta and Psi - theta.

    At the root, inside of all segments, W is their sum, without a difference.
    """
    back = work.back
    for i in range(BLOCK):
        write_point(state, i, met(row_at(back, i), plane_at(state, i)))
        if is_root:
            rigid = times(work.theta[i], reach)
            lifted = rigid + back[LIFT + i]
            # far up a spring at the root leaves of both next to nothing: the state itself has those digits
            if magnitude(lifted) >= 0.1 * magnitude(rigid):
                state[i] = times(lifted, math.ldexp(1.0, -shift[i])) if shift[i] else lifted
        state[LIFT + i] = back[LIFT + i]
        state[TURN + i] = back[TURN + i]


@inlined
def _carry_rigid(points: Any, row: Any, inner: Any, back: Any, shift: Any) -> None:
    """Compute condition, W - r theta and Psi - theta beyond an offset, a spring or a body, in place."""
    kind = row.kind
    for i in range(BLOCK):
        s = points[i]
        f = row_at(back, i)
        if kind == OFFSET:
            back[LIFT + i] += row.length * back[TURN + i]
        elif kind == SPRING:
            moment = times(met(f, plane_at(inner, i))[2], math.ldexp(1.0, shift[i]))
            back[TURN + i] += row.compliance * reciprocal(s * row.damping + row.stiffness) * moment
        write_point(back, i, carry_beyond(kind, row, s, s * s, f))


@inlined
def _beyond_segment(points: Any, row: Any, j: int, work: BlockBuffers, reach: float, shift: Any) -> None:
    """Compute W - r theta and Psi - theta beyond a slow segment from the state at its inner end; nan for others.

    It is `waves.transition_rows` from the other end, with the other sign of Psi and Q, minus the identity.
    """
    inner = work.planes[j + 1]
    waves = work.waves[j]
    back = work.back
    for i in range(BLOCK):
        if not work.low[j, i]:
            back[LIFT + i] = complex(np.nan, 0.0)
            continue
        unit = math.ldexp(1.0, shift[i])
        (_, _, M, Q) = met(row_at(back, i), plane_at(inner, i))
        M = times(M, unit)
        Q = times(Q, unit)
        lift = back[LIFT + i]
        turn = back[TURN + i]
        W = times(work.theta[i], reach) + lift
        Psi = work.theta[i] + turn
        of_W, of_Psi, _, _ = rows_at(points[i], row, waves, i)
        S = points[i] * points[i]
        F1 = waves[SERIES + BLOCK + i]
        F2_less_1 = waves[SERIES + 4 * BLOCK + i]
        F3_less_1 = waves[SERIES + 5 * BLOCK + i]
        even = F3_less_1 - row.of_chain[0] * S * of_W[2]
        odd = F3_less_1 - row.of_chain[1] * S * F1
        lift += row.length * turn
        back[LIFT + i] = lift + (even * W + F2_less_1 * Psi + of_W[2] * M - of_W[3] * Q)
        back[TURN + i] = turn + (odd * Psi - of_Psi[0] * W - of_Psi[2] * M + of_Psi[3] * Q)


@inlined
def drive_at(s: complex, segment: Any, ends: Any, theta: complex, M: complex) -> tuple[complex, float]:
    """Return the input of a response with that hub angle and moment on the hub, and its scale away from a pole.

    The scale is that of its two terms, and of each with the motion of the other.
    """
    A0 = OF_ANGLE
    B0 = OF_MOMENT
    of_angle = ends[A0] + s * (ends[A0 + 1] + s * (ends[A0 + 2] + s * ends[A0 + 3]))
    of_moment = ends[B0] + s * ends[B0 + 1]
    waves = impedance(magnitude(s * s), segment) * segment.stiffness / segment.length
    turned = magnitude(theta) + magnitude(M) / max(waves, 1.0)
    bent = magnitude(M) + magnitude(theta) * waves
    return of_angle * theta - of_moment * M, magnitude(of_angle) * turned + magnitude(of_moment) * bent


@compiled
def fill_free(
    s: Any, rows: Any, ends: Any, axis: Any, table: Any, found: Any, lost: Any, per_input: bool
) -> None:
    """Compute drive, scale and each output of the free response at s (1-D), rows of `found`; mark lost digits.

    It satisfies axis . (W, Psi, M, Q) = 0 on the hub's axis, W = 0 for `AXIS`; `axis` (4, n) has one column, or one for
    each point.  Outputs are those of a unit input with `per_input`, else times e^{-scale}.  A row of `table` is an
    output (`layout.OutputFormula`): the row of its place (or -1), its field, weight of theta, power of s, unit, C,
    weights of s theta and of the drive.  Digits are lost where two waves of a segment are nearly one, where an output
    is a small difference of fast waves, and where the drive is one, near a pole.
    """
    differs = False
    outermost = 0
    for o in range(len(table)):
        differs = differs or (table[o, 0] >= 0.0 and table[o, 2] != 0.0)
    while outermost < len(rows) and rows[outermost].kind != MARK:
        outermost += 1
    work = _work(len(rows))
    segment = innermost(rows)
    values = np.empty((1 + len(table), BLOCK), np.complex128)
    points = np.empty(BLOCK, np.complex128)
    over = np.ones(BLOCK, np.complex128)
    lost_here = np.empty(BLOCK, np.bool_)
    # against overflow of squares of a heavy hub's drive
    small = 1.0 / max(1.0, ends[OF_ANGLE + 1], ends[OF_ANGLE + 2])
    for first in range(0, s.size, BLOCK):
        n = min(BLOCK, s.size - first)
        for i in range(BLOCK):
            points[i] = s[first + i] if i < n else s[first]
        _sweep(points, rows, ends, work, lost_here)
        for i in range(BLOCK):
            at = min(first + min(i, n - 1), axis.shape[1] - 1)
            for j in range(4):
                work.back[BLOCK * j + i] = axis[j, at]
        _drive(points, segment, ends, work.planes[len(rows)], values[0], lost_here)
        if per_input:
            for i in range(BLOCK):
                over[i] = times(reciprocal(times(values[0, i], small)), small)
        if len(table):
            _go_back(points, rows, outermost, work, differs, lost_here)
        for o in range(len(table)):
            _output(points, table[o], work, values[0], over, values[1 + o], lost_here)
        for i in range(n):
            found[0, first + i] = values[0, i]
            found[1, first + i] = work.scale[i]
            lost[first + i] = lost_here[i]
            for o in range(len(table)):
                found[2 + o, first + i] = values[1 + o, i]


@inlined
def innermost(rows: Any) -> Any:
    """Return the row of the segment at the hub."""
    j = len(rows) - 1
    while rows[j].kind != SEGMENT:
        j -= 1
    return rows[j]


@inlined
def _drive(points: Any, segment: Any, ends: Any, plane: Any, drive: Any, lost: Any) -> None:
    """Compute the drive at every point of a block; digits are lost where it is small."""
    # a drive below this share of its terms is flagged, as it may be a pole
    pole = 1e-11
    for i in range(BLOCK):
        drive[i], terms = drive_at(points[i], segment, ends, plane[i], plane[BLOCK + i])
        lost[i] = lost[i] or magnitude(drive[i]) < pole * terms


@inlined
def _output(points: Any, want: Any, work: BlockBuffers, drive: Any, over: Any, value: Any, lost: Any) -> None:
    """Compute an output of the table at every point of a block; digits are lost where it is a small difference.

    Until its power of s it is times 2^100: at the tip W would underflow where s^2 W does not.
    """
    # an output below this share of its terms has lost a bit and is summed from the axis instead,
    difference = 0.5
    # or else flagged below this share, with four lost bits
    small_difference = 0.05
    j = int(want[0])
    field = BLOCK * int(want[1])
    lift = 2.0**100
    of_theta = lift * want[2]
    of_rate = lift * want[6]
    of_drive = lift * want[7]
    for i in range(BLOCK):
        value[i] = times(work.theta[i], of_theta)
    if of_drive != 0.0:
        for i in range(BLOCK):
            value[i] += times(drive[i], of_drive) + points[i] * times(work.theta[i], of_rate)
    if j >= 0:
        states = work.planes[j + 1]
        scale = work.scales[j]
        shift = work.shifts[j]
        for i in range(BLOCK):
            at = states[field + i]
            if scale[i] != 0.0 or shift[i]:
                root = math.exp(0.5 * scale[i].real)
                turn = scale[i].imag
                decay = math.ldexp(lift * root, shift[i]) * root
                at *= complex(decay * math.cos(turn), decay * math.sin(turn))
            else:
                at = times(at, lift)
            size = magnitude(value[i])
            value[i] += at
            if of_theta != 0.0 and magnitude(value[i]) < difference * size:
                if np.isfinite(states[LIFT + i].real):
                    value[i] = times(states[LIFT + field + i], lift)
                else:
                    lost[i] = lost[i] or magnitude(value[i]) < small_difference * size
    for i in range(BLOCK):
        value[i] *= over[i]
    finish_output(points, value, int(want[3]), want[4] / lift, want[5], value)
