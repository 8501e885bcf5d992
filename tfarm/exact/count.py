"""A chain without damping on the imaginary axis: the signs of the count of its natural frequencies.

All numbers are real there.  The count proceeds from the payload to the hub.  A segment clamped at both ends has the
count of the pinned one, in closed form, less 0 or 1 for each clamped rotation.  At each joint, between a segment with a
clamped inner end and the outer part clamped at the joint, first the displacement is released and then the rotation; at
last the clamp's spring, the joint and the hub.  Each step raises the count by 0 or 1 (Rayleigh's theorem on one
constraint).  The parity of the count is the sign of the determinant of that system, positive at rest.  For the outer
part these are p_WPsi where it is clamped and, with the numbers r of the plane of a clamped inner end at the joint,
r_PsiQ p_WPsi - r_WPsi p_PsiQ where W is free and Psi clamped.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.exact.compiled import compiled, inlined
from tfarm.exact.layout import OF_ANGLE, OF_MOMENT, SEGMENT, SPRING, Layout
from tfarm.exact.sweep import inside
from tfarm.exact.waves import (
    SERIES_RADIUS,
    SolutionPlane,
    Wave,
    across_rows,
    across_waves,
    dispersion,
    end_plane,
    even_functions,
    in_chain,
    scale_plane,
    tip_conditions,
    transition_rows,
    transition_series,
)
from tfarm.records import read_only

# of the estimate of a slender beam, a factor of 1e12: the end of a search
DOUBLINGS = 40


def rows_to_count(layout: Layout) -> tuple[NDArray[np.void], Real]:
    """Return rows and ends of a layout without damping, for `chain_count`, both read-only as those of a layout."""
    return layout.rows, np.asarray(read_only(np.append(layout.ends, layout.chain.free_motions_of_tip)))


@inlined
def _match_parity(number: int, value: float, step: int) -> int:
    """Return the count, changed by `step` where its parity differs from the sign of the determinant."""
    return number + step * ((number % 2 == 1) != (value < 0.0))


@inlined
def chain_count(omega: float, rows: Any, ends: Any) -> int:
    """Return the number of natural frequencies below omega [rad/s], with the rigid body."""
    # in the vector of ends: the number of free motions of the tip
    free_motions = 12
    S = -omega * omega
    p = end_plane(*tip_conditions(ends, S))
    number = 0
    free = int(ends[free_motions])
    for i in range(len(rows)):
        row = rows[i]
        if row.kind == SEGMENT:
            number, p = _join_segment(number, omega, row, p, free)
            free = 2
        else:
            p = inside(row.kind, row, 0.0, S, p)
        if row.kind == SPRING:
            number = _match_parity(number, p[0], 1)
    if ends[OF_MOMENT] == 0.0:
        return number
    drive = (ends[OF_ANGLE] + S * ends[OF_ANGLE + 2]) * p[0] - ends[OF_MOMENT] * p[1]
    return _match_parity(number, drive, 1)


@inlined
def _join_segment(
    outside: int, omega: float, row: Any, plane: SolutionPlane, free: int
) -> tuple[int, SolutionPlane]:
    """Return the count with one more segment, clamped at its inner end, and the plane carried across it.

    `outside` is the count of the outer part clamped at the joint, `free` the number of free motions there.
    """
    # W = Psi = 0
    clamped = (0.0, 0.0, 0.0, 0.0, 1.0)
    (s, _, _), (z1, v1, t1, dt1), (z2, v2, t2, dt2) = dispersion(complex(0.0, omega), row)
    travel_both = z1.real < 0.0 and z2.real < 0.0
    number = half_waves(z1, t1, dt1) + half_waves(z2, t2, dt2) + travel_both
    S = s.real
    z1 = z1.real
    z2 = z2.real
    l = row.length
    EI = row.stiffness
    if max(abs(z1), abs(z2)) < SERIES_RADIUS:
        F0, F1, F2, F3, _, _ = transition_series(z1 + z2, z1 * z2)
        rows = transition_rows((F0 * (l * l * l), F1 * (l * l), F2 * l, F3), S, 1.0 / EI, row.of_chain)
        q = across_rows(*rows, plane)
        r = across_rows(*rows, clamped)
    else:
        one = in_chain(real_wave(z1, v1.real, t1, dt1), l)
        two = in_chain(real_wave(z2, v2.real, t2, dt2), l)
        gS = row.of_chain[2] * S
        gap = one[2] - two[2]
        unit = 1.0 / (gS * EI * gap * gap)
        q = scale_plane(across_waves(one, two, gS, EI, plane), unit)
        r = scale_plane(across_waves(one, two, gS, EI, clamped), unit)
    # r at the outer end is, up to signs, the plane carried inwards (symmetry)
    number = _match_parity(number, r[1], -1)
    number = _match_parity(number, -r[0], -1) + outside
    if free == 2:
        number = _match_parity(number, -r[0] * plane[3] - r[3] * plane[0], 1)
    if free:
        number = _match_parity(number, q[0], 1)
    return number, q


@compiled
def chain_counts(omega: Any, rows: Any, ends: Any) -> Any:
    """Return `chain_count` at every omega (1-D)."""
    found = np.empty(omega.size, np.int64)
    for i in range(omega.size):
        found[i] = chain_count(omega[i], rows, ends)
    return found


@compiled
def list_steps(first: Any, last: int, rows: Any, starts: Any, ends: Any, estimate: Any, found: Any) -> None:
    """Compute the smallest floats [rad/s] at which the count of each chain reaches the numbers first[j]..last.

    They are the last columns of found (chains, numbers), which begins as nan and stays so where a count does not reach
    `last`.  Chain j has rows[starts[j]:starts[j + 1]] and ends[j]; its estimate [rad/s] is doubled until it is above
    all of them, `DOUBLINGS` times at most, and each is bisected from there to neighbouring floats.
    """
    for j in range(len(ends)):
        own = rows[starts[j] : starts[j + 1]]
        above = estimate[j]
        doubled = 0
        while doubled < DOUBLINGS and chain_count(above, own, ends[j]) < last:
            above = 2.0 * above
            doubled = doubled + 1
        if doubled == DOUBLINGS:
            continue
        for number in range(first[j], last + 1):
            low = 0.0
            high = above
            while True:
                middle = 0.5 * (low + high)
                if not (low < middle and middle < high):
                    break
                if chain_count(middle, own, ends[j]) >= number:
                    high = middle
                else:
                    low = middle
            found[j, found.shape[1] - 1 - (last - number)] = high


@inlined
def half_waves(z: complex, t: complex, dt: complex) -> int:
    """Return the number of n with n pi < k, for a travelling wave e^{i k x}."""
    if z.real < 0.0:
        return max(0, math.ceil((abs(t.imag) + math.copysign(1.0, t.imag) * dt.imag) / math.pi) - 1)
    return 0


@inlined
def real_wave(z: float, v: float, t: complex, dt: complex) -> Wave:
    """Return a wave of `waves.across_waves` for real z, scaled where it decays."""
    if abs(z) < 1.0:
        c, s = even_functions(z)
        return c, s, z, v, 1.0
    if z > 0.0:
        e = math.exp(-t.real) * (1.0 - dt.real)
        return 0.5 * (1.0 + e * e), 0.5 * (1.0 - e * e) / (t.real + dt.real), z, v, e
    k = t.imag
    dk = dt.imag
    cosine = math.cos(k)
    sine = math.sin(k)
    return cosine - sine * dk, (sine + cosine * dk) / (k + dk), z, v, 1.0
