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

from .compiled import compiled, inlined
from .layout import TO_M, TO_Q, TO_W
from .waves import (
    PARALLEL,
    SIGMA,
    A,
    B,
    G,
    Plane,
    Row,
    Wave,
    across_rows,
    across_waves,
    dispersion,
    is_low,
    magnitude,
    reciprocal,
    row_across,
    row_across_waves,
    transition_rows,
    transition_series,
    wave_functions,
    wave_sums,
)

BLOCK = 32  # points of a block: few for single points, many for the overhead of loops
S_SQUARED, D, GS, Z1, V1, T1, DT1, Z2, V2, T2, DT2 = (BLOCK * j for j in range(11))
C1, S1, E1, C2, S2, E2 = (BLOCK * j for j in range(6))

PLANE_SIZE, ROW_SIZE, NUMBERS_SIZE, FUNCTIONS_SIZE = (BLOCK * parts for parts in (5, 4, 11, 6))  # of the flat buffers
SLOW_WAVE = 1.0  # |z_2| below which a wave has little phase along a segment: next to its shear cut-off
FADED = 1e-140  # |e^{-t}| below which its reciprocal would overflow


class Kept(NamedTuple):
    """The data of each segment (rows) and point for the way back: waves, or transition functions where `low`."""

    low: NDArray[np.bool_]
    numbers: NDArray[np.complex128]
    functions: NDArray[np.complex128]
    series: NDArray[np.complex128]


@inlined
def times(z: complex, factor: float) -> complex:
    """Return z times a real number, which numba would convert to a complex one."""
    return complex(z.real * factor, z.imag * factor)


@compiled
def cross(
    points: Any, row: Any, plane: Any, inner: Any, scale: Any, lost: Any, watched: Any, kept: Any, number: int
) -> None:
    """Compute the plane at the inner end of a segment (`inner`) from that at its outer one, at the points of a block.

    Scales are added to `scale`, lost digits and points next to the shear cut-off are marked.  Data for the way back are
    in `kept` (`Kept`) under its number.
    """
    low, numbers, series, slow = kept.low[number], kept.numbers[number], kept.series[number], 0
    for i in range(BLOCK):
        low[i] = is_low(points[i], row)
        slow += low[i]
    if slow < BLOCK:
        all_wave_numbers(points, row, numbers)
        all_wave_functions(numbers, kept.functions[number])
        _by_waves(row, numbers, kept.functions[number], plane, inner)
        for i in range(BLOCK):
            if not low[i]:
                z1, z2 = numbers[Z1 + i], numbers[Z2 + i]
                scale[i] += numbers[T1 + i] + numbers[DT1 + i] + numbers[T2 + i] + numbers[DT2 + i]
                lost[i] = lost[i] or magnitude(z1 - z2) < PARALLEL * (magnitude(z1) + magnitude(z2))
                watched[i] = watched[i] or magnitude(z2) < SLOW_WAVE
    if slow:
        _transition(points, row, series)
        other = inner.copy() if slow < BLOCK else inner
        _by_series(points, row, series, plane, other)
        if slow < BLOCK:
            take_where(low, other, inner)


@compiled
def all_wave_numbers(points: Any, row: Any, numbers: Any) -> None:
    """Compute `dispersion` at every point of a block."""
    for i in range(BLOCK):
        S, d, _, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(points[i], row)
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
def _units(row: Any) -> Plane:
    """Return the factors of a plane from the chain's units to those of a segment."""
    return row[TO_W], row[TO_W] * row[TO_M], row[TO_M], row[TO_Q], row[TO_M] * row[TO_Q]


@inlined
def _inverse(units: Plane) -> Plane:
    """Return the factors back."""
    return 1.0 / units[0], 1.0 / units[1], 1.0 / units[2], 1.0 / units[3], 1.0 / units[4]


@inlined
def _scaled(p: Plane, units: Plane) -> Plane:
    """Return a plane in other units."""
    return (
        times(p[0], units[0]), times(p[1], units[1]), times(p[2], units[2]), times(p[3], units[3]),
        times(p[4], units[4]),
    )  # fmt: skip


