"""The small case of `python -m tests.synthesis.held_designs SIZE SEED`."""

import numpy as np

from tests.synthesis.held_designs import excess
from tfarm.arm import TWO_GAINS


def test_gains_for_a_random_rig_hold_on_another_model():
    over, own, _ = excess(np.random.default_rng([1, 0]), (TWO_GAINS,))
    assert over <= 0
    assert own < 0
