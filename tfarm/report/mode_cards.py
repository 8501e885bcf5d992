"""Cards of the first modes: a small shape each that swings on the screen, and stands still on paper."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tfarm.arrays import Real
from tfarm.digits import significant
from tfarm.plots.shapes import DrawnMode

CARD_WIDTH, CARD_HEIGHT, CARD_EDGE = 120.0, 60.0, 8.0  # of the drawing, in its own units
PATH_EVERY = 10  # of the points of a shape every so many are drawn: 41, half a unit from the true curve at most


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeCard:
    """A mode: its number, frequency [Hz] in digits, the path of its shape, and where its nodes are across the card."""

    number: int
    hertz: str
    path: str
    nodes: Sequence[float]


def mode_cards(shapes: Sequence[DrawnMode]) -> tuple[ModeCard, ...]:
    """A card for each shape, upwards where w is positive, its largest displacement as high as the card."""
    cards = []
    for shape in shapes:
        across = _across(shape.x, shape)[::PATH_EVERY]
        up = (CARD_HEIGHT / 2 - (CARD_HEIGHT / 2 - CARD_EDGE / 2) * shape.w)[::PATH_EVERY]
        points = " ".join(f"{x:.1f},{y:.2f}" for x, y in zip(across, up, strict=True))
        hertz = significant(shape.natural_frequency / (2 * math.pi), 5)
        nodes = tuple(round(float(x), 1) for x in _across(shape.nodes, shape))
        cards.append(ModeCard(number=shape.number, hertz=hertz, path=f"M{points}", nodes=nodes))
    return tuple(cards)


def _across(x: Real, shape: DrawnMode) -> Real:
    return CARD_EDGE + (CARD_WIDTH - 2 * CARD_EDGE) * np.asarray(x) / shape.x[-1]
