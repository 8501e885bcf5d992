"""Stability intervals, map, delay margin and required damping, each against poles on both of its sides."""

import math
import re
from dataclasses import replace
from importlib import import_module
from itertools import product

import numpy as np
import pytest

import tfarm
from tests.odd_arms import odd_arms
from tests.plausible.arms import draw
from tests.rigs import some_rig
from tests.shared import circle_crossings, thinned
from tests.similar import EITHER
from tfarm import Arm, Hub, HubFeedback, Law, Link, Payload, Section, modes
from tfarm.arm import as_law
from tfarm.arrays import MACHINE_EPS
from tfarm.case import Case
from tfarm.dsp import Chain, Converters, Sampling
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.loop.circle_crossings import ends_of_K1, interval_around, sampled_map, stable_windows
from tfarm.loop.edges import DelayMargin, Figure, delay_margin, required_damping
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_analysis import Analysis
from tfarm.loop.sampled_poles import FADED_RADIUS
from tfarm.loop.sampled_verdict import Verdict, sampled_verdict
from tfarm.schema import text, to_dict
from tfarm.spectrum.gains import default_gains

GAINS = HubFeedback(K1=0.3, K2=0.3)
room = import_module("tfarm.loop.sampled_verdict")


def stable_at(loop, name, values):
    """Whether all poles lie inside the circle at each value of a gain."""
    return [loop.with_number(name, float(value)).poles.is_stable for value in values]


@pytest.mark.parametrize("period", [0.005, 0.05])
def test_a_static_crossing_torn_by_rounding_hides_no_window(period):
    """A pinned tip, where a pole meets z = 1 at K2 = 1: the window below it is there, by the poles on its two sides."""
    arm = odd_arms()["pinned"]
    loop = sampled_loop(Case(arm, HubFeedback(K1=0.0374, K2=0.3), Chain(sampling=Sampling(period=period))), count=8)
    low, high = interval_around(stable_windows(loop, "K2"), 0.3)
    assert high == pytest.approx(1.0, rel=1e-9)
    assert stable_at(loop, "K2", (low - 1e-6, low + 1e-6, 0.999, 1.001)) == [False, True, True, False]


def test_where_the_feedback_outweighs_no_fast_modes_damping_all_delays_are_looked_through(lab):
    """A weak rate gain on a little damped arm, whose fastest mode turns more than 20 times in a sample."""
    arm = replace(lab, link=replace(lab.link, damping=1e-4))
    loop = sampled_loop(Case(arm, HubFeedback(K1=0.02), Chain(sampling=Sampling(period=0.02))), count=12)
    assert loop.plant.poles.imag.max() * 0.02 > 2 * np.pi * 20
    assert delay_margin(loop) == DelayMargin(20.0, True)
    assert all(loop.with_delay(delay).poles.is_stable for delay in np.linspace(0.0, 20.0, 9))
    analysis = Analysis(Verdict(loop))
    vars(analysis)["delay"] = Figure(20.0, 4, None, 12, is_bound=True)
    assert (text(analysis.delay_margin_seconds), text(analysis.delay)) == ("≥ 0.4", "≥ 20 (first 12 modes)")
    assert (analysis.delay_margin_seconds, analysis.is_lower_bound) == (0.4, True)


def test_a_long_delay_hides_no_crossing_between_two_points_of_the_grid(lab):
    """Sixty samples turn the loop's phase sixty times round the circle; a grid ten times coarser loses a pair."""
    loop = sampled_loop(Case(lab, GAINS, Chain(sampling=Sampling(delay_samples=60.0))), count=6)
    found = circle_crossings(loop.with_number("K1", 0.0).with_number("K2", 0.3), "K1")
    edges = found.gain[np.diff(found.gain, append=np.inf) > 1e-6]
    middles = np.r_[edges[0] - 1, (edges[1:] + edges[:-1]) / 2, edges[-1] + 1]
    counts = [(loop.with_number("K1", middle).poles.log_radius > 0).sum() for middle in middles]
    np.testing.assert_array_equal(counts - found.passed(middles), counts[0])


def test_the_map_has_exact_edges(lab):
    loop = sampled_loop(Case(lab, GAINS), count=11)
    plane = sampled_map(loop, [0.1, 0.3, 30.0], np.linspace(-0.5, 1.5, 5))
    assert plane.stable_intervals[1:] == [[pytest.approx(stable_windows(loop, "K2")[0], rel=1e-12)], []]


