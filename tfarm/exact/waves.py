"""The exact solution in float64: closed form, compensated phases, fused and vectorised.

Everything is dimensionless in the arm's length L and bending stiffness EI: deflection W/L, rotation
Psi, moment M L/EI, shear force Q L^2/EI, torque u L/EI, while s stays in 1/s.  With S = s^2 and
d = 1 + C s, two waves e^{+-t_j x}, z_j = t_j^2, solve the dispersion relation

    (d z - a S)(z - b S) + g S = 0      a = rho L^2/E   b = rho L^2/(kappa G)   g = rho A L^4/(E I)

which is (A.2) of the paper (with its inner square root) without fractions.  Written with
v_j = z_j - b S and the even functions c_j = cosh t_j, S_j = sinh t_j / t_j nothing is singular at the shear
cut-off (t_2 = 0).  The functions here do the algebra for any number type that has + - * /:
floats, complex arrays, dual numbers, and balls use the same lines.

Three things keep the last digits, each measured against 50-digit balls:

* every hyperbolic function is scaled by e^{-t_j} (Re t_j >= 0), so nothing overflows or cancels;
* t_j is a phase of hundreds of radians at high frequency, and half a unit in its last place would be
  1e-13 of the answer; so z_j is corrected by one Newton step whose residual is formed in
  double-double arithmetic (products split exactly by fused multiply-add);
* as s -> 0 the four waves become parallel; there the transition functions of `from_transition`
  are summed as series in z_1 + z_2 and z_1 z_2.

Where z_1 = z_2 (never on the imaginary axis at C = 0) both forms lose digits: such points are flagged,
and `tfarm.exact.balls` gives them their value.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .compiled import compiled, fma, inlined

# Number type of the algebra below: float, complex, ndarray, Dual, acb.
Number = Any

BLOCK = 128  # points a block: its twenty work arrays stay in the first- and second-level cache
SERIES_RADIUS = 6.0  # |z_j| below which the series are used; 14 terms leave 6^14/31! = 1e-23
SERIES_TERMS = 14
INVERSE_FACTORIAL = np.array([1.0 / math.factorial(n) for n in range(2 * SERIES_TERMS + 2)])
PARALLEL = 0.15  # |z_1 - z_2| below this share of |z_1| + |z_2|: flagged
POLE = 1e-11  # torque below this share of its own terms: flagged, it may be a pole


# ---------------------------------------------------------------- the algebra, for any number type


@inlined
def from_waves(
    c1: Number, s1: Number, z1: Number, v1: Number, e1: Number,
    c2: Number, s2: Number, z2: Number, v2: Number, e2: Number,
    gS: Number, d: Number, tip_mass: Number, shear: Number, tip_inertia: Number, moment: Number,
) -> tuple[Number, Number, Number, Number]:
    """(theta, M0, Q0, W1) of the free response, up to one common factor, from the two waves.

    The tip obeys  tip_mass W + shear Q = 0  and  tip_inertia Psi + moment M = 0,  that is (m s^2, 1) for
    a finite inertia and (1, 0) for an infinite one.  c, s are scaled by e = e^{-t}.  In the notation of the
    paper's appendix these are its 3x3 minors: theta vanishes at the hub-locked frequencies and
    M0 at those of a pinned root.  No product of a wave with itself is left: it would cancel.
    """  # fmt: skip
    So1, So2 = tip_mass * z1 * s1 + shear * gS * c1, tip_mass * z2 * s2 + shear * gS * c2
    Se1, Se2 = tip_mass * c1 + shear * gS * s1, tip_mass * c2 + shear * gS * s2
    r1, r2 = tip_inertia * c1 + moment * d * z1 * s1, tip_inertia * c2 + moment * d * z2 * s2
    Me1, Me2 = v1 * (tip_inertia * s1 + moment * d * c1), v2 * (tip_inertia * s2 + moment * d * c2)
    bare = (tip_mass * tip_inertia - shear * moment * d * gS) * (e1 * e2)
    N1 = So2 * Me1 - v2 * r2 * Se1 + v2 * bare
    N2 = So1 * Me2 - v1 * r1 * Se2 + v1 * bare
    theta = N1 * v1 + N2 * v2
    M0 = d * (z1 - z2) * (So1 * r2 * v2 - So2 * r1 * v1)
    Q0 = gS * (N1 + N2)
    W1 = shear * gS * (z1 - z2) * (r1 * e2 - r2 * e1)
    return theta, M0, Q0, W1


@inlined
def from_transition(
    F0: Number, F1: Number, F2: Number, F3: Number, F2_less_1: Number, S: Number, over_d: Number,
    a: float, b: float, g: float, sigma: float,
    tip_mass: Number, shear: Number, tip_inertia: Number, moment: Number,
) -> tuple[Number, Number, Number, Number, Number]:
    """(theta, M0, Q0, W1, W1 - theta) of the free response, up to one factor, without wave numbers.

    F0 = (sinh t1 / t1 - sinh t2 / t2)/(z1 - z2) and its derivatives F1, F2, F3 along x at the tip are entire in s^2 (C = 0)
    and give the state-transition matrix of (W, Psi, M, Q); the tip's two conditions are solved by Cramer's rule; over_d = 1/(1 + C s).  Best for small |t|; for large ones products of a wave with itself cancel.
    """  # fmt: skip
    bS, gS = b * S, g * S
    bend = F2 - bS * F0
    turn = F3 - bS * F1
    lift = sigma * F2 - (1 + sigma * a * S) * over_d * F0
    row1_theta = shear * gS * F1 + tip_mass * F2
    row1_M0 = (shear * gS * F0 + tip_mass * F1) * over_d
    row1_Q0 = shear * (F3 - a * S * over_d * F1) + tip_mass * lift
    row2_theta = moment * S * (a * bend - g * F0) + tip_inertia * turn
    row2_M0 = moment * turn + tip_inertia * over_d * bend
    row2_Q0 = -moment * F2 - tip_inertia * over_d * F1
    theta = row1_Q0 * row2_M0 - row1_M0 * row2_Q0
    M0 = row1_theta * row2_Q0 - row1_Q0 * row2_theta
    Q0 = row1_M0 * row2_theta - row1_theta * row2_M0
    rest = M0 * F1 * over_d + Q0 * lift
    W1 = shear * (moment * F2 + tip_inertia * over_d * F1)  # not theta F2 + rest: that cancels for a heavy payload
    return theta, M0, Q0, W1, theta * F2_less_1 + rest


@inlined
def fields_from_root(
    x: Number, F0: Number, F1: Number, F2: Number, F3: Number, F2_less_x: Number, F3_less_1: Number,
    S: Number, over_d: Number, a: float, b: float, g: float, sigma: float, theta: Number, M0: Number, Q0: Number,
) -> tuple[Number, Number, Number, Number]:
    """Deflection W - x theta, rotation Psi - theta, moment M and shear force Q at x from the root's values.

    F0..F3 are the transition functions at x.  For |t| x small; further out the waves separate better.
    """  # fmt: skip
    bS, gS, aS = b * S, g * S, a * S
    Y = theta * F2_less_x + over_d * (M0 * F1 - Q0 * F0) + Q0 * sigma * (F2 - aS * over_d * F0)
    Phi = theta * (F3_less_1 - bS * F1) + over_d * (M0 * (F2 - bS * F0) - Q0 * F1)
    M = theta * (aS * (F2 - bS * F0) - gS * F0) + M0 * (F3 - bS * F1) - Q0 * F2
    Q = gS * (theta * F1 + over_d * M0 * F0) + Q0 * (F3 - aS * over_d * F1)
    return Y, Phi, M, Q


@inlined
def _series(shift: int, z_sum: Number, z_product: Number) -> tuple[Number, Number]:
    """sum over k of h_k/(2k + shift)!, whole and less its first term.

    h_k, the complete homogeneous polynomial of z1 and z2, obeys h_k = (z1 + z2) h_{k-1} - z1 z2 h_{k-2}: Clenshaw.
    """
    now = rest = after = 0.0 * z_sum
    for n in range(SERIES_TERMS):
        rest = z_sum * now - z_product * after
        now, after = INVERSE_FACTORIAL[2 * (SERIES_TERMS - 1 - n) + shift] + rest, now
    return now, rest


@inlined
def transition_series(z_sum: Number, z_product: Number) -> tuple[Number, Number, Number, Number, Number, Number]:
    """F0, F1, F2, F3 at the tip, F2 - 1 and F3 - 1 as series, exact to 1e-17 for |z| < 6."""
    F0, _ = _series(3, z_sum, z_product)
    F1, _ = _series(2, z_sum, z_product)
    F2, F2_less_1 = _series(1, z_sum, z_product)
    F3, F3_less_1 = _series(0, z_sum, z_product)
    return F0, F1, F2, F3, F2_less_1, F3_less_1


# ---------------------------------------------------------------- wave numbers with a compensated phase


@inlined
def _two_sum(a: complex, b: complex) -> tuple[complex, complex]:
    """a + b = total + error exactly (Knuth 1969), real and imaginary part each."""
    total = a + b
    shadow = total - a
    return total, (a - (total - shadow)) + (b - shadow)


@inlined
def _two_product(a: complex, b: complex) -> tuple[complex, complex]:
    """a b = product + error, error to about 2^-100 of |a b|."""
    rr, ii, ri, ir = a.real * b.real, a.imag * b.imag, a.real * b.imag, a.imag * b.real
    product, rest = _two_sum(complex(rr, ri), complex(-ii, ir))
    split = complex(
        fma(a.real, b.real, -rr) - fma(a.imag, b.imag, -ii),
        fma(a.real, b.imag, -ri) + fma(a.imag, b.real, -ir),
    )
    return product, rest + split


@inlined
def _scaled(high: float, low: float, x: complex, x_low: complex) -> tuple[complex, complex]:
    """(high + low) (x + x_low) for a real double-double and a complex one."""
    product = high * x
    split = complex(fma(high, x.real, -product.real), fma(high, x.imag, -product.imag))
    return product, split + (high * x_low + low * x)


@inlined
def _square_root(z: complex) -> complex:
    """Principal square root without branches, so that loops over it vectorise."""
    size = math.sqrt(z.real * z.real + z.imag * z.imag)
    large = math.sqrt(0.5 * (size + abs(z.real)))
    small = 0.5 * abs(z.imag) / (large + 1e-300)
    real, imag = (large, small) if z.real >= 0.0 else (small, large)
    return complex(real, math.copysign(imag, z.imag))


@inlined
def _reciprocal(z: complex) -> complex:
    """1/z; the numbers here stay within 1e+-140, so the plain formula neither over- nor underflows."""
    scale = 1.0 / (z.real * z.real + z.imag * z.imag)
    return complex(z.real * scale, -z.imag * scale)


@inlined
def dispersion(s: complex, k: Any) -> tuple[complex, ...]:
    """S, d, d_low and for both waves z, v = z - b S, t with its correction dt:  e^{-t_j} = e^{-t} (1 - dt).

    `k` is the vector of `Coefficients.kernel`: a, b, g as double-doubles, then sigma and C.
    """
    S, S_low = _two_product(s, s)
    d, d_low = _two_sum(complex(1.0, 0.0), k[7] * s)
    d_low = d_low + complex(fma(k[7], s.real, -(k[7] * s.real)), fma(k[7], s.imag, -(k[7] * s.imag)))
    aS, aS_low = _scaled(k[0], k[1], S, S_low)
    bS, bS_low = _scaled(k[2], k[3], S, S_low)
    gS, gS_low = _scaled(k[4], k[5], S, S_low)

    over_d = _reciprocal(d)
    bend, couple = aS * over_d, gS * over_d
    mean = 0.5 * (bend + bS)
    spread = _square_root(0.25 * (bend - bS) * (bend - bS) - couple)
    spread = spread * (1.0 if mean.real * spread.real + mean.imag * spread.imag >= 0.0 else -1.0)
    z1 = mean + spread  # the larger root; the other from the product, without cancellation
    z2 = (bend * bS + couple) * _reciprocal(z1)

    z1, v1, t1, dt1 = _corrected(z1, d, d_low, aS, aS_low, bS, bS_low, gS, gS_low)
    z2, v2, t2, dt2 = _corrected(z2, d, d_low, aS, aS_low, bS, bS_low, gS, gS_low)
    return S, d, bS, gS, z1, v1, t1, dt1, z2, v2, t2, dt2


@inlined
def _corrected(
    z: complex, d: complex, d_low: complex, aS: complex, aS_low: complex,
    bS: complex, bS_low: complex, gS: complex, gS_low: complex,
) -> tuple[complex, complex, complex, complex]:
    """One Newton step on (d z - a S)(z - b S) + g S with its residual in double-double."""  # fmt: skip
    dz, dz_low = _two_product(d, z)
    dz_low = dz_low + d_low * z
    u, u_low = _two_sum(dz, -aS)
    u_low = u_low + (dz_low - aS_low)
    v, v_low = _two_sum(z, -bS)
    v_low = v_low - bS_low
    uv, uv_low = _two_product(u, v)
    residual = (uv + gS) + (uv_low + (u * v_low + u_low * v) + gS_low)
    step = -residual * _reciprocal(d * v + u)
    t = _square_root(z)
    square, square_low = _two_product(t, t)
    remainder = ((z - square) - square_low) + step
    return z + step, v + (v_low + step), t, 0.5 * remainder * _reciprocal(t)


# ---------------------------------------------------------------- the fused kernel


@inlined
def _wave_functions(z: complex, t: complex, dt: complex) -> tuple[complex, complex, complex]:
    """c = cosh t e^{-t}, S = sinh t / t e^{-t} and e = e^{-t}, with t + dt for t."""
    decay = math.exp(-t.real)
    e = decay * complex(math.cos(t.imag), -math.sin(t.imag))
    e = e - e * dt
    if abs(z.real) + abs(z.imag) < 1.0:  # 1 - e^2 would cancel
        c, s = even_functions(z)
        return e * c, e * s, e
    half_square = 0.5 * (e * e)
    return 0.5 + half_square, (0.5 - half_square) * _reciprocal(t + dt), e


@inlined
def even_functions(z: Number) -> tuple[Number, Number]:
    """cosh sqrt z and sinh sqrt z / sqrt z by Horner's rule; ten terms are exact to 1e-19 for |z| < 1."""
    c = s = 1.0 + 0.0 * z
    for k in range(10, 0, -1):
        c = 1.0 + z * c / ((2 * k - 1) * (2 * k))
        s = 1.0 + z * s / ((2 * k) * (2 * k + 1))
    return c, s


