"""How many natural frequencies lie below a given one: a count, not a search.

Wittrick and Williams (1971) count through the pivots of a dynamic stiffness; Howson and Williams (1973) start from the
beam whose frequencies are known in closed form.  Put together for a chain of segments the count becomes a climb from
the payload to the hub, each step a sign (`tfarm.exact.count`):

* with both ends of a segment pinned, n pi < k counts the waves that fit (and W = 0, Psi = const above the cut-off);
* releasing a motion, or adding inertia to it, raises the count by 0 or 1, holding it lowers the count by 0 or 1
  (Rayleigh's theorem on one constraint);
* the parity of each count is the sign of that system's characteristic function D(i w).

A double root changes no sign and still raises the count by two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tfarm.exact.count import bisect_chain, chain_counts, rows_to_count
from tfarm.exact.layout import Layout
from tfarm.exact.system import System


class Counter:
    """N(omega) of a system: how many natural frequencies [rad/s] lie below omega, the rigid-body mode included."""

    def __init__(self, system: System) -> None:
        self._rows, self._ends = rows_to_count(Layout(system.with_damping(0.0)))

    def __call__(self, omega: NDArray[np.float64]) -> NDArray[np.int64]:
        """The counts, in the shape of omega (1-D, rad/s, positive)."""
        return chain_counts(np.ascontiguousarray(omega, dtype=float), self._rows, self._ends)

    def first_reaching(self, number: NDArray[np.int64], below: float) -> NDArray[np.float64]:
        """The smallest floats [rad/s] with a count of `number` at least, by bisection of 0..below."""
        low, high = np.zeros(number.size), np.full(number.size, below)
        bisect_chain(number, self._rows, self._ends, low, high)
        return high
