"""Predictions of runs: planted ones leave their noise, wrong models lose against a null model, causes are named."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import tfarm
from tests.fitting import quanser
from tests.shared import refusal
from tests.shell import answer, refused
from tfarm.arm.chain import Actuator, Chain, Converters, Sampling
from tfarm.arm.writing import to_toml
from tfarm.case import Case
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulator
from tfarm.fitting.posterior import Posterior, PosteriorNumber
from tfarm.fitting.residual_causes import cross_correlation
from tfarm.fitting.run_files import load_run
from tfarm.fitting.runs import RigRun

T = 0.01
N = 1000
LAB = tfarm.load("sasaki2012-lab")
ARM = replace(LAB, hub=replace(LAB.hub, friction=0.3))
CHAIN = Chain(sampling=Sampling(period=T, delay_samples=0.7))
# of recorded signals alone
LAW = tfarm.HubFeedback(Kp=2.0, K1=0.0, K2=0.1)
NOISE = {"hub_angle": 1e-3, "root_moment": 0.01}
# an encoder's and a gauge's, as their controller reads them
OFFSETS = {"hub_angle": 0.02, "root_moment": 0.05}
REFERENCE = np.interp(T * np.arange(N), [0, 1, 2, 5, 6], [0, 0, 1, 1, 0.3])


def planted(*, closed, arm=ARM, chain=CHAIN, friction=0.0, gain=1.0, seed=0, law=LAW):
    """A run by the simulator with 20 modes; what a sensor reads besides its signal is torque that the law makes of it.

    Dry friction is the disturbance that its own motion makes, by iteration.
    """
    rng = np.random.default_rng(seed)
    none = np.zeros(N)
    read = {name: OFFSETS[name] * closed + NOISE[name] * rng.standard_normal(N) for name in NOISE}
    torque = np.repeat(rng.choice([-0.5, 0.5], N // 10), 10)
    fed = -law.Kp * read["hub_angle"] - law.K2 * read["root_moment"] if closed else gain * torque
    disturbance = none
    for _ in range(8 if friction else 1):
        task = Scenario("planted", T, fed, REFERENCE if closed else none, none, none, disturbance)
        at = Simulator(Case(arm, law if closed else tfarm.HubFeedback(), chain), task).run().at_samples
        disturbance = -friction * np.tanh(at.hub_rate / 0.02)
    outputs = {name: at.signal(name) + read[name] for name in NOISE}
    if closed:
        return RigRun(period=T, outputs=outputs, references={"hub_angle": REFERENCE}, law=law)
    return RigRun(period=T, outputs=outputs, input=torque)


def with_stiffness(arm, factor):
    return replace(arm, link=replace(arm.link, youngs_modulus=factor * arm.link.youngs_modulus))


# ------------------------------------------------------------ planted


@pytest.mark.parametrize("closed", [True, False], ids=["closed", "open"])
def test_the_right_arm_leaves_the_noise_and_beats_every_null_model(closed):
    found = tfarm.predict(
        ARM, planted(closed=closed), CHAIN, before=with_stiffness(ARM, 1.5), without={"drive.delay": 0.0}
    )
    for name, sigma in NOISE.items():
        # of 1000 samples: three deviations are 7 %
        assert found.rms_of("predicted", name) == pytest.approx(sigma, rel=0.1)
        assert found.offsets[name] == pytest.approx(OFFSETS[name] * closed, abs=4 * sigma)
    assert found.null_models == (
        "reference itself" if closed else "at rest", "rigid arm", "E I 20 % up", "E I 20 % down", "before the fit",
        "without drive.delay",
    )  # fmt: skip
    assert found.rms_of("without drive.delay", "root_moment") > 1.2 * found.rms_of("predicted", "root_moment")
    assert found.counts_for == [*NOISE]
    assert all(each.is_noise for each in found.residuals)
    assert found.causes == ()
    assert found.cause.startswith("none to look for")


def test_the_prediction_is_that_of_the_simulator_through_steps_and_limits():
    chain = replace(CHAIN, converters=Converters(encoder_counts=512), actuator=Actuator(torque_limit=0.4))
    none = np.zeros(N)
    task = Scenario("planted", T, none, REFERENCE, none, none, none)
    simulation = Simulator(Case(ARM, LAW, chain), task).run()
    assert simulation.saturated["torque"] > 20
    outputs = {name: simulation.at_samples.signal(name) for name in NOISE}
    run = RigRun(
        period=T, outputs=outputs, references={"hub_angle": REFERENCE}, law=LAW, sigma=dict.fromkeys(NOISE, 1e-9)
    )
    found = tfarm.predict(ARM, run, chain)
    # the modes beyond those of a run, and an offset that the loop without limits takes for the saturation
    free = replace(run, outputs={"hub_angle": outputs["hub_angle"]}, sigma={"hub_angle": 1e-9})
    assert tfarm.predict(ARM, free, chain).rms_of("predicted", "hub_angle") < 1e-6
    assert tfarm.predict(ARM, free, CHAIN).rms_of("predicted", "hub_angle") > 1e-2
    assert found.rms_of("predicted", "hub_angle") < 1e-2


def test_a_run_begins_where_its_encoder_has_the_hub():
    """All angles of a closed loop are off by the same: nothing changes."""
    here = planted(closed=True)
    moved = replace(
        here,
        outputs={**here.outputs, "hub_angle": here.outputs["hub_angle"] + 0.4},
        references={"hub_angle": REFERENCE + 0.4},
    )
    first, second = (tfarm.predict(ARM, each, CHAIN) for each in (here, moved))
    np.testing.assert_allclose(second.predicted - first.predicted, [[0.4], [0.0]] * np.ones(N), atol=1e-12)


def test_a_wrong_arm_loses_against_a_null_model():
    """A link that is a fifth too stiff: the one that is a fifth softer is the planted one, but for 4 %."""
    found = tfarm.predict(with_stiffness(ARM, 1.25), planted(closed=False), CHAIN)
    assert found.counts_for == []
    assert found.better_null("root_moment") == "E I 20 % down"
    assert found.rms_of("E I 20 % down", "root_moment") == pytest.approx(NOISE["root_moment"], rel=0.1)
    assert found.finding.startswith("the prediction does not count, not in hub_angle (")


def test_the_band_holds_95_percent_of_the_samples():
    """The arm of the fit is off by one deviation of its stiffness, which its posterior says."""
    sigma = 2e-3
    E = ARM.link.youngs_modulus * (1 + sigma)
    posterior = Posterior(
        format="tfarm posterior 1",
        arm="x",
        numbers=[PosteriorNumber(key="link.youngs_modulus", value=E, low=None, high=None, size=0)],
        covariance=[[sigma**2]],
        not_determined=[],
    )
    found = tfarm.predict(with_stiffness(ARM, 1 + sigma), planted(closed=False), CHAIN, posterior=posterior)
    noise = {each.signal: each.noise for each in found.residuals}
    assert found.rms_of("predicted", "root_moment") > 1.8 * NOISE["root_moment"]
    assert (found.half_band[1] > 1.9 * noise["root_moment"]).all()
    assert all(0.9 < each.inside <= 1.0 for each in found.residuals)
    assert {"hub_angle_low", "hub_angle_high"} <= {column.key for column in found.csv_table.columns}


# ------------------------------------------------------------ residuals


def with_mode(run):
    """A part that tfarm's arm lacks: 23 Hz, of a third of the noise's tenfold in the gauge."""
    pole = np.exp((-0.01 + 1j) * 2 * np.pi * 23 * T)
    ring = lfilter([0.0, 1.0], [1.0, -pole], run.input).imag
    return replace(run, outputs={**run.outputs, "root_moment": run.outputs["root_moment"] + 0.1 * ring})


CAUSES = {
    "gain of the drive": (lambda: planted(closed=False, gain=1.1), "+10"),
    "gain of root_moment": (
        lambda: replace(
            (one := planted(closed=False)), outputs={**one.outputs, "root_moment": 1.1 * one.outputs["root_moment"]}
        ),
        "+10",
    ),
    "dead time of the drive": (
        lambda: planted(closed=True, chain=Chain(sampling=Sampling(period=T, delay_samples=1.2))),
        "+5",
    ),
    "bending stiffness E I": (lambda: planted(closed=False, arm=with_stiffness(ARM, 0.95)), "-5"),
    "dry friction of the hub": (lambda: planted(closed=True, friction=0.05), "0.05"),
    "another mode": (lambda: with_mode(planted(closed=False)), "23"),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_a_planted_cause_is_named_with_its_size(cause):
    plant, size = CAUSES[cause]
    found = tfarm.predict(ARM, plant(), CHAIN)
    best = found.causes[0]
    assert best.change == cause
    assert best.removed > 0.5
    value = float(best.size.split()[0])
    assert value == pytest.approx(float(size), rel=0.1)
    assert found.cause.startswith(f"{cause} (")
    assert not all(each.is_noise for each in found.residuals)


def test_what_no_single_change_removes_is_named_as_such():
    rng = np.random.default_rng(1)
    run = planted(closed=False)
    wander = 0.05 * np.cumsum(rng.standard_normal(N)) * 0.1
    off = replace(run, outputs={**run.outputs, "root_moment": run.outputs["root_moment"] + wander})
    found = tfarm.predict(ARM, off, CHAIN)
    assert found.cause.startswith("none of these: at most, ")


def test_the_correlation_has_its_lag_and_its_bound():
    rng = np.random.default_rng(2)
    x, e = rng.standard_normal((2, 4000))
    late = np.r_[np.zeros(30), x[:-30]]
    ratio, lag = cross_correlation(e + 0.2 * late, x)
    assert (lag, ratio > 3) == (30, True)
    # of one lag: 1 % beyond the bound
    beyond = [cross_correlation(each, x[:400])[0] > 1.6 for each in rng.standard_normal((40, 400))]
    assert np.mean(beyond) < 0.1


# ------------------------------------------------------------ a real rig


@pytest.mark.parametrize(
    ("controller", "hub", "deflection"),
    [("lqg", 0.42, 0.18), pytest.param("hinf", 1.13, 0.39, marks=pytest.mark.survey)],
)
def test_two_runs_of_a_real_rig_are_predicted_from_others(controller, hub, deflection):
    """Fitted to runs of other steps: far better than the maker's numbers in the gauge, and not free of dry friction."""
    (found,) = quanser.predictions([load_run(quanser.RIG / f"{controller}.toml").run], quanser.VALUES)
    rows = quanser.in_degrees(found)
    assert rows["predicted"] == pytest.approx([hub, deflection], abs=0.01)
    assert rows["predicted"][1] < 0.7 * rows["before the fit"][1]
    assert rows["predicted"][0] < 0.3 * rows["reference itself"][0]
    # the bending stiffness is not what these runs show
    assert "root_moment" not in found.counts_for
    assert not found.residuals[0].is_noise
    # a curve that is damped within a turn is no mode that the arm lacks
    assert "another mode" not in found.cause


