"""One quadratic Lyapunov function for two matrices, and so for everything between them, proven in whole numbers.

If P > 0 and P - A^T P A > 0 for both ends A_lo, A_hi of a segment, then V = s^T P s falls at every sample for *any*
sequence of matrices of that segment, for A -> A^T P A is convex.  Where the ends differ by a matrix of rank one such a
P exists exactly where the circle criterion holds (Kalman-Yakubovich-Popov lemma); P is found in float64 by a Riccati
equation, and its inequalities are then checked without any rounding: matrices of doubles are whole numbers over a power
of two, and Bareiss' elimination (1968) keeps them whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are, solve_triangular

from tfarm.arrays import Real
from tfarm.exact.whole import as_integers, falls, is_positive_definite
from tfarm.records import record

SLACKS = (1e-3, 1e-5, 1e-7, 1e-9)  # how strictly the inequality is asked for, in balanced states
BITS_OF_P = 60  # bits that P is rounded to before the proof
DOUBLINGS = 40  # of the number of samples that a sum over all of them has: 10^12, after which any mode has died down


@dataclass(frozen=True)
@record
class CommonLyapunov:
    """V = s^T P s falls with both matrices `low` and `high` (n, n), and with all between them.

    `contraction` rho < 1: |s| in the norm of P shrinks at least by it at every sample (float64).
    """

    low: Real
    high: Real
    P: Real
    contraction: float

    @cached_property
    def root(self) -> Real:
        """L with P = L L^T: the norm is |L^T s|."""
        return np.asarray(np.linalg.cholesky(self.P), dtype=float)

    def is_proven(self) -> bool:
        """Whether P > 0 and both inequalities hold in exact arithmetic.

        In the states 2^k s, k whole and such that P has diagonal entries near 1: units of length, torque and stiffness
        then leave P all its digits, and nothing is rounded by the change of units, for powers of two are exact.
        """
        diagonal = np.diag(self.P)
        if not (np.isfinite(self.P).all() and (diagonal > 0).all()):
            return False
        units = 2.0 ** np.round(-np.log2(diagonal) / 2)
        scaled = self.P * units * units[:, None]
        P, _ = as_integers(np.round(np.ldexp(scaled / abs(scaled).max(), BITS_OF_P)))
        ends = (A * units / units[:, None] for A in (self.low, self.high))
        return is_positive_definite(P) and all(falls(P, A) for A in ends)


def common_lyapunov(middle: Real, drive: Real, sense: Real, low: Real, high: Real) -> CommonLyapunov | None:
    """The Lyapunov function of the segment from `low` to `high`, or None where none is found.

    `middle` lies between them, and drive sense^T is half of low - high.  Of several strictnesses the best is taken.
    Where `middle` is not stable there is none.
    """
    if not abs(np.linalg.eigvals(middle)).max() < 1.0:
        return None
    scale = _sizes(middle, drive)
    A, b, c = middle * scale / scale[:, None], (drive / scale)[:, None], (sense * scale)[None]
    found: list[CommonLyapunov] = []
    for slack in SLACKS:
        try:
            P = solve_discrete_are(A, b, c.T @ c + slack * (c @ c.T).item() * np.eye(len(A)), -np.eye(1))
            P = (P + P.T) / 2 / scale / scale[:, None]
            L = np.linalg.cholesky(P)
        except (LinAlgError, ValueError):
            continue
        ends = [solve_triangular(L, (L.T @ each).T, lower=True) for each in (low, high)]
        rho = float(max(np.linalg.norm(each, 2) for each in ends))
        if rho < 1.0:
            found.append(CommonLyapunov(low, high, P, rho))
    return min(found, key=lambda each: each.contraction, default=None)


def _sizes(A: Real, b: Real) -> Real:
    """How far each state goes after one push: the root of its sum of squares, by doubling."""
    total, power = np.outer(b, b), A
    for _ in range(DOUBLINGS):
        total, power = total + power @ total @ power.T, power @ power
    size: Real = np.sqrt(np.diag(total))
    return np.where(size > 0, size, 1.0)
