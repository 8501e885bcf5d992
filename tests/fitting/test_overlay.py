"""Exact responses of one signal over another, and measured ones: planted differences are named, and mixed up units."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shared import refusal
from tests.shell import answer, refused, run
from tfarm.fitting.data import Measured, noise_of
from tfarm.fitting.overlay import overlay
from tfarm.fitting.ratio import Ratio
from tfarm.fitting.resonances import lines_of_peak, matched_peaks, must_be_in_unit, peaks_of, resonance_at

LAB = tfarm.load("sasaki2012-lab")
TRUE = replace(LAB, link=replace(LAB.link, youngs_modulus=1.2 * LAB.link.youngs_modulus, damping=2e-4))
GAIN, NOISE = -0.9, 0.01
OMEGA = np.linspace(5.0, 700.0, 3000)
RIG = tfarm.load("tests/rigs/bench-rig.toml")
BARE = tfarm.load("sasaki2012")  # without damping, where poles and zeros are counted, not searched for
PAIRS = (("tip_acceleration", "hub_angle"), ("root_moment", "hub_torque"))


def measured(output, input, arm=TRUE, scale=1.0, seed=1):
    """What a sensor of that gain and one per cent of noise in each part sees of another arm."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((2, OMEGA.size))
    H = GAIN * Ratio(arm, output, input)(1j * OMEGA)
    values = H * (1 + NOISE * (noise[0] + 1j * noise[1]))
    return Measured(output=output, input=input, omega=OMEGA * scale, values=values, sigma=NOISE * abs(H))


@pytest.fixture(scope="module")
def found():
    return {pair: overlay(LAB, measured(*pair)) for pair in PAIRS}


@pytest.mark.parametrize("pair", PAIRS)
def test_each_resonance_is_the_true_arms_pole_and_residue(pair, found):
    """Within five of the deviations that the fit to its lines gives; the poles are followed from the undamped modes."""
    one, ratio = found[pair], Ratio(TRUE, *pair)
    eigenvalues = tfarm.damped_modes(tfarm.modes(ratio.driven_arm, 4)).eigenvalues
    poles = np.sort_complex(eigenvalues[eigenvalues.imag > 0])[::-1]
    assert [row.mode for row in one.modes] == [1, 2, 3]
    for row, pole in zip(one.modes, poles, strict=False):
        near = row.measured
        assert abs(near.pole.imag - pole.imag) < 5 * near.std[1]
        assert abs(near.pole.real - pole.real) < 5 * near.std[0]
        assert near.std[0] < 0.1 * abs(pole.real)
        assert near.residue == pytest.approx(GAIN * ratio.residue(complex(pole), one.roots), rel=0.1)
        assert row.level.real < 0  # the sensor is the other way round
    assert one.unmatched.size == 0


def test_of_the_true_arm_only_the_sensor_differs():
    """Its gain and sign in every residue, and no frequency; lines are taken from three half-widths to each side."""
    one = overlay(TRUE, measured(*PAIRS[1]))
    for row in one.modes:
        assert row.level == pytest.approx(GAIN, rel=0.05)
        assert row.frequency_ratio == pytest.approx(1.0, abs=1e-3)
        assert row.level_db == pytest.approx(20 * np.log10(-GAIN), abs=0.5)
    for row in one.modes[:2]:  # the third overlaps its neighbours
        kept = one.measured.omega[lines_of_peak(one.measured, int(np.argmin(abs(OMEGA - row.peak))))]
        half, line = row.damping_ratio * abs(row.pole), OMEGA[1] - OMEGA[0]
        assert kept[[0, -1]] == pytest.approx(row.peak + 3 * half * np.array([-1, 1]), abs=0.3 * half + 3 * line)


def test_a_noise_given_too_small_is_taken_from_the_residuals():
    data = measured(*PAIRS[1])
    (place, *_) = peaks_of(data, data.sigma)
    given, small = (resonance_at(data, data.sigma / by, place).std for by in (1, 10))
    assert small == pytest.approx(given, rel=0.2)


def test_the_one_number_that_explains_a_mode_does(found):
    """With Young's modulus changed by it the arm has the measured frequency; of a power law all modes agree."""
    one = found[PAIRS[0]]
    factors = {each[:2]: 1 + each.change / 100 for each in one.required_changes}
    for row in one.modes:
        factor = factors["youngs_modulus", row.mode]
        assert factor == pytest.approx(1.2, abs=0.01)
        other = replace(LAB, input="hub_angle", link=replace(LAB.link, youngs_modulus=factor * LAB.link.youngs_modulus))
        w = tfarm.modes(other, count=3).natural_frequency
        assert w[row.mode - 1] == pytest.approx(abs(row.measured.pole), rel=2e-3)
    assert "hub_inertia" not in {name for name, _ in factors}  # with the angle held it moves none
    assert ("hub_inertia", 1) in {each[:2] for each in found[PAIRS[1]].required_changes}


