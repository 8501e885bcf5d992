"""B. Wang, Z. Wang, X. Zuo (2017), table 1: cantilevers with tip mass and tip inertia, the inertia's sign reversed.

Their column without inertia agrees.  The others are the roots of the right equation for -I_c, and cannot be
frequencies: inertia added to the tip would raise them (Rayleigh forbids it).
"""

import math
from dataclasses import replace
from itertools import pairwise

import mpmath
import numpy as np
import pytest

from tfarm.audit.literature import SOURCES, beam
from tfarm.audit.published import agrees, case_rows, computed

(SOURCE,) = (source for source in SOURCES if source.key == "wang-2017")
PLAIN, *LOADED = SOURCE.cases


def equation(z, mass, inertia):
    """det of tip moment and tip shear over cosh z, for the shapes cosh - cos and sinh - sin that the root allows.

    EI w'' = w^2 I_c w' and EI w''' = -w^2 m w at the tip: C = cosh z and so on, all over cosh z.
    """
    C, S, c, s = mpmath.mpf(1), mpmath.tanh(z), mpmath.cos(z) / mpmath.cosh(z), mpmath.sin(z) / mpmath.cosh(z)
    moment = (C + c - inertia * z**3 * (S + s), S + s - inertia * z**3 * (C - c))
    shear = (S - s + mass * z * (C - c), C + c + mass * z * (S - s))
    return moment[0] * shear[1] - moment[1] * shear[0]


def roots(case, sign):
    """z^2 of the first five roots for this sign of the inertia, by a scan for changes of sign."""
    mass, inertia = case.arm.payload.mass, sign * case.arm.payload.inertia
    found, points = [], np.arange(0.2, 16.0, 0.02).tolist()
    with mpmath.workdps(30):
        values = [mpmath.cosh(z) * equation(mpmath.mpf(z), mass, inertia) for z in points]
        for (low, high), (a, b) in zip(pairwise(points), pairwise(values), strict=True):
            if a * b < 0:
                root = mpmath.findroot(lambda z: equation(z, mass, inertia), (low, high), solver="anderson")
                found.append(float(root**2))
    return found[:5]


def test_without_inertia_every_printed_digit_is_right() -> None:
    assert all(row.agrees for row in case_rows(SOURCE.key, PLAIN))
    assert computed(PLAIN) == pytest.approx(roots(PLAIN, 1), rel=1e-12)


@pytest.mark.parametrize("case", LOADED, ids=lambda case: case.name)
def test_with_inertia_reversed_every_printed_digit_is_theirs(case) -> None:
    assert computed(case) == pytest.approx(roots(case, 1), rel=1e-12)
    assert not any(row.agrees for row in case_rows(SOURCE.key, case))
    assert all(agrees(value, printed) for value, printed in zip(roots(case, -1), case.printed, strict=True))


@pytest.mark.parametrize("case", LOADED, ids=lambda case: case.name)
def test_inertia_on_the_tip_lowers_every_frequency_and_theirs_are_higher(case) -> None:
    bare = replace(case, arm=beam(mass=case.arm.payload.mass))
    assert (computed(case) < computed(bare)).all()
    assert (np.array([float(text) for text in case.printed]) > computed(bare)).all()
    sliding = replace(case, arm=beam(mass=case.arm.payload.mass, inertia=math.inf))
    assert (computed(case)[1:] > computed(sliding)[:-1]).all()  # one more constraint: they interlace
