"""The record to take next: information by closed form, scatter of fits of such records, limits, files, refusals."""

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import image
from scipy.special import chdtr

import tfarm
from tests.exported.compilers import build
from tests.exported.compilers import run as run_program
from tests.fitting.expected import CHAIN, DURATION, FREE, LAB, NOISE, deviations, expected, fitted, simulated
from tests.shared import refusal
from tests.shell import answer, refused, run
from tfarm.arm.chain import Actuator, Chain, Converters
from tfarm.fitting.experiment import excitations
from tfarm.fitting.recording import read_recording
from tfarm.fitting.runs import run_of

STIFF = replace(
    LAB,
    theory="euler-bernoulli",
    link=replace(LAB.link, youngs_modulus=1e6 * LAB.link.youngs_modulus, damping=1e-6),
)


@pytest.fixture(scope="module")
def found():
    return expected()


def test_the_inertia_of_a_rigid_arm_has_the_interval_of_its_closed_form():
    """theta = (1/J) times the double integral of u, less what offset, drift and bias make up: 1, t and t^2.

    Of the double step of +-a within D that is  sigma_J/J = sigma J/(a D^2 sqrt(c n)),  c = 173/3932160.
    """
    T, D, a, sigma = 0.01, 4.0, 2.0, 1e-3
    answers = tfarm.experiment(STIFF, ["hub.inertia"], D, limit=a, outputs=["hub_angle"], noise={"hub_angle": sigma})
    link = STIFF.link
    J = STIFF.hub.inertia + link.density * link.section.area * link.length**3 / 3
    shapes = excitations(STIFF, D, T)
    t = T * np.arange(400)
    assert {row.excitation for row in answers.ranked} == shapes.keys()
    for row in answers.ranked:
        shape = shapes[row.excitation]
        rate = np.r_[0.0, np.cumsum(T * shape)[:-1]]
        theta = np.r_[0.0, np.cumsum(T * rate + T**2 / 2 * shape)[:-1]] * row.peak / abs(shape).max() / J
        seen = theta - np.polynomial.Polynomial.fit(t, theta, 2)(t)
        precision = np.linalg.norm(seen) / sigma * STIFF.hub.inertia / J
        assert row.information == pytest.approx(np.log1p(precision**2), rel=1e-4)
        interval = 1.959964 / precision
        assert row.intervals["hub.inertia"] == (pytest.approx(interval, rel=1e-3) if precision > 1 else None)
    best = max(answers.ranked, key=lambda row: row.information)
    assert answers.ranked[0] == best
    step = next(row for row in answers.ranked if row.excitation == "double step, 1 s each way")
    share = sigma * J / (a * D**2 * np.sqrt(173 / 3932160 * 400))
    assert step.intervals["hub.inertia"] * STIFF.hub.inertia / J == pytest.approx(1.959964 * share, rel=0.01)


@pytest.mark.survey
def test_fits_of_such_records_scatter_as_expected_and_have_its_intervals(found):
    """Few draws: the sum of z^2 of each number within 99.98 % of chi-squared; `tests.fitting.expected` takes more."""
    clean = simulated(found.input)
    rng = np.random.default_rng(5)
    fits = [fitted(found.input, clean, rng) for _ in range(3)]
    off = np.array([deviations(each) for each in fits])
    shares = np.array([*found.ranked[0].intervals.values()]) / 1.959964
    chance = chdtr(len(fits), ((off / shares) ** 2).sum(axis=0))
    assert (abs(chance - 0.5) < 0.4999).all()
    for each, number in zip(fits[0].parameters, found.numbers, strict=True):
        assert each.deviation == pytest.approx(number.deviation, rel=0.01)
        assert number.low < number.value < number.high
    # a record of another excitation has the smaller determinant of information that its row states
    other = next(row for row in found.ranked if row.excitation.startswith("PRBS"))
    shape = excitations(LAB, DURATION, CHAIN.sampling.period)[other.excitation]
    u = other.peak / abs(shape).max() * shape
    measured = [fits[0], fitted(u, simulated(u), rng)]
    dets = [np.linalg.slogdet(each.jacobian.T @ each.jacobian)[1] for each in measured]
    assert dets == pytest.approx([found.ranked[0].information, other.information], abs=0.02)
    assert dets[0] > dets[1]


@pytest.mark.parametrize(
    ("limits", "chain", "name", "most"),
    [
        ({"limit": 0.05}, Chain(), "input", 0.05),
        ({"angle": 0.005}, Chain(actuator=Actuator(torque_limit=2.0)), "hub_angle", 0.005),
        ({"limit": 5.0, "rate": 0.2}, Chain(), "hub_rate", 0.2),
        ({"limit": 5.0}, Chain(converters=Converters(moment_range=0.5)), "root_moment", 0.5),
    ],
)
def test_the_input_is_as_large_as_the_first_limit_allows_and_leaves_a_rigid_arm_where_it_was(limits, chain, name, most):
    """By the simulator; a limit of the chain counts as one that is given."""
    found = tfarm.experiment(LAB, ["hub.inertia"], 2.0, noise=NOISE, chain=chain, **limits)
    clean = simulated(found.input, chain, bias=0.0)
    largest = abs(found.input).max() if name == "input" else abs(clean.signal(name)).max()
    assert largest == pytest.approx(most, rel=1e-5)
    assert found.limits[name] == most
    for name, signal in found.outputs.items():
        exact = clean.signal(name)
        # the simulator has more modes
        assert signal == pytest.approx(exact, abs=1e-5 * abs(exact).max())
    k = np.arange(found.input.size)
    assert abs(found.input.sum()) < 1e-10 * abs(found.input).sum()
    assert abs(k @ found.input) < 1e-10 * (k @ abs(found.input))


