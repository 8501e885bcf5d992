"""Root loci: complete by winding number, the same in both directions; ends, crossings and meetings by other methods."""

import json
import math
import re
import shlex
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import tfarm
from tests.chain_elements import reached
from tests.loop.arms import loop_of, window_arm
from tests.loop.rig_loops import RigLoop
from tests.shared import refusal, thinned
from tests.shell import run
from tfarm import Arm, Hub, HubFeedback, Law, Link, Payload, Section
from tfarm.arm import Attachment, Motor
from tfarm.case import Case
from tfarm.loop.branches import Origin, origin_name
from tfarm.loop.lines import line_crossings
from tfarm.loop.loci import damping_ratios, loci, most_damped, reduced_locus, round_branches
from tfarm.loop.locus import frame, locus
from tfarm.loop.poles import poles_below
from tfarm.schema import curve_table
from tfarm.spectrum.damped import damped_modes
from tfarm.spectrum.gains import default_gains, rate_unit

EPS = np.finfo(float).eps
LAB, PAPER, STOCKY = (tfarm.load(name) for name in ("sasaki2012-lab", "sasaki2012", "stocky-steel"))
HUB, K1, K2 = HubFeedback(K1=0.3, K2=0.3), HubFeedback(K1=0.3), HubFeedback(K2=0.5, Kp=3.0)
MOTOR = Motor(resistance=2.6, torque_constant=0.0077, inductance=0.02, gear_ratio=70, rotor_inertia=1e-6)
TUBE = Section.tube(outer_diameter=0.0056, inner_diameter=0.0038)
RIGS = {
    "no back-EMF": replace(PAPER, motor=replace(MOTOR, back_emf_constant=0.0), input="motor_voltage"),
    "back-EMF": replace(PAPER, motor=MOTOR, input="motor_voltage"),
    "rotor's friction": replace(LAB, motor=replace(MOTOR, rotor_friction=1e-6), input="motor_voltage"),
    "flexlink": tfarm.load("quanser-flexlink"),
    "friction": replace(LAB, hub=Hub(inertia=LAB.hub.inertia, friction=0.2)),
}
RUBBING = replace(LAB, hub=Hub(inertia=0.0, friction=2.0))
PLASTIC = Arm(  # a hub of next to no inertia and a heavy tip: K1 makes mode 1 two real poles at once
    link=Link.isotropic(
        length=0.62, density=1150.0, youngs_modulus=2.5e9, poissons_ratio=0.4, damping=2.5e-4, section=TUBE
    ),
    hub=Hub(inertia=6.5e-5), payload=Payload(mass=0.325), name="plastic tube",
)  # fmt: skip
RANGES = [
    (PAPER, HubFeedback(), "K1", 0.0, 10.0),
    (LAB, K2, "K1", 0.0, 30.0),
    (PAPER, K1, "K2", -5.0, 5.0),
    (STOCKY, K1, "K2", -5.0, 5.0),
    (LAB, HUB, "Kp", 0.0, 100.0),
    (PAPER, HUB, "all", 0.0, 10.0),
    (LAB, HubFeedback(K1=0.3, K2=0.3, Kp=3.0), "all", -2.0, 2.0),
    (LAB, HUB, "payload_mass", 0.0, 2.0),
    (PAPER, HUB, "hub_inertia", 0.01, 2.0),
    (PAPER, HUB, "damping", 0.0, 1e-3),
    (LAB, HUB, "length", 0.4, 1.2),
    (PLASTIC, HubFeedback(K1=10.9, K2=-0.39), "all", 0.0, 2.0),
    (RUBBING, HubFeedback(K1=0.5, K2=0.3), "Kp", -2.0, 20.0),
    (RUBBING, HubFeedback(K1=0.5, K2=0.3), "K2", -1.0, 0.9),
    (RUBBING, HubFeedback(K1=0.5, K2=0.3), "K1", -1.9, 5.0),
]
NAMES = [f"{arm.name}-{vary}-{n}" for n, (arm, _, vary, _, _) in enumerate(RANGES)]


