"""Segments of a chain in float64, many s at a time: the plane carried inwards, the condition carried back outwards.

The steps of a block of points are loops of arithmetic alone, which vectorise, and one with the exponentials (as in
`waves`).  The waves of each segment, or its transition functions where both are slow, are kept for the way back.

The numbers of a block are a flat buffer: component j of point i at `BLOCK` j + i.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex
from tfarm.exact.compiled import inlined
from tfarm.exact.waves import (
    SolutionPlane,
    SolutionRow,
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
    scale_plane,
    transition_rows,
    transition_series,
    wave_functions,
    wave_sums,
)

# points of a block: few for single points, many for the overhead of loops
BLOCK = 32
# A plane; on the way back of a mark its state, W - r theta and Psi - theta there.
LIFT, TURN, PLANE_SIZE = (BLOCK * j for j in (4, 5, 6))
# Of a segment S, d and g S; z, v, t and dt of each wave, then its c, s, e and t + dt; F0..F3, F2 - 1 and F3 - 1.
S_SQUARED, ONE, TWO, SERIES, WAVES_SIZE = (BLOCK * j for j in (0, 3, 11, 19, 25))
# of a wave
FUNCTIONS, PHASE = (BLOCK * j for j in (4, 7))


class BlockBuffers(NamedTuple):
    """Scratch arrays of a block, many by the row j of an element.

    `planes` j + 1 is inside of the element, 0 at the tip's end; that of a mark becomes its state on the way back.  It
    was divided by 2^`powers` after the element; a mark's state times e^`scales` 2^`shifts` has the scale of the plane
    at the axis.  Of a segment `low` are the slow points.  `back` is the condition on the way back, W - r theta and
    Psi - theta, r the distance from the axis, nan beyond a segment that is not slow.
    """

    planes: Complex
    waves: Complex
    powers: NDArray[np.int64]
    scales: Complex
    shifts: NDArray[np.int64]
    low: NDArray[np.bool_]
    back: Complex
    scale: Complex
    theta: Complex


@inlined
def times(z: complex, factor: float) -> complex:
    """Return z times a real number, which numba would convert to a complex one."""
    return complex(z.real * factor, z.imag * factor)


@inlined
def write_point(buffer: Any, i: int, numbers: tuple[complex, ...]) -> None:
    """Write the numbers of a point."""
    for j in range(len(numbers)):
        buffer[BLOCK * j + i] = numbers[j]


@inlined
def put_where(chosen: bool, buffer: Any, i: int, numbers: tuple[complex, ...]) -> None:
    """Write the numbers of a chosen point, without a branch."""
    for j in range(len(numbers)):
        buffer[BLOCK * j + i] = numbers[j] if chosen else buffer[BLOCK * j + i]


@inlined
def row_at(buffer: Any, i: int) -> SolutionRow:
    """Return four numbers of a point."""
    return buffer[i], buffer[BLOCK + i], buffer[2 * BLOCK + i], buffer[3 * BLOCK + i]


@inlined
def plane_at(buffer: Any, i: int) -> SolutionPlane:
    """Return the plane of a point."""
    return buffer[i], buffer[BLOCK + i], buffer[2 * BLOCK + i], buffer[3 * BLOCK + i], buffer[4 * BLOCK + i]


@inlined
def cross(points: Any, row: Any, j: int, work: BlockBuffers, lost: Any) -> None:
    """Compute the plane at the inner end of a segment, row j, from that at its outer one, at the points of a block.

    Scales are added to `work.scale`, lost digits are marked.
    """
    # |z_1 - z_2| below this share of |z_1| + |z_2| loses digits
    parallel = 0.15
    outer = work.planes[j]
    inner = work.planes[j + 1]
    waves = work.waves[j]
    low = work.low[j]
    slow = 0
    for i in range(BLOCK):
        low[i] = is_low(points[i], row)
        slow += low[i]
    if slow < BLOCK:
        fill_waves(points, row, waves)
        for i in range(BLOCK):
            one, two, gS, d = waves_at(row, waves, i)
            gap = one[2] - two[2]
            unit = reciprocal(gS * d * gap * gap)
            carried = across_waves(one, two, gS, d, plane_at(outer, i))
            write_point(inner, i, scale_plane(carried, unit))
        for i in range(BLOCK):
            z1 = waves[ONE + i]
            z2 = waves[TWO + i]
            work.scale[i] += 0.0 if low[i] else waves[ONE + PHASE + i] + waves[TWO + PHASE + i]
            is_parallel = magnitude(z1 - z2) < parallel * (magnitude(z1) + magnitude(z2))
            lost[i] |= (not low[i]) & is_parallel
    if slow:
        _fill_series(points, row, waves)
        for i in range(BLOCK):
            W, Psi, M, Q = rows_at(points[i], row, waves, i)
            put_where(low[i], inner, i, across_rows(W, Psi, M, Q, plane_at(outer, i)))


@inlined
def fill_waves(points: Any, row: Any, waves: Any) -> None:
    """Compute numbers and functions of both waves at every point of a block: the latter alone calls a library."""
    for i in range(BLOCK):
        own, one, two = dispersion(points[i], row)
        write_point(waves, S_SQUARED + i, own)
        write_point(waves, ONE + i, one)
        write_point(waves, TWO + i, two)
    for i in range(BLOCK):
        (z1, _, t1, dt1) = row_at(waves, ONE + i)
        (z2, _, t2, dt2) = row_at(waves, TWO + i)
        write_point(waves, ONE + FUNCTIONS + i, wave_functions(z1, t1, dt1))
        write_point(waves, TWO + FUNCTIONS + i, wave_functions(z2, t2, dt2))


@inlined
def waves_at(row: Any, waves: Any, i: int) -> tuple[Wave, Wave, complex, complex]:
    """Return both waves of a point, g S and d, in the chain's units."""
    (z1, v1, _, _) = row_at(waves, ONE + i)
    (c1, s1, e1, _) = row_at(waves, ONE + FUNCTIONS + i)
    (z2, v2, _, _) = row_at(waves, TWO + i)
    (c2, s2, e2, _) = row_at(waves, TWO + FUNCTIONS + i)
    (_, d, gS, _) = row_at(waves, S_SQUARED + i)
    l = row.length
    EI = row.stiffness
    one = in_chain((c1, s1, z1, v1, e1), l)
    two = in_chain((c2, s2, z2, v2, e2), l)
    return one, two, times(gS, EI / (l * l * l * l)), times(d, EI)


