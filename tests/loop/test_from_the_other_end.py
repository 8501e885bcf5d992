"""A locus that cannot be followed one way is followed the other, and turned: its poles and crossings are the same."""

import numpy as np
import pytest

import tfarm.loop.locus as module
from tfarm import HubFeedback, load, locus
from tfarm.errors import ConvergenceError

LAB = load("sasaki2012-lab")
WAY = LAB, HubFeedback(K1=0.3, K2=0.3), "K2", 0.0, 2.0, 5, 4


def lost(variation, start, stop, number):
    raise ConvergenceError("branches cannot be told apart", start, stop)


def only_downwards(variation, start, stop, number, followed=module.followed):
    return followed(variation, start, stop, number) if start > stop else lost(variation, start, stop, number)


def test_the_other_way_is_the_same(monkeypatch):
    straight = locus(*WAY)
    monkeypatch.setattr(module, "followed", only_downwards)
    turned = locus(*WAY)
    np.testing.assert_array_equal(turned.gain, straight.gain)
    np.testing.assert_allclose(turned.branches, straight.branches, rtol=1e-9, atol=1e-9)
    (one,), (other,) = turned.crossings, straight.crossings
    assert (one.direction, one.branch) == (other.direction, other.branch) == ("unstable", other.branch)
    assert (one.gain, one.omega) == pytest.approx((other.gain, other.omega), rel=1e-9)


def test_what_can_be_followed_neither_way_is_refused(monkeypatch):
    monkeypatch.setattr(module, "followed", lost)
    with pytest.raises(ConvergenceError) as refused:
        locus(*WAY)
    assert refused.value.best == 0.0  # as from the end that was asked for
