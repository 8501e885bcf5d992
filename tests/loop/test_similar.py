"""The same loop in other units of mass, length and time: no answer may compare a quantity with a plain number."""

import math

import numpy as np
import pytest

import tfarm
from tests.loop.test_lossless import CLAMP
from tests.rigs import some_rig
from tests.shared import thinned
from tests.similar import EITHER
from tfarm import HubFeedback, Law
from tfarm.case import Case
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.margins import margins
from tfarm.loop.plane import gain_map
from tfarm.loop.poles import Poles
from tfarm.loop.stability import Stability
from tfarm.spectrum.box import Box
from tfarm.spectrum.table import default_gains

LAB = tfarm.load("sasaki2012-lab")
LEAD = {"hub_angle": ([3.0, 20.0], [0.002, 1.0]), "root_moment": ([0.2], [1e-4, 2e-2, 1.0])}  # num and den in s
POWERS = {"phase": 0, "phase_lag": 0, "phase_lead": 0, "delay": 1, "disk": 0, "peak_sensitivity": 0}
POWERS |= {"peak_complementary": 0}
TOLD = ("word", "unstable_roots")


def digits(*numbers):
    """How many significant digits the shortest of them is written with."""
    return min(len(repr(abs(each)).split("e")[0].replace(".", "").strip("0")) for each in numbers)


def agree(here, there, unit=1.0):
    """Whether two numbers are one, to the digits that the shorter is given with."""
    shown = digits(here, there)
    return here * unit == there or abs(here * unit - there) <= 3 * 10.0 ** (1 - shown) * abs(there)


def close(here, there, rel):
    """Whether arrays are of one shape and size."""
    here, there = np.asarray(here, dtype=float), np.asarray(there, dtype=float)
    return here.shape == there.shape and np.allclose(there, here, rtol=rel, atol=0.0)


def apart(here, there, units):
    """Which margins (`LoopMargins`) of a loop and of the same in other units are not the same."""
    time = units.time
    same = {name: agree(getattr(here, name), getattr(there, name), time**power) for name, power in POWERS.items()}
    same |= {f"at {name}": close(here.at[name], there.at[name] * time, 1e-5) for name in POWERS}
    same["gain"] = close(here.gain, there.gain, 1e-7)
    for name in ("gain_crossovers", "phase_crossovers"):
        mine, theirs = (np.array(getattr(each, name)).reshape(-1, 2) for each in (here, there))
        same[name] = close(mine[:, 0], theirs[:, 0] * time, 1e-9)
        same[name] &= all(agree(*pair) for pair in zip(mine[:, 1].tolist(), theirs[:, 1].tolist(), strict=False))
    return [name for name, is_one in same.items() if not is_one]


def differing(arm, law, units):
    """What is not the same of verdict, windows and margins of the loop and of that in other units."""
    here, there = margins(arm, law), margins(units.arm(arm), units.law(arm, law))
    same = {name: getattr(here.stability, name) == getattr(there.stability, name) for name in TOLD}
    for name, windows in here.windows.items():
        unit = units.law(arm, HubFeedback(**{name: 1.0}))[name]
        same[f"windows of {name}"] = close(np.multiply(windows.all, unit), there.windows[name].all, 1e-5)
    same["margins"] = (there.in_band is None) == (here.in_band is None)
    found = [name for name, is_one in same.items() if not is_one]
    return found if found or here.in_band is None else apart(here.in_band, there.in_band, units)


@pytest.mark.parametrize("seed", thinned(range(16), 8))
def test_random_rigs_have_the_same_margins(seed):
    """Where poles are too narrow for doubles too: fewer digits are given then, and no crossing that is a pole."""
    rng = np.random.default_rng([41, seed])
    rigs = (some_rig(rng) for _ in range(20))
    arm = next(arm for arm in rigs if arm.input != "hub_angle" and not arm.is_locked)
    unit = default_gains(arm)
    law = HubFeedback(K1=unit.K1 * float(10 ** rng.uniform(-1, 3)), K2=unit.K2 * float(rng.uniform(-3, 3)))
    assert differing(arm, law, EITHER["slow" if seed % 2 else "fast"]) == []


