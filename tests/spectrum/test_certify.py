"""Certified frequencies: what is proven is true, and what cannot be proven is an error."""

import math
from dataclasses import replace
from decimal import Decimal

import mpmath
import numpy as np
import pytest

import tfarm
from tfarm import Arm, CertificationError, Hub, Payload
from tfarm.exact import appendix
from tfarm.exact.system import system_of
from tfarm.spectrum.frequencies import natural_frequencies
from tfarm.spectrum.proofs import certify


def last_unit(text: str, digits: int) -> Decimal:
    return Decimal(10) ** (Decimal(text).adjusted() - digits + 1)


@pytest.mark.parametrize("digits", [3, 15, 30])
@pytest.mark.parametrize("preset", [name for name in tfarm.presets() if tfarm.load(name).is_uniform])
def test_brackets_are_one_unit_wide_and_hold_a_root_of_the_papers_determinant(preset: str, digits: int) -> None:
    arm = tfarm.load(preset)
    modes = tfarm.modes(arm, 6)
    proof = modes.certify(digits)
    assert proof.count == 6 + arm.has_rigid_mode
    undamped = replace(arm, link=replace(arm.link, damping=0.0))
    for (lower, upper), omega in zip(proof.brackets, modes.natural_frequency[-6:], strict=True):
        assert Decimal(upper) - Decimal(lower) == last_unit(lower, digits)
        assert Decimal(lower) <= Decimal(float(omega)) + last_unit(lower, 15)
        assert Decimal(upper) >= Decimal(float(omega)) - last_unit(lower, 15)
        with mpmath.workdps(digits + 30):
            ends = [appendix.Appendix(undamped, mpmath.mpc(0, mpmath.mpf(text))) for text in (lower, upper)]
            signs = [(end.Delta * end.lambdas[0] * end.lambdas[1]) for end in ends]
            assert mpmath.re(signs[0] / signs[1]) < 0


FORGERIES = {
    "one missing": (lambda omega: np.delete(omega, 2), r"5 frequencies were enclosed, but 6 lie below"),
    "one moved": (lambda omega: omega * np.where(np.arange(5) == 2, 1 + 1e-6, 1.0), "no certified sign change"),
    "one twice": (lambda omega: omega[[0, 1, 2, 2, 3]], r"overlap|enclosed"),
}


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_list_is_not_certified(name: str) -> None:
    forged, words = FORGERIES[name]
    k = system_of(tfarm.load("sasaki2012"))
    *omega, following = natural_frequencies(k, 2, 7)
    with pytest.raises(CertificationError, match=words):
        certify(k, forged(np.array(omega)), float(following), 15, 1)


def crossing() -> Arm:
    """A pinned-pinned beam whose two spectra cross: n = 1 of the second on n = m of the first, for some length."""
    steel = tfarm.load("stocky-steel")
    return replace(steel, hub=Hub(inertia=0.0), payload=Payload(mass=math.inf, inertia=0.0))


def test_the_cut_off_mode_is_certified() -> None:
    arm = crossing()
    modes = tfarm.modes(arm, 12)
    assert np.isclose(modes.natural_frequency, arm.shear_cutoff, rtol=1e-14).any()
    assert modes.certify(20).count == 12
