"""Loci of a sampled loop as they are drawn: round in the z-plane, and poles at every value."""

import math

import numpy as np
import pytest

import tfarm
from tfarm import HubFeedback
from tfarm.dsp import Chain, Sampling, sampled_loop
from tfarm.dsp.edges import another
from tfarm.dsp.modes import RIM, STRONGER, sampled_loci, sampled_locus

LAB = tfarm.load("sasaki2012-lab")
GAINS = HubFeedback(K1=0.3, K2=0.3)


@pytest.fixture(scope="module")
def found():
    return sampled_loci(sampled_loop(LAB, GAINS, Chain(sampling=Sampling(period=0.01)), count=6), 25.0, (-0.5, 1.5))


@pytest.mark.parametrize("which", ["K1", "K2"])
def test_a_branch_turns_by_less_than_two_and_a_half_degrees_where_it_is_seen(found, which):
    """The picture is 2 RIM wide and high; pieces below a five hundredth of it, and corners at z real, are left out."""
    drawn = found.by[which]
    turns = []
    for z in np.where((drawn.z.imag > 0) & (abs(drawn.z) < RIM), drawn.z, np.nan).T:
        piece = np.diff(z) / (2 * RIM)
        seen, both = abs(piece) > 2e-3, np.isfinite(piece[1:]) & np.isfinite(piece[:-1])
        turns.extend(abs(np.angle(piece[1:] * piece[:-1].conj()))[both & (seen[1:] | seen[:-1])])
    turns = np.array(turns)
    assert turns.size > 5
    assert turns.max() <= math.radians(2.5)


def test_each_point_of_a_locus_is_a_pole_of_its_loop(found):
    for name, drawn in found.by.items():
        for n in range(0, drawn.values.size, drawn.values.size // 4):
            poles = found.loop.having(**{name: float(drawn.values[n])}).poles.z
            listed = drawn.z[n][np.isfinite(drawn.z[n])]
            assert max(abs(poles - z).min() for z in listed) < 1e-9
    assert found.half_rate == 50.0
    hertz = tfarm.modes(LAB, 6).natural_frequency / (2 * math.pi)
    assert [found.is_aliased(mode) for mode in (1, 2, 3)] == [bool(hertz[mode] > 50.0) for mode in (1, 2, 3)]


def test_a_branch_is_named_after_the_mode_whose_pole_it_leaves(found):
    """With next to no gain, which moves a pole by less than 1e-4, both branches of a mode lie at e^{pT} of its pair."""
    eigenvalues = tfarm.damped_modes(tfarm.modes(LAB, 6)).eigenvalues
    alone = sampled_locus(found.loop.having(K2=0.0), "K1", np.geomspace(1e-3, STRONGER, 31) * GAINS.K1)
    start, mode = alone.z[0], alone.mode
    for number, pair in zip(range(1, 7), eigenvalues[-6:], strict=True):
        mine = np.sort_complex(start[mode == number])
        np.testing.assert_allclose(mine, np.sort_complex(np.exp(pair * 0.01)), rtol=0, atol=1e-4)


@pytest.mark.parametrize(("count", "most", "other"), [(5, 40, 10), (20, 40, 40), (21, 40, 10), (1, 1, 1), (3, 5, 1)])
def test_a_figure_is_compared_with_that_of_twice_or_half_the_modes(count, most, other):
    assert another(count, most) == other
