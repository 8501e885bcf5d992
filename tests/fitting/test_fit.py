"""Arms fitted to responses of finite elements with noise, and to decays; what the data leave open is reported."""

import math
import tomllib
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tfarm
from tests import chain_elements
from tests.fitting.planted import chi_squared_at, elements_response, judged, judged_pair, judged_rig
from tests.shared import refusal, thinned
from tests.shell import answer, refused, run
from tfarm.fitting import solve
from tfarm.fitting.assumptions import is_named
from tfarm.fitting.data import noise_of
from tfarm.fitting.fit import fit
from tfarm.fitting.intervals import profile_end
from tfarm.fitting.model import RingMode, eigenvalue, mode_of

LAB = tfarm.load("sasaki2012-lab")
OMEGA = np.geomspace(8.0, 1200.0, 160)
PAIRS = (("tip_acceleration", "hub_angle"), ("root_moment", "hub_torque"))


@cache
def without_noise(arm, pairs, omega):
    """Responses of finite elements at a tuple of frequencies: many tests begin with the same."""
    return elements_response(arm, np.array(omega), pairs)


def measured(arm=LAB, pairs=PAIRS, share=0.02, seed=1, omega=OMEGA):
    """Responses of finite elements with noise of known size."""
    rng, found = np.random.default_rng(seed), []
    for (output, under), H in zip(pairs, without_noise(arm, pairs, tuple(omega)), strict=True):
        sigma = share * abs(H) + 1e-3 * np.median(abs(H))
        noise = sigma * (rng.standard_normal(omega.size) + 1j * rng.standard_normal(omega.size))
        found.append(tfarm.Measured(output=output, input=under, omega=omega, values=H + noise, sigma=sigma))
    return found


@pytest.mark.parametrize("seed", thinned([1, 13, 10013], 2))  # the last has sensors of the wrong sign
def test_planted_numbers_are_found_again(seed):
    verdict, _, found = judged(seed, profile=False)
    assert verdict == "right"
    assert found.is_explained
    assert found.chi_squared / found.freedom == pytest.approx(1.0, abs=5 * math.sqrt(2 / found.freedom))


HUB_SPRING = Path("tests/data/reproductions/hub-spring.toml")
HUB_SPRING_FREE = ("link.youngs_modulus", "hub.inertia", "payload.mass")


def hub_spring_sweep():
    """A sweep of 90 lines of an arm of 110 GPa, whose second resonance, 0.2 % damped, lies between two of them."""
    hertz, re, im, sigma = np.loadtxt(HUB_SPRING.with_name("hub-spring-sweep.csv"), delimiter=",", skiprows=1).T
    omega = 2 * math.pi * hertz
    return tfarm.Measured(output="hub_angle", input="hub_torque", omega=omega, values=re + 1j * im, sigma=sigma)


def test_a_resonance_between_two_lines_is_found():
    found = fit(tfarm.load(HUB_SPRING), [hub_spring_sweep()], free=HUB_SPRING_FREE, profile=False)
    assert found.is_explained
    assert abs(found.arm.link.youngs_modulus - 1.1e11) < 4 * found.parameters[0].deviation
    elsewhere = {each.key: each.value for each in found.parameters} | {HUB_SPRING_FREE[0]: 9.09e10}
    assert found.chi_squared < chi_squared_at(found, elsewhere) / 5


def test_a_fit_that_leaves_a_number_open_is_tried_from_its_own_start_too(monkeypatch):
    """Of Poisson's ratio of a slender link nothing is known, and E is a sixth too low in the valley of all starts."""
    rig, both = tfarm.load(HUB_SPRING), (*HUB_SPRING_FREE, "link.poissons_ratio")
    right = fit(rig, [hub_spring_sweep()], free=HUB_SPRING_FREE, profile=False)
    start = {each.key: each.value for each in right.parameters}
    wrong = np.array([math.log(9.09e10 / 1.1e11), 0, 0, 0])
    monkeypatch.setattr("tfarm.fitting.solve.start_by", lambda problem, draws, shares: (problem, wrong))
    found = fit(rig, [hub_spring_sweep()], free=both, start=start, profile=False)
    assert found.starts == 4
    assert found.chi_squared == pytest.approx(right.chi_squared, rel=1e-6)


RIGS = [10001, 10006, 10021, 10028, 10081, 10085]  # sharp resonances between lines, and numbers hardly known


