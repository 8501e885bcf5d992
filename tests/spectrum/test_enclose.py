"""Proofs off the axis: they hold where closed forms and fifty digits can check them, and refuse what is not so."""

import math
from dataclasses import replace

import flint
import mpmath
import numpy as np
import pytest

import tfarm
from tests.shared import refusal, sized, thinned
from tests.spectrum.damped import pairs
from tests.spectrum.independent import newton_root, pinned, sine_waves
from tests.spectrum.test_damped import damped_arm, listed
from tfarm import CertificationError
from tfarm.exact.balls import point, precision
from tfarm.exact.system import system_of
from tfarm.spectrum import frequencies, proofs
from tfarm.spectrum.box import Box
from tfarm.spectrum.proofs import Disc, _holds_one, disjoint, enclosed, proven_count

LAB = tfarm.load("sasaki2012-lab")


def box_of(height, reach):
    """From -reach to 0.1 height."""
    return Box(-reach, 0.1 * height, -height, height)


@pytest.mark.parametrize("digits", [15, 40, 200])
def test_discs_hold_the_papers_roots(digits: int) -> None:
    arm = damped_arm(2e-5, hub=0.3, mass=0.4, inertia=0.5, slenderness=12.0)
    k = system_of(arm)
    for zero in pairs(listed(arm, 3))[[0, 2], 0]:
        disc = enclosed(k, complex(zero), digits)
        root = newton_root(arm, zero, digits)
        with mpmath.workdps(2 * digits + 20):
            miss = abs(mpmath.mpc(disc.re, disc.im) - root)
            assert miss < mpmath.mpf(disc.radius)
            assert mpmath.mpf(disc.radius) <= abs(root) * mpmath.mpf(10) ** (1 - digits)
            assert mpmath.mpf(disc.radius) >= abs(root) * mpmath.mpf(10) ** (-digits - 1)


def test_discs_of_real_zeros_are_real() -> None:
    arm = pinned(damped_arm(3e-3, slenderness=200.0).link)
    damped = listed(arm, 6)
    for pair in damped.eigenvalues[damped.is_overdamped]:
        for zero in pair:
            disc = enclosed(damped.undamped.system, complex(zero), 30)
            assert disc.is_real
            root = newton_root(arm, zero, 30)
            with mpmath.workdps(60):
                assert abs(mpmath.mpf(disc.re) - root) < mpmath.mpf(disc.radius)


