"""Damped modes, with their starts, against a Galerkin model, the paper's determinant and closed forms.

Eigenvalues of no mode are listed too, named after what sets them, and never refused.
"""

import json
import math
import re
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import tfarm
from tests.chain_elements import eigenvalues
from tests.shared import sized, thinned
from tests.spectrum.damped import judge, judge_rig, pairs, some_damped_arm
from tests.spectrum.independent import newton_step, pinned, sine_waves
from tests.strategies import arm_of, some_arm
from tfarm import Arm, Hub
from tfarm.arm import Motor
from tfarm.cli.running import run
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError
from tfarm.exact.system import system_of
from tfarm.loop.branches import open_poles
from tfarm.report.page import ArmReport
from tfarm.report.response_sections import damped_tables, locked_table
from tfarm.spectrum.damped import NOT_ASSIGNED, DampedModes, damped_modes, damped_starts, origins_of
from tfarm.spectrum.naming import function_of

EPS = np.finfo(float).eps
EXTREMES = ((0.0, 0.0, 0.0), (math.inf, math.inf, math.inf), (0.0, math.inf, 0.0), (1.0, 0.0, math.inf))


def damped_arm(C, *, hub=1.0, mass=0.0, inertia=0.0, slenderness=50.0) -> Arm:
    return arm_of(
        length=1.0, slenderness=slenderness, width=3.0, density=7800.0, E=2.1e11, nu=0.3,
        damping=C, hub=hub, mass=mass, inertia=inertia,
    )  # fmt: skip


def listed(arm: Arm, count: int, theory="timoshenko") -> DampedModes:
    return damped_modes(tfarm.modes(arm, count, theory=theory))


def nearest_apart(ours, theirs):
    """Relative distance of each of ours to the nearest of theirs."""
    return np.array([abs(theirs / zero - 1).min() for zero in np.ravel(ours)])


def test_random_arms_are_listed_completely() -> None:
    """`python -m tests.spectrum.damped 200` for more, here and below."""
    rng = np.random.default_rng(41)
    found = [judge(*some_damped_arm(rng), certify=False) for _ in range(2)]
    assert [each.words for each in found if each.outcome != "right"] == []
    assert sum(each.figures["eigenvalues in the box"] for each in found) > 20


def test_random_arms_are_proven_complete() -> None:
    rng = np.random.default_rng(43)
    arm, count = some_damped_arm(rng)
    found = judge(arm, min(count, 5), model=False)
    assert (found.outcome, found.words) == ("right", "")


DAMPINGS = [(1e-2, 500.0), (1e-6, 500.0), (1e-12, 500.0), (1e-12, 5.0), (1e-6, 5.0), (1e-2, 5.0)]


@pytest.mark.parametrize(("damping", "ends"), thinned(product(DAMPINGS, EXTREMES), 5))
def test_extreme_ends(damping: tuple[float, float], ends: tuple[float, float, float]) -> None:
    (C, slenderness), (hub, mass, inertia) = damping, ends
    arm = damped_arm(C, hub=hub, mass=mass, inertia=inertia, slenderness=slenderness)
    for count in (1, 8):
        found = judge(arm, count, certify=False, model=slenderness < 100)
        assert found.outcome == "right", (count, found.words)


def test_eigenvalues_beyond_the_box_are_zeros_too() -> None:
    """Two branches of this arm once ended at 4e11 1/s, where a slope by differences was none, right of the axis."""
    arm = tfarm.load("sasaki2012-lab").with_numbers(damping=1e-3)
    found = pairs(listed(arm, 20))
    found = found[np.isfinite(found)]
    assert found.size > 30
    assert found.real.max() <= 0
    steps = np.array([newton_step(arm, complex(s)) for s in found[found.imag >= 0]])
    assert steps.max() < 1e-8


@pytest.mark.parametrize("overdamping", thinned([3.0, 0.05, 30.0], 3))
def test_the_papers_determinant_vanishes_there(overdamping: float) -> None:
    rng = np.random.default_rng(12)
    for case in (
        ("some", "some", "some"),
        ("infinite", "zero", "zero"),
        ("zero", "infinite", "some"),
        ("some", "zero", "infinite"),
    ):
        arm = some_arm(rng, case, damping=0.0, slenderness=(8, 80))
        arm = arm.with_numbers(damping=2 * overdamping / float(tfarm.modes(arm, 5).natural_frequency[-1]))
        damped = listed(arm, 5)
        steps = [newton_step(arm, zero) for zero in pairs(damped).ravel()]
        assert max(steps) < 1e-14, (case, steps)


