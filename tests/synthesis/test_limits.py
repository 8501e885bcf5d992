"""The margin that limits a loop, and the costs of sampling, from records."""

from dataclasses import replace

import pytest

import tfarm
from tfarm.assessment.card import Graded
from tfarm.synthesis.limits import limiting_margin, loop_limits

LAB = tfarm.load("sasaki2012-lab")
CARD = tfarm.result_card(LAB, tfarm.HubFeedback(K1=3.0, K2=0.15))
MODES = tfarm.modes(LAB, 3)


def test_the_limiting_margin_has_the_least_reserve_and_the_mode_next_to_it():
    """Of a good loop the delay margin, which has no frequency; of a larger Ms that peak, at a mode."""
    found = limiting_margin(CARD.sampled, MODES)
    assert (found.requirement.name, found.is_met, found.omega) == ("delay_margin_periods", True, None)
    omega = MODES.flexible[1]
    peak = Graded(2.5, 1.02 * omega, "low")
    found = limiting_margin(replace(CARD.sampled, peak_sensitivity=peak), MODES)
    assert (found.value, found.is_met, found.mode, found.frequency) == (2.5, False, 2, omega)
    beyond = peak._replace(omega=2 * MODES.flexible[-1])
    assert limiting_margin(replace(CARD.sampled, peak_sensitivity=beyond), MODES).mode is None


def test_costs_are_the_differences_of_both_cards():
    costs = {each.title: each for each in loop_limits(CARD, MODES).costs}
    phase = costs["phase margin"]
    assert phase.loss == pytest.approx(CARD.continuous.phase_margin.value - CARD.sampled.phase_margin.value)
    peak = costs["peak sensitivity"]
    assert peak.loss == pytest.approx(CARD.sampled.peak_sensitivity.value - CARD.continuous.peak_sensitivity.value)


def test_a_loop_without_margins_has_no_limit_and_no_costs():
    unstable = tfarm.result_card(LAB, tfarm.HubFeedback(K1=26.0, K2=-3.0))
    assert unstable.sampled.stability == "unstable"
    found = loop_limits(unstable, MODES)
    assert (found.limiting, found.costs, found.is_good) == (None, (), False)
