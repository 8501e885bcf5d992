"""A "settled" verdict is proven in its band: loops that eight and sixteen modes both make stable."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

import tfarm
from tests.loop.settled import HoldModel, hurting, ordinary
from tests.shared import thinned
from tests.survey import each_of, tally
from tfarm.arm import FED_BACK, Arm, Hub, HubFeedback, Link, Section
from tfarm.case import Case
from tfarm.dsp import Chain, Sampling
from tfarm.loop.circle import Circle, complete_band
from tfarm.loop.circle_crossings import stable_windows
from tfarm.loop.edges import shown_windows, whole_loop
from tfarm.loop.left_poles import bound_left_of
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.spectrum import modes
from tfarm.spectrum.box import TOWARD_SINGULAR
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
RINGING = replace(LIGHT, link=replace(LIGHT.link, damping=1e-6))  # no mode that matters at 10 ms is overdamped
CASES = {
    "light hub": (LIGHT, HubFeedback(K1=0.1, K2=0.6), Chain(sampling=Sampling(period=9e-5, delay_samples=0.5))),
    "free pin": (PIN, HubFeedback(K1=33.0, K2=0.0), Chain(sampling=Sampling(period=7.4e-5, delay_samples=1.0))),
}


@pytest.mark.parametrize("name", thinned(CASES, 2))
def test_modes_beyond_the_sixteenth_can_be_the_unstable_ones(name):
    """Sixteen modes are stable, forty are not; verdict and an independent hold model agree."""
    arm, gains, chain = CASES[name]
    assert sampled_loop(Case(arm, gains, chain), count=16).poles.is_stable
    verdict = sampled_verdict(Case(arm, gains, chain))
    assert verdict.is_settled
    assert not verdict.is_stable
    assert verdict.sentence.startswith("unstable (certified ")
    assert f"up to {verdict.band_rad_s:.3g} rad/s, not determined beyond" in verdict.sentence
    coarse, fine = (HoldModel(arm, terms).log_radius(gains, chain) for terms in (80, 100))
    assert min(coarse, fine) > 1e-3
    assert verdict.loop.poles.log_spectral_radius == pytest.approx(fine, abs=4 * abs(fine - coarse))


def test_an_edge_has_the_digits_that_more_modes_leave():
    """Sixteen modes put the edge of K1 at 0.62; it is near 0.50.  Unproven it has no digit."""
    gains, chain = HubFeedback(K1=0.1, K2=0.3), Chain(sampling=Sampling(period=9e-5))
    loop, band = sampled_loop(Case(LIGHT, gains, chain), count=16), complete_band(whole_loop(Case(LIGHT, gains, chain)))
    assert stable_windows(loop, "K1")[0][1] > 0.6
    ((low, high),) = shown_windows(loop, band, "K1")
    assert (low.text, low.is_settled, high.band) == ("0", True, band.top)
    half, model = 0.5 * 10.0**-high.digits, HoldModel(LIGHT, 140)
    sides = [model.log_radius(replace(gains, K1=float(high.text) + way * half), chain) for way in (-1, 1)]
    assert sides[0] < 0 < sides[1]
    ((_, alone),) = shown_windows(loop, None, "K1")
    assert (alone.is_settled, alone.modes, alone.digits <= 1) == (False, 16, True)


def test_the_band_holds_every_pole_of_twice_as_many_modes_there():
    """Below its top and right of its line no other of twice as many modes."""
    loop = whole_loop(Case(RINGING, HubFeedback(K1=0.3, K2=0.3), Chain()))
    band, found = complete_band(loop), loop.plant.poles
    line, zeros = -found.real[complete_band(loop).kept].min(), damped_modes(modes(RINGING, 60)).eigenvalues.ravel()
    inside = zeros[(abs(zeros.imag) < band.top) & (zeros.real >= -line) & (zeros != 0)]
    assert inside.size == band.kept.sum() >= 20
    assert max(abs(found[band.kept] - zero).min() / abs(zero) for zero in inside) < 1e-9


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.7])
def test_poles_left_of_the_line_weigh_no_more_than_the_bound(delay):
    """Pulse transfer functions of the band's poles, and those of sixty modes, on the circle."""
    gains, chain = HubFeedback(K1=0.3, K2=0.3), Chain(sampling=Sampling(delay_samples=delay))
    case = Case(RINGING, gains, chain)
    band, many = complete_band(whole_loop(case)), sampled_loop(case, count=60)
    circle = band.circle
    z = np.exp(0.5j * (circle.low + circle.high))
    F = circle.characteristic(band.loop.weights).middle / (1 - 1 / z)  # of K1, whose plant has a simple pole at z = 1
    bound = gains.K1 * band.missing[1] + gains.K2 * band.missing[2]
    assert np.all(abs(F - many(z)) <= bound + 1e-9 * abs(F))


