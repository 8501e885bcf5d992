"""The waves of a uniform segment: their numbers, and the functions that carry a state from one end to the other.

The waves are dimensionless in the segment's length l and bending stiffness EI: deflection W/l, rotation Psi, moment
M l/EI, shear force Q l^2/EI; s is in 1/s.  With S = s^2 and d = 1 + C s, two pairs of waves e^{+-t_j x}, z_j = t_j^2,
solve the dispersion relation

    (d z - a S)(z - b S) + g S = 0      a = rho l^2/E   b = rho l^2/(kappa G)   g = rho A l^4/(E I)

which is (A.2) of the paper (with its inner square root) without fractions.  Written with v_j = z_j - b S and the even
functions c_j = cosh t_j, S_j = sinh t_j / t_j nothing is singular at the shear cut-off (t_2 = 0).

Three measures keep the last digits, each verified against balls:

* every hyperbolic function is scaled by e^{-t_j} (Re t_j >= 0), so nothing overflows or cancels;
* t_j = sqrt(z_j) is a phase of hundreds of radians at high frequency, and half a unit in its last place would be a
  relative error of 1e-13.  So each root of the dispersion relation is corrected by one Newton step with a residual in
  double-double arithmetic: products split exactly by fused multiply-add, sums by Knuth's two-sum.  There is no branch,
  so that loops over it vectorise;
* as s -> 0 the four waves become parallel; there the transition functions F0 = (S_1 - S_2)/(z_1 - z_2) and its
  derivatives F1, F2, F3 along x, at x = l, are summed as series in z_1 + z_2 and z_1 z_2.

Where z_1 = z_2 (never on the imaginary axis at C = 0) both forms lose digits, and `pieces.cross` flags such points.

A chain of segments without cancelling waves.  The state along a chain is z = (W, Psi, M, Q).  The condition at the
outer end leaves a plane of states.  A product of 4x4 matrices would make its two vectors parallel, as both follow the
fastest growing wave.  So the plane is carried by its second compound (Ng and Reid 1979; Allen and Bridges 2002):
p_ij = z_i y_j - z_j y_i for two states z, y of it.  Every element is symplectic, also for complex s and with damping,
so p_WQ = -p_PsiM, and there are five numbers,

    p = (p_WPsi, p_WM, p_WQ, p_PsiQ, p_MQ).

A condition f z = 0 at the other end, a row f = (f_W, f_Psi, f_M, f_Q) carried outwards, determines one state of the
plane, z_j = sum over i of f_i p_ij: the free response.  For one segment with W = 0 at its root it is theta = p_WPsi,
M(0) = p_WM and Q(0) = p_WQ.  The formulas that carry a plane or a condition hold in any units, of which one is that of
the whole chain: its length, and the stiffness at the hub.

A uniform segment has two pairs of waves, W = cosh(t_j x) and sinh(t_j x)/t_j with z_j = t_j^2.  Their weights
(alpha_j, beta_j) become (c alpha - z s beta, c beta - s alpha) for an origin moved inwards by the length, with
determinant 1.  So alpha_1 beta_1 and alpha_2 beta_2 are constant.  The rest of p is a 2x2 matrix, multiplied by the
first wave from the left and the second from the right: there is no product of a wave with itself.

Numbers are floats, arrays, balls or series.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tfarm.exact.compiled import compiled, fma, inlined

# float, complex, ndarray, series or ball
Number = Any
# a number as a sum of two, the second below the last place of the first
Double = tuple[complex, complex]

# |z_j| below which the series are used
SERIES_RADIUS = 6.0
# the first term left out is below 15 * 6^14/28! = 4e-18
SERIES_TERMS = 14
INVERSE_FACTORIAL = np.array([1.0 / math.factorial(n) for n in range(2 * SERIES_TERMS + 2)])


@inlined
def _two_sum(a: complex, b: complex) -> Double:
    """Return total and error with a + b = total + error exactly (Knuth 1969), real and imaginary part each."""
    total = a + b
    shadow = total - a
    return total, (a - (total - shadow)) + (b - shadow)


@inlined
def _two_product(a: complex, b: complex) -> Double:
    """Return product and error of a b, the error to about 2^-100 of |a b|."""
    rr = a.real * b.real
    ii = a.imag * b.imag
    ri = a.real * b.imag
    ir = a.imag * b.real
    product, rest = _two_sum(complex(rr, ri), complex(-ii, ir))
    split = complex(
        fma(a.real, b.real, -rr) - fma(a.imag, b.imag, -ii),
        fma(a.real, b.imag, -ri) + fma(a.imag, b.real, -ir),
    )
    return product, rest + split


@inlined
def _times_double(high: float, low: float, number: Double) -> Double:
    """Return (high + low) times a double-double."""
    x, x_low = number
    product, split = _times_real(high, x)
    return product, split + (high * x_low + low * x)


@inlined
def _times_real(a: float, x: complex) -> Double:
    """Return product and error of a x exactly."""
    product = a * x
    return product, complex(fma(a, x.real, -product.real), fma(a, x.imag, -product.imag))


@inlined
def _square_root(z: complex) -> complex:
    """Return the principal square root without branches, so that loops over it vectorise."""
    size = math.sqrt(z.real * z.real + z.imag * z.imag)
    large = math.sqrt(0.5 * (size + abs(z.real)))
    small = 0.5 * abs(z.imag) / (large + 1e-300)
    real, imag = (large, small) if z.real >= 0.0 else (small, large)
    return complex(real, math.copysign(imag, z.imag))


@inlined
def reciprocal(z: complex) -> complex:
    """Return 1/z for numbers within 1e+-140, by the plain formula."""
    scale = 1.0 / (z.real * z.real + z.imag * z.imag)
    return complex(z.real * scale, -z.imag * scale)


@inlined
def magnitude(z: complex) -> float:
    """Return the larger of |Re z| and |Im z|."""
    return max(abs(z.real), abs(z.imag))


@inlined
def dispersion(s: complex, k: Any) -> tuple[tuple[complex, complex, complex], SolutionRow, SolutionRow]:
    """Return S, d, g S, and for both waves z, v = z - b S, t with its correction dt:  e^{-t_j} = e^{-t} (1 - dt).

    `k` is the row of a segment (`layout.ROW`).
    """
    S = _two_product(s, s)
    Cs, Cs_low = _times_real(k.damping, s)
    d, d_low = _two_sum(complex(1.0, 0.0), Cs)
    d_low = d_low + Cs_low
    aS = _times_double(k.a, k.a_low, S)
    bS = _times_double(k.b, k.b_low, S)
    gS = _times_double(k.g, k.g_low, S)

    over_d = reciprocal(d)
    bend = aS[0] * over_d
    couple = gS[0] * over_d
    shear = bS[0]
    mean = 0.5 * (bend + shear)
    spread = _square_root(0.25 * (bend - shear) * (bend - shear) - couple)
    spread = spread * (1.0 if mean.real * spread.real + mean.imag * spread.imag >= 0.0 else -1.0)
    # the larger root; the other from the product, without cancellation
    z1 = mean + spread
    z2 = (bend * shear + couple) * reciprocal(z1)
    damper = d, d_low
    one = _correct_root(z1, damper, aS, bS, gS)
    two = _correct_root(z2, damper, aS, bS, gS)
    return (S[0], d, gS[0]), one, two


@inlined
def _correct_root(z: complex, damper: Double, aS: Double, bS: Double, gS: Double) -> SolutionRow:
    """Return z, v, t, dt after a Newton step on (d z - a S)(z - b S) + g S, a double-double residual."""
    (d, d_low) = damper
    (gS_high, gS_low) = gS
    dz, dz_low = _two_product(d, z)
    dz_low = dz_low + d_low * z
    u, u_low = _two_sum(dz, -aS[0])
    u_low = u_low + (dz_low - aS[1])
    v, v_low = _two_sum(z, -bS[0])
    v_low = v_low - bS[1]
    uv, uv_low = _two_product(u, v)
    residual = (uv + gS_high) + (uv_low + (u * v_low + u_low * v) + gS_low)
    step = -residual * reciprocal(d * v + u)
    t = _square_root(z)
    square, square_low = _two_product(t, t)
    remainder = ((z - square) - square_low) + step
    # t = 0 at the cut-off, where no dt is needed
    smooth = 0.5 / (t.real * t.real + t.imag * t.imag + 1e-20)
    return z + step, v + (v_low + step), t, remainder * complex(t.real * smooth, -t.imag * smooth)


@compiled
def fill_wave_numbers(s: Any, rows: Any, found: Any) -> None:
    """Compute z, v and t of both waves of a segment, one row, at s (1-D), the larger z first: `found` (2, 3, n)."""
    for i in range(s.size):
        _, one, two = dispersion(s[i], rows[0])
        for n, (z, v, t, dt) in enumerate((one, two)):
            found[n, 0, i] = z
            found[n, 1, i] = v
            found[n, 2, i] = t + dt


@inlined
def wave_functions(z: complex, t: complex, dt: complex) -> SolutionRow:
    """Return c = cosh t e^{-t}, S = sinh t / t e^{-t}, e = e^{-t} and t, with t + dt for t."""
    e = math.exp(-t.real) * complex(math.cos(t.imag), -math.sin(t.imag))
    # 1 - e^2 would cancel; here e^{-t} is a scale alone, and t that of this very scale: next to the cut-off dt is large
    if abs(z.real) + abs(z.imag) < 1.0:
        c, s = even_functions(z)
        return e * c, e * s, e, t
    e = e - e * dt
    phase = t + dt
    half_square = 0.5 * (e * e)
    return 0.5 + half_square, (0.5 - half_square) * reciprocal(phase), e, phase


@inlined
def wave_sums(s: complex, k: Any) -> tuple[complex, complex, complex, complex]:
    """Return S = s^2, 1/d, z_1 + z_2 and z_1 z_2 of a segment."""
    S = s * s
    over_d = reciprocal(1.0 + k.damping * s)
    return S, over_d, S * (k.b + k.a * over_d), S * (k.a * k.b * S + k.g) * over_d


@inlined
def is_low(s: complex, k: Any) -> bool:
    """Whether both |z| are certainly below SERIES_RADIUS."""
    _, _, z_sum, z_product = wave_sums(s, k)
    half_sum = 0.5 * magnitude(z_sum)
    product = magnitude(z_product)
    return 1.4 * (half_sum + math.sqrt(half_sum * half_sum + 2.0 * product)) < SERIES_RADIUS


@inlined
def _series(shift: int, z_sum: Number, z_product: Number) -> tuple[Number, Number]:
    """Return the sum over k of h_k/(2k + shift)!, and the same without its first term.

    h_k, the complete homogeneous polynomial of z1 and z2, satisfies h_k = (z1 + z2) h_{k-1} - z1 z2 h_{k-2}: Clenshaw.
    """
    now = rest = after = 0.0 * z_sum
    for n in range(SERIES_TERMS):
        rest = z_sum * now - z_product * after
        after = now
        now = INVERSE_FACTORIAL[2 * (SERIES_TERMS - 1 - n) + shift] + rest
    return now, rest


@inlined
def transition_series(z_sum: Number, z_product: Number) -> tuple[Number, ...]:
    """Return F0, F1, F2, F3 at the tip, F2 - 1 and F3 - 1 as series, to 1e-17 for |z| < 6."""
    F0, _ = _series(3, z_sum, z_product)
    F1, _ = _series(2, z_sum, z_product)
    F2, F2_less_1 = _series(1, z_sum, z_product)
    F3, F3_less_1 = _series(0, z_sum, z_product)
    return F0, F1, F2, F3, F2_less_1, F3_less_1


@inlined
def even_functions(z: Number) -> tuple[Number, Number]:
    """Return cosh sqrt z and sinh sqrt z / sqrt z by Horner's rule; ten terms are enough to 1e-19 for |z| < 1."""
    c = s = 1.0 + 0.0 * z
    for k in range(10, 0, -1):
        c = 1.0 + z * c / ((2 * k - 1) * (2 * k))
        s = 1.0 + z * s / ((2 * k) * (2 * k + 1))
    return c, s


