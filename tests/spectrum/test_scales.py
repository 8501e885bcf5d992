"""The units of gains, by dimensional analysis: an arm of another size and material is the same arm in its own units."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shell import answer, run
from tests.similar import INERTIA, Units
from tfarm import Hub, HubFeedback, Payload
from tfarm.arm.chain import Sampling
from tfarm.case import Case
from tfarm.dsp import Chain
from tfarm.errors import ParameterError
from tfarm.loop.circle_crossings import stable_windows
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import stability
from tfarm.spectrum.gains import (
    DEFAULT_DIGITS,
    PAPER_GAINS,
    RATE_SHARE,
    angle_unit,
    default_gains,
    rate_unit,
    turning_inertia,
)
from tfarm.synthesis.design import design

STOCKY, LAB = tfarm.load("stocky-steel"), tfarm.load("sasaki2012-lab")
EPS = 2.0**-52
LARGE = Units(1e6, 100.0, 100.0)  # of the same material, a hundred times as long


def test_the_papers_arms_keep_the_papers_gains():
    """The misprinted density too, though its J w1 is twice as large; any other arm has its own."""
    papers = [tfarm.load(name) for name in tfarm.presets() if name.startswith("sasaki")]
    assert len(papers) == 3
    assert {default_gains(arm) for arm in papers} == {PAPER_GAINS}
    rounded = f"{RATE_SHARE * rate_unit(LAB):.{DEFAULT_DIGITS}g}"
    assert float(rounded) == PAPER_GAINS.K1  # by the rule for every arm as well
    renamed = replace(LAB, name="mine", assumptions=())
    assert default_gains(renamed) == PAPER_GAINS
    assert default_gains(replace(LAB, hub=Hub(inertia=10.0))).K1 > 1.0


def test_a_gain_is_too_large_for_an_arm_and_not_by_itself():
    """K1 = 2e9 N m s/rad is ordinary for an arm of J w1 = 5e9; LAB has a limit of its own, which is reported."""
    large, time = LARGE.arm(LAB), LARGE.time
    assert rate_unit(large) > 1e9
    law = HubFeedback(K1=0.5 * rate_unit(large), K2=0.3, Kp=0.1 * angle_unit(large))
    small = HubFeedback(K1=0.5 * rate_unit(LAB), K2=0.3, Kp=0.1 * angle_unit(LAB))
    here, there = (tfarm.closed_loop_poles(*each, 3).values for each in ((LAB, small), (large, law)))
    assert there * time == pytest.approx(here, rel=1e-9)
    for name, unit in (("K1", rate_unit(LAB)), ("Kp", angle_unit(LAB))):
        with pytest.raises(ParameterError, match=rf"{name} = .*for this arm at most 1e\+09 times J w1"):
            tfarm.margins(LAB, HubFeedback(**{name: 2e9 * unit}))
        with pytest.raises(ParameterError, match="for this arm"):
            sampled_verdict(Case(LAB, HubFeedback(**{name: 2e9 * unit})))


def test_windows_and_designs_of_a_large_arm_are_those_of_a_similar_small_one():
    """Nothing on the way compares a gain with a number: K1 goes beyond 1e9 N m s/rad here, continuous and sampled."""
    large, time, inertia = LARGE.arm(LAB), LARGE.time, LARGE.of(INERTIA)
    slow = Chain(sampling=Sampling(period=0.01 * time))
    chains, arms = (Chain(), slow), (LAB, large)
    laws = [HubFeedback(K1=2 * rate_unit(arm), K2=0.3) for arm in arms]
    ends = [stable_windows(sampled_loop(Case(*each), count=4), "K1") for each in zip(arms, laws, chains, strict=True)]
    assert np.ravel(ends[1]) * time / inertia == pytest.approx(np.ravel(ends[0]), rel=1e-6)
    found = [design(arm, "damping", chain=chain) for arm, chain in zip(arms, chains, strict=True)]
    assert found[1].law.K1 * time / inertia == pytest.approx(found[0].law.K1, rel=1e-3)
    assert found[1].value == pytest.approx(found[0].value, rel=1e-6)


def test_parts_that_do_not_turn_are_left_out():
    """J of an arm whose tip is pinned is that of hub and link; a locked hub leaves the link."""
    link = LAB.link
    beam = link.rhoA * link.length**3 / 3 + link.rhoI * link.length
    held = replace(LAB, payload=Payload(mass=math.inf))
    assert turning_inertia(held) == pytest.approx(LAB.hub.inertia + beam, rel=8 * EPS)
    assert turning_inertia(replace(LAB, hub=Hub(inertia=math.inf))) == pytest.approx(beam, rel=8 * EPS)
    assert turning_inertia(STOCKY) == STOCKY.total_inertia


def test_a_hub_without_inertia_has_no_moment_gain(capsys, tmp_path):
    """A K2 would be an algebraic loop; so K2 = 0 is the default of every command for such an arm."""
    pin = replace(LAB, hub=Hub(inertia=0.0), name="pin")
    assert default_gains(pin).K2 == 0.0
    file = tmp_path / "pin.toml"
    file.write_text(tfarm.arm.to_toml(pin), encoding="utf-8")
    found = answer(capsys, "margins", str(file))
    assert (found["K1"], found["K2"]) == (default_gains(pin).K1, 0.0)
    assert stability(Case(pin, HubFeedback(K1=found["K1"]))).word == found["verdict"]


VERBS = [
    ["poles"], ["margins"], ["sampled", "--modes", "2"], ["simulate", "--duration", "0.05"],
    ["locus", "--vary", "K1", "--from", "1", "--to", "2", "--points", "3", "--branches", "2"],
]  # fmt: skip


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb[0])
def test_gains_that_were_not_given_are_stated(capsys, verb):
    _, out, _ = run(capsys, verb[0], "stocky-steel", *verb[1:])
    assert "by default K1 = 77.7 N m s/rad (0.00642 J w1 of this arm) and K2 = 0.3\n" in out
    assert default_gains(STOCKY) == HubFeedback(K1=77.7, K2=0.3)


def test_gains_that_were_given_are_not(capsys):
    _, out, _ = run(capsys, "margins", "sasaki2012", "--K1", "1")
    assert "by default K2 = 0.3\n" in out
    _, out, _ = run(capsys, "margins", "sasaki2012", "--K1", "1", "--K2", "0")
    assert "by default" not in out
    found = answer(capsys, "margins", "sasaki2012", "--K2", "0")
    assert found["default_gains"] == ["K1"]
    assert found["default_gains_in_words"] == "K1 = 0.3 N m s/rad (as in the paper)"
