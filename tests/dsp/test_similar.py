"""The same sampled loop in other units of mass, length and time: windows, delay margin and poles of random rigs."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from tests.rigs import some_rig
from tests.shared import thinned
from tests.similar import EITHER
from tfarm import HubFeedback, modes
from tfarm.dsp import Chain, Sampling, delay_margin, sampled_loop, stable_windows
from tfarm.errors import ConvergenceError
from tfarm.spectrum.table import default_gains

STILL_RIG = (6, 28)  # held by a spring near its root: the hub's rate next to z = 1 is rounding


def some_sampled(seed):
    """A rig that turns under a law, gains about its own, and a clock about its first mode's period."""
    rng = np.random.default_rng(seed)
    rigs = (some_rig(rng) for _ in range(20))
    arm = next(arm for arm in rigs if arm.input != "hub_angle" and not arm.is_locked)
    usual = default_gains(arm)
    law = HubFeedback(K1=usual.K1 * float(10 ** rng.uniform(-1, 2)), K2=usual.K2 * float(rng.uniform(-2, 3)))
    T = float(rng.uniform(0.05, 2)) / float(modes(arm, 1).natural_frequency[-1])
    delay, corner = float(rng.choice([0, 0.4, 1.3])), float(rng.choice([np.inf, 2 / T]))
    return arm, law, Chain(sampling=Sampling(period=T, delay_samples=delay, antialias_corner=corner))


def answers(arm, law, chain, units):
    """Windows of K1 and K2 in units of those of the law, delay margin, poles in z; None where modes are not told."""
    try:
        loop = sampled_loop(arm, law, chain, count=6)
    except ConvergenceError:
        return None
    windows = [np.array(stable_windows(loop, name)) / units[name] for name in ("K1", "K2")]
    return windows, delay_margin(loop), loop.poles.z


SEEDS = [STILL_RIG, *((6, n) for n in range(24))]


@pytest.mark.parametrize(("seed", "units"), thinned(product(SEEDS, EITHER.values()), 27))
def test_a_sampled_loop_has_the_same_windows_delay_and_poles(seed, units):
    arm, law, chain = some_sampled(seed)
    sampling = chain.sampling
    other = replace(
        sampling, period=sampling.period * units.time, antialias_corner=sampling.antialias_corner / units.time
    )
    here = answers(arm, law, chain, HubFeedback(K1=1.0, K2=1.0))
    ones = units.law(arm, HubFeedback(K1=1.0, K2=1.0))
    there = answers(units.arm(arm), units.law(arm, law), replace(chain, sampling=other), ones)
    assert (here is None) == (there is None)
    if here is None:
        return
    for mine, theirs in zip(here[0], there[0], strict=True):
        np.testing.assert_allclose(theirs, mine, rtol=1e-6)
    assert there[1].samples == pytest.approx(here[1].samples, abs=1e-6)
    assert there[1].is_bound == here[1].is_bound
    assert abs(there[2][:, None] - here[2]).min(axis=1).max() < 1e-9


def test_an_arm_that_something_holds_has_its_whole_window():
    """By the poles on either side of both ends, and at gains in between."""
    arm, law, chain = some_sampled(STILL_RIG)
    loop = sampled_loop(arm, law, chain, count=6)
    ((low, high),) = stable_windows(loop, "K1")
    inside = low + (high - low) * np.array([1e-6, 0.1, 0.35, 0.6, 0.9, 1 - 1e-6])
    assert all(loop.having(K1=float(K1)).poles.is_stable for K1 in inside)
    for K1 in (low - 1e-6 * (high - low), high + 1e-6 * (high - low)):
        assert not loop.having(K1=float(K1)).poles.is_stable