@inlined
def rows_at(
    s: complex, row: Any, waves: Any, i: int
) -> tuple[SolutionRow, SolutionRow, SolutionRow, SolutionRow]:
    """Return the transition matrix of a slow segment at a point from F0..F3 in the chain's units."""
    over_d = times(reciprocal(1.0 + row.damping * s), 1.0 / row.stiffness)
    return transition_rows(row_at(waves, SERIES + i), s * s, over_d, row.of_chain)


@inlined
def _fill_series(points: Any, row: Any, waves: Any) -> None:
    """Compute F0..F3, F2 - 1 and F3 - 1 of a slow segment in the chain's units, at every point of a block."""
    l = row.length
    for i in range(BLOCK):
        _, _, z_sum, z_product = wave_sums(points[i], row)
        F0, F1, F2, F3, F2_less_1, F3_less_1 = transition_series(z_sum, z_product)
        own = times(F0, l * l * l), times(F1, l * l), times(F2, l), F3, times(F2_less_1, l), F3_less_1
        write_point(waves, SERIES + i, own)


@inlined
def cross_back(points: Any, row: Any, j: int, work: BlockBuffers, scale: Any) -> None:
    """Compute the condition at the outer end of a segment, row j, from that at its inner one, in place; see `cross`.

    The scales less those of the plane are added to `scale`.
    """
    back = work.back
    waves = work.waves[j]
    low = work.low[j]
    slow = 0
    for i in range(BLOCK):
        slow += low[i]
    if slow < BLOCK:
        _fade(waves, low, scale)
        for i in range(BLOCK):
            one, two, gS, d = waves_at(row, waves, i)
            W, Psi, M, Q = row_across_waves(one, two, gS, d, row_at(back, i))
            unit = reciprocal(gS * d * (one[2] - two[2]))
            put_where(not low[i], back, i, (W * unit, Psi * unit, M * unit, Q * unit))
    if slow:
        for i in range(BLOCK):
            rows = rows_at(points[i], row, waves, i)
            put_where(low[i], back, i, row_across(*rows, row_at(back, i)))


@inlined
def _fade(waves: Any, low: Any, scale: Any) -> None:
    """Bring c and s of the slower wave to the scale of the faster one, also where both e^{-t} underflow."""
    for i in range(BLOCK):
        one = ONE + FUNCTIONS + i
        two = TWO + FUNCTIONS + i
        is_first = waves[ONE + PHASE + i].real >= waves[TWO + PHASE + i].real
        fast, slow = (one, two) if is_first else (two, one)
        (_, _, e, t) = row_at(waves, fast)
        (c, s, e_slow, t_slow) = row_at(waves, slow)
        # below that a reciprocal would overflow
        if magnitude(e_slow) > 1e-140:
            ratio = e * reciprocal(e_slow)
        else:
            decay = math.exp(t_slow.real - t.real)
            turn = t_slow.imag - t.imag
            ratio = complex(decay * math.cos(turn), decay * math.sin(turn))
        waves[slow] = c * ratio
        waves[slow + BLOCK] = s * ratio
        if not low[i]:
            scale[i] -= t_slow


@inlined
def finish_output(points: Any, source: Any, power: int, unit: float, C: float, value: Any) -> None:
    """Compute the values of an output, those of its source times  unit s^power/(1 + C s),  power at most 4."""
    for i in range(value.size):
        s = points[i]
        found = source[i]
        found = found * s if power % 2 == 1 else found
        found = found * (s * s) if power > 1 else found
        found = found * (s * s) if power > 3 else found
        value[i] = times(found * reciprocal(1.0 + C * s), unit) if C else times(found, unit)
