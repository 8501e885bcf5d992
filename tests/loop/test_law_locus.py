"""Loci of any law: against gains at the hub, lists of poles, and crossings solved for in another way."""

import json
from importlib import import_module

import numpy as np
import pytest

import tfarm
from tests.loop.arms import window_arm
from tests.shared import remember
from tests.shell import run
from tfarm import HubFeedback, Law, ParameterError
from tfarm.loop.law_locus import assigned, inside, law_locus
from tfarm.loop.loop import Loop
from tfarm.loop.poles import poles_below
from tfarm.spectrum.box import Box

LAB = tfarm.load("sasaki2012-lab")
LAW = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_acceleration": ([0.05], [0.02, 1.0])}, delay=0.002)


def test_along_a_gain_at_the_hub_it_is_the_locus_of_that():
    mine = law_locus(LAB, Law({"hub_rate": 0.3, "root_moment": 0.3}), "root_moment", 0.1, 2.0, 8, 3)
    theirs = tfarm.locus(LAB, HubFeedback(K1=0.3, K2=0.3), "K2", 0.1, 2.0, 8, 4)
    for row in theirs.branches[1:3]:
        away = np.nanmin(abs(mine.branches - row), axis=0)
        assert (away[abs(row) < 500] < 1e-9 * 500).all()
    (first,) = (each for each in theirs.crossings if each.omega < 500)
    same = min(mine.crossings, key=lambda each: abs(each.gain - first.gain))
    assert same.gain == pytest.approx(first.gain, rel=1e-9)
    assert (same.omega, same.direction) == (pytest.approx(first.omega, rel=1e-9), first.direction)


@pytest.mark.parametrize(
    ("vary", "start", "stop"), [("gain", 0.5, 8.0), ("delay", 0.012, 0.001), ("payload_mass", 0.05, 0.5)]
)
def test_each_value_has_its_complete_list_of_poles(vary, start, stop):
    found = law_locus(LAB, LAW, vary, start, stop, 4, 2)
    for n in (0, 1, 3):
        value = float(found.values[n])
        arm = LAB.having(payload_mass=value) if vary == "payload_mass" else LAB
        law = LAW if vary == "payload_mass" else LAW.having(vary, value)
        poles = poles_below(Loop(arm, law), 1.2 * found.box.im_max).values
        listed = np.sort_complex(found.branches[~np.isnan(found.branches[:, n]), n])
        expected = np.sort_complex(poles[found.box.holds(poles)])
        np.testing.assert_allclose(listed, expected, atol=1e-9 * found.box.im_max)
    moved = abs(np.diff(found.branches, axis=1))
    assert np.nanmax(moved) < 0.3 * found.box.im_max  # no branch jumps to another


def test_crossings_are_where_a_delay_takes_the_phase_margin():
    found = law_locus(LAB, LAW.having("delay", 0.0), "delay", 0.0005, 0.02, 6, 2)
    margin = tfarm.margins(LAB, LAW.having("delay", 0.0005)).in_band
    first = found.crossings[0]
    assert first.direction == "unstable"
    assert first.gain == pytest.approx(0.0005 + margin.delay, rel=1e-7)
    assert first.omega == pytest.approx(margin.at["delay"], rel=1e-5)


def test_a_pole_that_leaves_at_the_right_as_a_filter_turns_over_is_named():
    """1/(T s + 1) has its pole at -1/T: it goes through infinity at T = 0, where the locus runs from T < 0 to T > 0."""
    found = law_locus(LAB, LAW, "hub_angle.den.0", -0.02, 0.03, 4, 1)
    (far,) = [each for each in found.crossings if np.isinf(each.omega)]
    assert (far.gain, far.branch, far.direction) == (0.0, None, "stable")
    back = law_locus(LAB, LAW, "hub_angle.den.0", 0.03, -0.02, 4, 1)
    assert "unstable" in [each.direction for each in back.crossings if np.isinf(each.omega)]