def upper(zeros):
    """Zeros with Im >= 0, ascending."""
    return np.sort_complex(np.where(zeros.imag < 0, zeros.conj(), zeros))


def must_be_complete(found, nodes, tolerance):
    """By winding numbers, without continuation; a pole that comes in from infinity has no branch."""
    for n in nodes:
        zeros = found.branches[:, n]
        poles = poles_below(found.varied.at(float(found.gain[n])), zeros.imag.max() * (1 + 1e-6))
        for zero in upper(zeros[poles.box.holds(zeros)]):
            assert abs(poles.values - zero).min() <= tolerance * abs(zero)
        for pole in poles.values if found.arm is not RUBBING else ():
            assert abs(upper(zeros) - pole).min() <= tolerance * abs(pole)


@pytest.mark.parametrize(("arm", "law", "vary", "start", "stop"), thinned(RANGES, 3), ids=NAMES)
def test_branches_are_all_poles_of_the_box_and_the_same_backwards(arm, law, vary, start, stop):
    """The same way back, from other modes and gains."""
    tolerance = 1e-12 if arm in (RUBBING, PLASTIC) else 50 * EPS
    found = locus(arm, law, vary, start, stop, points=11, branches=6 if arm in (RUBBING, PLASTIC) else 8)
    must_be_complete(found, (0, 4, 10), tolerance)
    back = locus(arm, law, vary, stop, start, points=11, branches=len(found.branches))
    assert np.all(abs(found.branches - back.branches[:, ::-1]) <= tolerance * abs(found.branches))


CASES = [(name, vary) for name in RIGS for vary in ("K1", "K2", "all")]


@pytest.mark.parametrize(("name", "vary"), thinned(CASES[2:] + CASES[:2], 7))
def test_branches_of_a_rig_are_poles_of_the_elements_and_all_of_a_box(name, vary):
    """From a driving gain to a strong one; the circuit's own pole -R/L_a lies beyond what the elements of one have."""
    arm = RIGS[name]
    law, unit = default_gains(arm), arm.input_per_torque
    ends = {"K1": (-0.5 * law.K1, 3 * law.K1), "K2": (-2 * unit, 0.9 * unit), "all": (0.0, 2.0)}[vary]
    found = locus(arm, law, vary, *ends, points=9, branches=6)
    must_be_complete(found, (0, 4, 8), 1e-12)
    model = RigLoop(arm, reached(arm, 8))
    for n in (0, 4, 8):
        theirs, zeros = model.eigenvalues(found.varied.at(float(found.gain[n])).gains), found.branches[:, n]
        for zero in zeros[(zeros != 0) & (abs(zeros) < model.up_to / 2)]:
            assert abs(theirs - zero).min() < 1e-7 * abs(zero) + 1e-9 * model.a  # their own 0 is off by so much
    assert reduced_locus(found).worst < 1e-5


LAW = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_acceleration": ([0.05], [0.02, 1.0])}, delay=0.002)


@pytest.mark.parametrize(
    ("vary", "start", "stop"), [("gain", 0.5, 8.0), ("delay", 0.012, 0.001), ("payload_mass", 0.05, 0.5)]
)
def test_each_value_of_a_law_has_its_complete_list_of_poles(vary, start, stop):
    found = locus(LAB, LAW, vary, start, stop, 4, 2)
    for n in (0, 1, 3):
        poles = poles_below(found.varied.at(float(found.gain[n])), 1.2 * found.box.im_max).values
        listed = np.sort_complex(found.branches[found.branches[:, n].imag >= 0, n])
        np.testing.assert_allclose(listed, np.sort_complex(poles[found.box.holds(poles)]), atol=1e-9 * found.box.im_max)
    assert np.nanmax(abs(np.diff(found.branches, axis=1))) < 0.3 * found.box.im_max  # no branch jumps to another