@inlined
def _scaled_row(f: Row, units: Plane) -> Row:
    """Return a condition in other units, of which `units` are those of a plane."""
    return times(f[0], units[0]), f[1], times(f[2], units[2]), times(f[3], units[3])


@compiled
def _by_waves(row: Any, numbers: Any, functions: Any, plane: Any, inner: Any) -> None:
    """Compute `across_waves` in the segment's own units, at every point of a block."""
    units = _units(row)
    back = _inverse(units)
    for i in range(BLOCK):
        S, d, gS = numbers[S_SQUARED + i], numbers[D + i], numbers[GS + i]
        one, two = waves_at(numbers, functions, i)
        v_sum, gap = S * (times(reciprocal(d), row[A]) - row[B]), one[2] - two[2]
        p = across_waves(one, two, gS, d, v_sum, _scaled(plane_at(plane, i), units))
        unit = reciprocal(gS * d * gap * gap)
        put_plane(inner, i, _scaled((p[0] * unit, p[1] * unit, p[2] * unit, p[3] * unit, p[4] * unit), back))


@compiled
def _transition(points: Any, row: Any, series: Any) -> None:
    """Compute F0..F3 of a slow segment, at every point of a block."""
    for i in range(BLOCK):
        _, _, z_sum, z_product = wave_sums(points[i], row)
        F0, F1, F2, F3, _, _ = transition_series(z_sum, z_product)
        put_row(series, i, (F0, F1, F2, F3))


@inlined
def _rows(i: int, points: Any, row: Any, series: Any) -> tuple[Row, Row, Row, Row]:
    """Return the transition matrix of a slow segment at a point."""
    S, over_d, _, _ = wave_sums(points[i], row)
    return transition_rows(*row_at(series, i), S, over_d, row[A], row[B], row[G], row[SIGMA])


@compiled
def _by_series(points: Any, row: Any, series: Any, plane: Any, inner: Any) -> None:
    """Compute `across_rows` in the segment's own units, at every point of a block."""
    units = _units(row)
    back = _inverse(units)
    for i in range(BLOCK):
        p = across_rows(*_rows(i, points, row, series), _scaled(plane_at(plane, i), units))
        put_plane(inner, i, _scaled(p, back))


@compiled
def cross_back(points: Any, row: Any, f: Any, outer: Any, scale: Any, faded: Any, kept: Any, number: int) -> None:
    """Compute the condition at the outer end of a segment (`outer`) from that at its inner one; see `cross`.

    The scales less those of the plane are added to `scale`; `faded` (6 blocks) is scratch.
    """
    low, slow = kept.low[number], 0
    for i in range(BLOCK):
        slow += low[i]
    if slow < BLOCK:
        _fade(kept.numbers[number], kept.functions[number], faded, scale, low)
        _row_by_waves(row, kept.numbers[number], faded, f, outer)
    if slow:
        other = outer.copy() if slow < BLOCK else outer
        _row_by_series(points, row, kept.series[number], f, other)
        if slow < BLOCK:
            take_where(low, other, outer)


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
        t1, t2 = numbers[T1 + i] + numbers[DT1 + i], numbers[T2 + i] + numbers[DT2 + i]
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
def _row_by_waves(row: Any, numbers: Any, faded: Any, f: Any, outer: Any) -> None:
    """Compute `row_across_waves` in the segment's own units, at every point of a block."""
    units = _units(row)
    back = _inverse(units)
    for i in range(BLOCK):
        d, gS = numbers[D + i], numbers[GS + i]
        one, two = waves_at(numbers, faded, i)
        own = row_across_waves(one, two, gS, d, _scaled_row(row_at(f, i), back))
        unit = reciprocal(gS * d * (one[2] - two[2]))
        put_row(outer, i, _scaled_row((own[0] * unit, own[1] * unit, own[2] * unit, own[3] * unit), units))


@compiled
def _row_by_series(points: Any, row: Any, series: Any, f: Any, outer: Any) -> None:
    """Compute `row_across` in the segment's own units, at every point of a block."""
    units = _units(row)
    back = _inverse(units)
    for i in range(BLOCK):
        own = row_across(*_rows(i, points, row, series), _scaled_row(row_at(f, i), back))
        put_row(outer, i, _scaled_row(own, units))
