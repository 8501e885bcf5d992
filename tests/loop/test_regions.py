"""The (K1, K2) map, against counts of a Legendre-Ritz model, of boxes, of theory at C = 0, and along either gain."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.scale import SymmetricalLogTransform

import tfarm
from tests.loop.arms import held, loop_of, verdict_of
from tests.loop.ritz_loop import RitzLoop
from tests.loop.test_lossless import RIGS
from tests.shared import refusal, thinned
from tfarm import HubFeedback
from tfarm.loop.plane import INFINITE, edge, gain_map, static_edges
from tfarm.loop.plane_axes import Axis, cell_middles, ranges_of
from tfarm.loop.poles import poles_below
from tfarm.schema import to_dict
from tfarm.spectrum.gains import default_gains

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")


def counts_by(count, K1, K2, Kp):
    """The count of each law of a grid."""
    return np.array([[count(HubFeedback(K1=float(a), K2=float(b), Kp=Kp)) for a in K1] for b in K2])


def of_model(arm, terms):
    model = RitzLoop(arm, terms)
    return lambda law: int((model.eigenvalues(law).real > 1e-9).sum())


@pytest.mark.parametrize("Kp", thinned([0.0, 3.0, -0.5], 2))
def test_counts_of_the_lab_arm_are_those_of_an_independent_model(Kp) -> None:
    K1, K2 = cell_middles(-1, 3, 5), cell_middles(-2, 2.5, 6)
    found = gain_map(LAB, K1, K2, Kp)
    low = counts_by(lambda law: poles_below(loop_of(LAB, law), found.band).unstable, K1, K2, Kp)
    np.testing.assert_array_equal(found.unstable, low)
    np.testing.assert_array_equal(found.stable, counts_by(of_model(LAB, 10), K1, K2, Kp) == 0)


@pytest.mark.parametrize(("Kp", "K2"), [(0.0, (-2, 3)), (-30.0, (-2, 3)), (0.0, (1.2, 1.4)), (-30.0, (1.2, 1.4))])
def test_counts_of_a_held_arm_step_where_its_stiffness_vanishes(Kp, K2) -> None:
    """At K1 < 0 the real pole goes the other way there than at K1 > 0; the range may begin beyond that step."""
    K1, K2 = cell_middles(-6, 6, 5), cell_middles(*K2, 9)
    counts = counts_by(of_model(held(1e-3), 10), K1, K2, Kp)
    np.testing.assert_array_equal(gain_map(held(1e-3), K1, K2, Kp).unstable, counts)


def test_a_column_without_rate_feedback_steps_where_the_effective_inertia_vanishes() -> None:
    """At K1 = Kp = 0 a real pole passes the two at 0 where J = K2 (J - I_h): no crossing at w > 0 shows it."""
    J = LAB.total_inertia
    limit = J / (J - LAB.hub.inertia)
    K2 = np.array([-20.0, -2.0, 0.5, limit * (1 - 1e-6), limit * (1 + 1e-6), 40.0])
    found = gain_map(LAB, np.array([-0.5, 0.0, 0.5]), K2)
    counted = [[verdict_of(LAB, HubFeedback(K1=a, K2=float(b))).unstable_roots for a in (-0.5, 0.0, 0.5)] for b in K2]
    assert found.unstable.tolist() == counted
    assert found.unstable[4, 1] == found.unstable[3, 1] + 1
    assert not found.stable[:, 1].any()


NO_DAMPING = [(BARE, -2.0), (held(0.0), -30.0), (BARE, 0.0), (held(0.0), 5.0), (BARE, 2.0)]


@pytest.mark.parametrize(("arm", "Kp"), thinned(NO_DAMPING, 3))
def test_at_no_damping_finite_counts_are_those_of_a_verdict_at_each_point(arm, Kp) -> None:
    """On the lines K1 = 0 and K2 = 1 too, where every pole may lie on the axis and none be unstable."""
    K1, K2 = np.sort(np.r_[cell_middles(-5, 5, 4), 0.0]), np.sort(np.r_[cell_middles(-2, 5, 5), 1.0])
    found = gain_map(arm, K1, K2, Kp)
    for (j, i), count in np.ndenumerate(found.unstable):
        there = verdict_of(arm, HubFeedback(K1=float(K1[i]), K2=float(K2[j]), Kp=Kp))
        assert count == (INFINITE if there.unstable_roots_infinite else there.unstable_roots)
        assert found.stable[j, i] == (there.word == "stable")
        if count != INFINITE and K2[j] != 1.0:  # where the model has no inertia left
            model = RitzLoop(arm, 10).eigenvalues(HubFeedback(K1=float(K1[i]), K2=float(K2[j]), Kp=Kp))
            assert count == int((model.real > 1e-7 * abs(model)).sum())


def test_the_middle_of_a_range_around_0_is_0_and_not_next_to_it() -> None:
    """There at C = 0 nothing is stable, a rounding above it everything is."""
    for low, high, number in ((-1.0, 3.0, 6), (-0.7, 2.1, 6), (-0.1, 0.7, 12), (-6.3, 6.3, 5)):
        gains = cell_middles(low, high, number)
        assert np.diff(gains) == pytest.approx((high - low) / number, rel=1e-12)
        assert abs(gains[gains != 0]).min() > 0.01 * (high - low) / number
    columns = cell_middles(-2.1, 0.7, 6)
    assert columns[4] == 0
    assert gain_map(BARE, columns, np.array([0.0, 0.5])).stable.tolist() == 2 * [[False] * 5 + [True]]


def test_the_answer_holds_the_boundary_inside_the_map_to_its_very_corner() -> None:
    """Every point of it that lies in the rectangle of the two ranges, and no other."""
    found = gain_map(LAB, np.linspace(0.0, 20.0, 3), np.linspace(-0.5, 1.5, 3))
    answer = to_dict(found)
    K1, K2 = found.boundary[:, 0], found.boundary[:, 1]
    inside = (K1 >= 0.0) & (K1 <= 20.0) & (K2 >= -0.5) & (K2 <= 1.5)
    np.testing.assert_array_equal(answer["boundary"], found.boundary[inside])
    assert (inside & (K1 > 10.0) & (K2 > 0.5)).any()  # in the last square of the grid
    assert not inside.all()


@pytest.mark.parametrize("K1", [[1.0], [1.0, 1.0], [2.0, 1.0], [0.0, math.nan], np.linspace(0, 1, 2001)])
def test_an_empty_or_unordered_range_is_refused(K1) -> None:
    assert "K1" in str(refusal(gain_map, LAB, np.array(K1), np.array([0.0, 1.0])))


def test_without_damping_the_intervals_of_a_held_arm_end_where_it_falls_statically() -> None:
    """An angle pushed away by less than the arm's own stiffness: the map's counts are the same, point by point."""
    held = BARE.with_numbers(payload_mass=math.inf)
    assert held.is_undamped
    plane = gain_map(held, np.array([-0.3, 0.3]), np.linspace(-2.5, 1.9, 41), -150.0)
    for n, column in enumerate(plane.stable_intervals):
        inside = [any(low < K2 < high for low, high in column) for K2 in plane.K2[1:-1]]
        np.testing.assert_array_equal(inside, plane.unstable[1:-1, n] == 0)
    assert plane.stable_intervals[0] == []
    assert 0 < (plane.unstable[:, 1] == 0).sum() < 41


@pytest.mark.parametrize(("arm", "reach"), [(BARE, "every mode, by a theorem"), (LAB, "up to 12196.9 rad/s")])
def test_a_map_has_the_reach_of_its_poles(arm, reach) -> None:
    assert gain_map(arm, np.array([0.1, 0.3]), np.array([0.0, 0.5])).reach == reach


def test_by_default_a_map_is_around_the_papers_gains_in_the_rigs_units() -> None:
    """The paper's 0.3 and 0 lie in -1 ... 3 and -2 ... 2; of a rig the first as its own K1, the second as its input."""
    assert ranges_of(LAB) == ((-1.0, 3.0), (-2.0, 2.0))
    rig = RIGS["r = 0.05"]
    (left, right), (low, high) = ranges_of(rig)
    assert (left, right) == pytest.approx((-default_gains(rig).K1 / 0.3, default_gains(rig).K1 / 0.1), rel=1e-15)
    assert (low, high) == (-2.0 * rig.input_per_torque, 2.0 * rig.input_per_torque)


