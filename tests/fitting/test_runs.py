"""Fits of an arm to runs: the model of a run against the simulator, and planted numbers found again."""

import math
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from scipy import signal
from scipy.stats import binom

import tfarm
from tests.shared import refusal
from tests.shell import answer, refused
from tfarm.arm import AT_HUB, Law
from tfarm.arm.chain import Actuator, Chain, Converters, Sampling, load_chain
from tfarm.arm.law_tables import load_law
from tfarm.arm.writing import to_toml
from tfarm.case import Case
from tfarm.dsp.discretise import acting_law
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.sensed import sensed_plant
from tfarm.dsp.simulate import LinearLoop, Simulator, references_of
from tfarm.fitting.fit import fit
from tfarm.fitting.model import Problem, free_parameters
from tfarm.fitting.posterior import load_posterior
from tfarm.fitting.run_model import fit_run
from tfarm.fitting.run_numbers import with_run_numbers
from tfarm.fitting.runs import RigRun
from tfarm.fitting.whiteness import chance_of_independent, chance_of_lags, chance_of_white
from tfarm.plots.frequency import fit_runs
from tfarm.report.page import ArmReport
from tfarm.report.response_sections import fit_section
from tfarm.schema import to_dict

LAB = tfarm.load("sasaki2012-lab")
QUANSER = Path(__file__).parent.parent / "data" / "quanser-2dsfl"
T = 0.01
MODES = 8
SERVO = tfarm.HubFeedback(Kp=2.0, K1=0.7, K2=0.1)
LOOSE = tfarm.HubFeedback()
SIGMA = {"hub_angle": 2e-3, "hub_rate": 0.02, "root_moment": 0.02}


def chain_of(delay=0.7, **sampling):
    return Chain(sampling=Sampling(period=T, delay_samples=delay, **sampling))