ENDS = [(math.inf, 0.0, 0.0), (0.0, 0.0, 0.0), (0.7, 0.5, 2.0), (2.0, math.inf, 0.1)]
WITHOUT_SHEAR = [(theory, *ends) for theory in ("euler-bernoulli", "rayleigh") for ends in ENDS]


@pytest.mark.parametrize(("theory", "hub", "mass", "inertia"), thinned(WITHOUT_SHEAR, 5))
def test_without_shear_damping_is_proportional(theory, hub, mass, inertia) -> None:
    """All the stiffness is damped, and no inertia is: s^2 + w^2 (1 + C s) = 0 whatever the ends carry."""
    rigid = damped_arm(0.0, hub=hub, mass=mass, inertia=inertia)
    omega = tfarm.modes(rigid, 10, theory=theory).natural_frequency
    flexible = omega[omega > 0]
    for C in (1e-3 / flexible[-1], 1.7 / flexible[4], 11 / flexible[0]):
        damped = listed(rigid.with_numbers(damping=C), 10, theory)
        p, q = pairs(damped).T
        assert (abs((p + q).real + C * flexible**2) < 1e-11 * C * flexible**2 + 64 * EPS * flexible).all()
        np.testing.assert_allclose((p * q).real, flexible**2, rtol=1e-11)
        np.testing.assert_allclose(damped.damping_ratio[damped.index > 0], C * flexible / 2, rtol=1e-11, atol=64 * EPS)
        np.testing.assert_array_equal(damped.is_overdamped[damped.index > 0], C * flexible > 2)


WAVES = list(product(("timoshenko", "shear", "rayleigh", "euler-bernoulli"), (5.0, 30.0)))


@pytest.mark.parametrize(("theory", "slenderness"), thinned(WAVES, 8))
def test_sine_waves_between_two_pins(theory: str, slenderness: float) -> None:
    """Every eigenvalue listed is a root of a wave's polynomial, and every root in the box is listed."""
    link = damped_arm(0.0, slenderness=slenderness).link
    first = tfarm.modes(pinned(link), 1).natural_frequency[-1]
    for C in (1e-4 / first, 0.02 / first, 0.3 / first, 4 / first):
        arm = pinned(replace(link, damping=C))
        waves, cut_off = sine_waves(arm, 400, theory)
        exact = np.concatenate([waves.ravel(), cut_off])
        damped = listed(arm, 12, theory)
        assert nearest_apart(pairs(damped), exact).max() < 1e-9
        assert damped.box.holds(exact).sum() == damped.count, (theory, C)
        inside = exact[damped.box.holds(exact)]
        assert nearest_apart(inside, pairs(damped).ravel()).max(initial=0) < 1e-9


def test_slow_and_fast_zeros_of_overdamped_sine_waves() -> None:
    """Slow ones lie left of -1/C and tend to it; each pair is of one wave, in shear where its fast zero met a third."""
    C = 3e-3
    arm = pinned(damped_arm(C, slenderness=200.0).link)
    damped = listed(arm, 8)
    overdamped = damped.is_overdamped
    np.testing.assert_array_equal(damped.index[overdamped], [4, 5, 6])
    slow, fast = damped.eigenvalues[overdamped].real.T
    assert (slow < -1 / C).all()
    assert (np.diff(slow) > 0).all()
    assert (fast < slow).all()
    for wave, pair in zip(sine_waves(arm, 8)[0], damped.eigenvalues, strict=True):
        assert nearest_apart(pair, wave).max() < 1e-9


@pytest.mark.parametrize("seed", thinned(range(5), 3))
def test_little_damping_takes_the_bending_share_of_the_energy(seed: int) -> None:
    """Re s = -C w^2 d ln w/d ln E to first order (G held), Im s = w: the error falls with C^2."""
    arm = some_arm(np.random.default_rng(seed), damping=0.0, slenderness=(5, 40))
    undamped = tfarm.modes(arm, 8)
    flexible = undamped.index > 0
    omega, share = undamped.natural_frequency[flexible], undamped.sensitivity["youngs_modulus"][flexible]
    errors = []
    for Cw in (1e-3, 1e-4):
        C = Cw / omega[-1]
        s = pairs(damped_modes(tfarm.modes(arm.with_numbers(damping=C), 8)))[:, 0]
        errors.append(abs(s.real / (-C * omega**2 * share) - 1).max())
        assert abs(s.imag / omega - 1).max() < 10 * Cw**2
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 50


