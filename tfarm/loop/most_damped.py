"""Where along a locus the first mode is damped most: between the values of the locus, to the digits of its poles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tfarm.arm import NAMES
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.crossing.following import between
from tfarm.records import record

from .locus import Locus

ROUND_POINTS = 17  # of each round between two neighbours, so that it is an eighth as wide as the one before
NARROWEST_ROUND = 1e-7  # of the gain: where rounds end; a damping ratio, flat there, is known to 1e-14 of its curvature


@dataclass(frozen=True)
@record
class MostDamped:
    """The `gain` at which mode 1 has its largest `damping_ratio`, and whether it still swings on all of the way there
    from it (`swings_on`) and is damped less beyond (`falls`)."""

    gain: float
    damping_ratio: float
    swings_on: bool
    falls: bool


def most_damped(found: Locus) -> MostDamped | None:
    """The first mode's largest damping ratio along a gain; None where its branch is not followed all the way.

    Where it is the largest of the locus's values with a neighbour on either side that swings too, it is looked for
    between these, on ever narrower grids; at an end of the range it is that of the locus's own value.
    """
    rows = found.branches[(found.mode == 1) & (found.branches.imag > 0).any(axis=1)]
    rows = rows[~np.isnan(rows).any(axis=1)]
    if found.vary not in NAMES or not rows.size:
        return None
    way, ratios = int(np.sign(found.gain[-1] - found.gain[0])), damping_ratios(rows[0])
    at = int(np.argmax(ratios))
    best, near = (float(found.gain[at]), float(ratios[at])), slice(at - 1, at + 2)
    gain, branch = found.gain[near][::way], rows[0][near][::way]
    inside = 0 < at < ratios.size - 1 and (branch.imag > 0).all()
    while inside and gain[2] - gain[0] > NARROWEST_ROUND * abs(gain[1]):
        grid = np.linspace(gain[0], gain[2], ROUND_POINTS)
        found_there = between(found.varied, gain, branch[:, None], grid)[:, 0]
        top = int(np.nanargmax(damping_ratios(found_there)))
        if not 0 < top < ROUND_POINTS - 1:
            break
        gain, branch = grid[top - 1 : top + 2], found_there[top - 1 : top + 2]
        best = float(gain[1]), float(damping_ratios(branch[1:2])[0])
    return MostDamped(*best, bool((rows[0][at:].imag > 0).all()), at < ratios.size - 1)


def damping_ratios(s: Complex) -> Real:
    """-Re s/|s| of poles that swing; -inf of real ones."""
    return np.where(s.imag > 0, -s.real / np.maximum(abs(s), LEAST_SIZE), -np.inf)
