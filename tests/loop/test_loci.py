"""Loci as they are drawn and written: whether they reach the end, in which unit, and to how many digits."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.shared import thinned
from tfarm import HubFeedback
from tfarm.loop import loci as room
from tfarm.loop.ended import with_others
from tfarm.loop.loci import held_branches, loci
from tfarm.loop.locus import locus
from tfarm.loop.reduced_locus import reduced_locus
from tfarm.loop.variation import Variation

LAB = tfarm.load("sasaki2012-lab")
HELD = replace(LAB, hub=replace(LAB.hub, stiffness=2.0))
LAW = HubFeedback(K1=0.3, K2=0.3)


@pytest.mark.parametrize("arm", thinned([HELD, LAB], 2), ids=["held", "free"])
def test_a_range_that_can_be_followed_is_not_cut(arm):
    found = loci(arm, LAW, "K2", 0.0, 0.5)
    assert not found.is_cut
    assert (found.name, found.exact.gain[0], found.exact.gain[-1]) == ("K2", 0.0, 0.5)


def test_a_gain_has_its_unit():
    assert [loci(LAB, LAW, vary, 0.0, 0.5).unit for vary in ("K1", "K2", "Kp")] == ["N m s/rad", "", "N m/rad"]


@pytest.mark.parametrize("refused", thinned([3, 1, 2, 0], 2))
def test_where_branches_cannot_be_followed_fewer_are_and_less_far(monkeypatch, refused):
    """7, then 4, then to three quarters, then 2 to the half of the range."""
    asked = []

    def followed(*given):
        asked.append(given[-1])
        if len(asked) <= refused:
            raise tfarm.ConvergenceError("cannot be told apart", 1.0, 1.0)
        return locus(*given)

    monkeypatch.setattr(room, "locus", followed)
    found = loci(LAB, LAW, "K1", 0.2, 1.2)
    assert asked == [7, 4, 4, 2][: refused + 1]
    assert found.exact.gain[-1] == pytest.approx([1.2, 1.2, 0.95, 0.7][refused], rel=1e-15)
    assert found.is_cut == (refused > 1)
    assert found.reduced.worst == reduced_locus(found.exact).worst


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


def test_a_crossing_is_known_by_its_gain_and_its_frequency():
    """One of another frequency at the same gain, or of another gain at the same frequency, is another one."""
    variation, gain = Variation(LAB, HubFeedback(K1=0.3, K2=0.3), "K2"), np.linspace(-1.0, 2.0, 4)
    branches = np.full((1, 4), -1.0 + 100j)
    true = with_others(variation, gain, branches, ())
    assert len(true) > 0
    first = replace(true[0], branch=0)
    for seen, number in ((first, 0), (replace(first, omega=0.5 * first.omega), 1), (replace(first, gain=0.5), 1)):
        assert len(with_others(variation, gain, branches, (seen,))) == len(true) + number