@pytest.mark.parametrize("K2", [0.1, 0.3, 0.9])
def test_the_delay_margin_is_where_the_verdict_turns(lab, K2):
    loop = sampled_loop(Case(lab, HubFeedback(K1=0.3, K2=K2)), count=12)
    margin = delay_margin(loop)
    assert not margin.is_bound
    delays = *np.linspace(0, margin.samples, 41)[:-1], margin.samples - 1e-6, margin.samples + 1e-6
    assert [loop.with_delay(float(delay)).poles.is_stable for delay in delays] == [True] * 41 + [False]


def test_the_required_damping_is_where_the_verdict_turns(lossless):
    """At C = 0 modes grow by 1e-9 a sample; very little damping stabilises that, and a formula gives it."""
    C = required_damping(Case(lossless, GAINS, Chain()), count=20)
    growth, w = sampled_verdict(Case(lossless, GAINS)).log_radius, tfarm.modes(lossless, 13).natural_frequency[13]
    assert pytest.approx(2 * growth / (0.01 * w**2), rel=0.02) == C
    arms = [lossless.with_numbers(damping=each * C) for each in (1, 1 - 4e-6)]
    assert [sampled_loop(Case(arm, GAINS, Chain())).poles.is_stable for arm in arms] == [True, False]


@pytest.mark.parametrize(("K1", "K2", "ratio"), [(0.3, -0.2, 0.02), (20.0, 0.3, 0.15)])
def test_a_required_damping_next_to_overdamped_modes_is_that_of_a_loop_with_all_of_them(lossless, K1, K2, ratio):
    """The search has few modes that outlive a sample: eigenvalues of 20 turn there."""
    case = Case(lossless, HubFeedback(K1=K1, K2=K2))
    C = required_damping(case)
    assert ratio / 10 < C * tfarm.modes(lossless, 1).natural_frequency[1] / 2 < ratio
    arms = [lossless.with_numbers(damping=C * side) for side in (1 - 1e-4, 1 + 1e-4)]
    radii = [abs(sampled_loop(case.on(arm), count=20).eigenvalues).max() for arm in arms]
    assert radii[0] > 1 > radii[1]


def test_the_region_is_upright_where_intervals_of_the_rate_gain_end(lab):
    """Stable on one side of each end, not on the other, by the eigenvalues at one of the gains that were looked at."""
    loop = sampled_loop(Case(lab, GAINS), count=14)
    moment_gains = (-0.9, 0.3, 0.9)
    ends = ends_of_K1(loop, moment_gains)
    assert ends.size
    assert (ends > 0).all()
    for end in ends.tolist():
        loops = [
            [loop.with_number("K2", K2).with_number("K1", end * (1 + way)) for way in (-1e-5, 1e-5)]
            for K2 in moment_gains
        ]
        assert any((abs(a.eigenvalues).max() < 1) != (abs(b.eigenvalues).max() < 1) for a, b in loops)


def test_no_damping_cures_some_loops_and_none_is_needed_for_few_modes(lossless):
    """At the strongest damping the loop of ringing modes alone is stable, and that of 20 modes is not."""
    assert required_damping(Case(lossless, HubFeedback(K1=0.3, K2=3.0), Chain()), count=6) == np.inf
    assert required_damping(Case(lossless, GAINS, Chain()), count=6) == 0.0
    case = draw(63, 531)
    chain = Chain(sampling=Sampling(period=2 * math.pi / case.first / 9))
    strongest = case.arm.elastic.with_numbers(damping=0.3 / case.first)
    radii = [abs(sampled_loop(Case(strongest, case.law, chain), count=n).eigenvalues).max() for n in (1, 20)]
    assert radii[0] < 1 < radii[1]
    assert required_damping(Case(case.arm.elastic, case.law, chain)) == np.inf


def test_the_verdict_settles_with_damping_and_names_its_modes_without(lab, lossless):
    verdict, undamped = sampled_verdict(Case(lab, GAINS)), sampled_verdict(Case(lossless, GAINS))
    assert (verdict.is_settled, undamped.is_settled, undamped.band_rad_s) == (True, False, None)
    assert (undamped.slowest, undamped.modes_used) == ("mode 13", 20)
    assert undamped.holds_for == "model of the first 20 modes, not determined beyond"
    still = sampled_verdict(Case(lossless, HubFeedback(K1=0, K2=0)))
    words = [each.sentence.split()[0] for each in (verdict, sampled_verdict(Case(lossless, GAINS), count=12), still)]
    assert words == ["stable", "stable", "marginal"]


