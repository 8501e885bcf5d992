"""Loops of rigs against a state-space model of finite elements (`rig_loops`): poles, counts, edges, samples."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import tfarm
from tests.chain_elements import reached
from tests.loop.arms import loop_of, verdict_of
from tests.loop.rig_loops import RigLoop
from tests.rigs import some_rig
from tests.shared import thinned
from tfarm import HubFeedback
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling
from tfarm.loop.continuous import frequency_above_mode
from tfarm.loop.plane import INFINITE, gain_map
from tfarm.loop.poles import closed_loop_poles, poles_below
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.windows import windows_of
from tfarm.spectrum.gains import default_gains, gain_unit

REAL = {name: tfarm.load(name) for name in ("quanser-2dsfl", "quanser-flexlink")}
REAL["bench-rig"] = tfarm.load(str(Path(__file__).parents[1] / "rigs" / "bench-rig.toml"))
SEEDS = (0, 2)
LAWS = ((0.5, 0.8, 0.0), (0.05, 1.5, 0.1), (0.05, -2.0, 0.1), (-0.05, 0.0, 0.0))  # K1, K2, Kp in the arm's units


def damped_rig(seed):
    """A rig that turns by a torque or through its motor."""
    rng = np.random.default_rng([21, seed])
    arm = some_rig(rng, damped=True, segments=int(rng.integers(1, 4)))
    return replace(arm, input="hub_torque") if arm.input == "hub_angle" else arm


SAMPLED = ((0.001, 0.3, True), (0.001, 1.3, False), (0.008, -0.6, False), (0.008, 1.05, True))  # s, K2
RIGS = REAL | {f"seed {seed}": damped_rig(seed) for seed in SEEDS}


def laws(arm):
    """The default law, and some that are not: strong, with too much moment, with too little, driving."""
    yield default_gains(arm)
    units = [gain_unit(arm, name) for name in ("K1", "K2", "Kp")]
    for shares in LAWS:
        K1, K2, Kp = (share * unit for share, unit in zip(shares, units, strict=True))
        yield HubFeedback(K1=K1, K2=0.0 if arm.has_massless_hub else K2, Kp=Kp)


@pytest.mark.parametrize("name", thinned(RIGS, 5))
def test_poles_are_those_of_the_elements_and_no_others(name):
    """Six poles of each loop: as many of the elements in the box, each where it is listed, and as many unstable."""
    arm = RIGS[name]
    found = [closed_loop_poles(arm, law, 6) for law in laws(arm)]
    corner = max(abs(complex(max(-poles.box.re_min, poles.box.re_max), poles.box.im_max)) for poles in found)
    model = RigLoop(arm, 1.05 * corner)
    for poles in found:
        theirs = model.eigenvalues(poles.loop.gains)
        theirs = theirs[poles.box.holds(theirs) & (abs(theirs) > 1e-6 * model.a)]
        upper = theirs[theirs.imag > -1e-9 * model.a]
        assert upper.size == poles.nonzero.size
        assert all(abs(upper - pole).min() < 1e-8 * abs(pole) for pole in poles.nonzero)
        assert int((theirs.real > 1e-9 * abs(theirs)).sum()) == poles.unstable


def test_no_bound_is_claimed_where_elastic_links_ring_beyond_the_band():
    """A voltage behind an inductance, C = 0: with K2 < 0 modes far above the band are driven, each by very little."""
    arm = REAL["quanser-flexlink"]
    law = default_gains(arm).with_number("K2", -0.015)
    verdict = verdict_of(arm, law)
    assert "not determined beyond" in verdict.tail
    beyond = poles_below(loop_of(arm, law), 3e4)
    driven = beyond.nonzero[beyond.nonzero.real > 1e-12 * abs(beyond.nonzero)]
    assert driven.size
    assert driven.imag.min() > verdict.band
    theirs = RigLoop(arm, 2.5e4).eigenvalues(law)
    first = driven[driven.imag.argmin()]
    assert abs(theirs - first).min() < 1e-9 * abs(first)


@pytest.mark.parametrize(("name", "gain"), thinned(product(RIGS, ("K1", "K2")), 5))
def test_at_an_edge_of_a_window_poles_of_the_elements_cross(name, gain):
    """Just inside none is unstable, just outside one or two are, at the crossing's frequency."""
    arm = RIGS[name]
    law = default_gains(arm)
    window = windows_of(verdict_of(arm, law), [gain])[gain]
    assert window.around is not None
    for edge in window.around:
        at = window.crossings.at[abs(window.crossings.gain - edge) <= 1e-6 * abs(edge)]  # of elastic links all at once
        if window.end(edge) != "edge" or at.min() > reached(arm, 30):
            continue  # no pole crosses there, or beyond what the elements have
        model, outwards = RigLoop(arm, max(reached(arm, 10), 1.5 * at.min())), np.sign(edge - law[gain])
        inside, outside = (law.with_number(gain, edge + sign * outwards * 1e-3 * abs(edge)) for sign in (-1, 1))
        assert model.unstable(inside) == 0
        moved = model.eigenvalues(outside)
        moved = moved[moved.real > 1e-12 * abs(moved)]
        assert moved.size
        assert (abs(abs(moved)[:, None] - at) < 1e-2 * (at + model.a)).any()


@pytest.mark.parametrize(("period", "K2", "stable"), thinned(SAMPLED, 4))
def test_the_sampled_loop_is_that_of_the_elements_under_a_hold(period, K2, stable):
    """The largest |z|, of the loop stable and not, the free angle's z = 1 apart."""
    arm = REAL["bench-rig"]
    law = default_gains(arm).with_number("K2", K2)
    verdict = sampled_verdict(Case(arm, law, Chain(sampling=Sampling(period=period))))
    z = RigLoop(arm, reached(arm, 8)).sampled(law, period)
    radius = np.log(abs(np.delete(z, abs(z - 1).argmin())).max())
    assert verdict.log_radius == pytest.approx(radius, rel=1e-5)
    assert verdict.is_stable is stable
    assert bool(radius < 0) is stable


@pytest.mark.parametrize("K2", [1.2, -0.5])
def test_more_than_the_whole_moment_drives_every_mode_behind_friction(K2):
    """Each higher band has as many more unstable poles as it has modes, two each; below the whole moment none."""
    arm = REAL["quanser-2dsfl"]
    law = default_gains(arm).with_number("K2", K2 * arm.input_per_torque)
    verdict = verdict_of(arm, law)
    driven = K2 > 1
    assert verdict.unstable_roots_infinite == driven
    assert verdict.is_known_beyond
    heights = [frequency_above_mode(arm, number) for number in (4, 8)]
    low, high = (poles_below(loop_of(arm, law), height).unstable for height in heights)
    assert high - low == 8 * driven
    plane = gain_map(
        arm, np.array([0.5, 1.0]) * law.K1, np.array([1.0, 1.01]) * law.K2 if driven else np.array([1.0, 0.9]) * law.K2
    )
    assert (plane.unstable == (INFINITE if driven else 0)).all()
