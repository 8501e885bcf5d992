"""Wave numbers in float64 whose phase is right to the last digit.

t_j = sqrt(z_j) is a phase of hundreds of radians at high frequency, and half a unit in its last place would be 1e-13
of the answer; above the cut-off two such errors do not even act together.  So each root of the dispersion
relation is corrected by one Newton step whose residual is formed in double-double arithmetic: products split
exactly by fused multiply-add, sums by Knuth's two-sum.  No branch, so that loops over it vectorise.
"""

from __future__ import annotations

import math
from typing import Any

from .compiled import fma, inlined
from .vector import A_LOW, B_LOW, DAMPING, G_LOW, A, B, G


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
def dispersion(s: complex, k: Any) -> tuple[complex, ...]:
    """S, d, d_low and for both waves z, v = z - b S, t with its correction dt:  e^{-t_j} = e^{-t} (1 - dt).

    `k` is the vector of `Coefficients.kernel`: a, b, g as double-doubles, then sigma and C.
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
