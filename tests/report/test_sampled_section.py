"""The sampled loop on the page: drawn numbers are those of the rooms, verdicts name their modes, same bytes."""

import io
import math
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import tfarm
from tests.report.written import blocks_of, values_of
from tfarm.arm import HubFeedback
from tfarm.arm.chain import Converters, Sampling
from tfarm.case import Case
from tfarm.digits import kept_digits
from tfarm.dsp import Chain, Simulator, scenario
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.stability import stability
from tfarm.loop.windows import windows_of
from tfarm.plots.regions import gain_regions
from tfarm.report import sampled_section as page
from tfarm.report.blocks import prose, save_block
from tfarm.report.page import FILM_FRAMES, ArmReport, GivenLaw
from tfarm.report.sampled_section import sampled_section, slews
from tfarm.schema import text
from tfarm.spectrum.gains import default_gains
from tfarm.synthesis.stability_map import CUT_RANGE, K2_RANGE, stable_regions

LAB, PAPER = tfarm.load("sasaki2012-lab"), tfarm.load("sasaki2012")
GAINS = HubFeedback(K1=0.3, K2=0.3)
PLANE = cache(lambda: stable_regions(Case(LAB, GAINS)))
analysed = cache(tfarm.sampled)
DRAWN_DIGITS = 7  # of the numbers of a picture


@pytest.fixture(scope="module")
def section():
    return sampled_section(ArmReport(LAB, Chain()))


def windows(arm, gains=GAINS):
    return windows_of(stability(Case(arm, gains)), ["K2"])["K2"]


# ------------------------------------------------------------ the overlay


def test_the_picture_of_a_rig_is_as_high_as_its_own_gains():
    """Driven by its motor's current, K2 balances a torque at 0.112 A/(N m), and not at 1."""
    rig = tfarm.load("quanser-2dsfl")
    data = stable_regions(Case(rig, default_gains(rig)))
    low, high = gain_regions.figure(*data).axes[0].get_ylim()
    assert 0.112 < high < 0.2
    *_, sampled = data.sampled
    ((bottom, top),) = sampled.stable_intervals[0]
    assert top - bottom > 0.4 * (high - low)
    assert low < bottom < top < high


def test_the_map_of_both_regions_is_that_of_the_poles():
    data = PLANE()
    random = np.random.default_rng(5)
    loop = sampled_loop(Case(LAB, GAINS, Chain()), count=16)
    for i in random.integers(0, data.continuous.K1.size, 6):
        K1 = float(data.continuous.K1[i])
        for K2 in random.uniform(*K2_RANGE, 2):
            regions = (data.continuous, *data.sampled)
            inside = [any(a < K2 < b for a, b in each.stable_intervals[i]) for each in regions]
            law = tfarm.HubFeedback(K1=K1, K2=float(K2))
            assert inside == [
                stability(Case(LAB, law)).is_stable,
                loop.with_number("K1", K1).with_number("K2", float(K2)).poles.is_stable,
            ]


def test_without_damping_the_layers_are_nested_and_name_their_number_of_modes():
    data = stable_regions(Case(PAPER, GAINS))
    assert [layer.loop.plant.arm.damping for layer in data.sampled] == [1e-4, 1e-6, 0.0]
    assert data.sampled[-1].modes_used == 20
    assert all(column == [(CUT_RANGE[0], 1.0)] for column in data.continuous.stable_intervals)
    i = int(np.searchsorted(data.continuous.K1, 0.3))
    widths = [sum(b - a for a, b in layer.stable_intervals[i]) for layer in data.sampled]
    assert widths[0] > widths[1] > 1.1
    assert widths[2] < 0.05  # C = 0: a sliver


# ------------------------------------------------------------ words and tables


def test_facts_and_words_are_the_analysis(section):
    analysis = analysed(LAB, GAINS, Chain())
    slew = tfarm.simulate(LAB, GAINS, duration=3.0)
    continuous, sampled = (each.tip for each in tfarm.step(LAB, GAINS, Chain(), "slew").loops.values())
    assert [(fact.label, fact.value, fact.unit) for fact in section.facts] == [
        ("K1, sampled, 10 ms", text(analysis.shown["K1"], 4), "N m s/rad"),
        ("K2, sampled, 10 ms", "(-0.1526, 1.16388)", ""),
        ("settling time of the root moment", f"{slew.settling_time:.4g}", "s"),
        ("settling time of the tip after the slew, continuous-time", f"{continuous.settling_time:.4g}", "s"),
        ("settling time of the tip after the slew, sampled", f"{sampled.settling_time:.4g}", "s"),
    ]
    residuals = [f"residual {1e3 * of.residual_rms:.3g} mm rms" for of in (continuous, sampled)]
    assert [fact.note for fact in section.facts[-2:]] == residuals
    assert "stable for K2 in (< -50, 1.031), the sampled one for K2 in (-0.1526, 1.16388)" in section.blocks[0].caption


