"""The best constant gain, of costs that are functions of the gain with a minimum in closed form.

Input shapers: their zeros, and a one-mode arm that they leave at rest.  What the tuner takes from the arm: ranges of
converters, units of its cost, the arms it is tried on.
"""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import tfarm
from tests.odd_arms import odd_arms
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling
from tfarm.loop.sampled import sampled_loop
from tfarm.spectrum.gains import default_gains
from tfarm.tuner import (
    baselines,
    best_constant,
    residual_rms,
    shaped_trial,
    slew_trial,
)
from tfarm.tuner.baselines import quantised_chain, shaper, tried_loops
from tfarm.tuner.tuning import usual_plan

GAINS = tfarm.HubFeedback(K1=0.3, K2=1.0)


@pytest.mark.parametrize(
    ("cost", "windows", "best", "off"),
    [
        # the lowest of two valleys is the narrower one
        (lambda K: min((K - 0.3) ** 2, 50 * (K - 0.8) ** 2 - 0.1), [(0.0, 1.0)], 0.8, 1e-7),
        (lambda K: (K - 1.2) ** 2, [(0.0, 0.5), (1.0, 1.5)], 1.2, 1e-7),
        # no moment feedback is not stable
        (lambda K: K, [(0.2, 1.0)], 0.2, 1e-5),
        (lambda K: 2.0 + K, [(0.0, 1.0)], 0.0, 0.0),
        (lambda K: 2.0 + K, [], 0.0, 0.0),
    ],
)
def test_the_best_constant_gain_has_the_lowest_cost_of_the_stability_intervals(monkeypatch, cost, windows, best, off):
    """Costs with a minimum in closed form; no other gain is tried, but 0 where no gain is stable."""
    tried = []

    def with_constant(K):
        tried.append(K)
        return SimpleNamespace(cost=cost(K))

    monkeypatch.setattr(baselines, "constant_windows", lambda loop: windows)
    found = best_constant(SimpleNamespace(loop=None, n=300, with_constant=with_constant))
    assert found.gain == pytest.approx(best, abs=off)
    assert found.cost == cost(found.gain)
    assert len(tried) > 1 or not windows
    assert all(any(low <= K < high for low, high in windows) or not (windows or K) for K in tried)


def test_a_one_mode_arm_is_left_at_rest():
    """No damping, no feedback, one mode: after the shaped slew nothing vibrates, to the last digits."""
    trial = slew_trial(tfarm.load("sasaki2012"), K1=0.0, count=1)
    task = trial.task.through(shaper(trial.loop, "ZV", 1))
    quiet = replace(trial, task=task).with_constant(0.0)
    before = residual_rms(trial.with_constant(0.0), trial.task)
    after = quiet.x[quiet.t > task.busy_until + 0.011]
    assert before > 0.5
    assert abs(after).max() < 1e-10 * before


def test_shaping_keeps_the_slew():
    trial = slew_trial(tfarm.load("sasaki2012-lab"))
    for kind in ("ZV", "EI"):
        late = shaped_trial(trial, kind).task
        assert late.hub_angle[-1] == pytest.approx(trial.task.hub_angle[-1], rel=1e-12)
        assert late.hub_rate[-1] == pytest.approx(0, abs=1e-12)
        ends = [task.t[np.flatnonzero(abs(task.feedforward) > 1e-12)[-1]] for task in (trial.task, late)]
        assert late.busy_until - trial.task.busy_until == pytest.approx(ends[1] - ends[0], rel=1e-9)
        assert late.feedforward.sum() == pytest.approx(0, abs=1e-10)


ARMS = odd_arms()
TURNING = [name for name, arm in ARMS.items() if arm.has_rigid_mode and arm.hub.inertia]


