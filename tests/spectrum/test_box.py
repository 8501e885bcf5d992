"""Zeros in a box: what is no zero must not be found, whatever the function looks like."""

import math
import re

import numpy as np
import pytest

from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic
from tfarm.spectrum.box import (
    Box,
    complete_box,
    complete_zeros,
    distinct,
    filled_box,
    find_other_zeros,
    newton,
    winding_number,
    zeros_in_box,
)

UNITS = (2.0**-30, 1.0, 2.0**30)  # of time, which matter nowhere: every tolerance is a share of a size


def in_units(function, unit):
    """The same function of s where that is counted in other units."""

    def scaled(s):
        at = function(s / unit)
        return Analytic(at.value, at.slope / unit, at.scale)

    return scaled


def polynomial(*zeros, flat=0.0):
    """A polynomial with those zeros; its slope is given as 0 for |s| < flat, as differences of a constant are."""
    p = np.poly1d(np.poly(zeros))

    def function(s):
        slope = np.where(abs(s) < flat, 0.0, p.deriv()(s))
        return Analytic(p(s), slope.astype(complex), np.zeros(s.size, complex))

    return function


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


def test_flat_starts_do_not_stand_in_for_zeros_not_yet_found():
    zeros = np.array([2.0 + 3.0j, 2.0 - 3.0j, -1.0, -40.0])
    found = zeros_in_box(polynomial(*zeros, flat=0.5), Box(-50.0, 10.0, -10.0, 10.0), np.array([0.1, -0.2, 0.3 + 0j]))
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(zeros), rel=1e-12)


@pytest.mark.parametrize("unit", UNITS)
def test_the_turns_around_a_box_are_the_zeros_in_it_however_near_the_edge(unit):
    zeros = np.array([2.0 + 3.0j, 2.0 - 3.0j, -1.0, -40.0, 9.999, 9.99999, 10.001])
    box = Box(-50.0 * unit, 10.0 * unit, -10.0 * unit, 10.0 * unit)
    assert winding_number(in_units(polynomial(*zeros), unit), box) == box.holds(unit * zeros + 0j).sum() == 6
    with pytest.raises(ConvergenceError, match=re.escape(f"lies on the contour near {10 * unit:.6g}")):
        winding_number(in_units(polynomial(*zeros, 10.0), unit), box)


def test_a_search_ends():
    """Where cut follows cut the search is given up, not run for minutes."""
    zeros = np.array([2.0 + 3.0j, 2.0 - 3.0j, -1.0, -40.0])
    with pytest.raises(ConvergenceError, match="too many cuts"):
        zeros_in_box(polynomial(*zeros), Box(-50.0, 10.0, -10.0, 10.0), np.array([0.1 + 0j]), most_calls=3)


def test_a_box_grows_where_a_zero_lies_on_its_edge():
    zeros = np.array([2.0 + 10.0j, 2.0 - 10.0j, -1.0, -40.0])
    found, box = complete_zeros(
        polynomial(*zeros), lambda height: Box(-50.0, 10.0, -height, height), 10.0, np.array([0.1 + 0j])
    )
    assert 10.0 < box.im_max < 10.1
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(zeros), rel=1e-12)
    assert (found.imag == 0).sum() == 2
    _, last = complete_zeros(  # on the edge of the first two, so that the last of three is taken
        polynomial(*zeros, 2.0 + 11.0j, 2.0 - 11.0j),
        lambda height: Box(-50.0, 10.0, -height, height), 10.0, np.array([0.1 + 0j]), factors=(1.0, 1.1, 1.2),
    )  # fmt: skip
    assert last.im_max == 12.0
    with pytest.raises(ConvergenceError, match="lies on the contour"):
        complete_zeros(
            polynomial(*zeros), lambda height: Box(-50.0, 10.0, -height, height), 10.0, zeros, factors=(1.0,)
        )


EPS = 2.0**-52


@pytest.mark.parametrize("size", UNITS)
def test_a_zero_has_all_its_digits_whatever_its_size(size):
    """What ends the steps is a share of |s|, so units of time do not matter: not the zeros, nor how many calls."""
    zeros, calls = np.array([1.0 + 2.0j, 1.0 - 2.0j, -0.37]), []

    def function(s):
        calls.append(s.size)
        return in_units(polynomial(*zeros), size)(s)

    found = newton(function, size * zeros * (1 + 0.01j))
    np.testing.assert_allclose(found / size, zeros, rtol=4 * EPS)
    assert len(calls) < 9


def test_points_side_by_side_are_one():
    """The first of them is kept; how near is measured by their size."""
    points = np.array([1e6, 2.0, 1e6 + 1e-4, 2.0 + 1e-4, 0.0, 0.0, 2.0 + 1e-10j])
    np.testing.assert_array_equal(distinct(points), [1e6, 2.0, 2.0 + 1e-4, 0.0])


@pytest.mark.parametrize("unit", UNITS)
def test_all_zeros_of_a_box_are_found_in_any_unit_of_time(unit):
    """One of them a millionth of the box off 0; what is taken for rounding, and so for real, is a share of a size."""
    zeros = np.array([2.0 + 3.0j, 2.0 - 3.0j, -1.0, 1e-5])
    function = in_units(polynomial(*zeros), unit)
    found, box = complete_zeros(function, lambda height: Box(-5 * unit, 5 * unit, -height, height), 4 * unit, zeros[:0])
    assert np.sort_complex(found / unit) == pytest.approx(np.sort_complex(zeros), rel=1e-10)
    assert (found.imag == 0).sum() == 2
    assert box.im_max == 4 * unit