def test_a_mode_that_is_real_between_two_values_alone_has_its_branch():
    """At gain 0 mode 1 swings at 54 rad/s; at the next value it has met the hub's pole, and is a mirror image there."""
    found = locus(PLASTIC, HubFeedback(K1=10.9, K2=-0.39), "all", 0.0, 2.0, 60, 6)
    assert found.mode.tolist() == [0, 0, 1, 2, 3, 4]


def test_a_table_is_titled_by_what_varies_and_each_branch_has_its_origin(capsys):
    """A filtered law through a motor with a circuit: two poles at rest, the circuit's, two modes, the filter's own."""
    law = Law({"hub_angle": ([2.0], [0.004, 1.0]), "hub_rate": 0.4})
    found = locus(RIGS["back-EMF"], law, "hub_angle", 0.0, 1.0, 5, 2)
    integral = Law({"hub_angle": ([1.0, 5.0], [1.0, 0.0]), "hub_rate": 0.4})
    rests = locus(LAB, integral, "gain", 0.0, 1.0, 5, 2)
    at_rest = rests.origin[rests.branches[:, 0] == 0].tolist()
    assert at_rest == [Origin.RIGID_BODY, Origin.RIGID_BODY, Origin.CONTROLLER]
    assert (found.varied.title, found.titles["gain"]) == (("factor on hub_angle", ""), ("factor on hub_angle", ""))
    names = dict(zip(found.branches[:, 0].tolist(), map(origin_name, found.origin.tolist()), strict=True))
    assert names[min(names, key=lambda s: abs(s + 250.0))] == "controller"  # 1/T, uncoupled at a factor of 0
    assert names[min(names, key=abs)] == "rigid body"
    assert [origin_name(n) for n in sorted(found.mode[found.mode > 0].tolist())] == ["mode 1", "mode 2"]
    _, out, _ = run(capsys, *shlex.split("locus sasaki2012-lab --vary K2 --from 0.9 --to 1.1 --points 3 --branches 3"))
    crossings, branches, best = out.split("\n\n")[1:4]
    assert crossings.splitlines()[1].split()[:2] == ["K2", "frequency"]
    assert re.search(r" unstable +mode 1 ", crossings)
    assert re.match(r"branch +origin +pole at K2 = 0.9 \[1/s\] +pole at K2 = 1.1 \[1/s\]", branches.splitlines()[1])
    assert re.search(r"^ +0 +rigid body +0 ", branches, re.MULTILINE)
    assert best.splitlines()[1].split()[0] == "K2"
    assert "unit" not in out
    assert curve_table(locus(LAB, HUB, "K1", 0.0, 1.0, 2, 2)).columns[0].unit == "N m s/rad"


def test_zeros_at_the_origin_stay_exactly_there():
    assert np.all(locus(PAPER, HubFeedback(), "K1", 0.0, 5.0, 50, 3).branches[0] == 0)
    assert np.all(locus(PAPER, HubFeedback(), "K2", 0.0, 0.9, 50, 3).branches[:2] == 0)
    ends = locus(PAPER, HubFeedback(), "Kp", 0.0, 5.0, 50, 3).branches
    assert ends[0, 0] == 0
    assert np.all(ends[0, 1:].imag > 0)


CHANGED = {"hub_inertia": (0.02, 3.0), "payload_mass": (0.0, 2.0), "payload_inertia": (0.0, 0.05), "length": (0.5, 1.1),
           "damping": (0.0, 3e-4)}  # fmt: skip


@pytest.mark.parametrize(("arm", "vary"), thinned(product((PAPER, LAB), CHANGED), 3))
def test_without_a_law_both_ends_are_the_arms_own_modes(arm, vary):
    """By modes counted at C = 0, damped modes complete by winding number, each in its own order."""
    start, stop = CHANGED[vary]
    found = locus(arm, HubFeedback(), vary, start, stop, 15, 8)
    for end, value in ((0, start), (-1, stop)):
        table = tfarm.modes(arm.with_numbers(**{vary: value}), 6)
        expected = damped_modes(table).eigenvalues[:, 0] if table.arm.link.damping else 1j * table.natural_frequency
        assert np.all(abs(found.branches[1:, end] - expected) <= 50 * EPS * abs(expected))


