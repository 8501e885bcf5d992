"""Gain, phase, delay and disk margin of the exact loop function L(i w), and never without the verdict.

A gain margin of an unstable loop is a number that means nothing.  At C = 0 the loop function has poles on the axis at
ever higher frequency, so that any delay, however short, destabilises some mode: the exact delay margin is 0.  With
K2 != 0 the disk margin is 0 too and the peak sensitivity infinite; with K2 = 0 the hub is passive, and they are not.
What the loop has up to a band is given beside them, with the band.

Disk margin: the largest alpha for which the loop bears every factor (2 + alpha d)/(2 - alpha d), |d| < 1 (Seiler,
Packard and Gahinet 2020, symmetric disks), which is 2 min |(1 + L)/(1 - L)|.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from tfarm.arm import Arm, HubFeedback

from .frequencies import grid
from .lines import BISECTIONS, Line, crossing_at_zero, crossings
from .plant import Loop
from .stability import Stability, stability
from .windows import Windows, gain_windows

Real = NDArray[np.float64]
NONE = HubFeedback()
DIGITS, PLACE_DIGITS = 9, 7  # of a margin, and of the frequency of a dip, which its depth hardly feels
LOWEST = 6  # local minima on the grid that are refined
NEAR_POLES = np.geomspace(0.05, 20.0, 12)  # points about a pole, in its distances from the axis


@dataclass(frozen=True)
class LoopMargins:
    """Margins of L(i w) for 0 < w <= `band` [rad/s]; inf where nothing limits.

    `gain` (lowest, highest factor), `phase` [deg], `delay` [s], `disk` [-], `peak_sensitivity` [-]; `at` are the
    frequencies [rad/s] where phase, delay, disk margin and peak sensitivity occur.
    """

    band: float
    gain: tuple[float, float]
    phase: float
    delay: float
    disk: float
    peak_sensitivity: float
    at: dict[str, float]


@dataclass(frozen=True)
class Margins:
    """The verdict first.  `in_band` are the margins up to its band; `exact_delay`, `exact_disk` and `exact_peak` those
    of the whole infinite-dimensional loop.  All four are None unless the loop is stable.
    """

    stability: Stability
    windows: dict[str, Windows]
    in_band: LoopMargins | None
    exact_delay: float | None
    exact_disk: float | None
    exact_peak: float | None


def margins(arm: Arm, law: HubFeedback, band: float | None = None) -> Margins:
    """Verdict, windows of each gain, and margins of the loop.  Raises what `stability` raises."""
    verdict = stability(arm, law, band)
    windows = {name: gain_windows(verdict, name) for name in ("K1", "K2", "Kp")}
    if not verdict.is_stable:
        return Margins(verdict, windows, None, None, None, None)
    found = loop_margins(verdict)
    if arm.link.damping == 0 and law.K2:
        return Margins(verdict, windows, found, 0.0, 0.0, math.inf)
    if arm.link.damping == 0 and law.K1:  # 1 + L = 1 + (Kp + i K1 w) theta, theta real: no dip deepens with w
        return Margins(verdict, windows, found, 0.0, found.disk, found.peak_sensitivity)
    return Margins(verdict, windows, found, found.delay, found.disk, found.peak_sensitivity)


def loop_margins(verdict: Stability) -> LoopMargins:
    """The margins of a stable loop up to the verdict's band."""
    loop, band = verdict.loop, verdict.band
    omega = dense(verdict)
    crossed = unit_crossings(loop, omega)
    angle = np.angle(-loop.loop_function(1j * crossed))  # 0 where L = -1
    lag = np.mod(angle, 2 * math.pi)
    phase, at_phase = _least(np.asarray(abs(angle) * 180 / math.pi), crossed)
    delay, at_delay = _least(lag / np.where(crossed == 0, 1, crossed), crossed)

    def inverse_sensitivity(w: Real) -> Real:
        drive, fed_back = loop.parts(1j * w)
        return np.asarray(abs(drive + fed_back) / np.maximum(abs(drive), 1e-300))

    disk, at_disk = lowest(lambda w: disk_at(loop, w), omega)
    least, at_peak = lowest(inverse_sensitivity, omega)
    at = {"phase": at_phase, "delay": at_delay, "disk": at_disk, "peak_sensitivity": at_peak}
    places = {name: _held(where, PLACE_DIGITS) for name, where in at.items()}
    phase, delay, disk, peak = (_held(value, DIGITS) for value in (phase, delay, disk, max(1.0, 1.0 / least)))
    return LoopMargins(band, gain_margin(loop, band), phase, delay, disk, peak, places)


