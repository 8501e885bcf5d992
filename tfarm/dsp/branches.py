"""Poles of a sampled loop along a number of its law, as branches."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from tfarm.arrays import Complex, Real, Whole


def follow_branches(poles: Sequence[Complex], values: Real) -> Complex:
    """Return the poles at each of the values, in any order, as branches (values, poles): each column is continuous.

    The values must be close enough for branches to be distinguished.
    """
    rows: list[Complex] = []
    for number, z in enumerate(poles):
        ahead = rows[-1] if rows else z
        if len(rows) > 2:
            before, last, wanted = values[number - 2 : number + 1]
            ahead = ahead + (wanted - last) / (last - before) * (rows[-1] - rows[-2])
        rows.append(z[match_poles(ahead, z)])
    return np.array(rows)


def match_poles(ahead: Complex, z: Complex) -> Whole:
    """Return the poles in the order of the branches that they continue: the assignment of least total distance."""
    _, order = linear_sum_assignment(abs(ahead[:, None] - z))
    return order
