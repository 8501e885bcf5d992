"""R. D. Blevins (1979), table 8-1: ends that slide without turning, as limits of a hub's radius and a payload's offset.

A hub without inertia whose clamp is far off the axis lets the root slide and not turn, and so does a payload whose
centre is pinned far beyond the tip: 2.365..., 5.498..., which are the table's.  How far is seen by the order in 1/r.
"""

from dataclasses import replace

import mpmath
import numpy as np
import pytest

from tfarm import Hub, Payload
from tfarm.audit.published import ALL, case_rows, computed

(SOURCE,) = (source for source in ALL if source.key == "blevins-1979-sliding")
PARTS = {
    "root": lambda far: {"hub": Hub(inertia=0.0, radius=far)},
    "tip": lambda far: {"payload": Payload(mass=np.inf, offset=far)},
}


@pytest.mark.parametrize("case", SOURCE.cases, ids=lambda case: case.name)
def test_every_printed_digit_is_right(case):
    assert all(row.agrees for row in case_rows(SOURCE.key, case))
    with mpmath.workdps(30):
        for root in computed(case).tolist():
            assert root == pytest.approx(
                float(mpmath.findroot(lambda z: mpmath.tan(z) + mpmath.tanh(z), root)), rel=1e-9
            )


@pytest.mark.parametrize("end", PARTS)
def test_the_limit_is_reached_with_one_over_the_distance(end):
    """A tenth of the distance left, ten times the difference: both ends alike, one the other's mirror image."""
    case = dict(zip(PARTS, SOURCE.cases, strict=True))[end]
    limit = computed(case)
    near, far = (computed(replace(case, arm=replace(case.arm, **PARTS[end](r)))) - limit for r in (1e4, 1e5))
    assert near == pytest.approx(10 * far, rel=1e-3)