def test_a_peak_that_the_arm_does_not_have_is_named():
    data = measured("root_moment", "hub_torque")
    s, p = 1j * OMEGA, complex(-1.0, 400.0)
    alien = 3.0 * (1 / (s - p) + 1 / (s - p.conjugate()))
    one = overlay(BARE, replace(data, values=data.values + alien))
    assert one.unmatched == pytest.approx([400.0], abs=2.0)
    assert [row.mode for row in one.modes if row.peak is not None] == [1, 2, 3]


@pytest.mark.parametrize(("scale", "message"), [(2 * np.pi, "6.28"), (1 / (2 * np.pi), "0.159")])
def test_frequencies_in_another_unit_than_the_header_are_one_line(scale, message):
    error = refusal(overlay, BARE, measured("root_moment", "hub_torque", scale=scale))
    words = "are rad/s given as Hz?" if scale > 1 else "are Hz given as rad/s?"
    assert f"its peaks are {message} times the arm's frequencies: {words}" in str(error)


def test_peaks_a_third_off_and_missing_ones_are_no_other_unit():
    """Of an arm's frequencies up to 35 % off, each seen or not: in 120 draws none is taken for another unit."""
    rng = np.random.default_rng(5)
    arms = (BARE, tfarm.load("quanser-2dsfl"))
    spectra = [tfarm.modes(arm, count=40).natural_frequency[-40:] for arm in arms]
    accepted = 0
    for n in range(120):
        own = spectra[n % 2]
        first, count = rng.integers(0, 3), rng.integers(1, 6)
        w = np.sort(own[first : first + count] * rng.uniform(0.7, 1.35) * np.exp(0.04 * rng.standard_normal(count)))
        omega = np.r_[0.5 * w[0], np.repeat(w, 3) * np.tile([0.99, 1.0, 1.01], count), 1.5 * w[-1]]
        heights = np.r_[1.0, np.ravel([(1.0, 9.0 if rng.random() < 0.85 else 1.0, 1.0) for _ in w]), 1.0]
        if (np.diff(omega) > 0).all():
            data = Measured(output="hub_angle", input="hub_torque", omega=omega, values=heights)
            must_be_in_unit(data, 0.01 * heights, 1j * own)
            accepted += 1
    assert accepted > 100


def test_pairs_are_in_order_and_of_least_cost():
    """By hand: 1.3 is nearer to 1 than leaving both costs; of 5 and 6 the nearer one; 40 has no partner."""
    pairs, cost = matched_peaks(np.array([1.3, 5.0, 40.0]), np.array([1.0, 4.0, 6.0]), (0.5, 100.0))
    assert pairs == [(0, 0), (1, 2)]
    assert cost == pytest.approx(np.log(1.3) + np.log(6 / 5) + 0.3 + 0.3)


def test_values_of_zero_leave_every_other_value_its_noise():
    """A line at which nothing came through is no number to divide by, and no certainty either."""
    data = measured("root_moment", "hub_torque")
    noise = [noise_of(replace(data, sigma=None, values=np.where(w > OMEGA, 0.0, data.values))) for w in (0, 8, 690)]
    assert all((one.sigma > 0).all() and np.isfinite(one.sigma).all() for one in noise)
    assert noise[1].sigma[200:] == pytest.approx(noise[0].sigma[200:], rel=0.2)
    assert np.median(noise[0].sigma / (NOISE * abs(data.values))) == pytest.approx(1.0, abs=0.15)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """A file as a laboratory writes it."""
    path, data = tmp_path_factory.mktemp("sweep") / "sweep.csv", measured("root_moment", "hub_torque")
    rows = zip(*(x.tolist() for x in (data.omega / (2 * np.pi), data.values.real, data.values.imag)), strict=True)
    path.write_text("\n".join(["hz,re,im,coherence,averages", *(f"{a!r},{b!r},{c!r},0.998,10" for a, b, c in rows)]))
    return path


def test_the_command_prints_writes_and_draws(sweep, tmp_path, capsys):
    options = ("response", "sasaki2012", "--measured", f"root_moment/hub_torque={sweep}")
    png, table = tmp_path / "o.png", tmp_path / "o.csv"
    code, out, err = run(capsys, *options, "--png", str(png), "--csv", str(table))
    assert (code, err) == (0, f"written: {table}\nwritten: {png}\n")
    assert png.read_bytes().startswith(b"\x89PNG")
    assert len(list(csv.reader(table.read_text().splitlines()))) == 1 + OMEGA.size
    assert "single changes that explain a mode" in out
    assert "N m/(N m)" in out
    given = answer(capsys, *options)
    rows = zip(given["modes"], overlay(BARE, measured("root_moment", "hub_torque")).modes, strict=True)
    for row, own in rows:
        assert row["measured_hz"] == pytest.approx(abs(own.measured.pole) / (2 * np.pi), rel=1e-4)
        assert row["exact_hz"] == abs(own.pole) / (2 * np.pi)
    changes = {(each["parameter"], each["mode"]): each["change_percent"] for each in given["required_percent"]}
    assert changes["youngs_modulus", 1] == pytest.approx(20.0, abs=0.5)
    assert given["power_at_zero"] == -0
    assert given["poles"] == [[0.0, w] for w in tfarm.modes(BARE, up_to=1.8 * 700).natural_frequency[1:]]
    assert given["noise"] == "coherence of 10 averages"


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (("--output", "root_moment"), "--output = 'root_moment': a measured response has its own"),
        (("--omega", "1,2"), "--omega = (1.0, 2.0)"),
    ],
)
def test_options_that_do_not_go_with_it_are_refused(extra, message, sweep, capsys):
    options = ("response", "sasaki2012", "--measured", f"root_moment/hub_torque={sweep}")
    assert message in refused(capsys, *options, *extra)


