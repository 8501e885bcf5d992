"""A region of the plane of gains, given as intervals column by column, cut into parts that can be filled."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from tfarm.arrays import Real

from .plane import Window

Slice = tuple[float, float, float]  # a value of the gain across, and an interval of the other there


@dataclass
class RegionPiece:
    """A part of a region to fill: (across, low, high) from column to column.

    `begins`, `ends`: whether the region itself does at that side, and not only the piece.
    """

    points: list[Slice]
    begins: bool
    ends: bool = True


def pieces(across: Real, intervals: Sequence[Sequence[Window]]) -> list[RegionPiece]:
    """The region cut into parts with one interval a column; where intervals part or join, parts meet without a gap."""
    done: list[RegionPiece] = []
    going: list[RegionPiece] = []
    for gain, column in zip(across, intervals, strict=True):
        here = [(float(gain), low, high) for low, high in column]
        last = [piece.points[-1] for piece in going]
        parents = [[i for i, one in enumerate(last) if _overlap(one, each)] for each in here]
        children = [[j for j, each in enumerate(here) if _overlap(one, each)] for one in last]
        following = []
        for each, before in zip(here, parents, strict=True):
            if len(before) == 1 and len(children[before[0]]) == 1:
                going[before[0]].points.append(each)
                following.append(going[before[0]])
            elif len(before) == 1:  # one of the parts of an interval
                parts = _shares(last[before[0]], [here[j] for j in children[before[0]]])
                start = parts[children[before[0]].index(here.index(each))]
                following.append(RegionPiece([start, each], begins=False))
            else:  # begins here, or is where several join
                parts = _shares(each, [last[i] for i in before]) if before else []
                for i, part in zip(before, parts, strict=True):
                    going[i].points.append(part)
                following.append(RegionPiece([each], begins=not before))
        for piece, after in zip(going, children, strict=True):
            piece.ends = not after
        done += [piece for piece in going if not any(piece is each for each in following)]
        going = following
    for piece in going:
        piece.ends = True
    return [piece for piece in done + going if len(piece.points) > 1]


def _shares(whole: Slice, parts: Sequence[Slice]) -> list[Slice]:
    """The interval divided among the parts that it falls into, in the middles of the gaps between them."""
    gaps = [(a[2] + b[1]) / 2 for a, b in itertools.pairwise(parts)]
    return [(whole[0], low, high) for low, high in itertools.pairwise([whole[1], *gaps, whole[2]])]


def _overlap(a: Slice, b: Slice) -> bool:
    return a[1] < b[2] and b[1] < a[2]
