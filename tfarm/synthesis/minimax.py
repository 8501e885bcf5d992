"""The least of a largest: min over x of max_i f_i(x) where all g_j(x) < 0, each f and g smooth, with its gradient.

The largest of the dampings, or of the growths, of poles has an edge wherever two poles are alike, and the best is on
such edges.  First the quasi-Newton method of Broyden, Fletcher, Goldfarb and Shanno runs on max f + PRICE max(0, g),
with the slope of the one that is the largest and the weak Wolfe conditions: it goes down along edges although it knows
of none (Lewis and Overton, 2013).  Then all f and g are replaced by their tangents, and the linear programme in a box
about x is solved; the box grows where it foretold well, and shrinks where it did not (Madsen, 1975).  Neither finds
more than the minimum of its own valley, if that: several starts are for the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

Real = NDArray[np.float64]

LOST = 1e3  # score where the g are not below 0, and more the larger they are
PRICE, WITHIN = 100.0, 1e-5  # of a g above -WITHIN: tuned on the laws of all structures for the preset sasaki2012-lab
TURNS = 120  # steps of the first part
BEST = 2  # of the points that it comes to, the second part begins at
TRIES = 25  # trials of a step's length
EVERY, SLOW = 15, 1e-4  # turns after which so small a relative gain ends the first part
FIRST, FURTHEST = 0.3, 2.0  # the largest part of the first step, and of any
ARMIJO, WOLFE = 1e-4, 0.5  # of the slope: decrease that a step has to make, and slope that it may leave
STEPS = 40  # of the second part, at most
RADIUS, LEAST, LARGEST = 0.1, 1e-6, 2.0  # of the box: the first, where the search ends, and the most
GOOD, POOR = 0.75, 0.25  # of what was foretold: the box grows, or shrinks
GROW, SHRINK = 2.0, 0.3
KEPT = 0.05  # of the distance to g = 0 that a step leaves
GAIN = 1e-7  # relative: less is none


class Pieces(NamedTuple):
    """f (m,) and their slopes (m, n), g (k,) and theirs (k, n)."""

    values: Real
    slopes: Real
    growth: Real
    growth_slopes: Real

    @property
    def score(self) -> float:
        """The largest f, or `LOST` and more where a g is not below 0."""
        most = float(self.growth.max(initial=-np.inf))
        return LOST * (1.0 + min(most, 1e6)) if most >= 0.0 else float(self.values.max())

    def priced(self) -> tuple[float, Real]:
        """The largest f and the price of the largest g, and the slope of the sum."""
        i, j = int(self.values.argmax()), int(self.growth.argmax())
        over = float(self.growth[j]) + WITHIN
        if over <= 0.0:
            return float(self.values[i]), self.slopes[i]
        return float(self.values[i]) + PRICE * over, self.slopes[i] + PRICE * self.growth_slopes[j]


Function = Callable[[Real], Pieces]
Found = tuple[float, Real]  # score and point


def joined(parts: list[Pieces]) -> Pieces:
    """The functions of all together."""
    return Pieces(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def minimax(pieces: Function, starts: Sequence[Real], upper: Real, tell: Callable[[int, float], None]) -> list[Found]:
    """Scores and points x <= upper that the search from so many starts comes to, the lowest first.

    The best of them go on along tangents.  `tell` is told how many are done, and the lowest score.
    """
    found: list[Found] = []
    for n, start in enumerate(starts, 1):
        then = descended(pieces, start, upper)
        found += [(pieces(x).score, x) for x in (start, then)]
        tell(n, min(found, key=_first)[0])
    found += [along_tangents(pieces, x, upper) for _, x in sorted(found, key=_first)[:BEST]]
    return sorted(found, key=_first)


def _first(found: Found) -> float:
    return found[0]


def descended(pieces: Function, start: Real, upper: Real) -> Real:
    """Where the quasi-Newton search on the price ends."""

    def priced(x: Real) -> tuple[float, Real]:
        value, slope = pieces(np.minimum(x, upper)).priced()
        return value, np.where(x <= upper, slope, 0.0)

    x, inverse = np.minimum(start, upper), np.eye(start.size)
    value, slope = priced(x)
    before = np.inf
    for turn in range(TURNS):
        if turn % EVERY == 0:
            if before - value < SLOW * abs(value):
                break
            before = value
        step = -inverse @ slope
        step = step * min(1.0, (FURTHEST if turn else FIRST) / max(float(abs(step).max()), 1e-300))
        if not step @ slope < 0.0:
            break
        length, then, new = _weak_wolfe(priced, x, step, value, float(step @ slope))
        if not then < value:
            break
        step, change = length * step, new - slope
        x, value, slope = x + step, then, new
        if (turned := float(step @ change)) > 0.0:
            inverse = _updated(inverse if turn else inverse * turned / (change @ change), step, change, turned)
        if abs(step).max() < LEAST:
            break
    return np.asarray(np.minimum(x, upper))


def _weak_wolfe(
    priced: Callable[[Real], tuple[float, Real]], x: Real, step: Real, value: float, slope: float
) -> tuple[float, float, Real]:
    """A share of a step that goes down enough and leaves less of the slope; value and slope there."""
    low, high, share = 0.0, np.inf, 1.0
    for _ in range(TRIES):
        then, new = priced(x + share * step)
        if not then <= value + ARMIJO * share * slope:
            high = share
        elif new @ step < WOLFE * slope and share < FURTHEST / abs(step).max():
            low = share
        else:
            break
        share = (low + high) / 2 if np.isfinite(high) else 2 * share
    return share, then, new


def _updated(inverse: Real, step: Real, change: Real, turned: float) -> Real:
    """The inverse of the second derivatives that maps the change of slope onto the step."""
    left = np.eye(step.size) - np.outer(step, change) / turned
    return np.asarray(left @ inverse @ left.T + np.outer(step, step) / turned)


def along_tangents(pieces: Function, start: Real, upper: Real) -> tuple[float, Real]:
    """The score and the point that linear programmes over the tangents come to."""
    x, radius = start, RADIUS
    now = pieces(x)
    for _ in range(STEPS):
        step, foretold = _tangent_step(now, -radius, np.minimum(radius, upper - x))
        if foretold <= GAIN * abs(now.score):
            break
        then = pieces(x + step)
        share = (now.score - then.score) / foretold
        if share > 0.0:
            x, now = x + step, then
        radius = min(GROW * radius, LARGEST) if share > GOOD else radius * SHRINK if share < POOR else radius
        if radius < LEAST:
            break
    return now.score, x


def _tangent_step(now: Pieces, low: float, high: Real) -> tuple[Real, float]:
    """The step d of least max f + f' d in a box, with g + g' d <= KEPT g; and by how much it lowers the score.

    Where some g is not below 0, that of least max g + g' d.
    """
    lost = now.score >= LOST
    f, slopes = (now.growth, now.growth_slopes) if lost else (now.values, now.slopes)
    rows, right = np.c_[slopes, -np.ones(len(f))], -f
    if not lost:
        rows = np.r_[rows, np.c_[now.growth_slopes, np.zeros(len(now.growth))]]
        right = np.r_[right, (KEPT - 1.0) * now.growth]
    n = slopes.shape[1]
    bounds = [*((low, float(top)) for top in high), (None, None)]
    size = np.maximum(abs(rows[:, :n]).max(axis=1, initial=0.0), 1.0)
    rows, right, price = rows / size[:, None], right / size, np.r_[np.zeros(n), 1.0]
    done: Any = linprog(price, A_ub=rows, b_ub=right, bounds=bounds, method="highs")
    if done.status != 0:
        return np.zeros(n), 0.0
    return np.asarray(done.x[:n]), (float(f.max()) - float(done.x[n])) * (LOST if lost else 1.0)
