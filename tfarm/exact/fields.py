"""Deflection, rotation, moment and shear force along the arm, in float64.

Near the root, where |t| x is small, the root's exact values are carried along by the transition functions.
Further out that would multiply rounding by e^{t x}; there each wave is written as what decays from the root
and what decays from the tip,

    W(x) = sum_j P_j e^{-t_j x} + R_j e^{-t_j (1 - x)},

with P and R again free of products of a wave with itself (derived from the minors in `closed_form.from_waves`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex

from .closed_form import (
    SERIES_RADIUS,
    even_functions,
    fields_from_root,
    from_transition,
    from_waves,
    tip_conditions,
    transition_series,
)
from .coefficients import Coefficients
from .compiled import python_of
from .vector import HUB_REST, TIP_MASS
from .waves import evaluate, separated

Tip = tuple[Any, float, Any, float]  # tip_mass, shear, tip_inertia, moment
_ROOT = np.array([[0, 0, 0, 1.0], [1, 0, 0, 1.0], [2, 0, 0, 1.0]])  # theta, M0, Q0 as `evaluate` wants them
_ends = python_of(from_transition)
_fields = python_of(fields_from_root)
_minors = python_of(from_waves)
_transition = python_of(transition_series)
_even = python_of(even_functions)
_tip_conditions = python_of(tip_conditions)


class Wave(NamedTuple):
    """One pair of waves at each s: z = t^2, v = z - b S, and c, S, e of `closed_form.from_waves`."""

    z: Complex
    v: Complex
    t: Complex
    c: Complex
    s: Complex
    e: Complex


def waves(k: Coefficients, s: Complex) -> tuple[Complex, Complex, Complex, Wave, Wave]:
    """S, d, g S and the two waves at s, each of the shape of s (1-D)."""
    numbers, functions = np.empty((11, s.size), complex), np.empty((6, s.size), complex)
    separated(s, k.kernel, numbers, functions)
    S, d, gS, z1, v1, t1, dt1, z2, v2, t2, dt2 = numbers
    return S, d, gS, Wave(z1, v1, t1 + dt1, *functions[:3]), Wave(z2, v2, t2 + dt2, *functions[3:])


def root_state(k: Coefficients, s: Complex) -> tuple[Complex, NDArray[np.bool_]]:
    """theta, M0 and Q0 (dimensionless, rows) for a unit input at s (1-D), and where digits are missing."""
    values, suspects = np.empty((3, s.size), complex), np.empty(s.size, bool)
    evaluate(s, k.kernel, _ROOT, values, suspects)
    return values, suspects


def fields(k: Coefficients, s: Complex, x: float) -> tuple[Complex, NDArray[np.bool_]]:
    """Y, Phi, M, Q (dimensionless, rows) at the share x for a unit input, and where digits are missing."""
    root, suspects = root_state(k, s)
    S, d, gS, one, two = waves(k, s)
    size = np.maximum(abs(one.z), abs(two.z))
    low = ~(size >= SERIES_RADIUS)  # s = 0 too, where no wave is left
    near = low | (size * x * x < SERIES_RADIUS) if x <= 0.5 else low
    result = np.empty((4, s.size), complex)
    result[:, near] = from_root(k, S[near], d[near], root[:, near], x)
    if x > 0.5:
        result[2:, low] = _from_tip(k, S[low], d[low], root[0, low], x)
    far = ~near
    one, two = (Wave._make(part[far] for part in wave) for wave in (one, two))
    result[:, far] = _from_waves(k, S[far], d[far], gS[far], one, two, root[0, far], x)
    return result, suspects


def from_root(k: Coefficients, S: Any, d: Any, root: Any, x: Any) -> tuple[Any, ...]:
    """Y, Phi, M, Q at x from the root's theta, M0, Q0 where |z| x^2 < `SERIES_RADIUS`; the shapes broadcast."""
    a, b, g, sigma = float(k.a), float(k.b), float(k.g), float(k.sigma)
    return _fields(x, *_functions(k, S, d, x), S, 1 / d, a, b, g, sigma, *root)


