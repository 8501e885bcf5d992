"""Segments of a chain in float64, many s at a time: the plane carried inwards, the condition carried back outwards.

The steps of a block of points are loops of arithmetic alone, which vectorise, and one with the exponentials (as in
`waves`).  The waves of each segment, or its transition functions where both are slow, are kept for the way back.

Arrays of a block are flat buffers: component j of point i at `BLOCK` j + i.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex

from .compiled import compiled, inlined
from .layout import BENDING, CHAIN_A, CHAIN_B, CHAIN_G, CHAIN_SIGMA, LENGTH
from .waves import (
    DAMPING,
    PARALLEL,
    Plane,
    Row,
    Wave,
    across_rows,
    across_waves,
    dispersion,
    in_chain,
    is_low,
    magnitude,
    reciprocal,
    row_across,
    row_across_waves,
    scaled,
    transition_rows,
    transition_series,
    wave_functions,
    wave_sums,
)

BLOCK = 32  # points of a block: few for single points, many for the overhead of loops
S_SQUARED, D, GS, Z1, V1, T1, DT1, Z2, V2, T2, DT2 = (BLOCK * j for j in range(11))
C1, S1, E1, C2, S2, E2 = (BLOCK * j for j in range(6))
F2_LESS_1, F3_LESS_1 = 4 * BLOCK, 5 * BLOCK  # of the transition functions, after F0..F3
LIFT, TURN = 4 * BLOCK, 5 * BLOCK  # of a mark, after its state

PLANE_SIZE, ROW_SIZE, NUMBERS_SIZE, FUNCTIONS_SIZE = (BLOCK * parts for parts in (6, 4, 11, 6))  # of the flat buffers
SLOW_WAVE = 1.0  # |z_2| below which a wave has little phase along a segment: next to its shear cut-off
FADED = 1e-140  # |e^{-t}| below which its reciprocal would overflow


class Work(NamedTuple):
    """Scratch arrays of a block, many by the row j of an element.

    `planes` j + 1 is inside of the element, 0 at the tip's end; that of a mark becomes its state on the way back, and
    W - r theta and Psi - theta there.  It was divided by 2^`powers` after the element; a mark's state times e^`scales`
    2^`shifts` has the scale of the plane at the axis.  Of a segment `low` are the slow points, the others have waves
    (`numbers`, `functions`) and those a `series`.  `condition` is the row on the way back; `lift` and `turn` are
    W - r theta and Psi - theta there, r the distance from the axis, nan beyond a segment that is not slow.  `watched`
    are points next to a segment's shear cut-off.
    """

    planes: Complex
    powers: NDArray[np.int64]
    scales: Complex
    shifts: NDArray[np.int64]
    low: NDArray[np.bool_]
    numbers: Complex
    functions: Complex
    series: Complex
    condition: Complex
    faded: Complex
    scale: Complex
    theta: Complex
    lift: Complex
    turn: Complex
    watched: NDArray[np.bool_]


@inlined
def times(z: complex, factor: float) -> complex:
    """Return z times a real number, which numba would convert to a complex one."""
    return complex(z.real * factor, z.imag * factor)


@compiled
def cross(points: Any, row: Any, j: int, work: Work, lost: Any) -> None:
    """Compute the plane at the inner end of a segment, row j, from that at its outer one, at the points of a block.

    Scales are added to `work.scale`, lost digits and points next to the shear cut-off are marked.
    """
    plane, inner, numbers = work.planes[j], work.planes[j + 1], work.numbers[j]
    slow = mark_slow(points, row, work.low[j])
    if slow < BLOCK:
        all_wave_numbers(points, row, numbers)
        all_wave_functions(numbers, work.functions[j])
        _by_waves(row, numbers, work.functions[j], plane, inner)
        mark_parallel(numbers, work.low[j], lost)
        for i in range(BLOCK):
            if not work.low[j, i]:
                t1, t2 = phases(numbers, i)
                work.scale[i] += t1 + t2
                work.watched[i] = work.watched[i] or magnitude(numbers[Z2 + i]) < SLOW_WAVE
    if slow:
        other = inner.copy() if slow < BLOCK else inner
        _by_series(points, row, work.series[j], plane, other)
        if slow < BLOCK:
            take_where(work.low[j], other, inner)


@compiled
def mark_slow(points: Any, row: Any, low: Any) -> int:
    """Mark the points with slow waves (`is_low`), and return their number."""
    slow = 0
    for i in range(BLOCK):
        low[i] = is_low(points[i], row)
        slow += low[i]
    return slow


@compiled
def mark_parallel(numbers: Any, low: Any, lost: Any) -> None:
    """Mark the points where both waves are nearly one (`PARALLEL`)."""
    for i in range(lost.size):
        if not low[i]:
            z1, z2 = numbers[Z1 + i], numbers[Z2 + i]
            lost[i] = lost[i] or magnitude(z1 - z2) < PARALLEL * (magnitude(z1) + magnitude(z2))


@compiled
def all_wave_numbers(points: Any, row: Any, numbers: Any) -> None:
    """Compute `dispersion` at every point of a block."""
    for i in range(BLOCK):
        S, d, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(points[i], row)
        numbers[S_SQUARED + i], numbers[D + i], numbers[GS + i] = S, d, gS
        numbers[Z1 + i], numbers[V1 + i], numbers[T1 + i], numbers[DT1 + i] = z1, v1, t1, dt1
        numbers[Z2 + i], numbers[V2 + i], numbers[T2 + i], numbers[DT2 + i] = z2, v2, t2, dt2


@compiled
def all_wave_functions(numbers: Any, functions: Any) -> None:
    """Compute the two complex exponentials of each point, the only loop that calls a library."""
    for i in range(BLOCK):
        c1, s1, e1 = wave_functions(numbers[Z1 + i], numbers[T1 + i], numbers[DT1 + i])
        c2, s2, e2 = wave_functions(numbers[Z2 + i], numbers[T2 + i], numbers[DT2 + i])
        functions[C1 + i], functions[S1 + i], functions[E1 + i] = c1, s1, e1
        functions[C2 + i], functions[S2 + i], functions[E2 + i] = c2, s2, e2


@compiled
def take_where(low: Any, source: Any, target: Any) -> None:
    """Copy the slow points of another buffer."""
    for j in range(len(target) // BLOCK):
        for i in range(BLOCK):
            if low[i]:
                target[BLOCK * j + i] = source[BLOCK * j + i]


@inlined
def plane_at(buffer: Any, i: int) -> Plane:
    """Return the plane of a point."""
    return buffer[i], buffer[BLOCK + i], buffer[2 * BLOCK + i], buffer[3 * BLOCK + i], buffer[4 * BLOCK + i]


@inlined
def put_plane(buffer: Any, i: int, p: Plane) -> None:
    """Write the plane of a point."""
    buffer[i], buffer[BLOCK + i], buffer[2 * BLOCK + i], buffer[3 * BLOCK + i], buffer[4 * BLOCK + i] = p


@inlined
def row_at(buffer: Any, i: int) -> Row:
    """Return the condition of a point."""
    return buffer[i], buffer[BLOCK + i], buffer[2 * BLOCK + i], buffer[3 * BLOCK + i]


@inlined
def put_row(buffer: Any, i: int, f: Row) -> None:
    """Write the condition, or the state, of a point."""
    buffer[i], buffer[BLOCK + i], buffer[2 * BLOCK + i], buffer[3 * BLOCK + i] = f


@inlined
def waves_at(numbers: Any, functions: Any, i: int) -> tuple[Wave, Wave]:
    """Return both waves of a point."""
    return (
        (functions[C1 + i], functions[S1 + i], numbers[Z1 + i], numbers[V1 + i], functions[E1 + i]),
        (functions[C2 + i], functions[S2 + i], numbers[Z2 + i], numbers[V2 + i], functions[E2 + i]),
    )


@inlined
def phases(numbers: Any, i: int) -> tuple[complex, complex]:
    """Return t of both waves of a point."""
    return numbers[T1 + i] + numbers[DT1 + i], numbers[T2 + i] + numbers[DT2 + i]


@inlined
def _chain_waves(row: Any, numbers: Any, functions: Any, i: int) -> tuple[Wave, Wave, complex, complex]:
    """Return both waves of a point, g S and d in the chain's units."""
    one, two = waves_at(numbers, functions, i)
    l, EI = row[LENGTH], row[BENDING]
    gS, d = times(numbers[GS + i], EI / (l * l * l * l)), times(numbers[D + i], EI)
    return in_chain(one, l), in_chain(two, l), gS, d


