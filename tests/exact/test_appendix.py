"""The paper's appendix against balls, the matrix exponential and a Ritz model; its digits and its errors."""

import math
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest

import tfarm
from tests.exact.test_chain import ALONG
from tests.outputs import OF_ONE_LINK
from tests.shared import thinned
from tests.strategies import BOUNDARY_CASES, some_arm, some_s
from tests.transition import determinant, response
from tfarm import Arm, ConvergenceError, Hub, Link, ParameterError, Payload, Section
from tfarm.exact import appendix
from tfarm.exact.system import system_of
from tfarm.exact.values import enclose

EPS = np.finfo(float).eps


def middle(ball, digits):
    """The middle of a complex ball as an mpmath number."""
    return mpmath.mpc(*(part.mid().str(digits, radius=False) for part in (ball.real, ball.imag)))


@pytest.mark.parametrize("case", thinned([(each,) for each in BOUNDARY_CASES], 4))
def test_forty_digits_are_those_of_the_balls(case):
    """The balls never separate two waves; the appendix never does anything else."""
    rng = np.random.default_rng(BOUNDARY_CASES.index(case))
    arm, s = some_arm(rng, case), some_s(rng)
    x = float(rng.uniform(0.05, 0.95)) * arm.link.length
    k, compared = system_of(arm), 0
    for name, output in OF_ONE_LINK.items():
        value = appendix.output_value(arm, name, s, 40, x=x)
        if value == 0:
            assert output.place == "tip"
            continue
        exact = enclose(k, output, s, bits=170, x=Fraction(x) / k.length)
        with mpmath.workdps(50):
            assert abs(value / middle(exact, 50) - 1) < mpmath.mpf(10) ** -39
        compared += 1
    assert compared > 6


def test_delta_is_the_characteristic_function_without_its_artefacts():
    """Delta = 4 E I (1 + C s) rho A s^2 (l1^2 - l2^2)^2/(l1 l2) D, D of the transition matrices."""
    arm = replace(tfarm.load("sasaki2012-lab"), payload=Payload(mass=0.3, inertia=0.02))
    ratios = []
    for s in (3 + 60j, 0.2j, 5e3j):
        Delta = appendix.determinant(arm, s, 30)
        with mpmath.workdps(60):
            at = appendix.Appendix(arm, mpmath.mpc(s))
            l1, l2, rhoA = at.lambdas[0], at.lambdas[1], at.rho * at.A
            D = Delta * l1 * l2 / (4 * at.EI * at.damper * rhoA * at.s**2 * (l1**2 - l2**2) ** 2)
            ratios.append(D / determinant(arm, s))
    assert max(abs(each / ratios[0] - 1) for each in ratios) < mpmath.mpf(10) ** -29


@pytest.mark.parametrize("digits", thinned([15, 5, 150, 40], 2))
def test_as_many_digits_as_requested(digits):
    arm = tfarm.load("sasaki2012-lab")
    for name in ("hub_angle", "tip_deflection", "root_moment"):
        for s in (0.3 + 57.1j, 1e-6j, 1e6j, 1e-3 + 1e5j):
            value, better = (appendix.output_value(arm, name, s, n) for n in (digits, 2 * digits + 20))
            with mpmath.workdps(2 * digits + 20):
                for part, right in ((value.real, better.real), (value.imag, better.imag)):
                    assert abs(part - right) <= abs(right) * mpmath.mpf(10) ** -digits


def test_a_part_that_vanishes_by_symmetry_is_zero():
    arm = tfarm.load("sasaki2012")
    assert appendix.output_value(arm, "hub_angle", 40j, 20).imag == 0
    assert appendix.output_value(arm, "hub_rate", 40j, 20).real == 0
    assert appendix.output_value(arm, "hub_rate", 40 + 0j, 20).imag == 0


def powers_of_two(*, damping=0.0, hub=0.25, mass=0.5, inertia=0.125):
    """An arm whose cut-off, 3 2^16 rad/s, and whose point of equal waves at C = 0, s = 2^18, are floats."""
    section = Section.general(area=9 * 2.0**-10, second_moment=2.0**-20, shear_factor=0.5)
    link = Link(
        length=1.0, density=2.0**12, youngs_modulus=2.0**36, shear_modulus=2.0**35, section=section, damping=damping
    )
    return Arm(link=link, hub=Hub(inertia=hub), payload=Payload(mass=mass, inertia=inertia))


