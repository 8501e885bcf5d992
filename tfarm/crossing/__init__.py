"""Crossings of a curve by zeros of A + g B along a real gain g, and counts of zeros beyond it (D-decomposition).

The curve may be the imaginary axis or the unit circle, and A and B any functions.
"""

from tfarm.crossing.line import (
    Crossing,
    Crossings,
    Curve,
    Grid,
    Line,
    Steps,
    Window,
    ascending,
    brackets,
    confirmed,
    counts_over,
    crossed,
    crossings,
    intervals,
    joined,
    zeros_between,
)
from tfarm.crossing.turning import RegionPiece, pieces

__all__ = [
    "Crossing",
    "Crossings",
    "Curve",
    "Grid",
    "Line",
    "RegionPiece",
    "Steps",
    "Window",
    "ascending",
    "brackets",
    "confirmed",
    "counts_over",
    "crossed",
    "crossings",
    "intervals",
    "joined",
    "pieces",
    "zeros_between",
]
