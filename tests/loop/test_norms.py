"""Norms of weighted S, K S and T: against python-control, the aliased exact plant, dense values; weights of files."""

import math

import control
import numpy as np
import pytest
from scipy.integrate import quad

import tfarm
from tests.dsp.independent import aliased_loop
from tests.loop.norms import norms
from tests.shared import refusal, sized
from tests.shell import answer, refused
from tests.survey import tally
from tfarm import HubFeedback, Law
from tfarm.arm.law_tables import load_weights
from tfarm.arm.weights import weights_of
from tfarm.arm.writing import to_toml
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling, pulse_transfer
from tfarm.dsp.discretise import discretise_law
from tfarm.loop.left_poles import bound_left_of, left_response
from tfarm.loop.norms import STACKED, controller_entries, norm, weight_sizes, weighted_sizes
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_verdict import sampled_verdict

T = 0.01
LAB = tfarm.load("sasaki2012-lab")
FAST = HubFeedback(K1=3.0, K2=0.15)
GAINS = HubFeedback(K1=0.3, K2=0.3)
LEAD = Law({"hub_angle": ([1.0, 2.0], [0.01, 1.0])}, delay=0.002)
IN_S = {"S": ([0.5, 2.0], [1.0, 0.02]), "KS": 0.1}


def in_z(num, den):
    return control.tf(num, den, T)


WEIGHTS = {"S": in_z([0.6, -0.57], [1.0, -0.999]), "KS": in_z([0.2, -0.19], [1.0, -0.5]), "T": in_z([1.0], [1.0])}


@pytest.mark.parametrize("names", [("S",), ("KS",), ("T",), ("S", "KS", "T")], ids="+".join)
def test_norms_of_a_finite_model_are_those_of_python_control(names):
    """Of a model of the same modes, closed by hand, by its bisection on the eigenvalues of a Hamiltonian."""
    G = pulse_transfer(LAB, ["hub_angle"], Sampling(delay_samples=0.2), count=14).state_space()
    Ak, Bk, Ck, Dk = discretise_law(LEAD, T).matrices()
    A = np.block([[G.A - G.B @ Dk @ G.C, G.B @ Ck], [-Bk @ G.C, Ak]])
    nothing = np.zeros((1, len(Ak)))
    rows = {"S": np.hstack([-G.C, nothing]), "KS": np.hstack([-Dk @ G.C, Ck]), "T": np.hstack([G.C, nothing])}
    direct = {"S": 1.0, "KS": Dk.item(), "T": 0.0}
    C, D = np.vstack([rows[name] for name in names]), np.array([[direct[name]] for name in names])
    closed = control.ss(A, np.vstack([G.B @ Dk, Bk]), C, D, T)
    theirs = discrete_norm(control.append(*(control.ss(WEIGHTS[name]) for name in names)) * closed)
    found = norm(LAB, LEAD, weights={name: WEIGHTS[name] for name in names}).bounds[-1]
    assert found.value == pytest.approx(theirs, rel=1e-6)
    assert theirs * (1 - 1e-7) <= found.upper <= 1.001 * theirs


def discrete_norm(system):
    """The norm in continuous time after z = (1 + s)/(1 - s): python-control alone has none with poles at z = 0."""
    A, B, C, D = system.A, system.B, system.C, system.D
    # square, as its bisection needs it
    B, D = (np.pad(each, ((0, 0), (0, len(C) - 1))) for each in (B, D))
    inverse = np.linalg.inv(A + np.eye(len(A)))
    unit = math.sqrt(2.0)
    continuous = control.ss(inverse @ (A - np.eye(len(A))), unit * inverse @ B, unit * C @ inverse, D - C @ inverse @ B)
    return control.system_norm(continuous, p="inf", tol=1e-8)


@pytest.mark.parametrize("law", [GAINS, FAST])
def test_the_exact_plant_has_the_value_and_no_larger_one(law):
    """|S| by the aliasing sum over the transcendental plant: at the peak, and at random frequencies."""
    (row, _) = norm(LAB, law, weights={"S": 1.0}).bounds
    angles = np.r_[row.omega * T, np.random.default_rng(3).uniform(0.01, math.pi, 20)]
    L = [law.K1 * R + law.K2 * M for R, M in (aliased_loop(LAB, np.exp(1j * q), T) for q in angles)]
    sizes = abs(1 / (1 + np.array(L)))
    assert sizes[0] == pytest.approx(row.value, rel=1e-5)
    assert sizes.max() <= row.upper <= 1.001 * row.value


