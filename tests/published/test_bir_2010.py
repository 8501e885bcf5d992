"""G. S. Bir (2009, 2010), after Wright and others (1982): a clamped blade at rest, without and with a tip mass."""

import math
from dataclasses import replace

import mpmath
import pytest

from tfarm.audit.literature import SOURCES
from tfarm.audit.published import agrees, case_rows, computed

(SOURCE,) = (source for source in SOURCES if source.key == "bir-2010")
BARE, LOADED = SOURCE.cases


def test_the_first_and_both_with_a_tip_mass_agree() -> None:
    assert [row.agrees for row in case_rows(SOURCE.key, BARE)] == [True, False, False]
    assert all(row.agrees for row in case_rows(SOURCE.key, LOADED))


def test_the_length_is_rounded_and_the_second_frequency_twice() -> None:
    """With 1000^(1/2) m the unit EI/(rhoA L^4) is 1 s^-2, so the third agrees, the second rounded twice."""
    link = replace(BARE.arm.link, length=math.sqrt(1000.0))
    meant = computed(replace(BARE, arm=replace(BARE.arm, link=link))).tolist()
    assert link.EI / (link.rhoA * link.length**4) == pytest.approx(1.0, rel=1e-15)
    assert agrees(meant[2], BARE.printed[2])
    assert not agrees(meant[1], BARE.printed[1])
    assert f"{meant[1]:.4f}" == "22.0345"
    assert agrees(22.0345, BARE.printed[1])


@pytest.mark.parametrize("case", SOURCE.cases, ids=lambda case: case.name)
def test_the_frequency_equation(case) -> None:
    """1 + cos z cosh z + (m/M) z (cos z sinh z - sin z cosh z) = 0."""
    link = case.arm.link
    ratio = case.arm.payload.mass / (link.rhoA * link.length)

    def equation(z):
        return 1 / mpmath.cosh(z) + mpmath.cos(z) + ratio * z * (mpmath.cos(z) * mpmath.tanh(z) - mpmath.sin(z))

    unit = math.sqrt(link.EI / link.rhoA) / link.length**2
    for omega in computed(case):
        z = mpmath.findroot(equation, math.sqrt(omega / unit))
        assert omega == pytest.approx(float(z**2) * unit, rel=1e-13)
