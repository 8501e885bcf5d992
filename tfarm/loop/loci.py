"""The exact locus of a gain beside that of a reduced model, over as much of a range as can be followed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tfarm.arm import Arm, HubFeedback, written_unit
from tfarm.arrays import Complex
from tfarm.errors import ConvergenceError
from tfarm.records import record
from tfarm.spectrum import modes

from .locus import Locus, locus
from .reduced_locus import ReducedLocus, reduced_locus

LOCUS_POINTS = 300  # values of the gain
LOCUS_TRIES = ((7, 1.0), (4, 1.0), (4, 0.75), (2, 0.5))  # branches, and how much of the range they are followed over
POLE_DIGITS = 10  # digits of |s| that are drawn and written: poles differ from processor to processor by 1e-14 at most
GAPS_HELD = 5  # digits of a gap, 1e-5 of |s| or less between two such poles


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
    def first(self) -> float:
        """The first natural frequency [rad/s], of which a gap is a share where |s| is less."""
        return float(modes(self.exact.arm, 1).natural_frequency[-1])

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
