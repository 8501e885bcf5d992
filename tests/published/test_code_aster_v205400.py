"""code_aster, validation manual V2.05.400, case 1: a beam pinned at one end and free at the other."""

import mpmath
import numpy as np
import pytest

import tfarm
from tfarm.audit.literature import SOURCES
from tfarm.audit.published import case_rows, computed

(SOURCE,) = (source for source in SOURCES if source.key == "code-aster-v2.05.400")


def test_the_roots_of_tan_and_tanh() -> None:
    (case,) = SOURCE.cases
    assert all(row.agrees for row in case_rows(SOURCE.key, case))
    for z in computed(case):
        exact = mpmath.findroot(lambda z: mpmath.tan(z) - mpmath.tanh(z), z)
        assert z == pytest.approx(float(exact), rel=1e-14)


def test_the_manuals_first_root_is_the_rigid_body() -> None:
    (case,) = SOURCE.cases
    omega = tfarm.modes(case.arm, 5, theory="euler-bernoulli").natural_frequency
    assert omega[0] == 0.0
    assert omega.size == 1 + len(case.printed)
    assert (np.diff(omega) > 0).all()