def command(n, seed=0, hold=8, size=0.5):
    """A torque of either sign, that may change every few samples."""
    rng = np.random.default_rng(seed)
    return size * np.repeat(rng.choice([-1.0, 1.0], n // hold + 1), hold)[:n]


def task_of(feedforward, reference, bias=0.0):
    zero = np.zeros(feedforward.size)
    return Scenario("planted", T, feedforward, reference, zero, zero, zero + bias)


def simulated(arm, law, chain, task, **how):
    return Simulator(Case(arm, law, chain), task, **{"count": MODES, **how}).run()


def with_noise(signals, seed, sigma=SIGMA):
    rng = np.random.default_rng(seed)
    return {name: values + sigma[name] * rng.standard_normal(values.size) for name, values in signals.items()}


def signals_of(run, names=("hub_angle", "root_moment")):
    return {name: run.measured[:, AT_HUB.index(name)] for name in names}


def open_run(arm=LAB, chain=None, n=500, bias=0.02, seed=1, times=1.0, **own):
    """A record in open loop, its command a torque over `times`."""
    u = command(n)
    found = simulated(arm, LOOSE, chain or chain_of(), task_of(u, 0 * u, bias))
    return RigRun(period=T, input=u / times, outputs=with_noise(signals_of(found), seed), **own)


SPRUNG = replace(LAB, hub=replace(LAB.hub, stiffness=3.0, friction=0.05))
# of the arm as a rigid one: I_h + rho A L^3/3 + rho I L
J = LAB.hub.inertia + LAB.link.rhoA * LAB.length**3 / 3 + LAB.link.rhoI * LAB.length
CURRENT = replace(
    LAB,
    motor=tfarm.Motor(resistance=1.0, torque_constant=0.3, back_emf_constant=0.3, gear_ratio=5.0),
    input="motor_current",
)


@pytest.mark.parametrize("arm", [LAB, SPRUNG, CURRENT], ids=["turning", "sprung", "current"])
@pytest.mark.parametrize("delay", [0.0, 0.7, 2.0, 1.4])
@pytest.mark.parametrize("corner", [math.inf, 60.0])
def test_the_response_to_a_held_input_is_that_of_the_simulator(arm, delay, corner):
    chain = chain_of(delay, antialias_corner=corner)
    u = command(300)
    found = PulseTransfer(sensed_plant(arm, chain, AT_HUB, MODES).together, chain.sampling).held_response(u)
    right = simulated(arm, LOOSE, chain, task_of(u, 0 * u)).measured.T
    assert abs(found - right).max(axis=1) == pytest.approx(0, abs=1e-11 * abs(right).max())


@pytest.mark.parametrize("delay", [0.0, 0.7, 1.3])
def test_a_rigid_arm_turns_by_the_square_of_the_time(delay):
    """theta = u (t - tau)^2/(2 J)."""
    rigid = replace(LAB, link=replace(LAB.link, youngs_modulus=1e22, shear_modulus=1e22))
    chain = chain_of(delay)
    plant = sensed_plant(rigid, chain, ("hub_angle",), 2).together
    found = PulseTransfer(plant, chain.sampling).held_response(np.full(200, 0.3))
    since = np.maximum(T * np.arange(200) - delay * T, 0.0)
    np.testing.assert_allclose(found[0], 0.3 * since**2 / (2 * J), rtol=1e-9, atol=1e-12)


DIFFERENCE = Converters(hub_rate="difference", rate_filter=80.0)


@pytest.mark.parametrize("arm", [LAB, SPRUNG], ids=["turning", "sprung"])
@pytest.mark.parametrize("converters", [Converters(), DIFFERENCE], ids=["tachometer", "difference"])
def test_the_input_of_a_linear_loop_is_that_of_the_simulator(arm, converters):
    chain = replace(chain_of(1.3, antialias_corner=90.0), converters=converters)
    task = task_of(np.zeros(400), np.cumsum(command(400)) * T, bias=0.02)
    case = Case(arm, SERVO, chain)
    law, late = acting_law(case)
    loop = LinearLoop(sensed_plant(arm, chain, (*AT_HUB, *law.signals), MODES).together, law, late)
    found = loop.input(references_of(law, task), task.disturbance)
    right = simulated(arm, SERVO, chain, task).torque
    np.testing.assert_allclose(found, right, rtol=0, atol=1e-11 * abs(right).max())


def test_a_controller_alone_answers_errors_as_its_difference_equation():
    law = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "root_moment": ([0.5], [0.02, 1.0])})
    case = Case(LAB, law, chain_of())
    acting, late = acting_law(case)
    loop = LinearLoop(sensed_plant(LAB, late, AT_HUB, 2).together, acting, late)
    errors = np.random.default_rng(3).standard_normal((50, len(loop.columns)))
    A, B, C, D = acting.matrices(loop.columns)
    right = signal.dlsim((A, B, C, D, 1.0), errors)[1].ravel()
    np.testing.assert_allclose(loop.input_alone(errors), right, rtol=1e-10, atol=1e-12)


def test_a_release_is_made_of_the_free_responses_of_its_mode():
    chain = chain_of()
    plant = sensed_plant(LAB, chain, AT_HUB, MODES).together
    first = int(np.flatnonzero((plant.mode == 1) & (plant.poles.imag > 0))[0])
    zero = np.zeros(300)
    released = replace(task_of(zero, zero), tip_offset=0.01)
    right = simulated(LAB, LOOSE, chain, released).measured.T
    parts = PulseTransfer(plant, chain.sampling).free_responses(first, 300).reshape(2, -1)
    amplitudes, *_ = np.linalg.lstsq(parts.T, right.ravel())
    np.testing.assert_allclose(amplitudes @ parts, right.ravel(), rtol=0, atol=1e-11 * abs(right).max())


# ------------------------------------------------------------ numbers of a run alone


def own_numbers(run, chain, arm=LAB):
    model = fit_run(arm, run, chain)
    found, deviations = model.own_numbers(arm, lambda place: math.nan)
    return dict(zip(model.own_names(arm), zip(found, deviations, strict=True), strict=True))


