"""Where the first mode is damped most along K1: on any grid of the locus, and by poles found one gain at a time."""

import numpy as np
import pytest

import tfarm
from tfarm.loop.most_damped import damping_ratios, most_damped
from tfarm.spectrum.table import default_gains, rate_unit

LAB = tfarm.load("sasaki2012-lab")
LAW = default_gains(LAB)


def ratio_at(K1):
    """Of the exact pole that swings most slowly, from the complete list in a box."""
    poles = tfarm.closed_loop_poles(LAB, LAW.having("K1", K1), 8).values
    swinging = poles[poles.imag > 0]
    return float(damping_ratios(swinging[[np.argmin(abs(swinging))]])[0])


def along(points, stop=None):
    stop = 2 * rate_unit(LAB) if stop is None else stop
    return most_damped(tfarm.locus(LAB, LAW, "K1", 0.0, stop, points=points, branches=4))


def test_it_is_the_same_on_any_grid_and_the_largest_of_its_neighbours():
    coarse, fine = along(30), along(200)
    assert coarse.gain == pytest.approx(fine.gain, rel=1e-6)
    assert coarse.damping_ratio == pytest.approx(fine.damping_ratio, rel=1e-10)
    assert coarse.swings_on
    assert coarse.falls
    assert ratio_at(coarse.gain) == pytest.approx(coarse.damping_ratio, rel=1e-9)
    assert max(ratio_at(0.999 * coarse.gain), ratio_at(1.001 * coarse.gain)) < coarse.damping_ratio


def test_at_the_end_of_a_range_it_is_what_is_there():
    short = along(20, stop=2.0)
    assert short.gain == 2.0
    assert not short.falls
    assert short.damping_ratio == pytest.approx(ratio_at(2.0), rel=1e-9)


def test_of_another_number_than_a_gain_nothing_is_said():
    assert most_damped(tfarm.locus(LAB, LAW, "payload_mass", 0.0, 0.1, points=10, branches=4)) is None
