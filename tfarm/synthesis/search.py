"""The search for the best law: many points of the bounds, strategies from the best of them, and wider bounds.

The points are those of Sobol's sequence, which leave no large gap (Sobol, 1967).  From those that are best, each apart
from the others, evolution strategies go down (`evolution`), and then from points about the best; all also beyond bounds
that are neither given nor physical ends.  Bounds that the best law lies beyond are those of the wider region.
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
HOPS, HOPS_EACH, HOP_POINTS = 1, 4, 256  # searches about the best of more than two, strategies each, and points
CANDIDATES = 4  # laws that the exact verdicts may judge, the best first
BEYOND = 4.0  # of x: so far beyond its bounds a search may go, a factor e^4 of a coefficient far above its unit
APART = 0.02  # of the range of x: points that are nearer are not both begun at
AS_GOOD = 1e-4  # relative: a coefficient that scores so nearly as well at its physical end is there
SEED = 0  # of the sequence's scrambling, and of points about the best
AGREES = 5e-3  # relative: a strategy that ends with so nearly the best score agrees
FLAT_WITHIN = 0.01  # laws whose score is worse by less than this share bound the flat part
FLAT_STEPS, FLAT_HALVINGS = 60, 30  # of the way to the bounds, each 1.4 times the one before; of an interval
AT_ORIGIN = 1e-9  # of that way: the first step


@dataclass(frozen=True)
@record
class Search:
    """What a search found: points and scores, the lowest first; the structure with the bounds that were searched.

    `starts` strategies began, of which `agreed` came to the best score; `widened` names coefficients.
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
        """What is minimised, at points x (n, laws); where one arm's loop does not hold, the next ones are left out."""
        worst = self.judges[0].scores(form, x)
        for judge in self.judges[1:]:
            held = worst < LOST
            if held.any():
                worst[held] = np.maximum(worst[held], judge.scores(form, x[:, held]))
        return worst


def search(judge: Worst, form: Structure, tell: Tell) -> Search:
    """The best laws of a structure near its bounds, which are widened where the best lies beyond."""
    given = [each.name in form.given for each in form.free]
    ends = [(place, end) for place in range(form.size) for end in (0, 1)]
    places = [each for each in ends if not (given[each[0]] or form.is_physical(*each))]
    region = form.wider(places, BEYOND)
    points = np.c_[form.origin, sobol(*form.box, POINTS_LOG2)]

    def told(number: int, score: float) -> None:
        tell(f"{form.name}: round {number} of {MOST_ROUNDS}, best so far {score:.6g}")

    def best_from(points: Real, each: int) -> tuple[Real, Real]:
        first = points[:, _apart(region, points, judge.scores(region, points), each * form.size)]
        return evolved(lambda at: judge.scores(region, at), first, region.box, told)

    x, scores = best_from(points, STARTS_EACH)
    rng = np.random.default_rng(SEED)
    for _ in range(HOPS if form.size > 2 else 0):
        around = x[:, :1] + rng.standard_normal((form.size, HOP_POINTS))
        further = best_from(np.c_[x[:, :1], np.clip(around.T, *region.box).T], HOPS_EACH)
        x, scores = np.c_[x, further[0]], np.r_[scores, further[1]]
        order = np.argsort(scores, kind="stable")
        x, scores = x[:, order], scores[order]
    x[:, 0] = _at_limits(judge, region, x[:, 0], float(scores[0]))
    close, best = scores[0] + AGREES * abs(scores[0]), x[:, 0]
    beyond = [each for each in places if (form.box[0] > best, form.box[1] < best)[each[1]][each[0]]]
    widened = tuple(dict.fromkeys(form.names[place] for place, _ in beyond))
    found = [(float(scores[n]), x[:, n]) for n in _apart(region, x, scores, CANDIDATES)]
    return Search(form.wider(beyond, BEYOND), found, scores.size, int((scores <= close).sum()), widened)


def _at_limits(judge: Worst, form: Structure, x: Real, score: float) -> Real:
    """The point with each coefficient at its physical end where it scores as well there."""
    for place, end in [(place, end) for place in range(form.size) for end in (0, 1) if form.is_physical(place, end)]:
        moved = x.copy()
        moved[place] = form.box[end][place]
        if judge.scores(form, moved[:, None])[0] <= score + AS_GOOD * abs(score):
            x = moved
    return x


def sobol(low: Real, high: Real, log2: int) -> Real:
    """Points (n, 2^log2) of Sobol's sequence in a box; of one unknown, evenly on a line."""
    from scipy.stats import qmc  # here, because it takes half a second to load

    shares = qmc.Sobol(low.size, seed=SEED).random_base2(log2)
    return np.asarray((low + shares * (high - low)).T)


def _apart(form: Structure, points: Real, scores: Real, most: int) -> list[int]:
    """The places of the best points, each of them apart from those before."""
    low, high = form.box
    found: list[int] = []
    for n in np.argsort(scores, kind="stable").tolist():
        if (abs(points[:, [n]] - points[:, found]) > APART * (high - low)[:, None]).any(axis=0).all():
            found.append(n)
        if len(found) == most:
            break
    return found


def flat_part(judge: Worst, form: Structure, x: Real, score: float) -> dict[str, Bounds]:
    """Between which values of each coefficient the score stays within `FLAT_WITHIN` of the best, the others held.

    Walked outwards in steps that grow, then halved: narrow valleys are seen as well as wide ones.  All ways at once.
    """
    limit, ways = score + FLAT_WITHIN * abs(score), np.arange(2 * form.size)
    along, ends = ways // 2, np.array(form.box).T.ravel()  # of each way, which coefficient changes, and its bound

    def good(steps: Real, which: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Of steps (k, m) along some (k,) of the ways."""
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
            held = good(middle[:, None], cut)[:, 0]
            low, high = np.where(held, middle, low), np.where(held, high, middle)
        reach[cut] = low
    found = form.coefficients((x[along] + reach).reshape(form.size, 2))
    bounds = [each.bounds for each in form.free]
    whole = ~np.isin(ways, cut).reshape(form.size, 2)
    return {
        name: (low if all_low else float(a), high if all_high else float(b))
        for name, (a, b), (all_low, all_high), (low, high) in zip(form.names, found, whole, bounds, strict=True)
    }
