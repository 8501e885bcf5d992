"""What the tuner takes from the arm: ranges of converters, units of its cost, the arms it is tried on, its shapers."""

import math

import pytest

import tfarm
from tests.odd_arms import odd_arms
from tfarm.dsp import Chain, Sampling, sampled_loop
from tfarm.spectrum.table import default_gains
from tfarm.tuner.baselines import quantised_chain, shaper, tried_loops
from tfarm.tuner.tuning import trial_of, usual_plan

ARMS = odd_arms()
TURNING = [name for name, arm in ARMS.items() if arm.has_rigid_mode and arm.hub.inertia]


@pytest.mark.parametrize("name", TURNING)
def test_a_shaper_of_one_impulse_is_an_arm_without_a_mode_below_half_the_sample_rate(name):
    """What the sentence about shaping rests on, by the poles of the loop itself."""
    arm, chain = ARMS[name], Chain()
    loop = sampled_loop(arm, default_gains(arm), chain, count=3)
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
    cost = trial_of(arm, plan, chain).cost
    assert (cost.a * plan.scale**2, cost.b * plan.scale**2) == pytest.approx((1.0, 2.6))
    conditioned = {each.name: each.arm for each in tried_loops(arm, chain)}
    loads = [each.payload.mass for key, each in conditioned.items() if key.startswith("payload")]
    of_mass, wanted = (arm.payload.mass, [0.5, 1.5, 2.0]) if arm.payload.mass else (arm.own_mass, [0.06, 0.15, 0.3])
    assert loads == pytest.approx([share * of_mass for share in wanted], rel=0.05)  # two digits
    shares = sorted(e.link.damping / arm.link.damping for key, e in conditioned.items() if key.startswith("C ="))
    assert shares == pytest.approx([0.0, 0.1, 10.0])
    hubs = [conditioned[f"hub {share}"].hub.inertia / arm.hub.inertia for share in ("-20%", "+20%")]
    assert hubs == pytest.approx([0.8, 1.2], rel=1e-15)


def test_the_papers_arm_keeps_the_papers():
    lab = tfarm.load("sasaki2012-lab")
    names = [each.name for each in tried_loops(lab, Chain())]
    assert names[4:] == [
        "payload 0.1 kg", "payload 0.25 kg", "payload 0.5 kg", "hub -20%", "hub +20%", "C = 0 s", "C = 1e-05 s",
        "C = 0.001 s",
    ]  # fmt: skip
    assert names[2:4] == ["one sample of delay", "quantised, one sample of delay"]
    late = Chain(sampling=Sampling(delay_samples=0.5))
    assert [each.name for each in tried_loops(lab, late)][2:4] == [
        each.replace("one", "one more") for each in names[2:4]
    ]
    converters = quantised_chain(lab, Chain()).converters
    assert (converters.moment_range, converters.torque_range, usual_plan(lab, Chain()).scale) == (20.0, 10.0, 1.0)


@pytest.mark.parametrize(("hub", "wanted"), [(0.1, [1e-5, 1e-3]), (1e-3, [5e-6, 5e-4])])
def test_an_arm_without_damping_is_tried_with_two_dampings_of_its_first_mode(hub, wanted):
    """0.0358 and 3.58 per cent of critical, but that C is rounded to one digit."""
    arm = tfarm.load("sasaki2012").having(hub_inertia=hub)
    given = [each.arm for each in tried_loops(arm, Chain()) if each.name.startswith("C =")]
    assert [each.damping for each in given] == wanted
    ratios = [tfarm.damped_modes(tfarm.modes(each, 1)).damping_ratio[-1] for each in given]
    assert ratios == pytest.approx([3.575e-4, 3.575e-2], rel=0.1)