@pytest.mark.parametrize("seed", [*thinned(RIGS, 2), pytest.param(80004, marks=pytest.mark.survey)])
def test_no_fit_of_a_rig_ends_above_the_true_numbers(seed):
    assert judged_rig(seed)[0] == "right"


def test_profiles_are_where_the_sum_of_squares_has_grown_by_the_quantile():
    found = fit(LAB, measured(), free=["link.youngs_modulus", "hub.inertia"])
    own, best = found.problem, found.point
    for n, each in enumerate(found.parameters):
        for end in (each.low, each.high):
            held = own.parameters[n].coordinate(end)
            reach = found.parameters[1 - n].deviation / own.parameters[1 - n].start
            grid = best[1 - n] + np.linspace(-1, 1, 21) * reach
            points = [np.array([held, other] if n == 0 else [other, held]) for other in grid]
            sums = [float(r @ r) for r in map(own.residuals, points)]
            assert min(sums) - found.chi_squared == pytest.approx(1.959964**2, rel=0.05)
        assert each.low < each.value < each.high
        assert (each.high - each.low) / (2 * 1.96 * each.deviation) == pytest.approx(1, abs=0.05)  # nearly Gaussian


@pytest.mark.parametrize("waves", [(1.0, 4.0), (1.5, 3.0), (0.9, 7.0), (1.2, 11.0)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_profile_that_is_not_monotonic_ends_at_its_level_on_its_side(waves, side):
    """The one residual x + a sin(b x) has its level at several x."""
    size, speed = waves
    problem = SimpleNamespace(
        runs=(),
        bounds=(np.array([-9.0]), np.array([9.0])),
        residuals=lambda x: x + size * np.sin(speed * x),
    )
    slope = np.array([[1 + size * speed]])
    found = SimpleNamespace(problem=problem, point=np.zeros(1), jacobian=slope, chi_squared=0.0)
    end = profile_end(found, 0, side * 1.96 / slope.item(), 1.96, {})
    assert end * side > 0
    assert abs(problem.residuals(end)) == pytest.approx(1.96, abs=0.02)


@pytest.mark.parametrize("seed", thinned([0, 1], 2))  # E and the density; E and I
def test_planted_pairs_are_known_by_one_combination(seed):
    assert judged_pair(seed)[0] == "right"


def test_what_does_not_matter_is_bounded_on_one_side():
    """The lab arm carries nothing: how heavy the payload is at most is known all the same."""
    found = fit(LAB, measured(), free=["payload.mass", "hub.inertia"])
    mass = found.parameters[0]
    assert mass.low == 0.0
    assert 1e-6 < mass.high < 1e-3 * LAB.own_mass
    assert mass.deviation is None


@pytest.mark.parametrize("profile", [False, True])
def test_a_number_bounded_on_one_side_is_free_in_the_intervals_of_others(profile):
    """The least sum over the masses has grown by the quantile squared where the inertia's interval ends."""
    responses = [replace(each, omega=each.omega, sigma=20 * each.sigma) for each in measured()]
    found = fit(LAB, responses, free=["payload.mass", "hub.inertia"], profile=profile)
    mass, inertia = found.parameters
    assert mass.deviation is None
    assert mass.low == 0.0
    assert math.sqrt(found.posterior.matrix[1, 1]) == pytest.approx(inertia.deviation / inertia.value, rel=1e-3)
    masses = mass.high * np.r_[1e-3, np.linspace(0.04, 2.0, 50)]
    for end in (inertia.low, inertia.high):
        growth = min(chi_squared_at(found, {mass.key: each, inertia.key: end}) for each in masses)
        growth -= found.chi_squared
        # the covariance has no bound at a mass of 0
        assert growth > 1.96**2 * 0.95
        assert not profile or growth == pytest.approx(1.96**2, rel=0.05)


def test_decays_alone():
    """Two frequencies and one ratio, of finite elements, for two numbers."""
    s = chain_elements.eigenvalues(LAB, 400.0)
    ringing = sorted(s[s.imag > 1.0].tolist(), key=lambda p: p.imag)
    rings = [
        RingMode(number, p.imag, 1e-6 * p.imag, -p.real / abs(p), 1e-6) for number, p in enumerate(ringing[:2], start=1)
    ]
    start = {"link.youngs_modulus": 5e10, "link.damping": 3e-4}
    found = fit(LAB, [], free=list(start), start=start, rings=rings, profile=False)
    assert found.arm.link.youngs_modulus == pytest.approx(LAB.link.youngs_modulus, rel=1e-5)
    assert found.arm.link.damping == pytest.approx(LAB.link.damping, rel=1e-3)
    assert found.rms_log_error is None


def test_a_decay_is_of_a_mode_that_rings():
    """Its eigenvalue is that followed from the undamped mode; overdamped there is none."""
    followed = tfarm.damped_modes(tfarm.modes(LAB, 2)).eigenvalues[-1, 0]
    assert eigenvalue(LAB, 2) == pytest.approx(followed, rel=1e-12)
    assert "does not ring" in str(refusal(eigenvalue, LAB.with_numbers(damping=1.0), 1, kind=tfarm.ConvergenceError))


def test_noise_by_its_coherence_and_by_its_scatter():
    """Coherence of n averages: sqrt((1 - g)/(2 n g)) of each part; with neither known, the values' own scatter."""
    rng, sigma = np.random.default_rng(3), 0.03
    H = 1 / (1 + 1j * OMEGA / 100)
    values = H + sigma * abs(H) * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))
    one = {"output": "hub_rate", "input": "hub_torque", "omega": OMEGA, "values": values}
    found = noise_of(tfarm.Measured(**one))
    assert not found.is_known
    assert np.median(found.sigma / abs(H)) == pytest.approx(sigma, rel=0.25)
    coherence = np.full(OMEGA.size, 1 / (1 + 2 * 10 * sigma**2))
    known = noise_of(tfarm.Measured(**one, coherence=coherence, averages=10))
    assert known.is_known
    assert known.sigma == pytest.approx(sigma * abs(values), rel=1e-12)


