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
    brackets,
    check_ascending,
    confirm_intervals,
    counts_over,
    crossings,
    intervals,
    join_neighbours,
    locate_crossings,
    zeros_between,
)
from tfarm.crossing.turning import RegionPiece, pieces
from tfarm.moved import moved

__all__ = [
    "Crossing",
    "Crossings",
    "Curve",
    "Grid",
    "Line",
    "RegionPiece",
    "Steps",
    "Window",
    "brackets",
    "check_ascending",
    "confirm_intervals",
    "counts_over",
    "crossings",
    "intervals",
    "join_neighbours",
    "locate_crossings",
    "pieces",
    "zeros_between",
]

# names up to version 1.0
_LINE = "tfarm.crossing.line"
__getattr__ = moved(
    __name__,
    {
        "ascending": f"{_LINE}:check_ascending",
        "confirmed": f"{_LINE}:confirm_intervals",
        "crossed": f"{_LINE}:locate_crossings",
        "joined": f"{_LINE}:join_neighbours",
    },
)