def _functions(k: Coefficients, S: Any, d: Any, x: Any) -> tuple[Any, ...]:
    """F0, F1, F2, F3, F2 - x and F3 - 1 at x, by their series."""
    a, b, g = float(k.a), float(k.b), float(k.g)
    z_sum, z_product = S * (b + a / d), S * (a * b * S + g) / d
    F0, F1, F2, F3, F2_less_1, F3_less_1 = _transition(z_sum * x**2, z_product * x**4)
    return x**3 * F0, x**2 * F1, x * F2, F3, x * F2_less_1, F3_less_1


def _from_tip(k: Coefficients, S: Complex, d: Complex, theta: Complex, x: float) -> tuple[Complex, Complex]:
    """M and Q near the tip at low frequency, carried back from it: from the root they would be small differences.

    The tip's two conditions leave it W = shear Y, Q = -tip_mass Y, Psi = moment X, M = -tip_inertia X.
    """
    a, b, g, sigma = float(k.a), float(k.b), float(k.g), float(k.sigma)
    tip_mass, shear, tip_inertia, moment = tip_condition(k, S)
    over_d, aS, bS, gS = 1 / d, a * S, b * S, g * S
    F0, F1, F2, F3, *_ = functions = _functions(k, S, d, 1.0)
    bend, turn = F2 - bS * F0, F3 - bS * F1
    drop = aS * bend - gS * F0
    row = (
        shear * gS * F1 + tip_mass * F2,
        (shear * gS * F0 + tip_mass * F1) * over_d,
        shear * (F3 - aS * over_d * F1) + tip_mass * (sigma * F2 - (1 + sigma * aS) * over_d * F0),
    )
    free, *_ = _ends(*functions[:4], functions[4], S, over_d, a, b, g, sigma, tip_mass, shear, tip_inertia, moment)
    cross = over_d * (F1 * turn - F2 * bend), F2 * turn - over_d * drop * F1, turn**2 - over_d * drop * bend
    X = sum(one * other for one, other in zip(row, cross, strict=True)) * theta / free
    Y = (moment * F2 + tip_inertia * over_d * F1) * theta / free
    _, _, M, Q = _march(k, S, d, (shear * Y, moment * X, -tip_inertia * X, -tip_mass * Y), x)
    return M, Q


def _march(k: Coefficients, S: Complex, d: Complex, tip: tuple[Complex, ...], x: float) -> tuple[Complex, ...]:
    """W, Psi, M and Q at x, carried back from the tip's W, Psi, M and Q; seen from the tip, Psi and Q change sign."""
    a, b, g, sigma = float(k.a), float(k.b), float(k.g), float(k.sigma)
    W, Psi, M, Q = tip
    F0, F1, F2, F3, *_ = functions = _functions(k, S, d, 1 - x)
    fields = _fields(1 - x, *functions, S, 1 / d, a, b, g, sigma, -Psi, M, -Q)
    Y, Phi, M, Q = fields
    W_at = Y - (1 - x) * Psi + (F3 - a * S / d * F1) * W
    Psi_at = Psi - Phi + g * S / d * F0 * W
    return W_at, Psi_at, M - g * S * F1 * W, -Q - g * S * (F2 - a * S / d * F0) * W


def free_root(k: Coefficients, S: Any, d: Any) -> tuple[Any, Any, Any]:
    """theta, M0, Q0 of the free response at low frequency, up to one factor."""
    functions = _functions(k, S, d, 1.0)
    constants = float(k.a), float(k.b), float(k.g), float(k.sigma)
    theta, M0, Q0, *_ = _ends(*functions[:5], S, 1 / d, *constants, *tip_condition(k, S))
    return theta, M0, Q0


def tip_condition(k: Coefficients, S: Any) -> Tip:
    """tip_mass, shear, tip_inertia and moment of the tip's conditions, as `closed_form.from_waves` takes them."""
    return _tip_conditions(k.kernel[TIP_MASS:HUB_REST], S)


