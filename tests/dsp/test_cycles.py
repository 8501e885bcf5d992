"""What is read off a simulation: how fast a limit cycle swings, whose energy is known."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.arm import HubFeedback
from tfarm.dsp import Actuator, Chain, Simulator, scenario
from tfarm.dsp.results import ideal_chain, limit_cycle

LAB, BARE = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")


def test_a_limit_cycle_swings_at_the_peak_of_its_spectrum():
    """An unstable loop that its motor limits; the last quarter of 20 s tells frequencies to 0.2 Hz."""
    gains, chain = HubFeedback(K1=0.3, K2=1.18), Chain(actuator=Actuator(torque_limit=3.0))
    task = replace(scenario("impulse", LAB, chain, 20.0), impulse=0.01)
    run, ideal = (Simulator(LAB, each, task, count=4).linear(gains) for each in (chain, ideal_chain(chain)))
    moment = run.at_samples.root_moment[-500:]
    peak = np.argmax(abs(np.fft.rfft((moment - moment.mean()) * np.hanning(500)))) * 2 * np.pi / 5.0
    assert limit_cycle(run, ideal).frequency == pytest.approx(peak, abs=np.pi / 5.0)


@pytest.mark.parametrize(
    ("arm", "chain", "is_known"),
    [(BARE, Chain(), True), (LAB, Chain(), False), (BARE, Chain(actuator=Actuator(hub_damping=0.1)), False)],
)
def test_energy_is_accounted_for_where_nothing_takes_it(arm, chain, is_known):
    run = Simulator(arm, chain, scenario("step", arm, chain, 0.1), count=2).linear(HubFeedback(K1=0.3))
    assert (run.energy_error is not None) == is_known
