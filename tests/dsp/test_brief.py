"""The sampled verdict beside recommended gains: its radius by a Galerkin model and a zero-order hold of its own."""

from dataclasses import replace

import pytest

import tfarm
from tests.shared import remember, thinned
from tests.shell import answer, run
from tests.synthesis.held_loop import HeldLoop
from tfarm import HubFeedback
from tfarm.arm import to_toml
from tfarm.dsp import Chain
from tfarm.dsp.chain import Sampling
from tfarm.dsp.verdict import sampled_brief
from tfarm.synthesis import design

LAB = tfarm.load("sasaki2012-lab")


@pytest.mark.parametrize(
    ("K1", "K2", "period"), thinned([(26.0, -3.0, 0.01), (20.0, -0.5, 0.01), (20.0, -0.5, 5e-4), (0.3, 0.3, 0.01)], 2)
)
def test_the_radius_is_that_of_an_independent_model(K1, K2, period):
    law = HubFeedback(K1=K1, K2=K2)
    brief = sampled_brief(LAB, law, Chain(sampling=Sampling(period=period))).answer
    radius = HeldLoop(LAB, period).radius(law)
    assert brief["spectral_radius"] == pytest.approx(radius, rel=1e-5)  # of 12 Ritz modes
    assert brief["stable"] == (radius < 1)


def test_gains_that_fail_when_sampled_are_not_recommended_without_a_word(capsys, monkeypatch):
    """At 10 ms, which no file of a preset says and which is said to be a default."""
    remember(monkeypatch, design, "design")  # two commands ask for the same
    found = answer(capsys, "design", "sasaki2012-lab", "--continuous")["sampled"]
    assert (found["period_s"], found["period_is_default"], found["stable"]) == (0.01, True, False)
    assert found["spectral_radius"] > 2
    _, out, _ = run(capsys, "design", "sasaki2012-lab", "--continuous")
    assert "objective damping of the continuous loop" in out
    assert "the bounds of K2 were widened to (" in out
    assert "BUT sampled every 10 ms (tfarm's default period) these gains are UNSTABLE: mode" in out


def test_the_period_is_that_of_the_arms_file(capsys, tmp_path):
    file = tmp_path / "quick.toml"
    text = to_toml(replace(LAB, name="quick")) + "\n[sampling]\nperiod = 5e-4\ndelay_samples = 0.5\n"
    file.write_text(text, encoding="utf-8")
    bounds = ["--K1", "15,25", "--K2=-0.5,0.2"]
    found = answer(capsys, "design", str(file), *bounds)["sampled"]
    assert (found["period_s"], found["delay_samples"], found["period_is_default"]) == (5e-4, 0.5, False)
    assert found["stable"] is True
    _, out, _ = run(capsys, "design", str(file), *bounds, "--period", "0.25e-3")
    assert "\nsampled every 0.25 ms, 0.5 samples late these gains are stable: mode" in out


def test_in_short_it_is_the_verdict_and_the_clock_in_milliseconds():
    lab = tfarm.load("sasaki2012-lab")
    chain = Chain(sampling=Sampling(period=0.004))
    told = [sampled_brief(lab, HubFeedback(K1=0.3, K2=K2), chain).short for K2 in (0.3, -4.0)]
    assert told == ["stable when sampled every 4 ms", "UNSTABLE when sampled every 4 ms"]
