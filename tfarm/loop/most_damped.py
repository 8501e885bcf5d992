"""Where along a locus the first mode is damped most: between the values of the locus, to the digits of its poles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tfarm.arm import NAMES, many_laws
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.records import record

from .damping import exact_poles_next_to
from .locus import Locus, locus

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

    Where it is the largest of the locus's values with a neighbour on either side that swings too, the poles between
    these are solved for, on ever narrower grids; at an end of the range, or next to where the pole turns real, it is
    that of the locus's own value.
    """
    rows = found.branches[(found.mode == 1) & (found.branches.imag > 0).any(axis=1)]
    rows = rows[~np.isnan(rows).any(axis=1)]
    if found.vary not in NAMES or not rows.size:
        return None
    branch, ratios = rows[0], damping_ratios(rows[0])
    at = int(np.argmax(ratios))
    gain, ratio = float(found.gain[at]), float(ratios[at])
    near = slice(at - 1, at + 2)
    if 0 < at < ratios.size - 1 and (branch[near].imag > 0).all():
        gain, ratio = _between(found, found.gain[near], branch[near])
    return MostDamped(gain, ratio, bool((branch[at:].imag > 0).all()), at < ratios.size - 1)


def damping_ratios(s: Complex) -> Real:
    """-Re s/|s| of poles that swing; -inf of real ones."""
    return np.where(s.imag > 0, -s.real / np.maximum(abs(s), LEAST_SIZE), -np.inf)


def _between(found: Locus, gain: Real, branch: Complex) -> tuple[float, float]:
    """The gain of largest damping ratio between three neighbours of which the middle one has the largest, and it.

    On each grid between them the branch is next to their parabola, or followed where that is too coarse.
    """
    best = float(gain[1]), float(damping_ratios(branch[1:2])[0])
    while gain[2] - gain[0] > NARROWEST_ROUND * abs(gain[1]):
        grid = np.linspace(gain[0], gain[2], ROUND_POINTS)
        starts = np.polyval(np.polyfit(gain - gain[1], branch, 2), grid - gain[1])
        near, settled = exact_poles_next_to(found.arm, starts[:, None], many_laws(found.law, **{found.vary: grid}))
        poles = near[:, 0]
        if not settled.all():
            ends = float(grid[0]), float(grid[-1])
            more = locus(found.arm, found.law, found.vary, *ends, grid.size, len(found.branches)).branches
            poles = more[np.argmin(abs(more[:, 0] - branch[0]))]
        ratios = damping_ratios(poles)
        at = int(np.argmax(ratios))
        if not 0 < at < ROUND_POINTS - 1:
            break
        best = float(grid[at]), float(ratios[at])
        gain, branch = grid[at - 1 : at + 2], poles[at - 1 : at + 2]
    return best