@pytest.mark.parametrize("unit", UNITS)
def test_a_zero_of_high_order_is_there_as_often(unit):
    """As a polynomial, next to its zero mere rounding, and as a product, which is exact there."""

    def product(s):
        a, b = (s - 1.3) ** 3, s + 0.7
        return Analytic(a * b, a + 3 * (s - 1.3) ** 2 * b, 0 * s)

    box = Box(-unit, 2 * unit, -unit, unit)
    for function, digits in ((polynomial(1.3, 1.3, 1.3, -0.7), 1e-4), (product, 1e-9)):
        found = zeros_in_box(in_units(function, unit), box, np.empty(0, complex))
        assert np.sort(found.real) / unit == pytest.approx([-0.7, 1.3, 1.3, 1.3], rel=digits)


def test_a_known_zero_is_taken_as_it_is_and_once():
    """Near 0 Newton's method is not believed: a zero found next to a known one is that one; others are kept."""
    tiny, zeros = 3e-10, np.array([2.0 + 3.0j, 2.0 - 3.0j, -1.0])
    function, box = polynomial(*zeros, tiny), Box(-5.0, 5.0, -4.0, 4.0)
    rough = np.array([tiny * 1.01], dtype=complex)
    found = zeros_in_box(function, box, zeros * 1.01, rough)
    assert np.sort_complex(found) == pytest.approx(np.sort_complex([*zeros, rough[0]]), rel=1e-12)
    known = np.array([-1.0 + 0j, 7.0])  # of which one lies in the box, and is a zero that would be found anyway
    found = zeros_in_box(polynomial(*zeros, 7.0), box, zeros * 1.01, known)
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(zeros), rel=1e-12)


def test_a_fast_turning_function_is_not_aliased() -> None:
    """exp(a s^2) turns once between the points of one side and not at all on the opposite one."""
    zeros = np.array([0.3 + 0.2j, 0.7 - 0.4j, 0.5 + 0.45j])
    box = Box(0.0, 1.0, -0.5, 0.51)
    turn = 40 * math.pi * 1.0  # 2 a x = 2 pi a step of 1/40 at x = 1
    function = with_zeros(zeros, turn)
    assert winding_number(function, box, points=40) == 3


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


def test_a_missed_zero_is_found_with_the_known_ones_divided_out():
    """Of 60 zeros far right a plain step is short everywhere; once all but one are known none is there again."""
    zeros = np.array([1.0 + 2.0j, 1.0 - 2.0j, -1.5, 0.8 + 0.1j, *np.linspace(3.0, 4.0, 60)])
    box, starts = Box(-2.0, 2.0, -3.0, 3.0), np.array([-0.9 + 0j, 0.5 + 1.5j, -1.0 - 2.0j])
    function = with_zeros(zeros)
    near = find_other_zeros(function, starts, np.delete(zeros, 3), box, 1)
    assert near.size
    np.testing.assert_allclose(near, zeros[3], rtol=1e-5)
    assert find_other_zeros(function, starts, zeros, box, 1).size == 0


def test_of_a_function_real_on_the_real_axis_half_a_box_is_searched():
    """All zeros are found, real, near the axis and double ones too, on fewer points than in a box that is no mirror."""
    zeros = np.array([2.0 + 3.0j, 2.0 - 3.0j, -1.0, 1e-5, 0.7 + 1e-4j, 0.7 - 1e-4j, -1.7, -1.7])
    points = []

    def function(s):
        points[-1] += s.size
        return with_zeros(zeros)(s)

    for low in (-4.0, -4.001):
        points.append(0)
        found = zeros_in_box(function, Box(-5.0, 5.0, low, 4.0), np.empty(0, complex))
        np.testing.assert_allclose(np.sort_complex(found.round(7)), np.sort_complex(zeros), atol=1e-6)
    assert points[0] < points[1]


def conjugates(*upper):
    return np.array([[z, np.conj(z)] for z in upper])


def test_a_box_ends_below_the_first_zero_that_is_not_listed() -> None:
    """Among known zeros by their heights, among unknown ones by the winding number; one below all of them is found."""
    all_there = with_zeros(conjugates(-0.01 + 1j, -0.01 + 2j, -0.02 + 3j, -0.1 + 5j))
    none = np.empty((0, 2), complex)
    box = complete_box(all_there, conjugates(-0.01 + 1j, -0.01 + 2j, -0.1 + 5j), none, 0.0)
    assert box is not None
    assert 1 < box.im_max < 3
    known = complete_box(all_there, conjugates(-0.01 + 1j, -0.01 + 2j), conjugates(-0.02 + 3j, -0.1 + 5j), 0.0)
    assert known is not None
    assert 2 < known.im_max < 3
    below, listed, beyond = (conjugates(each) for each in (-0.01 + 0.3j, -0.01 + 2j, -0.02 + 3j))
    function = with_zeros(np.concatenate([below, listed, beyond]))
    assert complete_box(function, listed, beyond, 0.0) is None
    box, found = filled_box(function, listed, beyond, 2.8, listed.ravel(), 0.0)
    assert 2 < box.im_max < 3
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(np.r_[below, listed].ravel()), rtol=1e-12)


def test_no_box_is_complete_with_a_listed_zero_that_is_none() -> None:
    function = with_zeros(conjugates(-0.01 + 1j, -0.01 + 3j))
    listed = conjugates(-0.01 + 1j, -0.01 + 2j, -0.01 + 3j)
    assert complete_box(function, listed, np.empty((0, 2), complex), 0.0) is None