def _held(value: float, digits: int) -> float:
    """The value to the digits that hold: those after them are the rounding of L next to its poles."""
    return float(f"{value:.{digits}g}")


def disk_at(loop: Loop, omega: Real) -> Real:
    """2 |(1 + L)/(1 - L)| at i omega."""
    drive, fed_back = loop.parts(1j * omega)
    return np.asarray(2 * abs(drive + fed_back) / np.maximum(abs(drive - fed_back), 1e-300))


def dense(verdict: Stability) -> Real:
    """The grid of the arm and points about every oscillating pole of the loop, as close as it is to the axis.

    There |1 + L| dips, by as little damping as narrowly, and not where the arm's own functions are steep.
    """
    poles = verdict.poles.values[verdict.poles.values.imag > 0]
    away = np.concatenate([-NEAR_POLES[::-1], [0.0], NEAR_POLES])
    close = (poles.imag[:, None] + abs(poles.real[:, None]) * away).ravel()
    omega = np.asarray(grid(verdict.loop.arm, verdict.band))
    return np.unique(np.concatenate([omega, close[(close > omega[0]) & (close < omega[-1])]]))


def gain_margin(loop: Loop, band: float) -> tuple[float, float]:
    """The factors on all gains at once, below and above 1, at which a pole first reaches the axis."""
    law, arm, line = loop.law, loop.arm, Line(NONE, loop.law)
    if arm.link.damping == 0:
        static = crossing_at_zero(arm, line)
        factors = [1.0 / law.K2] if law.K2 > 0 else []
        factors += [] if static is None else [static.t]
    else:
        factors = [each.t for each in crossings(arm, line, band)]
    below = max((t for t in factors if 0 <= t < 1), default=0.0)
    return below, min((t for t in factors if t > 1), default=math.inf)


def unit_crossings(loop: Loop, omega: Real) -> Real:
    """Frequencies [rad/s] where |L(i w)| = 1."""
    if loop.law == NONE:
        return np.empty(0)

    def size(w: Real) -> Real:
        return np.asarray(np.log(abs(loop.loop_function(1j * w))))

    sign = np.sign(size(omega))
    (before,) = np.nonzero(sign[1:] * sign[:-1] < 0)
    low, high, start = omega[before], omega[before + 1], sign[before]
    for _ in range(BISECTIONS if before.size else 0):
        middle = (low + high) / 2
        left = np.sign(size(middle)) == start
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return np.asarray((low + high) / 2)


def lowest(f: Callable[[Real], Real], omega: Real) -> tuple[float, float]:
    """The least value of f over the grid's range and where, its lowest dips refined between grid points."""
    values = f(omega)
    dips = np.nonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:]))[0] + 1
    best = int(np.argmin(values))
    least, at = float(values[best]), float(omega[best])
    for i in dips[np.argsort(values[dips])][:LOWEST]:
        found = minimize_scalar(
            lambda w: float(f(np.array([w]))[0]), bounds=(omega[i - 1], omega[i + 1]), method="bounded"
        )
        if found.fun < least:
            least, at = float(found.fun), float(found.x)
    return least, at


def _least(values: Real, where: Real) -> tuple[float, float]:
    if not values.size:
        return math.inf, 0.0
    i = int(np.argmin(values))
    return float(values[i]), float(where[i])