def test_a_value_of_0_with_a_coherence_has_no_weight():
    """A line that was lost on the way, 0 with the coherence of its neighbours: the fit is that without it."""
    omega = OMEGA[::4]
    values = tfarm.transfer(LAB.with_numbers(hub_inertia=1.1 * LAB.hub_inertia), "root_moment")(1j * omega)
    lost = np.arange(omega.size) == 12
    found = []
    for w, H in ((omega, np.where(lost, 0.0, values)), (omega[~lost], values[~lost])):
        known = {"coherence": np.full(w.size, 0.99), "averages": 10}
        data = tfarm.Measured(output="root_moment", input="hub_torque", omega=w, values=H, **known)
        one = fit(LAB, data, ["hub.inertia"], profile=False)
        (number,) = one.parameters
        found.append((one.freedom, number.deviation))
        assert number.value == pytest.approx(1.1 * LAB.hub_inertia, rel=1e-6)
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_unknown_noise_comes_from_the_residuals():
    data = [replace(each, sigma=None) for each in measured(pairs=PAIRS[:1])]
    start = {"link.youngs_modulus": 6e10}
    found = fit(LAB, data, free=[*start, "link.damping"], start=start, profile=False)
    assert found.is_explained is None
    assert found.chi_squared / found.freedom == pytest.approx(1.0, rel=0.02)
    assert abs(found.arm.link.youngs_modulus / LAB.link.youngs_modulus - 1) < 2e-3


def test_a_wrong_arm_is_rejected():
    """The data are those of an arm with a clamp that yields; with a rigid one the fit is rejected."""
    soft = tfarm.Arm(link=LAB.link, hub=LAB.hub, clamp=tfarm.RotarySpring(stiffness=300.0), name="soft")
    found = fit(LAB, measured(soft, PAIRS[:1], omega=OMEGA[::3]), free=["link.youngs_modulus"], profile=False)
    assert found.is_explained is False
    assert "does not explain" in found.verdict


def test_resonances_before_and_after_are_the_arms_own():
    """Over torque they are natural frequencies, over the hub's angle those of a locked hub."""
    start = {"link.youngs_modulus": 6e10}
    found = fit(LAB, measured(), free=["link.youngs_modulus"], start=start, profile=False)
    free = tfarm.modes(found.arm, 6).natural_frequency[1:] / 2 / math.pi
    locked = tfarm.modes(found.arm.with_numbers(hub_inertia=math.inf), 6).natural_frequency / 2 / math.pi
    for before, after, peak in found.resonances:
        own = min([*free, *locked], key=lambda f: abs(f - after))
        assert after == pytest.approx(own, rel=2e-3)  # w of an eigenvalue, damped
        stiffer = math.sqrt(6e10 / found.arm.link.youngs_modulus)
        assert before / after == pytest.approx(stiffer, rel=4e-3)  # ratio^2/2 = 1.4e-3 each
        assert peak == pytest.approx(after, rel=0.05)  # on a grid of 3 %


