"""Poles of the sampled loop: published figures, the first-order law, the finite-gain form, rates by difference."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.arm import Hub, HubFeedback
from tfarm.case import Case
from tfarm.dsp import Actuator, Chain, Converters, Sampling
from tfarm.errors import ParameterError
from tfarm.loop.sampled import sampled_loop
from tfarm.loop.sampled_modes import STRONGER, dominant, mode_table, sampled_loci, sampled_locus

pytestmark = pytest.mark.kernels

T = 0.01


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 1.3, 2.0])
def test_small_gains_follow_the_law(lossless, delay):
    """ln|z| = -b^2 sin(q/2) [(K1/w) cos((d + 1/2) q) + (K2 I_h - Kp/w^2) sin((d + 1/2) q)] for the first ten modes."""
    chain = Chain(sampling=Sampling(delay_samples=delay))
    modes = tfarm.modes(lossless, 10)
    w, b = modes.natural_frequency[1:], modes.hub_participation[1:]
    for K1, K2, Kp in ((1e-5, 0.0, 0.0), (0.0, 1e-5, 0.0), (1e-6, 2e-5, 0.0), (0.0, 1e-6, 1e-4)):
        table = mode_table(sampled_loop(Case(lossless, HubFeedback(K1=K1, K2=K2, Kp=Kp), chain), count=14))
        law = table.first_order[:10]
        second = 1e-4 * b**2 * (K1 / w + K2 * 0.1 + Kp / w**2)  # where the law is zero, the second order is not
        assert np.all(abs(table.log_radius[:10] - law) <= 0.01 * abs(law) + second)
        q = w * T
        by_hand = K1 / w * np.cos((delay + 0.5) * q) + (K2 * 0.1 - Kp / w**2) * np.sin((delay + 0.5) * q)
        np.testing.assert_allclose(law, -(b**2) * np.sin(q / 2) * by_hand, rtol=1e-9, atol=1e-9 * second.max())


@pytest.mark.parametrize("Kp", [0.0, 0.7])
def test_the_polished_poles_are_the_eigenvalues_of_the_matrix(lab, Kp):
    """All of them, apart from the z = 1 of a free hub angle, which the whole matrix has."""
    late = Chain(sampling=Sampling(delay_samples=1.5))
    loop = sampled_loop(Case(lab, HubFeedback(K1=0.3, K2=0.3, Kp=Kp), late), count=10)
    whole = np.linalg.eigvals(loop.matrix())
    ours = loop.poles.z[abs(loop.poles.z) > 0.2]
    assert (min(abs(whole - 1)) < 1e-12) == loop.has_free_angle == (Kp == 0)
    for z in ours:
        assert min(abs(whole - z)) < 1e-11
    assert np.isclose(abs(loop(ours)), 0, atol=1e-9).all()
    assert len(loop.matrix()) == len(loop.poles.z) + (Kp == 0)


@pytest.mark.parametrize("delay", [0.0, 0.6])
@pytest.mark.parametrize("Kp", [0.0, 0.5])
@pytest.mark.parametrize("hub_damping", [0.0, 0.4])
def test_a_rate_by_difference_is_in_the_matrix_as_in_F(lab, delay, Kp, hub_damping):
    """z = roots of 1 + Kp Theta + K1 (1 - a)(z - 1)/(T (z - a)) Theta + K2 M."""
    chain = Chain(
        sampling=Sampling(delay_samples=delay, antialias_corner=600.0),
        converters=Converters(hub_rate="difference", rate_filter=200.0),
        actuator=Actuator(hub_damping=hub_damping),
    )
    loop = sampled_loop(Case(lab, HubFeedback(K1=0.3, K2=0.25, Kp=Kp), chain), count=8)
    z = loop.poles.z[abs(loop.poles.z) > 0.2]
    assert z.size >= 8
    np.testing.assert_allclose(abs(loop(z)), 0, atol=1e-8)
    a = np.exp(-200.0 * T)
    angle, moment = loop.pulse(z)
    by_hand = 1 + Kp * angle + 0.3 * (1 - a) * (z - 1) / (T * (z - a)) * angle + 0.25 * moment
    np.testing.assert_allclose(abs(by_hand), 0, atol=1e-7)


SIZE = 1e-4  # of a gain: the difference over both signs is right to its square, and to the rounding of ln|z| over it


def added(loop, by):
    """What a gain of that name alone adds to ln|z| of each listed mode, by the loop's own poles at a tiny gain."""
    less, more = (loop.times(0.0).with_number(by, sign * SIZE * loop.number(by)).poles for sign in (-1, 1))

    def largest(poles, n):
        return poles.log_radius[poles.mode == n].max()

    return np.array([(largest(more, n) - largest(less, n)) / (2 * SIZE) for n in mode_table(loop).index])


CHAINS = {
    "as it is": Chain(),
    "late": Chain(sampling=Sampling(delay_samples=1.3)),
    "filtered": Chain(sampling=Sampling(antialias_corner=200.0)),
    "differences": Chain(converters=Converters(hub_rate="difference", rate_filter=200.0)),
    "damped hub": Chain(actuator=Actuator(hub_damping=0.3)),
}


