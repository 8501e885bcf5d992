"""How many natural frequencies lie below a given one: a count, not a search.

Wittrick and Williams (1971) count through the pivots of a dynamic stiffness; Howson and Williams (1973) start from the
beam whose frequencies are known in closed form.  Put together for this arm the count becomes a chain of signs:

* with both ends pinned, n pi < k counts the waves that fit (and W = 0, Psi = const above the cut-off);
* adding inertia to one motion of the tip or the root, or releasing it, raises the count by 0 or 1, holding
  it lowers the count by 0 or 1 (Rayleigh's theorem on one constraint);
* the parity of each count is the sign of that arm's characteristic function D(i w).

So four signs of D, for four neighbouring arms, turn a closed form into the count for any hub and payload.  A
double root changes no sign and still raises the count by two.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from tfarm.exact.axis import bisect, drives
from tfarm.exact.chain import ElementChain
from tfarm.exact.chain_axis import bisect_chain, chain_counts, rows_to_count
from tfarm.exact.coefficients import Coefficients, EndCondition
from tfarm.exact.system import System
from tfarm.exact.vector import DAMPING


class ChainCounter:
    """N(omega) of a chain, as `Counter` is of an arm (see `tfarm.exact.chain_axis`)."""

    def __init__(self, chain: ElementChain) -> None:
        self._rows, self._ends = rows_to_count(chain.with_damping(0.0).at())

    def __call__(self, omega: NDArray[np.float64]) -> NDArray[np.int64]:
        """The counts, in the shape of omega (1-D, rad/s, positive)."""
        return chain_counts(np.ascontiguousarray(omega, dtype=float), self._rows, self._ends)

    def first_reaching(self, number: NDArray[np.int64], below: float) -> NDArray[np.float64]:
        """The smallest floats [rad/s] with a count of `number` at least, by bisection of 0..below."""
        low, high = np.zeros(number.size), np.full(number.size, below)
        bisect_chain(number, self._rows, self._ends, low, high)
        return high


def counter_of(k: System) -> Counter | ChainCounter:
    """The count of a system."""
    return ChainCounter(k) if isinstance(k, ElementChain) else Counter(k)


class Counter:
    """N(omega) of one arm: how many natural frequencies [rad/s] lie below omega, the rigid-body mode included."""

    def __init__(self, k: Coefficients) -> None:
        self._kernel = k.kernel
        rows, self._steps = steps_of(k)
        self._ends = np.array(rows, dtype=float).reshape(-1, 9)

    def __call__(self, omega: NDArray[np.float64]) -> NDArray[np.int64]:
        """The counts, in the shape of omega (1-D, rad/s, positive)."""
        values, count = drives(omega, self._kernel, self._ends)
        for value, step in zip(values, self._steps, strict=True):
            count = count + step * ((count % 2 == 1) != (value < 0))
        return count

    def first_reaching(self, number: NDArray[np.int64], below: float) -> NDArray[np.float64]:
        """The smallest floats [rad/s] with a count of `number` at least, by bisection of 0..below."""
        kernel = self._kernel.copy()
        kernel[DAMPING] = 0.0
        low, high = np.zeros(number.size), np.full(number.size, below)
        bisect(number, kernel, self._ends, np.array(self._steps, np.int64), low, high)
        return high


def steps_of(k: Coefficients) -> tuple[list[list[Fraction]], list[int]]:
    """The arms from pinned-pinned to this one, as rows of end conditions, and the step of the count at each."""
    none = Fraction(0)
    arm = replace(k, tip_mass=math.inf, tip_inertia=none, hub_inertia=none)
    rows, steps = [], []
    for part in ("tip_inertia", "tip_mass", "hub_inertia"):
        inertia = getattr(k, part)
        if inertia != getattr(arm, part):
            arm = replace(arm, **{part: inertia})
            rows.append(end_row(arm))
            steps.append(-1 if inertia == math.inf else 1)
    return rows, steps


def end_row(k: Coefficients) -> list[Fraction]:
    """The nine numbers of the arm's own end conditions: tip mass, tip inertia, hub."""
    ends = (EndCondition.of(inertia) for inertia in (k.tip_mass, k.tip_inertia, k.hub_inertia))
    return [number for end in ends for number in (end.rest, end.inertia, end.force)]
