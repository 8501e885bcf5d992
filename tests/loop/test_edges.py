"""The map as it is drawn: axes, and an edge that lies between points of different counts."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.scale import SymmetricalLogTransform

import tfarm
from tfarm.arm import HubFeedback
from tfarm.loop.loop import Loop
from tfarm.loop.plane import LINEAR_SCALE, Axis, edge, seen, static_edges
from tfarm.loop.stability import stability

LAB = tfarm.load("sasaki2012-lab")
EPS = np.finfo(float).eps


@pytest.mark.parametrize("axis", [Axis(-0.1, 500.0, 0.1), Axis(-50.0, 2.0, 2.0), Axis(-30.0, 7.0, 10.0)])
def test_an_axis_is_matplotlibs_own(axis):
    """So that a share of the picture is one: symlog, base 10."""
    theirs = SymmetricalLogTransform(10.0, axis.linear, LINEAR_SCALE)
    x = np.linspace(axis.low, axis.high, 101)
    low, high = theirs.transform(np.array([axis.low, axis.high]))
    assert axis.place(x) == pytest.approx((theirs.transform(x) - low) / (high - low), abs=8 * EPS)


@pytest.mark.parametrize("axis", [Axis(-0.1, 500.0, 0.1), Axis(-50.0, 2.0, 2.0), Axis(-4.0, 2.0)])
def test_a_grid_is_even_as_seen(axis):
    assert axis.place(axis.grid(40)) == pytest.approx((np.arange(40) + 0.5) / 40, abs=16 * EPS)


def test_a_grid_finds_its_own_axis():
    assert Axis.of(np.linspace(-1.0, 3.0, 41)) == Axis(-1.0, 3.0)
    assert Axis.of(np.geomspace(0.02, 3.0, 41)) == Axis(0.02, 3.0, 0.02)
    assert Axis.of(np.array([-3.0, -1.0, -0.5, 0.0, 2.0, 6.0])) == Axis(-3.0, 6.0, 0.5)


def test_what_is_seen_is_the_nearest_count():
    plane = tfarm.map(LAB, np.geomspace(0.02, 3.0, 9), np.linspace(-1.0, 2.0, 7))
    found = seen(plane, Axis(0.02, 3.0), Axis(-1.0, 2.0))
    for row, K2 in enumerate(found.K2):
        for column, K1 in enumerate(found.K1):
            nearest = abs(plane.K2 - K2).argmin(), abs(plane.K1 - K1).argmin()
            assert found.unstable[row, column] == plane.unstable[nearest]


@pytest.mark.parametrize("Kp", [0.0, 5.0])
def test_the_edge_between_the_grids_frequencies_is_that_of_the_law_with_its_angle_gain(Kp):
    """1 + L(i w) = 0 there, L by the loop function."""
    plane = tfarm.map(LAB, np.linspace(0.05, 3.0, 30), np.linspace(-2.0, 2.0, 41), Kp)
    points = edge(plane, Axis.of(plane.K1), Axis.of(plane.K2))
    points = points[~np.isnan(points[:, 0]) & (points[:, 0] > 0.05) & (points[:, 0] < 3.0)]
    new = points[~np.isin(points[:, 2], plane.boundary[:, 2])]
    assert len(new) > 5
    for K1, K2, omega in new[:: len(new) // 5]:
        law = HubFeedback(K1=K1, K2=K2, Kp=Kp)
        s = np.array([1j * omega])
        parts = [abs(Loop(LAB, HubFeedback(**{name: law[name]})).loop_function(s)[0]) for name in ("K1", "K2", "Kp")]
        assert abs(1 + Loop(LAB, law).loop_function(s)[0]) < 2000 * EPS * (1 + sum(parts))


@pytest.mark.parametrize(("name", "K1", "K2"), [("free", 0.0, None), ("held", None, 1.0)])
def test_a_real_pole_passes_through_0_on_the_line_that_is_drawn(name, K1, K2):
    """On K1 = 0 where the arm turns; where its tip is held, on the K2 at which the hub no longer holds against it."""
    arm = LAB if name == "free" else replace(LAB, payload=tfarm.Payload(mass=math.inf))
    found = static_edges(tfarm.map(arm, np.linspace(0.1, 1.0, 3), np.linspace(0.0, 0.5, 3)))
    assert found == (K1, K2 if K2 is None else pytest.approx(K2, abs=1e-12))
    before, after = (
        stability(arm, HubFeedback(K1=0.3 if K1 is None else way, K2=0.3 if K2 is None else K2 + way)).unstable_roots
        for way in (-1e-3, 1e-3)
    )
    assert {before, after} == {0, 1}
