"""What the modes left out of a damped arm add: not all at once, but with the slow poles that accumulate at -1/C.

At C > 0 high bending modes are overdamped, and infinitely many slow real poles lie between -1/C and a small multiple of
it. A static remainder D takes them for instantaneous, which is wrong where a torque has switched a few C before a
sample.  So D becomes  sum of D_j/(1 + s/c_j) + the rest, c_j = 1/C times a few ratios, fitted to the exact arm at real
s > 0; at s = 0 nothing changes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tfarm.arrays import Complex, Real

CORNER_RATIOS = 1 + np.geomspace(0.02, 30.0, 14)  # c_j C, and below s C of the fit: tuned by hand on the lab arm
SLOW_PAIRS = CORNER_RATIOS.size // 2  # the corners, two a pair
FITTED_AT = np.geomspace(0.02, 5.0, 60)  # s C at which they are fitted: tuned with CORNER_RATIOS
ALIKE = 1e-12  # of the largest singular value: corners that differ by less share their weight
SLOW_POLES_FROM = 1.2  # C w of the last mode from which on it serves; below, the modes left out still ring


def slow_remainder(C: float, missing: Callable[[Complex], Complex]) -> tuple[Real, Real]:
    """The corners c_j (m,) [1/s] and the shares D_j (outputs, m), C being the damping [s].

    `missing` gives what the modes leave out of each output (outputs, n) at s (n,).
    """
    basis = 1 / (1 + FITTED_AT[:, None] / CORNER_RATIOS) - 1
    left = missing((FITTED_AT / C).astype(complex)).real
    shares: Real = np.linalg.lstsq(basis, left.T, rcond=ALIKE)[0].T.astype(float)
    return CORNER_RATIOS / C, shares