EPS = np.finfo(float).eps


@pytest.mark.parametrize("axis", [Axis(-0.1, 500.0, 0.1), Axis(-50.0, 2.0, 2.0), Axis(-30.0, 7.0, 10.0)])
def test_an_axis_is_matplotlibs_own(axis):
    """So that a share of the picture is one: symlog, base 10."""
    theirs = SymmetricalLogTransform(10.0, axis.linear, axis.linear_scale)
    x = np.linspace(axis.low, axis.high, 101)
    low, high = theirs.transform(np.array([axis.low, axis.high]))
    assert axis.place(x) == pytest.approx((theirs.transform(x) - low) / (high - low), abs=8 * EPS)


def test_a_grid_finds_its_own_axis():
    for values, axis in (
        (np.linspace(-1.0, 3.0, 41), Axis(-1.0, 3.0)),
        (np.geomspace(0.02, 3.0, 41), Axis(0.02, 3.0, 0.02)),
        (np.array([-3.0, -1.0, -0.5, 0.0, 2.0, 6.0]), Axis(-3.0, 6.0, 0.5)),
    ):
        assert Axis.of(values) == axis
        assert axis.place(axis.grid(40)) == pytest.approx((np.arange(40) + 0.5) / 40, abs=16 * EPS)  # even as seen


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
        parts = [abs(loop_of(LAB, HubFeedback(**{name: law[name]})).loop_function(s)[0]) for name in ("K1", "K2", "Kp")]
        assert abs(1 + loop_of(LAB, law).loop_function(s)[0]) < 2000 * EPS * (1 + sum(parts))


@pytest.mark.parametrize(("name", "K1", "K2"), [("free", 0.0, None), ("held", None, 1.0)])
def test_a_real_pole_passes_through_0_on_the_line_that_is_drawn(name, K1, K2):
    """On K1 = 0 where the arm turns; where its tip is held, on the K2 at which the hub no longer holds against it."""
    arm = LAB if name == "free" else replace(LAB, payload=tfarm.Payload(mass=math.inf))
    found = static_edges(tfarm.map(arm, np.linspace(0.1, 1.0, 3), np.linspace(0.0, 0.5, 3)))
    assert found == (K1, K2 if K2 is None else pytest.approx(K2, abs=1e-12))
    before, after = (
        verdict_of(arm, HubFeedback(K1=0.3 if K1 is None else way, K2=0.3 if K2 is None else K2 + way)).unstable_roots
        for way in (-1e-3, 1e-3)
    )
    assert {before, after} == {0, 1}
