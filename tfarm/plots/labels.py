"""Words among curves: put, when the picture is drawn, where they lie on no curve, on no frame and on no other words.

Only then is known how large the axes are; so the same holds in a window that is made larger.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product, takewhile
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import same_color
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from tfarm.arrays import Real

from .style import FAINT, GREY, INK

LabelOffset = tuple[float, float]  # points, from a place to the nearest corner, side or middle of the words
AWAY = (6.0, 11.0)  # points from a mark to its words
SIDES, CORNERS = ((0, 1), (0, -1), (1, 0), (-1, 0)), ((1, 1), (-1, 1), (1, -1), (-1, -1))
Offsets = tuple[LabelOffset, ...]
OFFSETS_AROUND: Offsets = tuple((r * x, r * y) for r in AWAY for x, y in (*SIDES, *CORNERS))
OFFSETS_BESIDE: Offsets = tuple((r * x, r * y) for r in AWAY for x, y in (*SIDES[2:], *CORNERS, *SIDES[:2]))
OFFSETS_FURTHER: Offsets = (*OFFSETS_AROUND, *((r * x, r * y) for r in (17.0, 24.0) for x, y in (*SIDES, *CORNERS)))
OFFSET_UPON: Offsets = ((0.0, 0.0),)  # in the middle of the place itself, as on a contour
PADDING = 1.5  # pixels around words that nothing else comes into


class Label(Annotation):
    """Words at the first of some places, and of some offsets from it, where they are clear; else at the best of them.

    `own` is a line that they may lie on.  Those that `may_go` are left out where no place is clear.  Where there is a
    `short` form, words stand upright where they have no room across, and else it takes their place.
    """

    def __init__(
        self, text: str, places: Sequence[tuple[float, float]], offsets: Sequence[LabelOffset] = OFFSETS_AROUND, *,
        own: Any = None, may_go: bool = False, short: str = "", **looks: Any,
    ) -> None:  # fmt: skip
        looks = {"zorder": 6.0, "fontsize": 8.0, "color": INK, **looks}
        super().__init__(text, places[0], xytext=offsets[0], textcoords="offset points", **looks)
        forms = [(text, 0), (text, 90), (short, 0)] if short else [(text, 0)]
        self.tried, self.own, self.may_go = list(product(forms, places, offsets)), own, may_go
        self.set_in_layout(False)
        self.box: Bbox | None = None

    def draw(self, renderer: Any) -> None:
        """Find the place, then draw as any text."""
        axes = self.axes
        assert isinstance(axes, Axes)
        curves, words = _curves(axes, self.own), _words(axes, self, renderer)
        least, best = math.inf, 0
        for number in range(len(self.tried)):
            met = _met(self._box(number, renderer), axes, curves, words)
            if met < least:
                least, best = met, number
            if not met:
                break
        self.set_visible(not least or not self.may_go)
        box = self._box(best, renderer)
        self.box = box if self.get_visible() else None
        super().draw(renderer)

    def _box(self, number: int, renderer: Any) -> Bbox:
        """Where the words would be [pixels]."""
        (text, turn), self.xy, (x, y) = self.tried[number]
        self.set(text=text, rotation=turn, position=(x, y))
        self.set(ha="left" if x > 0 else "right" if x < 0 else "center")
        self.set(va="bottom" if y > 0 else "top" if y < 0 else "center")
        self.update_positions(renderer)
        return Text.get_window_extent(self, renderer).padded(PADDING)


def _curves(axes: Axes, own: Any) -> list[tuple[Real, Real]]:
    """Both ends (n, 2) in pixels of the pieces of each line, of marks twice the place; on grey guides words may lie."""
    found = []
    for line in axes.lines:
        data = np.asarray(line.get_xydata(), dtype=float)
        if line is own or not line.get_visible() or not len(data):
            continue
        if any(same_color(line.get_color(), guide) for guide in (FAINT, GREY)) and line.get_marker() == "None":
            continue
        pixels = np.asarray(line.get_transform().transform(data))
        is_line = line.get_linestyle() != "None" and len(data) > 1
        found.append((pixels[:-1], pixels[1:]) if is_line else (pixels, pixels))
    return found


def _words(axes: Axes, mine: Label, renderer: Any) -> list[Bbox]:
    """The boxes of the words that stand already: all that have one place, and the labels before this one."""
    before = takewhile(lambda text: text is not mine, axes.texts)
    found = [text.box for text in before if isinstance(text, Label) and text.box is not None]
    others = [text for text in axes.texts if not isinstance(text, Label) and text.get_visible() and text.get_text()]
    return found + [Text.get_window_extent(text, renderer) for text in others]


def _met(box: Bbox, axes: Axes, curves: Sequence[tuple[Real, Real]], words: Sequence[Bbox]) -> float:
    """How bad it is to stand there: 0 where nothing is met; the frame and other words are worse than curves."""
    frame = axes.bbox
    is_out = axes.axison and not (
        frame.x0 <= box.x0 and frame.y0 <= box.y0 and box.x1 <= frame.x1 and box.y1 <= frame.y1
    )
    met = 10.0 * is_out + 3.0 * sum(box.overlaps(other) for other in words)
    return met + sum(_runs_through(box, *ends) for ends in curves)


def _runs_through(box: Bbox, start: Real, end: Real) -> bool:
    """Whether any of the pieces (n, 2) from start to end comes into the box (Liang and Barsky, 1984)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        low, high = (np.asarray(corner) - start for corner in (box.min, box.max))
        way = end - start
        low, high = low / way, high / way  # where a piece does not move, infinite: inside from -inf to inf, or nowhere
        enters, leaves = np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)
        return bool(((enters <= leaves) & (enters <= 1) & (leaves >= 0)).any())
