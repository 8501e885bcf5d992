"""How sure a fit is: covariance, what the data do not determine, and intervals by the profile of the likelihood."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from tfarm.arrays import Real
from tfarm.records import record

from .solve import OPEN_DEVIATION, Solution, nearest_minimum, principal_axes

ToldInterval = Callable[[int, int, str], object]

TAKES_PART = 0.1  # of a unit vector: a smaller component has no part in it
ROUND = 0.02  # a power so near to 1 is written as 1
LEVEL_REACHED = 0.01  # of a deviation: where a profile has reached its level
BETTER = 0.05  # of a sum of squares: a profile that falls by more has left the valley of the best
SECANT_STEPS = 12  # steps of the secant: three do but in a crooked valley
REACHES = (0.5, 1.0, 2.0, 4.0, 6.0, 9.0)  # of ln p: where a number that does not matter is tried


@dataclass(frozen=True, kw_only=True)
@record
class Fitted:
    """A fitted number: `value` in SI units, the ends of its 95 % interval, its standard deviation by the covariance.

    What the data do not determine has no interval.
    """

    key: str
    value: float
    low: float | None
    high: float | None
    deviation: float | None
    identified: bool

    @property
    def half_known(self) -> str:
        """What is known of a number whose interval has one end, in words; nothing of others."""
        if (self.low is None) == (self.high is None):
            return ""
        side = f"at least {self.low:.4g}" if self.high is None else f"at most {self.high:.4g}"
        return f"{self.key} is {side}: these data say no more"


class BetterError(Exception):
    """A profile has come to a lower sum of squares than the best: carries where."""

    def __init__(self, found: Solution) -> None:
        super().__init__(found)
        self.found = found


def sureness(
    found: Solution, *, profile: bool, progress: ToldInterval | None = None
) -> tuple[tuple[Fitted, ...], tuple[str, ...]]:
    """A solution's numbers with their intervals, and what is not determined, in words.

    The intervals are by profiles, or by the covariance where these are not asked for.
    Along an open axis nothing changes, so one number of it is held while the others are profiled.  `progress` is told
    (done, total, key) before each.  Raises BetterError where a profile comes to a lower sum than the solution's.
    """
    sizes, axes = principal_axes(found.jacobian)
    is_open = sizes < 1.0 / OPEN_DEVIATION
    covariance = (axes[~is_open].T / sizes[~is_open] ** 2) @ axes[~is_open]
    unsure: list[bool] = np.any(abs(axes[is_open]) > TAKES_PART, axis=0).tolist()
    held = {int(abs(axis).argmax()): float(found.point[abs(axis).argmax()]) for axis in axes[is_open]}
    quantile = found.quantile
    fitted, words = [], [_said(axis, [each.key for each in found.problem.parameters]) for axis in axes[is_open]]
    alone = {int(abs(axis).argmax()): n for n, axis in enumerate(axes[is_open]) if (abs(axis) > TAKES_PART).sum() == 1}
    for n, each in enumerate(found.problem.parameters):
        if progress is not None:
            progress(n, len(found.problem.parameters), f"interval of {each.key}")
        value, slope = each.value(float(found.point[n])), abs(each.slope(float(found.point[n])))
        low = high = deviation = None
        if not unsure[n]:
            deviation = math.sqrt(covariance[n, n])
            ends = [found.point[n] - quantile * deviation, found.point[n] + quantile * deviation]
            if profile:
                ends = [_end(found, n, way, deviation, quantile, held) for way in (-1, 1)]
            low, high = sorted(each.value(float(end)) for end in ends)
            low, high = each.known_ends(ends, (low, high))
        elif n in alone and (side := _one_sided(found, n, quantile)) is not None:
            low, high = side
            words[alone[n]] = ""
        fitted.append(
            Fitted(
                key=each.key, value=value, low=low, high=high, identified=low is not None and high is not None,
                deviation=None if deviation is None else slope * deviation,
            )
        )  # fmt: skip
    words += [each.half_known for each in fitted]
    return tuple(fitted), tuple(word for word in words if word)


def _one_sided(found: Solution, n: int, quantile: float) -> tuple[float, float | None] | None:
    """The interval of a number that does not matter where it is, but would if it were larger, or smaller.

    A payload of next to nothing is at most so heavy, a clamp that is all but rigid at least so stiff.  The others are
    held: what they could take back is no more than a factor of the end.
    """
    each, limits = found.problem.parameters[n], (found.problem.bounds[0][n], found.problem.bounds[1][n])
    if not each.by_logarithm:
        return None

    def excess(at: float) -> float:
        point = found.point.copy()
        point[n] = at
        residuals = found.problem.residuals(point)
        return float(residuals @ residuals) - found.chi_squared - quantile**2

    ends: list[float | None] = []
    for way in (-1, 1):
        steps = (found.point[n] + way * reach for reach in REACHES)
        inside = [float(at) for at in steps if limits[0] <= at <= limits[1]]
        beyond = next((at for at in inside if excess(at) > 0), None)
        ends.append(None if beyond is None else float(brentq(excess, found.point[n], beyond, xtol=1e-4)))
    if ends == [None, None]:
        return None
    low, high = ends
    return 0.0 if low is None else each.value(low), None if high is None else each.value(high)


def _end(found: Solution, n: int, way: int, deviation: float, quantile: float, held: dict[int, float]) -> float:
    """Where the least sum of squares with coordinate n held has grown by quantile^2, on one side of the best.

    The root of that growth is nearly linear in the coordinate, so a secant finds it in two or three steps.
    """
    low, high = found.problem.bounds[0][n], found.problem.bounds[1][n]
    rest = [m for m in range(found.point.size) if m != n and m not in held]
    slope = np.zeros(found.point.size)  # of the others where n is held elsewhere
    slope[rest] = -np.linalg.lstsq(found.jacobian[:, rest], found.jacobian[:, n], rcond=None)[0]
    slope[n] = 1.0
    near, root_near = float(found.point[n]), 0.0
    at = near + way * quantile * deviation
    for _ in range(SECANT_STEPS):
        at = float(np.clip(at, low, high))
        start = found.point + slope * (at - found.point[n])
        there = nearest_minimum(found.problem, start, held | {n: at})
        growth = there.chi_squared - found.chi_squared
        if growth < -BETTER:
            raise BetterError(there)
        root = math.sqrt(max(growth, 0.0))
        if abs(root - quantile) < LEVEL_REACHED or (at in (low, high) and root < quantile):
            return at
        step = (quantile - root) * (at - near) / (root - root_near) if root != root_near else 2 * (at - near)
        near, root_near, at = at, root, at + float(np.clip(step, -3 * abs(at - near), 3 * abs(at - near)))
    return at


def _said(axis: Real, keys: Sequence[str]) -> str:
    """A direction along which nothing changes, in words; of two numbers, the combination that is known instead."""
    part = [n for n in np.argsort(-abs(axis)) if abs(axis[n]) > TAKES_PART]
    names = [keys[n] for n in part]
    if len(part) == 1:
        return f"{names[0]} is not determined by these data"
    if len(part) == 2:
        power = -axis[part[0]] / axis[part[1]]  # first * second^power does not change along the axis
        known = f"{names[0]} {'*' if power > 0 else '/'} {names[1]}"
        known += "" if abs(abs(power) - 1) < ROUND else f"^{abs(power):.3g}"
        return f"{names[0]} and {names[1]} are not determined by these data: only {known} is"
    shares = ", ".join(f"{name} {axis[n] / abs(axis[part[0]]):+.3g} %" for name, n in zip(names, part, strict=True))
    return f"not determined by these data: {shares} together change nothing"
