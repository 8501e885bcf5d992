"""The exact solution on the imaginary axis without damping, where it is real.

There the drive, torque per free response, is the characteristic function D(i w), a real entire function of w^2.
Its sign is (-1)^N, N the number of natural frequencies below w: the fact that counting rests on.
Frequencies are the roots of the drive under the arm's own end conditions; the other conditions
here belong to the chain of neighbouring arms that `tfarm.spectrum.counting` climbs.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .closed_form import (
    SERIES_RADIUS,
    even_functions,
    from_transition,
    from_waves,
    hub_condition,
    tip_conditions,
    transition_series,
)
from .compiled import compiled, inlined
from .dispersion import dispersion
from .vector import DAMPING, SIGMA, A, B, G


def drives(
    omega: NDArray[np.float64], kernel: NDArray[np.float64], ends: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Scaled D(i omega) under each row of end conditions, and the count for both ends pinned.

    `ends` has a row of nine numbers an arm: (rest, inertia, force) of tip mass, tip inertia and hub.  Shapes:
    omega (n,), the drives (rows, n), the counts (n,).  Damping is left out.
    """
    values, pinned = np.empty((len(ends), omega.size)), np.empty(omega.size, np.int64)
    undamped = kernel.copy()
    undamped[DAMPING] = 0.0
    _drives(np.ascontiguousarray(omega, dtype=float), undamped, ends, values, pinned)
    return values, pinned


@compiled
def _drives(omega: Any, k: Any, ends: Any, values: Any, pinned: Any) -> None:
    for i in range(omega.size):
        S, _, _, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(complex(0.0, omega[i]), k)
        pinned[i] = half_waves(z1, t1, dt1) + half_waves(z2, t2, dt2)
        if z1.real < 0.0 and z2.real < 0.0:
            pinned[i] += 1  # above the cut-off: W = 0, Psi constant
        S, z1, z2 = S.real, z1.real, z2.real
        if max(abs(z1), abs(z2)) < SERIES_RADIUS:
            F0, F1, F2, F3, F2_less_1, _ = transition_series(z1 + z2, z1 * z2)
            for row in range(len(ends)):
                e = ends[row]
                tip = tip_conditions(e, S)
                theta, M0, _, _, _ = from_transition(
                    F0, F1, F2, F3, F2_less_1, S, 1.0, k[A], k[B], k[G], k[SIGMA], *tip
                )
                values[row, i] = hub_condition(e, S, theta, M0)
        else:
            c1, s1, e1 = real_functions(z1, t1, dt1)
            c2, s2, e2 = real_functions(z2, t2, dt2)
            for row in range(len(ends)):
                e = ends[row]
                tip = tip_conditions(e, S)
                theta, M0, _, _ = from_waves(c1, s1, z1, v1.real, e1, c2, s2, z2, v2.real, e2, gS.real, 1.0, *tip)
                values[row, i] = hub_condition(e, S, theta, M0) / (gS.real * (z1 - z2) ** 2)


@compiled
def bisect(number: Any, k: Any, ends: Any, steps: Any, low: Any, high: Any) -> None:
    """Move low[i] and high[i] to the neighbouring floats between which the count reaches number[i]; k is undamped.

    `ends` and `steps` are the arms that the count climbs by (`tfarm.spectrum.counting`).
    """
    omega, values, pinned = np.empty(1), np.empty((len(ends), 1)), np.empty(1, np.int64)
    for i in range(number.size):
        while True:
            omega[0] = 0.5 * (low[i] + high[i])
            if not (low[i] < omega[0] and omega[0] < high[i]):
                break
            _drives(omega, k, ends, values, pinned)
            count = pinned[0]
            for row in range(len(ends)):
                if (count % 2 == 1) != (values[row, 0] < 0.0):
                    count += steps[row]
            if count >= number[i]:
                high[i] = omega[0]
            else:
                low[i] = omega[0]


@inlined
def half_waves(z: complex, t: complex, dt: complex) -> int:
    """How many whole half waves fit strictly inside the length: n pi < k, for a travelling wave e^{i k x}."""
    return max(0, math.ceil((abs(t.imag) + math.copysign(1.0, t.imag) * dt.imag) / math.pi) - 1) if z.real < 0.0 else 0


@inlined
def real_functions(z: float, t: complex, dt: complex) -> tuple[float, float, float]:
    """c, S, e of `closed_form.from_waves` for real z: scaled where it decays, plain where it travels."""
    if abs(z) < 1.0:
        c, s = even_functions(z)
        return c, s, 1.0
    if z > 0.0:
        e = math.exp(-t.real) * (1.0 - dt.real)
        return 0.5 * (1.0 + e * e), 0.5 * (1.0 - e * e) / (t.real + dt.real), e
    k, dk = t.imag, dt.imag
    cosine, sine = math.cos(k), math.sin(k)
    return cosine - sine * dk, (sine + cosine * dk) / (k + dk), 1.0