@inlined
def tip_conditions(ends: Any, S: Number) -> SolutionRow:
    """Return tip_mass, shear, tip_inertia and moment of the tip's conditions at S = s^2 from the vector of ends.

    Rest, inertia and force of the mass come first and those of the inertia next (see `system.end_condition`).
    """
    return ends[0] + ends[1] * S, ends[2] + 0.0 * S, ends[3] + ends[4] * S, ends[5] + 0.0 * S


@inlined
def impedance(S: float, k: Any) -> float:
    """Return the scale of M0/theta for a free tip, in the segment's units: inertia if slow, one wave number if fast."""
    inertia = k.g * S
    return min(inertia, math.sqrt(math.sqrt(inertia)) + math.sqrt(S * (k.a + k.b)))


# c, s, z, v, e: c and s are scaled by e = e^{-t}
Wave = tuple[Number, Number, Number, Number, Number]
# p_WPsi, p_WM, p_WQ = -p_PsiM, p_PsiQ, p_MQ
SolutionPlane = tuple[Number, Number, Number, Number, Number]
# f_W, f_Psi, f_M, f_Q
SolutionRow = tuple[Number, Number, Number, Number]


@inlined
def end_plane(mass: Number, shear: Number, inertia: Number, moment: Number) -> SolutionPlane:
    """Return the plane of states with  mass W + shear Q = 0  and  inertia Psi + moment M = 0, of a body at the end."""
    return shear * moment, -shear * inertia, 0 * shear, mass * moment, -mass * inertia


