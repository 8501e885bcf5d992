"""Published frequencies of beams pinned at both ends, and the classical roots of the slender beam.

NAFEMS Test 5 (FV5), deep simply supported beam, Selected Benchmarks for Natural Frequency Analysis, 1987;
code_aster SDLV302, short beam on two supports.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm import Arm, Hub, Link, Payload, Section


def pinned(link: Link) -> Arm:
    return Arm(link=link, hub=Hub(inertia=0.0), payload=Payload(mass=math.inf))


def test_nafems_fv5_deep_simply_supported_beam() -> None:
    nu = 0.3
    section = Section.rectangle(width=2.0, depth=2.0, shear_factor=10 * (1 + nu) / (12 + 11 * nu))
    link = Link.isotropic(length=10.0, density=8000.0, youngs_modulus=200e9, poissons_ratio=nu, section=section)
    printed = np.array([42.650, 148.15, 283.47])  # Hz
    ours = tfarm.modes(pinned(link), 3).natural_frequency_hz
    np.testing.assert_allclose(ours[1:], printed[1:], atol=0.005)  # to their last digit
    # their first, 42.650, lies 1.2e-4 above the exact beam of their data, 42.6449: beyond their digits, said so
    assert ours[0] == pytest.approx(42.6449, abs=5e-5)
    assert abs(ours[0] / printed[0] - 1) < 1.3e-4


def test_code_aster_sdlv302_short_beam_on_two_supports() -> None:
    section = Section.rectangle(width=0.1, depth=0.2, shear_factor=5 / 6)
    link = Link.isotropic(length=2.0, density=7800.0, youngs_modulus=2.1e11, poissons_ratio=0.3, section=section)
    printed = np.array([115.7, 442.2, 931.6])  # Hz; their fourth, 1534.0, is 1533.648 exactly
    ours = tfarm.modes(pinned(link), 4).natural_frequency_hz
    np.testing.assert_allclose(ours[:3], printed, atol=0.05)
    assert ours[3] == pytest.approx(1534.0, rel=3e-4)


def test_pinned_beams_have_the_dispersion_relation_in_closed_form() -> None:
    arm = pinned(tfarm.load("stocky-steel").link)
    link, L = arm.link, arm.link.length
    squares = []
    for n in range(1, 40):
        k2 = (n * math.pi / L) ** 2
        # rhoI rhoA/kGA w^4 - (rhoA + rhoI k^2 + EI k^2 rhoA/kGA) w^2 + EI k^4 = 0
        a = link.rhoI * link.rhoA / link.kGA
        b = link.rhoA + link.rhoI * k2 + link.EI * k2 * link.rhoA / link.kGA
        squares += list(np.roots([a, -b, link.EI * k2**2]).real)
    expected = np.sort(np.sqrt([*squares, link.kGA / link.rhoI]))[:20]
    np.testing.assert_allclose(tfarm.modes(arm, 20).natural_frequency, expected, rtol=1e-12)


CLASSICAL = {  # Euler-Bernoulli roots beta L, from any textbook (Blevins 1979, table 8-1)
    "clamped-free": (Hub(inertia=math.inf), Payload(), [1.8751041, 4.6940911, 7.8547574]),
    "pinned-free": (Hub(inertia=0.0), Payload(), [3.9266023, 7.0685827, 10.2101761]),
    "clamped-pinned": (Hub(inertia=math.inf), Payload(mass=math.inf), [3.9266023, 7.0685827, 10.2101761]),
    "clamped-clamped": (
        Hub(inertia=math.inf),
        Payload(mass=math.inf, inertia=math.inf),
        [4.7300407, 7.8532046, 10.9956078],
    ),
    "pinned-pinned": (Hub(inertia=0.0), Payload(mass=math.inf), [math.pi, 2 * math.pi, 3 * math.pi]),
    "clamped-guided": (Hub(inertia=math.inf), Payload(inertia=math.inf), [2.3650204, 5.4978039, 8.6393798]),
}


@pytest.mark.parametrize("name", CLASSICAL)
def test_classical_roots_of_the_euler_bernoulli_beam(name: str) -> None:
    hub, payload, printed = CLASSICAL[name]
    arm = replace(tfarm.load("sasaki2012"), hub=hub, payload=payload)
    omega = tfarm.modes(arm, 3, theory="euler-bernoulli").natural_frequency[-3:]
    roots = (omega**2 * arm.link.rhoA / arm.link.EI) ** 0.25 * arm.link.length
    np.testing.assert_allclose(roots, printed, atol=6e-8)


@pytest.mark.parametrize("theory", ["timoshenko", "shear", "rayleigh"])
def test_every_theory_tends_to_euler_bernoulli_as_the_beam_gets_slender(theory: str) -> None:
    differences = []
    for depth in (0.02, 0.01, 0.005):
        section = Section.rectangle(width=0.1, depth=depth)
        link = Link.isotropic(length=1.0, density=2700.0, youngs_modulus=7e10, poissons_ratio=0.3, section=section)
        arm = Arm(link=link, hub=Hub(inertia=math.inf))
        reference = tfarm.modes(arm, 3, theory="euler-bernoulli").natural_frequency
        differences.append(1 - tfarm.modes(arm, 3, theory=theory).natural_frequency / reference)
    order = np.log2(differences[0] / differences[1]), np.log2(differences[1] / differences[2])
    np.testing.assert_allclose(order, 2.0, atol=0.02)  # the correction is (depth/length)^2
