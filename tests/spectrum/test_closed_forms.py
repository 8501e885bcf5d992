"""Natural frequencies in closed form, and the order in which the theories part from Euler and Bernoulli's."""

import math

import numpy as np
import pytest

import tfarm
from tfarm import Arm, Hub, Link, Payload, Section


def pinned(link: Link) -> Arm:
    return Arm(link=link, hub=Hub(inertia=0.0), payload=Payload(mass=math.inf))


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