@inlined
def in_chain(wave: Wave, length: Number) -> Wave:
    """Return a wave in the chain's unit of length, of a segment of that length."""
    c, s, z, v, e = wave
    unit = 1.0 / (length * length)
    return c, s * length, z * unit, v * unit, e


@inlined
def scale_plane(p: SolutionPlane, unit: Number) -> SolutionPlane:
    """Return the plane times a number."""
    return p[0] * unit, p[1] * unit, p[2] * unit, p[3] * unit, p[4] * unit


@inlined
def inside_offset(a: Number, p: SolutionPlane) -> SolutionPlane:
    """Return the plane inside a rigid massless offset: W + a Psi and M - a Q are its outer W and M."""
    WPsi, WM, WQ, PsiQ, MQ = p
    return WPsi, WM + a * (2 * WQ - a * PsiQ), WQ - a * PsiQ, PsiQ, MQ


@inlined
def inside_spring(stiffness: Number, compliance: Number, p: SolutionPlane) -> SolutionPlane:
    """Return the plane inside a spring, stiffness (Psi_outer - Psi_inner) = compliance M, times the stiffness."""
    WPsi, WM, WQ, PsiQ, MQ = p
    return (
        stiffness * WPsi - compliance * WM,
        stiffness * WM,
        stiffness * WQ,
        stiffness * PsiQ - compliance * MQ,
        stiffness * MQ,
    )