def test_bias_offsets_and_drift_are_found_again():
    run = open_run(bias=0.02, sigma={"hub_angle": 2e-3, "root_moment": 0.02})
    outputs = {
        "hub_angle": run.outputs["hub_angle"] + 0.3 - 0.05 * run.t,
        "root_moment": run.outputs["root_moment"] - 0.7,
    }
    found = own_numbers(replace(run, outputs=outputs), chain_of())
    planted = {"drive.bias": 0.02, "offset of hub_angle": 0.3, "offset of root_moment": -0.7}
    for name, value in (planted | {"angular momentum at the start": -0.05 * J}).items():
        assert abs(found[name][0] - value) < 4 * found[name][1] < abs(value)


def test_under_a_controller_bias_and_offset_are_found_again():
    """The controller reads the moment with its offset."""
    reference = np.cumsum(command(800)) * T
    planted = {"drive.bias": 0.02, "offset of hub_angle": 0.0, "offset of root_moment": 0.5}

    def controller(m):
        hub = SERVO.Kp * (m.angle_reference - m.hub_angle) - SERVO.K1 * m.hub_rate
        return hub - SERVO.K2 * (m.vibration + planted["offset of root_moment"])

    case = Case(LAB, SERVO, chain_of())
    task = task_of(0 * reference, reference, planted["drive.bias"])
    outputs = with_noise(signals_of(Simulator(case, task, count=MODES).controller(controller)), 4)
    outputs["root_moment"] += planted["offset of root_moment"]
    sigma = {name: SIGMA[name] for name in outputs}
    run = RigRun(period=T, outputs=outputs, references={"hub_angle": reference}, law=SERVO, sigma=sigma)
    own = own_numbers(run, chain_of())
    for name, value in planted.items():
        assert abs(own[name][0] - value) < 4 * own[name][1] < max(value, 0.01)


def test_a_record_may_begin_while_the_arm_moves():
    """What is left of the second half of a simulation without noise are modes beyond half of the sampling rate."""
    u = command(1000)
    sim = simulated(LAB, LOOSE, chain_of(0.0), task_of(u, 0 * u))
    outputs = {name: values[500:] for name, values in signals_of(sim).items()}
    run = RigRun(
        period=T, input=u[500:], outputs=outputs, sigma={name: float(np.std(x)) for name, x in outputs.items()}
    )
    model = fit_run(LAB, run, chain_of(0.0))
    assert model.is_moving
    left = abs(model.residuals(LAB, lambda place: math.nan).reshape(2, -1))
    assert left.max() < 0.02
    assert left[:, 50:].max() < 1e-3
    at_rest = replace(model, is_moving=False)
    assert abs(at_rest.residuals(LAB, lambda place: math.nan)).max() > 0.5


def test_a_record_may_be_finer_than_its_controller():
    reference = np.cumsum(command(300)) * T
    run = simulated(LAB, SERVO, chain_of(), task_of(0 * reference, reference), between=3)
    outputs = {}
    for name in ("hub_angle", "root_moment"):
        fine = run.between.signal(name).reshape(-1, 3)
        outputs[name] = np.c_[run.at_samples.signal(name), fine].ravel()
    record = RigRun(period=T / 4, outputs=outputs, references={"hub_angle": np.repeat(reference, 4)}, law=SERVO)
    model = replace(fit_run(LAB, record, chain_of()), count=MODES)
    found = model.respond(LAB, lambda place: math.nan).outputs
    for each, right in zip(found, outputs.values(), strict=True):
        np.testing.assert_allclose(each, right, rtol=0, atol=1e-10 * abs(right).max())
    odd = replace(record, period=T / 2.5)
    assert "over a whole number" in str(refusal(fit_run, LAB, odd, chain_of()))


# ------------------------------------------------------------ whiteness


def test_white_noise_is_rejected_as_seldom_as_its_chance_says():
    rng = np.random.default_rng(7)
    chances = np.array([chance_of_white(row) for row in rng.standard_normal((2000, 150))])
    for level in (0.01, 0.1):
        below = int((chances < level).sum())
        assert below <= binom.isf(1e-4, chances.size, level)
        # twice the lesser of two is no far bound
        assert below >= chances.size * level / 4


RING = np.sin(1.3 * np.arange(600))


