"""The waves of a uniform segment: their numbers, and the functions that carry a state from one end of it to the other.

Everything is dimensionless in the segment's length l and bending stiffness EI: deflection W/l, rotation Psi, moment
M l/EI, shear force Q l^2/EI, while s stays in 1/s.  With S = s^2 and d = 1 + C s, two pairs of waves e^{+-t_j x},
z_j = t_j^2, solve the dispersion relation

    (d z - a S)(z - b S) + g S = 0      a = rho l^2/E   b = rho l^2/(kappa G)   g = rho A l^4/(E I)

which is (A.2) of the paper (with its inner square root) without fractions.  Written with v_j = z_j - b S and the even
functions c_j = cosh t_j, S_j = sinh t_j / t_j nothing is singular at the shear cut-off (t_2 = 0).

Three things keep the last digits, each measured against balls:

* every hyperbolic function is scaled by e^{-t_j} (Re t_j >= 0), so nothing overflows or cancels;
* t_j = sqrt(z_j) is a phase of hundreds of radians at high frequency, and half a unit in its last place would be 1e-13
  of the answer; above the cut-off two such errors do not even act together.  So each root of the dispersion relation is
  corrected by one Newton step whose residual is formed in double-double arithmetic: products split exactly by fused
  multiply-add, sums by Knuth's two-sum.  No branch, so that loops over it vectorise;
* as s -> 0 the four waves become parallel; there the transition functions F0 = (S_1 - S_2)/(z_1 - z_2) and its
  derivatives F1, F2, F3 along x, at x = l, are summed as series in z_1 + z_2 and z_1 z_2.

Where z_1 = z_2 (never on the imaginary axis at C = 0) both forms lose digits: such points are flagged (`PARALLEL`).
Floats, complex arrays, power series (`Jet`) and balls run through the same lines; numba melts them into its loops.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .compiled import compiled, fma, inlined

Number = Any  # float, complex, ndarray, Jet or ball

# Where a segment's row of the kernel has a, b, g as two doubles each, sigma and C (`layout.kernel_row`).
A, A_LOW, B, B_LOW, G, G_LOW, SIGMA, DAMPING = range(8)

SERIES_RADIUS = 6.0  # |z_j| below which the series are used
SERIES_TERMS = 14  # the first term left out is below 15 * 6^14/28! = 4e-18
INVERSE_FACTORIAL = np.array([1.0 / math.factorial(n) for n in range(2 * SERIES_TERMS + 2)])
PARALLEL = 0.15  # |z_1 - z_2| below this share of |z_1| + |z_2|: flagged


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
def quotient(a: complex, b: complex) -> complex:
    """a/b for numbers of any size (Smith 1962); where b = 0 it is no number, which numba's own would raise for."""
    if abs(b.real) >= abs(b.imag):
        ratio = b.imag / b.real
        size = b.real + ratio * b.imag
        return complex((a.real + ratio * a.imag) / size, (a.imag - ratio * a.real) / size)
    ratio = b.real / b.imag
    size = b.imag + ratio * b.real
    return complex((ratio * a.real + a.imag) / size, (ratio * a.imag - a.real) / size)


@inlined
def reciprocal(z: complex) -> complex:
    """1/z; the numbers here stay within 1e+-140, so the plain formula neither over- nor underflows."""
    scale = 1.0 / (z.real * z.real + z.imag * z.imag)
    return complex(z.real * scale, -z.imag * scale)


@inlined
def magnitude(z: complex) -> float:
    return max(abs(z.real), abs(z.imag))


