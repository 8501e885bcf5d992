"""Damped modes of rigs that have eigenvalues of no mode: listed, named after what sets them, never refused."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tfarm
from tests.chain_elements import eigenvalues
from tests.shared import sized, thinned
from tests.spectrum.damped import judge_rig
from tfarm import Hub
from tfarm.arm import Motor
from tfarm.cli.running import run
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.loop.locus import open_poles
from tfarm.report.page import ArmReport
from tfarm.report.response_sections import damped_tables, locked_table
from tfarm.spectrum.damped import NOT_ASSIGNED, origins_of

STIFF_FRICTION = Path("tests/data/reproductions/stiff-friction.toml")
COUNTS = {28: 2, 83: 2, 227: 8}  # of modes that were requested of rigs once refused
RIGS = {n: (tfarm.load(f"tests/data/reproductions/stray_{n}.toml"), count) for n, count in COUNTS.items()}


@pytest.mark.parametrize("number", thinned([83, 28, 227], 3))
def test_a_list_is_not_refused_for_want_of_a_name(number: int) -> None:
    """All that finite elements have in the box, and a disc around each; something in the drive set what has no name."""
    found = judge_rig(*RIGS[number])
    assert (found.outcome, found.words) == ("unassigned", "")


def test_what_stiff_friction_holds_back_is_named_after_it() -> None:
    """The slow zero is about -k/b: half the friction doubles it; all in the box are those of finite elements."""
    arm = tfarm.load(STIFF_FRICTION)
    damped = tfarm.damped_modes(tfarm.modes(arm, 5))
    slow, *_ = damped.unassigned
    assert slow.origin == "hub friction"
    assert damped.left_out == 0
    half = replace(arm, hub=replace(arm.hub, friction=arm.hub.friction / 2))
    twice = eigenvalues(half, 5 * abs(slow.eigenvalue))
    assert twice[0].real / slow.eigenvalue.real == pytest.approx(2, rel=0.3)
    theirs = eigenvalues(arm, 1e4)
    theirs = theirs[damped.box.holds(theirs)]
    mine = np.r_[damped.eigenvalues[damped.is_assigned, 0], [each.eigenvalue for each in damped.unassigned]]
    assert mine.size == theirs.size
    np.testing.assert_allclose(np.sort_complex(mine), np.sort_complex(theirs), rtol=1e-6)


def test_origins_are_those_of_closed_forms() -> None:
    """A stiff, light link: -R/L_a of the circuit, about -b/J of the hub, and K^2/(J L_a) = |s|^2 of both together."""
    lab = tfarm.load("sasaki2012-lab")
    stiff = replace(lab, link=replace(lab.link, youngs_modulus=1e4 * lab.link.youngs_modulus, damping=0.0))
    slow = replace(stiff, hub=Hub(inertia=stiff.hub.inertia, friction=1e-3 * stiff.total_inertia))
    motor = Motor(resistance=1.0, torque_constant=0.05, inductance=1e-3, gear_ratio=50.0, rotor_inertia=1e-5)
    found = {
        "hub friction": (slow, -1e-3),
        "electrical pole": (replace(slow, motor=replace(motor, torque_constant=1e-5), input="motor_voltage"), -1e3),
    }
    for origin, (arm, value) in found.items():
        k = tfarm.modes(arm, 1).system
        near = eigenvalues(arm, 2 * abs(value))
        exact = near[abs(near / value - 1).argmin()]
        assert exact == pytest.approx(value, rel=1e-2)
        assert origins_of(k, np.array([complex(exact)])) == [origin]
    ringing = replace(stiff, motor=replace(motor, inductance=1.0), input="motor_voltage")
    near = eigenvalues(ringing, 100.0)
    pair = complex(near[near.imag > 0][0])
    inertia = ringing.total_inertia
    assert abs(pair) ** 2 == pytest.approx((50 * 0.05) ** 2 / (inertia * 1.0), rel=1e-3)
    assert origins_of(tfarm.modes(ringing, 1).system, np.array([pair])) == ["back-EMF and electrical pole"]
    mode = 1j * tfarm.modes(slow, 1).natural_frequency[-1:]
    assert origins_of(tfarm.modes(slow, 1).system, mode) == [NOT_ASSIGNED]


@pytest.mark.parametrize("number", thinned([83, 28, 227], 3))
def test_tables_of_them_hold_every_eigenvalue_and_no_nan(number: int) -> None:
    arm, count = RIGS[number]
    undamped = tfarm.modes(arm, count)
    damped = tfarm.damped_modes(undamped)
    first, *others = damped_tables(ArmReport(arm, Chain()), count)
    assert [row["index"] for row in first] == damped.index.tolist()
    assert [row["origin"] for each in others for row in each] == [each.origin for each in damped.unassigned]
    assert all("nan" not in cell for table in (first, *others) for column in table.columns for cell in column.cells)
    shapes = damped.shape(np.array([0.0, arm.length]))
    known = np.isfinite(damped.eigenvalues[damped.index > 0])
    assert np.isfinite(shapes[known]).all()
    assert np.isnan(shapes[~known]).all()
    assert np.isnan(damped.damping_ratio).sum() == (~damped.is_assigned).sum()
    assert ("Damped modes: no eigenvalue" in first.caption) == (not damped.is_assigned.all())
    assert ("Damped modes: " in first.caption) == (damped.left_out > 0 or not damped.is_assigned.all())
    locked_table(ArmReport(arm, Chain()), count)


@pytest.mark.parametrize("proof", sized((), ("--certify",)))
def test_the_command_lists_them(capsys: pytest.CaptureFixture[str], proof: tuple[str, ...]) -> None:
    command = ["modes", str(STIFF_FRICTION), "--count", "2", *proof]
    assert run([*command, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    apart = answer["unassigned_eigenvalues"]
    assert [each["origin"] for each in apart] == ["hub friction"] * 3
    discs = [each["discs"][0] for each in apart if proof]
    assert [float(disc["re"]) for disc in discs] == pytest.approx([each["eigenvalue"][0] for each in apart if proof])
    inside = [each["eigenvalue"][1] > 0 for each in apart if each["eigenvalue"][0] > answer["box"][0]]
    assert answer["eigenvalues_in_box"] == sum(1 + is_pair for is_pair in inside) == 3
    assert [mode["damping_ratio"] for mode in answer["modes"]] == [None, None]
    assert answer["damped_note"] == "no eigenvalue is assigned for certain to mode 1, 2"
    assert run(command) == 0
    out = capsys.readouterr().out
    assert re.search(r"hub friction +-9.269825", out)
    assert re.search(rf"^damped modes +{answer['damped_note']}$", out, re.MULTILINE)


def test_the_undamped_table_is_printed_whatever_happens_to_the_damped_one(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line has the reason; the exit code is that of a search that did not converge."""

    def lose(*_: object) -> None:
        raise ConvergenceError("no end of cuts", None, 0)

    monkeypatch.setattr("tfarm.spectrum.listing.damped_modes", lose)
    assert run(["modes", "sasaki2012-lab", "--count", "3"]) == 3
    out, err = capsys.readouterr()
    omega = tfarm.modes(tfarm.load("sasaki2012-lab"), 3).natural_frequency[1:]
    assert all(f"{each:.12g}" in out for each in omega)
    assert err == "tfarm: damped modes: no end of cuts\n"
    assert run(["modes", "sasaki2012-lab", "--count", "3", "--json"]) == 3
    answer = json.loads(capsys.readouterr().out)
    assert answer["damped_failure"] == "damped modes: no end of cuts"
    assert [mode["natural_frequency_rad_s"] for mode in answer["modes"][1:]] == omega.tolist()


def test_a_locus_begins_at_every_one_of_them() -> None:
    arm = tfarm.load(STIFF_FRICTION)
    poles, _ = open_poles(arm, 4)
    damped = tfarm.damped_modes(tfarm.modes(arm, 4))
    listed = np.r_[damped.unassigned_pairs, damped.eigenvalues[damped.is_assigned]].ravel()
    np.testing.assert_array_equal(np.sort_complex(poles), np.sort_complex(listed[np.isfinite(listed) & (listed != 0)]))


def test_an_eigenvalue_that_is_not_known_has_no_origin(recwarn: pytest.WarningsRecorder) -> None:
    arm = tfarm.load(STIFF_FRICTION)
    (slow, *_), k = tfarm.damped_modes(tfarm.modes(arm, 4)).unassigned, tfarm.modes(arm, 4).system
    assert origins_of(k, np.array([slow.eigenvalue, np.nan])) == [slow.origin, NOT_ASSIGNED]
    assert not recwarn.list
