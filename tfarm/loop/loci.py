"""The exact locus of a gain beside that of a reduced model, over as much of a range as can be followed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tfarm.arm import NAMES, Arm, HubFeedback, unit_of, written_unit
from tfarm.arrays import Complex
from tfarm.columns import Column
from tfarm.errors import ConvergenceError
from tfarm.records import record

from .crossings import crossing_answers
from .law_answers import law_answer
from .locus import Locus, locus
from .most_damped import most_damped
from .reduced_locus import ReducedLocus, reduced_locus
from .variation import VARIABLES

LOCUS_POINTS = 300  # values of the gain
LOCUS_TRIES = ((7, 1.0), (4, 1.0), (4, 0.75), (2, 0.5))  # branches, and how much of the range they are followed over
POLE_DIGITS = 10  # digits of |s| that are drawn and written: poles differ from processor to processor by 1e-14 at most
GAPS_HELD = 5  # digits of a gap, 1e-5 of |s| or less between two such poles
GAP_NOTE = (
    "largest distance of a branch from the reduced one, over |s| or the arm's first flexible frequency, the larger"
)
BRANCHES_NOTE = (
    "zeros followed: those at s = 0, then one a mode with Im s > 0; its mirror image only where the two part on the "
    "real axis. A crossing of a branch with omega > 0 is one of its mirror image too. A branch that comes to -1/C, "
    "where real poles accumulate, ends there and is null beyond; then crossings of poles on no branch are listed too "
    "(branch null)."
)


@dataclass(frozen=True)
@record
class Loci:
    """The exact locus, the reduced one beside it, and the gain that was to be reached."""

    exact: Locus
    reduced: ReducedLocus
    wanted: float

    @property
    def is_cut(self) -> bool:
        """Whether the branches could not be followed to the end of the range."""
        return float(self.exact.gain[-1]) != self.wanted

    @property
    def name(self) -> str:
        """What varies."""
        return self.exact.vary

    @property
    def unit(self) -> str:
        """Of what varies."""
        return written_unit(self.exact.vary, self.exact.arm).strip()


def held_branches(branches: Complex) -> Complex:
    """Branches to the digits that hold on every processor: as shares of |s|, so that a small Re s keeps its place."""
    size = np.maximum(abs(branches), np.finfo(float).tiny)
    unit = 10.0 ** (np.floor(np.log10(size)) + 1 - POLE_DIGITS)
    return np.round(branches.real / unit) * unit + 1j * (np.round(branches.imag / unit) * unit)


def branch_columns(branches: Complex, key: str, title: str = "") -> list[Column]:
    """Two columns a branch, Re s and Im s, empty where it is not followed; key and title name branch `n` and `part`."""
    return [
        Column(key.format(n=n, part=part[:2].lower()), title.format(n=n, part=part), "1/s",
               of=["" if np.isnan(s) else x for s, x in zip(row, values.tolist(), strict=True)])
        for n, row in enumerate(branches) for part, values in (("Re s", row.real), ("Im s", row.imag))
    ]  # fmt: skip


def loci(arm: Arm, law: HubFeedback, vary: str, start: float, stop: float) -> Loci:
    """Both loci of one gain: fewer branches, or less of the range, where more cannot be followed.

    Raises ConvergenceError where none can, and what `reduced_locus` raises.
    """
    lost: ConvergenceError | None = None
    for branches, share in LOCUS_TRIES:
        end = start + share * (stop - start)
        try:
            exact = locus(arm, law, vary, start, end, LOCUS_POINTS, branches)
        except ConvergenceError as error:
            lost = error
            continue
        return Loci(exact, reduced_locus(exact), stop)
    assert lost is not None
    raise lost


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