@pytest.mark.parametrize("more", [0.4 * RING, 4.0 * RING * np.exp(-np.arange(600) / 40), np.cumsum(np.full(600, 2e-3))])
def test_a_ring_or_a_drift_is_not_white(more):
    noise = np.random.default_rng(8).standard_normal(600)
    assert chance_of_white(noise) > 0.01
    assert chance_of_white(noise + more) < 1e-3


def test_a_wide_band_is_not_white():
    """A third of the spectrum, an eighth larger: its first correlations are those of noise, no line is large."""
    spectrum = np.fft.rfft(np.random.default_rng(2).standard_normal(4000))
    spectrum[:700] *= 1.12
    e = np.fft.irfft(spectrum)
    assert chance_of_lags(e) > 0.01
    assert chance_of_white(e) < 0.005


def test_white_residuals_depend_on_the_input_as_seldom_as_their_chance_says():
    rng = np.random.default_rng(6)
    u = rng.choice([-1.0, 1.0], 60).repeat(10)
    chances = np.array([chance_of_independent(e, u[None]) for e in rng.standard_normal((600, u.size))])
    below = int((chances < 0.05).sum())
    assert binom.isf(1 - 1e-4, chances.size, 0.05) <= below <= binom.isf(1e-4, chances.size, 0.05)
    # a late response to the input, a fiftieth of the variance
    more = np.r_[np.zeros(12), 0.15 * np.sin(0.4 * np.arange(25)) * 0.9 ** np.arange(25)]
    assert chance_of_independent(rng.standard_normal(u.size) + np.convolve(u, more)[: u.size], u[None]) < 1e-3


def test_an_observer_had_come_to_rest_where_its_run_begins():
    """By another angle of hub and reference, which turn freely, nothing changes: the state of a law of them neither."""
    rig, law = tfarm.load(str(QUANSER / "rig.toml")), load_law(QUANSER / "lqg.toml")
    t = 0.01 * np.arange(300)
    reference = 0.3 * np.minimum(t, 1.0)
    runs = []
    for start in (0.0, -0.2):
        outputs = {"hub_angle": 0.9 * reference + start, "root_moment": np.sin(t)}
        runs.append(
            RigRun(period=0.01, outputs=outputs, references={"hub_angle": reference + start}, law=law, initial="rest")
        )
    damped = replace(rig, link=replace(rig.link, damping=1e-3))
    found = [fit_run(damped, run, Chain()).residuals(damped, lambda _: math.nan) for run in runs]
    np.testing.assert_allclose(*found, rtol=0, atol=1e-9 * abs(found[0]).max())


@pytest.mark.parametrize("law", [None, SERVO])
def test_the_motion_at_the_start_is_free_unless_a_run_rests(law):
    """The first mode released, by the simulator: nothing is left of it, and much where the arm should rest."""
    task = replace(task_of(np.zeros(300), np.zeros(300)), tip_offset=0.01)
    outputs = signals_of(simulated(LAB, law or LOOSE, chain_of(), task))
    of_loop = {"references": {"hub_angle": np.zeros(300)}, "law": law} if law else {"input": np.zeros(300)}
    left = {}
    for initial in ("free", "rest"):
        run = RigRun(period=T, outputs=outputs, initial=initial, **of_loop)
        own = replace(fit_run(LAB, run, chain_of()), count=MODES)
        left[initial] = abs(own.residuals(LAB, lambda _: math.nan)).max()
    assert left["free"] < 1e-6 * left["rest"]


# ------------------------------------------------------------ fits

FREE = ("link.youngs_modulus", "hub.inertia", "drive.delay", "gain:root_moment")


def problem_of(run, free=FREE, arm=LAB):
    keys = [key for key in free if key in ("link.youngs_modulus", "hub.inertia")]
    family, numbers = free_parameters(arm, keys, start={}, bounds={}, priors={})
    whole = Problem(family, numbers, (), (), (fit_run(arm, run, chain_of()),))
    return with_run_numbers(whole, free, {}, {}, {})


