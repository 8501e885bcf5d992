"""Rigs without any loss whose gauge does not read the hub's moment: an edge of K2 for each mode of the locked hub."""

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
from tfarm.loop.frequencies import band_of
from tfarm.loop.lines import along, line_crossings
from tfarm.loop.lossless import locked_edges, stable_moments
from tfarm.loop.lyapunov import lyapunov
from tfarm.loop.margins import margins_of_gains
from tfarm.loop.nyquist import nyquist_of
from tfarm.loop.regions import INFINITE, region
from tfarm.loop.stability import stability
from tfarm.spectrum.scales import default_gains

ARM = tfarm.load("sasaki2012")
CANTILEVER = np.array([1.8751040687119611, 4.6940911329741746, 7.8547574382376126, 10.995540734875467])  # k_n L


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


@pytest.mark.parametrize("r", [0.0, 0.05, 0.2])
def test_closed_form_of_a_slender_cantilever(r):
    """K2_n = 1 + r k_n (cosh + cos)/(sinh + sin) of k_n L: the root shear over the root moment of a clamped beam."""
    slender = replace(with_radius(r), theory="euler-bernoulli", payload=Payload())
    kL = CANTILEVER
    sigma = (np.cosh(kL) + np.cos(kL)) / (np.sinh(kL) + np.sin(kL))
    edges = locked_edges(slender)
    first = np.argsort(edges.at)[:4]
    assert edges.gain[first] == pytest.approx(1 + r * kL / ARM.link.length * sigma, rel=1e-12)


@pytest.mark.parametrize("x", [0.02, 0.3])
def test_closed_form_of_a_gauge_on_a_slender_cantilever(x):
    """K2_n = W''(0)/W''(x) of the clamped beam's modes."""
    slender = replace(with_radius(0.0, x), theory="euler-bernoulli", payload=Payload())
    kL = CANTILEVER
    sigma, kx = (np.cosh(kL) + np.cos(kL)) / (np.sinh(kL) + np.sin(kL)), kL * x / ARM.link.length
    bending = (np.cosh(kx) + np.cos(kx) - sigma * (np.sinh(kx) + np.sin(kx))) / 2
    edges = locked_edges(slender)
    first = np.argsort(edges.at)[:4]
    assert edges.gain[first] == pytest.approx(1 / bending, rel=1e-10)


@pytest.mark.parametrize("name", thinned(RIGS, 2))
def test_the_edges_are_all_crossings_along_K2(name):
    """The D-decomposition, which knows no locked hub, finds the same gains, frequencies and ways, and no others."""
    arm = RIGS[name]
    known = locked_edges(arm)
    band = band_of(arm, 12)
    found = line_crossings(arm, along("K2", HubFeedback(K1=default_gains(arm).K1, Kp=0.1)), band)
    ours = {float(w): (t, n) for t, w, n in known if w < band and abs(t) < 1e6}
    theirs = {float(w): (t, n) for t, w, n in found if abs(t) < 1e6 and w > 0}
    assert len(ours) == len(theirs) > 5
    for (w, (t, n)), (v, (u, m)) in zip(sorted(ours.items()), sorted(theirs.items()), strict=True):
        assert v == pytest.approx(w, rel=1e-11)
        assert u == pytest.approx(t, rel=1e-6)  # theirs is a small difference where the hub is heavy
        assert n == m


@pytest.mark.parametrize("name", thinned(RIGS, 5))
def test_a_pole_of_the_elements_crosses_at_each_edge(name):
    """Half a per cent to either side of K2_n, at two K1, it is as far from the axis near i w_n, on the right beyond."""
    arm = RIGS[name]
    model, edges = RigLoop(arm, reached(arm, 8)), locked_edges(arm)
    first = np.argsort(edges.at)[:3]
    for K1 in np.array([0.3, 3.0]) * default_gains(arm).K1:
        for gain, w in zip(edges.gain[first], edges.at[first], strict=True):
            both = [model.eigenvalues(HubFeedback(K1=K1, K2=gain * step)) for step in (0.995, 1.005)]
            inside, outside = (s[abs(s - 1j * w).argmin()].real for s in both)
            assert inside < 0 < outside
            assert abs(inside + outside) < 0.2 * outside


