"""Loci of a hub that weighs nothing and rubs: no algebraic loop, whose poles are those that a box is searched for."""

from dataclasses import replace

import numpy as np
import pytest

from tfarm import Hub, HubFeedback, closed_loop_poles, load, locus
from tfarm.errors import ParameterError

RUBBING = replace(load("sasaki2012-lab"), hub=Hub(inertia=0.0, friction=2.0))
LAW = HubFeedback(K1=0.5, K2=0.3)


@pytest.mark.parametrize(("vary", "start", "stop"), [("Kp", -2.0, 20.0), ("K2", -1.0, 0.9), ("K1", -1.9, 5.0)])
def test_branches_are_poles(vary, start, stop):
    found = locus(RUBBING, LAW, vary, start, stop, 5, 3)
    for n in (1, 3):
        poles = closed_loop_poles(RUBBING, LAW.having(vary, float(found.gain[n])), 8).values
        for branch in found.branches[:, n]:
            assert np.abs(poles - complex(branch.real, abs(branch.imag))).min() <= 1e-9 * abs(branch)


@pytest.mark.parametrize("ends", [(-3.0, 5.0), (1.0, -2.0)])
def test_where_the_gain_takes_off_what_the_hub_loses_it_is_told_why_not(ends):
    with pytest.raises(ParameterError, match="a pole passes through infinity at K1 = -2"):
        locus(RUBBING, LAW, "K1", *ends, 5, 3)
