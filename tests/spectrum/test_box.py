"""Zeros in a box: what is no zero must not be found, whatever the function looks like."""

import numpy as np
import pytest

from tfarm.errors import ConvergenceError
from tfarm.exact.characteristic import Analytic
from tfarm.spectrum import box as room
from tfarm.spectrum.box import Box, complete, newton, winding_number, zeros_in_box


def polynomial(*zeros, flat=0.0):
    """A polynomial with those zeros; its slope is given as 0 for |s| < flat, as differences of a constant are."""
    p = np.poly1d(np.poly(zeros))

    def function(s):
        slope = np.where(abs(s) < flat, 0.0, p.deriv()(s))
        return Analytic(p(s), slope.astype(complex), np.zeros(s.size, complex))

    return function


def test_a_start_where_the_function_is_flat_is_no_zero():
    starts = np.array([1e-3, -2e-4, 1.9], dtype=complex)
    assert newton(polynomial(2.0, -3.0, flat=0.01), starts) == pytest.approx([2.0], rel=1e-14)


def test_flat_starts_do_not_stand_in_for_zeros_not_yet_found():
    zeros = np.array([2.0 + 3.0j, 2.0 - 3.0j, -1.0, -40.0])
    found = zeros_in_box(polynomial(*zeros, flat=0.5), Box(-50.0, 10.0, -10.0, 10.0), np.array([0.1, -0.2, 0.3 + 0j]))
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(zeros), rel=1e-12)


def test_the_turns_around_a_box_are_the_zeros_in_it_however_near_the_edge():
    zeros = np.array([2.0 + 3.0j, 2.0 - 3.0j, -1.0, -40.0, 9.999, 9.99999, 10.001])
    box = Box(-50.0, 10.0, -10.0, 10.0)
    assert winding_number(polynomial(*zeros), box) == box.holds(zeros.astype(complex)).sum() == 6
    with pytest.raises(ConvergenceError, match="lies on the contour near 10"):
        winding_number(polynomial(*zeros, 10.0), box)


def test_a_search_ends(monkeypatch):
    """Where cut follows cut the search is given up, not run for minutes."""
    zeros = np.array([2.0 + 3.0j, 2.0 - 3.0j, -1.0, -40.0])
    monkeypatch.setattr(room, "MOST_CALLS", 3)
    with pytest.raises(ConvergenceError, match="no end of cuts"):
        zeros_in_box(polynomial(*zeros), Box(-50.0, 10.0, -10.0, 10.0), np.array([0.1 + 0j]))


def test_a_box_grows_where_a_zero_lies_on_its_edge():
    zeros = np.array([2.0 + 10.0j, 2.0 - 10.0j, -1.0, -40.0])
    found, box = complete(
        polynomial(*zeros), lambda height: Box(-50.0, 10.0, -height, height), 10.0, np.array([0.1 + 0j])
    )
    assert 10.0 < box.im_max < 10.1
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(zeros), rel=1e-12)
    assert (found.imag == 0).sum() == 2
    _, last = complete(  # on the edge of the first two, so that the last of three is taken
        polynomial(*zeros, 2.0 + 11.0j, 2.0 - 11.0j),
        lambda height: Box(-50.0, 10.0, -height, height), 10.0, np.array([0.1 + 0j]), factors=(1.0, 1.1, 1.2),
    )  # fmt: skip
    assert last.im_max == 12.0
    with pytest.raises(ConvergenceError, match="lies on the contour"):
        complete(polynomial(*zeros), lambda height: Box(-50.0, 10.0, -height, height), 10.0, zeros, factors=(1.0,))
