"""What objectives are the largest of, and the slopes of each: growth and damping of poles, and dips along a curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Law
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.records import record
from tfarm.synthesis.law_slopes import Clock, changes
from tfarm.synthesis.sampled import REAL_ANGLE, disk_of
from tfarm.synthesis.structures import Slope

Sloped = tuple[Real, Real]  # values (m,) and slopes (m, n)

GROWTH_SEEN = -1.2  # a sample, or of |s|: poles that grow less, |z| < 0.3, are left out while others grow more
POLES_SEEN = 40  # poles that count, those that grow most: by hand
PEAKS_SEEN = 12  # highest places of a curve that count: by hand
LONGEST_MARGIN = 100.0  # samples, or s: the delay margin where |L| is nowhere 1


def growth_pieces(growth: Real, slopes: Real) -> Sloped:
    """The poles that are nearest to growing."""
    order = np.argsort(-growth, kind="stable")[:POLES_SEEN]
    order = order[growth[order] > GROWTH_SEEN] if growth[order[0]] > GROWTH_SEEN else order[:1]
    return growth[order], slopes[order]


def damping_pieces(z: Complex, moves: Complex, counted: NDArray[np.bool_]) -> Sloped:
    """-zeta of the oscillating poles in z that are counted; -1 where there is none."""
    oscillating = counted & (np.angle(z) > REAL_ANGLE) & (z != 0)
    z, moves = z[oscillating], moves[oscillating]
    if not z.size:
        return -np.ones(1), np.zeros((1, moves.shape[1]))
    return directions(np.log(z), moves / z[:, None])  # both times the period


def directions(s: Complex, moves: Complex) -> Sloped:
    """Re s/|s| (n,) of poles [1/s], of an oscillating one -zeta, and its slopes (n, coefficients)."""
    size = np.maximum(abs(s), LEAST_SIZE)
    slopes = moves.real / size[:, None] - (s.real / size**3)[:, None] * (s.conj()[:, None] * moves).real
    return np.asarray(s.real / size), np.asarray(slopes)


@dataclass(frozen=True)
@record
class LoopCurve:
    """What the loop function is made of on a curve: `places` i w or i q, points s or z, the plant (signals, n) there.

    `unit` [s] of an angle is a sample, 1 of a frequency.
    """

    places: Complex
    points: Complex
    plant: Complex
    signals: tuple[str, ...]
    clock: Clock
    unit: float

    def pieces(self, objective: str, law: Law, slopes: Sequence[Slope]) -> Sloped:
        """-disk margin, |S| or -delay [s] at the lowest dips of the curve, and their slopes."""
        L = self.loop_function(law)
        if objective == "delay":
            return self._delay(L, slopes)
        apart = 1.0 + L
        if objective == "sensitivity":
            f = 1 / abs(apart)
            slope = -(f[:, None] ** 2) * (apart.conj() / abs(apart))[:, None]
        else:
            f = -disk_of(L)
            slope = f[:, None] * (1 / apart + 1 / (1.0 - L))[:, None]
        padded = np.r_[-np.inf, f, -np.inf]
        (peaks,) = np.nonzero((f >= padded[:-2]) & (f >= padded[2:]))
        at = np.asarray(peaks[np.argsort(-f[peaks], kind="stable")[:PEAKS_SEEN]])
        return f[at], np.asarray((slope[at] * self._moves(at, slopes)).real)

    def loop_function(self, law: Law) -> Complex:
        """L (n,) of a law that reads some of the signals."""
        total = np.zeros(self.points.size, complex)
        for name, value in zip(law.signals, law.values(self.points), strict=True):
            total += value * self.plant[self.signals.index(name)]
        return total

    def _moves(self, at: NDArray[np.int64], slopes: Sequence[Slope]) -> Complex:
        """dL/dx (points, coefficients)."""
        if not slopes:
            return np.zeros((at.size, 0), complex)
        change = changes(slopes, self.signals, self.points[at], self.clock)
        return np.asarray(np.einsum("ijk,ik->kj", change, self.plant[:, at]))

    def _delay(self, L: Complex, slopes: Sequence[Slope]) -> Sloped:
        """-delay where |L| passes 1, between two points along straight lines."""
        q = self.places.imag
        size, turn = np.log(np.maximum(abs(L), LEAST_SIZE)), np.mod(np.pi + np.unwrap(np.angle(L)), 2 * np.pi)
        (at,) = np.nonzero(size[1:] * size[:-1] <= 0)
        at = at[size[at] != size[at + 1]]
        n = len(slopes[0].num) if slopes else 0
        if not at.size:
            return np.array([-LONGEST_MARGIN * self.unit]), np.zeros((1, n))
        ends = [self._moves(at + k, slopes) / L[at + k, None] for k in (0, 1)]  # d ln L
        gap = (size[at] - size[at + 1])[:, None]
        share = size[at] / gap[:, 0]
        d_share = (ends[0].real - share[:, None] * (ends[0] - ends[1]).real) / gap
        step = np.mod(turn[at + 1] - turn[at] + np.pi, 2 * np.pi) - np.pi
        angle, left = q[at] + share * (q[at + 1] - q[at]), np.mod(turn[at] + share * step, 2 * np.pi)
        d_angle = d_share * (q[at + 1] - q[at])[:, None]
        d_left = ends[0].imag + d_share * step[:, None] + share[:, None] * (ends[1] - ends[0]).imag
        delay = left / angle
        d_delay = (d_left - delay[:, None] * d_angle) / angle[:, None]
        long = delay > LONGEST_MARGIN
        return -self.unit * np.minimum(delay, LONGEST_MARGIN), -self.unit * np.where(long[:, None], 0.0, d_delay)