def closed_run(inside, n=600, seed=5):
    """A record under the servo, whose noise is of the sensors that it reads, or of the recorder alone."""
    reference = np.cumsum(command(n)) * T
    rng = np.random.default_rng(seed)
    noise = {name: SIGMA[name] * rng.standard_normal(n) for name in AT_HUB}
    heard = {name: inside * values for name, values in noise.items()}

    def controller(m):
        angle, rate, moment = (heard[name][m.k] for name in AT_HUB)
        hub = SERVO.Kp * (m.angle_reference - m.hub_angle - angle) - SERVO.K1 * (m.hub_rate + rate)
        return hub - SERVO.K2 * (m.vibration + moment)

    task = task_of(0 * reference, reference, bias=0.02)
    sim = Simulator(Case(LAB, SERVO, chain_of()), task, count=MODES).controller(controller)
    outputs = {name: values + noise[name] for name, values in signals_of(sim, AT_HUB).items()}
    return RigRun(period=T, outputs=outputs, references={"hub_angle": reference}, law=SERVO, initial="rest")


@pytest.mark.parametrize("inside", [False, True])
def test_the_jacobian_is_that_of_another_difference(inside):
    """But for what the run's own numbers can add, which a step of the search has no part of (Kaufman 1975)."""
    problem = problem_of(closed_run(inside, n=200))
    problem = replace(problem, runs=tuple(replace(each, through_loop=inside) for each in problem.runs))
    point = np.array([0.05, -0.1, 0.02, 0.1])
    found = problem.jacobian(point)
    # what the own numbers can add has no part in it, nor in the residuals
    (one,) = problem.runs
    basis = one.projection(problem.arm(point), partial(problem.value, point)).basis
    for n, step in enumerate(5e-4 * np.eye(4)):
        # of fourth order, with other steps
        near, far = (problem.residuals(point + k * step) - problem.residuals(point - k * step) for k in (1, 2))
        right = (8 * near - far) / (12 * step[n])
        right = right - basis @ (basis.T @ right)
        np.testing.assert_allclose(found[:, n], right, rtol=0, atol=1e-6 * abs(right).max())


PLANTED = {"link.youngs_modulus": LAB.link.youngs_modulus, "hub.inertia": LAB.hub.inertia, "drive.delay": 0.7 * T}
START = replace(
    LAB,
    link=replace(LAB.link, youngs_modulus=1.2 * LAB.link.youngs_modulus),
    hub=replace(LAB.hub, inertia=0.8 * LAB.hub.inertia),
)


def assert_found(found, planted):
    for each in found.parameters:
        assert abs(each.value - planted[each.key]) < 3.5 * each.deviation, each.key


def test_gain_and_dead_time_of_the_drive_are_found_in_open_loop():
    found = fit_of_open_run()
    assert_found(found, PLANTED | {"motor.torque_constant": 0.25})
    assert found.verdict == "fitted"
    assert not found.problem.runs[0].through_loop
    assert found.arm.motor.torque_constant == found.parameters[2].value


@pytest.mark.parametrize("inside", [False, True])
def test_noise_of_sensors_that_the_controller_reads_is_known_by_its_residuals(inside):
    found = fit(START, [], [*PLANTED], runs=[closed_run(inside)], chain=chain_of(0.0), profile=False)
    (run,) = found.problem.runs
    assert run.through_loop == inside
    assert_found(found, PLANTED)
    assert found.chance_of_white > 0.01
    (curves,) = found.run_curves
    # of the output: what the noise does to the arm is in it
    assert (np.std(curves.computed - curves.measured, axis=1)[2] > 1.3 * SIGMA["root_moment"]) == inside
    for name, sigma in zip(run.run.names, run.sigma, strict=True):
        assert sigma == pytest.approx(SIGMA[name], rel=5 / math.sqrt(2 * run.run.count))


# ------------------------------------------------------------ results, files and the command


@cache
def fit_of_open_run():
    """A fit whose model of the drive, and so whose arm, has the gain of 0.25 N m over the command."""
    run = open_run(times=0.25)
    return fit(START, [], [*PLANTED, "drive.gain"], runs=[run], chain=chain_of(0.0), profile=False)


