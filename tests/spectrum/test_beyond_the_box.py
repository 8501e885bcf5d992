"""What is said of eigenvalues beyond any box, held against where the theory's own waves put them."""

from dataclasses import replace

import numpy as np
import pytest

import tfarm
from tfarm.arm import THEORIES, WITH_ROTARY_INERTIA, WITH_SHEAR
from tfarm.spectrum.listing import beyond_the_box

LAB = tfarm.load("sasaki2012-lab")
STIFF = replace(LAB.link, damping=0.0)
TWO = replace(LAB, outer=(replace(LAB.link, damping=3e-4),))


def least_damped(arm, wavelengths):
    """Of a wave of each wave number k [1/m] on the first segment: the damping ratio of the slowest-decaying s.

    With w = sin kx, psi = cos kx: rhoA s^2 + kGA k^2 and kGA k couple to rhoI s^2 + EI (1 + Cs) k^2 + kGA; without
    rotary inertia rhoI s^2 goes, without shear psi = k.
    """
    link, found = arm.link, []
    EI, kGA, A, C = link.EI, link.kGA, link.rhoA, link.damping
    turning = link.rhoI if arm.theory in WITH_ROTARY_INERTIA else 0.0
    for k in wavelengths:
        if arm.theory in WITH_SHEAR:
            square = np.polymul([A, 0, kGA * k**2], [turning, EI * C * k**2, EI * k**2 + kGA])
            roots = np.roots(np.trim_zeros(np.polysub(square, [(kGA * k) ** 2]), "f"))
        else:
            roots = np.roots([A + turning * k**2, EI * C * k**4, EI * k**4])
        found.append((-roots.real / abs(roots)).min())
    return np.array(found)


@pytest.mark.parametrize("theory", THEORIES)
def test_short_waves_are_overdamped_without_shear_and_hardly_damped_with_it(theory):
    arm = LAB.under(theory)
    ratio = least_damped(arm, [1e5, 1e6, 1e7])
    said = beyond_the_box(arm)
    if theory in WITH_SHEAR:
        assert ratio[-1] < 1e-3
        assert (np.diff(ratio) < 0).all()
        assert "lightly damped modes exist at ever higher frequency" in said
    else:
        np.testing.assert_allclose(ratio, 1.0, rtol=1e-12)
        assert "all of them are overdamped" in said
    assert "-1/C, -10000 1/s" in said


def test_segments_of_their_own_damping_are_told_apart():
    assert "-1/C of the most damped segment, -3333.33 1/s" in beyond_the_box(TWO)
    partly = replace(LAB, outer=(STIFF,), theory="rayleigh")
    assert "segments without damping have lightly damped modes" in beyond_the_box(partly)
    assert beyond_the_box(LAB.elastic) == "their damping decreases with frequency, as no segment has damping (C = 0)"


def test_waves_change_at_a_cut_off_in_timoshenkos_theory_alone():
    """Beyond it both l^2 of the dispersion relation are negative: shear and rotary inertia together turn the sign."""
    for theory in THEORIES:
        arm, link = LAB.under(theory), LAB.link
        w = 1.1 * arm.shear_cutoff
        shear = link.rhoA / link.kGA * (theory in WITH_SHEAR)
        turning = link.rhoI / link.EI * (theory in WITH_ROTARY_INERTIA)
        both = shear * turning * w**4 - link.rhoA / link.EI * w**2
        squares = np.roots([1.0, w**2 * (shear + turning), both])
        assert arm.has_cutoff == (squares.real < 0).all()
