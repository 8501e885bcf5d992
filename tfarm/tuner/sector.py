"""Sectors of gains in which K may move as it likes: the discrete circle criterion on the exact sampled loop.

With H the pulse transfer function from torque to moment, rate feedback closed, and H_m = H/(1 + m H) the same with the
middle gain m = (lo + hi)/2 closed too,

    min over frequency of 1 + (lo + hi) Re H + lo hi |H|^2 > 0  and  H_lo stable
        <=>  H_m stable and (hi - lo)/2 max |H_m| < 1

so around m the widest sector has the radius 1/max|H_m|.  The peak is looked for on a grid that is dense around every
pole and then refined; as a grid proves nothing, the sector is proven afterwards by one quadratic Lyapunov function for
both ends, in whole numbers; it exists exactly where the criterion holds at all frequencies.

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
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve_discrete_are, solve_triangular

from tfarm.arm import MOMENT_GAIN
from tfarm.arrays import Real
from tfarm.dsp import Sampled
from tfarm.exact.rationals import as_integers, falls, is_positive_definite
from tfarm.records import record

SLACKS = (1e-3, 1e-5, 1e-7, 1e-9)  # how strictly the inequality is asked for, in balanced states
BITS_OF_P = 60  # bits that P is rounded to before the proof
DOUBLINGS = 40  # of the number of samples that a sum over all of them has: 10^12, after which any mode has died down
RADIUS_SHARE = 0.99  # of the radius that the criterion allows: room for the modes left out, and for a strict proof
POLE_WIDTHS = np.r_[-np.geomspace(100.0, 0.01, 30), 0.0, np.geomspace(0.01, 100.0, 30)]  # around a pole's angle
NARROWEST_PEAK = 1e-12  # of a pole next to the circle: its distance from it is known to no less
EVEN_POINTS = 1001  # of half the circle, beside those around poles
PEAK_ROUNDS, PEAKS_REFINED, PEAK_POINTS = 4, 5, 41  # rounds, highest points in each, points about them: 20 times finer


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


@dataclass(frozen=True)
@record
class MovingGain:
    """A sampled loop whose moment gain K moves: A(K) = open - K drive sense^T, apart from the free hub angle."""

    loop: Sampled

    @cached_property
    def open(self) -> Real:
        """The matrix with rate feedback alone."""
        return self.at(0.0)

    @cached_property
    def _fed_back(self) -> Real:
        """drive sense^T: what a gain of 1 takes off the matrix."""
        return self.open - self.at(1.0)

    @cached_property
    def sense(self) -> Real:
        """(n,): the moment read from the states."""
        dropped = len(self.loop.matrix()) - len(self.open)
        kept = self.loop.pulse.integrals_at + 2 - dropped  # the torque of the sample before: there the drive is 1
        return np.asarray(self._fed_back[kept])

    @cached_property
    def drive(self) -> Real:
        """(n,): what a torque of 1 adds to the states."""
        return np.asarray(self._fed_back @ self.sense / (self.sense @ self.sense))

    def at(self, K: float) -> Real:
        """The closed-loop matrix at a gain."""
        return self._under(K).reduced_matrix()

    def _under(self, K: float) -> Sampled:
        return self.loop.having(**{MOMENT_GAIN: K})

    def radius(self, m: float) -> float:
        """Half the width of the widest sector around m; 0 where m itself is unstable."""
        w, V = np.linalg.eig(self.at(m))
        if not abs(w).max() < 1.0:
            return 0.0
        r = (self.sense @ V) * np.linalg.solve(V, self.drive.astype(complex))
        return float(1.0 / _peak(r, w))

    def proof(self, lo: float, hi: float) -> CommonLyapunov | None:
        """The Lyapunov function of [lo, hi], proven in exact arithmetic; None where there is none."""
        half = (hi - lo) / 2
        found = common_lyapunov(
            self.at((lo + hi) / 2), np.sqrt(half) * self.drive, np.sqrt(half) * self.sense, self.at(lo), self.at(hi)
        )
        return found if found is not None and found.is_proven() else None

    def criterion(self, lo: float, hi: float, theta: Real) -> Real:
        """1 + (lo + hi) Re H + lo hi |H|^2 at z = e^{i theta}, by transfer functions."""
        z = np.exp(1j * theta)
        moment = self.loop.terms(z, None, np.ones(theta.size))[1 + self.loop.part(MOMENT_GAIN)]
        H = moment / self._under(0.0)(z)
        return np.asarray(1 + (lo + hi) * H.real + lo * hi * abs(H) ** 2)


def _peak(residues: NDArray[np.complexfloating], poles: NDArray[np.complexfloating]) -> float:
    """max over the unit circle of |sum of residues/(z - poles)|."""
    angle, width = abs(np.angle(poles)), np.maximum(1 - abs(poles), NARROWEST_PEAK)
    dense = (angle[:, None] + width[:, None] * POLE_WIDTHS).ravel()
    theta = np.unique(np.clip(np.r_[np.linspace(0, np.pi, EVEN_POINTS), dense], 0, np.pi))

    def size(theta: Real) -> Real:
        return np.asarray(abs((residues / (np.exp(1j * theta)[:, None] - poles)).sum(axis=1)))

    values = size(theta)
    for _ in range(PEAK_ROUNDS):
        best = np.argsort(values)[-PEAKS_REFINED:]
        low, high = theta[np.maximum(best - 1, 0)], theta[np.minimum(best + 1, theta.size - 1)]
        theta = np.unique((low[:, None] + (high - low)[:, None] * np.linspace(0, 1, PEAK_POINTS)).ravel())
        values = size(theta)
    return float(values.max())
