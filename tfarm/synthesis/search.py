"""The search for the best law: many points of the bounds, descents from the best of them, and wider bounds.

The points are those of Sobol's sequence, which leave no large gap (Sobol, 1967); one unknown is searched on a line.
From those that are best, each apart from the others, random walks look for better ones, all in step, as scores of many
laws take little longer than one; from the best of these `minimax` goes down.  All of that may go beyond bounds that
are neither given nor physical ends, and is repeated from points about the best.  Bounds that the best law lies beyond
are those of the wider region.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.records import record
from tfarm.synthesis.judge import Judge
from tfarm.synthesis.minimax import LOST, Pieces, ScoredPoint, minimax
from tfarm.synthesis.structures import Bounds, Structure
from tfarm.synthesis.worst_case import Tell

POINTS_LOG2 = 11  # of the number of points
LINE_POINTS = 512  # of one unknown
LINE_ZOOMS, ZOOM_POINTS = 8, 17  # of the grids between the neighbours of a minimum on a line
BEYOND = 4.0  # of x: so far beyond its bounds a search may go, a factor e^4 of a coefficient far above its unit
HOPS, HOP_POINTS = 2, 256  # searches from so many points about the best, at a deviation of 1 of x
APART = 0.02  # of the range of x: points that are nearer are not both begun at
SEED = 0  # of the sequence's scrambling, and of the walks
WALK_ROUNDS, HALVED_EVERY, FEWEST_WALKS = 40, 10, 4  # of the walks: rounds, those after which the better half goes on
WALK_POINTS = 8  # that each tries in a round
FIRST_STEP, STEP_GROWS, STEP_SHRINKS = 0.15, 1.3, 0.7  # of the range of x; times
AGREES = 5e-3  # relative: a descent that ends with so nearly the best score agrees
SAME_POINT = 1e-6  # of x
FLAT_WITHIN = 0.01  # laws whose score is worse by less than this share bound the flat part
FLAT_STEPS, FLAT_HALVINGS = 60, 30  # of the way to the bounds, each 1.4 times the one before; of an interval
AT_ORIGIN = 1e-9  # of that way: the first step


class Effort(NamedTuple):
    """Walks for each coefficient, and descents from the best of what they come to."""

    walks: int
    descents: int


WHOLE, AROUND = Effort(16, 4), Effort(4, 2)  # from points of the bounds, and from some about the best


@dataclass(frozen=True)
@record
class Search:
    """What a search found: points and scores, the lowest first; the structure with the bounds that were searched.

    `starts` descents were made, of which `agreed` ended at the best score; `widened` names coefficients.
    """

    form: Structure
    found: list[ScoredPoint]
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

    def pieces(self, form: Structure, x: Real) -> Pieces:
        """The pieces of all."""
        try:
            parts = [judge.pieces(form, x) for judge in self.judges]
            return Pieces(*(np.concatenate(each) for each in zip(*parts, strict=True)))
        except np.linalg.LinAlgError:  # coefficients too large to be a law, or an algebraic loop
            flat = np.zeros((1, x.size))
            return Pieces(np.zeros(1), flat, np.array([1e6]), flat)


def search(judge: Worst, form: Structure, tell: Tell) -> Search:
    """The best laws of a structure near its bounds, which are widened where the best lies beyond."""
    places = [(place, end) for place in range(form.size) for end in (0, 1) if not is_final(form, place, end)]
    region = form.wider(places, BEYOND)
    best = _descended(judge, region, np.c_[form.origin, sobol(*form.box, POINTS_LOG2)], WHOLE, tell)
    number, rng = len(best), np.random.default_rng(SEED)
    for _ in range(HOPS if form.size > 1 else 0):
        around = best[0][1][:, None] + rng.standard_normal((form.size, HOP_POINTS))
        more = _descended(judge, region, np.clip(around.T, *region.box).T, AROUND, tell)
        number += len(more)
        best = sorted([*best, *more], key=itemgetter(0))
    close, x = best[0][0] + AGREES * abs(best[0][0]), best[0][1]
    beyond = [each for each in places if (form.box[0] > x, form.box[1] < x)[each[1]][each[0]]]
    widened = tuple(dict.fromkeys(form.names[place] for place, _ in beyond))
    return Search(
        form.wider(beyond, BEYOND), _distinct(best), number, sum(score <= close for score, _ in best), widened
    )


def is_final(form: Structure, place: int, end: int) -> bool:
    """Whether no wider bounds are tried there: the bound was given, or is a physical end."""
    return form.free[place].name in form.given or form.is_physical(place, end)


def sobol(low: Real, high: Real, log2: int) -> Real:
    """Points (n, 2^log2) of Sobol's sequence in a box; of one unknown, evenly on a line."""
    from scipy.stats import qmc  # here, because it takes half a second to load

    if low.size == 1:
        shares = (np.arange(LINE_POINTS) + 0.5)[:, None] / LINE_POINTS
    else:
        shares = qmc.Sobol(low.size, seed=SEED).random_base2(log2)
    return np.asarray((low + shares * (high - low)).T)


