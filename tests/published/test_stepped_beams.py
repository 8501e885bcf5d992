"""Published frequencies of tapered Euler-Bernoulli beams, as many uniform steps, and of masses on a cantilever.

Each digit is confirmed by the steps, continued to infinitely many, or by an equation.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import eigvals

import tfarm
from tfarm import Arm, Hub, Link, Payload, Section
from tfarm.arm import Attachment
from tfarm.audit.published import ALL, agrees

SLENDER = 1e4  # L/r of a unit beam: shear and rotary inertia move its first frequencies by some 1e-6 or less


def natural_frequencies(arm, count):
    """The first flexible frequencies [rad/s] of an undamped rig in its own theory."""
    return tfarm.modes(arm, count).natural_frequency[arm.has_rigid_mode :]


def unit_link(length=1.0, EI=1.0, rhoA=1.0):
    """A slender segment of this bending stiffness [N m^2] and mass per length [kg/m]."""
    section = Section.general(area=1.0, second_moment=SLENDER**-2, shear_factor=5 / 6)
    return Link.isotropic(
        length=length, density=rhoA, youngs_modulus=EI * SLENDER**2, poissons_ratio=0.3, section=section
    )


def stepped(steps, EI, rhoA):
    """A clamped beam of EI(x) and rhoA(x), 0 <= x <= 1, as uniform steps, each as the beam is in its middle."""
    first, *outer = (unit_link(1 / steps, float(EI(x)), float(rhoA(x))) for x in (np.arange(steps) + 0.5) / steps)
    return Arm(link=first, outer=tuple(outer), hub=Hub(inertia=math.inf), theory="euler-bernoulli")


def without_steps(make, count, steps=(6, 12, 24)):
    """Frequencies of make(n) for n -> inf: the error goes with 1/n^2, 1/n^4, ... (Richardson and Gaunt 1927)."""
    rows = [natural_frequencies(make(n), count) for n in steps]
    power = 1
    while len(rows) > 1:
        rows = [(4**power * fine - coarse) / (4**power - 1) for coarse, fine in pairwise(rows)]
        power += 1
    return rows[0]


# Breadth b = 1 - tau_b x and depth h = 1 - tau_h x, clamped at x = 0, by (tau_h, tau_b): w L^2 (rhoA/EI)^(1/2) of the
# root's section.  The first two are the rows at rest of O. Ozdemir Ozgumus and M. O. Kaya (2006), as reproduced in
# International Journal of Mechanical and Materials Engineering 10 (2015), "Flapwise bending vibration analysis of
# functionally graded rotating double-tapered beams", table 1; the third of D. H. Hodges and M. J. Rutkowski (1981).
TAPERED = {
    (0.2, 0.4): ("4.18932", "21.6327", "57.2257"),
    (0.4, 0.0): ("3.73708", "19.1138", "50.3537"),
    (0.5, 0.0): ("3.8238", "18.3173", "47.2648"),
}


@pytest.mark.parametrize(("tau_h", "tau_b"), TAPERED)
def test_every_printed_digit_of_a_tapered_beam_is_right(tau_h, tau_b):
    def rhoA(x):
        return (1 - tau_b * x) * (1 - tau_h * x)

    found = without_steps(lambda n: stepped(n, lambda x: rhoA(x) * (1 - tau_h * x) ** 2, rhoA), 3)
    for ours, printed in zip(found.tolist(), TAPERED[tau_h, tau_b], strict=True):
        assert agrees(ours, printed)


def test_the_masses_of_ghali_neville_2017_however_they_are_put():
    """ghali-neville-2017: 1/w of F M, F_ij = x_i^2 (3 x_j - x_i)/6 for x_i <= x_j, the deflection of a cantilever.

    The outer mass is the payload, or an attachment at the tip; the link is one segment or three.
    """
    light = 1e-9  # kg/m, with masses of 1 kg
    x = np.arange(1.0, 4.0)
    low, high = np.minimum.outer(x, x), np.maximum.outer(x, x)
    exact = np.sort(1 / np.sqrt(eigvals(low**2 * (3 * high - low) / 6 * [1.0, 1.0, 4.0]).real))
    inner, third = tuple(Attachment(x=at, mass=1.0) for at in (1.0, 2.0)), unit_link(1.0, rhoA=light)
    arm = Arm(
        link=unit_link(3.0, rhoA=light), hub=Hub(inertia=math.inf), payload=Payload(mass=4.0), attachments=inner,
        theory="euler-bernoulli",
    )  # fmt: skip
    hung = replace(arm, payload=Payload(), attachments=(*inner, Attachment(x=3.0, mass=4.0)))
    (printed,) = (source.cases[0].printed for source in ALL if source.key == "ghali-neville-2017")
    for each in (arm, hung, replace(arm, link=third, outer=(third, third))):
        found = natural_frequencies(each, 3)
        assert found == pytest.approx(exact, rel=10 * light)
        assert all(agrees(ours, text) for ours, text in zip(found.tolist(), printed, strict=True))
