"""What `tfarm locus` prints with --json: a plain dictionary."""

from __future__ import annotations

from typing import Any

import numpy as np

from tfarm.arm import NAMES, unit_of

from .answers import law_answer
from .crossings import crossing_answers
from .locus import Locus
from .most_damped import most_damped
from .reduced_locus import ReducedLocus
from .variation import VARIABLES

GAP_NOTE = (
    "largest distance of a branch from the reduced one, over |s| or the arm's first flexible frequency, the larger"
)
BRANCHES_NOTE = (
    "zeros followed: those at s = 0, then one a mode with Im s > 0; its mirror image only where the two part on the "
    "real axis. A crossing of a branch with omega > 0 is one of its mirror image too. A branch that comes to -1/C, "
    "where real poles accumulate, ends there and is null beyond; then crossings of poles on no branch are listed too "
    "(branch null)."
)


def locus_answer(exact: Locus, reduced: ReducedLocus) -> dict[str, Any]:
    """The branches at each gain, where they cross the imaginary axis, and the gap to the reduced model's locus."""
    best = most_damped(exact)
    return {
        "arm": exact.arm.name,
        **law_answer(exact.law, exact.arm),
        "vary": exact.vary,
        "unit": unit_of(exact.vary, exact.arm) if exact.vary in NAMES else VARIABLES[exact.vary],
        "gain": exact.gain.tolist(),
        "mode": exact.mode.tolist(),
        "branches": [[None if np.isnan(s) else [s.real, s.imag] for s in row] for row in exact.branches.tolist()],
        "branches_note": BRANCHES_NOTE,
        "crossings": crossing_answers(exact.crossings),
        "ends": [{"branch": branch, "gain": gain} for branch, gain in exact.ends],
        "first_mode_most_damped": best and {"gain": best.gain, "damping_ratio": best.damping_ratio},
        "gap_to_reduced": reduced.worst,
        "gap_by_branch": reduced.gap.tolist(),
        "gap_note": GAP_NOTE,
        "reduced_order": reduced.order,
        "reduced_points": int(reduced.gain.size),
    }
