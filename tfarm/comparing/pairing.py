"""Closed-loop poles by mode: the assignment of least total distance to the poles of the open loop."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import linear_sum_assignment

from tfarm.arrays import Complex

FARTHEST = 1.0  # |ln s - ln p|: by more a law moves no mode here, a factor e of its frequency or 57 deg of its angle
HUB = 0  # stands for the pole below the first mode that no mode of the link is near


def poles_by_mode(poles: Complex, open_loop: Mapping[int, complex]) -> dict[int, complex]:
    """The poles s with Im s > 0 by the mode whose open-loop pole p is theirs; a single one below all of these is `HUB`.

    One a mode, by the least sum of |ln s - ln p|; what is farther than `FARTHEST` from its own belongs to no mode.
    """
    modes, own = list(open_loop), np.array(list(open_loop.values()))
    apart = np.minimum(abs(np.log(poles)[:, None] - np.log(own)), FARTHEST)
    rows, columns = linear_sum_assignment(apart)
    near = apart[rows, columns] < FARTHEST
    found = {modes[column]: complex(poles[row]) for row, column in zip(rows[near], columns[near], strict=True)}
    others = np.delete(poles, rows[near])
    below = others[abs(others) < min((abs(s) for s in found.values()), default=0.0)]
    return dict(sorted(found.items())) if below.size != 1 else {HUB: complex(below[0])} | dict(sorted(found.items()))
