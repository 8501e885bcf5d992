"""Along one real gain g: where a zero of A + g B is on the curve, for which gain, and to which side it goes.

At a point of the curve the zero is there for g = -A/B, which is a gain where it is real: where

    h = Im(A conj B)

vanishes.  As g grows the pair of zeros goes to the left of the curve where h rises along it and to the right where h
falls (differentiate A + g B = 0).  Up the imaginary axis right is unstable; around the unit circle, counter-clockwise,
right is outside, unstable too.  (Neimark 1948; Gryazina, Polyak and Tremba 2008.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tfarm.records import record

Real = NDArray[np.float64]
Whole = NDArray[np.int64]
Complex = NDArray[np.complexfloating[Any, Any]]

BISECTIONS = 53  # of a bracket, which is narrower than its place: to the last bit


class Crossing(NamedTuple):
    """At the gain `t` zeros are on the curve at the place `at` and its mirror image: `change` more of them are beyond
    it for greater gains."""

    t: float
    at: float
    change: int


@dataclass(frozen=True)
@record
class Crossings:
    """Every `Crossing` along one gain: `gain` (n,), ascending, where each is `at` (n,) and its `change` (n,)."""

    gain: Real
    at: Real
    change: Whole

    @classmethod
    def of(cls, found: Iterable[tuple[float, float, int]]) -> Crossings:
        """Those crossings, the ones at no finite gain left out."""
        rows = sorted((float(t), float(at), int(change)) for t, at, change in found if np.isfinite(t))
        gain, at, change = zip(*rows, strict=True) if rows else ((), (), ())
        return cls(np.array(gain, dtype=float), np.array(at, dtype=float), np.array(change, dtype=np.int64))

    def __iter__(self) -> Iterator[Crossing]:
        rows = zip(self.gain.tolist(), self.at.tolist(), self.change.tolist(), strict=True)
        return (Crossing(*row) for row in rows)

    def __len__(self) -> int:
        return self.gain.size

    def within(self, low: float, high: float) -> Crossings:
        """Those at gains between two."""
        inside = (low < self.gain) & (self.gain < high)
        return Crossings(self.gain[inside], self.at[inside], self.change[inside])

    def passed(self, gains: Real) -> Whole:
        """How many zeros have gone beyond the curve between -infinity and each of the gains, those at it too."""
        total: Whole = np.r_[0, np.cumsum(self.change)][np.searchsorted(self.gain, gains, side="right")]
        return total


def brackets(h: Real) -> tuple[tuple[Whole, ...], Whole]:
    """Where h (..., points) changes sign between neighbours, as indices of the first, and what that changes.

    2 more zeros beyond the curve where h falls, 2 fewer where it rises, the mirror image counted.
    """
    sign = np.sign(h)
    before = np.nonzero(sign[..., 1:] * sign[..., :-1] < 0)
    return before, np.where(sign[before] > 0, 2, -2)


def bisected(f: Callable[[Real], Real], low: Real, high: Real) -> Real:
    """Where each of the functions f (n,) changes sign between `low` and `high` (n,), to the last bit."""
    start = np.sign(f(low)) if low.size else low
    for _ in range(BISECTIONS if low.size else 0):
        middle = (low + high) / 2
        left = np.sign(f(middle)) == start
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return (low + high) / 2


def solved(parts: Callable[[Real], tuple[Complex, Complex]], low: Real, high: Real) -> tuple[Real, Real]:
    """The place (n,) between `low` and `high` (n,) at which each bracket's gain is real, and that gain.

    `parts` gives A and B of every bracket at a place of each.
    """

    def h(place: Real) -> Real:
        A, B = parts(place)
        return np.asarray((A * B.conj()).imag)

    place = bisected(h, low, high)
    A, B = parts(place)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # no B to speak of: beyond any number
        return place, np.asarray(-(A * B.conj()).real / abs(B) ** 2)
