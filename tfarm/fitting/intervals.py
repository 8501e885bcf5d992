"""Intervals of the numbers of a fit, and the directions that the data do not determine.

An interval is by the covariance of the linearised residuals, or by the profile of the likelihood: its ends are where
the least sum of squares, with the number held, has grown by the square of the quantile.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tfarm.arm.schema import file_key
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.fitting.model import Parameter
from tfarm.fitting.solve import (
    OPEN_DEVIATION,
    Solution,
    nearest_minimum,
    open_axes,
    principal_axes,
    sum_of_squares,
)
from tfarm.records import frozen
from tfarm.schema import Quantity
from tfarm.stopping import Progress


@frozen(kw_only=True)
class Fitted:
    """A fitted number: `value` in SI units, the ends of its 95 % interval, its standard deviation by the covariance.

    A number that the data do not determine has no interval.
    """

    label: Annotated[str, Quantity("number", help="name and symbol of the fitted number")]
    key: Annotated[
        str, Quantity("key", help="key of the number in the arm's file, or the sensor's gain or delay")
    ]
    unit: Annotated[str, Quantity("unit", help="SI unit of the number")]
    value: Annotated[float, Quantity("value", help="best value")]
    low: Annotated[
        float | None,
        Quantity(
            "95 % interval from", help="lower end of the interval; none where the data set no lower bound"
        ),
    ]
    high: Annotated[
        float | None, Quantity("to", help="upper end of the interval; none where the data set no upper bound")
    ]
    deviation: Annotated[
        float | None,
        Quantity(
            "standard deviation", digits=3, key="std", help="by the covariance of the linearised residuals"
        ),
    ]
    identified: Annotated[
        bool, Quantity("identified", help="whether the data bound the number on both sides")
    ]
    start: Annotated[float, Quantity(help="value at which the search began")]


class BetterError(Exception):
    """A profile has come to a lower sum of squares than the best: its argument is the solution there."""


def confidence_intervals(
    found: Solution, *, profile: bool, progress: Progress | None = None
) -> tuple[tuple[Fitted, ...], tuple[str, ...]]:
    """Return a solution's numbers with their intervals, and what is not determined, in words.

    The intervals are by profiles, or by the covariance where these are not asked for.
    Along an open axis nothing changes, so one number of it is held while the others are profiled.  A number that the
    data bound on one side is free meanwhile, in another coordinate (`at_bounds`).  `progress` gets
    (done, total, key) before each.  Raises BetterError where a profile comes to a lower sum than the solution's.
    """
    quantile = found.quantile
    before = found.problem.parameters
    found, bounds = at_bounds(found, quantile)
    parameters = found.problem.parameters
    sizes, axes = principal_axes(found.jacobian)
    is_known = sizes >= 1.0 / OPEN_DEVIATION
    deviations = np.linalg.norm(axes[is_known] / sizes[is_known, None], axis=0).tolist()
    unknown = axes[~is_known]
    # of a unit vector: a smaller component has no part in it
    part = abs(unknown) > 0.1
    largest = abs(unknown).argmax(axis=1).tolist()
    held = {n: float(found.point[n]) for n in largest}
    keys = [each.key for each in parameters]
    words = [
        "" if of.sum() == 1 and n in bounds else describe_axis(axis, of, keys)
        for axis, of, n in zip(unknown, part, largest, strict=True)
    ]
    lowest, highest = found.problem.bounds
    fitted = []
    for n, each in enumerate(parameters):
        if progress is not None:
            progress(n, len(parameters), f"interval of {each.key}")
        low = high = deviation = None
        point = float(found.point[n])
        value = each.value(point)
        own = deviations[n]
        if not part[:, n].any():
            reach = quantile * own
            ends = np.clip([point - reach, point + reach], lowest[n], highest[n]).tolist()
            if profile:
                ends = [profile_end(found, n, end, quantile, held) for end in ends]
            if n in bounds:
                low, high = bounded_ends(before[n], each, ends, bounds[n])
            else:
                low, high = each.ends(ends)
                deviation = own * (each.size or abs(value))
        elif n in bounds:
            low, high = bounds[n]
        of = file_key(each.key)
        fitted.append(
            Fitted(
                label=of.label,
                key=each.key,
                unit=of.unit or "1",
                value=value,
                low=low,
                high=high,
                deviation=deviation,
                identified=None not in (low, high),
                start=before[n].start,
            )
        )
        if (low is None) != (high is None):
            end = f"at most {high:.4g}" if low is None else f"at least {low:.4g}"
            words.append(f"{each.key} is {end}: one-sided bound")
    return tuple(fitted), tuple(word for word in words if word)


def at_bounds(found: Solution, quantile: float) -> tuple[Solution, dict[int, tuple[float, float | None]]]:
    """Return the solution with numbers that the data bound on one side alone in other coordinates, and their bounds.

    The logarithm of a number without effect where it is has no end, and the intervals of others, with it held, are too
    narrow.  The residuals are nearly linear in p itself where a larger one matters, and in 1/p where a smaller one
    does: so that is its coordinate, over the bound.
    """
    unknown = open_axes(found.jacobian)
    is_single = (abs(unknown) > 0.1).sum(axis=1) == 1
    parameters = [*found.problem.parameters]
    point = found.point.copy()
    jacobian = found.jacobian.copy()
    bounds: dict[int, tuple[float, float | None]] = {}
    for n in abs(unknown[is_single]).argmax(axis=1).tolist():
        low, high = one_sided_interval(found, n, quantile)
        if low is None:
            continue
        bounds[n] = low, high
        each = parameters[n]
        value = each.value(point[n])
        reach = [each.value(at) for at in each.bounds]
        size = 1.0 / low if high is None else high
        slope = jacobian[:, n] * (-value * size if high is None else size / value)
        others = np.delete(jacobian, n, axis=1)
        # deviations by a step of that size which no other number makes up: less than two would leave it open
        effect = float(np.linalg.norm(slope - others @ np.linalg.lstsq(others, slope)[0]))
        wider = max(1.0, 2.0 / max(effect, LEAST_SIZE))
        jacobian[:, n] = wider * slope
        size *= wider
        parameters[n] = replace(
            each, start=value, low=reach[0], high=reach[1], size=size, is_inverse=high is None
        )
        point[n] = 0.0
    problem = replace(found.problem, parameters=tuple(parameters))
    return replace(found, problem=problem, point=point, jacobian=jacobian), bounds


def bounded_ends(
    before: Parameter, each: Parameter, ends: Sequence[float], alone: tuple[float, float | None]
) -> tuple[float | None, float | None]:
    """Return the interval of a number between two coordinates, and that with the others held, together.

    Where it ends only as the search does, the number's own bound, or None, is its end.
    """
    low, high = sorted(map(each.value, ends))
    # of a number: one so near to the reach of the search has ended there
    near = 1e-6
    lower = min(alone[0], low if low > each.low * (1 + near) else before.low)
    upper = max(alone[1] or math.inf, high if high < each.high * (1 - near) else before.high)
    if lower == 0 and math.isinf(upper):
        return None, None
    return lower, None if math.isinf(upper) else upper


def one_sided_interval(found: Solution, n: int, quantile: float) -> tuple[float | None, float | None]:
    """Return the interval of a number that has no effect where it is, but would if it were larger, or smaller.

    A payload of next to nothing has an upper bound, a clamp that is all but rigid a lower one; None, None where there
    is neither.  The others are held: with them free the bound is farther by no more than a factor.
    """
    each = found.problem.parameters[n]
    if each.size or each.start < 0:
        return None, None
    low, high = (each[n] for each in found.problem.bounds)
    own = found.point[n]
    along = np.eye(found.point.size)[n]
    best = found.chi_squared

    def excess(at: float) -> float:
        return sum_of_squares(found.problem, found.point + (at - own) * along) - best - quantile**2

    def end(way: int) -> float | None:
        # of ln p: where a number that does not matter is tried
        steps = (own + way * reach for reach in (0.5, 1.0, 2.0, 4.0, 6.0, 9.0))
        beyond = next((at for at in steps if low <= at <= high and excess(at) > 0), None)
        if beyond is None:
            return None
        return each.value(float(brentq(excess, own, beyond, xtol=1e-4)))

    lower = end(-1)
    upper = end(1)
    if lower is None and upper is None:
        return None, None
    return lower or 0.0, upper


def profile_end(found: Solution, n: int, at: float, quantile: float, held: dict[int, float]) -> float:
    """Return where the least sum with coordinate n held has grown by quantile^2, on the side of the best of `at`.

    The root of that growth is nearly linear in the coordinate, so a secant finds it in two or three steps.
    """
    low, high = (each[n] for each in found.problem.bounds)
    rest = [m for m in range(found.point.size) if m != n and m not in held]
    # of the others where n is held elsewhere
    slope = np.eye(found.point.size)[n]
    slope[rest] = -np.linalg.lstsq(found.jacobian[:, rest], found.jacobian[:, n], rcond=None)[0]
    own = near = inside = found.point[n]
    outside = math.inf if at > own else -math.inf
    root_near = 0.0
    # of a run's sum of squares: a part in 1,000 of what a deviation adds
    change = 1e-3 / found.chi_squared if found.problem.runs else 1e-9
    # three steps do but in a crooked valley
    for _ in range(12):
        at = np.clip(at, low, high)
        start = found.point + slope * (at - own)
        there = nearest_minimum(found.problem, start, held | {n: at}, change=change)
        growth = there.chi_squared - found.chi_squared
        # of a sum of squares: a profile that falls by more has left the valley of the best
        if growth < -0.05:
            raise BetterError(there)
        root = math.sqrt(max(growth, 0.0))
        # of a deviation: there the profile has reached its level
        is_bound = at in (low, high) and root < quantile
        if is_bound or abs(root - quantile) < 0.01:
            return float(at)
        last = at - near
        # of the last step: no farther than three of it
        times = 2.0
        if root != root_near:
            times = np.clip((quantile - root) / (root - root_near), -3, 3)
        near = at
        root_near = root
        if root < quantile:
            inside = at
        else:
            outside = at
        at = at + times * last
        # a profile that is not monotonic ends between what is inside and what is outside
        if not min(inside, outside) < at < max(inside, outside):
            at = (inside + outside) / 2 if math.isfinite(outside) else 2 * inside - own
    return float(at)


def describe_axis(axis: Real, has_part: NDArray[np.bool_], keys: Sequence[str]) -> str:
    """Return a direction along which nothing changes, in words; of two numbers, the combination that is known."""
    order = np.argsort(-abs(axis))
    part = order[has_part[order]]
    names = [keys[n] for n in part]
    shares = axis[part] / abs(axis[part[0]])
    if len(part) == 1:
        return f"{names[0]} is not determined by these data"
    if len(part) == 2:
        # first * second^power does not change along the axis
        power = -shares[0] / shares[1]
        # one so near to 1 is written as 1
        exponent = "" if abs(abs(power) - 1) < 0.02 else f"^{abs(power):.3g}"
        known = f"{names[0]} {'*' if power > 0 else '/'} {names[1]}{exponent}"
        return f"{' and '.join(names)} are not determined by these data: only {known} is"
    words = ", ".join(f"{name} {share:+.3g} %" for name, share in zip(names, shares, strict=True))
    return f"not determined by these data: {words} together change nothing"