@inlined
def inside_body(translation: Number, rotation: Number, p: SolutionPlane) -> SolutionPlane:
    """Return the plane inside a body: Q + translation W and M + rotation Psi are its outer Q and M.

    translation and rotation are inertia s^2 + spring.
    """
    WPsi, WM, WQ, PsiQ, MQ = p
    return (
        WPsi,
        WM - rotation * WPsi,
        WQ,
        PsiQ + translation * WPsi,
        MQ + translation * WM - rotation * (PsiQ + translation * WPsi),
    )


@inlined
def across_waves(one: Wave, two: Wave, gS: Number, d: Number, p: SolutionPlane) -> SolutionPlane:
    """Return the plane at the inner end of a segment from the outer one, times g S d (z1 - z2)^2 e^{-(t1 + t2)}.

    v_j = z_j - b S and v1 v2 = g S/d.
    """
    (c1, s1, z1, v1, e1) = one
    (c2, s2, z2, v2, e2) = two
    WPsi, WM, WQ, PsiQ, MQ = p
    gap = z1 - z2
    turned = d * gS * WPsi
    # alpha_1 ^ alpha_2 and beta_1 ^ beta_2
    A = -gS * gap * WM
    D = d * gap * PsiQ
    # a1 ^ b2, b1 ^ a2
    B = v1 * MQ - 2.0 * gS * WQ + v2 * turned
    C = 2.0 * gS * WQ - v1 * turned - v2 * MQ
    v_sum = v1 + v2
    # v1 alpha_1 ^ beta_1 d/(g S)
    kept = (d * WQ * v_sum - MQ - turned) * (e1 * e2)
    A, C, B, D = c1 * A - z1 * s1 * C, c1 * C - s1 * A, c1 * B - z1 * s1 * D, c1 * D - s1 * B
    A, B, C, D = c2 * A - z2 * s2 * B, c2 * B - s2 * A, c2 * C - z2 * s2 * D, c2 * D - s2 * C
    return (
        2.0 * v1 * v2 * kept + v2 * B - v1 * C,
        -d * gap * A,
        gS * (v_sum * kept + B - C),
        gS * gap * D,
        gS * (2.0 * gS * kept + d * (v1 * B - v2 * C)),
    )


@inlined
def transition_rows(
    F: SolutionRow, S: Number, over_d: Number, k: Any
) -> tuple[SolutionRow, SolutionRow, SolutionRow, SolutionRow]:
    """Return the matrix from the state at the outer end of a segment to that at the inner end, by F0..F3.

    `k` are a, b, g and sigma.
    """
    (F0, F1, F2, F3) = F
    sigma = k[3]
    aS = k[0] * S
    bS = k[1] * S
    gS = k[2] * S
    even = F3 - aS * over_d * F1
    odd = F3 - bS * F1
    bend = F2 - bS * F0
    lift = F2 - aS * over_d * F0
    return (
        (even, -F2, over_d * F1, over_d * F0 - sigma * lift),
        (gS * over_d * F0, odd, -over_d * bend, -over_d * F1),
        (-gS * F1, gS * F0 - aS * bend, odd, F2),
        (-gS * lift, gS * F1, -gS * over_d * F0, even),
    )


