"""Rigs without any loss whose gauge does not read the hub's moment: an edge of K2 for each mode of the locked hub.

With K1 != 0 poles are on the axis where the hub rests alone, at the frequencies w_n of the locked hub, and for one K2
each, whatever K1 and Kp: (M0 + r Q0)/M of that mode.
"""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.chain_elements import reached
from tests.loop.arms import loop_of, verdict_of
from tests.loop.rig_loops import RigLoop
from tests.rigs import some_rig
from tests.shared import refusal, thinned
from tfarm import Hub, HubFeedback, Payload
from tfarm.arm import Gauge, Motor
from tfarm.loop.continuous import frequency_above_mode
from tfarm.loop.lines import line_crossings
from tfarm.loop.margins import margins
from tfarm.loop.nyquist import nyquist_of
from tfarm.loop.plane import gain_map
from tfarm.loop.theorem import lyapunov
from tfarm.spectrum.gains import default_gains

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
    loop = loop_of(arm, HubFeedback(K1=default_gains(arm).K1))
    found = line_crossings(loop, "K2", -50.0, 50.0, frequency_above_mode(arm, 12))
    kept = (found.at > 0) & (abs(found.gain) < 1e6)
    order = np.argsort(found.at[kept])
    return found.gain[kept][order], found.at[kept][order]


@pytest.mark.parametrize(("r", "x"), [(0.0, 0.0), (0.05, 0.0), (0.2, 0.0), (0.0, 0.02), (0.0, 0.3)])
def test_closed_form_of_a_slender_cantilever(r, x):
    """K2_n = 1 + r k_n (cosh + cos)/(sinh + sin) of k_n L, or W''(0)/W''(x), of the clamped beam's modes."""
    slender = replace(with_radius(r, x), theory="euler-bernoulli", payload=Payload())
    kL, kx = CANTILEVER, CANTILEVER * x / ARM.link.length
    sigma = (np.cosh(kL) + np.cos(kL)) / (np.sinh(kL) + np.sin(kL))
    bending = (np.cosh(kx) + np.cos(kx) - sigma * (np.sinh(kx) + np.sin(kx))) / 2
    expected = (1 + r * kL / ARM.link.length * sigma) / bending
    assert edges_of(slender)[0][:4] == pytest.approx(expected, rel=DIFFERENCE)


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
    law = default_gains(arm).with_number("K2", 0.0)
    gains, _ = edges_of(arm)
    high = gains[gains > 0].min()
    inside = law.with_number("K2", 0.999 * high)
    found = margins(arm, inside)
    assert found.stability.word == "stable"
    assert not found.stability.is_known_beyond
    assert (found.exact_delay, found.exact_disk, found.exact_peak) == (None, None, None)
    assert found.windows["K1"].around[0] == 0.0
    assert found.windows["K2"].around[1] == pytest.approx(high, rel=DIFFERENCE)
    assert found.in_band.gain[1] == pytest.approx(high / inside.K2, rel=DIFFERENCE)
    assert nyquist_of(found.stability).unstable_by_nyquist == 0
    assert not lyapunov(loop_of(arm, inside)).proven
    assert verdict_of(arm, law.with_number("K2", 1.001 * high)).word == "unstable"
    plane = gain_map(arm, np.array([0.1, 1.0]) * law.K1, np.array([0.0, 0.5, 0.999, 1.001]) * high)
    assert plane.unstable.tolist() == [[n, n] for n in (0, 0, 0, 2)]
    ((low, top),) = plane.stable_intervals[-1]
    assert (low, top) == (0.0, pytest.approx(high, rel=DIFFERENCE))


def test_what_a_mode_far_above_the_band_does_is_not_determined():
    """A gauge near the root reads the 16th and higher modes with the other sign: K2 = -2 drives some, not those below.

    In the elements' terms that growth is 3e-13 of the frequency: below rounding.  Without a rate gain nothing decides.
    """
    verdict = verdict_of(with_radius(0.0, 0.02), HubFeedback(K1=0.3, K2=-2.0))
    assert (verdict.word, verdict.is_known_beyond) == ("stable", False)
    assert "not determined beyond" in verdict.tail
    verdict = verdict_of(with_radius(0.05), HubFeedback(K2=0.3))
    assert (verdict.word, verdict.is_known_beyond) == ("marginal", False)