def test_the_circuits_pole_and_the_turning_hubs_are_one_pair_at_a_high_gain():
    """A motor under a high gain rings: a real pole from -K1/J and one from -R/L_a meet, and part as a pair."""
    arm = RIGS["back-EMF"]
    law = default_gains(arm).with_number("K2", 0.0)
    found = locus(arm, law, "K1", 0.0, 3000 * law.K1, points=301, branches=6)
    assert found.mode.tolist() == [0, 0, 0, 1, 2, 3]
    turning, circuit = found.branches[1:3]
    assert circuit[0] == pytest.approx(-MOTOR.resistance / MOTOR.inductance, rel=0.02)
    assert (turning.imag[0], circuit.imag[0]) == (0, 0)
    assert not np.isnan(found.branches).any()


def test_a_branch_that_comes_to_the_accumulation_point_ends_there_and_the_others_go_on(capsys):
    """A real pole near -K1/I_h reaches -1/C at K1 = I_h/C, where real zeros accumulate; a box has all the others."""
    found, C = locus(LAB, HubFeedback(), "K1", 0.0, 2000.0, 201, 5), LAB.link.damping
    ((branch, last),) = found.ends
    ended = found.branches[branch][~np.isnan(found.branches[branch])][-1]
    assert 0.9 * LAB.hub.inertia / C < last < LAB.hub.inertia / C
    assert (ended.imag, -1 / C < ended.real < -0.95 / C) == (0.0, True)
    assert np.isnan(found.branches).sum() == np.isnan(found.branches[branch]).sum() == (found.gain > last).sum()
    others = np.delete(found.branches, branch, axis=0)[:, -1]
    poles = poles_below(loop_of(LAB, HubFeedback(K1=2000.0)), 0.9 * others.imag.max()).values
    low = 0.8 * others.imag.max()
    assert upper(others[others.imag < low]) == pytest.approx(upper(poles[poles.imag < low]), rel=1e-9)
    assert found.spectral_abscissa[-1] == others[others != 0].real.max()
    given = "locus sasaki2012-lab --K2 0 --vary K1 --from 0 --to 2000 --points 41 --branches 5 --json"
    answer = json.loads(run(capsys, *given.split())[1])
    assert answer["branches"][branch][-1] is None
    assert [each["branch"] for each in answer["branch_list"] if each["ends_at"] is not None] == [branch]
    assert answer["gap_to_reduced"] < 1e-3
    (back,) = [each for each in locus(LAB, HubFeedback(), "K1", 2000.0, -3.0, 60, 5).crossings if each.branch is None]
    assert (back.gain, back.omega, back.direction) == (0.0, 0.0, "unstable")  # of the pole that comes out of -1/C
    assert back.origin is None


def test_modes_that_leave_the_imaginary_axis_as_a_quadruple_are_followed():
    """Without losses, K2 > 1 and Kp let the hub's mode meet the first one; the winding number has four poles off it."""
    found = locus(PAPER, HubFeedback(K2=1.3, Kp=334.0593798812562), "K1", 0.0, 1e-6, 3, 4)
    first = found.branches[:, 0]
    poles = poles_below(found.varied.at(0.0), 1.1 * first.imag.max()).values
    assert np.sort_complex(first.round(6)) == pytest.approx(np.sort_complex(poles.round(6)), rel=1e-9, abs=2e-6)
    assert (abs(first.real) > 13).sum() == 2


