"""What the branches of a locus may hide: a crossing there and back between two values, unstable poles on none of them.

Along a gain the crossing engine knows every crossing of the imaginary axis, whoever crosses it (`lines`).  Along a
parameter of the arm, where branches end, the poles of a few loops are counted in a box.
"""

from __future__ import annotations

import numpy as np

from tfarm.arrays import Complex, Real
from tfarm.errors import ConvergenceError
from tfarm.response.frequency import AXIS_SHARE
from tfarm.spectrum.scales import first_frequency

from .crossings import BranchCrossing
from .lines import line_crossings
from .poles import count_with_mirrors, poles_below
from .variation import Variation

SAME_CROSSING = 1e-6  # of gain and frequency: two roads to one crossing
LOOPS = 12  # whose poles are counted along a parameter of the arm
BOX_HEIGHTS = (0.97, 0.95, 0.93, 0.9)  # that are tried, as shares of the lowest end of the highest branch


def with_others(
    variation: Variation, gain: Real, branches: Complex, found: tuple[BranchCrossing, ...]
) -> tuple[BranchCrossing, ...]:
    """The crossings found on the branches, and those of poles on none, up to the frequency of the highest branch.

    Where at some value none of them swings, up to the first flexible frequency.
    Raises ConvergenceError where a parameter of the arm varies and at one of a few values more poles are unstable than
    branches are.
    """
    top = float(np.fmax.reduce(branches.imag, axis=0).min()) or first_frequency(variation.at(float(gain[0])).arm)
    if not variation.is_of_gains:
        for n in np.unique(np.linspace(0, gain.size - 1, LOOPS).round().astype(int)):
            here = branches[:, n]
            right = (here.real > AXIS_SHARE * abs(here)) & (abs(here.imag) < top)
            poles = poles_below(variation.at(float(gain[n])), top, factors=BOX_HEIGHTS)
            if poles.unstable > count_with_mirrors(here[right]):
                where = f"at {variation.vary} = {gain[n]:.6g}"
                text = f"{where} an unstable pole is on none of the branches that could be followed: use another range"
                raise ConvergenceError(text, poles.values, n)
        return found
    way, width = np.sign(gain[-1] - gain[0]), abs(gain[-1] - gain[0])
    ends = gain.min() + SAME_CROSSING * width, gain.max() - SAME_CROSSING * width
    inside = line_crossings(variation.arm, variation.line, top).within(*ends)
    more = [
        BranchCrossing(gain=t, omega=w, branch=None, direction="unstable" if change * way > 0 else "stable")
        for t, w, change in inside
        if not any(
            abs(t - it.gain) <= SAME_CROSSING * width and abs(w - it.omega) <= SAME_CROSSING * top for it in found
        )
    ]
    return tuple(sorted([*found, *more], key=lambda each: (way * each.gain, each.omega)))
