"""How a loop changes with the coefficients of its law: poles, the loop function, what a slew leaves.

A law C becomes C + dC, as a system beside it.  A pole z of the closed loop with eigenvectors w (left) and v (right),
w v = 1, then moves by

    dz = -(w b) sum over signals of dC_i(z) y_i,

b what a unit at the input of the plant does to the states, y what the signals are in the state v.  dC is that of the
entries, polynomials in s, at s = z or, of a law made discrete by Tustin's rule, at s = 2/T (z - 1)/(z + 1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tfarm.arm.blocks import Matrices
from tfarm.arrays import Complex
from tfarm.records import record
from tfarm.reduced.sensed import closed
from tfarm.synthesis.structures import Slope

AT_NYQUIST = 1e-12  # of z = -1, where Tustin's s is infinite


@dataclass(frozen=True)
@record
class Clock:
    """The `period` [s] of a sampled loop, None of a continuous one; `estimate` is the pole in z of the filter of a rate
    that is a difference of the angle, None where it is measured."""

    period: float | None
    estimate: float | None = None

    def laplace(self, z: Complex) -> Complex:
        """s of a law's own, by Tustin's rule."""
        if self.period is None:
            return z
        beside = z + 1.0
        return 2 / self.period * (z - 1.0) / np.where(abs(beside) < AT_NYQUIST, AT_NYQUIST, beside)


def changes(slopes: Sequence[Slope], signals: Sequence[str], z: Complex, clock: Clock) -> Complex:
    """dC_i/dx_j (signals, coefficients, n) at poles or points z (n,); 0 at a pole of the law, where it has no value."""
    s, n = clock.laplace(z), len(slopes[0].num)
    found = np.zeros((len(signals), n, z.size), complex)
    for entry, num, den in slopes:
        whole = np.polyval(entry.den, s)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            C = np.polyval(entry.num, s) / whole
            d_num, d_den = (np.polyval(rows.T[..., None], s) for rows in (num, den))  # (coefficients, n)
            moved = (d_num - C * d_den) / whole
        moved = np.where(np.isfinite(moved), moved, 0.0)
        if entry.signal in signals:
            found[list(signals).index(entry.signal)] += moved
        else:  # the rate is made of the angle
            assert clock.period is not None
            assert clock.estimate is not None
            a = clock.estimate
            found[list(signals).index("hub_angle")] += moved * ((1 - a) / clock.period * (z - 1) / (z - a))
    return found


def pole_slopes(
    plant: Matrices, law: Matrices, slopes: Sequence[Slope], share: float, signals: Sequence[str], clock: Clock
) -> tuple[Complex, Complex]:
    """Poles (n,) of a plant under a law, and their slopes (n, coefficients); `share` is a factor on the whole law.

    Raises ParameterError for an algebraic loop.
    """
    whole = closed(plant, law)
    if not slopes:
        return np.linalg.eigvals(whole).astype(complex), np.zeros((len(whole), 0), complex)
    A, B, C, D = plant
    _, Bk, Ck, Dk = law
    found, right = np.linalg.eig(whole)
    poles, through = found.astype(complex), 1.0 + float((Dk @ D)[0, 0])
    push = np.linalg.inv(right) @ np.vstack([B, Bk @ D]) / through
    own = C @ right[: len(A)]
    seen = own - D @ (Dk @ own + Ck @ right[len(A) :]) / through
    change = share * changes(slopes, signals, poles, clock)
    return poles, np.asarray(-(push.T * np.einsum("ijk,ik->jk", change, seen)).T)
