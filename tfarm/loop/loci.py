"""The exact locus of a gain with that of a reduced model, and a locus as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tfarm.arm import NAMES, Arm, HubFeedback, as_law, unit_of
from tfarm.arrays import Complex
from tfarm.columns import Column
from tfarm.records import record

from .crossings import crossing_answers
from .law_answers import law_answer, signals_answer
from .locus import Locus, locus
from .most_damped import most_damped
from .reduced_locus import ReducedLocus, reduced_locus
from .varied import ARM_PARAMETERS

LOCUS_POINTS, LOCUS_BRANCHES = 300, 7  # values of the gain, and branches
POLE_DIGITS = 10  # digits of |s| that are drawn and written: poles differ from processor to processor by 1e-14 at most
GAPS_HELD = 5  # digits of a gap, 1e-5 of |s| or less between two such poles
GAP_NOTE = (
    "largest distance of a branch from the reduced one, over |s| or the arm's first flexible frequency, the larger"
)
BRANCHES_NOTE = (
    "poles followed: those at s = 0, then one a mode with Im s > 0; its mirror image only where the two part on the "
    "real axis. A crossing of a branch with omega > 0 is one of its mirror image too. A branch is null where it is not "
    "followed: beyond -1/C, where real poles accumulate; outside the box of a law. Crossings of poles on no branch are "
    "listed too (branch null)."
)


@dataclass(frozen=True)
@record
class Loci:
    """The exact locus and the reduced one."""

    exact: Locus
    reduced: ReducedLocus

    @property
    def name(self) -> str:
        """What varies."""
        return self.exact.vary

    @property
    def unit(self) -> str:
        """Of what varies; nothing of a pure number."""
        return unit_in(self.exact).replace("1", "")


def unit_in(found: Locus) -> str:
    """The SI unit of what varies, "1" of a pure number."""
    of_other = ARM_PARAMETERS | {"delay": "s"}
    return unit_of(found.vary, found.arm) if found.vary in NAMES else of_other.get(found.vary, "1")


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
    """Return both loci of one gain.  Raises what `locus` and `reduced_locus` raise."""
    exact = locus(arm, law, vary, start, stop, LOCUS_POINTS, LOCUS_BRANCHES)
    return Loci(exact, reduced_locus(exact))


def locus_answer(exact: Locus, reduced: ReducedLocus | None) -> dict[str, Any]:
    """The branches at each value, where they cross the imaginary axis, and the gap to the reduced model's locus."""
    best = most_damped(exact)
    answer = {
        "arm": exact.arm.name,
        **(signals_answer(as_law(exact.law), exact.arm) if exact.in_box else law_answer(exact.law, exact.arm)),
        "vary": exact.vary,
        "unit": unit_in(exact),
        "gain": exact.gain.tolist(),
        "mode": exact.mode.tolist(),
        "branches": [[None if np.isnan(s) else [s.real, s.imag] for s in row] for row in exact.branches.tolist()],
        "branches_note": BRANCHES_NOTE,
        "box": list(exact.box),
        "crossings": crossing_answers(exact.crossings),
        "ends": [{"branch": branch, "gain": gain} for branch, gain in exact.ends],
        "first_mode_most_damped": best and {"gain": best.gain, "damping_ratio": best.damping_ratio},
    }
    if reduced is None:
        return answer
    return answer | {
        "gap_to_reduced": reduced.worst,
        "gap_by_branch": reduced.gap.tolist(),
        "gap_note": GAP_NOTE,
        "reduced_order": reduced.order,
        "reduced_points": int(reduced.gain.size),
    }