def test_the_verdict_is_converged_where_only_fewer_modes_agree(lab, monkeypatch):
    monkeypatch.setattr(room, "complete_band", lambda loop: None)
    for word, limit in (("converged for", {}), ("model of", {"tolerance": -1.0})):
        words = sampled_verdict(Case(lab, GAINS), **limit).holds_for
        assert re.fullmatch(rf"{word} the first \d+ modes, not determined beyond", words)


def test_margins_of_a_certified_loop_have_the_digits_that_are_shown(lab):
    answer, unstable = (to_dict(tfarm.sampled(lab, HubFeedback(K1=0.3, K2=K2))) for K2 in (0.3, 1.3))
    for key in ("delay_margin", "minimum_damping_s"):
        figure = answer[key]
        assert (figure["certified"], figure["digits"]) == (True, 4)
        assert float(figure["text"]) == pytest.approx(figure["value"], rel=5e-4)
    assert (unstable["unstable_poles"], unstable["delay_margin_samples"]) == (2, 0.0)


def test_a_count_of_modes_is_checked(lab):
    with pytest.raises(ParameterError, match="1 to 400"):
        sampled_verdict(Case(lab, GAINS), count=0)


@pytest.mark.parametrize("friction", [0.02, 1e-5])
def test_windows_of_the_rate_gain_of_a_damped_hub_begin_where_its_losses_are_taken(lab, friction):
    """There the hub drifts, a pole at z = 1; below it the loop is unstable, however small the friction."""
    arm = replace(lab, hub=replace(lab.hub, friction=friction))
    loop = sampled_loop(Case(arm, GAINS), count=8)
    ((low, high),) = stable_windows(loop, "K1")
    assert low == pytest.approx(-friction, rel=1e-13)
    sides = -1.005 * friction, -0.995 * friction, 0.99 * high, 1.01 * high
    assert stable_at(loop, "K1", sides) == [False, True, True, False]


STILL_RIG = (6, 28)  # held by a spring near its root: the hub's rate next to z = 1 is rounding


def some_sampled(seed):
    """A rig that turns under a law, gains about its own, and a sampling period about its first mode's period."""
    rng = np.random.default_rng(seed)
    rigs = (some_rig(rng) for _ in range(20))
    arm = next(arm for arm in rigs if arm.input != "hub_angle" and not arm.is_locked)
    usual = default_gains(arm)
    law = HubFeedback(K1=usual.K1 * float(10 ** rng.uniform(-1, 2)), K2=usual.K2 * float(rng.uniform(-2, 3)))
    T = float(rng.uniform(0.05, 2)) / float(modes(arm, 1).natural_frequency[-1])
    delay, corner = float(rng.choice([0, 0.4, 1.3])), float(rng.choice([np.inf, 2 / T]))
    return arm, law, Chain(sampling=Sampling(period=T, delay_samples=delay, antialias_corner=corner))


def answers(arm, law, chain, units):
    """Intervals of K1 and K2 in units of the law's, delay margin, poles; None where modes are not determined."""
    try:
        loop = sampled_loop(Case(arm, law, chain), count=6)
    except ConvergenceError:
        return None
    windows = [np.array(stable_windows(loop, name)) / units[name] for name in ("K1", "K2")]
    return windows, delay_margin(loop), loop.poles


SEEDS = [STILL_RIG, *((6, n) for n in range(24))]


@pytest.mark.parametrize(("seed", "units"), thinned(product(SEEDS, EITHER.values()), 27))
def test_a_sampled_loop_has_the_same_windows_delay_and_poles(seed, units):
    arm, law, chain = some_sampled(seed)
    sampling = chain.sampling
    corner = sampling.antialias_corner / units.time
    other = replace(sampling, period=sampling.period * units.time, antialias_corner=corner)
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
    # Overdamped modes are fitted by least squares without singular values below 1e-12: rounding changes their shares by
    # EPS/1e-12, and a pole that such a share moves by less than FADED_RADIUS by that part of it.
    is_fitted = (abs(there[2].z) < FADED_RADIUS) & (there[2].mode == 0)
    tolerance = np.where(is_fitted, FADED_RADIUS * MACHINE_EPS / 1e-12, 1e-9)
    assert (abs(there[2].z[:, None] - here[2].z).min(axis=1) < tolerance).all()


def test_an_arm_that_something_holds_has_its_whole_window():
    """By the poles on either side of both ends, and at gains in between."""
    loop = sampled_loop(Case(*some_sampled(STILL_RIG)), count=6)
    ((low, high),) = stable_windows(loop, "K1")
    shares = np.array([-1e-6, 1e-6, 0.1, 0.35, 0.6, 0.9, 1 - 1e-6, 1 + 1e-6])
    assert stable_at(loop, "K1", low + (high - low) * shares) == [False, *[True] * 6, False]


