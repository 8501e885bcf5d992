"""Search for the best law: differential evolution from several starts, a simplex from the best, and wider bounds.

SciPy's differential evolution (Storn and Price, 1997) uses no slopes, so that it works along edges, where the largest
of several values has none.  Each run begins with other points of Sobol's sequence, which leaves no large gap; one more
begins with the best points of all, and of more than two coefficients others near the best, as long as that gains.  The
simplex of Nelder and Mead is the end.  A law is left as soon as its score is above that of the point it is to replace.
Runs may leave bounds that are neither given nor physical ends; where the best law is beyond a bound, that of the wider
region is returned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.optimize import differential_evolution, minimize

from tfarm.arm import PLANE
from tfarm.arrays import Real
from tfarm.synthesis.judge import LOST, Judge, scores_of
from tfarm.synthesis.structures import Bounds, Structure
from tfarm.synthesis.worst_case import Effort, Tell

MOST_RUNS = 8
# of the scores: the spread of a run's points at which it ends
CONVERGED = 1e-9

# of points (n, k), and of limits
Score = Callable[..., Real]


class Points(NamedTuple):
    """Points x (n, m) and their scores (m,), the lowest first."""

    x: Real
    scores: Real

    @classmethod
    def of(cls, parts: Sequence[tuple[Real, Real]]) -> Points:
        """Return the points of all parts."""
        x, scores = (np.concatenate(each, axis=-1) for each in zip(*parts, strict=True))
        order = np.argsort(scores, kind="stable")
        return cls(x[:, order], scores[order])


class Search(NamedTuple):
    """Result of a search: points and scores, the lowest first; the structure with the searched bounds.

    Of `starts` runs `agreed` reached the best score; `widened` names coefficients.
    """

    form: Structure
    found: list[tuple[float, Real]]
    starts: int
    agreed: int
    widened: tuple[str, ...]


class Worst(NamedTuple):
    """The judges of several arms as one: the largest of their scores."""

    judges: tuple[Judge, ...]

    @property
    def work(self) -> float:
        """The work of a law, relative to that of one arm and its first model."""
        squares = 0
        for judge in self.judges:
            models = 4 if judge.is_sampled else 1
            squares += models * len(judge.model.plant[0]) ** 2
        # models times squared states of one arm's first model: with twice as much half the runs
        return squares / (4 * 20**2)

    def scores(self, form: Structure, x: Real, limits: Real | None = None) -> Real:
        """Return the function to be minimised, at points x (n, laws), any value above the limit of a law."""
        number = x.shape[1]
        if limits is None:
            limits = np.full(number, np.inf)
        # a limit of memory
        at_once = 256
        found = []
        for first in range(0, number, at_once):
            part = slice(first, first + at_once)
            entries = form.entries(form.coefficients(x[:, part]))
            found.append(scores_of(self.judges, entries, limits[part]))
        return np.concatenate(found)


def search(
    judge: Worst, form: Structure, tell: Tell, near: Real | None = None, effort: Effort = "whole"
) -> Search:
    """Return the best laws of a structure near its bounds, which are widened where the best lies beyond.

    `near` (n,) is the best point of a judge with fewer arms, with which the first run begins.
    """
    # of x: reach of a search beyond its bounds, a factor e^4 of a coefficient far above its unit
    reach = 4.0
    movable = form.ends(physical=False)
    region = form.wider(movable, reach)
    words = judge.judges[0].objective.words

    def report(number: int, best: float) -> None:
        found = "no stable law yet" if best >= LOST else f"best so far {words(best)}"
        tell(f"{form.name}: search {number}, {found}")

    (x, scores), of_runs = minimise_runs(
        partial(judge.scores, region), form, region.box, judge.work, report, near, effort
    )
    for place, end in region.ends(physical=True):
        moved = x[:, :1].copy()
        moved[place] = region.box[end][place]
        # a coefficient is at its physical end if the score there is as good
        if judge.scores(region, moved)[0] <= scores[0] + 1e-4 * abs(scores[0]):
            x[:, :1] = moved
    low, high = form.box
    is_beyond = x[:, 0] < low, x[:, 0] > high
    beyond = [(place, end) for place, end in movable if is_beyond[end][place]]
    widened = tuple(dict.fromkeys(form.names[place] for place, _ in beyond))
    # a run agrees if its score is worse than the best by less
    agreed = sum(each <= scores[0] + 5e-3 * abs(scores[0]) for each in of_runs)
    found = _best_points(region, x, scores)
    return Search(form.wider(beyond, reach), found, len(of_runs), agreed, widened)


def minimise_runs(
    score: Score,
    form: Structure,
    box: tuple[Real, Real],
    work: float,
    report: Callable[[int, float], None],
    near: Real | None,
    effort: Effort,
) -> tuple[Points, list[float]]:
    """Return the last points of all runs, and the best score of each.

    `score` takes points (n, k) of the box, and limits (k,) above which any value will do; `work` is that of a law,
    relative to the usual one; `report` is given the number of each run and the best score so far.  Runs begin within
    the bounds of `form`, the first also with its start or a point `near` the best, and are more where no loop is stable
    yet: the end of a sketch.  Then follow one with the best points of all, not of a search near a point, some near the
    best as long as that gains, and a simplex at the best of all.
    """
    # one run more than coefficients: some minima are found by one of five alone
    runs = 1
    if effort == "whole":
        runs = min(max(int((form.size + 1) / max(1.0, work)), 2), MOST_RUNS)
    # points of a run: a power of two
    number = 1 << (max(32, 15 * form.size) - 1).bit_length()
    rounds = min(800 * form.size, 4000) // number
    ended: list[Points] = []

    best = np.inf

    def run(points: Real, rounds: int) -> None:
        nonlocal best
        ended.append(evolve_points(score, box, points, rounds, len(ended)))
        best = min(best, ended[-1].scores[0])
        report(len(ended), float(best))

    for seed in range(MOST_RUNS):
        if seed >= runs and best < LOST:
            break
        points = sobol(*form.box, number, seed)
        if seed == 0:
            points[:, 0] = form.origin if near is None else near
        run(points, rounds)
    runs = len(ended)
    if effort == "whole":
        run(Points.of(ended).x[:, :number], 2 * rounds)
    if form.size > len(PLANE) and effort != "sketch":
        for n in range(5):
            before = best
            # the spread of the points of a run around the best, half as wide in each one after
            spread = 0.5 / 2**n * np.random.default_rng(runs + n).standard_normal((number, form.size))
            run(np.clip(Points.of(ended).x[:, 0] + spread, *box).T, rounds)
            # another run follows one with a gain
            if not best < before - 2e-3 * abs(before):
                break
    if effort != "sketch":
        ended.append(simplex(score, box, Points.of(ended)))
    found = Points.of(ended)
    return found, [float(found.scores[0]), *(float(each.scores[0]) for each in ended[:runs])]


def evolve_points(score: Score, box: tuple[Real, Real], points: Real, rounds: int, seed: int) -> Points:
    """Return the last points of a run of differential evolution that begins with `points` (n, m)."""
    # in turn, and the share of coefficients changed at once
    strategy = "best1bin"
    recombination = 0.7
    if seed % 2:
        strategy = "currenttobest1bin"
        recombination = 0.9
    limits = np.full(points.shape[1], np.inf)

    def after(intermediate_result: Any) -> None:
        """A point is replaced by one whose score is not above its own."""
        limits[:] = intermediate_result.population_energies

    done = cast("Any", differential_evolution)(
        lambda x: score(x.reshape(len(points), -1), limits),
        np.transpose(box),
        init=points.T,
        strategy=strategy,
        recombination=recombination,
        maxiter=rounds,
        tol=CONVERGED,
        rng=seed,
        polish=False,
        vectorized=True,
        updating="deferred",
        callback=after,
    )
    return Points.of([(done.population.T, done.population_energies)])


def simplex(score: Score, box: tuple[Real, Real], found: Points) -> Points:
    """Return the last point of a simplex of Nelder and Mead that begins at the best point found."""
    low, high = box
    start = found.x[:, 0]
    limit = found.scores[:1]
    # of the region: the first edges of the simplex
    step = 0.005 * (high - low)
    edges = np.diag(np.where(start + step > high, -step, step))
    options = {
        "initial_simplex": [start, *(start + edges)],
        "maxfev": 100 * start.size,
        "adaptive": start.size > 1,
        "xatol": CONVERGED * (high - low).max(),
        "fatol": CONVERGED * abs(limit[0]),
    }
    done = cast("Any", minimize)(
        lambda x: score(x[:, None], limit)[0],
        start,
        method="Nelder-Mead",
        bounds=np.transpose(box),
        options=options,
    )
    return Points(done.x[:, None], np.array([done.fun]))


def sobol(low: Real, high: Real, number: int, seed: int) -> Real:
    """Return points (n, number) of Sobol's sequence in a box, scrambled by a seed; a power of two has no gap."""
    # here, because it takes half a second to load
    from scipy.stats import qmc

    return (low + qmc.Sobol(low.size, rng=seed).random(number) * (high - low)).T


