"""Zeros followed on functions whose zeros are known, and winding numbers that turn fast."""

import math

import numpy as np
import pytest

import tfarm
from tests.spectrum.damped import some_damped_arm
from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic
from tfarm.spectrum import box as box_module
from tfarm.spectrum.box import Box, complete_box, winding_number, zeros_in_box
from tfarm.spectrum.continuation import Member, Node, follow, improved
from tfarm.spectrum.damped import COMPANY, all_damped_modes, damped_modes, member


def with_zeros(zeros, turning=0.0):
    """prod (s - z) exp(turning s^2), its exponential apart as scale."""
    zeros = np.ravel(zeros)

    def function(s):
        away = s[:, None] - zeros
        value = away.prod(1)
        with np.errstate(all="ignore"):
            rate = (1 / away).sum(1)
        slope = np.where(value == 0, 0.0, value * np.where(value == 0, 0.0, rate))
        for n in np.nonzero(value == 0)[0]:
            others = np.delete(zeros, abs(s[n] - zeros).argmin())
            slope[n] = (s[n] - others).prod()
        return Analytic(value, slope + 2 * turning * s * value, turning * s**2)

    return function


def start_at(omega):
    return Node(0.0, np.stack([1j * np.asarray(omega), -1j * np.asarray(omega)], 1))


def of_oscillators(omega):
    """Independent oscillators s^2 + C w^2 s + w^2 = 0: proportional damping."""

    def zeros(C):
        half = C * omega**2 / 2
        root = np.sqrt((half**2 - omega**2).astype(complex))
        return np.stack([-half + root, -half - root], 1)

    return lambda C: Member(with_zeros(zeros(C)), -1 / C if C else -np.inf), zeros


def sorted_pair(pair):
    return np.array(sorted(pair, key=lambda z: (-z.imag, abs(z))))


# ------------------------------------------------------------ following


@pytest.mark.parametrize("stop", [0.03, 0.21, 1.1, 5.0])
def test_oscillators_are_followed_into_overdamping(stop: float) -> None:
    omega = np.array([1.0, 2.7, 5.1, 8.3, 12.0])
    family, exact = of_oscillators(omega)
    nodes = follow(family, start_at(omega), stop, 0.01 / omega[-1], omega.size)
    assert nodes[-1].at == stop
    for node in nodes:
        for ours, theirs in zip(node.zeros, exact(node.at), strict=True):
            np.testing.assert_allclose(sorted_pair(ours), sorted_pair(theirs), rtol=1e-5)


def test_two_branches_do_not_fall_onto_one_zero() -> None:
    """Pairs that pass each other at a small distance: (0.02 + C) and (1 - C) apart from i."""

    def exact(C):
        upper = np.array([-0.02 + 1j * (1 + C), 1j * (2 - C)])
        return np.stack([upper, upper.conj()], 1)

    nodes = follow(lambda C: Member(with_zeros(exact(C))), Node(0.0, exact(0.0)), 1.0, 0.3, 2)
    np.testing.assert_allclose(nodes[-1].zeros, exact(1.0), rtol=1e-5)


def test_a_pair_meets_on_the_axis_and_parts_again() -> None:
    def exact(C):
        square = 1 - 4 * math.sin(C) ** 2 + 0j
        mean = -2 - C / 5
        first = mean + 1j * np.sqrt(square)
        return np.array([[first, 2 * mean - first], [-1 + 6j, -1 - 6j]])

    nodes = follow(lambda C: Member(with_zeros(exact(C))), Node(0.0, exact(0.0)), 3.0, 0.05, 2)
    assert any(node.zeros[0, 0].imag == 0 for node in nodes)
    assert nodes[-1].zeros[0, 0].imag > 0
    for ours, theirs in zip(nodes[-1].zeros, exact(3.0), strict=True):
        np.testing.assert_allclose(sorted_pair(ours), sorted_pair(theirs), rtol=1e-5)


def test_a_wanted_pair_that_ends_is_an_error_and_not_a_shorter_list() -> None:
    """A zero that jumps cannot be followed; what is behind it only keeps company."""

    def exact(C):
        jump = 0.0 if C < 0.37 else 3.0
        upper = np.array([-0.1 + 1j, -0.1 + 5j, -0.1 + 1j * (12 + jump)])
        return np.stack([upper, upper.conj()], 1)

    def family(C):
        return Member(with_zeros(exact(C)))

    nodes = follow(family, Node(0.0, exact(0.0)), 1.0, 0.05, 2)
    assert len(nodes[-1].zeros) == 2
    with pytest.raises(ConvergenceError):
        follow(family, Node(0.0, exact(0.0)), 1.0, 0.05, 3)


def test_correction_keeps_conjugates_and_real_zeros_apart() -> None:
    truth = np.array([[-1 + 2j, -1 - 2j], [-5.0, -9.0]])
    zeros, _ = improved(Member(with_zeros(truth)), truth * 1.01)
    assert zeros[0, 1] == zeros[0, 0].conjugate()
    assert not zeros[1].imag.any()


def test_a_conjugate_pair_is_asked_for_once() -> None:
    """The function is real on the real axis: its value at the lower zero of a pair is known."""
    truth, asked = np.array([[-1 + 2j, -1 - 2j], [-5.0, -9.0], [-3 + 7j, -3 - 7j]]), []
    function = with_zeros(truth)
    whole, _ = improved(Member(lambda s: asked.append(s.size) or function(s)), truth * 1.01)
    assert asked == [4]
    assert abs(whole - truth).max() < 0.01 * abs(truth * 0.01).max()


