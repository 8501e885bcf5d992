"""Search for the best law: many points of the bounds, strategies from the best of them, and wider bounds.

The points are those of Sobol's sequence, which leaves no large gap (Sobol, 1967).  Evolution strategies start from the
best of them, at a distance from each other (`evolution`), and then from points near the best.  They may leave bounds
that are neither given nor physical ends; where the best law is beyond a bound, that of the wider region is returned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.records import record
from tfarm.synthesis.evolution import MOST_ROUNDS, evolved
from tfarm.synthesis.judge import LOST, Judge
from tfarm.synthesis.structures import Bounds, Structure
from tfarm.synthesis.worst_case import Tell

POINTS_LOG2 = 11  # of the number of points
STARTS_EACH = 12  # strategies for each coefficient, from the best of them
HOPS, HOPS_EACH, HOP_POINTS = 1, 8, 1024  # searches near the best of more than two, strategies each, and points
CANDIDATES = 4  # laws for the exact verdicts, the best first
BEYOND = 4.0  # of x: reach of a search beyond its bounds, a factor e^4 of a coefficient far above its unit
APART = 0.02  # of the range of x: least distance of two starts
AS_GOOD = 1e-4  # relative: a coefficient is at its physical end if the score there is worse by less
SEED = 0  # of the sequence's scrambling, and of points near the best
AGREES = 5e-3  # relative: a strategy agrees if its score is worse than the best by less
FLAT_WITHIN = 0.01  # laws whose score is worse by less than this share bound the flat part
FLAT_STEPS, FLAT_HALVINGS = 60, 30  # of the way to the bounds, each 1.4 times the one before; of an interval
AT_ORIGIN = 1e-9  # of that way: the first step


@dataclass(frozen=True)
@record
class Search:
    """Result of a search: points and scores, the lowest first; the structure with the searched bounds.

    Of `starts` strategies `agreed` reached the best score; `widened` names coefficients.
    """

    form: Structure
    found: list[tuple[float, Real]]
    starts: int
    agreed: int
    widened: tuple[str, ...]


@dataclass(frozen=True)
@record
class Worst:
    """The judges of several arms as one: the largest of their scores."""

    judges: tuple[Judge, ...]

    def scores(self, form: Structure, x: Real) -> Real:
        """The function to be minimised, at points x (n, laws); arms after one with an unstable loop are left out."""
        worst = self.judges[0].scores(form, x)
        for judge in self.judges[1:]:
            stable = worst < LOST
            if stable.any():
                worst[stable] = np.maximum(worst[stable], judge.scores(form, x[:, stable]))
        return worst


def search(judge: Worst, form: Structure, tell: Tell) -> Search:
    """Return the best laws of a structure near its bounds, which are widened where the best lies beyond."""
    given = [each.name in form.given for each in form.free]
    ends = [(place, end) for place in range(form.size) for end in (0, 1)]
    places = [each for each in ends if not (given[each[0]] or form.is_physical(*each))]
    region = form.wider(places, BEYOND)
    points = np.c_[form.origin, sobol(*form.box, POINTS_LOG2)]

    def report(number: int, score: float) -> None:
        tell(f"{form.name}: round {number} of {MOST_ROUNDS}, best so far {score:.6g}")

    def best_from(points: Real, each: int) -> tuple[Real, Real]:
        first = points[:, _apart(region, points, judge.scores(region, points), each * form.size)]
        return evolved(lambda at: judge.scores(region, at), first, region.box, report)

    x, scores = best_from(points, STARTS_EACH)
    rng = np.random.default_rng(SEED)
    for _ in range(HOPS if form.size > 2 else 0):
        around = x[:, :1] + rng.standard_normal((form.size, HOP_POINTS))
        further = best_from(np.c_[x[:, :1], np.clip(around.T, *region.box).T], HOPS_EACH)
        x, scores = np.c_[x, further[0]], np.r_[scores, further[1]]
        order = np.argsort(scores, kind="stable")
        x, scores = x[:, order], scores[order]
    for place, end in (each for each in ends if region.is_physical(*each)):  # there if the score is as good
        moved = x[:, :1].copy()
        moved[place] = region.box[end][place]
        if judge.scores(region, moved)[0] <= scores[0] + AS_GOOD * abs(scores[0]):
            x[:, :1] = moved
    close, best = scores[0] + AGREES * abs(scores[0]), x[:, 0]
    beyond = [each for each in places if (form.box[0] > best, form.box[1] < best)[each[1]][each[0]]]
    widened = tuple(dict.fromkeys(form.names[place] for place, _ in beyond))
    found = [(float(scores[n]), x[:, n]) for n in _apart(region, x, scores, CANDIDATES)]
    return Search(form.wider(beyond, BEYOND), found, scores.size, int((scores <= close).sum()), widened)


def sobol(low: Real, high: Real, log2: int) -> Real:
    """Points (n, 2^log2) of Sobol's sequence in a box."""
    from scipy.stats import qmc  # here, because it takes half a second to load

    shares = qmc.Sobol(low.size, seed=SEED).random_base2(log2)
    return np.asarray((low + shares * (high - low)).T)


def _apart(form: Structure, points: Real, scores: Real, most: int) -> list[int]:
    """Indices of the best points, at a distance from each other."""
    low, high = form.box
    found: list[int] = []
    for n in np.argsort(scores, kind="stable").tolist():
        if (abs(points[:, [n]] - points[:, found]) > APART * (high - low)[:, None]).any(axis=0).all():
            found.append(n)
        if len(found) == most:
            break
    return found


def flat_part(judge: Worst, form: Structure, x: Real, score: float) -> dict[str, Bounds]:
    """Range of each coefficient in which the score is within `FLAT_WITHIN` of the best, the others constant.

    The search goes outwards in growing steps, then by halving: narrow ranges are found as well as wide ones.
    """
    limit, ways = score + FLAT_WITHIN * abs(score), np.arange(2 * form.size)
    along, ends = ways // 2, np.array(form.box).T.ravel()  # of each way the coefficient that changes, and its bound

    def good(steps: Real, which: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether steps (k, m) along some (k,) of the ways are within the limit."""
        points = np.repeat(x[:, None], steps.size, axis=1).reshape(-1, *steps.shape)
        points[along[which], np.arange(which.size)] += steps
        return np.asarray(judge.scores(form, points.reshape(x.size, -1)) <= limit).reshape(steps.shape)

    reach = ends - x[along]
    steps = np.geomspace(AT_ORIGIN, 1.0, FLAT_STEPS) * reach[:, None]
    bad = ~good(steps, ways)
    (cut,) = np.nonzero(bad.any(axis=1))
    if cut.size:
        first = bad[cut].argmax(axis=1)
        low, high = np.where(first > 0, steps[cut, first - 1], 0.0), steps[cut, first]
        for _ in range(FLAT_HALVINGS):
            middle = (low + high) / 2
            is_good = good(middle[:, None], cut)[:, 0]
            low, high = np.where(is_good, middle, low), np.where(is_good, high, middle)
        reach[cut] = low
    found = form.coefficients((x[along] + reach).reshape(form.size, 2))
    bounds = [each.bounds for each in form.free]
    whole = ~np.isin(ways, cut).reshape(form.size, 2)
    return {
        name: (low if all_low else float(a), high if all_high else float(b))
        for name, (a, b), (all_low, all_high), (low, high) in zip(form.names, found, whole, bounds, strict=True)
    }
