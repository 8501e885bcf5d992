"""How far modes ring, and how many records a picture of it takes: against the simulation's own records."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.arm import HubFeedback
from tfarm.dsp import Chain, Sampling, Simulator, scenario
from tfarm.dsp.traces import POINTS_A_PERIOD, records_between, ringing

STEEL = tfarm.load("stocky-steel")


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.6])
def test_what_is_played_again_is_the_simulation(delay):
    """A step without feedback or damping: one mode rings as far as the moment does, however late the step."""
    arm = replace(STEEL, link=replace(STEEL.link, damping=0.0))
    chain = Chain(sampling=Sampling(delay_samples=delay))
    simulator = Simulator(arm, chain, scenario("step", arm, chain, 0.3), count=1, between=400)
    run = simulator.linear(HubFeedback(K1=0.0, K2=0.0))
    moment = run.between.root_moment[run.between.t > (delay + 1) * chain.sampling.period]
    found = ringing(simulator, run)
    assert found.frequency == pytest.approx(tfarm.modes(arm, 1).natural_frequency[-1:])
    assert found.size[2, 0] == pytest.approx(np.ptp(moment) / 2, rel=2e-3)  # 400 records a sample: 96 a period


@pytest.mark.parametrize("delay", [0.0, 1.0])
def test_a_mode_rings_as_far_as_in_the_sample_where_it_rings_most(delay):
    """A slew, whose torque changes at each sample; four periods of the mode fit into one."""
    arm = replace(STEEL, link=replace(STEEL.link, damping=0.0))
    chain = Chain(sampling=Sampling(delay_samples=delay))
    simulator = Simulator(arm, chain, scenario("slew", arm, chain, 1.5), count=1, between=400)
    run = simulator.linear(HubFeedback(K1=0.0, K2=0.0))
    samples = run.between.root_moment.reshape(-1, 400)
    assert ringing(simulator, run).size[2, 0] == pytest.approx(np.ptp(samples, axis=1).max() / 2, rel=2e-3)


def test_the_slew_of_a_stiff_arm_gets_twenty_points_a_period():
    """416 Hz, which 400 points a second cannot show."""
    chain = Chain()
    simulator = Simulator(STEEL, chain, scenario("slew", STEEL, chain, 3.0), count=8)
    run = simulator.linear(HubFeedback(K1=1.0, K2=0.0))
    first = tfarm.modes(STEEL, 1).natural_frequency[-1] / (2 * np.pi)
    assert first == pytest.approx(416, abs=1)
    height = float(np.ptp(run.at_samples.root_moment))
    records = records_between(simulator, run, {"root_moment": height})
    fastest = ringing(simulator, run).fastest("root_moment", height) / (2 * np.pi)
    assert records / chain.sampling.period < POINTS_A_PERIOD * fastest <= (records + 1) / chain.sampling.period
    assert fastest >= first * (1 - 1e-9)
    fine = simulator.finer(records).linear(HubFeedback(K1=1.0, K2=0.0))
    np.testing.assert_allclose(fine.at_samples.root_moment, run.at_samples.root_moment, rtol=0, atol=1e-9)
    assert fine.between.t.size == records * run.t.size


def test_a_mode_takes_twenty_points_a_period_the_samples_among_them():
    """Of the lab arm 2.5 Hz in 100 samples a second, and none where nothing is seen."""
    lab, chain = tfarm.load("sasaki2012-lab"), Chain()
    simulator = Simulator(lab, chain, scenario("slew", lab, chain, 1.2), count=3)
    run = simulator.linear(HubFeedback(K1=0.3, K2=0.3))
    frequency = tfarm.modes(lab, 3).natural_frequency[1:] / (2 * np.pi)
    points = np.ceil(POINTS_A_PERIOD * frequency / 100)  # a sample's, itself among them
    height = float(np.ptp(run.at_samples.root_moment))
    needed = [records_between(simulator, run, {"root_moment": each}) for each in (1e9, height, 0.0)]
    assert needed[0] == 0
    assert needed[1] + 1 in points
    assert needed[2] + 1 == points[-1]
