"""What a picture's words lie on: each other, the frame of an axes, or a curve, by the boxes that matplotlib draws."""

from __future__ import annotations

import warnings
from itertools import combinations
from typing import Any
from unittest import mock

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from tfarm.plots.style import FAINT, GREY, style

ROOM = 1.0  # pixels around the letters of a text that its box includes: two may share them
Words = list[tuple[Text, Bbox]]


def complaints(figure: Figure) -> list[str]:
    """A line for each pair of words that overlap, for words across a frame or out of the picture, and on a curve."""
    words = drawn(figure)
    found = [f"{_quoted(a)} on {_quoted(b)}" for (a, one), (b, other) in combinations(words, 2) if one.overlaps(other)]
    found += [f"{_quoted(text)} leaves the picture" for text, box in words if not _holds(figure.bbox, box)]
    for ax in figure.axes:
        if ax.get_visible() and ax.axison:
            found += [f"{_quoted(text)} across a frame" for text, box in words if _is_cut(box, ax)]
        found += [
            f"{_quoted(text)} on a curve"
            for text, box in words
            if text in ax.texts and not text.get_path_effects() and _is_on_curve(text, box, ax)
        ]  # a halo hides the line below a number
    return found


def drawn(figure: Figure) -> Words:
    """Every text that is drawn and has letters, with its box [pixels] less the room around it."""
    found: Words = []
    with style(), warnings.catch_warnings(), mock.patch.object(Text, "draw", _noting(found)):
        warnings.filterwarnings("ignore", "Glyph .* missing")
        figure.draw_without_rendering()
    return found


def _noting(found: Words) -> Any:
    draw = Text.draw

    def note(text: Text, renderer: Any) -> None:
        draw(text, renderer)
        if text.get_visible() and text.get_text().strip():
            found.append((text, Text.get_window_extent(text, renderer).padded(-ROOM)))

    return note


def _holds(frame: Bbox, box: Bbox) -> bool:
    return frame.x0 <= box.x0 and frame.y0 <= box.y0 and box.x1 <= frame.x1 and box.y1 <= frame.y1


def _is_cut(box: Bbox, ax: Axes) -> bool:
    """Whether an edge of the frame that is drawn runs through the box."""
    x0, y0, x1, y1 = ax.bbox.extents
    ends = {"left": (x0, y0, x0, y1), "right": (x1, y0, x1, y1), "bottom": (x0, y0, x1, y0), "top": (x0, y1, x1, y1)}
    lines = (ends[name] for name in ends if ax.spines[name].get_visible() and ax.get_frame_on())
    return any(box.x0 < right and left < box.x1 and box.y0 < top and low < box.y1 for left, low, right, top in lines)


def _is_on_curve(text: Text, box: Bbox, ax: Axes) -> bool:
    """Whether a line of the axes runs through the box, but for guides in grey."""
    for line in ax.lines:
        data = np.asarray(line.get_xydata(), dtype=float)
        is_guide = any(same_color(line.get_color(), guide) for guide in (FAINT, GREY))
        if is_guide or line.get_linestyle() == "None" or len(data) < 2:
            continue
        seen = Bbox.intersection(box, ax.bbox) if line.get_clip_on() else box
        pixels = line.get_transform().transform(data)
        parts = np.split(pixels, np.flatnonzero(np.isnan(pixels).any(axis=1)))  # Path joins what nan parts
        paths = [Path(part[~np.isnan(part).any(axis=1)]) for part in parts]
        if seen is not None and any(path.intersects_bbox(seen, filled=False) for path in paths if len(path.vertices)):
            return True
    return False


def _quoted(text: Text) -> str:
    return repr(text.get_text())


def linear_rgb(colour: Any) -> Any:
    """Linear parts of sRGB colours (..., 3)."""
    colour = np.asarray(colour)
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