def test_a_slew_that_does_not_settle_has_no_settling_time(section):
    run = SimpleNamespace(settling_time=None, t=np.array([0.0, 3.0]), stopped=None)
    fact = page.settling_fact(SimpleNamespace(name="PD"), run, True)
    assert fact[:3] == ("settling time of the root moment, PD", "not settled within 3.000", "s")
    lost = tfarm.simulate(LAB, HubFeedback(K1=0.3, K2=3.0), duration=3.0)
    assert page.settling_fact(SimpleNamespace(name="PD"), lost, False)[:2] == (
        "settling time of the root moment",
        "unstable",
    )


def test_at_zero_damping_a_little_more_than_the_least_that_is_needed_is_stable():
    """By the poles."""
    found = tfarm.sampled(PAPER, GAINS)
    assert found.verdict.slowest == "mode 13"
    assert f"{found.minimum_damping.value:.4g}" == "1.004e-14"
    healed = replace(PAPER, link=replace(PAPER.link, damping=1.01e-14))
    assert sampled_loop(Case(healed, GAINS, Chain()), count=20).poles.is_stable


def test_every_part_of_a_chain_is_named():
    own = Chain(sampling=Sampling(period=0.004, delay_samples=0.5), converters=Converters(hub_rate="difference"))
    words = page.chain_words(LAB, own)
    assert "every 4 ms, 0.5 samples of delay" in words
    assert "differenced" in words
    assert "the paper's" in page.chain_words(LAB, Chain())


# ------------------------------------------------------------ loci and time


def test_the_slew_is_the_simulators_own(section):
    """Without the feedback of the root moment, and with it."""
    drawn = values_of(blocks_of(section)["sampled-slew"].data)
    simulator = Simulator(Case(LAB, HubFeedback(), Chain()), scenario("slew", LAB, Chain(), 3.0), count=20)
    for key, K2 in (("without", 0.0), ("default", 0.3)):
        expected = simulator.linear(HubFeedback(K1=0.3, K2=K2))
        for name, signal in (("torque", expected.torque), ("root_moment", expected.at_samples.root_moment)):
            at_samples = np.isin(*(kept_digits(t, DRAWN_DIGITS) for t in (drawn["t_s"], expected.t)))
            shown = np.array(drawn[f"{name}_{key}_N_m"])[at_samples]
            half_a_digit = 0.5 * 10.0 ** (1 - DRAWN_DIGITS)  # of a number that begins with 1
            assert abs(shown - signal).max() < half_a_digit * abs(signal).max()


def test_the_film_is_of_the_slew_under_the_controller_and_moves_only_where_that_is_wanted(section, tmp_path):
    """Its still is the SVG, which a page has where motion is not wanted, and in print."""
    shown = blocks_of(section)["slew-film"]
    gif = Image.open(io.BytesIO(shown.film))
    assert gif.n_frames == 1 + FILM_FRAMES
    run = tfarm.simulate(LAB, GAINS, duration=1.5, count=20, between=4)
    link = shown.figure.axes[0].lines[1].get_xydata() @ [1, 1j]
    bent = math.sqrt(abs(link[-1]) ** 2 - LAB.reach**2)
    tip = abs(run.between.tip_displacement - LAB.reach * run.between.hub_angle).max()
    assert bent == pytest.approx(5 * tip, rel=0.02)
    for name in ("pictures", "data"):
        (tmp_path / name).mkdir()
    words = str(save_block(shown, tmp_path).html)
    still = '<picture><source media="(prefers-reduced-motion: reduce), print" srcset="pictures/slew-film.svg">'
    assert f'{still}<img src="pictures/slew-film.gif" loading="lazy"' in words
    assert (tmp_path / "pictures" / "slew-film.gif").read_bytes() == shown.film
    assert (tmp_path / "pictures" / "slew-film.svg").stat().st_size > 1_000


def test_a_loop_that_diverges_has_no_film():
    pictures, _, _ = slews(ArmReport(LAB, Chain(), (GivenLaw(HubFeedback(K1=0.3, K2=3.0)),)))
    assert [each.stem for each in pictures] == ["sampled-slew", "sampled-slew-numbers"]


# ------------------------------------------------------------ bytes and odd arms


def test_a_held_tip_has_a_map_but_no_slew():
    section = sampled_section(ArmReport(replace(LAB, payload=tfarm.Payload(mass=math.inf)), Chain()))
    assert "no slew" in section.words[-1]
    assert "sampled-overlay" in blocks_of(section)
    assert "sampled-slew" not in blocks_of(section)


def test_an_arm_on_springs_is_not_held_at_its_tip():
    sprung = replace(LAB, hub=replace(LAB.hub, stiffness=3.0))
    pinned = replace(sprung, payload=replace(LAB.payload, mass=np.inf))
    held = [prose("what_holds", arm=arm) for arm in (sprung, pinned)]
    assert held == ["Springs hold this arm", "The tip of this arm is held"]
