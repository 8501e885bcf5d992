"""Société française des mécaniciens, sheet SDLL15/89: a clamped tube with a tip mass, Euler-Bernoulli theory."""

import math

import mpmath
import pytest

from tfarm.audit.literature import SOURCES
from tfarm.audit.published import agrees, case_rows, computed

(SOURCE,) = (source for source in SOURCES if source.key == "vpcs-sdll15")
(CASE,) = SOURCE.cases


def test_all_but_the_first_agree_in_every_printed_digit() -> None:
    assert [row.agrees for row in case_rows(SOURCE.key, CASE)] == [False, True, True, True]


def test_the_first_is_rayleighs_estimate() -> None:
    """sqrt(3 EI / (L^3 (m + 0.24 M))) / 2 pi, M the beam's mass: its 1.65 agrees, and lies below the exact frequency.

    The static deflection gives 33/140 = 0.2357 of M in its place, and, as Rayleigh's quotient must, a little more.
    """
    link, mass = CASE.arm.link, CASE.arm.payload.mass

    def estimate(share: float) -> float:
        beam = link.rhoA * link.length
        return math.sqrt(3 * link.EI / (link.length**3 * (mass + share * beam))) / (2 * math.pi)

    first = computed(CASE)[0]
    assert agrees(estimate(0.24), CASE.printed[0])
    assert f"{estimate(0.24):.4f}" in CASE.why[1]
    assert f"{first:.4f}" in CASE.why[1]
    assert estimate(0.24) < first < estimate(33 / 140)
    assert estimate(33 / 140) == pytest.approx(first, rel=1e-3)


def test_the_frequency_equation_of_a_tip_mass() -> None:
    """1 + cos z cosh z + (m/M) z (cos z sinh z - sin z cosh z) = 0."""
    link = CASE.arm.link
    ratio = CASE.arm.payload.mass / (link.rhoA * link.length)

    def equation(z):
        return 1 / mpmath.cosh(z) + mpmath.cos(z) + ratio * z * (mpmath.cos(z) * mpmath.tanh(z) - mpmath.sin(z))

    unit = math.sqrt(link.EI / link.rhoA) / link.length**2 / (2 * math.pi)
    for frequency in computed(CASE):
        z = mpmath.findroot(equation, math.sqrt(frequency / unit))
        assert frequency == pytest.approx(float(z**2) * unit, rel=1e-13)