def test_the_results_of_a_run_are_its_noise_and_its_own_numbers():
    found = fit_of_open_run()
    for row in found.run_signals:
        assert row.noise == "white at the output"
        assert row.deviation == pytest.approx(SIGMA[row.signal], rel=0.2)
        assert row.chain == 0
        assert row.chance > 0.01
    own = {row.number: row for row in found.own_numbers}
    bias = own["drive.bias"]
    assert bias.unit == "A"
    assert abs(bias.value - 0.02 / 0.25) < 4 * bias.deviation
    (note,) = found.run_notes
    turned = 0.02 * found.problem.runs[0].run.t[-1] ** 2 / (2 * J)
    assert f"by {turned:.2g}"[:-1] in note
    assert "residuals are white" in found.in_words
    (curves,) = found.run_curves
    np.testing.assert_allclose(np.std(curves.computed - curves.measured, axis=1), [2e-3, 0.02], rtol=0.2)
    assert to_dict(found)["runs"][0]["by_chain"] == 0.0
    assert found.arm.assumptions[-1].startswith("Fitted to a run of array in open loop")


def test_a_wrong_arm_leaves_residuals_that_are_not_white():
    heavy = replace(LAB, payload=replace(LAB.payload, mass=0.3))
    found = fit(heavy, [], ["hub.inertia"], runs=[open_run(n=300)], chain=chain_of(), profile=False)
    assert not found.is_explained
    assert "model rejected: residuals are no white noise that is independent of the input (chance " in found.in_words
    assert found.verdict == "fitted, but the arm does not explain the data"


@pytest.mark.parametrize("law", [None, SERVO])
def test_limits_of_the_chain_that_are_reached_are_named(law):
    """What the simulator has with a limit of 0.3 N m less what it has without."""
    limited = replace(chain_of(), actuator=Actuator(torque_limit=0.3), converters=Converters(encoder_counts=500))
    reference = 0.0 if law is None else np.cumsum(command(300, size=2.0)) * T
    task = task_of(command(300) * (law is None), np.zeros(300) + reference)
    chains = (chain_of(), limited)
    free, held = (signals_of(simulated(LAB, law or LOOSE, each, task)) for each in chains)
    outputs = with_noise(free, 2)
    # from where the run is taken
    outputs["hub_angle"][0] = 0.0
    of_loop = {"references": {"hub_angle": task.hub_angle}, "law": law} if law else {"input": task.feedforward}
    run = RigRun(period=T, outputs=outputs, **of_loop)
    model = replace(fit_run(LAB, run, limited), sigma=(1e-3, 0.01), count=MODES)
    effects = model.chain_effects(LAB, lambda place: math.nan)
    right = [abs(held[name] - free[name]).max() / sigma for name, sigma in zip(outputs, (1e-3, 0.01), strict=True)]
    np.testing.assert_allclose(effects, right, rtol=1e-9)
    step = 2 * math.pi / 500
    assert model.rescaled(np.zeros(600), 1.0).sigma[0] == pytest.approx(step / math.sqrt(12))
    found = fit(LAB, [], ["hub.inertia"], runs=[run], chain=limited, profile=False)
    assert any("(saturation)" in note for note in found.run_notes)


def csv_of(run, path):
    columns = {"t": run.t} | {f"reference:{name}": x for name, x in run.references.items()} | {**run.outputs}
    if run.input is not None:
        columns["hub_torque"] = run.input
    np.savetxt(path, np.transpose([*columns.values()]), delimiter=",", header=",".join(columns), comments="")


