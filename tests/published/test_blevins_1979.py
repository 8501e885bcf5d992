"""R. D. Blevins, Formulas for Natural Frequency and Mode Shape (1979), table 8-1: uniform Euler-Bernoulli beams.

lambda_n = L (w^2 rho A/EI)^(1/4) for every pair of ends that an arm can have, w(0) = 0 in all of them.
"""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

import tfarm
from tfarm import Hub, Payload
from tfarm.audit.literature import END_CONDITIONS, SOURCES, beam
from tfarm.audit.published import computed

EPS = np.finfo(float).eps
inf = math.inf

# hub inertia, payload mass, payload inertia: the transcendental equation, and the table's lambda_1..lambda_5
TABLE = {
    "clamped-free": (inf, 0.0, 0.0, lambda z: mpmath.cos(z) + 1 / mpmath.cosh(z),
                     (1.87510407, 4.69409113, 7.85475744, 10.99554073, 14.13716839)),
    "clamped-sliding": (inf, 0.0, inf, lambda z: mpmath.tan(z) + mpmath.tanh(z),
                        (2.36502037, 5.49780392, 8.63937983, 11.78097245, 14.92256510)),
    "clamped-pinned": (inf, inf, 0.0, lambda z: mpmath.tan(z) - mpmath.tanh(z),
                       (3.92660231, 7.06858275, 10.21017612, 13.35176878, 16.49336143)),
    "clamped-clamped": (inf, inf, inf, lambda z: mpmath.cos(z) - 1 / mpmath.cosh(z),
                        (4.73004074, 7.85320462, 10.9956079, 14.1371655, 17.2787597)),
    "pinned-free": (0.0, 0.0, 0.0, lambda z: mpmath.tan(z) - mpmath.tanh(z),
                    (3.92660231, 7.06858275, 10.21017612, 13.35176878, 16.49336143)),
    "pinned-sliding": (0.0, 0.0, inf, mpmath.cos, tuple((n - 0.5) * math.pi for n in range(1, 6))),
    "pinned-pinned": (0.0, inf, 0.0, mpmath.sin, tuple(n * math.pi for n in range(1, 6))),
    "pinned-clamped": (0.0, inf, inf, lambda z: mpmath.tan(z) - mpmath.tanh(z),
                       (3.92660231, 7.06858275, 10.21017612, 13.35176878, 16.49336143)),
}  # fmt: skip


def arm_with(hub, mass, inertia):
    return replace(tfarm.load("sasaki2012"), hub=Hub(inertia=hub), payload=Payload(mass=mass, inertia=inertia))


def wave_numbers(arm, count):
    omega = tfarm.modes(arm, count, theory="euler-bernoulli").natural_frequency[-count:]
    return arm.link.length * np.sqrt(omega * math.sqrt(arm.link.rhoA / arm.link.EI))


@pytest.mark.parametrize("ends", TABLE)
def test_the_roots_of_table_8_1(ends):
    *bodies, equation, printed = TABLE[ends]
    found = wave_numbers(arm_with(*bodies), 30)
    assert found[:5] == pytest.approx(printed, abs=1e-7)  # a unit of the last digit where the table has seven
    with mpmath.workdps(30):
        for root in found:
            exact = mpmath.findroot(equation, float(root))
            assert abs(float(exact - float(root))) <= 16 * EPS * root


def test_a_mass_on_the_tip_of_a_clamped_beam():
    """1 + cos z cosh z + (m/rhoAL) z (cos z sinh z - sin z cosh z) = 0, one tenth to ten times the beam."""
    for ratio in (0.1, 1.0, 10.0):
        beam = arm_with(inf, 0.0, 0.0)
        arm = arm_with(inf, ratio * beam.link.rhoA * beam.link.length, 0.0)
        exact_ratio = mpmath.mpf(arm.payload.mass) / (mpmath.mpf(beam.link.rhoA) * beam.link.length)

        def equation(z, r=exact_ratio):
            cosine, sine = mpmath.cos(z), mpmath.sin(z)
            return 1 / mpmath.cosh(z) + cosine + r * z * (cosine * mpmath.tanh(z) - sine)

        with mpmath.workdps(30):
            for root in wave_numbers(arm, 10):
                assert abs(float(mpmath.findroot(equation, float(root)) - float(root))) <= 32 * EPS * root


@pytest.mark.parametrize("theory", ["timoshenko", "shear", "rayleigh"])
def test_a_slender_beam_approaches_the_table(theory):
    """The other theories come down to it as (r/L)^2: ten times as slender, a hundred times as close."""

    def excess(slenderness):
        arm = arm_with(inf, 0.0, 0.0)
        section = replace(arm.link.section, second_moment=arm.link.section.area * (arm.link.length / slenderness) ** 2)
        link = replace(arm.link, section=section)
        slender = replace(arm, link=link)
        exact, simple = (tfarm.modes(slender, 3, theory=t).natural_frequency for t in (theory, "euler-bernoulli"))
        return simple / exact - 1

    assert (excess(300.0) > 0).all()
    assert excess(3000.0) == pytest.approx(excess(300.0) / 100, rel=1e-2, abs=0)


def test_the_third_clamped_root_is_misprinted_in_its_last_digit():
    """10.9956079: cos z cosh z - 1 changes its sign half a unit and more below it."""

    def sign(z):
        return mpmath.sign(mpmath.cos(mpmath.mpf(z)) * mpmath.cosh(mpmath.mpf(z)) - 1)

    assert sign("10.99560783") != sign("10.99560784")
    assert sign("10.99560784") == sign("10.99560785") == sign("10.9956079")


def test_the_table_of_the_audit_is_this_one():
    (source,) = (source for source in SOURCES if source.key == "blevins-1979")
    plain = {case.name: case for case in source.cases if case.theory == "euler-bernoulli"}
    for ends, case in plain.items():
        assert tuple(float(text) for text in case.printed) == TABLE[ends][-1]
        arm = case.arm
        assert (arm.hub.inertia, arm.payload.mass, arm.payload.inertia) == TABLE[ends][:3]
    slender = [case for case in source.cases if case.theory == "timoshenko"]
    assert {case.name.split(",")[0] for case in slender} == {"clamped-free", "clamped-pinned", "pinned-free"}
    for case in slender:  # what is left of shear and rotary inertia is far below the digits, and vanishes as (r/L)^2
        simple = computed(replace(case, theory="euler-bernoulli"))
        coarse = computed(replace(case, arm=beam(slenderness=1e4, **END_CONDITIONS[case.name.split(",")[0]])))
        assert (abs(computed(case) - simple) < 5e-9).all()
        assert (simple - coarse) * 1e-4 == pytest.approx(simple - computed(case), rel=1e-2, abs=1e-14)
