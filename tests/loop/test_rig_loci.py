"""Root loci of rigs whose hub loses, and behind an inductance, against finite elements and the complete boxes."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.chain_elements import reached
from tests.loop.rig_loops import RigLoop
from tests.shared import thinned
from tfarm import Hub, HubFeedback
from tfarm.arm import Attachment, Motor
from tfarm.loop.lines import Line, along, line_crossings
from tfarm.loop.locus import locus
from tfarm.loop.loop import Loop
from tfarm.loop.poles import poles_below
from tfarm.loop.reduced_locus import reduced_locus
from tfarm.spectrum.table import default_gains

PAPER, LAB, FLEX = (tfarm.load(name) for name in ("sasaki2012", "sasaki2012-lab", "quanser-flexlink"))
MOTOR = Motor(resistance=2.6, torque_constant=0.0077, inductance=0.02, gear_ratio=70, rotor_inertia=1e-6)
DRIVEN = {"motor": MOTOR, "input": "motor_voltage"}
RIGS = {
    "no back-EMF": replace(PAPER, motor=replace(MOTOR, back_emf_constant=0.0), input="motor_voltage"),
    "back-EMF": replace(PAPER, **DRIVEN),
    "rotor's friction": replace(LAB, motor=replace(MOTOR, rotor_friction=1e-6), input="motor_voltage"),
    "flexlink": FLEX,
    "friction": replace(LAB, hub=Hub(inertia=LAB.hub_inertia, friction=0.2)),
}
CASES = [(name, vary) for name in RIGS for vary in ("K1", "K2", "all")]


def ranges(arm, law):
    """From a driving gain to a strong one; a scale from the open loop on."""
    unit = arm.input_per_torque
    return {"K1": (-0.5 * law.K1, 3 * law.K1), "K2": (-2 * unit, 0.9 * unit), "all": (0.0, 2.0)}


@pytest.mark.parametrize(
    ("name", "vary"), thinned(CASES[2:] + CASES[:2], 7)
)  # the first case alone takes a second and a half
def test_branches_are_poles_of_the_elements_and_all_of_a_box(name, vary):
    """At three gains; the circuit's own pole -R/L_a lies beyond what the elements of one rig have."""
    arm = RIGS[name]
    law = default_gains(arm)
    found = locus(arm, law, vary, *ranges(arm, law)[vary], points=9, branches=6)
    model = RigLoop(arm, reached(arm, 8))
    for n in (0, 4, 8):
        zeros = found.branches[:, n]
        loop = found.varied.at(float(found.gain[n]))
        theirs = model.eigenvalues(loop.gains)
        for zero in zeros[(zeros != 0) & (abs(zeros) < model.up_to / 2)]:
            assert abs(theirs - zero).min() < 1e-7 * abs(zero) + 1e-9 * model.a  # their own 0 is off by so much
        box = poles_below(loop, zeros.imag.max() * (1 + 1e-6))
        for pole in box.moving:
            assert abs(zeros - np.where(zeros.imag < 0, pole.conj(), pole)).min() < 1e-12 * abs(pole)
    assert reduced_locus(found).worst < 1e-5


def test_the_circuits_pole_and_the_turning_hubs_are_one_pair_at_a_high_gain():
    """A motor under a high gain rings: a real pole from -K1/J and one from -R/L_a meet, and part as a pair."""
    arm = RIGS["back-EMF"]
    law = default_gains(arm).having("K2", 0.0)
    found = locus(arm, law, "K1", 0.0, 3000 * law.K1, points=301, branches=6)
    assert found.mode.tolist() == [0, 0, 0, 1, 2, 3]
    turning, circuit = found.branches[1:3]
    assert circuit[0] == pytest.approx(-MOTOR.resistance / MOTOR.inductance, rel=0.02)
    assert (turning.imag[0], circuit.imag[0]) == (0, 0)
    assert not np.isnan(found.branches).any()


def test_crossings_along_a_scale_are_those_of_the_decomposition():
    """A rig with friction: the scale at which modes leave the axis, by `lines`, which follows no branch."""
    arm = RIGS["friction"]
    law = default_gains(arm).having("Kp", 0.3)
    found = locus(arm, law, "all", -2.0, 2.0, points=41, branches=5)
    moving = [(each.gain, each.omega) for each in found.crossings if each.omega > 0]
    band = abs(found.branches).max()
    known = [(t, w) for t, w, _ in line_crossings(arm, Line(HubFeedback(), law), band) if -2 < t < 2 and w > 0]
    assert len(moving) == len(known) > 0
    assert np.allclose(sorted(moving), sorted(known), rtol=1e-8)


@pytest.mark.parametrize("points", [9, 101])
def test_a_gain_that_takes_the_whole_friction_back_has_its_pole_at_0(points):
    """K1 = -b, on the grid and beside it."""
    arm = RIGS["friction"]
    found = locus(arm, default_gains(arm), "K1", -0.5, 0.3, points=points, branches=4)
    (static,) = (each for each in found.crossings if each.omega == 0)
    assert static.gain == pytest.approx(-0.2, rel=1e-9)
    assert static.direction == "stable"
    (known,) = (each for each in line_crossings(arm, along("K1", default_gains(arm)), 20.0) if each.at == 0)
    assert known.t == pytest.approx(-0.2, rel=1e-15)


@pytest.mark.parametrize(("start", "stop"), [(-1.0, 1.6), (1.6, -1.0)])
def test_at_the_gain_at_which_a_pole_passes_through_0_it_is_0_and_the_others_are_there(start, stop):
    """K2 = 1 on a rig that a spring holds, one of the values: a zero that is 0 has no digits to be followed by.

    Road: all poles in a box, a little to either side of it.
    """
    lab = LAB
    rig = replace(
        lab, attachments=(Attachment(x=0.7, mass=0.1, stiffness=200.0),), payload=replace(lab.payload, mass=0.5)
    )
    law = tfarm.default_gains(rig)
    found = tfarm.locus(rig, law, "K2", start, stop, points=300, branches=4)
    (n,) = np.flatnonzero(abs(found.gain - 1.0) < 1e-12)
    here = found.branches[:, n]
    assert (here == 0).sum() == 1
    step = 1e-7
    sides = [poles_below(Loop(rig, law.having("K2", 1.0 + side * step)), 200.0).values for side in (-1, 1)]
    for pole in here[here != 0]:
        middle = np.mean([side[abs(side - pole).argmin()] for side in sides])
        assert pole == pytest.approx(middle, rel=1e-6)
    assert [each.gain for each in found.crossings if each.omega == 0] == [pytest.approx(1.0, rel=1e-12)]