def _descended(judge: Worst, form: Structure, points: Real, effort: Effort, tell: Tell) -> list[ScoredPoint]:
    """Where the search comes to from the best of points (n, laws), the lowest first."""
    scores = judge.scores(form, points)
    if form.size == 1:
        found = [_on_line(judge, form, points[0], scores, n) for n in _dips(points[0], scores, effort.descents)]
        return sorted(found, key=itemgetter(0))
    first = points[:, _apart(form, points, scores, effort.walks * form.size)]
    points, scores = walked(judge, form, first)
    starts = list(points[:, _apart(form, points, scores, effort.descents)].T)

    def told(number: int, score: float) -> None:
        tell(f"{form.name}: descent {number} of {len(starts)}, best so far {score:.6g}")

    return minimax(lambda x: judge.pieces(form, x), starts, form.box, told)


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


def walked(judge: Worst, form: Structure, points: Real) -> tuple[Real, Real]:
    """Where random walks from points (n, walks) come to, in step, and their scores; the better half goes on each time.

    Each goes to the best of some points around it if that is better, and then takes longer steps, else shorter ones:
    an evolution strategy of one parent (Rechenberg, 1973).
    """
    rng, (low, high) = np.random.default_rng(SEED), form.box
    at, scores, step = points.copy(), judge.scores(form, points), np.full(points.shape[1], FIRST_STEP)
    ended: list[tuple[Real, Real]] = []
    for number in range(WALK_ROUNDS):
        if number and number % HALVED_EVERY == 0:
            order = np.argsort(scores, kind="stable")
            kept, left = np.split(order, [max(FEWEST_WALKS, order.size // 2)])
            ended.append((at[:, left], scores[left]))
            at, scores, step = at[:, kept], scores[kept], step[kept]
        moves = rng.standard_normal((*at.shape, WALK_POINTS)) * step[:, None] * (high - low)[:, None, None]
        tried = np.clip((at[:, :, None] + moves).T, low, high).T
        values = judge.scores(form, tried.reshape(low.size, -1)).reshape(tried.shape[1:])
        rows, best = np.arange(step.size), values.argmin(axis=1)
        better = values[rows, best] < scores
        at = np.where(better, tried[:, rows, best], at)
        scores = np.minimum(scores, values[rows, best])
        step = np.where(better, STEP_GROWS, STEP_SHRINKS) * step
    return np.concatenate([at, *(x for x, _ in ended)], axis=1), np.concatenate([scores, *(own for _, own in ended)])


def _dips(x: Real, scores: Real, most: int) -> NDArray[np.int64]:
    """The places of the lowest local minima along a line."""
    order = np.argsort(x, kind="stable")
    padded = np.r_[np.inf, scores[order], np.inf]
    low = order[(padded[1:-1] <= padded[:-2]) & (padded[1:-1] <= padded[2:])]
    return np.asarray(low[np.argsort(scores[low], kind="stable")[:most]])


def _on_line(judge: Worst, form: Structure, x: Real, scores: Real, place: int) -> ScoredPoint:
    """The minimum between the neighbours of a point on a line, by ever narrower grids."""
    (low,), (high,) = form.box
    width, best, at = np.diff(np.sort(x)).max(), float(scores[place]), float(x[place])
    for _ in range(LINE_ZOOMS):
        grid = np.clip(at + width * np.linspace(-1.0, 1.0, ZOOM_POINTS), low, high)
        values = judge.scores(form, grid[None])
        n = int(values.argmin())
        best, at, width = min((best, at, width), (float(values[n]), float(grid[n]), width), key=itemgetter(0))
        width /= (ZOOM_POINTS - 1) / 4
    return best, np.array([at])


def _distinct(found: Sequence[ScoredPoint]) -> list[ScoredPoint]:
    """Those that are not next to a better one."""
    kept: list[ScoredPoint] = []
    for score, x in found:
        if all(abs(x - other).max() > SAME_POINT for _, other in kept):
            kept.append((score, x))
    return kept


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