@inlined
def _end(k: Any, i: int, S: Number) -> Number:
    """rest + inertia s^2 of the end condition whose numbers start at k[i]."""
    return k[i] + k[i + 1] * S


# Where the arrays of a block start in its flat buffers: at fixed distances, and never read and written in the same
# loop, so that the compiler sees that nothing overlaps, and vectorises.
_S, _D, _GS, _Z1, _V1, _T1, _DT1, _Z2, _V2, _T2, _DT2 = (BLOCK * j for j in range(11))
_C1, _S1, _E1, _C2, _S2, _E2 = (BLOCK * j for j in range(6))


@compiled
def evaluate(s: Any, k: Any, outputs: Any, values: Any, suspects: Any) -> None:
    """Fill values[o, i] with output o at s[i]; mark suspects[i] where digits are missing.

    outputs[o] = (which of theta, M0, Q0, W1, Y1; power of s; 1 to divide by 1 + C s; factor).
    """
    points, chosen = np.empty(BLOCK, np.complex128), np.empty(BLOCK, np.int64)
    numbers, functions = np.empty(11 * BLOCK, np.complex128), np.empty(6 * BLOCK, np.complex128)
    states = np.empty(6 * BLOCK, np.complex128)
    for first in range(0, s.size, BLOCK):
        for low in (True, False):
            n = 0
            for i in range(first, min(first + BLOCK, s.size)):
                if _is_low(s[i], k) == low:
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
                start, power, gauge = BLOCK * int(outputs[o, 0]), outputs[o, 1], outputs[o, 2]
                for i in range(n):
                    value = outputs[o, 3] * states[start + i]
                    value = value * points[i] if power == 1 else value
                    value = value * (points[i] * points[i]) if power == 2 else value
                    value = value * _reciprocal(1.0 + k[7] * points[i]) if gauge == 1 else value
                    values[o, chosen[i]] = value
            for i in range(n):
                left = states[5 * BLOCK + i]
                suspects[chosen[i]] = left.real < POLE * left.imag or not low and _parallel(numbers, i)


