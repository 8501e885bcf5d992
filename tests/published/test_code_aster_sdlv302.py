"""code_aster, validation manual V2.04.302 (SDLV302): vibration of a short simply supported beam by Timoshenko's theory.

L = 2 m, depth 0.2 m, width 0.1 m, E = 2.1e11 Pa, nu = 0.3, rho = 7800 kg/m^3, shear factor 5/6; bending in the plane of
the depth.  The reference values are printed with one decimal, but given to four figures: the last reads 1534.0.
"""

import math

import numpy as np
import pytest

import tfarm
from tfarm import Arm, Hub, Link, Payload, Section
from tfarm.audit.literature import SOURCES

REFERENCE = np.array([115.7, 442.2, 931.6, 1534.0])  # Hz


def sdlv302():
    link = Link.isotropic(
        length=2.0,
        density=7800.0,
        youngs_modulus=2.1e11,
        poissons_ratio=0.3,
        section=Section.rectangle(width=0.1, depth=0.2, shear_factor=5 / 6),
    )
    return Arm(link=link, hub=Hub(inertia=0.0), payload=Payload(mass=math.inf))


def test_bending_frequencies_of_sdlv302():
    """The fourth is 2.3e-4 above the exact solution, the others agree in every printed digit."""
    found = tfarm.modes(sdlv302(), 4).natural_frequency_hz
    assert found == pytest.approx(np.array([115.709, 442.172, 931.574, 1533.648]), abs=5e-4)
    assert found[:3] == pytest.approx(REFERENCE[:3], abs=0.05)
    assert found[3] == pytest.approx(REFERENCE[3], rel=2.4e-4, abs=0)


def test_thirty_digits_confirmed_by_the_determinant_of_the_paper():
    texts = tfarm.modes(sdlv302(), 4).digits(30)
    assert [float(text) for text in texts] == pytest.approx(
        tfarm.modes(sdlv302(), 4).natural_frequency, rel=1e-15, abs=0
    )


def test_all_four_are_right_to_four_figures():
    found = tfarm.modes(sdlv302(), 4).natural_frequency_hz
    assert [float(f"{value:.4g}") for value in found] == REFERENCE.tolist()
    (source,) = (source for source in SOURCES if source.key == "code-aster-sdlv302")
    assert [float(text) for text in source.cases[0].printed] == REFERENCE.tolist()
    assert source.cases[0].arm == sdlv302()


def test_the_manuals_own_formula():
    """Omega = ((g + j) q + 1 - sqrt((g - j)^2 q^2 + 2 (g + j) q + 1)) / (2 g j), q = (n pi)^2 (section 2.1)."""
    link = sdlv302().link
    j, g = 1 / link.slenderness**2, link.EI / (link.kGA * link.length**2)
    q = (math.pi * np.arange(1, 5)) ** 2
    omega2 = ((g + j) * q + 1 - np.sqrt((g - j) ** 2 * q**2 + 2 * (g + j) * q + 1)) / (2 * g * j)
    exact = tfarm.modes(sdlv302(), 4).natural_frequency
    unit = link.EI / (link.rhoA * link.length**4)
    assert np.sqrt(omega2 * unit) == pytest.approx(exact, rel=1e-10)
