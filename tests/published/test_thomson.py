"""W. T. Thomson, Theory of Vibration with Applications (2010), appendix D: beams clamped at one end and at both."""

import math

import mpmath
import pytest

from tfarm.audit.literature import REDUCED, SOURCES
from tfarm.audit.published import case_rows, computed

(SOURCE,) = (source for source in SOURCES if source.key == "thomson-appendix-d")
SIGN = {"clamped-free": 1, "clamped-clamped": -1}  # cos z + sign / cosh z = 0


@pytest.mark.parametrize("case", SOURCE.cases, ids=lambda case: f"{case.name} {case.quantity}")
def test_every_printed_digit_is_right(case) -> None:
    assert all(row.agrees for row in case_rows(SOURCE.key, case))
    for ours in computed(case):
        guess = math.sqrt(ours) if case.quantity == REDUCED else ours
        z = mpmath.findroot(lambda z: mpmath.cos(z) + SIGN[case.name] / mpmath.cosh(z), guess)
        assert ours == pytest.approx(float(z**2 if case.quantity == REDUCED else z), rel=1e-14)


def test_its_two_columns_are_squares_of_each_other() -> None:
    first, second = SOURCE.cases[:2]
    assert computed(first) ** 2 == pytest.approx(computed(second), rel=1e-15)