@inlined
def _is_low(s: complex, k: Any) -> bool:
    """Whether both |z| are surely below SERIES_RADIUS."""
    S, over_d = s * s, _reciprocal(1.0 + k[7] * s)
    half_sum = 0.5 * _size(S * (k[2] + k[0] * over_d))
    product = _size(S * (k[0] * k[2] * S + k[4]) * over_d)
    return 1.4 * (half_sum + math.sqrt(half_sum * half_sum + 2.0 * product)) < SERIES_RADIUS


@inlined
def _parallel(numbers: Any, i: int) -> bool:
    size = _size(numbers[_Z1 + i]) + _size(numbers[_Z2 + i])
    return _size(numbers[_Z1 + i] - numbers[_Z2 + i]) < PARALLEL * size


@inlined
def _size(z: complex) -> float:
    return max(abs(z.real), abs(z.imag))


@compiled
def _wave_numbers(points: Any, k: Any, numbers: Any) -> None:
    """`dispersion` at the first n points."""
    for i in range(BLOCK):
        S, d, _, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(points[i], k)
        numbers[_S + i], numbers[_D + i], numbers[_GS + i] = S, d, gS
        numbers[_Z1 + i], numbers[_V1 + i], numbers[_T1 + i], numbers[_DT1 + i] = z1, v1, t1, dt1
        numbers[_Z2 + i], numbers[_V2 + i], numbers[_T2 + i], numbers[_DT2 + i] = z2, v2, t2, dt2


