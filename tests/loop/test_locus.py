"""Root loci: complete by winding number, the same in both directions; ends and crossings by other roads."""

import json
import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import tfarm
from tests.loop.arms import window_arm, with_damping
from tests.shared import thinned
from tfarm import Hub, HubFeedback, ParameterError, Payload
from tfarm.cli import main
from tfarm.exact.characteristic import gains_of
from tfarm.loop import reduced_locus as reduced_locus_room
from tfarm.loop.closed import locus
from tfarm.loop.lines import along, line_crossings
from tfarm.loop.locus import frame, rounded
from tfarm.loop.loop import Loop
from tfarm.loop.poles import poles_below
from tfarm.loop.reduced_locus import reduced_locus
from tfarm.spectrum.damped import damped_modes
from tfarm.spectrum.proofs import enclosed

EPS = np.finfo(float).eps
LAB, PAPER, STOCKY = (tfarm.load(name) for name in ("sasaki2012-lab", "sasaki2012", "stocky-steel"))
HUB = HubFeedback(K1=0.3, K2=0.3)
RANGES = [
    (PAPER, HubFeedback(), "K1", 0.0, 10.0),
    (LAB, HubFeedback(), "K1", -3.0, 3.0),
    (LAB, HubFeedback(K2=0.5, Kp=3.0), "K1", 0.0, 30.0),
    (PAPER, HubFeedback(K1=0.3), "K2", -5.0, 5.0),
    (STOCKY, HubFeedback(K1=0.3), "K2", -5.0, 5.0),
    (PAPER, HubFeedback(), "K2", 0.0, 5.0),
    (LAB, HUB, "Kp", 0.0, 100.0),
    (LAB, HubFeedback(K1=0.3), "Kp", -5.0, 5.0),
    (PAPER, HUB, "all", 0.0, 10.0),
    (LAB, HubFeedback(K1=0.3, K2=0.3, Kp=3.0), "all", -2.0, 2.0),
    (LAB, HUB, "payload_mass", 0.0, 2.0),
    (STOCKY, HUB, "payload_inertia", 0.0, 0.1),
    (PAPER, HUB, "hub_inertia", 0.01, 2.0),
    (LAB, HUB, "length", 0.4, 1.2),
    (PAPER, HUB, "damping", 0.0, 1e-3),
]
NAMES = [f"{arm.name}-{vary}-{n}" for n, (arm, _, vary, _, _) in enumerate(RANGES)]


def upper(zeros):
    """Zeros with Im >= 0, ascending."""
    return np.sort_complex(np.where(zeros.imag < 0, zeros.conj(), zeros))


# ------------------------------------------------------------ complete, and the same in both directions


@pytest.mark.parametrize(("arm", "law", "vary", "start", "stop"), thinned(RANGES, 3), ids=NAMES)
def test_branches_are_all_poles_of_the_box_and_the_same_backwards(arm, law, vary, start, stop):
    """Road: winding numbers, which know of no continuation; then the same way back, from other modes and gains."""
    found = locus(arm, law, vary, start, stop, points=11, branches=8)
    assert found.branches.shape == (8, 11)
    for n in (0, 4, 10):
        zeros = found.branches[:, n]
        poles = poles_below(found.varied.at(found.gain[n]), zeros.imag.max() * (1 + 1e-6))
        for zero in zeros[poles.box.holds(zeros)]:
            assert abs(poles.values - zero * (zero.imag >= 0) - zero.conj() * (zero.imag < 0)).min() <= 50 * EPS * abs(
                zero
            )
        for pole in poles.values:
            assert abs(upper(zeros) - pole).min() <= 50 * EPS * abs(pole)
    back = locus(arm, law, vary, stop, start, points=11, branches=8)
    assert np.all(abs(found.branches - back.branches[:, ::-1]) <= 50 * EPS * abs(found.branches))


def test_a_branch_does_not_depend_on_how_many_points_or_branches_are_asked_for():
    fine = locus(LAB, HubFeedback(K1=0.3), "K2", -2.0, 2.0, points=201, branches=12)
    rough = locus(LAB, HubFeedback(K1=0.3), "K2", -2.0, 2.0, points=11, branches=5)
    assert np.all(abs(fine.branches[:5, ::20] - rough.branches) <= 50 * EPS * abs(rough.branches))


def test_branches_are_continuous():
    """Twice the points halve the largest step of each branch, but for square roots where two meet."""
    steps = [abs(np.diff(locus(PAPER, HUB, "K2", -3.0, 3.0, n, 10).branches)).max(axis=1) for n in (401, 801)]
    assert np.all(steps[1] <= 0.75 * steps[0] + EPS)


