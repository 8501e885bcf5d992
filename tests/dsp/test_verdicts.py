"""A small sample of `python -m tests.dsp.verdicts 1000`."""

from dataclasses import replace

import numpy as np
import pytest

from tests.dsp.verdicts import encirclements, loops, simulated_growth, some_case
from tests.survey import each_of, tally
from tfarm.arm import HubFeedback
from tfarm.dsp import sampled_loop, sampled_verdict


def test_the_verdict_is_what_simulations_and_encirclements_say():
    outcomes, _, wrong = tally(each_of(loops), 3, 7)
    assert 1 <= outcomes["stable"] <= 2
    assert (outcomes["stable"] + outcomes["unstable"], outcomes.total(), wrong) == (3, 3, 0)


def test_the_sample_can_tell():
    """With the sign of K2 mistaken in the simulation the verdicts differ: the comparison is no tautology."""
    rng, wrong = np.random.default_rng(7), 0
    for _ in range(8):
        if wrong == 2:
            break
        case = some_case(rng)
        verdict = sampled_verdict(case.arm, case.gains, case.chain)
        mistaken = replace(case, gains=HubFeedback(K1=case.gains.K1, K2=-case.gains.K2))
        if abs(verdict.loop.poles.log_spectral_radius) < 1e-3:
            continue
        growth = simulated_growth(mistaken, verdict.loop.poles.log_spectral_radius, verdict.modes_used)
        wrong += verdict.is_stable != (growth <= 1) or encirclements(mistaken) != encirclements(case)
    assert wrong == 2


def test_more_modes_do_not_change_a_settled_verdict():
    """As many as the verdict took, against three times as many, on arms with little damping too."""
    rng = np.random.default_rng(2)
    for _ in range(1):
        case = some_case(rng)
        verdict = sampled_verdict(case.arm, case.gains, case.chain)
        assert verdict.is_settled
        poles = sampled_loop(case.arm, case.gains, case.chain, count=3 * verdict.modes_used).poles
        settled = verdict.loop.poles
        assert poles.log_spectral_radius == pytest.approx(settled.log_spectral_radius, rel=1e-4, abs=1e-12)
        assert (poles.log_radius > 0).sum() == (settled.log_radius > 0).sum()
