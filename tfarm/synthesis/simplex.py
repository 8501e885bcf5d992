"""The downhill simplex of Nelder and Mead (1965) in a plane, from several triangles in step.

Each triangle asks for one value after another; what all of them ask for is worked out at once, as a score of many
points takes little longer than one of a single point.  A triangle goes its way as if it were alone: reflection 1,
expansion 2, contraction and shrinking by a half, as SciPy has them.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import suppress

import numpy as np

from tfarm.arrays import Real

Walk = Generator[Real, float, None]  # yields points (2,), is sent their values


def downhill(values: Callable[[Real], Real], triangles: Sequence[Real], small: float, most: int) -> list[Triangle]:
    """The triangles, each three points (3, 2), after `most` values each at most: their lowest corner stands first.

    `values` takes points (n, 2).  A triangle ends earlier whose corners are all alike, and no farther apart than
    `small`.
    """
    found = [Triangle(each) for each in triangles]
    walks = [each.walk(small) for each in found]
    asked = [(walk, next(walk)) for walk in walks]
    for _ in range(most):
        if not asked:
            break
        told = zip(asked, values(np.array([point for _, point in asked])).tolist(), strict=True)
        asked = []
        for (walk, _), value in told:
            with suppress(StopIteration):
                asked.append((walk, walk.send(value)))
    for each in found:
        each.sort()
    return found


class Triangle:
    """Three corners (3, 2), the lowest first, and their values."""

    def __init__(self, corners: Real) -> None:
        self.corners, self.values = corners.copy(), np.full(3, np.inf)

    def sort(self) -> None:
        """Put the lowest corner first, one without a value last."""
        order = np.argsort(self.values, kind="stable")
        self.corners, self.values = self.corners[order], self.values[order]

    def walk(self, small: float) -> Walk:
        """The points whose values the triangle asks for, until it is `small` and level."""
        for n in range(3):
            self.values[n] = yield self.corners[n]
        self.sort()
        while abs(self.corners[1:] - self.corners[0]).max() > small or (self.values[1:] != self.values[0]).any():
            yield from self._step()
            self.sort()

    def _step(self) -> Walk:
        worst, middle = self.corners[2].copy(), (self.corners[0] + self.corners[1]) / 2
        across = 2 * middle - worst
        there = yield across
        if there < self.values[0]:
            beyond = 3 * middle - 2 * worst
            farther = yield beyond
            self._move(*((beyond, farther) if farther < there else (across, there)))
        elif there < self.values[1]:
            self._move(across, there)
        else:
            is_outside = there < self.values[2]
            nearer = 1.5 * middle - 0.5 * worst if is_outside else 0.5 * middle + 0.5 * worst
            value = yield nearer
            if value <= there if is_outside else value < self.values[2]:
                self._move(nearer, value)
            else:
                yield from self._shrink()

    def _move(self, corner: Real, value: float) -> None:
        self.corners[2], self.values[2] = corner, value

    def _shrink(self) -> Walk:
        for n in (1, 2):
            self.corners[n] = self.corners[0] + 0.5 * (self.corners[n] - self.corners[0])
            self.values[n] = yield self.corners[n]