DEEP = window_arm()
LINES = {  # arm, law, what varies, ends, values
    "windows": (DEEP, HubFeedback(K1=1.0), "K2", -15.0, 2.0, 200),
    "few values": (DEEP, HubFeedback(K1=1.0), "K2", -6.0, -14.0, 3),
    "rate": (LAB, HubFeedback(), "K1", -3.0, 3.0, 200),
    "angle": (LAB, K1, "Kp", -5.0, 5.0, 200),
    "static": (LAB, HubFeedback(), "K2", 0.5, 5.0, 200),
    "friction": (RIGS["friction"], default_gains(RIGS["friction"]).with_number("Kp", 0.3), "all", -2.0, 2.0, 41),
    "a law, two values": (DEEP, Law({"hub_rate": 1.0, "root_moment": ([-13.0], [1.0])}), "root_moment", -14.0, -7.0, 2),
}


@pytest.mark.parametrize("name", LINES)
def test_crossings_are_those_of_the_line_of_laws(name):
    """By D-decomposition, which scans frequencies and has no branches; some go out and back between values."""
    arm, law, vary, start, stop, points = LINES[name]
    found = locus(arm, law, vary, start, stop, points, 9)
    low, high = sorted((start, stop))
    loop, key = found.varied.first.under(found.varied.full), "gain" if vary == "all" else vary
    other = [each for each in line_crossings(loop, key, low, high, found.branches.imag.max()) if low < each.t < high]
    ours = sorted((each.gain, each.omega, (each.direction == "unstable") == (stop > start)) for each in found.crossings)
    theirs = sorted((each.t, each.at, each.change > 0) for each in other)
    assert len(ours) == len(theirs) > 0
    for (g, w, right), (t, omega, more) in zip(ours, theirs, strict=True):
        assert right == more
        assert abs(g - t) <= 1e-12 * max(1.0, abs(t))
        assert abs(w - omega) <= 1e-11 * max(1.0, omega)
    way = 1 if stop > start else -1
    assert [way * each.gain for each in found.crossings] == sorted(way * each.gain for each in found.crossings)


def test_at_no_damping_every_mode_crosses_at_once():
    """At C = 0 (Lyapunov): all flexible modes at K2 = 1, where they are those of the locked hub; all at K1 = 0."""
    assert not locus(DEEP.with_numbers(damping=0.0), HubFeedback(K1=1.0), "K2", -14.0, -6.0, 5, 9).crossings
    found = locus(PAPER, K1, "K2", 0.8, 1.1, 31, 9).crossings
    locked = tfarm.modes(replace(PAPER, hub=Hub(inertia=math.inf)), 7).natural_frequency
    assert [each.direction for each in found] == ["unstable"] * 7
    assert np.all(abs(np.array([each.gain for each in found]) - 1) <= 4 * EPS)
    assert np.all(abs(np.sort([each.omega for each in found]) / locked - 1) <= 20 * EPS)
    found = locus(PAPER, HubFeedback(), "K1", -1.0, 1.1, 30, 8).crossings
    own = np.r_[0, tfarm.modes(PAPER, 6).natural_frequency[1:]]
    assert np.all(abs(np.array([each.gain for each in found])) <= EPS)
    assert np.all(abs(np.sort([each.omega for each in found]) - own) <= 20 * EPS * own)


def pushing(stiffness, friction, lag):
    """A hub on a spring, and a law that pushes it."""
    arm = replace(LAB, hub=Hub(inertia=0.1, stiffness=stiffness, friction=friction))
    return arm, Law({"hub_angle": ([-1.0], [lag, 1.0])})


