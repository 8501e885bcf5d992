"""What a controller knows of the hub's rate: its own reading, or the filtered difference of an encoder's angle."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from tfarm.dsp.kernel import estimate

PERIOD, CORNER = 0.01, 120.0


def test_a_filtered_difference_is_the_filter_that_is_said_from_an_angle_that_stood_still():
    """(1 - a)/T (1 - 1/z)/(1 - a/z), by SciPy's filter: of a random walk, wherever it begins."""
    a = math.exp(-CORNER * PERIOD)
    angle = 0.7 + np.cumsum(np.random.default_rng(2).normal(size=50))
    memory = np.zeros(3)
    found = [estimate(each, np.nan, memory, True, a, PERIOD) for each in angle]
    through = (1 - a) / PERIOD
    np.testing.assert_allclose(found, lfilter([through, -through], [1, -a], angle - angle[0]), rtol=1e-9, atol=1e-11)
    assert found[0] == 0.0


@pytest.mark.parametrize("rate", [0.0, -3.0])
def test_a_rate_that_is_read_is_taken_as_it_is(rate):
    assert estimate(1.0, rate, np.zeros(3), False, 0.5, PERIOD) == rate
