"""Loops whose plant has a pole next to s = 0, as friction at a heavy hub makes it: verdicts on them are proven."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm import HubFeedback, Law
from tfarm.dsp import Chain, Converters, Sampling, pulse_transfer, sampled_loop, sampled_verdict
from tfarm.dsp.circle import Circle, complete_band
from tfarm.dsp.crossings import stable_windows
from tfarm.dsp.edges import whole_loop
from tfarm.reduced import modal_model, relaxed_model

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
    """x^n H, through the law, at a point of each arc, by `Sampled.terms`."""
    loop = whole_loop(arm, GAINS, chain)
    circle = complete_band(loop).circle()
    assert circle.is_slow.any()
    rng = np.random.default_rng(3)
    arcs = np.arange(4, circle.low.size)
    q = circle.low[arcs] + rng.uniform(0, 1, arcs.size) * (circle.high - circle.low)[arcs]
    z = np.exp(1j * q)
    terms = loop.terms(z, None, np.ones(q.size))
    for row, (_, signal, gain, roots) in enumerate(circle.terms):
        disc, order = circle.parts[1 + row], circle.orders[signal] - int((roots == 0).sum())
        value = (1 - 1 / z) ** order * terms[row] / gain * z**-loop.in_z.poles.size
        assert (abs(value - disc.middle[arcs]) <= disc.radius[arcs]).all()


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
@pytest.mark.parametrize("law", [GAINS, replace(GAINS, Kp=0.01), LEAD], ids=["PD", "soft", "lead"])
@pytest.mark.parametrize("arm", [BRAKED, LOOSE], ids=["friction", "hardly any"])
def test_a_verdict_on_a_hub_with_friction_is_proven(arm, chain, law):
    verdict = sampled_verdict(arm, law, chain)
    assert verdict.is_settled
    assert verdict.is_stable == (np.abs(np.linalg.eigvals(verdict.loop.reduced_matrix())).max() < 1)


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
def test_with_ever_less_friction_the_loop_is_ever_nearer_to_that_without(chain):
    """Radius and edge of Kp are smooth in b: what b does at 1e-7 is the share of it that it does at 1e-3."""
    found = {}
    for b in (0.0, 1e-3, 1e-5, 1e-7):
        loop = sampled_loop(replace(LAB, hub=replace(LAB.hub, friction=b)), GAINS, chain, count=6)
        ((low, high),) = stable_windows(loop, "Kp")
        assert low == 0.0
        found[b] = np.array([loop.poles.log_spectral_radius, high])
    slope = (found[1e-3] - found[0.0]) / 1e-3
    for b in (1e-5, 1e-7):  # R/s and r/(s - p) cancel to first order: some last bits of J/(b T)
        rounding = 20 * np.finfo(float).eps * LAB.total_inertia / (b * chain.sampling.period)
        np.testing.assert_allclose(found[b], found[0.0] + slope * b, rtol=1e-7 + rounding)


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.6])
def test_the_state_space_of_a_braked_hub_is_its_pulse_transfer_function(delay):
    """C (z - A)^-1 B against the sum over poles, with friction that leaves both their digits."""
    arm = replace(LAB, hub=replace(LAB.hub, friction=0.3))
    pulse = pulse_transfer(arm, ["hub_angle", "hub_rate", "root_moment"], Sampling(period=0.01, delay_samples=delay))
    assert pulse.plant.braked(0.1 / 0.01) is not None
    A, B, C = pulse.matrices()
    z = np.array([1.2j, 0.95 * np.exp(0.3j), -1.1 + 0.2j])
    states = np.array([C @ np.linalg.solve(each * np.eye(len(A)) - A, B) for each in z]).T
    np.testing.assert_allclose(states, pulse(z), rtol=1e-9)


@pytest.mark.parametrize("model", [modal_model, relaxed_model])
def test_a_model_has_its_statics_whatever_the_friction(model):
    """Exact values at low frequencies, where -r/p of the slow pole, up to 1e14, and what is at rest nearly cancel."""
    names = ["hub_angle", "hub_rate", "root_moment", "tip_displacement"]
    s = np.array([0.1j, 3j])
    off = []
    for b in (1e-1, 1e-3, 1e-5, 1e-7):
        arm = replace(LAB, hub=replace(LAB.hub, friction=b))
        off.append(abs(model(arm, names, 6)(s) / tfarm.transfer(arm, names)(s) - 1).max())
    assert max(off) < 2 * off[0] + 1e-16 * LAB.total_inertia * 3 / 1e-7  # R/s and r/(s - p) cancel to first order


def test_a_pole_left_of_the_line_is_not_bounded_twice():
    """What is left of it is in `missing` already: then the integral of the rate stands by itself."""
    loop = whole_loop(BRAKED, GAINS, Chain())
    band = complete_band(loop)
    left = band.kept & (np.arange(band.kept.size) != band.circle().braked)
    assert Circle(loop, left, band.missing).braked is None
