"""Minimum of a function in a box by evolution strategies with covariance adaptation, many of them in step.

Each draws points from a normal distribution N(m, step^2 C), moves m to the weighted mean of the best, and learns
from such moves the covariance C and the step:

    m' = m + step y,   y = sum of w_i (x_i - m)/step over the best points
    p_s' = (1 - c_s) p_s + sqrt(c_s (2 - c_s) mu) C^(-1/2) y         longer than by chance: the step grows
    p_c' = (1 - c_c) p_c + sqrt(c_c (2 - c_c) mu) y
    C'  = (1 - c_1 - c_mu) C + c_1 p_c' p_c'^T + c_mu sum of w_i y_i y_i^T

It uses no slopes, so that it works along edges, where the largest of several values has none.  Constants are those of
N. Hansen, The CMA Evolution Strategy: A Tutorial (arXiv 1604.00772).  A strategy finds a local minimum: the worse half
of all ends every few rounds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tfarm.arrays import Real, Whole

POINTS = 12  # of each strategy in a round
HALVED_EVERY, FINALISTS = 10, 4  # rounds after which the better half goes on, and the least number left
MOST_ROUNDS = 160  # a ridge in five coordinates takes most of them
FIRST_STEP = 0.05  # of the box: short, as good valleys are narrow
LEAST_PROGRESS, SHORT_STEP = 1e-5, 1e-3  # of the score between halvings, of the box: with less of both all end
STEP_GROWS = 0.6  # of ln(step) in a round, at most
LEAST_SPREAD = 1e-20  # of C: an eigenvalue below it is rounding
STALLED = 1.4  # of the length by chance, and 2/(n + 1): beyond that length of the step's path that of C is not updated
SEED = 0


class Constants(NamedTuple):
    """Weights (points,) of the best points, their effective number mu, and the rates of learning."""

    weights: Real
    mu: float
    c_step: float
    damping: float
    c_path: float
    c_one: float
    c_mu: float
    chance: float

    @classmethod
    def of(cls, n: int) -> Constants:
        """The constants for n coordinates."""
        weights = np.log(POINTS / 2 + 0.5) - np.log(np.arange(1, POINTS // 2 + 1))
        weights /= weights.sum()
        mu = float(1 / (weights**2).sum())
        c_step, c_one = (mu + 2) / (n + mu + 5), 2 / ((n + 1.3) ** 2 + mu)
        return cls(
            weights, mu, c_step,
            damping=1 + c_step + 2 * max(0.0, np.sqrt((mu - 1) / (n + 1)) - 1),
            c_path=(4 + mu / n) / (n + 4 + 2 * mu / n),
            c_one=c_one,
            c_mu=min(1 - c_one, 2 * (mu - 2 + 1 / mu) / ((n + 2) ** 2 + mu)),
            chance=np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n)),
        )  # fmt: skip


class Strategies(NamedTuple):
    """Strategies (m, ...) in a box of unit size: mean, step, C, both paths, and the best point with its score."""

    mean: Real
    step: Real
    C: Real
    step_path: Real
    path: Real
    best: Real
    score: Real

    def some(self, which: Whole) -> Strategies:
        """The strategies of some indices."""
        return Strategies(*(each[which] for each in self))


def evolved(
    score: Callable[[Real], Real], starts: Real, box: tuple[Real, Real], tell: Callable[[int, float], None]
) -> tuple[Real, Real]:
    """Return the points (n, m) reached by strategies from m starts (n, m), and their scores, the lowest first.

    `score` takes points (n, k) of the box.  `tell` is called with the number of each tenth round, and the lowest score.
    """
    (low, high), rng = (end[:, None] for end in box), np.random.default_rng(SEED)
    n, m = starts.shape
    none = np.zeros((m, n))
    mean = ((starts - low) / (high - low)).T
    unit = np.repeat(np.eye(n)[None], m, axis=0)
    now = Strategies(mean, np.full(m, FIRST_STEP), unit, none, none, mean, score(starts))
    of, ended, before = Constants.of(n), [], np.inf
    for number in range(MOST_ROUNDS):
        if number and number % HALVED_EVERY == 0:
            lowest = float(now.score.min())
            if before - lowest <= LEAST_PROGRESS * abs(lowest) and now.step.max() < SHORT_STEP:
                break
            before = lowest
            order = np.argsort(now.score, kind="stable")
            kept, left = np.split(order, [max(FINALISTS, order.size // 2)])
            ended.append(now.some(left))
            now = now.some(kept)
            tell(number, float(now.score[0]))
        now = _next(now, of, lambda x: score(low + (high - low) * x), rng, number)
    found = np.concatenate([each.best for each in (now, *ended)]).T
    scores = np.concatenate([each.score for each in (now, *ended)])
    order = np.argsort(scores, kind="stable")
    return (low + (high - low) * found)[:, order], scores[order]


def _next(
    now: Strategies, of: Constants, score: Callable[[Real], Real], rng: np.random.Generator, number: int
) -> Strategies:
    """The strategies after one round."""
    (m, n), step = now.mean.shape, now.step[:, None]
    spread, axes = np.linalg.eigh(now.C)
    spread = np.sqrt(np.maximum(spread, LEAST_SPREAD))
    drawn = np.einsum("mij,mj,mkj->mki", axes, spread, rng.standard_normal((m, POINTS, n)))
    x = np.clip(now.mean[:, None] + step[:, None] * drawn, 0.0, 1.0)
    scores = score(x.reshape(-1, n).T).reshape(m, POINTS)
    order = np.argsort(scores, axis=1, kind="stable")[:, : of.weights.size]
    x, lowest = np.take_along_axis(x, order[:, :, None], axis=1), np.take_along_axis(scores, order[:, :1], axis=1)[:, 0]
    y = (x - now.mean[:, None]) / step[:, None]
    move = np.einsum("k,mki->mi", of.weights, y)
    turned = np.einsum("mij,mj,mkj,mk->mi", axes, 1 / spread, axes, move)
    step_path = (1 - of.c_step) * now.step_path + np.sqrt(of.c_step * (2 - of.c_step) * of.mu) * turned
    length = np.linalg.norm(step_path, axis=1) / of.chance
    begun = np.sqrt(1 - (1 - of.c_step) ** (2 * (number + 1)))
    is_usual = length / begun < STALLED + 2 / (n + 1)
    path = (1 - of.c_path) * now.path
    path = path + is_usual[:, None] * np.sqrt(of.c_path * (2 - of.c_path) * of.mu) * move
    C = (1 - of.c_one - of.c_mu) * now.C + of.c_one * path[:, :, None] * path[:, None]
    C = C + of.c_mu * np.einsum("k,mki,mkj->mij", of.weights, y, y)
    better = lowest < now.score
    grown = now.step * np.exp(np.minimum(STEP_GROWS, of.c_step / of.damping * (length - 1)))
    return Strategies(
        mean=now.mean + step * move,
        step=np.minimum(grown, 1.0),
        C=C,
        step_path=step_path,
        path=path,
        best=np.where(better[:, None], x[:, 0], now.best),
        score=np.where(better, lowest, now.score),
    )
