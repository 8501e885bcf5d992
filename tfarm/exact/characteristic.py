"""The characteristic function of the arm and of its closed loop: entire at C = 0, analytic but for s = -1/C.

The free response needs a torque u(s) at the hub, the *drive*; the law  u = -Kp theta - K1 s theta - K2 M/(1 + C s)
asks for another, and an eigenvalue is where both agree:

    D(s) = drive + (Kp + K1 s) theta + K2 M(0)/(1 + C s)

(the gauge at the root reads the moment without its damping part), so feedback changes one row of the paper's matrix,
and closed-loop poles are zeros of a function as exact as the arm's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .coefficients import Coefficients
from .compiled import compiled
from .dispersion import reciprocal
from .free import free_response
from .jets import Jet
from .waves import free_ends

Complex = NDArray[np.complexfloating[Any, Any]]
Real = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """The law's gains without dimensions: Kp L/EI, K1 L/EI in s, and K2, exact as fractions of their doubles."""

    Kp: Fraction = Fraction(0)
    K1: Fraction = Fraction(0)
    K2: Fraction = Fraction(0)

    @classmethod
    def of(cls, k: Coefficients, K1: float, K2: float, Kp: float) -> Gains:
        """The gains of  u = -Kp theta - K1 theta_t - K2 E I phi'(0)  in SI units."""
        unit = k.length / k.EI
        return cls(Kp=Fraction(Kp) * unit, K1=Fraction(K1) * unit, K2=Fraction(K2))


OPEN = Gains()
STEP = 1e-6  # of |s|, or of the way to -1/C, for differences


class Analytic(NamedTuple):
    """Values f e^{-scale}, their derivatives f' e^{-scale}, and scale, at given points."""

    value: Complex
    slope: Complex
    scale: Complex


def characteristic(k: Coefficients, s: Complex, gains: Gains = OPEN, at_zero: int = 0) -> Analytic:
    """D(s)/s^at_zero and its derivative at s (1-D, complex), in float64."""
    free = free_response(k, s)
    value, slope = closed(Jet.variable(s, 1), k.damping, free.drive, free.theta, free.M, gains).c
    if at_zero:
        s = np.where(s == 0, 1e-100, s)
        value = value / s**at_zero
        slope = slope / s**at_zero - at_zero * value / s
    return Analytic(value, slope, free.scale)


def quick_characteristic(k: Coefficients, s: Complex, gains: Gains = OPEN, at_zero: int = 0) -> Analytic:
    """The same with slopes from differences, right to about 1e-8: thirty times as fast for a hundred points."""
    law = np.array([[float(gains.Kp)], [float(gains.K1)], [float(gains.K2)]])
    return quick_characteristics(k, s, law, at_zero)


def quick_characteristics(k: Coefficients, s: Complex, law: Real, at_zero: int = 0) -> Analytic:
    """`quick_characteristic` with gains of their own at each point: law (3, n) or (3, 1), dimensionless Kp, K1, K2."""
    h = STEP * np.maximum(abs(s) * np.minimum(1.0, abs(1.0 + k.damping * s)), 1e-300)
    at = np.stack([s, s + h, s - h])
    drive, theta, moment, scale = loop_parts(k, at)
    values = drive + (law[0] + law[1] * at) * theta + law[2] * moment
    if at_zero:
        values = values / np.where(at == 0, 1e-100, at) ** at_zero
    with np.errstate(over="ignore", invalid="ignore"):  # next to -1/C at huge C: a slope that is no number says so
        up, down = (values[row] * np.exp(scale[row] - scale[0]) for row in (1, 2))
        return Analytic(values[0], (up - down) / (2 * h), scale[0])


def loop_parts(k: Coefficients, s: NDArray[Any]) -> tuple[Complex, Complex, Complex, Complex]:
    """Drive, theta and M0/(1 + C s) of the free response times e^{-scale}, and scale, for s of any shape.

    What a law makes of them is linear: D = drive + (Kp + K1 s) theta + K2 M0/(1 + C s), without dimensions.
    """
    parts = np.empty((4, s.size), complex)
    fill_loop_parts(np.ascontiguousarray(s, dtype=complex).ravel(), k.kernel, parts)
    drive, theta, moment, scale = parts.reshape(4, *s.shape)
    return drive, theta, moment, scale


@compiled
def fill_loop_parts(s: Any, k: Any, parts: Any) -> None:
    """The four rows of `loop_parts` at s (1-D)."""
    for i in range(s.size):
        theta, M0, scale = free_ends(s[i], k)
        parts[0, i] = ((k[14] + k[15] * s[i] * s[i]) * theta - k[16] * M0) / k[17]
        parts[1, i], parts[2, i], parts[3, i] = theta, M0 * reciprocal(1.0 + k[7] * s[i]), scale


def closed(s: Any, damping: float, drive: Any, theta: Any, M0: Any, gains: Gains) -> Any:
    """The drive with the feedback's torque taken from it, for any kind of number."""
    if gains.Kp or gains.K1:
        drive = drive + (float(gains.K1) * s + float(gains.Kp)) * theta
    return drive + M0 * float(gains.K2) / (1.0 + damping * s) if gains.K2 else drive


def zeros_at_origin(k: Coefficients, gains: Gains = OPEN) -> int:
    """How often D vanishes at s = 0: twice where the whole arm turns freely, once where K1 alone acts on it.

    (A third time at K1 = Kp = 0 and K2 = J/(J - I_h), where gauge and inertia cancel: that zero is left in D.)
    """
    if not k.has_rigid_mode or gains.Kp:
        return 0
    return 1 if gains.K1 else 2
