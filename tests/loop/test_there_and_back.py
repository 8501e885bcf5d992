"""A branch may go right of the axis and back between two values of a locus: its crossings are listed all the same."""

import numpy as np
import pytest

from tfarm import Arm, Hub, HubFeedback, Link, Section, locus, margins

DEEP = Arm(  # 0.1 wide and 0.2 deep: at C = 2e-6 s there are unstable windows at negative K2
    link=Link(
        length=1.0,
        density=7800.0,
        youngs_modulus=2.1e11,
        shear_modulus=8e10,
        section=Section.general(area=0.02, second_moment=0.1 * 0.2**3 / 12, shear_factor=5 / 6),
        damping=2e-6,
    ),
    hub=Hub(inertia=1.0),
)
LAW = HubFeedback(K1=1.0)


def places(found):
    return [(each.gain, each.omega, each.direction) for each in found.crossings]


def test_few_values_have_the_crossings_of_many():
    coarse, fine = locus(DEEP, LAW, "K2", -14.0, -6.0, 3, 9), locus(DEEP, LAW, "K2", -14.0, -6.0, 17, 9)
    assert [each.branch for each in fine.crossings] == [6, 6]  # seen on the branch itself
    assert [each[2] for each in places(coarse)] == [each[2] for each in places(fine)] == ["unstable", "stable"]
    np.testing.assert_allclose([each[:2] for each in places(coarse)], [each[:2] for each in places(fine)], rtol=1e-9)


def test_they_are_the_ends_of_the_windows():
    ends = [end for window in margins(DEEP, LAW).windows["K2"].all for end in window if -14 < end < -6]
    backwards = locus(DEEP, LAW, "K2", -6.0, -14.0, 3, 9)
    assert [each.gain for each in backwards.crossings] == pytest.approx(sorted(ends, reverse=True), rel=1e-9)
    assert backwards.finding.startswith("a pole becomes unstable at K2 = -8.48297, stable at K2 = -11.4716")


def test_without_damping_nothing_is_made_up():
    assert not locus(DEEP.having(damping=0.0), LAW, "K2", -14.0, -6.0, 5, 9).crossings
