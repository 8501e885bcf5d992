"""How far each number of a law may go at the samples: against eigenvalues, and Jury's conditions."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tests.dsp.law_verdicts import some_case
from tests.dsp.test_laws import LAB, LAWS, T
from tfarm import HubFeedback, Law
from tfarm.dsp import Chain, sampled_loop, stable_windows
from tfarm.dsp.crossings import circle_grid, number_crossings
from tfarm.dsp.verdict import sampled_numbers


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_number_is_in_a_window_where_all_eigenvalues_are_inside_the_circle(law):
    """At random factors of either sign on one part; near an edge eigenvalues tell nothing."""
    rng, told = np.random.default_rng(5), set()
    loop = sampled_loop(LAB, law, Chain(), count=6)
    for name, value, windows in sampled_numbers(loop):
        for factor in (*-(10 ** rng.uniform(-3, 2, 4)), *10 ** rng.uniform(-3, 2, 8)):
            radius = abs(np.linalg.eigvals(loop.having(**{name: factor * value}).reduced_matrix())).max()
            inside = any(low < factor * value < high for low, high in windows)
            assert abs(radius - 1) < 1e-6 or inside == (radius < 1), (name, factor)
            told.add(inside)
    assert told == {True, False}


def test_between_crossings_along_one_part_the_count_is_what_they_say():
    """Random laws, integrators and unstable ones among them, at random factors of either sign."""
    rng, compared = np.random.default_rng(77), 0
    for _ in range(6):
        case = some_case(rng)
        loop = case and sampled_loop(*case, count=6)
        for name in loop.law.part_gains if loop else ():
            own = loop.number(name)
            values = own * np.r_[1.0, -(10 ** rng.uniform(-4, 3, 3)), 10 ** rng.uniform(-4, 3, 3)]
            loops = [loop.having(**{name: value}) for value in values.tolist()]
            passed = number_crossings(circle_grid(loop), name, loop.row[None])[0].passed(values)
            counts = np.array([(each.poles.log_radius > 0).sum() for each in loops])
            assert (counts - counts[0] == passed - passed[0]).all(), name
            compared += 1
    assert compared > 5


def test_of_a_stiff_arm_angle_and_rate_gain_reach_as_far_as_jury_says():
    """z^2 - 2z + 1 + Kp T^2 (z + 1)/2J + K1 T (z - 1)/J: Kp > 0, K1 > Kp T/2 and K1 < 2J/T."""
    stiff = LAB.having(length=0.1)
    gains = HubFeedback(K1=0.4 * stiff.turned_inertia / T, Kp=1.0)
    loop = sampled_loop(stiff, gains, Chain(), count=1)
    np.testing.assert_allclose(stable_windows(loop, "Kp"), [(0.0, 2 * gains.K1 / T)], rtol=1e-2)
    np.testing.assert_allclose(stable_windows(loop, "K1"), [(T / 2, 2 * stiff.turned_inertia / T)], rtol=1e-2)


def test_an_angle_gain_that_is_0_lies_at_the_edge_of_its_interval():
    """Apart from z = 1 of the free angle the loop is stable there, and from there on the angle is held."""
    found = tfarm.sampled(LAB, HubFeedback(K1=14.7, K2=-0.26), Chain(), count=6)
    low, high = found.interval("Kp")
    assert (low, found.verdict.is_stable) == (0.0, True)
    held = (found.loop.having(Kp=Kp) for Kp in (1e-3, high * 0.999))
    assert all(each.poles.is_stable for each in held)
    driven = replace(found, verdict=replace(found.verdict, loop=found.verdict.loop.having(K1=-0.1), band=None))
    assert driven.interval("Kp") is None  # whatever its windows


def test_only_a_part_that_one_signal_has_to_itself_has_a_name():
    both = Law.of_matrices([[0.5]], [[1.0, 1.0]], [[1.0]], [[0.1, 0.2]], ["hub_rate", "root_moment"], period=T)
    assert both.part_gains == {}
    law = LAWS["in z"]
    assert law.part_gains == {"hub_angle.gain": (0, 1.0), "root_moment.gain": (1, 1.0)}
    assert LAWS["lead"].part_gains == {"hub_angle.gain": (0, 1.0), "root_moment": (1, 0.1)}
    for name, (part, value) in law.part_gains.items():
        twice = law.weighted([2.0 if place == part else 1.0 for place in range(2)])
        z = np.array([0.3 + 0.4j])
        np.testing.assert_allclose(twice.values(z), law.having(name, 2 * value).values(z), rtol=1e-14)