def test_zeros_at_the_origin_stay_exactly_there():
    assert np.all(locus(PAPER, HubFeedback(), "K1", 0.0, 5.0, 50, 3).branches[0] == 0)
    assert np.all(locus(PAPER, HubFeedback(), "K2", 0.0, 0.9, 50, 3).branches[:2] == 0)
    ends = locus(PAPER, HubFeedback(), "Kp", 0.0, 5.0, 50, 3).branches
    assert ends[0, 0] == 0
    assert np.all(ends[0, 1:].imag > 0)


def test_a_pinned_payload_leaves_no_rigid_mode():
    pinned = replace(LAB, payload=Payload(mass=math.inf))
    found = locus(pinned, HubFeedback(), "K1", 0.0, 1.0, 11, 4)
    assert list(found.mode) == [1, 2, 3, 4]
    ends = damped_modes(tfarm.modes(pinned, 4)).eigenvalues[:, 0]
    assert np.all(abs(found.branches[:, 0] - ends) <= 50 * EPS * abs(ends))


# ------------------------------------------------------------ ends and limits


CHANGED = {
    "hub_inertia": (0.02, 3.0, lambda arm, value: replace(arm, hub=Hub(inertia=value))),
    "payload_mass": (0.0, 2.0, lambda arm, value: replace(arm, payload=replace(arm.payload, mass=value))),
    "payload_inertia": (0.0, 0.05, lambda arm, value: replace(arm, payload=replace(arm.payload, inertia=value))),
    "length": (0.5, 1.1, lambda arm, value: replace(arm, link=replace(arm.link, length=value))),
    "damping": (0.0, 3e-4, with_damping),
}


@pytest.mark.parametrize(("arm", "vary"), thinned(product((PAPER, LAB), CHANGED), 3))
def test_without_a_law_both_ends_are_the_arms_own_modes(arm, vary):
    """Road: modes by counting at C = 0, damped modes complete by winding number, each in its own order."""
    start, stop, changed = CHANGED[vary]
    found = locus(arm, HubFeedback(), vary, start, stop, 15, 8)
    for end, value in ((0, start), (-1, stop)):
        table = tfarm.modes(changed(arm, value), 6)
        expected = damped_modes(table).eigenvalues[:, 0] if table.arm.link.damping else 1j * table.natural_frequency
        assert np.all(abs(found.branches[1:, end] - expected) <= 50 * EPS * abs(expected))


def test_feeding_the_moment_back_is_another_hub():
    """At C = 0 the arm sees a hub of inertia I_h/(1 - K2) with a damper K1/(1 - K2)."""
    found = locus(PAPER, HubFeedback(K1=0.3), "K2", -2.0, 0.9, 30, 8)
    for n in (0, 13, 29):
        share = 1 - found.gain[n]
        equal = replace(PAPER, hub=Hub(inertia=PAPER.hub.inertia / share))
        other = locus(equal, HubFeedback(), "K1", 0.0, 0.3 / share, 3, 8).branches[:, -1]
        assert np.all(abs(other - found.branches[:, n]) <= 200 * EPS * abs(other))


def test_high_rate_gain_locks_the_hub():
    """As K1 grows the oscillating branches tend to the modes of the locked hub, as 1/K1."""
    locked = 1j * tfarm.modes(replace(STOCKY, hub=Hub(inertia=math.inf)), 3).natural_frequency
    away = []
    for K1 in (1e6, 1e7):
        found = locus(STOCKY, HubFeedback(), "K1", 0.0, K1, 5, 8)
        away.append(np.array([abs(found.branches[:, -1] - mode).min() for mode in locked]))
    assert np.all(abs(away[0] / away[1] - 10) < 0.05)


# ------------------------------------------------------------ crossings


def test_the_known_edge_of_the_lab_arm_to_its_last_digits():
    """K1 = 0.3: K2 = 1.0305, at 27.8 rad/s.  Road: proven 30-digit discs around the pole there and beside it."""
    (found,) = locus(LAB, HubFeedback(K1=0.3), "K2", 0.5, 1.1, 40, 8).crossings
    assert (round(found.gain, 4), round(found.omega, 1), found.direction) == (1.0305, 27.8, "unstable")
    side = []
    for K2 in (found.gain * (1 - 1e-13), found.gain * (1 + 1e-13)):
        loop = Loop(LAB, HubFeedback(K1=0.3, K2=K2))
        disc = enclosed(loop.k, 1j * found.omega, 30, gains_of(loop.k, loop.gains))
        assert found.omega == pytest.approx(float(disc.im), rel=1e-12)
        side.append(float(disc.re))
    assert side[0] < 0 < side[1]


