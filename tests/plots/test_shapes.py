"""Drawn mode shapes: a cantilever's nodes are in every textbook, and its shape ends at its largest."""

import itertools
import math

import pytest

import tfarm
from tfarm.plots.shapes import shapes_of

NODES = {1: (), 2: (0.7834,), 3: (0.5035, 0.8677)}  # of a clamped-free beam, shares of its length (Blevins 1979, 8-1)


def test_shapes_of_a_cantilever_have_its_nodes_and_frequencies():
    """The root counts no node; this arm is slender, its nodes are a beam's to a thousandth."""
    modes = tfarm.modes(tfarm.load("sasaki2012").having(hub_inertia=math.inf), count=3)
    for shape, omega in zip(shapes_of(modes, 3), modes.natural_frequency, strict=True):
        assert shape.nodes / shape.x[-1] == pytest.approx(NODES[shape.number], abs=2e-3)
        assert shape.natural_frequency == omega
        assert (shape.w[0], shape.w[-1]) == pytest.approx((0.0, 1.0), abs=1e-12)
        signs = [w > 0 for w in shape.w[1:]]
        assert sum(before != after for before, after in itertools.pairwise(signs)) == shape.number - 1
