"""Curves of zeros along a gain: values to be added between its values, so that the curves are drawn smooth.

A curve through few points has corners where the zeros have none.  Where two of them meet on the real axis and separate
at a right angle, the corner is true: it is approached to less than a pixel.

A region, given as intervals column by column, is cut into parts that can be filled.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.crossing.line import Window

# from one piece of a curve to the next: a sharper turn is a corner
MOST_TURN = math.radians(5.0)
# of the picture, a pixel: corners of shorter pieces are invisible
PIXEL = 2e-3
# a value of the gain across, and an interval of the other there
Slice = tuple[float, float, float]


def loose(curves: Complex, width: Real | float, height: Real | float) -> NDArray[np.bool_]:
    """Whether a value is needed between each and the next (n - 1,), for curves (b, n) in pictures of that size.

    `width` and `height` are numbers, or columns (b, 1).  None is needed where a curve is NaN or real.
    """
    # how much wider than high, or higher than wide, a picture is at most: so much more a curve turns in it
    stretch = 2.0
    piece = np.diff(curves.real / width + 1j * (curves.imag / height), axis=1)
    size = abs(piece)
    is_real = curves.imag == 0
    with np.errstate(all="ignore"):
        turn = abs(np.angle(piece[:, 1:] / piece[:, :-1]))
    parts = is_real[:, 1:] != is_real[:, :-1]
    stays = is_real[:, 2:] & is_real[:, 1:-1] & is_real[:, :-2]
    bent = np.isfinite(turn) & (turn > MOST_TURN / stretch) & ~(stays | parts[:, 1:] | parts[:, :-1])
    wanted = parts.copy()
    wanted[:, :-1] |= bent
    wanted[:, 1:] |= bent
    return np.asarray((wanted & (size > PIXEL)).any(axis=0))


def loose_columns(across: Real, parts: Sequence[RegionPiece], drawn: Callable[[Real, Real], Complex]) -> Real:
    """Return values of a gain between columns (n,) of a region, next to corners of the outlines of its parts.

    `drawn` maps a point of the plane to the picture, 1 high and about as wide; corners outside are left out.
    """
    wanted: set[float] = set()
    for part in parts:
        gain, low, high = np.array(part.points).T
        gain = np.r_[gain, gain[::-1]]
        outline = drawn(gain, np.r_[low, high[::-1]])
        kept = abs(outline - np.roll(outline, 1)) > 0
        gain = gain[kept]
        outline = outline[kept]
        before = outline - np.roll(outline, 1)
        after = np.roll(outline, -1) - outline
        is_seen = (outline.real > 0) & (outline.imag > 0) & (outline.imag < 1)
        is_corner = is_seen & (abs(np.angle(after / before)) > MOST_TURN)
        for way, side in ((1, before), (-1, after)):
            is_long = is_corner & (abs(side) > PIXEL)
            for ends in zip(gain[is_long].tolist(), np.roll(gain, way)[is_long].tolist(), strict=True):
                wanted.update(_halves(across, *ends))
    return np.array(sorted(wanted))


def _halves(across: Real, here: float, other: float) -> list[float]:
    """Return values nearly half way between two columns; of an upright side, to its neighbours."""
    n = int(np.searchsorted(across, here))
    neighbours = across[max(0, n - 1) : n + 2].tolist()
    # 1e-11 of a gain: columns nearer to each other are in the rounding of the end of a region
    ends = [other]
    if here == other:
        ends = [each for each in neighbours if abs(each - here) > 1e-11 * abs(here)]
    # 0.45 of the way from one column to the next: half way may be the very edge that both were laid around
    return [min(here, each) + 0.45 * abs(each - here) for each in ends]


@dataclass(eq=False)
class RegionPiece:
    """A part of a region to fill: (across, low, high) from column to column.

    `begins`, `ends`: whether the region itself has an end at that side, and not only the piece.
    """

    points: list[Slice]
    begins: bool
    ends: bool = True


def pieces(across: Real, intervals: Sequence[Sequence[Window]]) -> list[RegionPiece]:
    """Cut the region into parts with one interval a column; where intervals split or join, parts meet without a gap."""
    found: list[RegionPiece] = []
    going: list[RegionPiece] = []
    for gain, column in zip(across.tolist(), intervals, strict=True):
        here = [(gain, *ends) for ends in column]
        last = [piece.points[-1] for piece in going]
        pairs = itertools.product(range(len(last)), range(len(here)))
        links = [(i, j) for i, j in pairs if last[i][1] < here[j][2] and here[j][1] < last[i][2]]
        following = [RegionPiece([each], begins=True) for each in here]
        for i, j in links:
            children = [b for a, b in links if a == i]
            parents = [a for a, b in links if b == j]
            piece = going[i]
            # a part of an interval begins
            if len(children) > 1:
                piece.ends = False
                piece = RegionPiece(
                    [_share(last[i], [here[b] for b in children], children.index(j))], begins=False
                )
                found.append(piece)
            piece.points.append(_share(here[j], [last[a] for a in parents], parents.index(i)))
            # here several parts join
            if len(parents) > 1:
                piece.ends = following[j].begins = False
            else:
                following[j] = piece
        found += [piece for piece in following if piece not in found]
        going = following
    return [piece for piece in found if len(piece.points) > 1]


def _share(whole: Slice, parts: Sequence[Slice], number: int) -> Slice:
    """Return the share of one of its parts in an interval, up to the middles of the gaps between them."""
    gaps = [(a[2] + b[1]) / 2 for a, b in itertools.pairwise(parts)]
    ends = [whole[1], *gaps, whole[2]]
    return whole[0], ends[number], ends[number + 1]
