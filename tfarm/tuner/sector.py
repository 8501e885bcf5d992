"""Sectors of gains in which K may move as it likes: the discrete circle criterion on the exact sampled loop.

With H the pulse transfer function from torque to moment, rate feedback closed, and H_m = H/(1 + m H) the same with the
middle gain m = (lo + hi)/2 closed too,

    min over frequency of 1 + (lo + hi) Re H + lo hi |H|^2 > 0  and  H_lo stable
        <=>  H_m stable and (hi - lo)/2 max |H_m| < 1

so around m the widest sector has the radius 1/max|H_m|.  The peak is looked for on a grid that is dense around every
pole and then refined; as a grid proves nothing, the sector is proven afterwards by a Lyapunov function (see
`lyapunov`), which exists exactly where the criterion holds at all frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import MOMENT_GAIN
from tfarm.arrays import Real
from tfarm.dsp import Sampled
from tfarm.records import record
from tfarm.tuner.lyapunov import CommonLyapunov, common_lyapunov

RADIUS_SHARE = 0.99  # of the radius that the criterion allows: room for the modes left out, and for a strict proof
POLE_WIDTHS = np.r_[-np.geomspace(100.0, 0.01, 30), 0.0, np.geomspace(0.01, 100.0, 30)]  # around a pole's angle
NARROWEST_PEAK = 1e-12  # of a pole next to the circle: its distance from it is known to no less
EVEN_POINTS = 1001  # of half the circle, beside those around poles
PEAK_ROUNDS, PEAKS_REFINED, PEAK_POINTS = 4, 5, 41  # rounds, highest points in each, points about them: 20 times finer


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
        moment = self.loop.terms(z, None, np.ones(theta.size))[1 + self.loop.place(MOMENT_GAIN)]
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