def test_no_damping_leaves_the_modes_on_the_axis() -> None:
    damped = listed(damped_arm(0.0), 8)
    np.testing.assert_array_equal(damped.eigenvalues[1:, 0], 1j * damped.natural_frequency[1:])
    np.testing.assert_array_equal(damped.damping_ratio, 0.0)
    assert not damped.is_overdamped.any()
    assert damped.count == 2 * 8 + 2


@pytest.mark.parametrize(
    ("hub", "mass"), thinned([(0.3, 0.4), (0.0, 0.4), (math.inf, 0.0), (math.inf, 0.4), (0.5, math.inf)], 4)
)
def test_shapes_tend_to_the_undamped_ones(hub: float, mass: float) -> None:
    arm = damped_arm(1e-12, hub=hub, mass=mass, inertia=0.2, slenderness=20.0)
    damped, undamped = listed(arm, 4), tfarm.modes(arm, 4)
    x = np.linspace(0, 1, 7)
    for name in ("shape", "rotation", "moment"):
        real = getattr(undamped, name)(x)[undamped.index > 0]
        for j in (0, 1):
            np.testing.assert_allclose(getattr(damped, name)(x)[:, j], real, rtol=1e-6, atol=1e-6 * abs(real).max())


@pytest.mark.parametrize("name", ["shape", "rotation", "moment"])
def test_a_hub_that_is_held_is_the_limit_of_a_heavy_one(name: str) -> None:
    """They differ by the arm's inertia over the hub's: nothing of a shape is lost where the hub hardly turns."""
    lab = tfarm.load("sasaki2012-lab")
    held, *heavy = (
        getattr(listed(lab.with_numbers(hub_inertia=inertia), 2), name)(np.linspace(0.0, lab.length, 7))
        for inertia in (math.inf, 1e9, 1e12)
    )
    size = abs(held).max()
    assert size > 0.1
    for inertia, found in zip((1e9, 1e12), heavy, strict=True):
        np.testing.assert_allclose(found, held, rtol=0, atol=(3.0 / inertia + 1e-14) * size)


def test_shapes_are_conjugate_and_of_the_shape_of_x() -> None:
    damped = listed(damped_arm(2e-5, hub=0.3, mass=0.4, inertia=0.5, slenderness=12.0), 3)
    assert damped.shape(1.0).shape == (3, 2)
    assert damped.moment(np.zeros((2, 5))).shape == (3, 2, 2, 5)
    w = damped.shape(np.linspace(0, 1, 5))
    np.testing.assert_allclose(w[:, 1], w[:, 0].conj(), rtol=1e-12)
    with pytest.raises(tfarm.ParameterError, match="between 0 and 1"):
        damped.shape(1.01)


@pytest.mark.parametrize("C", [1e-5, 1e-3, 0.02])
@pytest.mark.parametrize("name", ["sasaki2012", "stocky-steel"])
def test_on_two_pins_they_are_the_eigenvalues(name, C):
    """There mode n has k = n pi/L whatever the damping; below the cut-off and above, bending and shear, also real ones.

    The oracle is the characteristic function, in which k does not occur: a step of Newton's method is rounding.
    """
    arm = tfarm.load(name).with_numbers(damping=C, hub_inertia=0.0, payload_mass=math.inf, payload_inertia=0.0)
    omega = tfarm.modes(arm, 6).natural_frequency[1:]
    starts = damped_starts(arm, omega)[2 * omega.size :]  # behind those of no damping
    starts = starts[abs(1 + C * starts) > 0.2]
    at = function_of(system_of(arm))(starts)
    assert starts.size >= omega.size
    assert (abs(at.value / at.slope) < 1e-7 * abs(starts)).all()


def test_without_damping_they_are_the_frequencies():
    omega = np.array([3.0, 40.0])
    arm = tfarm.load("sasaki2012")
    np.testing.assert_array_equal(damped_starts(arm, omega), [3j, 40j, -3j, -40j])


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