def test_poles_are_told_apart_or_it_is_said():
    box = Box(-10.0, 10.0, -10.0, 10.0)
    pairs, plain = assigned(np.array([1 + 2j, -3 + 4j]), np.array([-3 + 4.1j, 1.05 + 2j]), box)
    assert (pairs, plain) == ({0: 1, 1: 0}, True)
    pairs, plain = assigned(np.array([1 + 2j]), np.array([1 + 2.1j, 0 + 5j]), box)
    assert not plain  # one more in the middle of the box
    pairs, plain = assigned(np.array([1 + 2j]), np.array([1 + 2.1j, 0 + 9.9j]), box)
    assert (pairs, plain) == ({0: 0}, True)  # it came in over the edge


def test_a_pole_that_goes_out_and_comes_back_between_two_values_crosses_all_the_same():
    """Stable at both, and no branch changes sides: the two crossings are those of the windows of K2."""
    arm, law = window_arm(), Law({"hub_rate": 1.0, "root_moment": -13.0})
    found = law_locus(arm, law, "root_moment", -14.0, -7.0, 2, 9)
    assert (found.branches.real <= 0).all()
    edges = tfarm.margins(arm, HubFeedback(K1=1.0, K2=-13.0)).windows["K2"].crossings
    between = [(t, w) for t, w in zip(edges.gain, edges.at, strict=True) if -14 < t < -7]
    assert [(each.gain, each.omega) for each in found.crossings] == [pytest.approx(each, rel=1e-9) for each in between]
    assert [(each.direction, each.branch) for each in found.crossings] == [("unstable", None), ("stable", None)]
    back = law_locus(arm, law, "root_moment", -7.0, -14.0, 2, 9).crossings
    assert [each.direction for each in back] == ["unstable", "stable"]
    assert back[0].gain == pytest.approx(found.crossings[1].gain, rel=1e-9)


def test_well_inside_a_box_is_a_twentieth_of_its_shorter_measure_from_the_edges_where_poles_come_and_go():
    box = Box(-10.0, 2.0, -4.0, 4.0)  # 12 wide, 4 high above the axis: 0.2
    s = np.array([-9.79 + 1j, -9.81 + 1j, 1.79 + 1j, 1.81 + 1j, 0 + 3.79j, 0 + 3.81j, -3 + 0j])
    np.testing.assert_array_equal(inside(s, box), [True, False, True, False, True, False, True])


def test_the_command_follows_a_law(capsys, tmp_path, monkeypatch):
    remember(monkeypatch, import_module("tfarm.loop.closed"), "locus")  # two commands ask for the same
    text = "[law]\ndelay = 0.002\n[law.hub_angle]\nnum = [2.0, 1.0]\nden = [0.01, 1.0]\n"
    (tmp_path / "law.toml").write_text(text)
    way = ("--vary", "gain", "--from", "1", "--to", "9", "--points", "3", "--branches", "1")
    code, out, err = run(capsys, "locus", "sasaki2012-lab", "--law", str(tmp_path / "law.toml"), *way, "--json")
    assert (code, err) == (0, "")
    law = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0])}, delay=0.002)
    found = law_locus(LAB, law, "gain", 1.0, 9.0, 3, 1)
    assert json.loads(out)["box"] == list(found.box)
    code, out, _ = run(capsys, "locus", "sasaki2012-lab", "--law", str(tmp_path / "law.toml"), *way)
    assert "complete at each value" in out
    assert run(capsys, "locus", "sasaki2012-lab", "--law", str(tmp_path / "law.toml"), "--vary", "K1", *way[2:])[0] == 2


def test_what_is_no_way_is_refused():
    for vary, start, stop in (("hub_speed", 0.0, 1.0), ("gain", 1.0, 1.0), ("gain", 0.0, np.inf)):
        with pytest.raises(ParameterError):
            law_locus(LAB, LAW, vary, start, stop, 5, 2)
