"""Words among curves: put, when the picture is drawn, where they lie on no curve, on no frame and on no other words.

Only then is known how large the axes are; so the same holds in a window that is made larger.
"""

from __future__ import annotations

from collections.abc import Sequence
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

    `own` is a line that they may lie on.  Those that `may_go` are left out where no place is clear.
    """

    def __init__(
        self, text: str, places: Sequence[tuple[float, float]], offsets: Sequence[LabelOffset] = OFFSETS_AROUND, *,
        own: Any = None, may_go: bool = False, fontsize: float = 8.0, color: str = INK, weight: str = "normal",
        bbox: Any = None,
    ) -> None:  # fmt: skip
        super().__init__(
            text, places[0], xytext=offsets[0], textcoords="offset points", zorder=6.0, fontsize=fontsize, color=color,
            weight=weight, bbox=bbox,
        )  # fmt: skip
        self.places, self.offsets, self.own, self.may_go = places, offsets, own, may_go
        self.set_in_layout(False)
        self.box: Bbox | None = None

    def draw(self, renderer: Any) -> None:
        """Find the place, then draw as any text."""
        axes = self.axes
        assert isinstance(axes, Axes)
        curves, words = _curves(axes, self.own), _words(axes, self, renderer)
        best: tuple[float, tuple[float, float], LabelOffset] | None = None
        for place in self.places:
            for offset in self.offsets:
                box = self._box(place, offset, renderer)
                met = _met(box, axes, curves, words)
                if best is None or met < best[0]:
                    best = (met, place, offset)
                if not met:
                    break
            if best is not None and not best[0]:
                break
        assert best is not None
        self.set_visible(not best[0] or not self.may_go)
        box = self._box(best[1], best[2], renderer)
        self.box = box if self.get_visible() else None
        super().draw(renderer)

    def _box(self, place: tuple[float, float], offset: LabelOffset, renderer: Any) -> Bbox:
        """Where the words would be [pixels]."""
        self.xy = place
        self.set_position(offset)
        x, y = offset
        self.set_horizontalalignment("left" if x > 0 else "right" if x < 0 else "center")
        self.set_verticalalignment("bottom" if y > 0 else "top" if y < 0 else "center")
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
    found = []
    for text in axes.texts:
        if text is mine:
            break
        if isinstance(text, Label):
            found += [text.box] if text.box is not None else []
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
