"""Analog damping of the actuator is friction of the hub: in every answer the two are the same loop."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shell import answer
from tfarm.arm.chain import file_text
from tfarm.assessment.comparison import compare
from tfarm.dsp import Actuator, Chain, Sampling, scenario
from tfarm.dsp.plant import arm_under_chain
from tfarm.report.live import explore
from tfarm.schema import to_dict
from tfarm.synthesis.judge import judge_of
from tfarm.tuner.trial import slew_trial

ARM, GAINS, DAMPING = tfarm.load("sasaki2012-lab"), tfarm.HubFeedback(K1=0.3, K2=0.3), 0.5
BRAKED = replace(ARM, hub=replace(ARM.hub, friction=ARM.hub.friction + DAMPING))
IDEAL = Chain(sampling=Sampling(delay_samples=0.5))
ANALOG = replace(IDEAL, actuator=Actuator(hub_damping=DAMPING))


def page(arm, chain, monkeypatch):
    """The arm and the chain of a live page."""
    cases = []
    monkeypatch.setattr("webbrowser.open", lambda address: True)
    monkeypatch.setattr("tfarm.report.live.save_live", lambda case, folder: cases.append(case))
    explore(arm, GAINS, chain)
    return cases


ANSWERS = {
    "card": lambda arm, chain, _: to_dict(tfarm.result_card(arm, GAINS, chain)),
    "card of known margins": lambda arm, chain, _: to_dict(
        tfarm.result_card(arm, GAINS, chain, continuous=tfarm.margins(ARM, GAINS)).continuous
    ),
    "loop function": lambda arm, chain, _: to_dict(tfarm.loop_function(arm, GAINS, chain)),
    "comparison": lambda arm, chain, _: [
        (side.poles, side.sampled.words)
        for side in compare(arm, [GAINS, GAINS.with_number("K2", 0.1)], chain=chain, modes=2).sides
    ],
    "slew": lambda arm, chain, _: to_dict(tfarm.step(arm, GAINS, chain, "slew", 2.0)),
    "deflection": lambda arm, chain, _: to_dict(tfarm.step(arm, GAINS, chain, "deflection", 2.0)),
    "simulation": lambda arm, chain, _: to_dict(tfarm.simulate(arm, GAINS, chain, "slew", 1.5)),
    "design": lambda arm, chain, _: [
        judge_of(arm, arm, chain, objective, ("hub_rate", "root_moment"), 2, 8, continuous=loop).score(GAINS)
        for objective, loop in (("damping", False), ("damping", True), ("residual", True), ("cost", False))
    ],
    "tuner": lambda arm, chain, _: slew_trial(arm, chain, Kp=1.0).with_constant(0.3).cost,
    "live page": page,
}


@pytest.mark.parametrize("name", ANSWERS)
def test_analog_damping_is_friction_of_the_hub(name, monkeypatch):
    ask = ANSWERS[name]
    assert str(ask(ARM, ANALOG, monkeypatch)) == str(ask(BRAKED, IDEAL, monkeypatch))


def test_it_is_in_each_loop_once():
    """Of the driven arm and the chain that is left the answers are the same again."""
    arm, chain = arm_under_chain(ARM, ANALOG)
    assert (arm, chain) == (BRAKED, IDEAL)
    assert arm_under_chain(arm, chain) == (arm, chain)
    assert str(tfarm.result_card(ARM, GAINS, ANALOG)) == str(tfarm.result_card(arm, GAINS, chain))
    (damped, plain) = (tfarm.result_card(each, GAINS, IDEAL).continuous for each in (BRAKED, ARM))
    assert damped.time_constant < 0.5 * plain.time_constant  # (J + ...)/(K1 + b): the damping acts


def test_a_slew_against_analog_damping_arrives():
    """A rigid arm, J theta_tt = r - b theta_t, follows the reference; so the tip ends at its travel."""
    found = tfarm.step(ARM, GAINS, ANALOG, "slew", 4.0)
    for loop in (found.continuous, found.sampled):
        assert loop.signals["tip_displacement"][-1] == pytest.approx(1.15, abs=0.02)
    task, rate = scenario("slew", ARM, ANALOG, 1.0), scenario("slew", ARM, IDEAL, 1.0)
    means = np.diff(np.r_[task.hub_angle, task.hub_angle[-1]]) / task.period
    np.testing.assert_allclose(task.feedforward - rate.feedforward, DAMPING * means, atol=1e-12)


WITHOUT_SAMPLING = {
    "poles": ("--count", "4"),
    "nyquist": (),
    "nichols": (),
    "spill": ("--modes", "3"),
    "locus": ("--vary", "K2", "--from", "0", "--to", "0.5", "--points", "5"),
    "map": ("--K1=0,1", "--K2=0,0.5", "--points", "4"),
}


@pytest.mark.parametrize("command", WITHOUT_SAMPLING)
def test_a_command_without_sampling_has_the_analog_damping_of_the_file(tmp_path, capsys, command):
    """The gains are given: default gains are those of the arm without its motor's damping."""
    gains = () if command == "map" else ("--K1", "0.3", "--K2", "0.3")
    answers = []
    for arm, chain in ((ARM, Chain(actuator=Actuator(hub_damping=DAMPING))), (BRAKED, Chain()), (ARM, Chain())):
        file = tmp_path / "arm.toml"
        file.write_text(file_text(arm, chain))
        answers.append(answer(capsys, command, str(file), *gains, *WITHOUT_SAMPLING[command]))
    assert answers[0] == answers[1] != answers[2]