def test_a_double_eigenvalue_has_no_disc(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without shear and at C w = 2 exactly both zeros are -w; the double nearest to that C leaves them 1e-8 apart."""
    rigid = damped_arm(0.0, hub=math.inf)
    omega = tfarm.modes(rigid, 2, theory="euler-bernoulli").natural_frequency
    arm = replace(rigid, link=replace(rigid.link, damping=2 / float(omega[1])))
    k = system_of(arm, "euler-bernoulli")
    monkeypatch.setattr(frequencies, "MOST_AXIS_BITS", 1000)
    assert "double" in str(refusal(enclosed, k, complex(-omega[1]) * (1 + 1e-4), 5, kind=CertificationError))


def test_touching_discs_are_seen() -> None:
    def disc(re, im, radius="1e-3"):
        return Disc(re, im, radius)

    apart = [disc("1.000", "0"), disc("1.003", "0"), disc("1.000", "0.0021"), disc("-1.000", "0")]
    assert disjoint(apart)
    for other in (
        disc("1.000", "0"),
        disc("1.0019", "0"),
        disc("1.002", "0"),
        disc("1.001", "0.0015"),
        disc("9", "0", "8.0"),
    ):
        assert not disjoint([*apart, other])
    assert disjoint([])


def test_rouches_theorem_is_right_about_discs_of_any_size() -> None:
    """A disc it accepts has exactly one zero; small discs around a zero are accepted."""
    rng = np.random.default_rng(6)
    k = system_of(LAB)
    zeros = listed(LAB, 12).eigenvalues[1:].ravel()
    accepted = 0
    with precision(200):
        for _ in range(150):
            zero = zeros[rng.integers(8)]
            radius = 10 ** rng.uniform(-4, 0.5) * abs(zero)
            middle = complex(zero + radius * rng.uniform(0, 1.5) * np.exp(2j * math.pi * rng.random()))
            if _holds_one(k, None, point(middle), flint.arb(float(radius))):
                assert (abs(zeros - middle) <= radius).sum() == 1
                accepted += 1
        assert all(_holds_one(k, None, point(complex(z)), flint.arb(float(1e-3 * abs(z)))) for z in zeros[:8])
    assert accepted > 20


@pytest.mark.parametrize("boxes", sized(1, 2))
@pytest.mark.parametrize("theory", thinned(["timoshenko", "shear", "euler-bernoulli"], 3))
def test_counts_of_sine_waves_are_those_of_the_closed_form(theory: str, boxes: int) -> None:
    rng = np.random.default_rng(31)
    link = damped_arm(0.0, slenderness=15.0).link
    first = tfarm.modes(pinned(link), 1).natural_frequency[-1]
    for Cw in (0.0, 0.05):
        arm = pinned(replace(link, damping=Cw / float(first)))
        k = system_of(arm, theory)
        exact = np.concatenate([part.ravel() for part in sine_waves(arm, 200, theory)])
        for _ in range(boxes):
            height = float(first * 10 ** rng.uniform(-0.5, 1.2))
            reach = height * float(rng.uniform(0.05, 1.5))
            box = box_of(height, min(reach, 0.9 * float(first) / Cw) if Cw else reach)
            inside = int(box.holds(exact).sum()) + k.at_rest
            assert proven_count(k, box) == inside, (Cw, box)


def test_a_box_through_a_zero_is_refused() -> None:
    k = system_of(LAB)
    zero = pairs(listed(LAB, 3))[0, 0]
    for box in (
        Box(-50.0, 30.0, -zero.imag, zero.imag),
        Box(float(zero.real), 30.0, -150.0, 150.0),
        Box(-50.0, float(zero.real), -150.0, 150.0),
        Box(-50.0, 0.0, -300.0, 300.0),  # through the origin's double zero
    ):
        assert "edge of the box" in str(refusal(proven_count, k, box, kind=CertificationError))


def test_a_box_with_the_accumulation_point_is_refused() -> None:
    k = system_of(LAB)
    for left in (-1 / LAB.link.damping, -2 / LAB.link.damping):
        box = Box(left, 10.0, -300.0, 300.0)
        assert "-1/C" in str(refusal(proven_count, k, box, kind=CertificationError))


FORGERIES = {
    "dropped": lambda zeros: np.delete(zeros, 2, axis=0),
    "doubled": lambda zeros: np.insert(zeros, 3, zeros[3], axis=0),
    "one in place of another": lambda zeros: np.concatenate([zeros[:3], zeros[2:3], zeros[4:]]),
    "one moved": lambda zeros: np.concatenate([zeros[:3], zeros[3:4] * (1 + 1e-3), zeros[4:]]),
}


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_list_is_refused(name: str) -> None:
    damped = listed(LAB, 5)
    zeros = np.concatenate([damped.eigenvalues[:1], FORGERIES[name](damped.eigenvalues[1:])])
    undamped = replace(damped.undamped, index=np.arange(len(zeros)))
    forged = replace(damped, undamped=undamped, eigenvalues=zeros)
    consistent = int(forged.box.holds(zeros).sum()) + damped.undamped.system.at_rest - 2
    for count in {damped.count, consistent}:
        refusal(replace(forged, count=count).certify, kind=CertificationError)


@pytest.mark.parametrize("turn", [1, 1j])
def test_an_inexact_eigenvalue_is_refused(turn: complex) -> None:
    """A number that is 1e-9 off is not proven by a disc elsewhere."""
    damped = listed(LAB, 4)
    zeros = damped.eigenvalues.copy()
    moved = zeros[2, 0] + abs(zeros[2, 0]) * 1e-9 * turn
    zeros[2] = [moved, moved.conjugate()]
    with pytest.raises(CertificationError):
        replace(damped, eigenvalues=zeros).certify()


def test_a_contour_that_takes_too_many_pieces_is_given_up(monkeypatch):
    """One arm's proof took 27,000 evaluations for a third of one side; a proof ends, or reports that it does not."""
    k = system_of(tfarm.load("sasaki2012-lab"))
    box = Box(-300.0, 100.0, -400.0, 400.0)
    assert proven_count(k, box) > 0
    monkeypatch.setattr(proofs, "MOST_PIECES", 20)
    with pytest.raises(CertificationError, match="needs more than 20 pieces: certify a shorter list"):
        proven_count(k, box)
