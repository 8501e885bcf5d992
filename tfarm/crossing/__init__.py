"""Crossings of a curve by zeros of A + g B along a real gain g, and counts of zeros beyond it (D-decomposition).

The curve may be the imaginary axis or the unit circle, and A and B any functions.

line     crossings along lines of one gain, and the intervals and counts between them
shown    a plane of two numbers with its counts of unstable poles
turning  values between those of a gain, so that its curves are drawn smooth
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
__getattr__ = moved(
    __name__,
    {
        "ascending": "tfarm.crossing.line:check_ascending",
        "confirmed": "tfarm.crossing.line:confirm_intervals",
        "crossed": "tfarm.crossing.line:locate_crossings",
        "joined": "tfarm.crossing.line:join_neighbours",
    },
)
