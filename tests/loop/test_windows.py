"""Crossings along one number of a law, and its stability intervals: against poles, bisection, theorems, verdicts."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.loop.agreement import some_free_arm, some_gains
from tests.loop.arms import loop_of, verdict_of, window_arm
from tests.loop.ritz_loop import RitzLoop
from tests.shared import refusal, thinned
from tfarm import ConvergenceError, Hub, HubFeedback, Law, Payload, RotarySpring
from tfarm.arm.law_tables import load_law
from tfarm.loop import lines as lines_module
from tfarm.loop.lines import line_crossings, unstable_below
from tfarm.loop.margins import margins
from tfarm.loop.poles import poles_below
from tfarm.loop.windows import windows_of
from tfarm.spectrum.gains import default_gains, most_gain

LAB, BARE, STOCKY = (tfarm.load(name) for name in ("sasaki2012-lab", "sasaki2012", "stocky-steel"))


def windows(arm, law, name):
    return windows_of(verdict_of(arm, law), [name])[name]


def edge_by_bisection(model, law, name, inside, outside):
    """The value of a gain where the rightmost eigenvalue of the model changes sign."""
    for _ in range(28):
        middle = (inside + outside) / 2
        if model.rightmost(replace(law, **{name: middle})) < 0:
            inside = middle
        else:
            outside = middle
    return inside


PIN = replace(LAB, hub=Hub(inertia=0.0))
AROUND = [  # by theorems: without damping K2 reaches from minus infinity to 1, and a passive hub has no upper end
    *((arm, HubFeedback(K1=K1, K2=0.3), "K2", (-math.inf, 1.0)) for arm in (BARE, STOCKY) for K1 in (1e-6, 0.3, 100.0)),
    *((arm, HubFeedback(K1=0.3, K2=-4.0), "K1", (0.0, math.inf)) for arm in (BARE, STOCKY)),
    *((LAB, HubFeedback(K1=0.3), name, (0.0, math.inf)) for name in ("K1", "Kp")),
    (LAB, HubFeedback(K1=0.3, K2=1.2), "K2", None),  # unstable
    (PIN, HubFeedback(K1=0.3), "K2", None),  # has no K2 to choose
    (PIN, HubFeedback(K1=0.3), "K1", (0.0, math.inf)),
]


@pytest.mark.parametrize(("arm", "law", "name", "around"), AROUND)
def test_intervals_known_by_a_theorem_are_exact(arm, law, name, around) -> None:
    found = windows(arm, law, name)
    assert found.around == around
    if arm is not LAB:
        assert found.all == (() if around is None else (around,))


def test_the_window_of_the_counterexample_and_those_beyond_it() -> None:
    law = HubFeedback(K1=1.0, K2=-5.0)
    found = windows(window_arm(), law, "K2")
    low, high = found.all[-2][1], found.around[0]
    assert (round(low, 2), round(high, 2)) == (-11.47, -8.48)
    model = RitzLoop(window_arm(), 18)
    assert high == pytest.approx(edge_by_bisection(model, law, "K2", -5.0, -10.0), rel=1e-7)
    assert low == pytest.approx(edge_by_bisection(model, law, "K2", -12.0, -10.0), rel=1e-7)
    assert found.around[1] == pytest.approx(edge_by_bisection(model, law, "K2", 0.5, 1.2), rel=1e-7)
    there = windows(window_arm(), replace(law, K2=-10.0), "K2")
    assert there.around is None
    np.testing.assert_allclose(np.ravel(there.all)[1:], np.ravel(found.all)[1:], rtol=1e-11)


@pytest.mark.parametrize("seed", range(4))
def test_random_stability_intervals_agree_with_the_model(seed) -> None:
    rng = np.random.default_rng(100 + seed)
    arm = some_free_arm(rng, damped=True)
    K1, K2, Kp = some_gains(rng, arm, 3)
    law, model = HubFeedback(K1=float(K1[1]), K2=float(K2[1]), Kp=Kp), RitzLoop(arm, 18)
    verdict = verdict_of(arm, law)
    for name in ("K1", "K2", "Kp"):
        found = windows_of(verdict, [name])[name]
        edges = sorted({*found.looked_at, *(each.t for each in found.crossings)})
        for low, high in itertools.pairwise(edges):
            middle = (low + high) / 2
            if high - low < 1e-6 * max(abs(low), abs(high)):
                continue
            rightmost = model.rightmost(replace(law, **{name: middle}))
            assert any(a < middle < b for a, b in found.all) == (rightmost < 0)


def test_gains_near_the_largest_allowed_are_looked_at_too() -> None:
    most = most_gain(LAB, "K1")
    found = windows(LAB, HubFeedback(K1=0.9 * most), "K1")
    assert found.looked_at == (-most, most)
    heavy = replace(LAB, hub=Hub(inertia=1e7), payload=Payload(mass=1e5))
    assert windows(heavy, HubFeedback(K1=0.3, K2=0.2), "Kp").around[0] == 0


def test_an_end_of_the_search_is_no_edge() -> None:
    """An edge has poles on the axis there, a search bound none as far as poles can be found, infinity is a theorem."""
    found = windows(LAB, HubFeedback(K1=0.3, K2=0.3), "K2")
    assert [found.end(value) for value in found.around] == ["search bound", "edge"]
    for value in found.around:
        poles = poles_below(loop_of(LAB, HubFeedback(K1=0.3, K2=value)), 2e3).nonzero
        assert (abs(poles.real / abs(poles)).min() < 1e-12) == (found.end(value) == "edge")
    assert [windows(BARE, HubFeedback(K1=0.3), "K1").end(value) for value in (0.0, math.inf)] == ["edge", "no limit"]
    for arm in (BARE, LAB):
        assert margins(arm, default_gains(arm)).intervals_note is None


@pytest.mark.parametrize("C", [0.0, 1e-4])
def test_of_a_heavy_hub_k2_is_looked_at_beyond_where_it_cancels_the_inertia(C) -> None:
    """A hub of 100 times the beam: from K2 = J/(J - I_h) = 101 on K1 > 0 turns a negative inertia."""
    carried = LAB.total_inertia - LAB.hub.inertia
    arm = replace(LAB, hub=Hub(inertia=100 * carried), link=replace(LAB.link, damping=C))
    found = windows(arm, HubFeedback(K1=1e-3, K2=0.3), "K2")
    assert (found.looked_at[1] > 101 >= found.around[1], found.end(found.around[1])) == (True, "edge")
    assert verdict_of(arm, HubFeedback(K1=1e-3, K2=101.5)).unstable_roots > 0


def test_behind_an_inductance_the_lowest_K2_is_that_of_its_band():
    """Elastic links: each higher mode is driven by less; the answer names the band, which a higher one undercuts."""
    arm = tfarm.load("quanser-flexlink")
    law = default_gains(arm)
    found = margins(arm, law)
    assert "poles may cross inside them" in found.intervals_note
    band = found.windows["K2"].band
    assert math.isfinite(band)
    low = found.windows["K2"].around[0]
    higher = line_crossings(loop_of(arm, law), "K2", 2 * low, 0.0, 4 * band).gain
    assert 0.5 * low < higher[higher < 0].max() < 0


@pytest.mark.parametrize(
    ("inertia", "law", "words"),
    [(math.inf, HubFeedback(K1=0.3), "has no loop"), (0.0, HubFeedback(K1=0.3, K2=0.1), "an algebraic loop")],
)
def test_where_there_is_no_loop(inertia, law, words) -> None:
    assert words in str(refusal(loop_of, replace(BARE, hub=Hub(inertia=inertia)), law))


LAW = Law({"hub_angle": ([2.0, 1.0], [0.01, 1.0]), "tip_acceleration": ([0.05], [0.02, 1.0])}, delay=0.002)
OFF_END, OFF_ZERO = 1e-7, 1e-3  # of a window: distance from its end of a verdict; there a pole may be far out


def holds(windows, value):
    """Whether a value lies inside a stability interval."""
    return any(low < value < high for low, high in windows.all)


@pytest.mark.parametrize(("law", "every"), thinned([(LAW, 3), (LAW, 1), (LAW.with_number("gain", 7.0), 1)], 3))
def test_verdicts_turn_at_each_end(law, every):
    """Of each number of the law, or of every third one."""
    found = windows_of(verdict_of(LAB, law))
    assert found.keys() == law.numbers.keys()
    edges = 0
    for name, each in list(found.items())[::every]:
        for low, high in each.all:
            for end, side in ((low, 1), (high, -1)):
                inward = side * (OFF_END if end else OFF_ZERO) * (high - low)
                assert verdict_of(LAB, law.with_number(name, end + inward)).is_stable
                if each.end(end) == "edge":
                    edges += 1
                    assert not verdict_of(LAB, law.with_number(name, end - inward)).is_stable
        assert holds(each, law.numbers[name]) == (each.around is not None) == (law is LAW)
    assert edges >= 8 // every


def test_a_spring_is_outweighed_by_a_law_as_stiff():
    """2 N m/rad hold the hub: k + C(0) = 0, whatever else there is; and a filter turns over at T = 0."""
    held = replace(LAB, hub=replace(LAB.hub, stiffness=2.0, friction=0.5))
    found = windows_of(verdict_of(held, Law({"hub_angle": ([0.5], [0.01, 0.25])})))
    assert found["hub_angle.num.0"].around[0] == pytest.approx(-2.0 * 0.25, rel=1e-9)
    assert found["gain"].around[0] == pytest.approx(-1.0, rel=1e-9)
    assert found["hub_angle.den.0"].around[0] == 0.0


def test_the_factor_on_the_law_is_its_gain_margin():
    found = tfarm.margins(LAB, LAW)
    assert found.windows["gain"].around == pytest.approx(found.in_band.gain, rel=1e-9)


def test_where_poles_stay_on_the_axis_there_are_none():
    undamped = tfarm.margins(BARE, LAW.with_number("delay", 0.0))
    assert undamped.windows == {}
    assert "undamped link" in undamped.intervals_note
    marginal = verdict_of(LAB, Law({"tip_acceleration": 0.01, "root_moment": 0.1}))  # nothing holds angle or rate
    assert marginal.word == "marginal"
    assert windows_of(marginal) == {}


def test_a_number_whose_poles_cannot_be_counted_is_named(monkeypatch):
    with_real_poles = lines_module._with_real_poles

    def lost(line, *others):
        if line.name == "hub_angle.num.1":
            raise ConvergenceError("a zero lies on the contour", 0.0, 0.0)
        return with_real_poles(line, *others)

    monkeypatch.setattr(lines_module, "_with_real_poles", lost)
    found = tfarm.margins(LAB, LAW)
    assert LAW.numbers.keys() - found.windows.keys() == {"hub_angle.num.1"}
    assert found.intervals_note.endswith("poles not counted along hub_angle.num.1")


LAG = {"hub_angle": 1.0, "hub_rate": ([0.5], [0.05, 1.0]), "tip_displacement": ([0.3, 1.0], [0.02, 1.0])}
RESONATOR = {"hub_angle": 1.0, "hub_rate": 0.3, "tip_deflection": ([-2556.5], [1.0, 0.186, 8641.0])}
NARROW = {  # two crossings 0.15 rad/s apart, near 72 and 93, lie between neighbours of the arm's grid
    "resonator": (Law(RESONATOR), "gain", [0.5, 5.0, 6.9, 9.0]),
    "lag": (Law(LAG, delay=0.01), "tip_displacement.den.1", [0.5, 3.01, 9.0, 9.9]),
}


@pytest.mark.parametrize(("law", "name", "values"), thinned(NARROW.values(), 2), ids=NARROW)
def test_a_window_has_no_unstable_stretch_inside(law, name, values):
    window = windows_of(verdict_of(LAB, law))[name]
    for value in values:
        assert holds(window, value) == verdict_of(LAB, law.with_number(name, value)).is_stable


@pytest.mark.parametrize(("name", "band"), [("hub_angle.gain", 90.0), ("tip_acceleration.den.0", 150.0)])
def test_below_a_band_through_whose_top_poles_pass_each_interval_is_counted(name, band):
    """Crossings below it do not carry the count from one end of the range to the other."""
    law = LAW.with_number("gain", 7.0)
    found = windows_of(verdict_of(LAB, law, band), [name])[name]
    for value in np.linspace(*found.looked_at, 8)[1:-1].tolist():
        count = unstable_below(loop_of(LAB, law.with_number(name, value)), found.band)
        assert holds(found, value) == (count == 0)


@pytest.mark.parametrize("damping", [3e-8, 1e-7])
def test_next_to_zero_windows_are_not_cut_by_rounding(damping) -> None:
    """An integrator with a denominator as good as 0: the phase of what it feeds back is real to 1e-7 far up the axis.

    With the digits of the whole range the boundary was crossed at random there; poles are counted at values between.
    """
    stocky = tfarm.load("stocky-steel")
    hub = replace(stocky.hub, friction=0.3)
    arm = replace(stocky.with_numbers(damping=damping), hub=hub, joint=RotarySpring(stiffness=1.0))
    law = Law({"hub_angle": ([0.03, 0.07], [1.0, 0.0])})
    found = windows_of(verdict_of(arm, law))["hub_angle.den.0"]
    probes = [*np.geomspace(1e-8, 5.0, 8), *((low + high) / 2 for low, high in found.all)]
    for value in probes:
        count = verdict_of(arm, law.with_number("hub_angle.den.0", float(value)), band=found.band).unstable_roots
        assert holds(found, value) == (count == 0)


def reproduced(name):
    """Arm and law of a file."""
    file = f"tests/data/reproductions/{name}.toml"
    return tfarm.load(file), load_law(file)


def test_counts_are_not_carried_through_a_zero_leading_coefficient() -> None:
    """Next to 0 high modes are driven, and poles come to a lower band from above: the window was wrong."""
    arm, law = reproduced("lifted")
    found = windows_of(verdict_of(arm, law))["tip_acceleration.den.0"]
    for value in (-7.7, -7.4, -6.4):
        count = verdict_of(arm, law.with_number("tip_acceleration.den.0", value)).unstable_roots
        assert holds(found, value) == (count == 0)
    assert [pair[0] for pair in found.all] == [-10.0]


def test_a_leading_coefficient_without_which_there_is_no_loop_keeps_its_sign() -> None:
    """A lead on the hub's rate: without its lag it would answer the torque at once."""
    law = Law({"hub_rate": ([0.02, 0.3], [0.01, 1.0]), "hub_angle": 1.0})
    found = windows_of(verdict_of(LAB, law))["hub_rate.den.0"]
    assert found.looked_at == (0.001, 0.1)
    assert all(0.001 <= low < high <= 0.1 for low, high in found.all)


