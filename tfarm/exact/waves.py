"""The exact solution in float64: the closed form, scaled, fused and vectorised.

Three things keep the last digits, each measured against balls:

* every hyperbolic function is scaled by e^{-t_j} (Re t_j >= 0), so nothing overflows or cancels;
* the phases t_j are compensated (`dispersion`);
* as s -> 0 the four waves become parallel; there the transition functions of `from_transition` are summed
  as series in z_1 + z_2 and z_1 z_2.

Where z_1 = z_2 (never on the imaginary axis at C = 0) both forms lose digits, and at a pole there are none: such
points are flagged, and `tfarm.exact.values` gives them their value, or their name.

Points are worked through in blocks, each in loops that hold nothing but arithmetic (these vectorise) and one
that calls the two complex exponentials a point, the floor for speed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .closed_form import SERIES_RADIUS, Number, even_functions, from_transition, from_waves, transition_series
from .compiled import compiled, inlined
from .dispersion import dispersion, reciprocal
from .vector import (
    DAMPING,
    HUB_FORCE,
    HUB_REST,
    MASS_FORCE,
    SIGMA,
    TIP_INERTIA,
    TIP_MASS,
    TORQUE_DIVISOR,
    TURN_FORCE,
    A,
    B,
    G,
)

WAVE_BLOCK = 128  # points a block: its twenty work arrays stay in the first- and second-level cache
PARALLEL = 0.15  # |z_1 - z_2| below this share of |z_1| + |z_2|: flagged
LIFT = 2.0**100  # W1 is held this much larger: it would underflow where s^2 W1 does not
POLE = 1e-11  # torque below this share of its own terms: flagged, it may be a pole


@inlined
def wave_functions(z: complex, t: complex, dt: complex) -> tuple[complex, complex, complex]:
    """c = cosh t e^{-t}, S = sinh t / t e^{-t} and e = e^{-t}, with t + dt for t."""
    decay = math.exp(-t.real)
    e = decay * complex(math.cos(t.imag), -math.sin(t.imag))
    if abs(z.real) + abs(z.imag) < 1.0:  # 1 - e^2 would cancel; here e is a common factor, whatever its error
        c, s = even_functions(z)
        return e * c, e * s, e
    e = e - e * dt
    half_square = 0.5 * (e * e)
    return 0.5 + half_square, (0.5 - half_square) * reciprocal(t + dt), e


@inlined
def _end(k: Any, i: int, S: Number) -> Number:
    """rest + inertia s^2 of the end condition whose numbers start at k[i]."""
    return k[i] + k[i + 1] * S


# Where the arrays of a block start in its flat buffers: at fixed distances, and never read and written in the same
# loop, so that the compiler sees that nothing overlaps, and vectorises.
_S, _D, _GS, _Z1, _V1, _T1, _DT1, _Z2, _V2, _T2, _DT2 = (WAVE_BLOCK * j for j in range(11))
_C1, _S1, _E1, _C2, _S2, _E2 = (WAVE_BLOCK * j for j in range(6))


@compiled
def evaluate(s: Any, k: Any, outputs: Any, values: Any, suspects: Any) -> None:
    """Fill values[o, i] with output o at s[i]; mark suspects[i] where digits are missing.

    outputs[o] = (which of theta, M0, Q0, W1, Y1; power of s; 1 to divide by 1 + C s; factor).
    """
    points, chosen = np.empty(WAVE_BLOCK, np.complex128), np.empty(WAVE_BLOCK, np.int64)
    numbers, functions = np.empty(11 * WAVE_BLOCK, np.complex128), np.empty(6 * WAVE_BLOCK, np.complex128)
    states = np.empty(6 * WAVE_BLOCK, np.complex128)
    for first in range(0, s.size, WAVE_BLOCK):
        for low in (True, False):
            n = 0
            for i in range(first, min(first + WAVE_BLOCK, s.size)):
                if is_low(s[i], k) == low:
                    chosen[n], points[n] = i, s[i]
                    n += 1
            if n == 0:
                continue
            points[n:] = points[0]
            if low:
                _series_states(points, k, states)
            else:
                _wave_numbers(points, k, numbers)
                _all_wave_functions(numbers, functions)
                _wave_states(numbers, functions, k, states)
            for o in range(len(outputs)):
                start, power, gauge = WAVE_BLOCK * int(outputs[o, 0]), outputs[o, 1], outputs[o, 2]
                factor = outputs[o, 3] / LIFT if outputs[o, 0] == 3 else outputs[o, 3]
                for i in range(n):
                    value = states[start + i]
                    value = value * points[i] if power == 1 else value
                    value = value * (points[i] * points[i]) if power == 2 else value
                    value = value * reciprocal(1.0 + k[DAMPING] * points[i]) if gauge == 1 else value
                    values[o, chosen[i]] = factor * value
                for _ in range(int(power) if power > 2 else 0):
                    for i in range(n):
                        values[o, chosen[i]] *= points[i]
            for i in range(n):
                left = states[5 * WAVE_BLOCK + i]
                suspects[chosen[i]] = not left.real > POLE * left.imag or (not low and _parallel(numbers, i))


@inlined
def is_low(s: complex, k: Any) -> bool:
    """Whether both |z| are surely below SERIES_RADIUS."""
    S, over_d = s * s, reciprocal(1.0 + k[DAMPING] * s)
    half_sum = 0.5 * magnitude(S * (k[B] + k[A] * over_d))
    product = magnitude(S * (k[A] * k[B] * S + k[G]) * over_d)
    return 1.4 * (half_sum + math.sqrt(half_sum * half_sum + 2.0 * product)) < SERIES_RADIUS


@inlined
def _parallel(numbers: Any, i: int) -> bool:
    size = magnitude(numbers[_Z1 + i]) + magnitude(numbers[_Z2 + i])
    return magnitude(numbers[_Z1 + i] - numbers[_Z2 + i]) < PARALLEL * size


@inlined
def magnitude(z: complex) -> float:
    return max(abs(z.real), abs(z.imag))


@compiled
def _wave_numbers(points: Any, k: Any, numbers: Any) -> None:
    """`dispersion` at the first n points."""
    for i in range(WAVE_BLOCK):
        S, d, _, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(points[i], k)
        numbers[_S + i], numbers[_D + i], numbers[_GS + i] = S, d, gS
        numbers[_Z1 + i], numbers[_V1 + i], numbers[_T1 + i], numbers[_DT1 + i] = z1, v1, t1, dt1
        numbers[_Z2 + i], numbers[_V2 + i], numbers[_T2 + i], numbers[_DT2 + i] = z2, v2, t2, dt2


@compiled
def _all_wave_functions(numbers: Any, functions: Any) -> None:
    """The two complex exponentials a point: the only loop that calls a library."""
    for i in range(WAVE_BLOCK):
        c1, s1, e1 = wave_functions(numbers[_Z1 + i], numbers[_T1 + i], numbers[_DT1 + i])
        c2, s2, e2 = wave_functions(numbers[_Z2 + i], numbers[_T2 + i], numbers[_DT2 + i])
        functions[_C1 + i], functions[_S1 + i], functions[_E1 + i] = c1, s1, e1
        functions[_C2 + i], functions[_S2 + i], functions[_E2 + i] = c2, s2, e2


@compiled
def _wave_states(numbers: Any, functions: Any, k: Any, states: Any) -> None:
    """theta, M0, Q0, W1 and Y1 for a unit input, by the two waves."""
    for i in range(WAVE_BLOCK):
        S = numbers[_S + i]
        theta, M0, Q0, W1 = from_waves(
            functions[_C1 + i], functions[_S1 + i], numbers[_Z1 + i], numbers[_V1 + i], functions[_E1 + i],
            functions[_C2 + i], functions[_S2 + i], numbers[_Z2 + i], numbers[_V2 + i], functions[_E2 + i],
            numbers[_GS + i], numbers[_D + i],
            _end(k, TIP_MASS, S), k[MASS_FORCE], _end(k, TIP_INERTIA, S), k[TURN_FORCE],
        )  # fmt: skip
        _store(i, states, k, S, theta, M0, Q0, W1, W1 - theta)


@compiled
def _series_states(points: Any, k: Any, states: Any) -> None:
    """The same by the series of the transition functions, at low frequency."""
    for i in range(WAVE_BLOCK):
        s = points[i]
        S, d = s * s, 1.0 + k[DAMPING] * s
        over_d = reciprocal(d)
        z_sum = S * (k[B] + k[A] * over_d)
        z_product = S * (k[A] * k[B] * S + k[G]) * over_d
        F0, F1, F2, F3, F2_less_1, _ = transition_series(z_sum, z_product)
        theta, M0, Q0, W1, Y1 = from_transition(
            F0, F1, F2, F3, F2_less_1, S, over_d, k[A], k[B], k[G], k[SIGMA],
            _end(k, TIP_MASS, S), k[MASS_FORCE], _end(k, TIP_INERTIA, S), k[TURN_FORCE],
        )  # fmt: skip
        _store(i, states, k, S, theta, M0, Q0, W1, Y1)


@inlined
def _store(
    i: int, states: Any, k: Any, S: complex, theta: complex, M0: complex, Q0: complex, W1: complex, Y1: complex
) -> None:
    """Divide the free response by its torque (hub angle where the hub is locked), and say what is left of that."""
    turned, held = _end(k, HUB_REST, S) * theta, k[HUB_FORCE] * M0
    u = turned - held
    scale = k[TORQUE_DIVISOR] * reciprocal(u)
    states[i], states[WAVE_BLOCK + i], states[2 * WAVE_BLOCK + i] = scale * theta, scale * M0, scale * Q0
    states[3 * WAVE_BLOCK + i], states[4 * WAVE_BLOCK + i] = (LIFT * scale) * W1, scale * Y1
    waves = impedance(magnitude(S), k)  # with it, what u would be away from a pole
    crossed = k[HUB_REST] * magnitude(M0) / max(waves, 1.0) + k[HUB_FORCE] * magnitude(theta) * waves
    states[5 * WAVE_BLOCK + i] = complex(magnitude(u), magnitude(turned) + magnitude(held) + crossed)


@inlined
def impedance(S: float, k: Any) -> float:
    """Size of M0/theta for a free tip, dimensionless: of its inertia when slow, of one wave number when fast."""
    inertia = k[G] * S
    return min(inertia, math.sqrt(math.sqrt(inertia)) + math.sqrt(S * (k[A] + k[B])))


@compiled
def separated(s: Any, k: Any, numbers: Any, functions: Any) -> None:
    """Columns of numbers[:, i] and functions[:, i] at s[i]: S, d, g S, z, v, t, dt of both waves; c, S, e of both."""
    for i in range(s.size):
        S, d, _, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(s[i], k)
        numbers[0, i], numbers[1, i], numbers[2, i] = S, d, gS
        numbers[3, i], numbers[4, i], numbers[5, i], numbers[6, i] = z1, v1, t1, dt1
        numbers[7, i], numbers[8, i], numbers[9, i], numbers[10, i] = z2, v2, t2, dt2
        functions[0, i], functions[1, i], functions[2, i] = wave_functions(z1, t1, dt1)
        functions[3, i], functions[4, i], functions[5, i] = wave_functions(z2, t2, dt2)


@inlined
def free_ends(s: complex, k: Any) -> tuple[complex, complex, complex]:
    """theta and M0 of the free response at one s, times e^{-scale}, and scale: entire in s^2 at C = 0 (see `free`)."""
    S = s * s
    if is_low(s, k):
        over_d = reciprocal(1.0 + k[DAMPING] * s)
        z_sum, z_product = S * (k[B] + k[A] * over_d), S * (k[A] * k[B] * S + k[G]) * over_d
        F0, F1, F2, F3, F2_less_1, _ = transition_series(z_sum, z_product)
        theta, M0, _, _, _ = from_transition(
            F0, F1, F2, F3, F2_less_1, S, over_d, k[A], k[B], k[G], k[SIGMA],
            _end(k, TIP_MASS, S), k[MASS_FORCE], _end(k, TIP_INERTIA, S), k[TURN_FORCE],
        )  # fmt: skip
        return theta, M0, complex(0.0, 0.0)
    S, d, _, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(s, k)
    c1, s1, e1 = wave_functions(z1, t1, dt1)
    c2, s2, e2 = wave_functions(z2, t2, dt2)
    theta, M0, _, _ = from_waves(
        c1,
        s1,
        z1,
        v1,
        e1,
        c2,
        s2,
        z2,
        v2,
        e2,
        gS,
        d,
        _end(k, TIP_MASS, S),
        k[MASS_FORCE],
        _end(k, TIP_INERTIA, S),
        k[TURN_FORCE],
    )
    gap = z1 - z2
    unit = reciprocal(gS * d * gap * gap)
    return theta * unit, M0 * unit, t1 + dt1 + t2 + dt2
