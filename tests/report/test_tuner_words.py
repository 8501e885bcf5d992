"""What is said about the tuner on any arm: each sentence against the costs that it is given."""

from types import SimpleNamespace

import numpy as np

from tests.odd_arms import odd_arms
from tfarm.dsp.traces import away
from tfarm.report.sections import typeset
from tfarm.report.tuner_section import drift_words, shaping_words, tuner_in_short
from tfarm.tuner import LearningCurves

ARMS = odd_arms()


def study(without=2.0, best=1.0, tuner=0.9, shaped=0.1, late=0.1, ends=(0.2, 0.1)):
    """A study's numbers: costs, how much later shapers arrive [s], where the tip ends [m]."""
    curves = LearningCurves(np.full((5, 1), tuner), np.full(5, tuner), 0, 0)
    tuning = SimpleNamespace(
        without=SimpleNamespace(cost=without),
        best_constant=SimpleNamespace(cost=best, gain=0.3),
        shaped_costs=dict.fromkeys(("ZV", "EI"), shaped),
        shaped_delays=dict.fromkeys(("ZV", "EI"), late),
    )
    runs = [
        SimpleNamespace(
            at_samples=SimpleNamespace(tip_displacement=np.array([0.0, end])),
            scenario=SimpleNamespace(hub_angle=np.zeros(2)), t=np.arange(2.0),
        )
        for end in ends
    ]  # fmt: skip
    return SimpleNamespace(
        arm=ARMS["boom"], tuning=tuning, curves=curves, slews={"with the tuner": runs[0]}, constant=runs[1],
    )  # fmt: skip


def test_less_is_lowered_by_another_share_and_more_is_not():
    words = tuner_in_short(study(without=2.0, best=1.0, tuner=0.9))
    assert words.startswith("A little. A constant K2 of 0.300 already takes 50 % off")
    assert "lowers it by another 10 %, to 0.900" in words
    worse = tuner_in_short(study(without=2.0, best=1.0, tuner=1.15))
    assert worse.startswith("No.")
    assert "raises it by 15 %, to 1.15" in worse
    assert "another" not in worse


def test_a_constant_gain_that_does_nothing_is_not_said_to_take_0_percent_off():
    words = tuner_in_short(study(without=1.0, best=1.0, tuner=1.0))
    assert "No constant K2 takes anything off" in words
    assert "leaves it as it is" in words
    assert "0 %" not in words


def test_shaping_is_cheaper_only_where_it_is_and_nothing_arrives_0_ms_later():
    assert "is cheaper" in shaping_words(study(shaped=0.1))
    assert "is dearer here" in shaping_words(study(shaped=1.5))
    assert "0 ms later" not in shaping_words(study(late=0.0))
    assert "has nothing to do here" in shaping_words(study(late=0.0))


def test_the_angle_that_is_left_is_said_as_it_is():
    assert "leaves more of it" in drift_words(study(ends=(0.5, 0.01)))
    assert "leaves no more of it" in drift_words(study(ends=(0.01, 0.5)))
    assert "about as much" in drift_words(study(ends=(0.2, 0.1)))
    there = study(ends=(0.5, 1e-15))
    there.constant.scenario.hub_angle[0] = 0.1
    assert "and 0 mm with the best constant gain" in drift_words(there)
    assert away(ARMS["boom"], study().constant)[-1] == 0.1


def test_numbers_of_the_code_become_those_of_a_page():
    assert typeset("cost 5.852e+04, (0.9, 0.1)") == "cost 58520, (0.9, 0.1)"
    assert typeset("V_t = -a2 K1 theta_t^2, -2.5e-09 of J w1") == "V_t = −a2 K1 (dθ/dt)², −2.5 × 10⁻⁹ of J ω₁"
