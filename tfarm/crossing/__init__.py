"""Where zeros of A + g B cross a curve as a real gain g runs, and how many lie beyond it (D-decomposition).

The curve may be the imaginary axis or the unit circle; nothing here knows what A and B are.
"""

from tfarm.crossing.line import Crossing, Crossings, Parts, brackets, crossed, solved, with_dips, zeros_between
from tfarm.crossing.pieces import RegionPiece, pieces
from tfarm.crossing.plane import Window, confirmed, counts_over, intervals, joined

__all__ = [
    "Crossing",
    "Crossings",
    "Parts",
    "RegionPiece",
    "Window",
    "brackets",
    "confirmed",
    "counts_over",
    "crossed",
    "intervals",
    "joined",
    "pieces",
    "solved",
    "with_dips",
    "zeros_between",
]
