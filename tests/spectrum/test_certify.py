"""Certified frequencies: what is proven is true, what cannot be proven an error; D(i w) and the count in balls."""

import math
from dataclasses import replace
from decimal import Decimal

import flint
import mpmath
import numpy as np
import pytest

import tfarm
from tests.rigs import some_rig
from tests.strategies import BOUNDARY_CASES, some_arm
from tfarm import Arm, CertificationError, Hub, Payload
from tfarm.arm import THEORIES
from tfarm.exact import appendix, balls
from tfarm.exact.system import system_of
from tfarm.spectrum.frequencies import RealAxis, count_below, natural_frequencies, pinned_count
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
