"""D(i w) and the count in balls, of arms and of rigs: signs and numbers between frequencies that are known."""

import math

import flint
import numpy as np
import pytest

import tfarm
from tests.rigs import some_rig
from tests.strategies import BOUNDARY_CASES, some_arm
from tfarm.arm import THEORIES
from tfarm.exact import balls
from tfarm.exact.system import system_of
from tfarm.spectrum.frequencies import RealAxis, count_below, pinned_count

COUNT = 7


def undamped(arm):
    return system_of(arm, arm.theory).with_damping(0.0)


def some_systems():
    """Every kind of boundary, and rigs of one to six segments with springs, bodies and offsets."""
    for n, case in enumerate(BOUNDARY_CASES):
        yield some_arm(np.random.default_rng(n), case, damping=0.0)
    for n in range(12):
        yield some_rig(np.random.default_rng([17, n]), damped=False, theory=THEORIES[n % 4])


@pytest.mark.parametrize("arm", list(some_systems()))
def test_the_count_in_ball_arithmetic_is_that_of_the_list(arm):
    """Between the nth frequency and the next n lie below, and D has changed its sign n times."""
    table = tfarm.modes(arm, COUNT)
    k, omega = undamped(arm), table.natural_frequency[table.index > 0]
    between = np.sqrt(omega[1:] * omega[:-1])[np.diff(omega) > 1e-9 * omega[1:]]
    with balls.precision(512):  # of six segments far below the first frequency 200 bits do not suffice
        axis = RealAxis(k)
        for point in (0.5 * omega[0], *between):
            below = int((table.natural_frequency < point).sum())
            assert axis.count(flint.arb(point)) == below == count_below(k, point)
            assert bool(axis.drive(flint.arb(point)) < 0) == (below % 2 == 1)
        assert (
            axis.count(flint.arb(float(omega[0]), 0.1 * float(omega[0]))) is None
        )  # at a frequency nothing is certain


def test_half_waves_are_counted_in_closed_form():
    """n pi < sqrt(-z): of the wave that travels first, and with the second one the shear cut-off is passed."""
    pi = math.pi
    for number in (0, 1, 2, 7):
        inside = -flint.arb(((number + 0.5) * pi) ** 2)
        assert pinned_count([inside, flint.arb(3)]) == number
        assert pinned_count([flint.arb(3), inside]) == number
        assert pinned_count([inside, -flint.arb(1)]) == number + 1
        assert pinned_count([inside, -flint.arb((2.5 * pi) ** 2)]) == number + 3
    assert pinned_count([flint.arb(3), flint.arb(2)]) == 0
    assert pinned_count([-flint.arb(pi**2, 1e-9), flint.arb(3)]) is None
    assert pinned_count([flint.arb(0, 1e-9), flint.arb(3)]) is None
