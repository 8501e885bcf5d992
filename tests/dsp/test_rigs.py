"""The sampled loop on rigs: what a slew asks of the input, and analog damping where the input is no torque."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import tfarm
from tests.dsp.law_verdicts import stepped
from tests.shared import thinned
from tfarm import Law
from tfarm.dsp import Chain, sampled_verdict
from tfarm.dsp.chain import Actuator, Slew
from tfarm.dsp.plant import sensed_plant
from tfarm.dsp.scenarios import slew
from tfarm.dsp.traces import away
from tfarm.tuner.controller import tip_off

SLOW = 1e-3  # 1/s: the rig turns as one piece, and s^2 of its next term is beyond the digits compared


@pytest.mark.parametrize("name", ["tests/rigs/bench-rig.toml", "quanser-2dsfl", "quanser-flexlink"])
def test_the_feedforward_of_a_slew_turns_the_rig_against_its_friction(name):
    """Input over angle of the slowly turning exact rig is loss s + J s^2 + ..., and its gauge reads -J_g s^2."""
    arm = tfarm.load(name)
    task = slew(arm, Chain(), 1.5)
    forth, back = (1 / tfarm.transfer(arm, "hub_angle")(s) for s in (SLOW, -SLOW))
    loss, inertia = (forth - back) / (2 * SLOW), (forth + back) / (2 * SLOW**2)
    mean = np.r_[np.diff(task.hub_angle), 0.0] / task.period
    acceleration = np.r_[np.diff(task.hub_rate), 0.0] / task.period
    wanted = (loss * mean + inertia * acceleration).real[:-1]
    np.testing.assert_allclose(task.feedforward[:-1], wanted, rtol=1e-3, atol=1e-6 * abs(wanted).max())
    gauge = (tfarm.transfer(arm, "root_moment")(1j * SLOW) / tfarm.transfer(arm, "hub_angle")(1j * SLOW)).real
    np.testing.assert_allclose(task.rigid_moment[1:], gauge / -(SLOW**2) * np.diff(task.hub_rate) / task.period,
                               rtol=1e-4, atol=1e-9)  # fmt: skip


def test_analog_damping_is_friction_whatever_the_input():
    """A torque -d theta_t on the hub of a rig driven by current is the same rig with so much more friction."""
    arm, d = tfarm.load("quanser-2dsfl"), 0.7
    plant = sensed_plant(arm, Chain(actuator=Actuator(hub_damping=d)), ("hub_rate", "root_moment"), 8).unfiltered
    stiffer = replace(arm, hub=replace(arm.hub, friction=arm.hub.friction + d))
    s = 4 + 9j
    np.testing.assert_allclose(plant(s), tfarm.transfer(stiffer, ["hub_rate", "root_moment"])(s), rtol=1e-4)


@pytest.mark.parametrize("name", thinned(["tests/rigs/bench-rig.toml", "quanser-2dsfl", "quanser-flexlink"], 2))
@pytest.mark.parametrize("factor", [1.0, -40.0])
def test_the_verdict_on_a_damped_rig_is_proven(name, factor):
    """Poles of friction and of the circuit are among those that are counted; as many grow as in a stepped model."""
    arm = tfarm.load(name).having(damping=2e-5)
    gains = tfarm.default_gains(arm).times(factor)
    verdict = sampled_verdict(arm, gains)
    assert verdict.is_settled
    z = np.linalg.eigvals(stepped(arm, Law.of_gains(gains), Chain(), verdict.modes_used))
    grow = int((np.log(abs(z)) > 1e-9).sum())
    assert grow == (verdict.loop.poles.log_radius > 0).sum()
    assert (grow > 0) == (factor < 0)


def test_the_tip_of_a_slew_goes_where_a_rigid_arm_on_the_hub_s_radius_has_it():
    """G_tip/G_angle at rest is r + L: with the angle held the slew ends on its travel, as it does without a radius."""
    bench = tfarm.load("tests/rigs/bench-rig.toml")
    r, L = bench.hub.radius, bench.length
    assert r > 0.05 * L
    tip, angle = tfarm.transfer(bench, ["tip_displacement", "hub_angle"])(1e-3j)
    assert bench.reach == pytest.approx((tip / angle).real, rel=1e-6)
    for chain, travel in ((Chain(), 1.15 * (r + L)), (Chain(slew=Slew(travel=0.2)), 0.2)):
        run = tfarm.simulate(bench, tfarm.HubFeedback(K1=0.05, Kp=0.5), chain, duration=10.0, count=4)
        assert run.scenario.hub_angle[-1] == pytest.approx(travel / (r + L), rel=1e-12)
        assert run.at_samples.tip_displacement[-1] == pytest.approx(travel, abs=1e-4)
        assert abs(away(bench, run)[-1]) < 1e-4
        of_trial = SimpleNamespace(arm=bench, loop=SimpleNamespace(chain=chain))
        assert abs(tip_off(run, of_trial)) < 1e-4