@pytest.mark.parametrize("coarser", [1, 10])
def test_the_count_does_not_depend_on_the_arcs_to_begin_with(lab, coarser):
    """Resonances narrower than 1e-6 rad between the ends of arcs: these are halved until they are seen."""
    slightly = replace(lab, link=replace(lab.link, damping=1e-12))
    loop = sampled_loop(Case(slightly, HubFeedback(K1=0.3, K2=0.3)), count=14)
    band = complete_band(loop)
    circle = Circle(band.loop, band.kept, band.missing, 64 // coarser)
    for K2 in (0.3, -0.05, 1.3):
        other = loop.with_number("K1", 0.3).with_number("K2", K2)
        assert circle.count(other.weights) == (other.poles.log_radius > 0).sum()


@pytest.mark.parametrize(
    ("K1", "K2", "Kp"),
    [(0.3, 0.3, 0.0), (-0.3, 0.1, 0.0), (-0.3, 0.0, 0.0), (0.3, 0.3, -2.0), (1.0, -1.0, -1.0), (30.0, 0.0, 0.0)],
)
def test_the_count_is_that_of_the_eigenvalues_outside_odd_ones_too(lab, K1, K2, Kp):
    """An odd number of them: F begins or ends on the negative real axis, and its turn is none of whole turns."""
    loop = sampled_loop(Case(lab, HubFeedback(K1=K1, K2=K2, Kp=Kp), Chain()))
    outside = abs(np.linalg.eigvals(loop.reduced_matrix())) > 1 + 1e-9
    assert complete_band(loop).circle.count(loop.weights) == outside.sum()


@pytest.mark.parametrize(("damping", "K2", "off"), thinned([(0.3, 0.3, 1e-5), (0.3, 1.5, 1e-5), (12.0, 0.3, 0.05)], 3))
def test_far_beyond_critical_one_mode_shows_what_a_hold_model_does(lab, damping, K2, off):
    """Eleven and 429 times critical in the first mode: its slow pole, and the remainder near -1/C."""
    arm, gains = lab.with_numbers(damping=damping), HubFeedback(K1=0.3, K2=K2)
    verdict = sampled_verdict(Case(arm, gains))
    assert (verdict.modes_used, verdict.is_stable) == (1, K2 < 1)
    assert verdict.loop.poles.log_spectral_radius == pytest.approx(HoldModel(arm, 30).log_radius(gains, Chain()), off)


@pytest.mark.parametrize("K2", [0.3, 1.3])
@pytest.mark.parametrize("counted", ["as they are", "not", "otherwise"])
def test_only_a_count_on_the_circle_that_the_poles_agree_with_settles(lab, K2, counted, monkeypatch):
    """Stable and unstable: none to be had, or one of the other kind, settles nothing, and the poles speak."""
    gains = HubFeedback(K1=0.3, K2=K2)
    there = int((abs(sampled_loop(Case(lab, gains)).eigenvalues) > 1).sum())
    count = {"as they are": there, "not": None, "otherwise": 0 if there else 1}[counted]
    monkeypatch.setattr(Circle, "count", lambda circle, weights: count)
    verdict = sampled_verdict(Case(lab, gains))
    assert verdict.is_settled is (counted == "as they are")
    assert verdict.is_stable is (there == 0)


@pytest.mark.parametrize(("draw", "size"), [(hurting, 1), (ordinary, 4)])
def test_a_small_survey(draw, size):
    """Of `python -m tests.loop.settled 2000`."""
    outcomes, _, wrong = tally(each_of(draw), size, 3)
    assert wrong == 0
    assert outcomes["settled stable"] + outcomes["settled unstable"] == size


def test_what_is_left_of_the_line_is_bounded_by_the_integrals_of_both_edges():
    """Up the line and along the level one to where nothing outlives a sample, by SciPy's quadrature."""
    lab = tfarm.load("sasaki2012-lab")
    chain = Chain(sampling=Sampling(period=0.01, delay_samples=0.4, antialias_corner=200.0))
    loop, line, top = sampled_loop(Case(lab, HubFeedback(K1=0.3, K2=0.3), chain), count=8), 100.0, 120.0
    T, remaining = 0.01, 0.01 * (1 - loop.chain.sampling.fraction)
    G = tfarm.transfer(lab, "root_moment")
    row = FED_BACK.index("root_moment")

    def size(s):
        filtered = G(s) * 200.0 / (s + 200.0) if loop.rig.analog[row] else G(s)
        return abs(filtered / s) * math.exp(s.real * remaining) / (1 - math.exp(s.real * T))

    up, _ = quad(lambda w: size(complex(-line, w)), 0.0, top, limit=400)
    away, _ = quad(lambda c: size(complex(-c, top)), line, line + 45.0 / remaining, limit=400)
    found = bound_left_of(loop, line, top)[row]
    assert 1.0 <= found / ((up + away) * 2 / np.pi) <= 1.4


def test_with_much_damping_the_band_extends_to_the_shear_waves():
    """Much damping leaves four modes of bending; what oscillates above them dies within a sample."""
    arm = tfarm.load("sasaki2012-lab").with_numbers(damping=1e-3)
    loop = sampled_loop(Case(arm, HubFeedback(K1=0.3, K2=0.3)), count=4)
    found, highest = complete_band(loop), loop.plant.poles.imag.max()
    assert found.top > 100 * highest
    others = sampled_loop(Case(arm, HubFeedback(K1=0.3, K2=0.3)), count=12).plant.poles
    others = others[(others.imag > 1.01 * highest) & (others.imag < found.top)]
    assert others.size
    assert others.real.max() < -TOWARD_SINGULAR / arm.damping  # left of the line: they are gone within a sample
    few = complete_band(sampled_loop(Case(tfarm.load("sasaki2012-lab"), HubFeedback(K1=0.3, K2=0.3)), count=8))
    assert few.top == pytest.approx(1.02 * few.loop.plant.poles.imag.max(), rel=1e-12)  # the ninth is not far