LAB = tfarm.load("sasaki2012-lab")
FOUR = Law({"hub_angle": ((4.0, 2.0), (0.05, 1.0)), "hub_rate": 1.0, "root_moment": (0.2, (0.01, 1.0))}, delay=0.004)
WITH_ANGLE = HubFeedback(K1=0.3, K2=0.3, Kp=2.0)
OF_SIGNALS = Law({"hub_rate": 0.3, "hub_angle": 2.0, "tip_acceleration": ([0.05], [0.02, 1.0])})
PLAIN, DIFFERENCES = Chain(), Chain(converters=Converters(hub_rate="difference", rate_filter=300.0))
PLANES = [
    (GAINS, PLAIN, ("K1", "K2"), (0.05, 4.0), (-3.0, 30.0)),
    (GAINS, DIFFERENCES, ("K1", "K2"), (0.05, 4.0), (-3.0, 30.0)),
    (WITH_ANGLE, PLAIN, ("Kp", "K2"), (0.2, 8.0), (-1.0, 1.2)),
    (WITH_ANGLE, DIFFERENCES, ("K1", "Kp"), (0.05, 4.0), (-6.0, 30.0)),
    (FOUR, PLAIN, ("delay", "hub_angle"), (0.0, 0.04), (0.1, 6.0)),
    (FOUR, PLAIN, ("hub_rate", "hub_angle.den.0"), (-3.0, 8.0), (0.01, 0.3)),
    (FOUR, PLAIN, ("hub_angle.num.0", "root_moment.den.0"), (-9.0, 60.0), (0.002, 0.3)),
    (OF_SIGNALS, DIFFERENCES, ("hub_rate", "tip_acceleration.gain"), (0.05, 4.0), (-3.0, 30.0)),
]


@pytest.mark.parametrize(("law", "chain", "vary", "across", "up"), PLANES)
def test_the_count_at_a_point_is_that_of_the_poles_of_its_own_loop(law, chain, vary, across, up):
    """Of a loop made anew for the law at that point; some are unstable."""
    rng = np.random.default_rng(3)
    x, y = (np.sort(rng.uniform(*ends, 4)) for ends in (across, up))
    plane = sampled_map(sampled_loop(Case(LAB, law, chain), count=6), x, y, vary)
    assert plane.vary == vary
    counts = []
    for i, j in [(i, j) for i in range(4) for j in range(4) if (i + j) % 2]:
        there = as_law(law).with_number(vary[0], x[i]).with_number(vary[1], y[j])
        poles = sampled_loop(Case(LAB, there, chain), count=6).poles
        counts.append(int((abs(poles.z) > 1).sum()))
        assert (plane.unstable[i, j], plane.counts[j, i]) == (counts[-1], counts[-1])
    assert min(counts) < max(counts)


@pytest.mark.parametrize("name", ["hub_angel", "hub_angle.num.7"])
def test_what_is_no_number_of_the_law_is_refused(name):
    with pytest.raises(tfarm.ParameterError, match="law"):
        sampled_map(sampled_loop(Case(LAB, FOUR), count=4), [0.0, 1.0], [0.0, 1.0], (name, "hub_rate"))


def test_the_gain_margin_has_the_modes_that_the_verdict_needs_no_more():
    """A soft rod with a heavy tip: 8 modes are enough for the verdict, and mode 10 is the first with a larger gain."""
    section = Section.round(diameter=0.0878)
    link = Link.isotropic(
        length=1.1, density=1100.0, youngs_modulus=5e6, poissons_ratio=0.49, section=section, damping=2.7e-4
    )
    arm = Arm(name="soft", link=link, hub=Hub(inertia=0.048), payload=Payload(mass=6.56, inertia=0.0384))
    chain = Chain(sampling=Sampling(period=0.0053))
    law = HubFeedback(K1=6.0, K2=-0.7)
    found = tfarm.sampled(arm, law, chain)
    assert found.verdict.loop.plant.count < 10
    limit = 10 ** (found.curve.gain_margin.value / 20)
    for share, word in ((0.999, "stable"), (1.001, "unstable")):
        other = HubFeedback(K1=share * limit * law.K1, K2=share * limit * law.K2)
        verdict = tfarm.sampled(arm, other, chain).verdict
        assert verdict.word == word
    assert verdict.slowest == "mode 10"
