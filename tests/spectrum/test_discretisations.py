"""A Ritz model that shares nothing with the exact solution converges to it, at the rate of its theory."""

import math

import numpy as np
import pytest
from scipy.special import spherical_jn

import tfarm
from tests.models import Ritz
from tests.shared import thinned
from tfarm import Arm, Hub, Link, Payload, Section

pytestmark = pytest.mark.kernels

EPS = np.finfo(float).eps
COUNT = 4


def arm(depth: float = 0.2) -> Arm:
    """A deep arm with hub, tip mass and tip inertia, each of the order of the beam's own."""
    section = Section.rectangle(width=0.1, depth=depth, shear_factor=5 / 6)
    link = Link.isotropic(length=1.0, density=7800.0, youngs_modulus=2.1e11, poissons_ratio=0.3, section=section)
    beam = link.rhoA
    return Arm(link=link, hub=Hub(inertia=0.3 * beam), payload=Payload(mass=0.5 * beam, inertia=0.02 * beam))


ARMS = {
    "free": arm(),
    "locked": Arm(link=arm().link, hub=Hub(inertia=math.inf), payload=arm().payload),
    "slender": arm(0.02),
}


def exact(subject: Arm, count: int = COUNT) -> np.ndarray:
    return tfarm.modes(subject, count).natural_frequency[-count:]


@pytest.mark.parametrize("name", thinned(ARMS, 2))
def test_legendre_ritz_comes_from_above_and_never_turns_back(name: str) -> None:
    """Rayleigh and Ritz: every model is an upper bound, and more terms never raise it."""
    subject = ARMS[name]
    omega = np.array([Ritz(subject, terms).natural_frequencies(COUNT) for terms in range(4, 31, 2)])
    rounding = 64 * EPS * (exact(subject) / exact(subject)[0]) ** 2
    assert (omega >= exact(subject) * (1 - rounding)).all()
    assert (np.diff(omega, axis=0) <= rounding * omega[1:]).all()
    np.testing.assert_allclose(omega[-1], exact(subject), rtol=1e-12)


@pytest.mark.parametrize("name", thinned(["free", "locked", "slender"], 3))
def test_legendre_ritz_converges_as_the_legendre_series_of_its_waves(name: str) -> None:
    """The strains of a mode are waves of wave number k; what N terms leave of cos(kx) has the square of the first
    coefficient left out, (2 N + 1) j_N(k L/2)^2 (Gegenbauer): faster than any power, and than any geometric series.
    """
    subject, count = ARMS[name], 8
    link, omega = subject.link, exact(ARMS[name], 8)
    terms = np.arange(8, 28)
    error = np.array([Ritz(subject, int(n)).natural_frequencies(count) for n in terms]) / omega - 1
    for mode in (5, 7):
        k = max(np.roots([1, 0, -_half(link, omega[mode]), 0, _product(link, omega[mode])]).imag)
        rate = (2 * terms + 1) * spherical_jn(terms, k * link.length / 2) ** 2
        seen = (error[:, mode] < 1e-3) & (error[:, mode] > 1e-11)
        assert seen.sum() >= 5
        slope = np.polyfit(np.log(rate[seen]), np.log(error[seen, mode]), 1)[0]
        assert slope == pytest.approx(1.0, abs=0.1)


def _half(link: Link, omega: float) -> float:
    return -(omega**2) * (link.rhoI / link.EI + link.rhoA / link.kGA)


def _product(link: Link, omega: float) -> float:
    return -(omega**2) * link.rhoA / link.EI * (1 - omega**2 * link.rhoI / link.kGA)
