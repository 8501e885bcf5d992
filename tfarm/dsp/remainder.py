"""What the modes left out of a damped arm add: not all at once, but with the slow poles that accumulate at -1/C.

At C > 0 high bending modes are overdamped, and infinitely many slow real poles lie between -1/C and a small multiple of
it. A static remainder D takes them for instantaneous, which is wrong where a torque has switched a few C before a
sample.  So D becomes  sum of D_j/(1 + s/c_j) + the rest, c_j = 1/C times a few ratios, fitted to the exact arm at real
s > 0; at s = 0 nothing changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tfarm.dsp.plant import Plant

Complex = NDArray[np.complexfloating[Any, Any]]

RATIOS = 1 + np.geomspace(0.02, 30.0, 14)  # c_j C, and below s C of the fit: tuned by hand on the lab arm
AT = np.geomspace(0.02, 5.0, 60)
OVERDAMPED = 1.2  # C w of the last mode from which on it is fitted; below, the modes left out still ring


def with_slow_remainder(plant: Plant, exact: Callable[[Complex], Complex], highest: float) -> Plant:
    """The plant with its static remainder spread over slow poles.

    Unchanged where its last mode, of natural frequency `highest` [rad/s], still rings.  `exact` gives the plant's
    outputs (outputs, n) at s (n,).
    """
    C = plant.arm.damping
    if C * highest < OVERDAMPED:
        return plant
    s, corners = (AT / C).astype(complex), RATIOS / C
    missing = (exact(s) - np.array([plant(each) for each in s]).T).real
    basis = 1 / (1 + AT[:, None] / RATIOS) - 1
    shares = np.linalg.lstsq(basis, missing.T, rcond=1e-12)[0].T
    return replace(
        plant,
        poles=np.r_[plant.poles, -corners],
        residues=np.c_[plant.residues, shares * corners],
        static=plant.static - shares.sum(axis=1),
        mode=np.r_[plant.mode, np.zeros(corners.size, np.int64)],
    )