@pytest.mark.parametrize(
    ("name", "s"),
    thinned([(name, s) for name in OF_ONE_LINK for s in (3 * 2.0**16 * 1j, 2.0**18 + 0j, -(2.0**18) + 0j)], 8),
)
def test_where_two_waves_coincide_to_the_last_bit(name, s):
    """The cut-off, and the real s of equal waves: the appendix is 0/0, float64 flags it, and all give the value."""
    arm, output, x = powers_of_two(), OF_ONE_LINK[name], 0.4
    wanted = (ALONG[name], mpmath.mpf(x)) if output.place == "x" else name
    expected = response(arm, s, [wanted], 30)[wanted]
    with mpmath.workdps(30):
        assert abs(appendix.output_value(arm, name, s, 25, x=x) / expected - 1) < mpmath.mpf(10) ** -25
    G = tfarm.transfer(arm, name, x=x if output.place == "x" else None)
    slope = abs(s * G.derivative(s) / complex(expected))
    assert abs(G(s) / complex(expected) - 1) <= 90 * EPS * (1 + slope)


@pytest.mark.parametrize("omega", [71.505682466890, 204.333139363807, 537.952620541657, 1046.821121534289])
def test_the_published_roots_of_the_default_arm(omega):
    """Frequencies known to 13 digits from three solutions: the determinant has one root there, and none next to it."""
    arm = tfarm.load("sasaki2012-lab")
    assert appendix.roots_near(arm, omega, 13) == 1
    assert appendix.roots_near(arm, omega * (1 + 1e-11), 12) == 0


def test_a_root_is_the_frequency_that_balls_prove():
    """Two solutions: the secant method on the 4x4 determinant, and the closed form enclosed to 30 digits."""
    arm = tfarm.load("sasaki2012")
    table = tfarm.modes(arm, 4)
    for omega, digits in zip(table.natural_frequency[1:], table.digits(30)[1:], strict=True):
        with mpmath.workdps(35):
            found = appendix.natural_frequency(arm, float(omega), 30)
            assert abs(found / mpmath.mpf(digits) - 1) < mpmath.mpf(10) ** -29


def test_the_mode_at_the_cut_off_is_a_root():
    """The mode W = 0, Psi = const of a pinned-pinned arm at its cut-off is a root of the 4x4 determinant as well."""
    arm = powers_of_two(hub=0.0, mass=math.inf, inertia=0.0)
    assert appendix.roots_near(arm, 3 * 2.0**16, 12) == 1


@pytest.mark.parametrize("name", thinned(["hub_angle", "tip_displacement", "root_moment"], 2))
def test_at_s_0_the_limit_or_an_error(name):
    arm = powers_of_two()
    if name == "root_moment":
        limit = -(arm.total_inertia - arm.hub.inertia) / arm.total_inertia
        assert float(appendix.output_value(arm, name, 0j, 15).real) == pytest.approx(limit, rel=2 * EPS, abs=0)
    else:
        with pytest.raises(ConvergenceError, match=r"no 15 digits of .* a pole"):
            appendix.output_value(arm, name, 0j, 15)


def test_what_has_no_value_is_refused():
    with pytest.raises(ConvergenceError, match="no value at s = 196608j"):
        appendix.determinant(powers_of_two(), 3 * 2.0**16 * 1j, 15)
    for x in (None, -0.1, 1.1, math.nan):
        with pytest.raises(ParameterError, match=r"x = .*: a point of the arm lies between 0 and 1.0 m"):
            appendix.output_value(powers_of_two(), "moment", 5j, 15, x=x)


def test_what_the_ends_hold_is_zero():
    arm = powers_of_two(mass=0.0, inertia=0.0)
    held = powers_of_two(mass=math.inf)
    assert (
        appendix.output_value(arm, "moment", 5j, 15, x=1.0) == appendix.output_value(arm, "shear", 5j, 15, x=1.0) == 0
    )
    assert appendix.output_value(held, "tip_displacement", 5j, 15) == 0
    assert (
        appendix.output_value(arm, "deflection", 5j, 15, x=0.0)
        == appendix.output_value(arm, "rotation", 5j, 15, x=0.0)
        == 0
    )
