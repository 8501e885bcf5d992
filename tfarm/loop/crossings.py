"""Where branches of a locus cross the imaginary axis: solved for gain and frequency together, not interpolated.

Along a number of the law in which D is linear D-decomposition has every crossing (`tfarm.crossing`); each is that of
the branch that changes sides there, or of a pole on none.  Along another number the branch is followed to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

from tfarm.arrays import Complex, Real
from tfarm.crossing import Crossing, crossed
from tfarm.errors import ConvergenceError
from tfarm.response.frequency import AXIS_SHARE

from .family import line_crossings
from .frequencies import grid
from .varied import Varied

AT_ORIGIN = 1e-9  # of the largest of its branch: a pole so near to 0 is there but for the last step of its correction
SAME_CROSSING = 1e-3  # of the highest frequency: so near is a crossing of a branch to where its points say that it is
AT_END = 1e-9  # of the range: a crossing so near to an end is at the end, and not between
GAIN_KNOWN = 1e-15  # of the larger end of a step: the value at which a branch crosses
JUST_ABOVE = 1.01  # times the highest frequency of a branch: between two values it may be higher
STEP = 1e-6  # of a frequency, for a difference
CROSSINGS_SHOWN = 3  # of a locus in words


@dataclass(frozen=True, slots=True, kw_only=True)
class BranchCrossing:
    """One branch of a locus crosses the imaginary axis at s = i `omega` [rad/s], where what varies is `gain`.

    `omega` is 0 or infinite where a real pole goes through the origin or through infinity.  `branch` is its number in
    the locus, None for a pole on none of them, or between two points; `direction` is "unstable" where the real part
    becomes positive as the locus runs, and "stable" where it becomes negative.
    """

    gain: float
    omega: float
    branch: int | None
    direction: str

    @property
    def frequency_hz(self) -> float:
        """omega in Hz."""
        return self.omega / (2 * math.pi)


def in_words(vary: str, crossings: Sequence[BranchCrossing]) -> str:
    """Where poles cross the imaginary axis as one number varies, the first `CROSSINGS_SHOWN` of them."""
    if not crossings:
        return "no branch crosses the imaginary axis"
    first = ", ".join(f"{each.direction} at {vary} = {each.gain:.6g}" for each in crossings[:CROSSINGS_SHOWN])
    more = len(crossings) - CROSSINGS_SHOWN
    return f"a pole becomes {first}{f' and {more} more' if more > 0 else ''}"


def crossing_answers(found: Iterable[BranchCrossing]) -> list[dict[str, Any]]:
    """The crossings as plain dictionaries."""
    return [
        {
            "gain": each.gain,
            "omega_rad_s": each.omega,
            "frequency_hz": each.frequency_hz,
            "branch": each.branch,
            "direction": each.direction,
        }
        for each in found
    ]


def branch_crossings(family: Varied, gain: Real, branches: Complex, top: float) -> tuple[BranchCrossing, ...]:
    """Return the crossings of the imaginary axis in the order in which they come.

    Of a damped rig along a number of its law those of poles on no branch too, up to `top` [rad/s].
    """
    sign, span = float(np.sign(gain[-1] - gain[0])), abs(float(gain[-1] - gain[0]))
    changes, is_damped = _changes(branches), not family.is_reactive
    band = max(top, JUST_ABOVE * float(np.nanmax(branches.imag, initial=0.0)))
    known = _on_line(family, gain, band) if changes or is_damped else []
    found: list[BranchCrossing] = []
    for number, low, high in changes:
        ends, points = gain[[low, high]], branches[number, [low, high]]
        at, omega = _crossed(family, ends, points, known, top)
        direction = "unstable" if points[1].real > points[0].real else "stable"
        found.append(BranchCrossing(gain=at, omega=omega, branch=number, direction=direction))
    seen = {(each.gain, each.omega) for each in found}
    for t, omega, change in known if is_damped else ():
        is_between = AT_END * span < sign * (t - float(gain[0])) < (1 - AT_END) * span
        if is_between and not top < omega < math.inf and (t, omega) not in seen:
            direction = "unstable" if sign * change > 0 else "stable"
            found.append(BranchCrossing(gain=t, omega=omega, branch=None, direction=direction))
    return tuple(sorted(found, key=lambda each: (sign * each.gain, each.omega)))


def _on_line(family: Varied, gain: Real, top: float) -> list[Crossing]:
    """The crossings by D-decomposition where D is linear in the number; else none."""
    if family.is_of_arm or family.vary == "delay":
        return []
    loop = family.first.under(family.full)
    if family.is_reactive:
        t, at, change = crossed(np.asarray(grid(loop.arm, top)), family.on_axis)
        return [Crossing(*each) for each in zip(_corrected(family, t, at), at, change, strict=True)]
    name = "gain" if family.vary == "all" else family.vary
    return list(line_crossings(loop, name, float(gain.min()), float(gain.max()), top))


def _corrected(family: Varied, t: Real, at: Real) -> Real:
    """The gains for what a frequency is off in its last bit, by a step of Newton's method for both.

    Of D + B dt + D' dw = 0 the part across D' is one for dt alone.
    """
    (A, B), (after, by_after), (before, by_before) = (family.on_axis(at * (1 + d)) for d in (0.0, STEP, -STEP))
    slope = (after + t * by_after) - (before + t * by_before)
    with np.errstate(all="ignore"):
        return np.asarray(t - ((A + t * B) * slope.conj()).imag / (B * slope.conj()).imag)


def _changes(branches: Complex) -> list[tuple[int, int, int]]:
    """Each branch that changes sides with the numbers of its last value before and the first after.

    Points on the axis are left out; one of them that is at i w becomes a real one off it, too.  A mirror image is not
    listed.
    """
    size = abs(branches)
    largest = np.nanmax(np.where(np.isnan(size), 0.0, size), axis=1)[:, None]
    on_axis = (abs(branches.real) <= AXIS_SHARE * size) | (size <= AT_ORIGIN * largest)
    side = np.where(on_axis | np.isnan(branches), 0, np.sign(branches.real)).astype(int)
    found = []
    for number, (sides, poles) in enumerate(zip(side, branches, strict=True)):
        across = [(a, b) for a, b in pairwise(np.flatnonzero(sides)) if sides[a] != sides[b]]
        left = np.flatnonzero((sides[:-1] == 0) & (sides[1:] != 0))
        away = [(n, n + 1) for n in left if poles[n].imag > 0 == poles[n + 1].imag]
        listed = [(int(a), int(b)) for a, b in sorted({*across, *away}) if poles[a].imag >= 0 <= poles[b].imag]
        found += [(number, a, b) for a, b in listed if not np.isnan(poles[a : b + 1]).any()]
    return found


def _crossed(family: Varied, ends: Real, points: Complex, known: Sequence[Crossing], top: float) -> tuple[float, float]:
    """The value between two at which a branch is on the axis, and the frequency there."""
    low, high = sorted(ends.tolist())
    omegas = sorted(abs(points.imag).tolist())
    wide = SAME_CROSSING * top + (omegas[1] - omegas[0])
    near = [each for each in known if low <= each.t <= high and omegas[0] - wide <= each.at <= omegas[1] + wide]
    if near:
        share = points.real[0] / (points.real[0] - points.real[1])
        best = min(near, key=lambda each: abs(each.at - abs((points[0] + share * (points[1] - points[0])).imag)))
        return best.t, best.at
    tolerance = GAIN_KNOWN * max(abs(low), abs(high))
    if not points.imag.all() and family.at_rest(low) * family.at_rest(high) <= 0:
        return float(brentq(family.at_rest, low, high, xtol=tolerance)), 0.0

    def pole(value: float) -> complex:
        share = (value - ends[0]) / (ends[1] - ends[0])
        found = family.near(np.array([value]), np.array([[points[0] + share * (points[1] - points[0])]]))[0, 0]
        if np.isnan(found):
            text = f"a crossing of the imaginary axis near {family.vary} = {value:.6g} could not be solved for"
            raise ConvergenceError(text, value, found)
        return complex(found)

    at = float(brentq(lambda value: pole(value).real, low, high, xtol=tolerance))
    return at, abs(pole(at).imag)
