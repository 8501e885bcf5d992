"""Over a plane of two gains: the count of zeros beyond the curve, column by column, from crossings and one count."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real, Whole

from .line import Crossings

Window = tuple[float, float]  # two values of a gain, the lower first
SAME_EDGE = 1e-9  # relative: next to z = 1 one static crossing is read several times, each with an error near 1e-12


def counts_over(gains: Real, columns: Sequence[Crossings], reference: float, there: NDArray[Any]) -> Whole:
    """Zeros beyond the curve at each of the gains (n,) in each column: (columns, n).

    `columns` holds the crossings of each along the gain, `there` (columns,) the count at the gain `reference`.
    """
    passed = np.array([each.passed(np.r_[gains, reference]) for each in columns]).reshape(len(columns), gains.size + 1)
    return np.asarray(np.asarray(there)[:, None] + passed[:, :-1] - passed[:, -1:], dtype=np.int64)


def intervals(found: Crossings, low: float, high: float, reference: float, there: int) -> list[Window]:
    """The intervals between `low` and `high` in which nothing is beyond the curve, `there` the count at `reference`."""
    ends = np.r_[low, np.unique(found.within(low, high).gain), high]
    (counts,) = counts_over((ends[1:] + ends[:-1]) / 2, [found], reference, np.array([there]))
    return joined([(float(a), float(b)) for a, b, n in zip(ends[:-1], ends[1:], counts, strict=True) if n == 0 < b - a])


def confirmed(found: Crossings, low: float, high: float, is_stable: Callable[[float], bool]) -> list[Window]:
    """The intervals between `low` and `high`, which may be infinite, in which nothing is beyond the curve.

    Between two crossings the count is constant, and only where it is least it may be 0: there `is_stable` is asked at
    one gain.  Gaps that rounding tears between crossings of one gain are none.  Where it is stable in none of these
    `is_stable` is asked between all: next to z = 1 rounding may have made a crossing, and the counts are wrong.
    """
    gains = found.within(low, high).gain
    edges = np.r_[low, gains[np.r_[True, np.diff(gains) > SAME_EDGE * abs(gains[1:])][: gains.size]], high]
    beyond = 2 * (abs(edges[np.isfinite(edges)]).max(initial=0.0) or 1.0)  # where nothing crosses: any would do
    inner = np.clip(edges, -beyond, beyond)
    middles = (inner[1:] + inner[:-1]) / 2
    counts = found.passed(middles)  # the same up to a constant
    is_least = counts == counts.min()
    stable = [i for i in np.flatnonzero(is_least) if is_stable(float(middles[i]))]
    stable = stable or [i for i in np.flatnonzero(~is_least) if is_stable(float(middles[i]))]
    return joined([(float(edges[i]), float(edges[i + 1])) for i in stable])


def joined(windows: list[Window]) -> list[Window]:
    """Neighbours with a common edge are one (two crossings that cancel)."""
    merged: list[Window] = []
    for low, high in windows:
        if merged and merged[-1][1] == low:
            merged[-1] = (merged[-1][0], high)
        else:
            merged.append((low, high))
    return merged