@compiled
def _by_waves(row: Any, numbers: Any, functions: Any, plane: Any, inner: Any) -> None:
    """Compute `across_waves` at every point of a block."""
    for i in range(BLOCK):
        one, two, gS, d = _chain_waves(row, numbers, functions, i)
        p, gap = across_waves(one, two, gS, d, plane_at(plane, i)), one[2] - two[2]
        put_plane(inner, i, scaled(p, reciprocal(gS * d * gap * gap)))


@inlined
def rows_at(s: complex, row: Any, series: Any, i: int) -> tuple[Row, Row, Row, Row]:
    """Return the transition matrix of a slow segment at a point from F0..F3 in the chain's units."""
    over_d = times(reciprocal(1.0 + row[DAMPING] * s), 1.0 / row[BENDING])
    return transition_rows(
        *row_at(series, i), s * s, over_d, row[CHAIN_A], row[CHAIN_B], row[CHAIN_G], row[CHAIN_SIGMA]
    )


@compiled
def _by_series(points: Any, row: Any, series: Any, plane: Any, inner: Any) -> None:
    """Compute F0..F3, F2 - 1 and F3 - 1 of a slow segment in the chain's units, and `across_rows`, in a block."""
    l = row[LENGTH]
    for i in range(BLOCK):
        _, _, z_sum, z_product = wave_sums(points[i], row)
        F0, F1, F2, F3, F2_less_1, F3_less_1 = transition_series(z_sum, z_product)
        put_row(series, i, (times(F0, l * l * l), times(F1, l * l), times(F2, l), F3))
        series[F2_LESS_1 + i], series[F3_LESS_1 + i] = times(F2_less_1, l), F3_less_1
    for i in range(BLOCK):
        put_plane(inner, i, across_rows(*rows_at(points[i], row, series, i), plane_at(plane, i)))


