"""Where along a locus the first mode is damped most: between the values of the locus, to the digits of its poles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import NAMES, Arm, many_laws
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.exact.characteristic import dimensionless, loop_system, quick_characteristics
from tfarm.records import record

from .locus import Locus, locus

ROUND_POINTS = 17  # of each round between two neighbours, so that it is an eighth as wide as the one before
CORRECTIONS = 6  # of Newton's method: the start is right to a few digits, so the last ones change nothing
LONGEST_CORRECTION = 0.1  # of |s|: a longer one would land anywhere, and more than WHOLE_CORRECTION in all is refused
LAST_CORRECTION = 1e-9  # of |s|: squared by the quadratic convergence, far below the last digit
WHOLE_CORRECTION = 0.05  # of |s|: farther from its start a pole may be another's
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


def exact_poles_next_to(arm: Arm, starts: Complex, laws: Real) -> tuple[Complex, NDArray[np.bool_]]:
    """The exact poles next to the starts (n, slots), and which settled there; nan where there is no start.

    `laws` (gains, n) are those of `many_laws`.
    """
    k = loop_system(arm)
    laws = dimensionless(k, laws)
    rows, columns = np.nonzero(~np.isnan(starts))
    s = starts[rows, columns]
    begin, move = s.copy(), np.zeros_like(s)
    for _ in range(CORRECTIONS):
        at = quick_characteristics(k, s, laws[:, rows])
        with np.errstate(all="ignore"):  # a start that runs away has not settled
            move = at.value / at.slope
        most = LONGEST_CORRECTION * abs(s)
        move = np.where(np.isfinite(move), move, LONGEST_CORRECTION * s)
        s = s - np.where(abs(move) > most, move * (most / np.maximum(abs(move), LEAST_SIZE)), move)
    polished, settled = np.full(starts.shape, np.nan, complex), np.ones(starts.shape, bool)
    polished[rows, columns] = s
    settled[rows, columns] = (abs(move) < LAST_CORRECTION * abs(s)) & (abs(s - begin) < WHOLE_CORRECTION * abs(s))
    return polished, settled
