"""What a law may look like: its structure, with free coefficients x on scales of the arm's own.

    PD            v = -Kp theta - K1 theta_t                                     of hub angle and hub rate
    PD+notch      v = -(Kp + K1 s/(1 + s/pole)) N(s) theta                       of the hub angle alone
    lead          v = -Kp (1 + s/zero)/(1 + s/pole) theta
    PPF           PD, and -sum g_i w_i^2/(s^2 + 2 zeta_i w_i s + w_i^2) M        positive position feedback
    strain-rate   PD, and -g s/(1 + s/pole) M

N(s) = (s^2 + 2 a w s + w^2)/(s^2 + 2 b w s + w^2).  M is the root moment: of either sign, as g is.  Kp is held: it says
how fast the angle answers, sqrt(Kp/J), and the objectives would have it small.  Signals enter less their references.
A pole faster than 2/T is none when sampled by Tustin's rule, but rings: there the search ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm, Law
from tfarm.arrays import Real
from tfarm.records import record
from tfarm.spectrum import modes as natural_modes
from tfarm.spectrum.scales import first_frequency

Numbers = NDArray[Any]  # real, or complex for a derivative

ANGLE_SPEED = 0.1  # of the first frequency, and rad a sample: how fast the angle answers unless it is said
LARGEST_X = 40.0  # of x
AT_LIMIT = 1e-9  # relative: a coefficient so near to its limit is there
ONE = np.ones(1)
IMAGINARY_STEP = 1e-30  # of a step: its square is nothing beside 1 in float64


class Entry(NamedTuple):
    """What a signal is multiplied by: polynomials in s, descending, of the coefficients."""

    signal: str
    num: Numbers
    den: Numbers


class Slope(NamedTuple):
    """An entry, and d num/dx_j and d den/dx_j (n, degrees) by the coordinates of the search."""

    entry: Entry
    num: Real
    den: Real


@dataclass(frozen=True)
@record
class Structure:
    """A law with free coefficients: their `names`, where they `start` (n,) and end (`most`), and its entries.

    Coefficient i is start e^x where `is_positive`, else start sinh(x).  `entries` makes polynomials of coefficients, by
    operations that are analytic in them.
    """

    name: str
    names: tuple[str, ...]
    start: Real
    is_positive: tuple[bool, ...]
    most: Real
    entries: Callable[[Numbers], tuple[Entry, ...]]

    def at_limit(self, x: Real) -> tuple[str, ...]:
        """The names of coefficients that are as large as they may be."""
        near = (1 - AT_LIMIT) * self.most
        return tuple(n for n, c, most in zip(self.names, self.coefficients(x), near, strict=True) if c >= most)

    def coefficients(self, x: Real) -> Real:
        """The coefficients at x."""
        signs = np.array(self.is_positive)
        x = np.clip(x, -LARGEST_X, LARGEST_X)
        return np.asarray(np.minimum(np.where(signs, self.start * np.exp(x), self.start * np.sinh(x)), self.most))

    def law(self, x: Real) -> Law:
        """The law at x."""
        entries = self.entries(self.coefficients(x))
        blocks = {each.signal: (tuple(each.num.tolist()), tuple(each.den.tolist())) for each in entries}
        return Law(blocks, name=self.name, references=tuple(blocks))

    def slopes(self, x: Real) -> tuple[Slope, ...]:
        """The entries at x and their derivatives by x, exact to rounding: f'(c) = Im f(c + i h)/h as h -> 0.

        (Squire and Trapp, 1998.)
        """
        c, stepped = self.coefficients(x), np.where(self.is_positive, np.exp(x), np.cosh(x)) * self.start
        steps = 1j * IMAGINARY_STEP * np.diag(stepped)
        moved = [self.entries(c + step) for step in steps]
        return tuple(
            Slope(
                entry,
                np.array([row[n].num.imag / IMAGINARY_STEP for row in moved]),
                np.array([row[n].den.imag / IMAGINARY_STEP for row in moved]),
            )
            for n, entry in enumerate(self.entries(c))
        )

    @property
    def upper(self) -> Real:
        """The largest x (n,): where a coefficient is as large as it may be."""
        with np.errstate(over="ignore"):
            share = self.most / self.start
        return np.where(np.isfinite(share), np.log(np.abs(share)), LARGEST_X)

    @property
    def origin(self) -> Real:
        """x of the start, where a gain of either sign is 0."""
        return np.zeros(len(self.names))


def usual_angle_gain(arm: Arm, period: float) -> float:
    """Kp [input/rad]: the angle answers at a tenth of the first frequency, or of a radian a sample if that is less."""
    speed = ANGLE_SPEED * min(first_frequency(arm), 1 / period)
    return float(f"{arm.turned_inertia * speed**2:.3g}")


def _rate_gain(arm: Arm, Kp: float) -> float:
    """K1 that damps the rigid arm under Kp by 1/sqrt(2), without its losses."""
    return float(np.sqrt(2 * Kp * arm.turned_inertia))


def _servo_entries(Kp: float, c: Numbers) -> tuple[Entry, Entry]:
    """Kp on the angle, the first coefficient on its rate."""
    return Entry("hub_angle", Kp * ONE, ONE), Entry("hub_rate", c[:1], ONE)


def _pd(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    start = np.array([_rate_gain(arm, Kp)])
    return Structure("PD", ("K1",), start, (True,), np.array([np.inf]), partial(_servo_entries, Kp))


def _pd_notch(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    def entries(c: Numbers) -> tuple[Entry, ...]:
        K1, pole, w, a, b = c
        num = np.polymul([K1 + Kp / pole, Kp], [1.0, 2 * a * w, w * w])
        den = np.polymul([1 / pole, 1.0], [1.0, 2 * b * w, w * w])
        return (Entry("hub_angle", num, den),)

    names = ("K1", "pole_rad_s", "notch_rad_s", "notch_zero_damping", "notch_pole_damping")
    start = np.array(
        [_rate_gain(arm, Kp), 2 / period, min(first_frequency(arm), 1 / period), 0.1, 0.7]
    )  # a derivative as fast as samples tell
    most = np.array([np.inf, 2 / period, 2 / period, np.inf, np.inf])
    return Structure("PD+notch", names, start, (True,) * 5, most, entries)


def _lead(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    def entries(c: Numbers) -> tuple[Entry, ...]:
        zero, pole = c
        return (Entry("hub_angle", np.array([Kp / zero, Kp]), np.array([1 / pole, 1.0])),)

    start, most = np.array([Kp / _rate_gain(arm, Kp), 2 / period]), np.array([np.inf, 2 / period])
    return Structure("lead", ("zero_rad_s", "pole_rad_s"), start, (True, True), most, entries)


def _ppf(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    frequencies = natural_modes(arm, modes).natural_frequency[-modes:]

    def entries(c: Numbers) -> tuple[Entry, ...]:
        num, den = np.zeros(1), ONE
        for g, w, zeta in c[1:].reshape(modes, 3):
            own = np.array([1.0, 2 * zeta * w, w * w])
            num = np.polyadd(np.polymul(num, own), g * w * w * den)
            den = np.polymul(den, own)
        return (*_servo_entries(Kp, c), Entry("root_moment", num, den))

    names = ("K1", *(f"{each}_{n}" for n in range(1, modes + 1) for each in ("gain", "filter_rad_s", "filter_damping")))
    unit = 0.1 * arm.input_per_torque
    start = np.r_[_rate_gain(arm, Kp), np.array([[unit, min(w, 1 / period), 0.3] for w in frequencies]).ravel()]
    most = np.r_[np.inf, np.tile([np.inf, 2 / period, np.inf], modes)]
    return Structure("PPF", names, start, (True, *(False, True, True) * modes), most, entries)


def _strain_rate(arm: Arm, Kp: float, modes: int, period: float) -> Structure:
    def entries(c: Numbers) -> tuple[Entry, ...]:
        _, g, pole = c
        return (*_servo_entries(Kp, c), Entry("root_moment", np.array([g, 0.0]), np.array([1 / pole, 1.0])))

    start = np.array([_rate_gain(arm, Kp), 0.1 * arm.input_per_torque / first_frequency(arm), 2 / period])
    most = np.array([np.inf, np.inf, 2 / period])
    return Structure("strain-rate", ("K1", "gain_s", "pole_rad_s"), start, (True, False, True), most, entries)


STRUCTURES: dict[str, Callable[[Arm, float, int, float], Structure]] = {
    "PD": _pd, "PD+notch": _pd_notch, "lead": _lead, "PPF": _ppf, "strain-rate": _strain_rate,
}  # fmt: skip
