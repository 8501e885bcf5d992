"""Windows between crossings some of which rounding has made: what is asked at a gain itself decides."""

import math

from tfarm.crossing import Crossings
from tfarm.crossing.line import confirmed

TRUE = [(-2.0, 0.7, -2), (3.0, 1.1, 2)]
FALSE = [
    (-1.0, 1e-13, 2),
    (0.5, 1e-14, 2),
    (20.0, 1e-13, -2),
    (30.0, 1e-15, -2),
    (40.0, 1e-13, -2),
    (50.0, 1e-13, -2),
]  # next to z = 1


def holds(gain):
    return -2 < gain < 3


def test_a_window_is_found_where_the_counts_are_wrong():
    for false in ([], FALSE):
        assert confirmed(Crossings.of(TRUE + false), -math.inf, math.inf, holds) == [(-2.0, 3.0)]


def test_where_nothing_holds_there_is_none():
    assert confirmed(Crossings.of(TRUE + FALSE), -math.inf, math.inf, lambda gain: False) == []