def test_the_steps_of_converters_are_noise_where_none_is_given():
    chain = Chain(converters=Converters(encoder_counts=4096, moment_bits=12, moment_range=50.0))
    found = tfarm.experiment(LAB, ["hub.inertia"], 2.0, limit=1.0, chain=chain, noise={"root_moment": 0.3})
    assert found.noise == pytest.approx({"hub_angle": 2 * np.pi / 4096 / 12**0.5, "root_moment": 0.3})
    half = tfarm.experiment(LAB, ["hub.inertia"], 2.0, limit=1.0, chain=chain)
    assert half.noise["root_moment"] == pytest.approx(100.0 / 2**12 / 12**0.5)


def test_what_no_record_determines_is_named_and_does_not_decide():
    """Torque times a factor turns an arm of as many times the mass, stiffness and inertia alike."""
    free = ["link.density", "link.youngs_modulus", "hub.inertia", "drive.gain"]
    found = tfarm.experiment(LAB, free, 3.0, limit=1.0, outputs=["hub_angle"], noise={"hub_angle": 1e-3})
    assert re.search("not determined by these data: .*torque_constant", " ".join(found.not_determined))
    assert {*found.ranked[0].intervals.values()} == {None}
    known = tfarm.experiment(LAB, free[:3], 3.0, limit=1.0, outputs=["hub_angle"], noise={"hub_angle": 1e-3})
    assert known.not_determined == ()
    # with the torque known or not: the other three directions, each a little longer by the fourth
    gaps = {row.excitation: row.information for row in known.ranked}
    assert all(abs(row.information - gaps[row.excitation]) < 3.0 for row in found.ranked)


def test_the_record_is_read_with_measured_columns_and_its_c_is_the_same_to_the_last_bit(tmp_path, capsys):
    csv, c, png = (tmp_path / name for name in ("next.csv", "next.c", "next.png"))
    options = ("--free", "hub.inertia,drive.gain", "--duration", "2", "--torque", "1", "--noise", "hub_angle=1e-3")
    files = ("--csv", str(csv), "--c", str(c), "--png", str(png))
    found = answer(capsys, "experiment", "sasaki2012-lab", *options, "--outputs", "hub_angle", *files)
    lines = csv.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "t [s],hub_torque [N m]"
    measured = [f"{line},0.25" for line in lines[1:]]
    csv.write_text("\n".join([f"{lines[0]},hub_angle [rad]", *measured]), encoding="utf-8")
    record = run_of(read_recording(csv), LAB)
    assert (record.period, record.names) == (pytest.approx(0.01), ("hub_angle",))
    assert record.input.tolist() == found["input"]
    (tmp_path / "main.c").write_text(
        "#include <stdio.h>\ndouble tfarm_excitation(long k);\nint main(void) { long k; double u;\n"
        "for (k = -1; k <= 200; k++) { u = tfarm_excitation(k); fwrite(&u, sizeof u, 1, stdout); }\nreturn 0; }\n",
        encoding="ascii",
    )
    program = build(tmp_path, "gcc", "-O2", sources=("next.c", "main.c"))
    assert np.frombuffer(run_program(program)).tolist() == [0.0, *found["input"], 0.0]
    assert min(image.imread(png).shape[:2]) > 600
    code, out, _ = run(capsys, "experiment", "sasaki2012-lab", *options, "--outputs", "hub_angle")
    best = found["excitations"][0]
    assert code == 0
    assert re.search(rf"^best excitation +{re.escape(best['excitation'])}$", out, re.MULTILINE)
    shares = "% +".join(f"{100 * share:.3g} " for share in best["intervals"].values())
    assert re.search(rf"^{re.escape(best['excitation'])} .* {shares}%$", out, re.MULTILINE)
    assert found["excitations"] == sorted(found["excitations"], key=lambda row: -row["information"])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"--free": "link.mass"}, "free = 'link.mass'"),
        ({"--free": ","}, "name what is free"),
        ({"--free": "hub.inertia,delay"}, "free = 'delay': is of the sensor of a response"),
        ({"--free": "drive.delay,drive.delay"}, "is named twice"),
        ({"--free": "gain:tip_angle"}, "no run has that signal"),
        ({"--duration": "0.1"}, "--duration = 0.1: 0.64 to 1000 s"),
        ({"--duration": "1e9"}, "100000 samples"),
        ({"--limit": "-1"}, "--limit = -1.0: a positive number of N m"),
        ({"--angle": "0"}, "--angle = 0.0"),
        ({"--rate": "-1"}, "--rate = -1.0"),
        ({"--outputs": "hub_angle,hub_rate"}, "noise of hub_rate is missing: give its standard deviation, --noise"),
        ({"--outputs": "root_moment"}, "--noise = 'hub_angle': is not measured"),
        ({"--noise": "hub_angle=0"}, "noise of hub_angle = 0.0"),
        ({"--c": "-"}, "- is standard output"),
    ],
)
def test_what_leaves_no_experiment_is_one_line(changed, message, capsys):
    usual = {"--free": "hub.inertia", "--duration": "2", "--limit": "1", "--noise": "hub_angle=1e-3"}
    words = [word for pair in ({"--outputs": "hub_angle"} | usual | changed).items() for word in pair]
    assert message in refused(capsys, "experiment", "sasaki2012-lab", *words)


def test_a_limit_of_the_input_and_a_free_hub_are_needed():
    assert "--limit is missing: give the largest hub_torque [N m], or [actuator] torque_limit" in str(
        refusal(tfarm.experiment, LAB, FREE, 2.0, noise=NOISE)
    )
    assert "has no loop" in str(refusal(tfarm.experiment, replace(LAB, input="hub_angle"), FREE, 2.0, noise=NOISE))