def test_a_count_next_to_a_law_s_slow_poles_is_right():
    """Three within a millionth of the lowest frequency, and a hub that turns freely: all in one step of a grid."""
    slow = 1e-6 * tfarm.modes(LAB, 1).natural_frequency[-1]
    law = Law({"hub_rate": {"zeros": [0.0] * 3, "poles": [slow, slow * (1 + 1j), slow * (1 - 1j)], "gain": 0.3}})
    loop = loop_of(LAB, law)
    near = loop.law.times(1e-9)  # as good as no feedback: its own poles, three of them right of the axis
    assert unstable_below(loop.under(near), 300.0) == 3


@pytest.mark.parametrize("size", [1e-4, 1e-16])
def test_a_pole_next_to_zero_is_found_where_nothing_turns_freely(size):
    """A spring of the hub against g/(s + e) of its rate: J s^2 + k + s g/(s + e) = 0 next to s = -k e/(k + g)."""
    stiffness, gain, e = 5.0, 2.0, size * tfarm.modes(LAB, 1).natural_frequency[-1]
    arm = replace(LAB, hub=replace(LAB.hub, stiffness=stiffness))
    poles = tfarm.closed_loop_poles(arm, Law({"hub_rate": ([gain], [1.0, e])}), 4)
    slowest = poles.values[np.argmin(abs(poles.values))]
    assert slowest == pytest.approx(-stiffness * e / (stiffness + gain), rel=1e-9 + 10 * size, abs=0)


def test_integrators_of_two_signals_leave_the_third_its_zeros_at_rest():
    """q = s (s^2 + 7 s), and p of the angle is q: D = a s^2 + ..., so that D/s^2 stays finite next to s = 0."""
    law = Law({
        "hub_angle": 40.0,
        "root_moment": ([0.3, 5.0], [1.0, 0.0]),
        "tip_acceleration": ([0.3, 5.0], [1.0, 7.0, 0.0]),
    })  # fmt: skip
    loop = loop_of(LAB, law)
    assert loop.zeros_at_origin == 2
    at = loop.function(1e-5 * np.array([1j, 0.5j]))
    farther, nearer = at.value * np.exp(at.scale)
    assert farther / nearer == pytest.approx(1.0, abs=1e-3)