def _from_waves(
    k: Coefficients, S: Complex, d: Complex, gS: Complex, one: Wave, two: Wave, theta: Complex, x: float
) -> tuple[Complex, ...]:
    tip = tip_condition(k, S)
    free, _, _, W1 = _minors(one.c, one.s, one.z, one.v, one.e, two.c, two.s, two.z, two.v, two.e, gS, d, *tip)
    over = theta / free
    W, Psi, M, Q = _sum(one, two, gS, d, tip, x, over)
    if x > 0.5:
        size = np.maximum(abs(one.z), abs(two.z))
        close = size * (1 - x) ** 2 < SERIES_RADIUS
        _, Psi1, M1, _ = _sum(one, two, gS, d, tip, 1.0, over)
        tip_mass, _, tip_inertia, moment = tip
        light = abs(tip_inertia) < moment * np.sqrt(size)  # take from its condition what the payload makes small
        with np.errstate(invalid="ignore", divide="ignore"):
            M1, Psi1 = (
                np.where(light, -tip_inertia / moment * Psi1, M1),
                np.where(light, Psi1, -moment / tip_inertia * M1),
            )
            Q1 = -tip_mass * gS * (one.z - two.z) * (_r(one, d, tip) * two.e - _r(two, d, tip) * one.e) * over
        marched = _march(k, S, d, (W1 * over, Psi1, M1, Q1), x)
        W, Psi, M, Q = np.where(close, marched, (W, Psi, M, Q))
    return W - x * theta, Psi - theta, M, Q


def _r(wave: Wave, d: Complex, tip: Tip) -> Complex:
    """The tip's moment condition for W = cosh t x, over v: tip_inertia c + moment d z S."""
    return tip[2] * wave.c + tip[3] * d * wave.z * wave.s


def _sum(one: Wave, two: Wave, gS: Complex, d: Complex, tip: Tip, x: float, over: Complex) -> list[Complex]:
    """W, Psi, M, Q at x of both waves together."""
    parts = _wave(one, two, gS, d, *tip, x), _wave(two, one, gS, d, *tip, x)
    return [(part + other) * over for part, other in zip(*parts, strict=True)]


def _wave(
    one: Wave,
    two: Wave,
    gS: Complex,
    d: Complex,
    tip_mass: Complex,
    shear: float,
    tip_inertia: Complex,
    moment: float,
    x: float,
) -> tuple[Complex, ...]:
    """W, Psi, M, Q of wave `one` in the free response, scaled as `closed_form.from_waves` is.

    A slow wave, |z| < 1, is written in even functions of x and 1 - x: next to the cut-off P and R would cancel.
    """
    bare = two.v * (tip_mass * tip_inertia - shear * moment * d * gS)
    So = tip_mass * two.z * two.s + shear * gS * two.c
    Mo = two.v * (tip_inertia * two.c + moment * d * two.z * two.s)
    even, odd = Mo * shear * gS - So * one.v * tip_inertia, Mo * tip_mass - So * one.v * moment * d
    slow = abs(one.z.real) + abs(one.z.imag) < 1.0
    z, t, y = np.where(slow, one.z, 0.0), np.where(slow, 1.0, one.t), 1 - x
    decaying = (even + t * odd - one.e * two.e * t * bare) / 2
    growing = (one.e * (even - t * odd) + two.e * t * bare) / 2
    P, R = decaying * np.exp(-t * x), growing * np.exp(-t * y)
    W, slope = P + R, (R - P) / t  # slope: W' / z
    (c_x, s_x), (c_y, s_y) = _even(z * x * x), _even(z * y * y)
    W = np.where(slow, one.e * (even * c_y + z * (odd * y * s_y + two.e * bare * x * s_x)), W)
    slope = np.where(slow, one.e * (two.e * bare * c_x - even * y * s_y - odd * c_y), slope)
    return W, one.v * slope, d * one.v * W, gS * slope