@inlined
def _minor(i: SolutionRow, j: SolutionRow, p: SolutionPlane) -> Number:
    """Return q_ij of the carried plane: the minors of rows i and j times p."""
    (i0, i1, i2, i3) = i
    (j0, j1, j2, j3) = j
    (WPsi, WM, WQ, PsiQ, MQ) = p
    return (
        (i0 * j1 - i1 * j0) * WPsi
        + (i0 * j2 - i2 * j0) * WM
        + (i0 * j3 - i3 * j0 - i1 * j2 + i2 * j1) * WQ
        + (i1 * j3 - i3 * j1) * PsiQ
        + (i2 * j3 - i3 * j2) * MQ
    )


@inlined
def across_rows(
    W: SolutionRow, Psi: SolutionRow, M: SolutionRow, Q: SolutionRow, p: SolutionPlane
) -> SolutionPlane:
    """Return the plane carried by `transition_rows`, for slow waves and for balls."""
    return _minor(W, Psi, p), _minor(W, M, p), _minor(W, Q, p), _minor(Psi, Q, p), _minor(M, Q, p)


@inlined
def met(f: SolutionRow, p: SolutionPlane) -> SolutionRow:
    """Return the state (W, Psi, M, Q) of the plane p with f z = 0, up to one factor."""
    WPsi, WM, WQ, PsiQ, MQ = p
    W, Psi, M, Q = f
    return (
        -Psi * WPsi - M * WM - Q * WQ,
        W * WPsi + M * WQ - Q * PsiQ,
        W * WM - Psi * WQ - Q * MQ,
        W * WQ + Psi * PsiQ + M * MQ,
    )


@inlined
def beyond_offset(a: Number, f: SolutionRow) -> SolutionRow:
    """Return the condition f z = 0 at the outer side of an offset, from that at its inner one."""
    return f[0], f[1] - a * f[0], f[2], f[3] + a * f[2]


@inlined
def beyond_spring(stiffness: Number, compliance: Number, f: SolutionRow) -> SolutionRow:
    """Return the condition beyond a rotational spring, times its stiffness."""
    return stiffness * f[0], stiffness * f[1], stiffness * f[2] - compliance * f[1], stiffness * f[3]


@inlined
def beyond_body(translation: Number, rotation: Number, f: SolutionRow) -> SolutionRow:
    """Return the condition beyond a body."""
    return f[0] - translation * f[3], f[1] - rotation * f[2], f[2], f[3]


@inlined
def row_across_waves(one: Wave, two: Wave, gS: Number, d: Number, f: SolutionRow) -> SolutionRow:
    """Return the condition at the outer end of a segment from that at its inner one, times g S d (z1 - z2).

    c, s of both waves are scaled by the same factor.
    """
    (c1, s1, z1, v1, _) = one
    (c2, s2, z2, v2, _) = two
    W, Psi, M, Q = f
    even1 = W + d * v1 * M
    odd1 = v1 * Psi + gS * Q
    even2 = W + d * v2 * M
    odd2 = v2 * Psi + gS * Q
    even1, odd1 = c1 * even1 - s1 * odd1, c1 * odd1 - z1 * s1 * even1
    even2, odd2 = c2 * even2 - s2 * odd2, c2 * odd2 - z2 * s2 * even2
    return (
        d * gS * (v1 * even2 - v2 * even1),
        d * gS * (odd1 - odd2),
        gS * (even1 - even2),
        d * (v1 * odd2 - v2 * odd1),
    )


@inlined
def row_across(
    W: SolutionRow, Psi: SolutionRow, M: SolutionRow, Q: SolutionRow, f: SolutionRow
) -> SolutionRow:
    """Return the condition carried outwards by `transition_rows`, f T^-1."""
    T = W, Psi, M, Q
    return _column(f, T, 0), _column(f, T, 1), _column(f, T, 2), _column(f, T, 3)


@inlined
def _column(f: SolutionRow, T: tuple[SolutionRow, SolutionRow, SolutionRow, SolutionRow], j: int) -> Number:
    """Return entry j of the row f T."""
    return f[0] * T[0][j] + f[1] * T[1][j] + f[2] * T[2][j] + f[3] * T[3][j]
