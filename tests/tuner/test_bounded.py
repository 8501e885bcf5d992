"""A small sample of `python -m tests.tuner.bounded 1000`, and that its adversary has teeth."""

import numpy as np

import tfarm
from tests.survey import tally
from tests.tuner import bounded
from tests.tuner.bounded import adversary
from tfarm.arm import HubFeedback
from tfarm.dsp import sampled_loop
from tfarm.tuner.sector import MovingGain


def test_guarded_runs_stay_bounded_and_in_the_guard():
    outcomes, _, wrong = tally(bounded.runs, 2, 1)  # whose first arm has a sector, found soon
    assert (outcomes["run"], wrong) == (2, 0)


def test_the_adversary_has_teeth():
    """HubFeedback that are stable one by one: beyond a sector it drives the loop unstable, inside one it cannot."""
    loop = MovingGain(sampled_loop(tfarm.load("sasaki2012-lab"), HubFeedback(K1=0.3, K2=1.0), count=6))
    grown = {ends: adversary(loop, *ends, np.random.default_rng(0), 1) for ends in ((0, 1.1), (0.1, 0.6), (0.31, 0.63))}
    assert grown[0, 1.1] > 50
    assert grown[0.1, 0.6] > 5
    assert grown[0.31, 0.63] < 0
