"""Rigs without any loss whose gauge does not read the hub's moment: an edge of K2 for each mode of the locked hub.

With K1 != 0 poles are on the axis where the hub rests alone, at the frequencies w_n of the locked hub, and for one K2
each, whatever K1 and Kp: (M0 + r Q0)/M of that mode.
"""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.chain_elements import reached
from tests.loop.rig_loops import RigLoop
from tests.rigs import some_rig
from tests.shared import thinned
from tfarm import HubFeedback, Payload
from tfarm.arm import Gauge
from tfarm.loop.loop import Loop, band_of
from tfarm.loop.margins import margins
from tfarm.loop.nyquist import nyquist_of
from tfarm.loop.plane import gain_map
from tfarm.loop.stability import stability
from tfarm.loop.theorem import lyapunov
from tfarm.loop.windows import line_crossings
from tfarm.spectrum.table import default_gains

ARM = tfarm.load("sasaki2012")
CANTILEVER = np.array([1.8751040687119611, 4.6940911329741746, 7.8547574382376126, 10.995540734875467])  # k_n L
DIFFERENCE = 1e-6  # of an edge: hub torque less inertia times acceleration, a small difference where the hub is heavy


def with_radius(r, x=0.0):
    """The paper's arm, clamped r from the axis, its gauge at x."""
    return replace(ARM, hub=replace(ARM.hub, radius=r), gauge=Gauge(x=x))


def lossless_rig(seed):
    """A rig of up to three segments without any loss, on a hub with some radius, its gauge in its first tenth."""
    rng = np.random.default_rng([12, seed])
    arm = some_rig(rng, damped=False, segments=int(rng.integers(1, 4)), drive="hub_torque")
    hub = replace(arm.hub, inertia=arm.carried_inertia * 0.3, radius=arm.length * rng.uniform(0.02, 0.3))
    return replace(arm, hub=hub, gauge=Gauge(x=arm.length * rng.uniform(0, 0.1)))


RIGS = {"r = 0.05": with_radius(0.05), "r = 0.2": with_radius(0.2), "gauge": with_radius(0.0, 0.05)}
RIGS |= {f"seed {seed}": lossless_rig(seed) for seed in (4, 6)}


def edges_of(arm):
    """Gains and frequencies of the edges along K2 in the band of twelve modes, by frequency."""
    loop = Loop(arm, HubFeedback(K1=default_gains(arm).K1))
    found = line_crossings(loop, "K2", -50.0, 50.0, band_of(arm, 12))
    kept = (found.at > 0) & (abs(found.gain) < 1e6)
    order = np.argsort(found.at[kept])
    return found.gain[kept][order], found.at[kept][order]


@pytest.mark.parametrize("r", [0.0, 0.05, 0.2])
def test_closed_form_of_a_slender_cantilever(r):
    """K2_n = 1 + r k_n (cosh + cos)/(sinh + sin) of k_n L: the root shear over the root moment of a clamped beam."""
    slender = replace(with_radius(r), theory="euler-bernoulli", payload=Payload())
    kL = CANTILEVER
    sigma = (np.cosh(kL) + np.cos(kL)) / (np.sinh(kL) + np.sin(kL))
    assert edges_of(slender)[0][:4] == pytest.approx(1 + r * kL / ARM.link.length * sigma, rel=DIFFERENCE)


@pytest.mark.parametrize("x", [0.02, 0.3])
def test_closed_form_of_a_gauge_on_a_slender_cantilever(x):
    """K2_n = W''(0)/W''(x) of the clamped beam's modes."""
    slender = replace(with_radius(0.0, x), theory="euler-bernoulli", payload=Payload())
    kL = CANTILEVER
    sigma, kx = (np.cosh(kL) + np.cos(kL)) / (np.sinh(kL) + np.sin(kL)), kL * x / ARM.link.length
    bending = (np.cosh(kx) + np.cos(kx) - sigma * (np.sinh(kx) + np.sin(kx))) / 2
    assert edges_of(slender)[0][:4] == pytest.approx(1 / bending, rel=DIFFERENCE)


@pytest.mark.parametrize("name", thinned(RIGS, 2))
def test_the_edges_are_at_the_frequencies_of_the_locked_hub(name):
    arm = RIGS[name]
    locked = tfarm.modes(arm.having(hub_inertia=np.inf), up_to=band_of(arm, 12)).natural_frequency
    _, omega = edges_of(arm)
    assert omega.size > 5
    for w in omega:
        assert abs(locked - w).min() < 1e-9 * w


