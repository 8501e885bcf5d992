"""Drawn mode shapes: a cantilever's nodes are in every textbook, and its shape ends at its largest."""

import math

import numpy as np
import pytest

import tfarm
from tfarm.plots.shapes import scaled

NODES = {1: (), 2: (0.7834,), 3: (0.5035, 0.8677)}  # of a clamped-free beam, shares of its length (Blevins 1979, 8-1)


def test_shapes_of_a_cantilever_have_its_nodes():
    """The root counts no node; this arm is slender, its nodes are a beam's to a thousandth."""
    found = tfarm.modes(tfarm.load("sasaki2012").having(hub_inertia=math.inf), count=4)
    shapes = scaled(found, 3)
    assert list(shapes) == [1, 2, 3]
    for (number, w), nodes in zip(shapes.items(), found.nodes, strict=False):
        assert nodes / found.arm.length == pytest.approx(NODES[number], abs=2e-3)
        assert (w[0], w[-1]) == pytest.approx((0.0, 1.0), abs=1e-12)
        assert np.count_nonzero(np.diff(np.sign(w[1:]))) == number - 1