@pytest.mark.parametrize(
    ("arm", "law", "vary", "start", "stop"),
    [
        (window_arm(), HubFeedback(K1=1.0), "K2", -15.0, 2.0),
        (LAB, HubFeedback(), "K1", -3.0, 3.0),
        (LAB, HubFeedback(K1=0.3), "Kp", -5.0, 5.0),
        (LAB, HubFeedback(), "K2", 0.5, 5.0),
    ],
    ids=["windows", "K1", "Kp", "static"],
)
def test_crossings_are_those_of_the_line_of_gains(arm, law, vary, start, stop):
    """Road: D-decomposition, which scans frequencies and knows of no branches."""
    found = locus(arm, law, vary, start, stop, 200, 9)
    top = found.branches.imag.max()
    other = [each for each in line_crossings(arm, along(vary, law), top) if start < each.t < stop]
    ours = sorted((each.gain, each.omega, each.direction == "unstable") for each in found.crossings)
    theirs = sorted((each.t, each.at, each.change > 0) for each in other)
    assert len(ours) == len(theirs) > 0
    for (g, w, right), (t, omega, more) in zip(ours, theirs, strict=True):
        assert right == more
        assert abs(g - t) <= 1e-12 * max(1.0, abs(t))
        assert abs(w - omega) <= 1e-11 * max(1.0, omega)


def test_at_no_damping_every_mode_crosses_at_once():
    """At C = 0 (Lyapunov): all flexible modes at K2 = 1, where they are those of the locked hub; all at K1 = 0."""
    found = locus(PAPER, HubFeedback(K1=0.3), "K2", 0.8, 1.1, 31, 9).crossings
    locked = tfarm.modes(replace(PAPER, hub=Hub(inertia=math.inf)), 7).natural_frequency
    assert [each.direction for each in found] == ["unstable"] * 7
    assert np.all(abs(np.array([each.gain for each in found]) - 1) <= 4 * EPS)
    assert np.all(abs(np.sort([each.omega for each in found]) / locked - 1) <= 20 * EPS)
    found = locus(PAPER, HubFeedback(), "K1", -1.0, 1.1, 30, 8).crossings
    own = np.r_[0, tfarm.modes(PAPER, 6).natural_frequency[1:]]
    assert np.all(abs(np.array([each.gain for each in found])) <= EPS)
    assert np.all(abs(np.sort([each.omega for each in found]) - own) <= 20 * EPS * own)


def test_too_much_moment_feedback_falls_statically():
    """K2 = J/(J - I_h) = 1 + I_h/(J - I_h): torque and inertia cancel, and a real pole passes 0."""
    (found,) = locus(PAPER, HubFeedback(), "K2", 0.5, 5.0, 60, 5).crossings
    edge = PAPER.total_inertia / (PAPER.total_inertia - PAPER.hub.inertia)
    assert (found.omega, found.direction) == (0.0, "unstable")
    assert found.gain == pytest.approx(edge, rel=1e-13)


def test_the_pole_at_zero_crosses_where_the_spring_changes_sign():
    (found,) = locus(LAB, HubFeedback(K1=0.3), "Kp", -5.0, 5.0, 40, 4).crossings
    assert (found.omega, found.direction) == (0.0, "stable")
    assert abs(found.gain) <= 1e-15


# ------------------------------------------------------------ next to a reduced model


@pytest.mark.parametrize(
    ("law", "vary", "stop"), [(HubFeedback(), "K1", 5.0), (HubFeedback(K1=0.3), "K2", 0.8), (HUB, "payload_mass", 1.0)]
)
def test_the_gap_to_the_reduced_locus_shrinks_with_its_order(law, vary, stop):
    found = locus(PAPER, law, vary, 0.0, stop, 20, 6)
    gaps = [reduced_locus(found, order).worst for order in (12, 18, 26)]
    assert gaps[0] > 3 * gaps[1] > 9 * gaps[2]
    assert gaps[2] < 1e-7


@pytest.mark.parametrize(("branches", "order"), [(3, 20), (10, 22), (12, 26)])
def test_unless_asked_otherwise_a_reduced_model_has_two_modes_beyond_the_last_branch(branches, order):
    """Two poles a mode: those of the branches, one of them rigid, and two more; 20 at least."""
    found = locus(PAPER, HubFeedback(), "K1", 0.0, 2.0, 3, branches)
    assert order == max(20, 2 * (len(np.unique(found.mode)) + 2))
    assert reduced_locus(found).order == order