@pytest.mark.parametrize("name", thinned(RIGS, 5))
def test_a_pole_of_the_elements_crosses_at_each_edge(name):
    """Half a per cent to either side of K2_n, at two K1, it is as far from the axis near i w_n, on the right beyond."""
    arm = RIGS[name]
    model, (gains, omega) = RigLoop(arm, reached(arm, 8)), edges_of(arm)
    for K1 in np.array([0.3, 3.0]) * default_gains(arm).K1:
        for gain, w in list(zip(gains, omega, strict=True))[:3]:
            both = [model.eigenvalues(HubFeedback(K1=K1, K2=gain * step)) for step in (0.995, 1.005)]
            inside, outside = (s[abs(s - 1j * w).argmin()].real for s in both)
            assert inside < 0 < outside
            assert abs(inside + outside) < 0.2 * outside


@pytest.mark.parametrize("name", thinned(RIGS, 4))
def test_verdict_windows_and_map_follow_the_edges(name):
    arm = RIGS[name]
    law = default_gains(arm).having("K2", 0.0)
    gains, _ = edges_of(arm)
    high = gains[gains > 0].min()
    inside = law.having("K2", 0.999 * high)
    found = margins(arm, inside)
    assert found.stability.verdict == "stable"
    assert not found.stability.is_known_beyond
    assert (found.exact_delay, found.exact_disk, found.exact_peak) == (None, None, None)
    assert found.windows["K1"].around[0] == 0.0
    assert found.windows["K2"].around[1] == pytest.approx(high, rel=DIFFERENCE)
    assert found.in_band.gain[1] == pytest.approx(high / inside.K2, rel=DIFFERENCE)
    assert nyquist_of(found.stability).unstable_by_nyquist == 0
    assert not lyapunov(arm, inside).proven
    assert stability(arm, law.having("K2", 1.001 * high)).verdict == "unstable"
    plane = gain_map(arm, np.array([0.1, 1.0]) * law.K1, np.array([0.0, 0.5, 0.999, 1.001]) * high)
    assert plane.unstable.tolist() == [[n, n] for n in (0, 0, 0, 2)]
    ((low, top),) = plane.stable_intervals[-1]
    assert (low, top) == (0.0, pytest.approx(high, rel=DIFFERENCE))


@pytest.mark.parametrize(("name", "K2", "count"), [("r = 0.05", 1.6, 8), ("r = 0.2", 3.5, 8)])
def test_so_many_poles_of_the_elements_are_unstable(name, K2, count):
    """Two for each edge below K2, by Nyquist's criterion too; as many to the left with K1 < 0."""
    arm = RIGS[name]
    law, model = HubFeedback(K1=0.3, K2=K2), RigLoop(arm, reached(arm, 8))
    verdict = stability(arm, law)
    assert verdict.unstable_roots == nyquist_of(verdict).unstable_by_nyquist == model.unstable(law) == count
    assert 2 * ((edges_of(arm)[0] < K2) & (edges_of(arm)[0] > 0)).sum() == count
    mirrored = stability(arm, HubFeedback(K1=-0.3, K2=0.5))
    assert mirrored.verdict == "unstable"
    assert np.sort(abs(mirrored.poles.values.real)) == pytest.approx(
        np.sort(abs(stability(arm, HubFeedback(K1=0.3, K2=0.5)).poles.values.real)), rel=1e-6, abs=1e-12
    )


def test_what_a_mode_far_above_the_band_does_is_not_determined():
    """A gauge near the root reads the 16th and higher modes with the other sign: K2 = -2 drives some, not those below.

    In the elements' terms that growth is 3e-13 of the frequency: below rounding.
    """
    verdict = stability(with_radius(0.0, 0.02), HubFeedback(K1=0.3, K2=-2.0))
    assert verdict.verdict == "stable"
    assert not verdict.is_known_beyond
    assert "not determined beyond" in verdict.tail


def test_without_a_rate_gain_nothing_decides():
    verdict = stability(with_radius(0.05), HubFeedback(K2=0.3))
    assert verdict.verdict == "marginal"
    assert not verdict.is_known_beyond


def test_massless_hub_with_a_radius_is_refused():
    arm = replace(with_radius(0.05), hub=replace(ARM.hub, inertia=0.0, radius=0.05))
    with pytest.raises(tfarm.ParameterError, match="through infinity"):
        stability(arm, HubFeedback(K1=0.3, K2=0.3))
