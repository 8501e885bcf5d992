"""One fit of several arms, from records of finite elements: shared numbers, each arm's own, files, and predictions."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import tfarm
from tests.fitting.three_rulers import CHAIN, DELAY, GAIN, PERIOD, fit_of, open_loop, predictions, ruler, started
from tests.shared import refusal
from tests.shell import answer, refused
from tfarm.arm.chain import Chain, Sampling
from tfarm.arm.writing import to_toml
from tfarm.fitting.fit import save_fit
from tfarm.fitting.posterior import load_posterior
from tfarm.fitting.together import fit_together

LENGTHS = (0.30, 0.18)
KEYS = ["link.youngs_modulus", "hub.inertia"]


@cache
def two_rulers():
    """Two rulers on one servo, their open loops, and one fit with the drive."""
    rng = np.random.default_rng(571)
    arms = [ruler(length) for length in LENGTHS]
    runs = [open_loop(arm, rng, 480) for arm in arms]
    return arms, runs, fit_of(arms, runs, profile=False)


@pytest.mark.survey
def test_what_three_rulers_share_is_one_number_and_the_rest_is_each_ones_own():
    arms, _, found = two_rulers()
    numbers = {each.key: each for each in found.parameters}
    names = [arm.name for arm in arms]
    expected = {"hub.inertia": 1.5e-3, "hub.friction": 0.02, "motor.torque_constant": GAIN, "drive.delay": DELAY}
    expected |= {f"link.youngs_modulus:{name}": 205e9 for name in names}
    expected |= {f"link.damping:{name}": 2e-4 for name in names}
    assert numbers.keys() == expected.keys()
    for key, value in expected.items():
        # four deviations, of which each is a few per cent at most
        assert abs(numbers[key].value - value) < 4 * numbers[key].deviation < 0.2 * value, key
    assert found.verdict == "fitted"
    one, other = found.arms
    assert one.hub == other.hub
    assert one.motor == other.motor
    assert one.link.youngs_modulus != other.link.youngs_modulus


@pytest.mark.survey
def test_closed_loops_are_predicted_to_their_noise_and_better_than_by_any_null_model():
    arms, _, found = two_rulers()
    for name, number, errors in predictions(np.random.default_rng(572), arms, found, count=300):
        best = errors.pop("fit")
        # steps of the encoder and noise leave 0.031 deg
        assert best < 0.045, (name, number)
        assert best < min(errors.values()), (name, number)


def test_residuals_are_those_of_each_arm_alone():
    _, _, found = two_rulers()
    (delay,) = [each.value for each in found.parameters if each.key == "drive.delay"]
    late = Chain(sampling=Sampling(period=PERIOD, delay_samples=delay / PERIOD))
    pairs = zip(found.arms, found.problem.runs, strict=True)
    parts = [replace(run, chain=late, delay=None).residuals(arm, None) for arm, run in pairs]
    np.testing.assert_allclose(np.concatenate(parts), found.residuals, rtol=1e-6, atol=1e-6)


def test_each_arm_is_saved_with_its_own_posterior(tmp_path):
    _, _, found = two_rulers()
    save_fit(found, tmp_path / "first.toml")
    for file, arm in zip(("first", "ruler-180-fitted"), found.arms, strict=True):
        saved = tfarm.load(tmp_path / f"{file}.toml")
        assert saved.link == arm.link
        assert saved.motor == arm.motor
        posterior = load_posterior(tmp_path / f"{file}.posterior.json")
        assert set(posterior.keys) == {*KEYS, "link.damping", "hub.friction", "motor.torque_constant"}
        deviation = {each.key: each.deviation / each.value for each in found.parameters}
        of = posterior.keys.index("hub.inertia")
        assert posterior.covariance[of][of] == pytest.approx(deviation["hub.inertia"] ** 2, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"shared": ["hub.radius"]}, "shared"),
        ({"runs": [[]]}, "runs"),
        ({"arms": [ruler(0.3), ruler(0.3)]}, "names of their own"),
        ({"start": {"hub.inertia:ruler-10": 1.0}}, "ruler-10"),
        ({"free": ["gain:hub_rate"], "shared": []}, "such as link.youngs_modulus"),
        ({"free": [*KEYS, "gain:hub_rate"], "shared": []}, "no run has that signal"),
    ],
)
def test_refusals(change, words):
    arms, runs, _ = two_rulers()
    of = {"arms": [started(arm) for arm in arms], "free": KEYS, "runs": [[run] for run in runs]}
    of |= {"shared": ["hub.inertia"], "chain": CHAIN} | change
    assert words in str(refusal(fit_together, of.pop("arms"), of.pop("free"), **of))


def test_the_command_fits_arms_together(tmp_path, capsys):
    arms, runs, _ = two_rulers()
    for arm, run in zip(arms, runs, strict=True):
        (tmp_path / f"{arm.name}.toml").write_text(to_toml(started(arm)))
        columns = np.column_stack([run.t, run.input, *run.outputs.values()])
        header = ",".join(["t", "hub_torque", *run.outputs])
        np.savetxt(tmp_path / f"{arm.name}.csv", columns, delimiter=",", header=header, comments="")
    one, other = (tmp_path / arm.name for arm in arms)
    words = ["fit", f"{one}.toml", "--run", f"{one}.csv", "--with", f"{other}.toml={other}.csv", "--period", PERIOD]
    words += ["--free", "link.youngs_modulus,link.damping,hub.inertia,hub.friction,drive.gain,drive.delay"]
    words += [
        "--shared",
        "hub.inertia,hub.friction,drive.gain,drive.delay",
        "--covariance",
        "--save",
        tmp_path / "one.toml",
    ]
    found = answer(capsys, *map(str, words))
    numbers = {each["key"]: each["value"] for each in found["parameters"]}
    assert numbers["drive.delay"] == pytest.approx(DELAY, rel=0.02)
    assert numbers["link.youngs_modulus:ruler-180"] == pytest.approx(205e9, rel=0.01)
    saved = tfarm.load(tmp_path / "ruler-180-fitted.toml")
    assert saved.hub.inertia == numbers["hub.inertia"]
    assert "--with" in refused(
        capsys, "fit", f"{one}.toml", "--run", f"{one}.csv", "--free", "hub.inertia", "--shared", "x"
    )