@pytest.mark.parametrize("size", sized(20, 200))
def test_no_dense_value_is_above_the_bound_nor_more_than_a_thousandth_below(size):
    outcomes, figures, wrong = tally(norms, size, 1)
    assert wrong == 0
    assert outcomes["bounded"] >= 0.9 * size
    assert max(figures["values"]) < 1e-6


def test_poles_that_decay_within_a_sample_respond_with_the_moments_of_their_residues():
    """Damping of a tenth of critical and 1 ms: bending modes left of the line, by the sum over them."""
    arm, sampling = LAB.with_numbers(damping=3e-4), Sampling(period=0.001, delay_samples=0.3)
    band = sampled_verdict(Case(arm, GAINS, Chain(sampling=sampling))).band
    found = left_response(band.loop, band.line, band.top)
    plant = band.loop.plant
    p = plant.poles[~band.kept]
    shares = plant.residues[:, ~band.kept] / p * np.exp(p * sampling.remaining)
    moments = (shares @ np.exp(np.multiply.outer(p * sampling.period, np.arange(found.moments.shape[1])))).real
    row = band.loop.in_z.signals.index("root_moment")
    assert abs(moments[row, 0]) > 100 * found.error[row]
    assert abs(2 * (found.moments - moments)[row]).sum() <= 1e-4 * band.missing[row]
    assert found.error[row] < 1e-4 * band.missing[row]


@pytest.mark.parametrize("k", [0, 1, 3])
def test_moments_are_integrals_around_the_region_left_of_a_line(k):
    """Counter-clockwise, in from the far left below, up the line and out along the top, by SciPy's quadrature."""
    line, top = 100.0, 120.0
    sampling = Sampling(period=T, delay_samples=0.4)
    loop = sampled_loop(Case(LAB, GAINS, Chain(sampling=sampling)), count=8)
    G = tfarm.transfer(LAB, "root_moment")
    far = -line - 45.0 / sampling.remaining
    corners = np.array([far - 1j * top, -line - 1j * top, -line + 1j * top, far + 1j * top])
    total = 0.0
    for start, way in zip(corners, np.diff(corners), strict=False):

        def integrand(t, start=start, way=way):
            s = start + t * way
            return way * G(s) / s * np.exp(s * (sampling.remaining + k * T)) / (2j * np.pi)

        total += quad(integrand, 0.0, 1.0, complex_func=True, limit=400)[0]
    found = left_response(loop, line, top)
    row = loop.in_z.signals.index("root_moment")
    assert found.moments[row, k] == pytest.approx(total.real, abs=found.error[row])
    assert found.error[row] < 1e-4 * bound_left_of(loop, line, top)[row]
    assert abs(total.imag) < 1e-9


def test_the_default_norms_are_ms_and_mt():
    found, margins = norm(LAB, GAINS), sampled_verdict(Case(LAB, GAINS)).in_band
    sensitivity, complementary, _ = found.bounds
    assert sensitivity.value == pytest.approx(margins.peak_sensitivity, rel=1e-7)
    assert complementary.value == pytest.approx(margins.peak_complementary, rel=1e-7)
    assert (found.norm.value, found.upper, found.is_certified) == (sensitivity.value, sensitivity.upper, True)
    assert found.gap <= 1e-3
    assert found.certainty.startswith("certified up to")


def test_an_integrator_is_allowed_where_the_function_is_0_at_rest():
    """S of a loop with the angle fed back falls as s^2; 1/s twice leaves its limit, (J + ...)/Kp, at rest."""
    law = HubFeedback(K1=3.0, K2=0.15, Kp=2.0)
    (row, _) = norm(LAB, law, weights={"S": ([1.0], [1.0, 0.0])}).bounds
    omega = np.geomspace(1e-3, math.pi / T, 20_000)
    L = sampled_verdict(Case(LAB, law)).full.loop_function(1j * omega)
    dense = (1 / abs(1 + L) / omega).max()
    assert dense * (1 - 1e-9) <= row.upper <= 1.0011 * dense
    (row, _) = norm(LAB, law, weights={"S": ([1.0], [1.0, 0.0, 0.0])}).bounds
    assert row.omega == 0
    assert row.value == pytest.approx(LAB.total_inertia / 2.0, rel=1e-3)
    (row, _) = norm(LAB, law, weights=weights_of({"S": ([T * T], [1.0, -2.0, 1.0])}, T)).bounds
    assert row.value == pytest.approx(LAB.total_inertia / 2.0, rel=1e-3)