# ------------------------------------------------------------ refusals, command


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"gains": {"tip_displacement": 1.0}}, "tip_displacement"),
        ({"without": {"link.young": 1.0}}, "link.young"),
        ({"without": {"gain:root_moment": 1.0}}, "no gain of this prediction"),
        ({"law": tfarm.HubFeedback(Kp=-2000.0)}, "grows without bound"),
    ],
    ids=["gain", "key", "sensor", "unstable"],
)
def test_what_cannot_be_predicted_is_refused_in_one_line(how, words):
    assert words in str(refusal(tfarm.predict, ARM, planted(closed=True), CHAIN, **how))


def test_the_command_is_the_function(tmp_path, capsys):
    made = planted(closed=False)
    table = np.column_stack([made.t, made.input, *made.outputs.values()])
    path = tmp_path / "run.csv"
    np.savetxt(path, table, delimiter=",", header="t,hub_torque,hub_angle,root_moment", comments="")
    arm = tmp_path / "arm.toml"
    arm.write_text(to_toml(ARM), encoding="utf-8")
    given = ("predict", str(arm), "--run", str(path), "--delay-samples", "0.7")
    picture = tmp_path / "p.png"
    found = answer(capsys, *given, "--before", "sasaki2012-lab", "--without", "drive.delay=0", "--png", str(picture))
    mine = tfarm.predict(ARM, made, CHAIN, before=LAB, without={"drive.delay": 0.0})
    assert found["counts"] == mine.finding
    mine_rms = {(row.signal, row.origin): row.rms for row in mine.rows if row.rms is not None}
    own_rms = {(row["signal"], row["origin"]): row["rms"] for row in found["signals"] if row["rms"] is not None}
    assert own_rms == pytest.approx(mine_rms, rel=1e-6)
    assert picture.stat().st_size > 10_000
    assert "give one run" in refused(capsys, *given, "--run", str(path))
