"""Which measured peak is which of the arm's: pairs of places in two ascending rows, by dynamic programming."""

from __future__ import annotations

import numpy as np

from tfarm.arrays import Real


def aligned(gaps: Real, measured_alone: float, own_alone: Real) -> tuple[list[tuple[int, int]], float]:
    """Pairs of places in both rows, in order, of the least cost in sum, and that cost.

    A pair costs its entry of `gaps` (measured, own); one left alone `measured_alone`, or its own of `own_alone` (own,).
    """
    n, m = gaps.shape
    cost, ways = np.zeros((n + 1, m + 1)), np.zeros((n + 1, m + 1), dtype=int)
    cost[1:, 0], cost[0, 1:] = measured_alone * np.arange(1, n + 1), np.cumsum(own_alone)
    ways[1:, 0], ways[0, 1:] = 1, 2
    for i in range(1, n + 1):
        for j in range(1, m + 1):
            choices = (
                cost[i - 1, j - 1] + gaps[i - 1, j - 1],
                cost[i - 1, j] + measured_alone,
                cost[i, j - 1] + own_alone[j - 1],
            )
            ways[i, j] = int(np.argmin(choices))
            cost[i, j] = choices[ways[i, j]]
    pairs, i, j = [], n, m
    while i or j:
        way = ways[i, j]
        if way == 0:
            pairs.append((i - 1, j - 1))
        i, j = i - (way != 2), j - (way != 1)
    return pairs[::-1], float(cost[-1, -1])
