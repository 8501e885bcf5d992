"""The cards of the modes: a cantilever's nodes are in every textbook, and its shape ends at its largest."""

from __future__ import annotations

import itertools
import math

import pytest

import tfarm
from tfarm.plots.shapes import shapes_of
from tfarm.report.modes_section import CARD_EDGE, CARD_HEIGHT, CARD_WIDTH, mode_cards
from tfarm.report.page import TEMPLATES

NODES = {1: (), 2: (0.7834,), 3: (0.5035, 0.8677)}  # of a clamped-free beam, shares of its length (Blevins 1979, 8-1)


def test_cards_of_a_cantilever_have_its_nodes_and_frequencies():
    """The root counts no node; this arm is slender, its nodes are a beam's to a thousandth, a card's to a tenth."""
    modes = tfarm.modes(tfarm.load("sasaki2012").having(hub_inertia=math.inf), count=3)
    cards = mode_cards(shapes_of(modes, 3))
    for card, omega in zip(cards, modes.natural_frequency, strict=True):
        places = [CARD_EDGE + (CARD_WIDTH - 2 * CARD_EDGE) * share for share in NODES[card.number]]
        assert card.nodes == pytest.approx(places, abs=0.2)
        assert float(card.hertz) == pytest.approx(omega / (2 * math.pi), rel=1e-4)
        points = [tuple(map(float, each.split(","))) for each in card.path[1:].split()]
        assert points[0] == (CARD_EDGE, CARD_HEIGHT / 2)
        assert points[-1] == (CARD_WIDTH - CARD_EDGE, CARD_EDGE / 2)
        sides = [y < CARD_HEIGHT / 2 for _, y in points[1:]]
        crossings = sum(before != after for before, after in itertools.pairwise(sides))
        assert crossings == card.number - 1


def test_a_page_moves_on_a_screen_alone_and_only_for_who_does_not_mind():
    style = (TEMPLATES / "style.css").read_text(encoding="utf-8")
    before, _ = style.split("animation: swing")
    assert before.rindex("@media") == before.rindex("@media screen and (prefers-reduced-motion: no-preference)")
