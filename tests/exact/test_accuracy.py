"""float64 against ball arithmetic, at random and where the last digits are in danger (see `accuracy`)."""

import cmath
import math

import numpy as np
import pytest

import tfarm
from tests.exact.accuracy import BOUND, exact_values, measure, run, some_share
from tests.strategies import some_arm, some_s
from tfarm.exact import balls
from tfarm.exact.coefficients import coefficients
from tfarm.exact.outputs import OUTPUTS
from tfarm.spectrum.search import natural_frequencies

AT_ENDS = {name: output for name, output in OUTPUTS.items() if output.place != "x"}


def assert_accurate(points):
    bad = [point for point in points if not point.flagged and not point.error <= BOUND]
    assert not bad, f"{len(bad)} of {len(points)}, worst {max(bad, key=lambda point: point.error)}"


@pytest.mark.parametrize("seed", [1000, 1001])
def test_every_output_at_random_arms_and_s(seed):
    points = run(300, seed)
    assert len(points) > 2500
    assert np.mean([point.flagged for point in points]) < 0.02
    assert_accurate(points)


def near(rng, centre, closest=1e-14, farthest=0.1):
    """A frequency next to `centre`, at a distance that is anything between the two shares of it."""
    distance = 10 ** rng.uniform(math.log10(closest), math.log10(farthest))
    return centre * (1 + rng.choice([-1, 1]) * distance)


def test_next_to_the_shear_cut_off():
    """Two of the four waves become constant there.

    Left out: a pinned-pinned arm has a mode of constant Psi at the cut-off, and Phi = Psi - Theta cancels it.
    """
    rng, points = np.random.default_rng(2), []
    while len(points) < 1000:
        arm = some_arm(rng, damping=0.0)
        if (arm.hub.inertia, arm.payload.mass, arm.payload.inertia) != (0.0, math.inf, 0.0):
            points += measure(arm, complex(0.0, near(rng, arm.shear_cutoff)), some_share(rng))
    assert_accurate(points)


def test_next_to_a_natural_frequency():
    """The kernel may flag what it cannot tell from a pole, but only within 1e-9 of it."""
    rng, points = np.random.default_rng(3), []
    while len(points) < 1000:
        arm, number = some_arm(rng, damping=0.0), int(rng.integers(2, 40))
        (omega,) = natural_frequencies(coefficients(arm), number, number)
        s = complex(0.0, near(rng, omega, 1e-12))
        at = measure(arm, s, some_share(rng))
        assert abs(s.imag / omega - 1) < 1e-9 or not any(point.flagged for point in at)
        points += at
    assert_accurate(points)


def test_on_both_sides_of_the_change_from_series_to_waves():
    """Where |z| = 6: s^2 = 36/g for a slender arm, on the imaginary axis and anywhere else."""
    rng, points = np.random.default_rng(4), []
    while len(points) < 1000:
        arm = some_arm(rng)
        s = near(rng, 6 / math.sqrt(coefficients(arm).g), 1e-3, 0.3) * cmath.exp(1j * rng.choice([math.pi / 2, 0.3]))
        points += measure(arm, s, some_share(rng))
    assert_accurate(points)


def test_overdamped_in_the_left_half_plane():
    rng, points = np.random.default_rng(5), []
    while len(points) < 1000:
        arm = some_arm(rng, damping=10 ** rng.uniform(-7, -2))
        points += measure(arm, -abs(some_s(rng)) + 0j, some_share(rng))
    assert_accurate(points)


def test_next_to_the_essential_singularity():
    """s -> -1/C, where 1 + C s keeps few digits of its own: at root and tip it costs none."""
    rng, points = np.random.default_rng(10), []
    while len(points) < 150:
        arm = some_arm(rng, damping=10 ** rng.uniform(-6, -2))
        points += measure(arm, complex(near(rng, -1 / arm.link.damping, 1e-6, 1e-3)), 0.5, AT_ENDS)
    assert_accurate(points)


def equal_waves(arm):
    """A complex s where z_1 = z_2: (k G - E d)^2 rho I s^2 = 4 A E (k G)^2 d, with d = 1 + C s."""
    link, A, I = arm.link, arm.link.section.area, arm.link.section.second_moment
    kG, d, s = link.kGA / A, np.poly1d([link.damping, 1]), np.poly1d([1, 0])
    roots = ((kG - link.youngs_modulus * d) ** 2 * link.density * I * s**2 - 4 * A * link.youngs_modulus * kG**2 * d).r
    return complex(min(roots, key=abs))


def test_where_two_waves_are_equal_and_around_it():
    """The kernel flags what it cannot do, and a transfer function gives those points their value all the same."""
    rng, flagged = np.random.default_rng(6), []
    for _ in range(40):
        arm = some_arm(rng)
        s = equal_waves(arm) * (1 + 10 ** rng.uniform(-16, 0) * cmath.exp(1j * rng.uniform(0, 7)))
        flagged += [point.flagged for point in measure(arm, s, 0.5)[:1]]
        exact = exact_values(coefficients(arm), s, 0.5, AT_ENDS)
        for name, value in zip(AT_ENDS, tfarm.transfer(arm, list(AT_ENDS))(s), strict=True):
            if name in exact:
                ball, condition = exact[name]
                assert float(abs(balls.point(complex(value)) / ball - 1).mid()) <= BOUND * (1 + condition)
    assert any(flagged)
    assert not all(flagged)


def test_where_the_tip_hardly_moves_any_more():
    """W falls below the smallest float while s^2 W does not: the tip's acceleration is right as long as it is one."""
    rng, points = np.random.default_rng(8), []
    while len(points) < 10:
        arm = some_arm(rng, ("some", "some", "some"), damping=0.0)
        k = coefficients(arm)
        s = rng.uniform(690, 760) / math.sqrt(min(k.a, k.b)) + 0j
        points += measure(arm, s, 0.5, {"tip_acceleration": OUTPUTS["tip_acceleration"]})
    assert_accurate(points)