@pytest.mark.parametrize("name", thinned(RIGS, 4))
def test_verdict_windows_and_map_follow_the_edges(name):
    arm = RIGS[name]
    law = default_gains(arm).having("K2", 0.0)
    low, high = stable_moments(arm)
    inside = law.having("K2", 0.999 * high)
    found = margins_of_gains(arm, inside)
    assert found.stability.verdict == "stable"
    assert not found.stability.is_known_beyond
    assert (found.exact_delay, found.exact_disk, found.exact_peak) == (None, None, None)
    assert found.windows["K1"].around == (0.0, np.inf)
    assert found.windows["K2"].around[1] == high
    assert found.windows["K2"].around[0] == max(low, found.windows["K2"].looked_at[0])
    assert found.in_band.gain[1] == pytest.approx(1 / 0.999, rel=1e-12)
    assert nyquist_of(found.stability).expected == 0
    assert not lyapunov(arm, inside).proven
    assert stability(arm, law.having("K2", 1.001 * high)).verdict == "unstable"
    plane = region(arm, np.array([-1.0, 0.1, 1.0]) * law.K1, np.array([0.0, 0.5, 0.999, 1.001]) * high)
    assert plane.unstable.tolist() == [[INFINITE, n, n] for n in (0, 0, 0, 2)]
    assert plane.stable_intervals[-1] == [(0.0, high)]


@pytest.mark.parametrize(("name", "K2", "count"), [("r = 0.05", 1.6, 8), ("r = 0.2", 3.5, 8)])
def test_so_many_poles_of_the_elements_are_unstable(name, K2, count):
    """Two for each edge below K2, by Nyquist's criterion too; as many to the left with K1 < 0."""
    arm = RIGS[name]
    law, model = HubFeedback(K1=0.3, K2=K2), RigLoop(arm, reached(arm, 8))
    verdict = stability(arm, law)
    assert verdict.unstable_roots == nyquist_of(verdict).expected == model.unstable(law) == count
    assert 2 * (locked_edges(arm).gain < K2).sum() == count
    mirrored = stability(arm, HubFeedback(K1=-0.3, K2=0.5))
    assert mirrored.unstable_roots_infinite
    assert np.sort(abs(mirrored.poles.values.real)) == pytest.approx(
        np.sort(abs(stability(arm, HubFeedback(K1=0.3, K2=0.5)).poles.values.real)), rel=1e-6, abs=1e-12
    )


def test_a_mode_far_above_the_band_is_in_the_verdict():
    """A gauge near the root reads the 16th and higher modes with the other sign: K2 = -2 drives some, not those below.

    In the elements' terms that growth is 3e-13 of the frequency: below rounding, so a box of poles alone would miss it.
    """
    arm = with_radius(0.0, 0.02)
    verdict = stability(arm, HubFeedback(K1=0.3, K2=-2.0))
    assert verdict.verdict == "unstable"
    assert verdict.unstable_roots == 0
    edges = locked_edges(arm)
    first = edges.at[(edges.gain < 0) & (edges.gain > -2.0)].min()
    assert f"the lowest is that at {first:.4g} rad/s" in verdict.tail
    kept = stability(arm, HubFeedback(K1=0.3, K2=0.999 * stable_moments(arm)[0]))
    assert kept.verdict == "stable"


def test_without_a_rate_gain_nothing_decides():
    verdict = stability(with_radius(0.05), HubFeedback(K2=0.3))
    assert verdict.verdict == "marginal"
    assert not verdict.is_known_beyond


def test_a_gauge_at_the_root_of_a_hub_without_radius_is_lyapunovs_line():
    edges = locked_edges(ARM)
    assert edges.gain == pytest.approx(np.ones(len(edges)), rel=1e-9)
    assert stable_moments(ARM) == (-np.inf, 1.0)


def test_massless_hub_with_a_radius_is_refused():
    arm = replace(with_radius(0.05), hub=replace(ARM.hub, inertia=0.0, radius=0.05))
    with pytest.raises(tfarm.ParameterError, match="through infinity"):
        stability(arm, HubFeedback(K1=0.3, K2=0.3))