def test_a_nearly_double_zero_is_corrected_as_a_pair() -> None:
    """Closer to each other than Newton's method would bear."""
    for apart in (1e-3, 1e-5, 1e-6j):
        truth = np.array([[-3 + apart, -3 - apart], [-1 + 9j, -1 - 9j]])
        if np.imag(apart) == 0:
            truth[0] = sorted(truth[0], key=abs)
        zeros = truth.copy()
        zeros[0] = -3.02 + (zeros[0] + 3) * 30
        for _ in range(12):
            zeros, _ = improved(Member(with_zeros(truth)), zeros)
        for ours, theirs in zip(zeros, truth, strict=True):
            np.testing.assert_allclose(sorted_pair(ours), sorted_pair(theirs), rtol=1e-8)


# ------------------------------------------------------------ winding numbers


def test_a_fast_turning_function_is_not_aliased(monkeypatch: pytest.MonkeyPatch) -> None:
    """exp(a s^2) turns once between the points of one side and not at all on the opposite one."""
    zeros = np.array([0.3 + 0.2j, 0.7 - 0.4j, 0.5 + 0.45j])
    box = Box(0.0, 1.0, -0.5, 0.5)
    turn = 40 * math.pi * 1.0  # 2 a x = 2 pi a step of 1/40 at x = 1
    function = with_zeros(zeros, turn)
    assert winding_number(function, box, points=40) == 3
    monkeypatch.setattr(box_module, "FORESEEN", np.inf)
    assert winding_number(function, box, points=40) != 3


def test_the_arm_that_was_miscounted(monkeypatch: pytest.MonkeyPatch) -> None:
    """18 of 20 zeros: a piece across the real axis may turn by 4 pi while the ends show no phase, nor a rate of it."""
    rng = np.random.default_rng(1)
    for _ in range(70):
        arm, count = some_damped_arm(rng)
    damped = damped_modes(tfarm.modes(arm, count))
    function = member(damped.undamped.system).function
    inside = damped.box.holds(damped.eigenvalues[damped.index > 0]).sum()
    points = (5, 10, 20, 25, 40, 83)
    assert [winding_number(function, damped.box, number) for number in points] == [inside] * len(points)
    monkeypatch.setattr(box_module, "FORESEEN", np.inf)
    assert winding_number(function, damped.box, 40) == inside - 2


@pytest.mark.parametrize("seed", range(6))
def test_random_zeros_are_counted_and_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    zeros = rng.uniform(-2, 2, 12) + 1j * rng.uniform(-2, 2, 12)
    zeros[3] = zeros[4]  # a double one
    box = Box(-1.3, 0.9, -1.1, 1.6)
    inside = box.holds(zeros)
    for turning in (0.0, 30.0, -200j):
        function = with_zeros(zeros, turning)
        assert winding_number(function, box) == inside.sum()
    found = zeros_in_box(with_zeros(zeros, 3.0), box, np.empty(0, complex))
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(zeros[inside]), atol=1e-5)


# ------------------------------------------------------------ boxes


def conjugates(*upper):
    return np.array([[z, np.conj(z)] for z in upper])


def test_a_box_ends_below_the_first_zero_that_is_not_listed() -> None:
    """Among known zeros by their heights, among unknown ones by the winding number; one below all of them is found."""
    all_there = with_zeros(conjugates(-0.01 + 1j, -0.01 + 2j, -0.02 + 3j, -0.1 + 5j))
    none = np.empty((0, 2), complex)
    box, count, more = complete_box(all_there, conjugates(-0.01 + 1j, -0.01 + 2j, -0.1 + 5j), none, 0.0)
    assert 1 < box.im_max < 3
    assert not more.size
    assert count == box.holds(np.array([1j, -1j, 2j, -2j])).sum()
    known = complete_box(all_there, conjugates(-0.01 + 1j, -0.01 + 2j), conjugates(-0.02 + 3j, -0.1 + 5j), 0.0)
    assert 2 < known[0].im_max < 3
    assert known[1] == 4
    below = with_zeros(conjugates(-0.01 + 0.3j, -0.01 + 2j, -0.02 + 3j))
    box, count, more = complete_box(below, conjugates(-0.01 + 2j), conjugates(-0.02 + 3j), 0.0)
    assert 2 < box.im_max < 3
    assert (count, *more) == (4, pytest.approx(-0.01 + 0.3j, rel=1e-12))


def test_a_listed_zero_that_is_none_is_told() -> None:
    function = with_zeros(conjugates(-0.01 + 1j, -0.01 + 3j))
    with pytest.raises(ConvergenceError, match="only"):
        complete_box(function, conjugates(-0.01 + 1j, -0.01 + 2j, -0.01 + 3j), np.empty((0, 2), complex), 0.0)


def test_what_cannot_be_followed_is_not_sought_twice(monkeypatch):
    """An answer asks for the same modes again and again, and giving up takes longest."""
    sought = []

    def lose(*args):
        sought.append(args[2])
        raise ConvergenceError("lost", args[1], 0.0)

    monkeypatch.setattr("tfarm.spectrum.damped.follow", lose)
    undamped = tfarm.modes(tfarm.load("sasaki2012-lab").having(damping=1.2345e-3), 4)
    for _ in range(3):
        with pytest.raises(ConvergenceError, match="lost"):
            all_damped_modes(undamped)
    assert len(sought) == len(COMPANY)