def test_the_command_and_its_file(tmp_path, capsys):
    path = tmp_path / "sweep.csv"
    (one,) = measured(pairs=PAIRS[:1], omega=OMEGA[::2])
    rows = (f"{w / 2 / math.pi!r},{v.real!r},{v.imag!r},{d!r}" for w, v, d in
            zip(one.omega.tolist(), one.values.tolist(), one.sigma.tolist(), strict=True))  # fmt: skip
    path.write_text("\n".join(["hz,re,im,sigma", *rows]))
    save, png = tmp_path / "fitted.toml", tmp_path / "fit.png"
    given = ("fit", "sasaki2012-lab", "--data", f"tip_acceleration/hub_angle={path}")
    code, out, err = run(
        capsys, *given, "--free", "link.youngs_modulus,gain", "--start", "link.youngs_modulus=6e10",
        "--save", str(save), "--png", str(png), "--covariance",
    )  # fmt: skip
    assert (code, err) == (0, f"written: {save}\nwritten: {png}\n")
    assert "2 of 2 numbers identified" in out
    assert png.read_bytes().startswith(b"\x89PNG")
    fitted = tfarm.load(save)
    assert one.digest == ""
    assert fitted.assumptions[0].startswith("Before the fit of Young's modulus E: E, G, A, L, kappa")
    assert fitted.assumptions[1:6] == LAB.assumptions[1:]
    assert fitted.assumptions[6].startswith("Fitted: Young's modulus E = 6.89")
    assert fitted.assumptions[7].startswith("Fitted to tip acceleration over hub angle of sweep.csv, SHA-256")
    assert tomllib.loads(save.read_text())["link"]["youngs_modulus"] == fitted.link.youngs_modulus
    found = answer(capsys, *given, "--free", "link.youngs_modulus", "--covariance")
    (number,) = found["parameters"]
    assert number.keys() >= {"key", "value", "low", "high", "std", "identified"}
    assert all(set(row) == {"before_hz", "after_hz", "measured_hz"} for row in found["resonances"])
    assert found["converged"]
    assert found["rms_log_error"] < 0.1
    assert found["arm"]["link"]["youngs_modulus"] == number["value"]


def test_sensors_alone_may_be_fitted():
    *before, words, _, _ = fit(LAB, measured(), free=["gain"], profile=False).arm.assumptions
    assert words.startswith("Fitted: sensors alone, from the arm sasaki2012-lab")
    assert tuple(before) == LAB.assumptions


@pytest.mark.parametrize(
    ("key", "value", "text", "is_it"),
    [
        ("hub.inertia", 0.1, "Hub inertia I_h = 0.1 kg m^2: our choice.", True),
        ("hub.inertia", 0.1, "An area of 6e-4 m^2, 0.1 m wide.", False),
        ("payload.mass", 2.0, "Width 0.2 m, depth 0.1 m and no more.", False),  # metres
        ("payload.mass", 2.0, "E, G, A, L, kappa, m and I_c as in Table 1.", True),
        ("payload.mass", 2.0, "The carried body has 2.0 kg.", True),
        ("payload.mass", 2.0, "The carried body has 2.0 kg m^2.", False),
        ("link.youngs_modulus", 7e10, "It enters as E (1 + C s).", False),
        ("link.youngs_modulus", 7e10, "Mass and E of the link as stated.", True),
    ],
)
def test_an_assumption_names_a_number_by_label_symbol_or_value(key, value, text, is_it):
    assert is_named(key, value, text) == is_it


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--free", "link.young", "--mode", "1=11hz"], 'did you mean "link.youngs_modulus"'),
        (["--free", "hub.inertia"], "at least one measured response"),
        (["--mode", "1=11hz"], "name what is free"),
        (["--free", "hub.inertia,payload.mass", "--mode", "1=11hz"], "1 numbers were measured"),
        (["--free", "hub.inertia", "--mode", "1=11"], "--mode = '1=11'"),
        (["--free", "hub.inertia", "--mode", "0=11hz"], "--mode = '0=11hz'"),
        (["--free", "hub.inertia", "--mode", "1=11hz,1.5"], "--mode = '1=11hz,1.5'"),
        (["--free", "hub.inertia", "--start", "hub.inertia=x", "--mode", "1=11hz"], "write KEY=NUMBER"),
        (["--free", "hub.inertia", "--bounds", "hub.inertia=1,2", "--mode", "1=11hz"], "starts at 0.1"),
        (["--free", "hub.inertia", "--prior", "hub.radius=1,2", "--mode", "1=11hz"], "is not free"),
        (["--free", "hub.inertia,hub.inertia", "--mode", "1=11hz"], "is named twice"),
    ],
)
def test_bad_input_is_one_line(arguments, words, capsys):
    assert words in refused(capsys, "fit", "sasaki2012-lab", *arguments)