def test_an_unstable_loop_has_an_infinite_norm_and_an_undamped_one_no_bound():
    unstable = norm(LAB, GAINS.with_number("K2", 5.0))
    assert (unstable.stability, unstable.norm.value, unstable.upper) == ("unstable", math.inf, math.inf)
    undamped = tfarm.load("quanser-flexlink")
    found = norm(undamped, tfarm.default_gains(undamped))
    assert (found.stability, found.upper, found.gap, found.is_certified) == ("stable", None, None, False)
    assert found.certainty.startswith("approximate")


def test_values_of_many_laws_on_a_grid_are_those_of_each():
    omega = np.geomspace(0.1, 300.0, 50)
    laws = [sampled_verdict(Case(LAB, law)).full for law in (GAINS, FAST)]
    weights = weights_of({**IN_S, "T": 2.0})
    L = np.array([loop.loop_function(1j * omega) for loop in laws])
    K = np.array([controller_entries(loop, omega) for loop in laws])
    found = weighted_sizes(L, K, weight_sizes(weights, omega, T))
    for n, law in enumerate((GAINS, FAST)):
        S = 1 / (1 + L[n])
        rows = [
            abs(S * (0.5j * omega + 2) / (1j * omega + 0.02)),
            0.1 * math.hypot(law.K1, law.K2) * abs(S),
            2 * abs(1 - S),
        ]
        for name, row in zip(("S", "KS", "T"), rows, strict=True):
            np.testing.assert_allclose(found[name][n], row, rtol=1e-9)
        np.testing.assert_allclose(found[STACKED][n] ** 2, sum(row**2 for row in rows), rtol=1e-9)


FILE = "[law]\n[law.hub_rate]\ngain = 3.0\n[law.root_moment]\ngain = 0.15\n[weights]\nKS = 0.1\n[weights.S]\n"


def test_the_command_reads_weights_of_the_controllers_file_or_of_options(tmp_path, capsys):
    path = tmp_path / "law.toml"
    path.write_text(FILE + "num = [0.5, 2.0]\nden = [1.0, 0.02]\n")
    assert load_weights(path) == weights_of(IN_S)
    of_file = answer(capsys, "norm", "sasaki2012-lab", "--law", str(path))
    options = ("--weight", "S=0.5,2/1,0.02", "--weight", "KS=0.1")
    typed = answer(capsys, "norm", "sasaki2012-lab", "--K1", "3", "--K2", "0.15", *options)
    assert of_file["bounds"] == typed["bounds"]
    assert [row["function"] for row in typed["bounds"]] == ["W_S S", "W_KS K S", "stacked column"]
    other = answer(capsys, "norm", "sasaki2012-lab", "--law", str(path), "--weight", "T=1")
    assert [row["function"] for row in other["bounds"]] == ["W_T T", "stacked column"]
    assert load_weights("sasaki2012-lab") is None
    arm = tmp_path / "arm.toml"
    arm.write_text(f"{to_toml(LAB)}\n{path.read_text()}")
    assert answer(capsys, "norm", str(arm))["bounds"] == of_file["bounds"]


@pytest.mark.parametrize(
    ("weights", "key"),
    [
        ({"Q": 1.0}, "weights"),
        ({}, "weights"),
        ({"S": ([1.0], [1.0, -3.0])}, "weights.S"),
        ({"T": ([1.0], [1.0, 0.0, 4.0])}, "weights.T"),
        ({"T": ([1.0], [1.0, 0.0])}, "weights.T"),
        ({"S": control.tf([1.0], [1.0, -1.1], T)}, "weights.S"),
        ({"S": control.tf([1.0], [1.0, -0.1], 0.02)}, "weights.period"),
        ({"S": WEIGHTS["S"], "T": control.tf([1.0], [1.0, -0.1], 0.02)}, "weights.period"),
        ({"KS": "big"}, "weights.KS"),
    ],
)
def test_weights_without_a_norm_are_refused_by_their_key(weights, key):
    assert refusal(norm, LAB, GAINS, weights=weights).key == key


@pytest.mark.parametrize("text", ["Q = 1.0", "S = 'big'", "x = 1.0", "[weights.KS]\ngain = 1.0\nx = 0.1", "period = 0"])
def test_a_wrong_table_of_weights_is_refused_with_its_file(tmp_path, text):
    path = tmp_path / "law.toml"
    path.write_text(f"[weights]\nT = 1.0\n{text}\n")
    error = refusal(load_weights, path)
    assert error.file == str(path)
    assert error.key.startswith("weights")


def test_a_weight_that_is_no_ratio_is_refused(capsys):
    line = refused(capsys, "norm", "sasaki2012-lab", "--K1", "3", "--weight", "S=a")
    assert "NUM or NUM/DEN" in line