@inlined
def dispersion(s: complex, k: Any) -> tuple[complex, ...]:
    """S, d, d_low and for both waves z, v = z - b S, t with its correction dt:  e^{-t_j} = e^{-t} (1 - dt).

    `k` is the row of a segment: a, b, g as double-doubles, then sigma and C.
    """
    S, S_low = _two_product(s, s)
    C = k[DAMPING]
    d, d_low = _two_sum(complex(1.0, 0.0), C * s)
    d_low = d_low + complex(fma(C, s.real, -(C * s.real)), fma(C, s.imag, -(C * s.imag)))
    aS, aS_low = _scaled(k[A], k[A_LOW], S, S_low)
    bS, bS_low = _scaled(k[B], k[B_LOW], S, S_low)
    gS, gS_low = _scaled(k[G], k[G_LOW], S, S_low)

    over_d = reciprocal(d)
    bend, couple = aS * over_d, gS * over_d
    mean = 0.5 * (bend + bS)
    spread = _square_root(0.25 * (bend - bS) * (bend - bS) - couple)
    spread = spread * (1.0 if mean.real * spread.real + mean.imag * spread.imag >= 0.0 else -1.0)
    z1 = mean + spread  # the larger root; the other from the product, without cancellation
    z2 = (bend * bS + couple) * reciprocal(z1)

    z1, v1, t1, dt1 = _corrected(z1, d, d_low, aS, aS_low, bS, bS_low, gS, gS_low)
    z2, v2, t2, dt2 = _corrected(z2, d, d_low, aS, aS_low, bS, bS_low, gS, gS_low)
    return S, d, bS, gS, z1, v1, t1, dt1, z2, v2, t2, dt2


@inlined
def _corrected(
    z: complex,
    d: complex,
    d_low: complex,
    aS: complex,
    aS_low: complex,
    bS: complex,
    bS_low: complex,
    gS: complex,
    gS_low: complex,
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
    step = -residual * reciprocal(d * v + u)
    t = _square_root(z)
    square, square_low = _two_product(t, t)
    remainder = ((z - square) - square_low) + step
    smooth = 0.5 / (t.real * t.real + t.imag * t.imag + 1e-20)  # t = 0 at the cut-off, where no dt is needed
    return z + step, v + (v_low + step), t, remainder * complex(t.real * smooth, -t.imag * smooth)


@compiled
def fill_wave_numbers(s: Any, k: Any, found: Any) -> None:
    """z, v and t of both waves at s (1-D), the larger z first: rows of `found` (6, n)."""
    for i in range(s.size):
        _, _, _, _, z1, v1, t1, dt1, z2, v2, t2, dt2 = dispersion(s[i], k)
        found[0, i], found[1, i], found[2, i] = z1, v1, t1 + dt1
        found[3, i], found[4, i], found[5, i] = z2, v2, t2 + dt2


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
def is_low(s: complex, k: Any) -> bool:
    """Whether both |z| are surely below SERIES_RADIUS."""
    S, over_d = s * s, reciprocal(1.0 + k[DAMPING] * s)
    half_sum = 0.5 * magnitude(S * (k[B] + k[A] * over_d))
    product = magnitude(S * (k[A] * k[B] * S + k[G]) * over_d)
    return 1.4 * (half_sum + math.sqrt(half_sum * half_sum + 2.0 * product)) < SERIES_RADIUS


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


@inlined
def even_functions(z: Number) -> tuple[Number, Number]:
    """cosh sqrt z and sinh sqrt z / sqrt z by Horner's rule; ten terms are exact to 1e-19 for |z| < 1."""
    c = s = 1.0 + 0.0 * z
    for k in range(10, 0, -1):
        c = 1.0 + z * c / ((2 * k - 1) * (2 * k))
        s = 1.0 + z * s / ((2 * k) * (2 * k + 1))
    return c, s


@inlined
def tip_conditions(ends: Any, S: Number) -> tuple[Number, Number, Number, Number]:
    """tip_mass, shear, tip_inertia and moment of the tip's conditions at S = s^2, of the numbers of its ends.

    Rest, inertia and force of the mass come first and those of the inertia next (see `elements.EndCondition`).
    """
    return ends[0] + ends[1] * S, ends[2], ends[3] + ends[4] * S, ends[5]


@inlined
def impedance(S: float, k: Any) -> float:
    """Size of M0/theta for a free tip, dimensionless: of its inertia when slow, of one wave number when fast."""
    inertia = k[G] * S
    return min(inertia, math.sqrt(math.sqrt(inertia)) + math.sqrt(S * (k[A] + k[B])))