def test_a_step_to_no_arm_is_a_wall():
    """An attachment near the tip that would pass it where the link grows shorter: the search ends at an arm."""
    rig = tfarm.load("tests/rigs/bench-rig.toml")
    omega = np.geomspace(20, 600, 20)
    H = tfarm.transfer(rig, "tip_acceleration")(1j * omega)
    data = tfarm.Measured(output="tip_acceleration", input="hub_torque", omega=omega, values=H, sigma=0.01 * abs(H))
    far, near = (
        fit(rig, data, free=["attachment.1.x", "link.2.length"], start={"attachment.1.x": x}, profile=False).arm
        for x in (0.44, 0.36)
    )
    assert far.attachments[0].x <= far.length * (1 + 1e-9)
    assert near.attachments[0].x == pytest.approx(0.3, abs=1e-4)
    assert near.links[1].length == pytest.approx(0.39, abs=1e-5)


def test_a_profile_that_finds_a_better_valley_moves_there():
    """From noise three times the signal: the interval holds the value, whatever valley the search began in."""
    omega = np.geomspace(5, 800, 60)
    rng = np.random.default_rng(0)
    H = tfarm.transfer(LAB, "root_moment")(1j * omega)
    values = H * (1 + 3 * (rng.standard_normal(60) + 1j * rng.standard_normal(60)))
    data = tfarm.Measured(output="root_moment", input="hub_torque", omega=omega, values=values)
    found = fit(LAB, data, free=["link.youngs_modulus", "hub.inertia"])
    for each in found.parameters:
        assert each.low is None or each.low <= each.value
        assert each.high is None or each.value <= each.high


def test_the_form_of_a_decay():
    assert mode_of("2=2.5hz~0.01,0.006~0.001") == pytest.approx((2, 5 * math.pi, 0.02 * math.pi, 0.006, 0.001))
    assert mode_of("1=100rad_s").ratio is None


def test_a_search_out_of_evaluations_goes_on_once(monkeypatch):
    """From 6 % below Young's modulus nine evaluations lead to the minimum."""
    monkeypatch.setattr(solve, "nearest_minimum", partial(solve.nearest_minimum, evaluations=7))
    monkeypatch.setattr("tfarm.fitting.solve.start_by", lambda problem, draws, shares: (problem, np.array([-0.06])))
    found = fit(LAB, measured(omega=OMEGA[::4]), free=["link.youngs_modulus"], profile=False)
    assert found.converged


@pytest.mark.parametrize("profile", [False, True])
def test_a_number_that_may_be_infinite_is_free_in_the_intervals_of_others(profile):
    """A clamp that is all but rigid: its compliance and that of the link are told apart by higher modes alone."""
    clamped = replace(LAB, clamp=tfarm.RotarySpring(stiffness=1e7))
    responses = [replace(each, sigma=20 * each.sigma) for each in measured()]
    found = fit(clamped, responses, free=["clamp.stiffness", "link.youngs_modulus"], profile=profile)
    stiffness, modulus = found.parameters
    assert stiffness.high is None
    assert 100 < stiffness.low < 1e6
    stiffnesses = stiffness.low * np.geomspace(0.3, 1e3, 60)
    for end in (modulus.low, modulus.high):
        growth = min(chi_squared_at(found, {stiffness.key: each, modulus.key: end}) for each in stiffnesses)
        growth -= found.chi_squared
        # the covariance has no bound at a stiffness without end
        assert growth > 1.96**2 * 0.95
        assert not profile or growth == pytest.approx(1.96**2, rel=0.05)
