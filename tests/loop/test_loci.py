"""Loci as they are drawn and written: whether they reach the end, in which unit, and to how many digits."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shared import thinned
from tfarm import HubFeedback
from tfarm.loop import loci as room
from tfarm.loop.loci import held_branches, loci

LAB = tfarm.load("sasaki2012-lab")
HELD = replace(LAB, hub=replace(LAB.hub, stiffness=2.0))
LAW = HubFeedback(K1=0.3, K2=0.3)


@pytest.mark.parametrize("arm", thinned([HELD, LAB], 2), ids=["held", "free"])
def test_a_range_that_can_be_followed_is_not_cut(arm):
    found = loci(arm, LAW, "K2", 0.0, 0.5)
    assert (found.name, found.exact.gain[0], found.exact.gain[-1]) == ("K2", 0.0, 0.5)


def test_a_gain_has_its_unit():
    assert [loci(LAB, LAW, vary, 0.0, 0.5).unit for vary in ("K1", "K2", "Kp")] == ["N m s/rad", "", "N m/rad"]


def test_what_cannot_be_followed_at_all_is_said(monkeypatch):
    def refused(*_):
        raise tfarm.ConvergenceError("cannot be told apart", 1.0, 1.0)

    monkeypatch.setattr(room, "locus", refused)
    with pytest.raises(tfarm.ConvergenceError, match="told apart"):
        loci(LAB, LAW, "K1", 0.2, 1.2)


def test_ten_digits_of_its_size_are_shown():
    """A small real part beside a large frequency has the digits that |s| leaves it."""
    pole = np.array([-0.123456789012345 + 98.7654321098765j, 0.0])
    assert held_branches(pole) == pytest.approx([-0.12345679 + 98.76543211j, 0.0], rel=1e-15)
    assert abs(held_branches(1e5 * pole) - 1e5 * held_branches(pole)).max() <= 1e-15 * 1e7