@pytest.mark.parametrize("units", EITHER.values(), ids=EITHER)
@pytest.mark.parametrize("arm", [LAB, CLAMP], ids=lambda arm: arm.name)
def test_a_map_has_the_same_counts(arm, units):
    K1, K2 = np.linspace(-1.03, 2, 7), np.linspace(-2.04, 2, 8)
    here = gain_map(arm, K1, K2)
    unit = units.law(arm, HubFeedback(K1=1.0, K2=1.0))
    there = gain_map(units.arm(arm), K1 * unit.K1, K2 * unit.K2)
    np.testing.assert_array_equal(there.unstable, here.unstable)
    np.testing.assert_allclose(there.boundary[:, 0], here.boundary[:, 0] * unit.K1, rtol=1e-6)


@pytest.mark.parametrize("name", thinned(EITHER, 2))
def test_a_law_with_dynamics_has_the_same_margins(name):
    units = EITHER[name]
    other, law = units.arm(LAB), units.law(LAB, LEAD)
    here, there = tfarm.margins(LAB, tfarm.Law(LEAD)), tfarm.margins(other, law)
    assert there.stability.word == here.stability.word == "stable"
    assert apart(here.in_band, there.in_band, units) == []
    here, there = tfarm.closed_loop_poles(LAB, tfarm.Law(LEAD), 9), tfarm.closed_loop_poles(other, law, 9)
    np.testing.assert_allclose(there.values * units.time, here.values, rtol=1e-9)


BARE = tfarm.load("sasaki2012")


def test_a_slow_pair_is_no_real_pole_to_a_locus():
    """Under next to no stiffness an arm swings as a rigid one, at 2e-4 rad/s."""
    w, ratio = 2e-4, 0.1
    law = Law({"hub_angle": w * w * LAB.total_inertia, "hub_rate": 2 * ratio * w * LAB.total_inertia})
    found = tfarm.locus(LAB, law, "gain", 0.5, 1.0, points=3, branches=1).branches[:, -1]
    slow = found[abs(found) < 1e-3]
    np.testing.assert_allclose(slow, [w * complex(-ratio, math.sqrt(1 - ratio**2))], rtol=1e-4)


def test_without_losses_no_law_is_quiet_however_little_it_feeds_back(monkeypatch):
    """At each of its modes |L| is infinite, though between them it is 1e-12: exact margins are not reported."""
    monkeypatch.setattr("tfarm.loop.margins.windows_of", lambda _: {})  # which take longest
    found = tfarm.margins(BARE, Law({"hub_rate": ([1e-12, 1e-12], [1.0, 2.0])}), band=1000.0)
    assert found.stability.is_stable
    assert found.in_band is not None
    assert (found.exact_delay, found.exact_disk, found.exact_peak) == (None, None, None)


def test_models_that_nothing_damps_are_not_unstable_by_rounding():
    """Their poles are at up to 6e4 rad/s, and right of the axis by some last digits."""
    arm = tfarm.load("stocky-steel").having(damping=0.0)
    found = tfarm.spill(arm, Law({"hub_angle": 1.0, "root_moment": 0.3}), 4)
    assert found.rightmost.real.max() > 0
    assert found.unstable.tolist() == [0] * 4
    assert found.driven.size == 0


def test_margins_look_at_what_is_narrow_in_the_law_itself():
    """A notch a ten-millionth wide."""
    w, ratio = 40.0, 1e-7
    law = Law({"hub_rate": ([0.3, 0.0, 0.3 * w * w], [1.0, 2 * ratio * w, w * w])})
    loop = ContinuousLoop(Case(LAB, law))
    poles = Poles(loop, np.empty(0, complex), Box(-100.0, 10.0, -100.0, 100.0))
    omega = Stability(loop, "stable", 0, False, 100.0, "", poles).frequencies
    assert (abs(omega - w) <= 2 * ratio * w).sum() > 5
