"""Proofs on the axis and off it: what is proven is true by other methods, and what cannot be proven is an error."""

import math
import re
from dataclasses import replace
from decimal import Decimal

import flint
import mpmath
import numpy as np
import pytest

import tfarm
from tests.rigs import some_rig
from tests.shared import refusal, sized, thinned
from tests.spectrum.damped import pairs
from tests.spectrum.independent import newton_root, pinned, sine_waves
from tests.spectrum.test_damped import damped_arm, listed
from tests.strategies import BOUNDARY_CASES, some_arm
from tfarm import Arm, CertificationError, Hub, Payload
from tfarm.arm import THEORIES
from tfarm.exact import appendix, balls
from tfarm.exact.balls import point, precision
from tfarm.exact.system import system_of
from tfarm.spectrum.box import Box
from tfarm.spectrum.frequencies import RealAxis, count_below, natural_frequencies, pinned_count
from tfarm.spectrum.proofs import Disc, _holds_one, certify, disjoint, enclose_zero, proven_count


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


COUNT = 7


def undamped(arm):
    return system_of(arm, arm.theory).with_damping(0.0)


def some_systems():
    """Every kind of boundary, and rigs of one to six segments with springs, bodies and offsets."""
    for n, case in enumerate(BOUNDARY_CASES):
        yield some_arm(np.random.default_rng(n), case, damping=0.0)
    for n in range(12):
        yield some_rig(np.random.default_rng([17, n]), damped=False, theory=THEORIES[n % 4])


@pytest.mark.parametrize("arm", list(some_systems()))
def test_the_count_in_ball_arithmetic_is_that_of_the_list(arm):
    """Between the nth frequency and the next n lie below, and D has changed its sign n times."""
    table = tfarm.modes(arm, COUNT)
    k, omega = undamped(arm), table.natural_frequency[table.index > 0]
    between = np.sqrt(omega[1:] * omega[:-1])[np.diff(omega) > 1e-9 * omega[1:]]
    with balls.precision(512):  # of six segments far below the first frequency 200 bits do not suffice
        axis = RealAxis(k)
        for point in (0.5 * omega[0], *between):
            below = int((table.natural_frequency < point).sum())
            assert axis.count(flint.arb(point)) == below == count_below(k, point)
            assert bool(axis.drive(flint.arb(point)) < 0) == (below % 2 == 1)
        assert (
            axis.count(flint.arb(float(omega[0]), 0.1 * float(omega[0]))) is None
        )  # at a frequency nothing is certain


def test_half_waves_are_counted_in_closed_form():
    """n pi < sqrt(-z): of the wave that travels first, and with the second one the shear cut-off is passed."""
    pi = math.pi
    for number in (0, 1, 2, 7):
        inside = -flint.arb(((number + 0.5) * pi) ** 2)
        assert pinned_count([inside, flint.arb(3)]) == number
        assert pinned_count([flint.arb(3), inside]) == number
        assert pinned_count([inside, -flint.arb(1)]) == number + 1
        assert pinned_count([inside, -flint.arb((2.5 * pi) ** 2)]) == number + 3
    assert pinned_count([flint.arb(3), flint.arb(2)]) == 0
    assert pinned_count([-flint.arb(pi**2, 1e-9), flint.arb(3)]) is None
    assert pinned_count([flint.arb(0, 1e-9), flint.arb(3)]) is None


LAB = tfarm.load("sasaki2012-lab")


def box_of(height, reach):
    """From -reach to 0.1 height."""
    return Box(-reach, 0.1 * height, -height, height)


@pytest.mark.parametrize("digits", [15, 40, 200])
def test_discs_hold_the_papers_roots(digits: int) -> None:
    arm = damped_arm(2e-5, hub=0.3, mass=0.4, inertia=0.5, slenderness=12.0)
    k = system_of(arm)
    for zero in pairs(listed(arm, 3))[[0, 2], 0]:
        disc = enclose_zero(k, complex(zero), digits)
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
            disc = enclose_zero(damped.undamped.system, complex(zero), 30)
            assert disc.is_real
            root = newton_root(arm, zero, 30)
            with mpmath.workdps(60):
                assert abs(mpmath.mpf(disc.re) - root) < mpmath.mpf(disc.radius)


def test_a_double_eigenvalue_has_no_disc() -> None:
    """Without shear and at C w = 2 exactly both zeros are -w; the double nearest to that C leaves them 1e-8 apart."""
    rigid = damped_arm(0.0, hub=math.inf)
    omega = tfarm.modes(rigid, 2, theory="euler-bernoulli").natural_frequency
    arm = replace(rigid, link=replace(rigid.link, damping=2 / float(omega[1])))
    k = system_of(arm, "euler-bernoulli")
    assert "double" in str(refusal(enclose_zero, k, complex(-omega[1]) * (1 + 1e-4), 5, kind=CertificationError))


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


DAMPED_FORGERIES = {
    "dropped": lambda zeros: np.delete(zeros, 2, axis=0),
    "doubled": lambda zeros: np.insert(zeros, 3, zeros[3], axis=0),
    "one in place of another": lambda zeros: np.concatenate([zeros[:3], zeros[2:3], zeros[4:]]),
    "one moved": lambda zeros: np.concatenate([zeros[:3], zeros[3:4] * (1 + 1e-3), zeros[4:]]),
}


@pytest.mark.parametrize("name", DAMPED_FORGERIES)
def test_a_forged_list_of_eigenvalues_is_refused(name: str) -> None:
    damped = listed(LAB, 5)
    zeros = np.concatenate([damped.eigenvalues[:1], DAMPED_FORGERIES[name](damped.eigenvalues[1:])])
    undamped = replace(damped.undamped, index=np.arange(len(zeros)))
    forged = replace(damped, undamped=undamped, eigenvalues=zeros)
    consistent = int(forged.box.holds(zeros).sum()) + damped.undamped.system.at_rest - 2
    for count in {damped.count, consistent}:
        error = str(refusal(replace(forged, count=count).certify, kind=CertificationError))
        assert re.search("the box has 12 eigenvalues|discs of two eigenvalues touch|not the eigenvalue listed", error)


@pytest.mark.parametrize("turn", [1, 1j])
def test_an_inexact_eigenvalue_is_refused(turn: complex) -> None:
    """A number that is 1e-9 off is not proven by a disc elsewhere."""
    damped = listed(LAB, 4)
    zeros = damped.eigenvalues.copy()
    moved = zeros[2, 0] + abs(zeros[2, 0]) * 1e-9 * turn
    zeros[2] = [moved, moved.conjugate()]
    with pytest.raises(CertificationError):
        replace(damped, eigenvalues=zeros).certify()


def test_a_contour_that_takes_too_many_pieces_is_given_up():
    """One arm's proof took 27,000 evaluations for a third of one side; a proof ends, or reports that it does not."""
    k = system_of(tfarm.load("sasaki2012-lab"))
    box = Box(-300.0, 100.0, -400.0, 400.0)
    assert proven_count(k, box) > 0
    with pytest.raises(CertificationError, match="needs more than 20 pieces: certify a shorter list"):
        proven_count(k, box, most_pieces=20)
