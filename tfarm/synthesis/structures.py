"""What a law may look like: its structure, with free coefficients x on scales of the arm's own.

    PD            v = -Kp theta - K1 theta_t                                     of hub angle and hub rate
    PD+notch      v = -(Kp + K1 s/(1 + s/pole)) N(s) theta                       of the hub angle alone
    lead          v = -Kp (1 + s/zero)/(1 + s/pole) theta
    PPF           PD, and -sum g_i w_i^2/(s^2 + 2 zeta_i w_i s + w_i^2) M        positive position feedback
    strain-rate   PD, and -g s/(1 + s/pole) M

N(s) = (s^2 + 2 a w s + w^2)/(s^2 + 2 b w s + w^2).  M is the root moment: of either sign, as g is.  Kp is held: it says
how fast the angle answers, sqrt(Kp/J), and the objectives would have it small.  A pole faster than 2/T is none when
sampled by Tustin's rule, but rings: there the search ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arm.law import Law
from tfarm.records import record
from tfarm.spectrum import modes as natural_modes

Real = NDArray[np.float64]

SPEED = 0.1  # of the first frequency, and rad a sample: how fast the angle answers unless it is said


@dataclass(frozen=True)
@record
class Structure:
    """A law with free coefficients: their `names`, where they `start` (n,) and end (`most`), and the law that has them.

    Coefficient i is start e^x where `is_positive`, else start sinh(x).
    """

    name: str
    names: tuple[str, ...]
    start: Real
    is_positive: tuple[bool, ...]
    most: Real
    build: Callable[[Real], Law]

    def at_limit(self, x: Real) -> tuple[str, ...]:
        """The names of coefficients that are as large as they may be."""
        return tuple(n for n, c, most in zip(self.names, self.coefficients(x), self.most, strict=True) if c >= most)

    def coefficients(self, x: Real) -> Real:
        """The coefficients at x."""
        signs = np.array(self.is_positive)
        x = np.clip(x, -40.0, 40.0)
        return np.asarray(np.minimum(np.where(signs, self.start * np.exp(x), self.start * np.sinh(x)), self.most))

    def law(self, x: Real) -> Law:
        """The law at x."""
        return self.build(self.coefficients(x))

    @property
    def origin(self) -> Real:
        """x of the start, where a gain of either sign is 0."""
        return np.zeros(len(self.names))


def usual_angle_gain(arm: Arm, period: float) -> float:
    """Kp [input/rad]: the angle answers at a tenth of the first frequency, or of a radian a sample if that is less."""
    first = float(natural_modes(arm, 1).natural_frequency[-1])
    return float(f"{arm.turned_inertia * (SPEED * min(first, 1 / period)) ** 2:.3g}")


def _rate_gain(arm: Arm, Kp: float) -> float:
    """K1 that damps the rigid arm under Kp by 1/sqrt(2), without its losses."""
    return float(np.sqrt(2 * Kp * arm.turned_inertia))


def _pd(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    def build(c: Real) -> Law:
        return Law({"hub_angle": Kp, "hub_rate": float(c[0])}, name="PD")

    return Structure("PD", ("K1",), np.array([_rate_gain(arm, Kp)]), (True,), np.array([np.inf]), build)


def _pd_notch(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    first = float(natural_modes(arm, 1).natural_frequency[-1])

    def build(c: Real) -> Law:
        K1, pole, w, a, b = c
        num = np.polymul([K1 + Kp / pole, Kp], [1.0, 2 * a * w, w * w])
        den = np.polymul([1 / pole, 1.0], [1.0, 2 * b * w, w * w])
        return Law({"hub_angle": (num, den)}, name="PD+notch")

    names = ("K1", "pole_rad_s", "notch_rad_s", "notch_zero_damping", "notch_pole_damping")
    start = np.array(
        [_rate_gain(arm, Kp), 2 / period, min(first, 1 / period), 0.1, 0.7]
    )  # a derivative as fast as samples tell
    most = np.array([np.inf, 2 / period, 2 / period, np.inf, np.inf])
    return Structure("PD+notch", names, start, (True,) * 5, most, build)


def _lead(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    def build(c: Real) -> Law:
        zero, pole = c
        return Law({"hub_angle": ((Kp / zero, Kp), (1 / pole, 1.0))}, name="lead")

    start, most = np.array([Kp / _rate_gain(arm, Kp), 2 / period]), np.array([np.inf, 2 / period])
    return Structure("lead", ("zero_rad_s", "pole_rad_s"), start, (True, True), most, build)


def _ppf(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    frequencies = natural_modes(arm, modes).natural_frequency[-modes:]

    def build(c: Real) -> Law:
        num, den = np.zeros(1), np.ones(1)
        for g, w, zeta in c[1:].reshape(modes, 3):
            own = np.array([1.0, 2 * zeta * w, w * w])
            num = np.polyadd(np.polymul(num, own), g * w * w * den)
            den = np.polymul(den, own)
        return Law({"hub_angle": Kp, "hub_rate": float(c[0]), "root_moment": (num, den)}, name="PPF")

    names = ("K1", *(f"{each}_{n}" for n in range(1, modes + 1) for each in ("gain", "filter_rad_s", "filter_damping")))
    unit = 0.1 * arm.input_per_torque
    start = np.r_[_rate_gain(arm, Kp), np.array([[unit, min(w, 1 / period), 0.3] for w in frequencies]).ravel()]
    most = np.r_[np.inf, np.tile([np.inf, 2 / period, np.inf], modes)]
    return Structure("PPF", names, start, (True, *(False, True, True) * modes), most, build)


def _strain_rate(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    first = float(natural_modes(arm, 1).natural_frequency[-1])

    def build(c: Real) -> Law:
        K1, g, pole = (float(each) for each in c)
        return Law({"hub_angle": Kp, "hub_rate": K1, "root_moment": ((g, 0.0), (1 / pole, 1.0))}, name="strain-rate")

    start = np.array([_rate_gain(arm, Kp), 0.1 * arm.input_per_torque / first, 2 / period])
    most = np.array([np.inf, np.inf, 2 / period])
    return Structure("strain-rate", ("K1", "gain_s", "pole_rad_s"), start, (True, False, True), most, build)


STRUCTURES: dict[str, Callable[[Arm, float, int, float], Structure]] = {
    "PD": _pd, "PD+notch": _pd_notch, "lead": _lead, "PPF": _ppf, "strain-rate": _strain_rate,
}  # fmt: skip