MASSED = replace(LAB, attachments=(Attachment(x=0.7, mass=0.1, stiffness=200.0),), payload=Payload(mass=0.5))
SPRUNG = replace(LAB, attachments=(Attachment(x=1.0, stiffness=200.0),), theory="euler-bernoulli")
TIP = 1 / (1 / 200.0 + 1 / (3 * LAB.link.EI))  # N m/rad: the spring in line with the bending stiffness, 1 m long
J, CARRIED = PAPER.total_inertia, PAPER.total_inertia - PAPER.hub.inertia
AT_REST = {  # where a real pole passes through 0: arm, law, what varies, ends, the closed form
    "inertia cancels": (PAPER, HubFeedback(), "K2", 0.5, 5.0, J / CARRIED, "unstable"),
    "a spring changes its sign": (LAB, K1, "Kp", -5.0, 5.0, 0.0, "stable"),
    "all friction is taken back": (RIGS["friction"], default_gains(RIGS["friction"]), "K1", -0.5, 0.3, -0.2, "stable"),
    "among the values": (MASSED, tfarm.default_gains(MASSED), "K2", -1.0, 1.6, 1.0, "unstable"),
    "backwards": (MASSED, tfarm.default_gains(MASSED), "K2", 1.6, -1.0, 1.0, "stable"),
    "a spring at the tip": (SPRUNG, Law({"hub_angle": ([-1.0], [1e-2, 1.0])}), "gain", TIP / 3, 2 * TIP, TIP,
                            "unstable"),
} | {
    f"a law as stiff as {k}, {b}, {lag}": (*pushing(k, b, lag), "gain", 0.01 * k, 7.3 * k, k, "unstable")
    for k, b, lag in ((1.0, 0.1, 1e-3), (1.0, 10.0, 0.1), (100.0, 0.1, 0.1))
}  # fmt: skip


@pytest.mark.parametrize("name", AT_REST)
def test_a_real_pole_passes_through_0_at_its_closed_form(name):
    arm, law, vary, start, stop, expected, way = AT_REST[name]
    found = locus(arm, law, vary, start, stop, 27, 4)
    (crossing,) = (each for each in found.crossings if each.omega == 0)
    assert (crossing.gain, crossing.direction) == (pytest.approx(expected, rel=1e-9, abs=1e-15), way)
    here = np.flatnonzero(abs(found.gain - expected) < 1e-12)
    if here.size and arm is MASSED:  # a pole at 0 has no digits to be followed by; the others are there
        row = found.branches[:, here[0]]
        sides = [poles_below(loop_of(arm, law.with_number(vary, 1.0 + side * 1e-7)), 200.0).values for side in (-1, 1)]
        assert (row == 0).sum() == 1
        for pole in row[row != 0]:
            assert pole == pytest.approx(np.mean([side[abs(side - pole).argmin()] for side in sides]), rel=1e-6)


def test_crossings_are_where_a_delay_takes_the_phase_margin():
    for law, start in ((LAW.with_number("delay", 0.0), 0.0005), (HUB, 0.001)):
        first = tfarm.locus(LAB, law, "delay", start, 0.02, 8, 2).crossings[0]
        late = law.with_number("delay", start) if law is not HUB else law
        margin = tfarm.margins(LAB, late).in_band
        assert first.direction == "unstable"
        assert first.gain == pytest.approx((start if law is not HUB else 0.0) + margin.delay, rel=1e-6)
        assert first.omega == pytest.approx(margin.at["delay"], rel=1e-5)


def test_a_pole_that_leaves_at_the_right_as_a_filter_turns_over_is_named():
    """1/(T s + 1) has its pole at -1/T: it goes through infinity at T = 0, where the locus runs from T < 0 to T > 0."""
    for ends, way in (((-0.02, 0.03), "stable"), ((0.03, -0.02), "unstable")):
        found = locus(LAB, LAW, "hub_angle.den.0", *ends, 4, 1)
        (far,) = [each for each in found.crossings if np.isinf(each.omega)]
        assert (far.gain, far.branch, far.direction) == (0.0, None, way)


@pytest.mark.parametrize(
    ("law", "vary", "stop"), [(HubFeedback(), "K1", 5.0), (K1, "K2", 0.8), (HUB, "payload_mass", 1.0)]
)
def test_the_gap_to_the_reduced_locus_shrinks_with_its_order(law, vary, stop):
    found = locus(PAPER, law, vary, 0.0, stop, 20, 6)
    gaps = [reduced_locus(found, order).worst for order in (12, 18, 26)]
    assert gaps[0] > 3 * gaps[1] > 9 * gaps[2]
    assert gaps[2] < 1e-7