def test_reduced_poles_are_those_of_python_control():
    """Road: the same closed loop as matrices."""
    from tfarm.reduced import modal_model

    found = locus(LAB, HUB, "all", 0.0, 1.0, 5, 5)
    A, B, C, D = modal_model(LAB, ["hub_rate", "root_moment"], 9).matrices()
    row = np.array([[0.3, 0.3]])
    poles = np.linalg.eigvals(A - B @ row @ C / (1 + row @ D))
    mine = reduced_locus(found, 20).branches[:, -1]
    assert max(abs(poles - pole).min() for pole in mine) < 1e-7


@pytest.mark.parametrize("law", [HubFeedback(K1=0.3, K2=0.3), HubFeedback(K1=30.0, K2=-1.0)])
def test_reduced_poles_do_not_depend_on_the_eigenvalue_solver(law):
    """Started where another processor's solver might end, 1e-12 of |s| away, they come to the same last digits."""
    found = locus(LAB, law, "K2", -1.0, 1.6, points=20, branches=4)
    rng = np.random.default_rng(3)
    start = reduced_locus_room.root_locus(LAB, law, "K2", found.gain, 9)
    noise = start * (1 + 1e-12 * (rng.standard_normal(start.shape) + 1j * rng.standard_normal(start.shape)))
    one, two = (reduced_locus_room._polished(found, each, 9) for each in (start, noise))
    assert (abs(one - start) <= 1e-9 * abs(start)).all()
    moving = abs(one) > 1e-3 * tfarm.modes(LAB, 1).natural_frequency[-1]
    assert (abs(one - two) <= 1e3 * EPS * abs(one))[moving].all()


# ------------------------------------------------------------ refusals and the command


@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_the_frame_of_a_picture_touches_its_outermost_points_and_holds_the_axis(turned):
    branches = turned * np.array([[-3 + 2j, -1 + 5j], [np.nan, -0.5 + 9j]])
    left, right, low, high = frame(branches)
    assert (left, right) == ((-3, 0) if turned > 0 else (0, 3))
    assert (low, high) == ((2, 9) if turned > 0 else (-9, -2))
    still = frame(np.zeros((1, 3), complex))
    assert still[0] < still[1]
    assert still[2] < still[3]
    assert frame(np.full((1, 3), np.nan + 0j)) == (0, 1, 0, 1)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"stop": 0.0}, "empty"),
        ({"stop": math.nan}, "finite"),
        ({"vary": "K3"}, "payload_mass"),
        ({"vary": "all"}, "every gain is 0"),
        ({"vary": "payload_mass", "start": -1.0}, "payload.mass"),
        ({"points": 1}, "points"),
        ({"branches": 0}, "branches"),
        ({"arm": replace(LAB, hub=Hub(inertia=math.inf))}, "locked"),
    ],
)
def test_bad_input_is_refused_in_one_line(change, told):
    given = {"arm": LAB, "law": HubFeedback(), "vary": "K1", "start": 0.0, "stop": 1.0, "points": 5, "branches": 3}
    with pytest.raises(ParameterError, match=told) as error:
        locus(**(given | change))
    assert "\n" not in str(error.value)


def test_a_branch_that_comes_to_the_accumulation_point_ends_there_and_the_others_go_on(capsys):
    """A real pole near -K1/I_h reaches -1/C at K1 = I_h/C, where real zeros accumulate; a box has all the others."""
    found, C = locus(LAB, HubFeedback(), "K1", 0.0, 2000.0, 201, 5), LAB.link.damping
    ((branch, last),) = found.ends
    ended = found.branches[branch][~np.isnan(found.branches[branch])][-1]
    assert 0.9 * LAB.hub.inertia / C < last < LAB.hub.inertia / C
    assert (ended.imag, -1 / C < ended.real < -0.95 / C) == (0.0, True)
    assert np.isnan(found.branches).sum() == np.isnan(found.branches[branch]).sum() == (found.gain > last).sum()
    others = np.delete(found.branches, branch, axis=0)[:, -1]
    poles = poles_below(Loop(LAB, HubFeedback(K1=2000.0)), 0.9 * others.imag.max())
    assert upper(others[others.imag < 0.8 * others.imag.max()]) == pytest.approx(
        upper(poles.values[poles.values.imag < 0.8 * others.imag.max()]), rel=1e-9
    )
    assert found.spectral_abscissa[-1] == others[others != 0].real.max()
    given = "locus sasaki2012-lab --K2 0 --vary K1 --from 0 --to 2000 --points 41 --branches 5 --json"
    with pytest.raises(SystemExit):
        main(given.split())
    answer = json.loads(capsys.readouterr().out)
    assert answer["branches"][branch][-1] is None
    assert [each["branch"] for each in answer["ends"]] == [branch]
    assert answer["gap_to_reduced"] < 1e-3