def test_a_fit_by_the_command_saves_an_arm_whose_loops_are_those_of_the_rig(tmp_path, monkeypatch, capsys):
    """The gain of the drive, 0.25 N m, and its dead time are in the file that margins and the others read."""
    monkeypatch.chdir(tmp_path)
    csv_of(open_run(times=0.25, n=300), "open.csv")
    Path("rig.toml").write_text(to_toml(START))
    free = "link.youngs_modulus,hub.inertia,drive.gain,drive.delay"
    command_line = ("fit", "rig.toml", "--run", "open.csv", "--free", free, "--covariance", "--initial", "free")
    found = answer(capsys, *command_line, "--save", "fitted.toml", "--figure", "fit.png")
    assert found["explained"]
    assert {row["noise_is"] for row in found["runs"]} == {"white at the output"}
    assert Path("fit.png").stat().st_size > 1e4
    chain = load_chain("fitted.toml")
    assert chain.sampling.delay_samples == pytest.approx(0.7, abs=0.05)
    posterior = load_posterior("fitted.posterior.json")
    assert "motor.torque_constant" in posterior.keys
    assert "drive.delay" not in posterior.keys
    right = tfarm.margins(LAB, SERVO).in_band
    law = {"K1": "2.8", "K2": "0.4", "Kp": "8"}
    own = answer(capsys, "margins", "fitted.toml", *(f"--{name}={value}" for name, value in law.items()))
    assert own["in_range"]["phase_margin_deg"] == pytest.approx(right.phase_margin.value, rel=0.01)
    closed = closed_run(False, n=300, seed=6)
    scaled = tfarm.HubFeedback(**{name: float(value) for name, value in law.items()})
    sim = simulated(
        tfarm.load("fitted.toml"), scaled, chain, task_of(0 * closed.t, closed.references["hub_angle"], 0.08)
    )
    for name in ("hub_angle", "root_moment"):
        off = sim.measured[:, AT_HUB.index(name)] - closed.outputs[name]
        assert np.std(off) == pytest.approx(SIGMA[name], rel=0.15)


def test_what_belongs_to_runs_is_refused_without_one(capsys):
    for option in (("--initial", "rest"), ("--period", "0.01")):
        assert "--run" in refused(capsys, "fit", "sasaki2012-lab", "--free", "hub.inertia", *option)
    assert "initial" in str(refusal(open_run, n=100, initial="moving"))
    for free, words in ((["gain"], "gain:SIGNAL"), (["drive.delay", "drive.delay"], "named twice")):
        assert words in str(refusal(fit, LAB, [], ["hub.inertia", *free], runs=[open_run(n=100)]))


def test_the_pages_of_a_fit_have_its_runs():
    found = fit_of_open_run()
    section = fit_section(ArmReport(found.arm, found.chain, (), found), count=2)
    stems = [each.stem for each in section.blocks]
    assert stems[:4] == ["fit-runs", "fit", "fit-signals", "fit-own"]
    assert not {"fit-overlay", "fit-resonances", "fit-band"} & {*stems}
    assert any("drift of the rigid mode" in words for words in section.words)
    measured, residual, *_ = fit_runs(found)
    assert measured.lines[0].get_ydata() == pytest.approx(found.problem.runs[0].measured[0])
    off = measured.lines[1].get_ydata() - measured.lines[0].get_ydata()
    assert residual.lines[0].get_ydata() == pytest.approx(off)


def test_a_dead_time_of_none_ends_at_its_bound():
    run = open_run(chain=chain_of(0.0), n=300)
    found = fit(START, [], [*PLANTED], runs=[run], chain=chain_of(0.3), profile=True)
    delay = found.parameters[-1]
    assert delay.low == pytest.approx(0, abs=1e-9)
    assert 0 <= delay.value < delay.high < 0.02 * T
    assert_found(found, PLANTED | {"drive.delay": 0.0})


def test_runs_and_frequency_responses_are_fitted_together():
    """The response knows the stiffness, and the run the dead time."""
    omega = np.geomspace(5.0, 300.0, 60)
    H = tfarm.transfer(LAB, "root_moment")(1j * omega)
    rng = np.random.default_rng(11)
    noise = 0.02 * abs(H) * (rng.standard_normal(60) + 1j * rng.standard_normal(60))
    data = tfarm.Measured(output="root_moment", input="hub_torque", omega=omega, values=H + noise, sigma=0.02 * abs(H))
    found = fit(START, [data], [*PLANTED], runs=[open_run(n=300)], chain=chain_of(0.0), profile=False)
    assert_found(found, PLANTED)
    assert found.verdict == "fitted"
    assert [row.name for row in found.response_list] == ["root_moment/hub_torque"]
    assert len(found.run_signals) == 2
