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
        s = np.where(s == 0, 1e-300, s)
        value = value / s**at_zero
        slope = slope / s**at_zero - at_zero * value / s
    return Analytic(value, slope, free.scale)


def quick_characteristic(k: Coefficients, s: Complex, gains: Gains = OPEN, at_zero: int = 0) -> Analytic:
    """The same with slopes from differences, right to about 1e-8: thirty times as fast for a hundred points."""
    h = STEP * np.maximum(abs(s) * np.minimum(1.0, abs(1.0 + k.damping * s)), 1e-300)
    values, scales = np.empty((3, s.size), complex), np.empty((3, s.size), complex)
    law = np.array([float(gains.Kp), float(gains.K1), float(gains.K2), float(at_zero)])
    evaluate_drive(np.concatenate([s, s + h, s - h]), k.kernel, law, values.reshape(-1), scales.reshape(-1))
    up, down = (values[row] * np.exp(scales[row] - scales[0]) for row in (1, 2))
    return Analytic(values[0], (up - down) / (2 * h), scales[0])


@compiled
def evaluate_drive(s: Any, k: Any, law: Any, values: Any, scales: Any) -> None:
    """Fill values with D(s)/s^law[3] e^{-scale}, and scales; law = (Kp, K1, K2, zeros at the origin)."""
    for i in range(s.size):
        theta, M0, scales[i] = free_ends(s[i], k)
        S = s[i] * s[i]
        drive = ((k[14] + k[15] * S) * theta - k[16] * M0) / k[17]
        drive = drive + (law[0] + law[1] * s[i]) * theta + law[2] * M0 * reciprocal(1.0 + k[7] * s[i])
        at_zero = int(law[3])
        at = s[i] if s[i] != 0 else complex(1e-300, 0.0)
        drive = drive * reciprocal(at) if at_zero >= 1 else drive
        values[i] = drive * reciprocal(at) if at_zero >= 2 else drive


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