def test_without_an_output_the_command_has_the_root_moment_and_no_picture_without_a_measurement(capsys, tmp_path):
    assert answer(capsys, "response", "sasaki2012-lab", "--s", "1j")["output"] == "root_moment"
    assert "needs --measured" in refused(capsys, "response", "sasaki2012-lab", "--png", str(tmp_path / "a.png"))


S = 1j * np.array([3.0, 40.0, 150.0, 300.0]) + 0.2


def test_over_the_measured_hub_angle_it_is_that_of_the_held_hub():
    """The angle as input and the angle as one of two signals: two ways to the same function, poles and zeros."""
    direct = Ratio(RIG, "tip_acceleration", "hub_angle")
    above, below = (tfarm.transfer(RIG, each) for each in ("tip_acceleration", "hub_angle"))
    assert direct(S) == pytest.approx(above(S) / below(S), rel=1e-12)
    found = direct.roots(300.0)
    held = below.zeros(up_to=300.0).values
    held = held[(held != 0) & (held.imag >= 0)]
    assert np.sort_complex(found.poles) == pytest.approx(np.sort_complex(held), rel=1e-11)
    assert found.at_zero == 2


def test_of_two_signals_it_has_their_zeros_and_none_of_the_arms_poles():
    """On a circle about each root the ratio turns once, and about the arm's own poles not at all."""
    ratio = Ratio(LAB, "moment@0.3", "hub_rate")
    found = ratio.roots(250.0)
    everything = np.r_[found.poles, found.zeros, found.poles.conj(), found.zeros.conj(), 0.0]

    def turns(centre):
        far = min((abs(centre - each) for each in everything if each != centre), default=1.0)
        circle = centre + 0.3 * far * np.exp(2j * np.pi * np.arange(65) / 64)
        return round(np.unwrap(np.angle(ratio(circle)))[[0, -1]] @ [-1, 1] / (2 * np.pi))

    assert {turns(pole) for pole in found.poles} <= {-1}
    assert {turns(zero) for zero in found.zeros} == {1}
    own = tfarm.transfer(LAB, "hub_angle").poles(up_to=250.0).values
    assert {turns(pole) for pole in own[own != 0]} == {0}
    assert found.common.size == 0
    low = abs(ratio(np.array([1e-3j, 2e-3j])))
    assert math.log2(low[1] / low[0]) == pytest.approx(found.at_zero, abs=1e-4)


def test_what_both_signals_share_cancels():
    """Acceleration over displacement is s^2: all zeros are common."""
    ratio = Ratio(BARE, "tip_acceleration", "tip_displacement")
    found = ratio.roots(250.0)
    assert (found.poles.size, found.zeros.size, found.at_zero) == (0, 0, 2)
    assert found.common.size > 0
    assert ratio(S) == pytest.approx(S**2, rel=1e-12)


def test_residues_are_those_by_the_derivative():
    """At a simple zero p of what is below, r = T_out(p)/T_in'(p)."""
    above, below = tfarm.transfer(LAB, "tip_acceleration"), tfarm.transfer(LAB, "hub_angle")
    ratio = Ratio(LAB, "tip_acceleration", "hub_angle")
    found = ratio.roots(600.0)
    for pole in found.poles[found.poles.imag > 0].tolist():
        assert ratio.residue(pole, found) == pytest.approx(above(pole) / below.derivative(pole), rel=1e-8)


@pytest.mark.parametrize(
    ("arm", "output", "input", "message"),
    [
        (LAB, "tip_acceleration", "tip_acceleration", "a signal over itself is 1"),
        (LAB, "strain@0.05", "hub_rate", "link.section.shape"),
        (LAB, "moment", "hub_rate", "moment.x is missing"),
        (LAB.with_numbers(hub_inertia=math.inf), "root_moment", "hub_torque", "drives no locked hub"),
        (LAB, "moment@9", "hub_rate", "a point of the arm lies between"),
        (LAB, "root_moment", "motor_voltage", "motor"),
        (LAB.with_numbers(payload_mass=math.inf), "root_moment", "tip_acceleration", "it is held"),
    ],
)
def test_signals_that_the_arm_does_not_have_are_refused(arm, output, input, message):
    assert message in str(refusal(Ratio, arm, output, input))


def test_a_current_that_is_measured_is_the_current_that_drives():
    rig = replace(tfarm.load("quanser-flexlink"), input="motor_voltage")
    above, below = (tfarm.transfer(rig, each) for each in ("hub_rate", "motor_current"))
    assert Ratio(rig, "hub_rate", "motor_current")(S) == pytest.approx(above(S) / below(S), rel=1e-11)