@pytest.mark.parametrize("name", CHAINS)
@pytest.mark.parametrize("arm", ["sasaki2012-lab", "quanser-flexlink"])
def test_the_first_order_effect_of_a_gain_is_that_of_a_tiny_gain(arm, name):
    """Through delay, filter, difference and a lag of the motor; an arm's own damping is taken for what it is."""
    arm, chain = tfarm.load(arm), CHAINS[name]
    loop = sampled_loop(Case(arm, HubFeedback(K1=0.02, K2=0.3), chain), count=5)
    table = mode_table(loop)
    assert table.index.size >= 4
    for by, found in (("K1", table.by_rate), ("K2", table.by_moment)):
        assert found == pytest.approx(added(loop, by), rel=1e-4, abs=1e-14 / SIZE)


def test_on_a_spring_moment_feedback_drives_the_mode_that_the_spring_makes(lab):
    """I_h theta'' = u + M - k theta: below sqrt(k/I_h) the moment is with the angle, and late it drives."""
    arm = replace(lab, hub=replace(lab.hub, stiffness=3.0), link=replace(lab.link, damping=0.0))
    table = mode_table(sampled_loop(Case(arm, HubFeedback(K1=0.001, K2=0.3)), count=6))
    assert table.natural_frequency[0] < np.sqrt(3.0 / lab.hub.inertia) < table.natural_frequency[1]
    assert table.index[table.by_moment > 0].tolist() == [1]


def test_a_locked_hub_has_no_loop_and_a_free_pin_none_by_moment(lab):
    locked = replace(lab, hub=Hub(inertia=np.inf))
    with pytest.raises(ParameterError, match="no loop"):
        sampled_loop(Case(locked, HubFeedback(K1=0.3, K2=0.3)))
    pin = replace(lab, hub=Hub(inertia=0.0))
    with pytest.raises(ParameterError, match="algebraic loop"):
        sampled_loop(Case(pin, HubFeedback(K1=0.3, K2=0.3)))
    assert sampled_loop(Case(pin, HubFeedback(K1=0.1, K2=0.0)), count=6).poles.z.size > 10


@pytest.mark.parametrize("period", [0.003, 0.01, 0.04])
def test_each_mode_is_seen_where_its_samples_turn(lossless, period):
    """Samples have cos(w T) of a mode alone: it appears at arccos(cos(w T))/T, the aliased frequency."""
    chain = Chain(sampling=Sampling(period=period))
    table = mode_table(sampled_loop(Case(lossless, HubFeedback(K1=0.1), chain), count=8))
    turned = table.natural_frequency * period
    np.testing.assert_allclose(table.aliased, np.arccos(np.cos(turned)) / period, rtol=1e-6)
    folded = np.where(table.band % 2 == 0, table.aliased * period, np.pi - table.aliased * period)
    np.testing.assert_allclose(turned, table.band * np.pi + folded, rtol=1e-9)
    assert table.band.max() > 1


LAB = tfarm.load("sasaki2012-lab")
GAINS = HubFeedback(K1=0.3, K2=0.3)


@pytest.fixture(scope="module")
def found():
    return sampled_loci(sampled_loop(Case(LAB, GAINS), count=6), 25.0, (-0.5, 1.5))


def test_each_point_of_a_locus_is_a_pole_of_its_loop(found):
    for name, drawn in found.by.items():
        for n in range(0, drawn.values.size, drawn.values.size // 4):
            poles = found.loop.with_number(name, float(drawn.values[n])).poles.z
            listed = drawn.z[n][np.isfinite(drawn.z[n])]
            assert max(abs(poles - z).min() for z in listed) < 1e-9
    assert found.half_rate == 50.0
    hertz = tfarm.modes(LAB, 6).natural_frequency / (2 * math.pi)
    assert [found.is_aliased(mode) for mode in (1, 2, 3)] == [bool(hertz[mode] > 50.0) for mode in (1, 2, 3)]


def test_a_branch_is_named_after_the_mode_whose_pole_it_leaves(found):
    """With next to no gain, which moves a pole by less than 1e-4, both branches of a mode lie at e^{pT} of its pair."""
    eigenvalues = tfarm.damped_modes(tfarm.modes(LAB, 6)).eigenvalues
    alone = sampled_locus(found.loop.with_number("K2", 0.0), "K1", np.geomspace(1e-3, STRONGER, 31) * GAINS.K1)
    start, mode = alone.z[0], alone.mode
    for number, pair in zip(range(1, 7), eigenvalues[-6:], strict=True):
        mine = np.sort_complex(start[mode == number])
        np.testing.assert_allclose(mine, np.sort_complex(np.exp(pair * 0.01)), rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("K2", "named", "nameless"), [(0.3, "the hub", "the hub"), (1.4, "mode 1", "an unassigned mode")]
)
def test_the_dominant_pole_has_the_name_of_its_mode_or_none(K2, named, nameless):
    """A pole that rings is none of the hub's, whether its mode is known or not."""
    loop = sampled_loop(Case(tfarm.load("sasaki2012-lab"), HubFeedback(K1=0.3, K2=K2)))
    assert dominant(loop) == named
    sensed = loop.rig.sensed
    without = replace(sensed, plants=tuple(replace(each, mode=0 * each.mode) for each in sensed.plants))
    assert dominant(replace(loop, rig=replace(loop.rig, sensed=without))) == nameless
