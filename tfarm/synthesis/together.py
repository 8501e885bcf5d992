"""Gains judged on several arms at once: by the arm on which they are worst."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import TypeVar

import numpy as np

from tfarm.arm import HubFeedback
from tfarm.arrays import Real
from tfarm.dsp.verdict import SampledBrief
from tfarm.loop.stability import Stability
from tfarm.records import record
from tfarm.synthesis.continuous import ContinuousJudge
from tfarm.synthesis.sampled import SampledJudge
from tfarm.synthesis.search import Bounds, Effort, GainAxis, Score

_One = TypeVar("_One")

LEAST_IS_BEST = ("residual", "cost", "sensitivity")  # of the objectives


@dataclass(frozen=True)
@record
class OnArm:
    """What a law is on one of the arms it was chosen for: its objective's `value`, and both verdicts.

    `numbers` are those that a box gave the arm.
    """

    name: str
    numbers: dict[str, float]
    value: float
    verdict: Stability
    sampled: SampledBrief


Judge = ContinuousJudge | SampledJudge  # what both gains of the plane are worth in a loop of an arm, the others held


@dataclass(frozen=True)
class Worst:
    """The judges of several arms as one: the largest of their scores."""

    judges: tuple[Judge, ...]

    def effort(self, up: Bounds) -> Effort:
        """The finest grid that any of them asks for."""
        return Effort(*(max(each) for each in zip(*(judge.effort(up) for judge in self.judges), strict=True)))

    def landscape(self, axes: tuple[GainAxis, GainAxis], effort: Effort) -> tuple[Real, Score]:
        """The largest scores over the grid, inf where one arm is not stable, and the score to refine with."""
        values, scores = zip(*(judge.landscape(axes, effort) for judge in self.judges), strict=True)
        return np.max(values, axis=0), lambda points: _largest(scores, points)

    def score(self, points: Real) -> Real:
        """What is minimised: the largest score."""
        return _largest([judge.score for judge in self.judges], points)

    def holds(self, law: HubFeedback) -> bool:
        """Whether the loop of every arm is stable by the verdict of its kind."""
        return all(judge.holds(law) for judge in self.judges)

    def values(self, law: HubFeedback) -> list[float]:
        """The objective of a law on each arm."""
        return [judge.value(law, score_of(judge, law)) for judge in self.judges]


def _largest(scores: Sequence[Score], points: Real) -> Real:
    """The largest score at points (2, n); where one arm's loop does not hold, the next arms are not asked."""
    first, *others = scores
    found = first(points)
    for score in others:
        held = np.isfinite(found)
        if held.any():
            found[held] = np.maximum(found[held], score(points[:, held]))
    return found


def score_of(judge: Judge, law: HubFeedback) -> float:
    """What a judge minimises, at one law."""
    return float(judge.score(np.array(law.point)[:, None])[0])


def worst_value(objective: str, values: Sequence[float]) -> float:
    """The worst of the values of an objective."""
    return max(values) if objective in LEAST_IS_BEST else min(values)


def in_step(each: Sequence[Iterable[_One]]) -> Iterator[tuple[_One, ...]]:
    """The first of all, the second of all, ...; one that has ended stays at its last."""
    last: list[_One | None] = [None] * len(each)
    for row in zip_longest(*each):
        last = [old if new is None else new for old, new in zip(last, row, strict=True)]
        yield tuple(one for one in last if one is not None)