def test_a_pole_that_is_on_no_branch_crosses_the_axis_all_the_same():
    """On the way back nobody knows the pole that comes out of -1/C; the crossing engine does, and says where."""
    found = locus(LAB, HubFeedback(), "K1", 2000.0, -3.0, 60, 5)
    nobodys = [each for each in found.crossings if each.branch is None]
    assert [(each.gain, each.omega, each.direction) for each in nobodys] == [(0.0, 0.0, "unstable")]


def test_modes_that_meet_on_the_axis_and_leave_it_as_a_quadruple_are_followed_around_that():
    """Without losses, K2 > 1 and Kp let the hub's mode meet the first one; the winding number has four poles off it."""
    arm, law = replace(LAB, link=replace(LAB.link, damping=0.0)), HubFeedback(K2=1.3, Kp=334.0593798812562)
    found = locus(arm, law, "K1", 0.0, 1e-6, 3, 4)
    poles = poles_below(Loop(arm, law), 1.1 * found.branches[:, 0].imag.max())
    assert np.sort_complex(found.branches[:, 0].round(6)) == pytest.approx(
        np.sort_complex(poles.values.round(6)), rel=1e-9, abs=2e-6
    )
    assert (abs(found.branches[:, 0].real) > 13).sum() == 2


def test_the_command_prints_one_json_object(capsys, tmp_path):
    table = tmp_path / "locus.csv"
    given = [
        "locus",
        "sasaki2012-lab",
        "--vary",
        "K2",
        "--from",
        "0.5",
        "--to",
        "1.1",
        "--points",
        "7",
        "--branches",
        "6",
    ]
    with pytest.raises(SystemExit) as done:
        main([*given, "--csv", str(table), "--json"])
    assert done.value.code == 0
    answer = json.loads(capsys.readouterr().out)
    found = locus(LAB, HUB, "K2", 0.5, 1.1, 7, 6)
    assert answer["gain"] == found.gain.tolist()
    assert np.array_equal(np.array(answer["branches"]) @ [1, 1j], found.branches)
    assert [tuple(row.values()) for row in answer["crossings"]] == [
        (each.gain, each.omega, each.omega / (2 * math.pi), each.branch, each.direction) for each in found.crossings
    ]
    assert 0 < answer["gap_to_reduced"] < 1e-4
    assert answer["reduced_order"] == 20
    assert len(table.read_text().splitlines()) == 8
    with pytest.raises(SystemExit) as done:
        main(["locus", "sasaki2012", "--vary", "K1", "--from", "1", "--to", "1"])
    assert done.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(("arm", "vary", "start", "stop"), [(STOCKY, "K2", -5.0, 0.9), (LAB, "K1", 0.3, 3.0)])
def test_each_branch_is_round_in_a_picture_of_its_own_and_of_all(arm, vary, start, stop):
    """From 12 values: pieces longer than a five hundredth of the picture turn by at most 2.5 degrees."""
    branches = rounded(locus(arm, HUB, vary, start, stop, points=12, branches=5)).branches
    swinging = branches[(branches.imag > 0).all(axis=1)]
    assert len(swinging) >= 3
    for points, shown in (*((row, [row]) for row in swinging), (branches, swinging)):
        wide, tall = max(points.real.max(), 0) - min(points.real.min(), 0), np.ptp(points.imag)
        for row in shown:
            across, up = np.diff(row.real) / wide, np.diff(row.imag) / tall
            heading, seen = np.unwrap(np.arctan2(up, across)), np.hypot(across, up) > 2e-3
            turn = abs(np.diff(heading))[seen[1:] | seen[:-1]]
            assert turn.max(initial=0.0) <= math.radians(2.5)


@pytest.mark.parametrize("law", [HubFeedback(K1=0.3, K2=0.3), HubFeedback(K1=0.1, K2=-1.0, Kp=0.4)])
def test_the_slope_of_the_reduced_loop_is_its_difference_quotient(law):
    from tfarm.reduced import modal_model

    model = modal_model(LAB, ["hub_angle", "hub_rate", "root_moment"], 4)
    s, row = np.array([[-1.0 + 30j, 2.0 + 150j, -3.0 + 0.5j]]), np.array([[law.Kp, law.K1, law.K2]])
    h = 1e-5 * abs(s)
    ahead, behind = (reduced_locus_room._return_difference(model, row, s + way * h)[0] for way in (1, -1))
    _, slope = reduced_locus_room._return_difference(model, row, s)
    np.testing.assert_allclose(slope, (ahead - behind) / (2 * h), rtol=1e-7)
