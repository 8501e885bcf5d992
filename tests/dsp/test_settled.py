"""A verdict that says "settled" is proven in its band: loops that eight and sixteen modes agree to call stable."""

from dataclasses import replace

import numpy as np
import pytest

from tests.dsp.hold import HoldModel
from tests.dsp.settled import survey
from tfarm.arm import Arm, Hub, HubFeedback, Link, Section
from tfarm.dsp import Chain, Sampling, analyse, sampled_loop, sampled_verdict
from tfarm.dsp.band import band_of
from tfarm.dsp.verdict import sampled_answer
from tfarm.spectrum import modes
from tfarm.spectrum.damped import damped_modes


def arm_of(link, inertia, damping, **section):
    shape = Section.rectangle(**section)
    return Arm(link=Link(section=shape, damping=damping, density=2700, **link), hub=Hub(inertia=inertia))


LIGHT = arm_of(
    {"length": 1.0, "youngs_modulus": 7.0e10, "shear_modulus": 2.6e10},
    4.5e-5, 8.8e-8, width=0.05, depth=0.01, shear_factor=0.8333333333333334,
)  # fmt: skip
PIN = arm_of(
    {"length": 3.0, "youngs_modulus": 7.0e10, "shear_modulus": 7.0e10 / 2.6}, 0.0, 2.65e-6, width=0.06, depth=0.03
)
CASES = {
    "light hub": (LIGHT, HubFeedback(K1=0.1, K2=0.6), Chain(sampling=Sampling(period=9e-5, delay_samples=0.5))),
    "free pin": (PIN, HubFeedback(K1=33.0, K2=0.0), Chain(sampling=Sampling(period=7.4e-5, delay_samples=1.0))),
}


@pytest.mark.parametrize("name", CASES)
def test_modes_beyond_the_sixteenth_can_be_the_unstable_ones(name):
    """Sixteen modes are stable, forty are not; the verdict says so, and so does a hold model that shares no code."""
    arm, gains, chain = CASES[name]
    assert sampled_loop(arm, gains, chain, count=16).poles.is_stable
    verdict = sampled_verdict(arm, gains, chain)
    assert verdict.is_settled
    assert not verdict.is_stable
    assert verdict.sentence.startswith("unstable: mode ")
    assert f"below {verdict.band_rad_s:.3g} rad/s, not known beyond" in verdict.sentence
    assert HoldModel(arm, 60).log_radius(gains, chain) > 1e-3


def test_the_growth_is_that_of_a_hold_model():
    """The hold model with 60, 80 and 100 polynomials: the last difference bounds what it has still to go."""
    arm, gains, chain = CASES["light hub"]
    *_, coarse, fine = (HoldModel(arm, terms).log_radius(gains, chain) for terms in (60, 80, 100))
    poles = sampled_verdict(arm, gains, chain).loop.poles
    assert poles.log_spectral_radius == pytest.approx(fine, abs=4 * abs(fine - coarse))


def test_an_edge_has_the_digits_that_more_modes_leave():
    """Sixteen modes see the edge of K1 at 0.62; it is near 0.50, and both ends of what is shown are what it says."""
    arm, gains, chain = LIGHT, HubFeedback(K1=0.1, K2=0.3), Chain(sampling=Sampling(period=9e-5))
    answer = sampled_answer(analyse(arm, gains, chain))
    ((low, high),) = answer["shown"]["K1_intervals"]
    assert low["text"] == "0"
    assert low["settled"]
    assert high["settled"]
    assert 0.49 < float(high["text"]) < 0.52
    half = 0.5 * 10.0 ** -high["digits"]
    model = HoldModel(arm)
    assert model.log_radius(replace(gains, K1=float(high["text"]) - half), chain) < 0
    assert model.log_radius(replace(gains, K1=float(high["text"]) + half), chain) > 0
    assert answer["band_rad_s"] == high["band_rad_s"]


def test_the_band_holds_every_pole_that_the_continuation_finds_there(lab):
    """Twelve modes of the lab arm, and no other of the first forty below the top and right of the line."""
    loop = sampled_loop(lab, HubFeedback(K1=0.3, K2=0.3), count=12)
    band = band_of(loop)
    line = -loop.plant.poles.real[band.kept].min()
    for zero in damped_modes(modes(lab, 40)).eigenvalues.ravel():
        if abs(zero.imag) < band.top and -line <= zero.real < 0:
            assert min(abs(loop.plant.poles[band.kept] - zero)) < 1e-9 * abs(zero)
    assert band.top > 10 * modes(lab, 12).natural_frequency[-1]


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.7])
def test_what_is_left_of_the_line_weighs_no_more_than_is_said(lab, delay):
    """Pulse transfer functions of the band's poles, and of three times as many modes, on the circle."""
    chain = Chain(sampling=Sampling(period=1e-3, delay_samples=delay))
    few, many = (sampled_loop(lab, HubFeedback(K1=0.3, K2=0.3), chain, count=n) for n in (24, 40))
    band = band_of(few)
    circle = band.circle()
    z = np.exp(0.5j * (circle.low + circle.high))
    F = circle._characteristic(few.gains).middle / (1 - 1 / z)  # of K1, whose plant has a simple pole at z = 1
    bound = abs(few.gains.K1) * band.missing[1] + abs(few.gains.K2) * band.missing[2]
    assert np.all(abs(F - many(z)) <= bound + 1e-9 * abs(F))


@pytest.mark.parametrize("coarser", [1, 10])
def test_the_count_does_not_depend_on_the_arcs_to_begin_with(lab, coarser, monkeypatch):
    """Resonances narrower than 1e-6 rad between the ends of arcs: these are halved until they are seen."""
    monkeypatch.setattr("tfarm.dsp.circle.ARCS", 64 // coarser)
    slightly = replace(lab, link=replace(lab.link, damping=1e-12))
    for K2 in (0.3, -0.05, 1.3):
        loop = sampled_loop(slightly, HubFeedback(K1=0.3, K2=K2), count=14)
        assert band_of(loop).circle().count(loop.gains) == (loop.poles.log_radius > 0).sum()


def test_without_damping_nothing_is_settled(lossless):
    for K2 in (0.3, 2.0):
        verdict = sampled_verdict(lossless, HubFeedback(K1=0.3, K2=K2))
        assert not verdict.is_settled
        assert verdict.band_rad_s is None
        assert "holds for the first 20 modes" in verdict.sentence


def test_a_small_survey():
    """Of `python -m tests.dsp.settled 2000`."""
    counts = survey(6, seed=3)
    assert counts["false"] == 0
    assert counts["settled"] >= 1