@compiled
def _all_wave_functions(numbers: Any, functions: Any) -> None:
    """The two complex exponentials a point: the only loop that calls a library."""
    for i in range(BLOCK):
        c1, s1, e1 = _wave_functions(numbers[_Z1 + i], numbers[_T1 + i], numbers[_DT1 + i])
        c2, s2, e2 = _wave_functions(numbers[_Z2 + i], numbers[_T2 + i], numbers[_DT2 + i])
        functions[_C1 + i], functions[_S1 + i], functions[_E1 + i] = c1, s1, e1
        functions[_C2 + i], functions[_S2 + i], functions[_E2 + i] = c2, s2, e2


@compiled
def _wave_states(numbers: Any, functions: Any, k: Any, states: Any) -> None:
    """theta, M0, Q0, W1 and Y1 for a unit input, by the two waves."""
    for i in range(BLOCK):
        S = numbers[_S + i]
        theta, M0, Q0, W1 = from_waves(
            functions[_C1 + i], functions[_S1 + i], numbers[_Z1 + i], numbers[_V1 + i], functions[_E1 + i],
            functions[_C2 + i], functions[_S2 + i], numbers[_Z2 + i], numbers[_V2 + i], functions[_E2 + i],
            numbers[_GS + i], numbers[_D + i], _end(k, 8, S), k[10], _end(k, 11, S), k[13],
        )  # fmt: skip
        _store(i, states, k, S, theta, M0, Q0, W1, W1 - theta)


