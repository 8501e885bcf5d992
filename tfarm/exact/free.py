"""The free response as analytic functions of s: numerators and denominator of every transfer function at the ends.

With torque and hub angle left open, the arm's equations and its tip conditions leave one solution up to a
factor.  Its root and tip values are the numerators, the torque it needs (the *drive*) the common
denominator; all of them are entire in s^2 at C = 0, without the artefacts of single waves, once each is divided
by g S d (z1 - z2)^2 and the scale e^{-(t1 + t2)} is taken back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex

from .closed_form import (
    SERIES_RADIUS,
    fields_from_root,
    from_transition,
    from_waves,
    tip_from_transition,
    tip_from_waves,
    transition_series,
)
from .coefficients import Coefficients
from .compiled import python_of
from .fields import Wave, tip_condition, waves
from .jets import Jet
from .vector import HUB_REST
from .waves import PARALLEL

_from_waves, _from_transition = python_of(from_waves), python_of(from_transition)
_transition, _fields = python_of(transition_series), python_of(fields_from_root)


class Free(NamedTuple):
    """The free response times e^{-scale}: hub angle, root moment and force, tip displacement and deflection, drive."""

    theta: Any
    M: Any
    Q: Any
    W: Any
    Y: Any
    drive: Any
    scale: Any
    parallel: Any  # where two waves are too nearly one for these formulas


class Tip(NamedTuple):
    """More of the free response times e^{-scale}: rotation Psi - theta, moment and shear force at the tip."""

    Phi: Any
    M: Any
    Q: Any
    scale: Any


def free_response(k: Coefficients, s: Complex) -> Free:
    """The free response at s (1-D), with the derivative of each entry: jets of order one but for the scale."""
    parts, scale, parallel = _everywhere(6, k, s, low_frequency, _by_waves)
    return Free._make((*parts, scale, parallel))


def tip_response(k: Coefficients, s: Complex) -> Tip:
    """What `free_response` leaves out at the tip, up to the same factor and scale."""
    parts, scale, _ = _everywhere(3, k, s, low_frequency_tip, _tip_by_waves)
    return Tip._make((*parts, scale))


def _everywhere(
    rows: int,
    k: Coefficients,
    s: Complex,
    by_series: Callable[[Coefficients, Jet], tuple[Jet, ...]],
    by_waves: Callable[[Coefficients, Jet, Complex, Wave, Wave], tuple[Jet, ...]],
) -> tuple[list[Jet], Complex, NDArray[np.bool_]]:
    """So many jets at s (1-D), by series where s is slow, by waves elsewhere; scale, and where waves are parallel."""
    _, d, _, one, two = waves(k, s)
    low = ~(np.maximum(abs(one.z), abs(two.z)) >= SERIES_RADIUS)  # s = 0 too, where no wave is left
    high = ~low
    parts = np.empty((rows, 2, s.size), complex)
    scale = np.where(low, 0.0, one.t + two.t)
    parallel = high & (abs(one.z - two.z) < PARALLEL * (abs(one.z) + abs(two.z)))
    if low.any():
        parts[:, :, low] = [entry.c for entry in by_series(k, Jet.variable(s[low], 1))]
    if high.any():
        one, two = (Wave._make(part[high] for part in wave) for wave in (one, two))
        parts[:, :, high] = [entry.c for entry in by_waves(k, Jet.variable(s[high], 1), d[high], one, two)]
    return [Jet(entry) for entry in parts], scale, parallel


def low_frequency(k: Coefficients, s: Jet) -> tuple[Jet, ...]:
    """theta, M, Q, W, Y and the drive around s by the series, to the order of the jet."""
    a, b, g, sigma = float(k.a), float(k.b), float(k.g), float(k.sigma)
    S, over_d, (F0, F1, F2, F3, F2_less_1, _) = _series(k, s)
    tip = tip_condition(k, S)
    state = _from_transition(F0, F1, F2, F3, F2_less_1, S, over_d, a, b, g, sigma, *tip)
    return *state, drive(k, S, state[0], state[1])


def low_frequency_tip(k: Coefficients, s: Jet) -> tuple[Jet, ...]:
    """Phi, M and Q at the tip around s by the series, to the order of the jet."""
    a, b, g, sigma = float(k.a), float(k.b), float(k.g), float(k.sigma)
    S, over_d, (F0, F1, F2, F3, F2_less_1, F3_less_1) = _series(k, s)
    tip = tip_condition(k, S)
    theta, M0, Q0, *_ = _from_transition(F0, F1, F2, F3, F2_less_1, S, over_d, a, b, g, sigma, *tip)
    lift, turn = tip_from_transition(F0, F1, F2, F3, S, over_d, a, sigma, *tip)
    _, Phi, _, _ = _fields(
        1.0, F0, F1, F2, F3, F2_less_1, F3_less_1, S, over_d, a, b, g, sigma, theta, M0, Q0
    )  # fmt: skip
    return Phi, -(tip[2] * turn), -(tip[0] * lift)


def _series(k: Coefficients, s: Jet) -> tuple[Jet, Jet, tuple[Jet, ...]]:
    """S, 1/d and the transition functions at the tip around s."""
    a, b, g = float(k.a), float(k.b), float(k.g)
    S, over_d = s * s, 1.0 / (1.0 + k.damping * s)
    return S, over_d, _transition(S * (b + a * over_d), S * (a * b * S + g) * over_d)


def drive(k: Coefficients, S: Any, theta: Any, M0: Any) -> Any:
    """Torque of the free response (its hub angle where the hub is locked): the characteristic function."""
    rest, inertia, force, gain = k.kernel[HUB_REST:]
    return ((rest + inertia * S) * theta - force * M0) / gain


def _by_waves(k: Coefficients, s: Jet, d: Complex, one: Wave, two: Wave) -> tuple[Jet, ...]:
    S = s * s
    arguments, unit = _jets(k, S, d, one, two)
    theta, M, Q, W = _from_waves(*arguments)
    state = tuple(entry * unit for entry in (theta, M, Q, W, W - theta))
    return *state, drive(k, S, state[0], state[1])


def _tip_by_waves(k: Coefficients, s: Jet, d: Complex, one: Wave, two: Wave) -> tuple[Jet, ...]:
    arguments, unit = _jets(k, s * s, d, one, two)
    tip_mass, _, tip_inertia, moment = arguments[-4:]
    theta, *_ = _from_waves(*arguments)
    lift, turn = tip_from_waves(*arguments)
    return (moment * turn - theta) * unit, -(tip_inertia * turn * unit), -(tip_mass * lift * unit)


def _jets(k: Coefficients, S: Jet, d: Complex, one: Wave, two: Wave) -> tuple[list[Any], Jet]:
    """What `from_waves` wants, as jets, and what its results are multiplied by to be free of single waves."""
    a, b, g = float(k.a), float(k.b), float(k.g)
    damper = Jet([d, k.damping * np.ones_like(d)])
    arguments: list[Any] = []
    for wave in (one, two):
        u = d * wave.z - a * S.c[0]
        by_s = k.damping * wave.z * wave.v - S.c[1] * (a * wave.v + b * u - g)
        slope = -by_s / (d * wave.v + u)  # dz/ds from the dispersion relation
        z = Jet([wave.z, slope])
        is_far = abs(wave.z) > 1.0
        far, near = np.where(is_far, wave.z, 1.0), np.where(is_far, 0.0, wave.z)
        by_z = np.where(is_far, (wave.c - wave.s) / (2 * far), wave.e * sinhc_slope(near))
        c, sinhc = Jet([wave.c, wave.s / 2 * slope]), Jet([wave.s, by_z * slope])
        arguments += [c, sinhc, z, Jet([wave.v, slope - b * S.c[1]]), wave.e]
    gap = arguments[2] - arguments[7]
    return [*arguments, g * S, damper, *tip_condition(k, S)], 1.0 / (g * S * damper * gap * gap)


def sinhc_slope(z: Complex) -> Complex:
    """d/dz of sinh sqrt z / sqrt z, by its series for |z| <= 1."""
    slope = np.zeros_like(z)
    for n in range(10, 0, -1):
        slope = (n + z * slope) / ((2 * n) * (2 * n + 1))
    return slope