def _best_points(form: Structure, x: Real, scores: Real) -> list[tuple[float, Real]]:
    """Return the four best points for the exact verdicts, of sorted ones, that differ by 2 % of the range of x."""
    low, high = form.box
    least = 0.02 * (high - low)
    found: list[tuple[float, Real]] = []
    for score, point in zip(scores.tolist(), x.T, strict=True):
        if all((abs(point - other) > least).any() for _, other in found):
            found.append((score, point))
        if len(found) == 4:
            break
    return found


def flat_part(judge: Worst, form: Structure, x: Real, limit: float) -> dict[str, Bounds]:
    """Return the range of each coefficient with a score up to a limit above that of the best, the others constant.

    The search goes outwards in growing steps, then by halving: narrow ranges are found as well as wide ones.
    """
    n = form.size
    ways = np.concatenate([np.diag(end - x) for end in form.box]).T

    def is_within(shares: Real) -> Any:
        """Return whether the law at a share (2 n, m) of each way from x to an end is within the limit."""
        points = (x[:, None, None] + ways[:, :, None] * shares).reshape(n, -1)
        scores = judge.scores(form, points, np.full(shares.size, limit))
        return (scores <= limit).reshape(shares.shape)

    # each 1.4 times the one before
    outwards = np.r_[0.0, np.geomspace(1e-9, 1.0, 60)]
    is_beyond = ~is_within(np.tile(outwards, (2 * n, 1)))
    first = is_beyond.argmax(axis=1)
    low = outwards[first - 1]
    high = outwards[first]
    for _ in range(30):
        middle = (low + high) / 2
        inside = is_within(middle[:, None])[:, 0]
        low = np.where(inside, middle, low)
        high = np.where(inside, high, middle)
    ends = form.coefficients(x[:, None] + ways * low)
    bounds = np.transpose([each.bounds for each in form.free])
    reached = np.where(first.reshape(2, n), [ends[:, :n].diagonal(), ends[:, n:].diagonal()], bounds)
    return {name: (least, most) for name, (least, most) in zip(form.names, reached.T.tolist(), strict=True)}