@compiled
def _series_states(points: Any, k: Any, states: Any) -> None:
    """The same by the series of the transition functions, at low frequency."""
    for i in range(BLOCK):
        s = points[i]
        S, d = s * s, 1.0 + k[7] * s
        over_d = _reciprocal(d)
        z_sum = S * (k[2] + k[0] * over_d)
        z_product = S * (k[0] * k[2] * S + k[4]) * over_d
        F0, F1, F2, F3, F2_less_1, _ = transition_series(z_sum, z_product)
        theta, M0, Q0, W1, Y1 = from_transition(
            F0, F1, F2, F3, F2_less_1, S, over_d, k[0], k[2], k[4], k[6],
            _end(k, 8, S), k[10], _end(k, 11, S), k[13],
        )  # fmt: skip
        _store(i, states, k, S, theta, M0, Q0, W1, Y1)


@inlined
def _store(
    i: int, states: Any, k: Any, S: complex, theta: complex, M0: complex, Q0: complex, W1: complex, Y1: complex
) -> None:
    """Divide the free response by its torque (its hub angle where the hub is locked), and say what is left of that."""  # fmt: skip
    turned, held = _end(k, 14, S) * theta, k[16] * M0
    u = turned - held
    scale = k[17] * _reciprocal(u)
    states[i], states[BLOCK + i], states[2 * BLOCK + i] = scale * theta, scale * M0, scale * Q0
    states[3 * BLOCK + i], states[4 * BLOCK + i] = scale * W1, scale * Y1
    states[5 * BLOCK + i] = complex(_size(u), _size(turned) + _size(held) + _size(M0))


# ---------------------------------------------------------------- what the fields along the arm need


@compiled
def separated(s: Any, k: Any, numbers: Any, functions: Any) -> None:
    """Columns of numbers[:, i] and functions[:, i] at s[i]: S, d, g S, z, v, t, dt of both waves; c, S, e of both."""
    for i in range(s.size):
        S, d, _, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(s[i], k)
        numbers[0, i], numbers[1, i], numbers[2, i] = S, d, gS
        numbers[3, i], numbers[4, i], numbers[5, i], numbers[6, i] = z1, v1, t1, dt1
        numbers[7, i], numbers[8, i], numbers[9, i], numbers[10, i] = z2, v2, t2, dt2
        functions[0, i], functions[1, i], functions[2, i] = _wave_functions(z1, t1, dt1)
        functions[3, i], functions[4, i], functions[5, i] = _wave_functions(z2, t2, dt2)
