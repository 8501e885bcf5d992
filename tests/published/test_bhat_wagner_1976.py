"""B. R. Bhat and H. Wagner (1976), J. Sound Vib. 45, 304-307: a cantilever whose tip mass is slender along its axis.

No copy was at hand: what is compared is the frequency equation of a clamped Euler-Bernoulli beam with a rigid body of
mass m, inertia I_c and centre e beyond its tip: w'' = z^4 (j w' + m e w) and w''' = -z^4 m (w + e w')
there (L = rhoA = EI = 1, frequency z^2, j = I_c + m e^2).  Their body is a slender rod, I_c = m e^2/3.
"""

from dataclasses import replace
from itertools import pairwise

import mpmath
import pytest

from tests.published.chains import natural_frequencies
from tfarm import Payload
from tfarm.audit.literature import beam
from tfarm.audit.published import ALL, agrees, case_rows

(SOURCE,) = (source for source in ALL if source.key == "bhat-wagner-1976")


def expanded(z, m, e, j):
    """The determinant of `conditions`, written out."""
    s, c, sh, ch = mpmath.sin(z), mpmath.cos(z), mpmath.sinh(z), mpmath.cosh(z)
    plain = 1 + c * ch + m * z * (c * sh - s * ch) - 2 * m * e * z**2 * s * sh
    return plain - j * z**3 * (s * ch + c * sh) + m * (j - m * e**2) * z**4 * (1 - c * ch)


def conditions(z, m, e, j):
    """Both conditions at the tip of w = sin z x - sinh z x and w = cos z x - cosh z x: the rows of a matrix."""
    s, c, sh, ch = mpmath.sin(z), mpmath.cos(z), mpmath.sinh(z), mpmath.cosh(z)
    w, slope = (s - sh, c - ch), (z * (c - ch), -z * (s + sh))
    bend, shear = (-(z**2) * (s + sh), -(z**2) * (c + ch)), (-(z**3) * (c + ch), z**3 * (s - sh))
    rows = [
        (bend[i] - z**4 * (j * slope[i] + m * e * w[i]), shear[i] + z**4 * m * (w[i] + e * slope[i])) for i in (0, 1)
    ]
    return mpmath.matrix(rows)


def parts(case):
    """m, e and j of the body, as the float64 numbers that they are."""
    body = case.arm.payload
    m, e, I_c = (mpmath.mpf(number) for number in (body.mass, body.offset, body.inertia))
    return m, e, I_c + m * e**2


@pytest.mark.parametrize("case", SOURCE.cases, ids=lambda case: case.name)
def test_every_digit_is_a_root_s(case):
    """The equation written out gives the digits that stand in the table, and is the determinant of the conditions."""
    with mpmath.workdps(30):
        m, e, j = parts(case)
        assert abs(j - m * e**2 * 4 / 3) < 1e-15
        for printed in case.printed:
            root = mpmath.findroot(lambda z: expanded(z, m, e, j), mpmath.mpf(printed))
            assert agrees(float(root), printed)
            size = abs(mpmath.diff(lambda z: mpmath.det(conditions(z, m, e, j)), root)) * root
            assert abs(mpmath.det(conditions(root, m, e, j))) < 1e-25 * size
    assert all(row.agrees for row in case_rows(SOURCE.key, case))


def test_none_of_the_first_ten_is_left_out_and_each_is_exact():
    """Ten frequencies of one body, by the equation's changes of sign."""
    m, e = 1.0, 0.25
    arm = replace(beam(), payload=Payload(mass=m, inertia=m * e**2 / 3, offset=e), theory="euler-bernoulli")
    found = natural_frequencies(arm, 10) ** 0.5
    j = m * e**2 * 4 / 3
    grid = mpmath.linspace(0.01, float(found[-1]) + 0.1, 600)
    signs = [mpmath.sign(expanded(z, m, e, j)) for z in grid]
    assert sum(a != b for a, b in pairwise(signs)) == 10
    with mpmath.workdps(40):
        for root in found.tolist():
            assert root == pytest.approx(float(mpmath.findroot(lambda z: expanded(z, m, e, j), root)), rel=1e-14)


def test_the_offset_is_felt():
    """With the centre on the tip every frequency is another: the digits tell an offset from none."""
    for case in SOURCE.cases:
        payload = replace(case.arm.payload, offset=0.0)
        moved = case_rows(SOURCE.key, replace(case, arm=replace(case.arm, payload=payload)))
        assert min(abs(row.difference) for row in moved) > 1e-3
