"""Published frequencies of tapered Euler-Bernoulli beams, as many uniform steps, and of masses on a cantilever.

Each digit is confirmed by the steps, continued to infinitely many, or by an equation; most tables were set down without
a copy at hand.
"""

import math
from dataclasses import replace
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.linalg import eigvals
from scipy.optimize import brentq

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


def stepped(steps, EI, rhoA, payload=None, length=1.0):
    """A clamped beam of EI(x) and rhoA(x), 0 <= x <= 1, as uniform steps, each as the beam is in its middle."""
    links = [unit_link(length / steps, float(EI(x)), float(rhoA(x))) for x in (np.arange(steps) + 0.5) / steps]
    return Arm(
        link=links[0], outer=tuple(links[1:]), hub=Hub(inertia=math.inf), payload=payload or Payload(),
        theory="euler-bernoulli",
    )  # fmt: skip


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


@pytest.mark.parametrize(("n", "printed"), [(1, "5.315"), (2, "8.719")])
def test_kirchhoffs_wedge_and_cone(n, printed):
    """G. Kirchhoff (1879): rhoA = (1 - x)^n, EI = (1 - x)^(n + 2); z^2/4 of J_n I_(n+1) + I_n J_(n+1) = 0 at z.

    The steps come from below, 1/n^2 apart, and so a third of their last difference is still missing.
    """

    def equation(z):
        J, I = mpmath.besselj, mpmath.besseli
        return J(n, z) * I(n + 1, z) + I(n, z) * J(n + 1, z)

    exact = float(mpmath.findroot(equation, 3.3 + 1.3 * n) ** 2 / 4)
    assert agrees(exact, printed)
    coarse, fine = (
        natural_frequencies(stepped(steps, lambda x: (1 - x) ** (n + 2), lambda x: (1 - x) ** n), 1)[0]
        for steps in (16, 32)
    )
    assert coarse < fine < exact
    assert fine + (fine - coarse) / 3 == pytest.approx(exact, rel=1e-3)
    assert (exact - fine) / (exact - coarse) == pytest.approx(1 / 4, abs=0.02)


def test_sheet_sdll10_has_the_sign_of_a_squared_reversed():
    """Société française des mécaniciens, SDLL10/89, as code_aster's sdll10a has it: breadth 0.03 m e^(-2 a x), a = 1/m.

    L = 0.6 m, depth 0.01 m, E = 200 GPa, 7800 kg/m^3, clamped at both ends.  With l = a +- (a^2 +- k^2)^(1/2) and
    k^4 = w^2 rhoA/EI of e^(l x): 2 r s (1 - cosh r L cos s L) + (r^2 - s^2) sinh r L sin s L = 0 of r^2 = k^2 + a^2,
    s^2 = k^2 - a^2.  The sheet's (the first to 1.1e-4 only) are those of -a^2: they lie below the uniform beam's, and
    must lie above.
    """
    printed = np.array([143.303, 396.821, 779.425, 1289.577])  # Hz
    length, unit = 0.6, math.sqrt(200e9 / (12 * 7800.0)) * 0.01 / (2 * math.pi)  # Hz m^2, of k^2
    held = Payload(mass=math.inf, inertia=math.inf)

    def by_the_equation(square, guesses):
        def equation(frequency):
            r, s = math.sqrt(frequency / unit + square), math.sqrt(frequency / unit - square)
            waves = 2 * r * s * (1 / math.cosh(r * length) - math.cos(s * length))
            return waves + 2 * square * math.tanh(r * length) * math.sin(s * length)

        return np.array([brentq(equation, 0.99 * guess, 1.01 * guess) for guess in guesses])

    def tapered(steps, a=1.0):
        def breadth(x):
            return math.exp(-2 * a * length * x)

        return stepped(steps, breadth, breadth, held, length)

    ours = without_steps(tapered, 4, steps=(8, 16)) * unit
    assert ours == pytest.approx(by_the_equation(1.0, ours), rel=1e-5)  # 6e-6: the next power of the steps
    theirs = by_the_equation(-1.0, printed)
    assert theirs[1:] == pytest.approx(printed[1:], abs=6e-4)
    assert theirs[0] == pytest.approx(printed[0], rel=1.2e-4)
    plain = natural_frequencies(tapered(1, a=0.0), 4) * unit
    assert (plain > printed).all()
    assert (ours > plain).all()


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