@compiled
def cross_back(points: Any, row: Any, j: int, work: Work, scale: Any) -> None:
    """Compute the condition at the outer end of a segment, row j, from that at its inner one, in place; see `cross`.

    The scales less those of the plane are added to `scale`.
    """
    f, low, slow = work.condition, work.low[j], 0
    for i in range(BLOCK):
        slow += low[i]
    other = f.copy() if 0 < slow < BLOCK else f
    if slow:
        _row_by_series(points, row, work.series[j], other)
    if slow < BLOCK:
        _fade(work.numbers[j], work.functions[j], work.faded, scale, low)
        _row_by_waves(row, work.numbers[j], work.faded, f)
        if slow:
            take_where(low, other, f)


@inlined
def _ratio(e1: complex, e2: complex, t1: complex, t2: complex) -> complex:
    """Return e^{-t} of the faster wave over that of the slower one, also where both underflow."""
    if t1.real < t2.real:
        e1, e2, t1, t2 = e2, e1, t2, t1
    if magnitude(e2) > FADED:
        return e1 * reciprocal(e2)
    decay, turn = math.exp(t2.real - t1.real), t2.imag - t1.imag
    return complex(decay * math.cos(turn), decay * math.sin(turn))


@compiled
def _fade(numbers: Any, functions: Any, faded: Any, scale: Any, low: Any) -> None:
    """Compute c and s of both waves in the scale of the faster one."""
    for i in range(BLOCK):
        c1, s1, c2, s2 = functions[C1 + i], functions[S1 + i], functions[C2 + i], functions[S2 + i]
        t1, t2 = phases(numbers, i)
        left = t2 if t1.real >= t2.real else t1
        ratio = _ratio(functions[E1 + i], functions[E2 + i], t1, t2)
        if t1.real >= t2.real:
            c2, s2 = c2 * ratio, s2 * ratio
        else:
            c1, s1 = c1 * ratio, s1 * ratio
        faded[C1 + i], faded[S1 + i], faded[C2 + i], faded[S2 + i] = c1, s1, c2, s2
        if not low[i]:
            scale[i] -= left


@compiled
def _row_by_waves(row: Any, numbers: Any, faded: Any, f: Any) -> None:
    """Compute `row_across_waves` in place, at every point of a block."""
    for i in range(BLOCK):
        one, two, gS, d = _chain_waves(row, numbers, faded, i)
        own = row_across_waves(one, two, gS, d, row_at(f, i))
        unit = reciprocal(gS * d * (one[2] - two[2]))
        put_row(f, i, (own[0] * unit, own[1] * unit, own[2] * unit, own[3] * unit))


@compiled
def _row_by_series(points: Any, row: Any, series: Any, f: Any) -> None:
    """Compute `row_across` in place, at every point of a block."""
    for i in range(BLOCK):
        put_row(f, i, row_across(*rows_at(points[i], row, series, i), row_at(f, i)))


@inlined
def finish(points: Any, source: Any, power: int, unit: float, C: float, value: Any) -> None:
    """Compute the values of an output, those of its source times  unit s^power/(1 + C s),  power at most 4."""
    for i in range(value.size):
        s, found = points[i], source[i]
        found = found * s if power % 2 == 1 else found
        found = found * (s * s) if power > 1 else found
        found = found * (s * s) if power > 3 else found
        value[i] = times(found * reciprocal(1.0 + C * s), unit) if C else times(found, unit)