@pytest.mark.parametrize("vary", ["K1", "K2"])
def test_a_reduced_locus_includes_the_unobservable_pole_at_0(vary):
    """Friction leaves a pole at 0 and one near it; the model of python-control has the second alone."""
    arm = tfarm.load("tests/rigs/bench-rig.toml")
    law = default_gains(arm)
    found = locus(arm, law, vary, 0.0, 2 * law[vary], branches=5, points=6)
    reduced = reduced_locus(found)
    assert (found.branches[0] == 0).all()
    assert (reduced.branches[0] == 0).all()
    assert reduced.worst < 1e-4


def ratio_at(value):
    """Of the exact pole that swings most slowly at a K1, from the complete list in a box."""
    poles = tfarm.closed_loop_poles(LAB, default_gains(LAB).with_number("K1", value), 8).values
    swinging = poles[poles.imag > 0]
    return float(damping_ratios(swinging[[np.argmin(abs(swinging))]])[0])


def test_where_the_first_mode_is_damped_most_does_not_depend_on_the_values():
    stop, law = 2 * rate_unit(LAB), default_gains(LAB)
    coarse, fine = (most_damped(locus(LAB, law, "K1", 0.0, stop, points, 4)) for points in (30, 200))
    assert coarse.gain == pytest.approx(fine.gain, rel=1e-6)
    assert coarse.damping_ratio == pytest.approx(fine.damping_ratio, rel=1e-10)
    assert ratio_at(coarse.gain) == pytest.approx(coarse.damping_ratio, rel=1e-9)
    assert max(ratio_at(0.999 * coarse.gain), ratio_at(1.001 * coarse.gain)) < coarse.damping_ratio
    short = most_damped(locus(LAB, law, "K1", 0.0, 2.0, 20, 4))
    assert (short.gain, short.damping_ratio) == (2.0, pytest.approx(ratio_at(2.0), rel=1e-9))
    assert most_damped(locus(LAB, law, "payload_mass", 0.0, 0.1, 10, 4)) is None


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


def test_ten_digits_of_its_size_are_shown_and_a_gain_has_its_unit():
    """A small real part at a large frequency has the digits that |s| leaves it."""
    pole = np.array([-0.123456789012345 + 98.7654321098765j, 0.0])
    assert round_branches(pole) == pytest.approx([-0.12345679 + 98.76543211j, 0.0], rel=1e-15)
    assert abs(round_branches(1e5 * pole) - 1e5 * round_branches(pole)).max() <= 1e-15 * 1e7
    held = replace(LAB, hub=replace(LAB.hub, stiffness=2.0))
    assert [loci(Case(arm, HUB), vary, 0.0, 0.5).unit for arm, vary in ((LAB, "K1"), (held, "K2"))] == ["N m s/rad", ""]


REFUSED = [
    ({"stop": 0.0}, "empty"),
    ({"stop": math.nan}, "finite"),
    ({"vary": "K3"}, "payload_mass"),
    ({"vary": "all"}, "every gain is 0"),
    ({"vary": "payload_mass", "start": -1.0}, "payload.mass"),
    ({"points": 1}, "points"),
    ({"branches": 0}, "branches"),
    ({"arm": replace(LAB, hub=Hub(inertia=math.inf))}, "locked"),
    ({"arm": RUBBING, "start": -3.0, "stop": 5.0}, "a pole passes through infinity at K1 = -2"),
    ({"arm": RUBBING, "start": 1.0, "stop": -2.0}, "a pole passes through infinity at K1 = -2"),
    ({"law": LAW, "vary": "hub_speed"}, "known are: gain, delay, hub_angle"),
    ({"law": LAW, "vary": "gain", "stop": np.inf}, "finite"),
]


@pytest.mark.parametrize(("change", "words"), REFUSED)
def test_bad_input_is_refused_in_one_line(change, words):
    given = {"arm": LAB, "law": HubFeedback(), "vary": "K1", "start": 0.0, "stop": 1.0, "points": 5, "branches": 3}
    assert words in str(refusal(locus, **(given | change)))
