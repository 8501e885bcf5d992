"""What is said of the sampled loop of odd arms: each sentence against poles that it was not made from."""

import math
import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import pytest

import tfarm
from tests.odd_arms import odd_arms
from tests.shared import thinned
from tfarm.comparing.regions import StableRegions
from tfarm.dsp import Chain, Sampling, sampled_loop, stable_windows
from tfarm.dsp.chain import Converters
from tfarm.dsp.edges import Figure
from tfarm.dsp.modes import dominant, mode_table
from tfarm.loop.stability import stability
from tfarm.loop.windows import windows_of
from tfarm.report.sampled_section import grown_words
from tfarm.report.sampled_words import (
    Sampled,
    against_continuous,
    chain_words,
    cure,
    damping_fact,
    sampled_in_short,
    spans,
)
from tfarm.spectrum.scales import default_gains

ARMS = odd_arms()
LOOPS = [name for name, arm in ARMS.items() if not arm.is_locked and arm.hub.inertia]
MODES = 4  # few, so that it is cheap: the sentences are about the loop that they are given


@cache
def data_of(name, period=0.01):
    """A section's numbers with few modes and without its pictures."""
    arm, chain = ARMS[name], Chain(sampling=Sampling(period=period))
    gains = default_gains(arm)
    loop = sampled_loop(arm, gains, chain, count=MODES)
    growth = loop.poles.log_spectral_radius
    verdict = SimpleNamespace(
        loop=loop, is_settled=False, band_rad_s=None, modes_used=MODES, is_stable=loop.poles.is_stable,
        log_radius=growth, word="stable" if growth < 0 else "unstable",
        sentence="stable: the hub decays most slowly, by 0.1 a sample",
    )  # fmt: skip
    analysis = SimpleNamespace(
        verdict=verdict, windows={"K2": stable_windows(loop, "K2")},
        shown={"K2": [(Figure(0.0, 0, None, MODES),) * 2]},
        delay_margin=SimpleNamespace(samples=1.25, is_bound=False), required_damping=0.0,
        damping=SimpleNamespace(is_settled=False, modes=MODES),
        modes=SimpleNamespace(natural_frequency=tfarm.modes(arm, 1).natural_frequency[-1:]),
    )  # fmt: skip
    windows = windows_of(stability(arm, gains), ["K2"])["K2"]
    return Sampled(arm, analysis, windows, StableRegions(None, ()), ())


def number(text):
    return float(text.replace("−", "-"))


@pytest.mark.parametrize("name", thinned(LOOPS, 2))
def test_room_that_sampling_adds_or_takes_is_where_the_poles_say_so(name):
    """Just inside what is added the continuous loop is unstable and the sampled one stable; the other way round too."""
    data = data_of(name)
    words = against_continuous(data)
    for verb, direction, end in re.findall(r"(adds room|takes away K2) (up to|down to|above|below) ([−\d.]+)", words):
        edge, sampled = number(end), data.sampled_K2
        low, high = data.continuous.around
        between = {"up to": (high + edge) / 2, "above": (high + edge) / 2}.get(direction, (max(low, -49.0) + edge) / 2)
        law = replace(data.gains, K2=between)
        by_time, by_samples = stability(data.arm, law).is_stable, sampled[0] < between < sampled[1]
        assert (by_time, by_samples) == ((False, True) if verb == "adds room" else (True, False)), words
    assert "without limit" not in words


@pytest.mark.parametrize("name", thinned(LOOPS, 2))
def test_yes_carries_its_margin_and_no_says_unstable(name):
    for period in (0.01, 0.0003):
        data = data_of(name, period)
        words = sampled_in_short(data)
        stable = sampled_loop(data.arm, data.gains, data.chain, count=MODES).poles.is_stable
        assert words.startswith("Yes") == stable
        assert (f"bears {1.25e3 * period:.3g}" in words.replace("0.3750", "0.375")) == stable
        assert ("unstable" in words) != stable


def test_intervals_that_hold_elsewhere_are_shown():
    """(0, 0.2) is stable although 0.3 is not: no "none"."""
    assert spans([(0.0, 0.2)], 0.3) == "0 … 0.2000, not 0.3"
    assert spans([(0.0, 0.2), (0.25, 0.4)], 0.3) == "0.250 … 0.4000"
    assert spans([], 0.3) == "none"


def test_damping_that_is_not_enough_is_not_said_to_be():
    data = data_of("rubber")
    own = data.arm.link.damping
    for needed, said in ((own / 2, "and this arm has"), (2 * own, "but this arm has only")):
        analysis = SimpleNamespace(**{**vars(data.analysis), "required_damping": needed})
        assert said in cure(replace(data, analysis=analysis))
        assert "is enough for the first 4 modes, " in cure(replace(data, analysis=analysis))
        analysis.damping = SimpleNamespace(is_settled=True, modes=None)
        assert "is enough, " in cure(replace(data, analysis=analysis))
    bare = replace(data.arm, link=replace(data.arm.link, damping=0.0))
    for needed, is_little in ((1e-9, True), (1e-3, False)):
        analysis = SimpleNamespace(**{**vars(data.analysis), "required_damping": needed})
        assert ("Every real arm has more" in cure(replace(data, arm=bare, analysis=analysis))) == is_little


@pytest.mark.parametrize(
    ("needed", "value", "beside"),
    [
        (0.0, "none", "for the first 4 modes"),
        (1e-14, "next to none", "1.0 × 10⁻¹⁴ s: 3.6 × 10⁻¹¹ % of critical in the first mode for the first 4 modes"),
        (1e-3, "1.0 × 10⁻³", "for the first 4 modes"),
        (math.inf, "none helps", "up to 15 % of critical in the first mode"),
    ],
)
def test_damping_that_is_needed_is_said_as_a_person_would(needed, value, beside):
    """Shares of critical damping: C w1/2, w1 = 71.506 rad/s of the paper's arm."""
    data = data_of("boom")
    modes = SimpleNamespace(natural_frequency=[71.505682])
    analysis = SimpleNamespace(**{**vars(data.analysis), "required_damping": needed, "modes": modes})
    fact = damping_fact(replace(data, analysis=analysis))
    assert (fact.value, fact.beside) == (value, beside)


def test_how_many_modes_grow_is_not_taken_for_which():
    assert [grown_words(each) for each in ([], [20], [3, 20])] == [
        "none grows",
        "one grows: mode 20",
        "2 grow: modes 3, 20",
    ]


def test_the_words_are_about_the_chain_of_the_file():
    arm = ARMS["boom"]
    assert "every 10 ms, which is the paper's" in chain_words(arm, Chain())
    own = Chain(sampling=Sampling(period=0.004, delay_samples=0.5), converters=Converters(hub_rate="difference"))
    words = chain_words(arm, own)
    assert "every 4 ms, 0.5 samples of delay" in words
    assert "differenced" in words
    assert "of this arm" in words  # its own default gain


@pytest.mark.parametrize("name", ["micro", "rubber"])
def test_the_table_of_modes_has_the_pole_that_the_verdict_names(name):
    """On the micro-arm mode 1, aliased to the edge of the strip, becomes two real poles: the slower one decides."""
    loop = data_of(name).analysis.verdict.loop
    table, named = mode_table(loop), dominant(loop)
    assert table.log_radius.max() <= loop.poles.log_spectral_radius
    if named.startswith("mode"):
        assert table.log_radius[table.index == int(named.partition(" ")[2])] == [loop.poles.log_spectral_radius]
