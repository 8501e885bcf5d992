"""F. Bellezza, L. Lanari, G. Ulivi (1990), Exact modeling of the flexible slewing link: a link on a turning hub.

No copy was at hand: what is compared is the frequency equation of an Euler-Bernoulli link (L = rhoA = EI = 1, frequency
z^2) on a free hub of inertia J, with the terms that a clamp at the radius r from the axis adds.  The link starts with
w = r theta and w' = theta, its tip is free, and J z^4 theta + w''(0) - r w'''(0) = 0.
"""

import math
from dataclasses import replace
from itertools import pairwise

import mpmath
import pytest

from tests.published.chains import natural_frequencies
from tfarm import Hub
from tfarm.audit.literature import beam
from tfarm.audit.published import ALL, agrees, case_rows

(SOURCE,) = (source for source in ALL if source.key == "bellezza-lanari-ulivi-1990")


def expanded(z, J, r):
    """The determinant of `conditions`, written out; r = 0 leaves the paper's."""
    s, c, sh, ch = mpmath.sin(z), mpmath.cos(z), mpmath.sinh(z), mpmath.cosh(z)
    return J * z**3 * (1 + c * ch) + s * ch - c * sh + 2 * r * z * s * sh + (r * z) ** 2 * (s * ch + c * sh)


def conditions(z, J, r):
    """Free tip and hub, of the waves cos, sin, cosh and sinh of z x with theta = w'(0): rows of a 4x4 matrix."""
    s, c, sh, ch = mpmath.sin(z), mpmath.cos(z), mpmath.sinh(z), mpmath.cosh(z)
    start = [(1, 0, -(z**2), 0), (0, z, 0, -(z**3)), (1, 0, z**2, 0), (0, z, 0, z**3)]  # w, w', w'', w''' at 0
    return mpmath.matrix([
        [-c, -s, ch, sh],
        [s, -c, sh, ch],
        [w - r * slope for w, slope, _, _ in start],
        [J * z**4 * slope + bend - r * shear for _, slope, bend, shear in start],
    ])  # fmt: skip


@pytest.mark.parametrize("case", SOURCE.cases, ids=lambda case: case.name)
def test_every_digit_is_a_root_s(case):
    """The equation written out gives the digits that stand in the table, and is the determinant of the conditions."""
    with mpmath.workdps(30):
        J, r = mpmath.mpf(case.arm.hub.inertia), mpmath.mpf(case.arm.hub.radius)
        for printed in case.printed:
            root = mpmath.findroot(lambda z: expanded(z, J, r), mpmath.mpf(printed))
            assert agrees(float(root), printed)
            size = abs(mpmath.diff(lambda z: mpmath.det(conditions(z, J, r)), root)) * root
            assert abs(mpmath.det(conditions(root, J, r))) < 1e-25 * size
    assert all(row.agrees for row in case_rows(SOURCE.key, case))


def test_none_of_the_first_ten_is_left_out_and_each_is_exact():
    """Ten frequencies of one hub, by the equation's changes of sign."""
    J, r = 0.1, 0.2
    arm = replace(beam(), hub=Hub(inertia=J, radius=r), theory="euler-bernoulli")
    found = natural_frequencies(arm, 10) ** 0.5
    signs = [mpmath.sign(expanded(z, J, r)) for z in mpmath.linspace(0.5, float(found[-1]) + 0.1, 600)]
    assert sum(a != b for a, b in pairwise(signs)) == 10
    with mpmath.workdps(40):
        for root in found.tolist():
            assert root == pytest.approx(float(mpmath.findroot(lambda z: expanded(z, J, r), root)), rel=1e-14)


def test_the_radius_is_felt_on_a_free_hub_and_not_on_a_locked_one():
    for case in SOURCE.cases:
        if case.arm.hub.radius:
            on_the_axis = replace(case.arm, hub=replace(case.arm.hub, radius=0.0))
            assert abs(case_rows(SOURCE.key, replace(case, arm=on_the_axis))[0].difference) > 1e-3
    locked = [natural_frequencies(replace(beam(), hub=Hub(inertia=math.inf, radius=r)), 3) for r in (0.0, 0.5)]
    assert locked[0] == pytest.approx(locked[1], rel=1e-13)
