"""What a hub loses beside an arm without losses is a rate gain: every mode turns where K1 makes up for it."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.rig_loops import RigLoop
from tests.rigs import some_rig
from tests.shared import thinned
from tfarm import Hub, HubFeedback
from tfarm.arm import Motor
from tfarm.loop.loop import Loop
from tfarm.loop.margins import margins
from tfarm.loop.plane import gain_map
from tfarm.loop.stability import stability

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
    """Not at ends torn by rounding: beside it elements have every mode of the first six right or left of the axis."""
    windows = margins(arm, HubFeedback(K1=1.0, K2=K2)).windows["K1"]
    top = np.inf if arm is ROOT else windows.looked_at[1]  # no theorem on a gauge that reads another moment
    assert windows.all == ((-LOSS, top),)
    omega = tfarm.modes(arm, 10).natural_frequency
    loop = RigLoop(arm, omega[-1])
    for K1, side in ((-1.02 * LOSS, 1), (-0.98 * LOSS, -1), (1.0, -1)):
        s = loop.eigenvalues(HubFeedback(K1=K1, K2=K2))
        assert (np.sign(s.real[(abs(s) > 1e-3) & (abs(s) < omega[6])]) == side).all()


@pytest.mark.parametrize("arm", [ROOT, CLAMP], ids=lambda arm: arm.name)
def test_where_nothing_is_lost_the_loop_is_marginal(arm):
    assert stability(arm, HubFeedback(K1=-LOSS, K2=0.3)).verdict == "marginal"


@pytest.mark.parametrize("arm", [ROOT, CLAMP, LAGGING], ids=lambda arm: arm.name)
def test_the_map_is_what_the_verdict_says(arm):
    """Of finitely many unstable poles too: behind an inductance friction damps the modes that no gain reaches."""
    K1, K2 = np.array([-0.7, -0.3, 0.5]), np.array([0.3, 1.2, 10.5, 14.0])
    found = gain_map(arm, K1, K2)
    for row, b in enumerate(K2):
        for column, a in enumerate(K1):
            there, count = stability(arm, HubFeedback(K1=float(a), K2=float(b))), found.unstable[row, column]
            assert bool(found.stable[row, column]) == there.is_stable
            assert (count == -1) == there.unstable_roots_infinite
            assert count in (-1, there.unstable_roots) or (
                arm is CLAMP and count > there.unstable_roots
            )  # of more modes


def test_the_gain_margin_is_where_elements_turn():
    """K1 < 0 that the friction outweighs: at b/|K1| every mode turns at once, before K2 does."""
    law = HubFeedback(K1=-0.2, K2=0.1, Kp=0.5)
    found = margins(ROOT, law).in_band.gain
    assert found[1] == pytest.approx(LOSS / 0.2, rel=1e-12)
    loop = RigLoop(ROOT, tfarm.modes(ROOT, 12).natural_frequency[-1])
    below, above = (loop.eigenvalues(HubFeedback(K1=-0.2 * t, K2=0.1 * t, Kp=0.5 * t)).real.max() for t in (2.49, 2.51))
    assert below < 0 < above


@pytest.mark.parametrize("seed", thinned([516, 261], 2))
def test_of_a_hub_without_inertia_nothing_below_its_losses_is_called_stable(seed):
    """Behind a clamp that yields a real pole passes through infinity where K1 takes what the hub loses."""
    arm = some_rig(np.random.default_rng(seed))
    assert arm.hub_side_inertia == 0 < arm.rate_loss
    b, unit = arm.rate_loss, abs(tfarm.default_gains(arm).K1)
    law = HubFeedback(K1=0.5 * unit, K2=0.3 * arm.input_per_torque)
    assert all(low >= -b for low, _ in margins(arm, law).windows["K1"].all)
    found = gain_map(arm, np.array([-b - 0.3 * unit, 0.5 * unit]), np.array([-1.3, 0.3]) * arm.input_per_torque)
    assert not found.stable[:, 0].any()
    s = tfarm.modes(arm, 12).natural_frequency[-1] * np.geomspace(1.0, 1e15, 61) + 0j
    L = Loop(arm, law.having("K1", -3.0 * b)).loop_function(s)
    if not arm.clamp.damping:  # or else that is lost in the clamp too
        assert (1 + L).real.min() < 0 < (1 + L).real.max()  # it changes its sign: there is a real pole on the right
