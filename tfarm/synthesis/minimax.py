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
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linprog

from tfarm.arrays import LEAST_SIZE, Real

LOST = 1e3  # score where the g are not below 0, and more the larger they are
PRICE = 100.0  # of a g above -WITHIN: tuned on the laws of all structures for the preset sasaki2012-lab
WITHIN = 1e-5  # below 0, so that what is found holds: tuned with it
# The others are customary, or were chosen by hand.
TURNS = 120  # steps of the first part
GO_ON = 3  # of the points that it comes to, the second part begins at
LENGTHS_TRIED = 25  # trials of a step's length
TURNS_A_CHECK = 15  # turns after which a gain below LEAST_PROGRESS ends the first part
LEAST_PROGRESS = 1e-4  # relative
FIRST_MOVE = 0.3  # of x: the largest part of the first step
LONGEST_MOVE = 2.0  # of any step
ARMIJO = 1e-4  # of the slope: the decrease that a step has to make
WOLFE = 0.5  # of the slope that a step may leave
TANGENT_STEPS = 40  # of the second part, at most
FIRST_RADIUS = 0.1  # of its first box, in x
LEAST_RADIUS = 1e-6  # of the box, where the search ends
LARGEST_RADIUS = 2.0  # of any box
FORETOLD_WELL = 0.75  # of what was foretold: from there on the box grows
FORETOLD_BADLY = 0.25  # and below it shrinks
RADIUS_GROWS = 2.0  # times
RADIUS_SHRINKS = 0.3  # times
GROWTH_KEPT = 0.05  # of the distance to g = 0 that a step leaves
LEAST_GAIN = 1e-7  # relative: less is none


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


PiecesAt = Callable[[Real], Pieces]
ScoredPoint = tuple[float, Real]  # score and point
Box = tuple[Real, Real]  # the least and the largest x (n,)


def minimax(
    pieces: PiecesAt, starts: Sequence[Real], box: Box, tell: Callable[[int, float], None]
) -> list[ScoredPoint]:
    """Scores and points x in a box that the search comes to, one from each of the starts, the lowest first.

    The best of them go on along tangents.  `tell` is called with how many are done, and the lowest score.
    """
    found: list[ScoredPoint] = []
    for n, start in enumerate(starts, 1):
        ends = [(pieces(x).score, x) for x in (np.clip(start, *box), descended(pieces, start, box))]
        found.append(min(ends, key=itemgetter(0)))
        tell(n, min(found, key=itemgetter(0))[0])
    found.sort(key=itemgetter(0))
    found[:GO_ON] = [along_tangents(pieces, x, box) for _, x in found[:GO_ON]]
    return sorted(found, key=itemgetter(0))


def descended(pieces: PiecesAt, start: Real, box: Box) -> Real:
    """Where the quasi-Newton search on the price ends."""

    def priced(x: Real) -> tuple[float, Real]:
        inside = np.clip(x, *box)
        value, slope = pieces(inside).priced()
        return value, np.where(x == inside, slope, 0.0)

    x, inverse = np.clip(start, *box), np.eye(start.size)
    value, slope = priced(x)
    before = np.inf
    for turn in range(TURNS):
        if turn % TURNS_A_CHECK == 0:
            if before - value < LEAST_PROGRESS * abs(value):
                break
            before = value
        step = -inverse @ slope
        step = step * min(1.0, (LONGEST_MOVE if turn else FIRST_MOVE) / max(float(abs(step).max()), LEAST_SIZE))
        if not step @ slope < 0.0:
            break
        length, then, new = _weak_wolfe(priced, x, step, value, float(step @ slope))
        if not then < value:
            break
        step, change = length * step, new - slope
        x, value, slope = x + step, then, new
        if (turned := float(step @ change)) > 0.0:  # so that the inverse maps the change of slope onto the step
            inverse = inverse if turn else inverse * turned / (change @ change)
            left = np.eye(step.size) - np.outer(step, change) / turned
            inverse = left @ inverse @ left.T + np.outer(step, step) / turned
        if abs(step).max() < LEAST_RADIUS:
            break
    return np.asarray(np.clip(x, *box))


def _weak_wolfe(
    priced: Callable[[Real], tuple[float, Real]], x: Real, step: Real, value: float, slope: float
) -> tuple[float, float, Real]:
    """A share of a step that goes down enough and leaves less of the slope; value and slope there."""
    low, high, share = 0.0, np.inf, 1.0
    for _ in range(LENGTHS_TRIED):
        then, new = priced(x + share * step)
        if not then <= value + ARMIJO * share * slope:
            high = share
        elif new @ step < WOLFE * slope and share < LONGEST_MOVE / abs(step).max():
            low = share
        else:
            break
        share = (low + high) / 2 if np.isfinite(high) else 2 * share
    return share, then, new


def along_tangents(pieces: PiecesAt, start: Real, box: Box) -> tuple[float, Real]:
    """The score and the point that linear programmes over the tangents come to."""
    x, radius = start, FIRST_RADIUS
    now = pieces(x)
    for _ in range(TANGENT_STEPS):
        step, foretold = _tangent_step(now, np.maximum(-radius, box[0] - x), np.minimum(radius, box[1] - x))
        if foretold <= LEAST_GAIN * abs(now.score):
            break
        then = pieces(x + step)
        share = (now.score - then.score) / foretold
        if share > 0.0:
            x, now = x + step, then
        if share > FORETOLD_WELL:
            radius = min(RADIUS_GROWS * radius, LARGEST_RADIUS)
        elif share < FORETOLD_BADLY:
            radius *= RADIUS_SHRINKS
        if radius < LEAST_RADIUS:
            break
    return now.score, x


def _tangent_step(now: Pieces, low: Real, high: Real) -> tuple[Real, float]:
    """The step d of least max f + f' d in a box, with g + g' d <= GROWTH_KEPT g; and by how much it lowers the score.

    Where some g is not below 0, that of least max g + g' d.
    """
    lost = now.score >= LOST
    f, slopes = (now.growth, now.growth_slopes) if lost else (now.values, now.slopes)
    rows, right = np.c_[slopes, -np.ones(len(f))], -f
    if not lost:
        rows = np.r_[rows, np.c_[now.growth_slopes, np.zeros(len(now.growth))]]
        right = np.r_[right, (GROWTH_KEPT - 1.0) * now.growth]
    n = slopes.shape[1]
    bounds = [*zip(low.tolist(), high.tolist(), strict=True), (None, None)]
    size = np.maximum(abs(rows[:, :n]).max(axis=1, initial=0.0), 1.0)
    rows, right, price = rows / size[:, None], right / size, np.r_[np.zeros(n), 1.0]
    done: Any = linprog(price, A_ub=rows, b_ub=right, bounds=bounds, method="highs")
    if done.status != 0:
        return np.zeros(n), 0.0
    return np.asarray(done.x[:n]), (float(f.max()) - float(done.x[n])) * (LOST if lost else 1.0)