def test_massless_hub_with_a_radius_is_refused():
    arm = replace(with_radius(0.05), hub=replace(ARM.hub, inertia=0.0, radius=0.05))
    assert "through infinity" in str(refusal(loop_of, arm, HubFeedback(K1=0.3, K2=0.3)))


ELASTIC = tfarm.load("sasaki2012")
LOSS = 0.5  # N m s/rad
ROOT = replace(ELASTIC, name="root", hub=Hub(inertia=ELASTIC.hub.inertia, friction=LOSS))
CLAMP = replace(ROOT, name="clamp", hub=replace(ROOT.hub, radius=0.06))  # whose gauge reads another moment than the hub
LAGGING = replace(
    ROOT,
    name="lagging",
    input="motor_voltage",
    motor=Motor(resistance=1.0, torque_constant=0.1, inductance=0.01, gear_ratio=10.0),
)


@pytest.mark.parametrize("arm", [ROOT, CLAMP], ids=lambda arm: arm.name)
@pytest.mark.parametrize("K2", thinned([-0.5, 0.3], 2))
def test_the_window_of_K1_ends_where_the_hub_loses_nothing(arm, K2):
    """Next to the end a finite-element model has each of the first six modes right or left of the axis."""
    windows = margins(arm, HubFeedback(K1=1.0, K2=K2)).windows["K1"]
    top = np.inf if arm is ROOT else windows.looked_at[1]  # no theorem on a gauge that reads another moment
    assert windows.all == ((-LOSS, top),)
    omega = tfarm.modes(arm, 10).natural_frequency
    loop = RigLoop(arm, omega[-1])
    for K1, side in ((-1.02 * LOSS, 1), (-0.98 * LOSS, -1), (1.0, -1)):
        s = loop.eigenvalues(HubFeedback(K1=K1, K2=K2))
        assert (np.sign(s.real[(abs(s) > 1e-3) & (abs(s) < omega[6])]) == side).all()
    assert verdict_of(arm, HubFeedback(K1=-LOSS, K2=K2)).word == "marginal"


@pytest.mark.parametrize("arm", [ROOT, CLAMP, LAGGING], ids=lambda arm: arm.name)
def test_the_map_agrees_with_the_verdict(arm):
    """Of finitely many unstable poles too: behind an inductance friction damps the modes that no gain reaches."""
    K1, K2 = np.array([-0.7, -0.3, 0.5]), np.array([0.3, 1.2, 10.5, 14.0])
    found = gain_map(arm, K1, K2)
    for row, b in enumerate(K2):
        for column, a in enumerate(K1):
            there, count = verdict_of(arm, HubFeedback(K1=float(a), K2=float(b))), found.unstable[row, column]
            assert bool(found.stable[row, column]) == there.is_stable
            assert (count == -1) == there.unstable_roots_infinite
            assert count in (-1, there.unstable_roots) or (
                arm is CLAMP and count > there.unstable_roots
            )  # of more modes


@pytest.mark.parametrize(
    ("seed", "damping"),
    [(1016, 0.0), (1243, 1.2e-5), (1297, 0.05), *(pytest.param(n, 0.0, marks=pytest.mark.survey) for n in (516, 261))],
)
def test_of_a_hub_without_inertia_nothing_below_its_losses_is_called_stable(seed, damping):
    """Behind a clamp that yields a real pole passes through infinity where K1 takes what the hub loses.

    With damping in the links no other pole is on the right: the map has none in its band, and is not stable.
    """
    arm = some_rig(np.random.default_rng(seed))
    arm = arm.with_numbers(damping=damping) if damping else arm
    assert arm.hub_side_inertia == 0 < arm.rate_loss
    b, unit = arm.rate_loss, abs(tfarm.default_gains(arm).K1)
    law = HubFeedback(K1=0.5 * unit, K2=0.3 * arm.input_per_torque)
    assert all(low >= -b for low, _ in margins(arm, law).windows["K1"].all)
    found = gain_map(arm, np.array([-b - 0.3 * unit, 0.5 * unit]), np.array([-1.3, 0.3]) * arm.input_per_torque)
    assert not found.stable[:, 0].any()
    s = tfarm.modes(arm, 12).natural_frequency[-1] * np.geomspace(1.0, 1e15, 61) + 0j
    L = loop_of(arm, law.with_number("K1", -3.0 * b)).loop_function(s)
    if not arm.clamp.damping:  # or else that is lost in the clamp too
        assert (1 + L).real.min() < 0 < (1 + L).real.max()  # it changes its sign: there is a real pole on the right
