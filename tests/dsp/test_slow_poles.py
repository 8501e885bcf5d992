"""Loops whose plant has a pole next to s = 0, as friction at a heavy hub makes it: verdicts on them are proven."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm import HubFeedback, Law
from tfarm.dsp import Chain, Converters, Sampling
from tfarm.dsp.band import complete_band
from tfarm.dsp.closed import verdict_on
from tfarm.dsp.margins import whole_loop

LAB = tfarm.load("sasaki2012-lab")
BRAKED = replace(LAB, hub=replace(LAB.hub, friction=0.01))  # its slow pole is at -b/J = -0.015 1/s
LOOSE = replace(LAB, hub=replace(LAB.hub, friction=1e-7))
SPRUNG = replace(LAB, hub=replace(LAB.hub, stiffness=1e-3))  # and here a slow pair, of the hub on its spring
CHAINS = {
    "plain": Chain(),
    "late": Chain(sampling=Sampling(period=0.005, delay_samples=1.3)),
    "encoder": Chain(sampling=Sampling(period=0.002), converters=Converters(hub_rate="difference")),
}
LEAD = Law({"hub_angle": ([0.1, 1.0], [0.01, 1.0]), "hub_rate": 0.3})
GAINS = HubFeedback(K1=0.3, K2=0.3, Kp=1.0)


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
@pytest.mark.parametrize("arm", [BRAKED, LOOSE, SPRUNG], ids=["friction", "hardly any", "spring"])
def test_discs_hold_the_pulse_transfer_functions(arm, chain):
    """x^n H at a point of each arc, by `PulseTransfer`."""
    loop = whole_loop(arm, GAINS, chain)
    circle = complete_band(loop).circle()
    assert circle.is_slow.any()
    rng = np.random.default_rng(3)
    arcs = np.arange(4, circle.low.size)
    q = circle.low[arcs] + rng.uniform(0, 1, arcs.size) * (circle.high - circle.low)[arcs]
    z = np.exp(1j * q)
    H = loop.signals(z, None, np.ones(q.size))
    for row, order in enumerate(circle.orders):
        disc = circle.parts[1 + row]
        value = (1 - 1 / z) ** order * H[row]
        assert (abs(value - disc.middle[arcs]) <= disc.radius[arcs]).all()


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
@pytest.mark.parametrize("law", [GAINS, replace(GAINS, Kp=0.01), LEAD], ids=["PD", "soft", "lead"])
@pytest.mark.parametrize("arm", [BRAKED, LOOSE], ids=["friction", "hardly any"])
def test_a_verdict_on_a_hub_with_friction_is_proven(arm, chain, law):
    verdict = verdict_on(arm, law, chain)
    assert verdict.is_settled
    assert verdict.is_stable == (np.abs(np.linalg.eigvals(verdict.loop.reduced_matrix())).max() < 1)
