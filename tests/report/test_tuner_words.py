"""What is said about the tuner on any arm: each sentence against the costs that it is given."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import tfarm
from tests.odd_arms import odd_arms
from tfarm.dsp import Chain, sampled_loop
from tfarm.dsp.curves import away
from tfarm.report.tuner_words import beside_best, drift_words, learning_words, shaping_words, tuner_in_short
from tfarm.report.words import typeset
from tfarm.spectrum.scales import default_gains
from tfarm.tuner.comparison import quantised_chain, tried_loops
from tfarm.tuner.overview import plan_of
from tfarm.tuner.shaping import shaper

ARMS = odd_arms()
TURNING = [name for name, arm in ARMS.items() if arm.has_rigid_mode and arm.hub.inertia]


def study(without=2.0, best=1.0, tuner=0.9, free=0.8, shaped=0.1, late=0.1, ends=(0.2, 0.1), is_proven=True):
    """A study's numbers: costs, how much later shapers arrive [s], where the tip ends [m]."""
    curves = [
        SimpleNamespace(final=np.full(5, cost), title="rule", diverged=0, died=0)
        for cost in (tuner, free, best)
    ]  # fmt: skip
    tuning = SimpleNamespace(
        without=SimpleNamespace(cost=without),
        best_constant=SimpleNamespace(cost=best, gain=0.3),
        shaped_costs=dict.fromkeys(("ZV", "EI"), shaped),
        shaped_delays=dict.fromkeys(("ZV", "EI"), late),
        training=SimpleNamespace(guard=SimpleNamespace(is_proven=is_proven, modes_used=20)),
    )
    runs = [
        SimpleNamespace(
            at_samples=SimpleNamespace(tip_displacement=np.array([0.0, end])),
            scenario=SimpleNamespace(hub_angle=np.zeros(2)), t=np.arange(2.0),
        )
        for end in ends
    ]  # fmt: skip
    cost_map = SimpleNamespace(is_papers_best=False, verdict="(a, e) = (0.6, 0.8): median cost 5.852e+04, rank 4")
    return SimpleNamespace(
        arm=ARMS["boom"], tuning=tuning, curves=curves, slews={"with the tuner": runs[0]}, constant=runs[1],
        cost_map=cost_map,
    )  # fmt: skip


def test_less_is_lowered_by_another_share_and_more_is_not():
    words = tuner_in_short(study(without=2.0, best=1.0, tuner=0.9, free=0.8))
    assert words.startswith("A little. A constant K2 of 0.300 already takes 50 % off")
    assert "lowers it by another 10 %, to 0.900" in words
    assert "the median is 20 % below that" in words
    worse = tuner_in_short(study(without=2.0, best=1.0, tuner=1.15, free=1.3))
    assert worse.startswith("No.")
    assert "raises it by 15 %, to 1.15" in worse
    assert "another" not in worse
    assert "30 % above that" in worse


def test_a_constant_gain_that_does_nothing_is_not_said_to_take_0_percent_off():
    words = tuner_in_short(study(without=1.0, best=1.0, tuner=1.0, free=math.inf))
    assert "No constant K2 takes anything off" in words
    assert "leaves it as it is" in words
    assert "more than half of the seeds run away" in words
    assert "0 %" not in words
    assert beside_best(1.0, 1.0) == "that of the best constant gain"


def test_shaping_is_cheaper_only_where_it_is_and_nothing_arrives_0_ms_later():
    assert "is cheaper" in shaping_words(study(shaped=0.1))
    assert "is dearer here" in shaping_words(study(shaped=1.5))
    assert "0 ms later" not in shaping_words(study(late=0.0))
    assert "has nothing to do here" in shaping_words(study(late=0.0))


@pytest.mark.parametrize("name", TURNING)
def test_a_shaper_of_one_impulse_is_an_arm_without_a_mode_below_half_the_sample_rate(name):
    """What the sentence about shaping rests on, by the poles of the loop itself."""
    arm, chain = ARMS[name], Chain()
    loop = sampled_loop(arm, default_gains(arm), chain, count=3)
    seen = ((loop.plant.poles.imag > 0) & (loop.plant.poles.imag < math.pi / chain.sampling.period)).any()
    assert (shaper(loop, "ZV").size == 1) == (not seen)


def test_the_angle_that_is_left_is_said_as_it_is():
    assert "leaves more of it" in drift_words(study(ends=(0.5, 0.01)))
    assert "leaves no more of it" in drift_words(study(ends=(0.01, 0.5)))
    assert "about as much" in drift_words(study(ends=(0.2, 0.1)))
    there = study(ends=(0.5, 1e-15))
    there.constant.scenario.hub_angle[0] = 0.1
    assert "and 0 mm with the best constant gain" in drift_words(there)
    assert away(ARMS["boom"], study().constant)[-1] == 0.1


def test_the_guard_is_not_sold_as_more_than_it_is():
    assert "costs part of the gain, and buys the proof" in learning_words(study(tuner=0.9, free=0.8))
    assert "costs nothing here, and buys the proof" in learning_words(study(tuner=0.9, free=1.2))
    assert "of the first modes alone" in learning_words(study(is_proven=False))
    assert typeset("cost 5.852e+04, (0.9, 0.1)") == "cost 58520, (0.9, 0.1)"
    assert typeset("V_t = -a2 K1 theta_t^2, -2.5e-09 of J w1") == "V_t = −a2 K1 (dθ/dt)², −2.5 × 10⁻⁹ of J ω₁"


@pytest.mark.parametrize("name", TURNING)
def test_the_scales_of_the_tuner_are_the_arms_own(name):
    """Ranges hold the slew's own torque, rigid moment and some more; payloads and dampings are shares of the arm's."""
    arm, chain = ARMS[name], Chain()
    torque = arm.total_inertia * chain.slew.acceleration(arm.link.length)
    converters, plan = quantised_chain(arm, chain).converters, plan_of(arm, chain)
    assert 2 * torque < converters.torque_range < 5 * torque
    assert torque < converters.moment_range < 10 * torque
    assert 2 < torque / plan.scale < 4.5  # one digit of a third: the paper's 3 N m over its 1 N m
    assert plan.cost.b * plan.scale**2 == pytest.approx(2.6)
    conditioned = {each.name: each.arm for each in tried_loops(arm, chain)}
    loads = [each.payload.mass for key, each in conditioned.items() if key.startswith("payload")]
    assert max(loads) <= 2 * (arm.payload.mass or arm.link.rhoA * arm.link.length)
    shares = sorted(e.link.damping / arm.link.damping for key, e in conditioned.items() if key.startswith("C ="))
    assert shares == pytest.approx([0.0, 0.1, 10.0])


def test_the_papers_arm_keeps_the_papers():
    lab = tfarm.load("sasaki2012-lab")
    names = [each.name for each in tried_loops(lab, Chain())]
    assert names[4:] == [
        "payload 0.1 kg", "payload 0.25 kg", "payload 0.5 kg", "hub -20%", "hub +20%", "C = 0 s", "C = 1e-05 s",
        "C = 0.001 s",
    ]  # fmt: skip
    converters = quantised_chain(lab, Chain()).converters
    assert (converters.moment_range, converters.torque_range, plan_of(lab, Chain()).scale) == (20.0, 10.0, 1.0)