@pytest.mark.parametrize("name", TURNING)
def test_a_shaper_has_one_impulse_where_no_mode_lies_below_nyquist_frequency(name):
    """What the sentence about shaping rests on, by the poles of the loop itself."""
    arm, chain = ARMS[name], Chain()
    loop = sampled_loop(Case(arm, default_gains(arm), chain), count=3)
    seen = ((loop.plant.poles.imag > 0) & (loop.plant.poles.imag < math.pi / chain.sampling.period)).any()
    assert (shaper(loop, "ZV").size == 1) == (not seen)


@pytest.mark.parametrize("name", TURNING)
def test_the_scales_of_the_tuner_are_the_arms_own(name):
    """Ranges hold the slew's own torque, rigid moment and some more; payloads and dampings are shares of the arm's."""
    arm, chain = ARMS[name], Chain()
    torque = arm.total_inertia * chain.slew.acceleration(arm.link.length)
    converters, plan = quantised_chain(arm, chain).converters, usual_plan(arm, chain)
    assert 2 * torque < converters.torque_range < 5 * torque
    assert torque < converters.moment_range < 10 * torque
    assert 2 < torque / plan.scale < 4.5  # one digit of a third: the paper's 3 N m over its 1 N m
    cost = plan.trial(arm, chain).cost
    assert (cost.a * plan.scale**2, cost.b * plan.scale**2) == pytest.approx((1.0, 2.6))
    conditioned = {each.name: each.case.arm for each in tried_loops(Case(arm, GAINS, chain))}
    loads = [each.payload.mass for key, each in conditioned.items() if key.startswith("payload")]
    of_mass, wanted = (arm.payload.mass, [0.5, 1.5, 2.0]) if arm.payload.mass else (arm.own_mass, [0.06, 0.15, 0.3])
    assert loads == pytest.approx([share * of_mass for share in wanted], rel=0.05)  # two digits
    shares = sorted(e.link.damping / arm.link.damping for key, e in conditioned.items() if key.startswith("C ="))
    assert shares == pytest.approx([0.0, 0.1, 10.0])
    hubs = [conditioned[f"hub {share}"].hub.inertia / arm.hub.inertia for share in ("-20%", "+20%")]
    assert hubs == pytest.approx([0.8, 1.2], rel=1e-15)


def test_the_papers_arm_keeps_the_papers():
    lab = tfarm.load("sasaki2012-lab")
    names = [each.name for each in tried_loops(Case(lab, GAINS))]
    assert names[4:] == [
        "payload 0.1 kg", "payload 0.25 kg", "payload 0.5 kg", "hub -20%", "hub +20%", "C = 0 s", "C = 1e-05 s",
        "C = 0.001 s",
    ]  # fmt: skip
    assert names[2:4] == ["one sample of delay", "quantised, one sample of delay"]
    late = Chain(sampling=Sampling(delay_samples=0.5))
    assert [each.name for each in tried_loops(Case(lab, GAINS, late))][2:4] == [
        each.replace("one", "one more") for each in names[2:4]
    ]
    converters = quantised_chain(lab, Chain()).converters
    assert (converters.moment_range, converters.torque_range, usual_plan(lab, Chain()).scale) == (20.0, 10.0, 1.0)


@pytest.mark.parametrize(("hub", "wanted"), [(0.1, [1e-5, 1e-3]), (1e-3, [5e-6, 5e-4])])
def test_an_arm_without_damping_is_tried_with_two_dampings_of_its_first_mode(hub, wanted):
    """0.0358 and 3.58 per cent of critical, but that C is rounded to one digit."""
    arm = tfarm.load("sasaki2012").with_numbers(hub_inertia=hub)
    given = [each.case.arm for each in tried_loops(Case(arm, GAINS)) if each.name.startswith("C =")]
    assert [each.damping for each in given] == wanted
    ratios = [tfarm.damped_modes(tfarm.modes(each, 1)).damping_ratio[-1] for each in given]
    assert ratios == pytest.approx([3.575e-4, 3.575e-2], rel=0.1)
