"""How much is worked out for windows, poles and the verdict under a law; what a faster count must not change."""

import numpy as np
import pytest

import tfarm
from tests import caches
from tests.loop.arms import some_loop
from tests.loop.law_counts import some_delay, some_law
from tests.loop.law_times import of_margins, some_case
from tests.shared import sized, thinned
from tfarm import Law
from tfarm.errors import ConvergenceError
from tfarm.loop.loop import Loop
from tfarm.loop.poles import poles_below
from tfarm.loop.windows import unstable_below
from tfarm.response.signals import Signals

LAB = tfarm.load("sasaki2012-lab")


@pytest.mark.parametrize("number", thinned([23, 128, 76, 132], 2))
def test_margins_of_a_law_ask_little_of_the_exact_rig(monkeypatch, number):
    """Poles that meet at rest, and strong damping: with poles found one by one to be counted it was ten times more."""
    case, asked, parts = some_case(1, number), [], Signals.parts

    def counted(self, s):
        asked.append(np.size(s))
        return parts(self, s)

    def never(*_):
        raise AssertionError("no start of a search is worth the damped modes")

    monkeypatch.setattr(Signals, "parts", counted)
    monkeypatch.setattr("tfarm.spectrum.damped.follow", never)
    caches.empty()
    of_margins(*case)
    assert len(asked) < 3000
    assert sum(asked) < 1_200_000


@pytest.mark.parametrize("number", sized(3, 12))
def test_a_count_without_a_list_is_that_of_the_list(number):
    rng, counts = np.random.default_rng(34), []
    while len(counts) < number:
        arm = some_loop(rng)[0]
        if not arm.least_damping:
            continue
        loop = Loop(arm, some_law(rng, arm, delay=some_delay(rng, arm)))
        band = float(tfarm.modes(arm, 9).natural_frequency[-2:].mean())
        try:
            poles = poles_below(loop, band)
        except ConvergenceError:
            continue
        assert unstable_below(loop, poles.box.im_max) == poles.unstable
        counts.append(poles.unstable)
    assert any(counts)


def test_a_count_next_to_a_law_s_slow_poles_is_right():
    """Three within a millionth of the lowest frequency, and a hub that turns freely: all in one step of a grid."""
    slow = 1e-6 * tfarm.modes(LAB, 1).natural_frequency[-1]
    law = Law({"hub_rate": {"zeros": [0.0] * 3, "poles": [slow, slow * (1 + 1j), slow * (1 - 1j)], "gain": 0.3}})
    loop = Loop(LAB, law)
    near = loop.law.times(1e-9)  # as good as no feedback: its own poles, three of them right of the axis
    assert unstable_below(loop.under(near), 300.0) == 3


def test_integrators_of_two_signals_leave_the_third_its_zeros_at_rest():
    """q = s (s^2 + 7 s), and p of the angle is q: D = a s^2 + ..., so that D/s^2 stays finite next to s = 0."""
    law = Law({
        "hub_angle": 40.0,
        "root_moment": ([0.3, 5.0], [1.0, 0.0]),
        "tip_acceleration": ([0.3, 5.0], [1.0, 7.0, 0.0]),
    })  # fmt: skip
    loop = Loop(LAB, law)
    assert loop.zeros_at_origin == 2
    at = loop.function(1e-5 * np.array([1j, 0.5j]))
    farther, nearer = at.value * np.exp(at.scale)
    assert farther / nearer == pytest.approx(1.0, abs=1e-3)
