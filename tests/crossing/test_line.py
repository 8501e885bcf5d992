"""D-decomposition on either curve, against the roots of polynomials: the room needs nothing else of A and B either."""

import math

import numpy as np
import pytest

from tfarm.crossing import (
    Crossings,
    Grid,
    Line,
    brackets,
    confirm_intervals,
    counts_over,
    crossings,
    intervals,
    join_neighbours,
    locate_crossings,
    zeros_between,
)

CURVES = {
    "axis": (lambda x: 1j * x, np.linspace(1e-3, 40.0, 4001), lambda s: s.real > 0),
    "circle": (lambda x: np.exp(1j * x), np.linspace(1e-3, np.pi - 1e-3, 4001), lambda z: abs(z) > 1),
}


def drawn(rng, curve):
    """A (degree 5) and B (degree 4) with real coefficients, roots on both sides of the curve."""
    pairs = rng.uniform(0.3, 1.6, 2) * np.exp(1j * rng.uniform(0.3, 2.8, 2))
    roots = np.r_[pairs, pairs.conj(), rng.uniform(-1.5, 1.5)]
    A = np.poly(roots * (8 if curve == "axis" else 1)).real
    return np.poly1d(A), np.poly1d(rng.standard_normal(5)) * (4.0 if curve == "axis" else 1.0)


def crossings_of(curve, A, B):
    """Those of pairs between the ends of the grid, and those of single roots at the real points of the curve."""
    at, grid, _ = CURVES[curve]
    gain, place, change = locate_crossings(grid, lambda x: (A(at(x)), B(at(x))))
    single = [0.0] if curve == "axis" else [1.0, -1.0]
    return place, Crossings.of(zip(gain, place, change, strict=True)), [-A(point) / B(point) for point in single]


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("seed", range(12))
def test_between_crossings_the_roots_beyond_the_curve_are_as_many_as_counted(curve, seed):
    A, B = drawn(np.random.default_rng(seed), curve)
    at, _, is_beyond = CURVES[curve]
    place, found, single = crossings_of(curve, A, B)
    np.testing.assert_allclose(
        A(at(found.at)) + found.gain * B(at(found.at)), 0, atol=1e-10 * abs(A(at(place))).max(initial=0.0)
    )

    def count(gain):
        return int(is_beyond((A + gain * B).roots).sum())

    for each in found:
        step = 1e-5 * max(abs(each.t), 1e-3)
        if min(abs(each.t - other) for other in [*single, *(o.t for o in found if o != each), np.inf]) > 3 * step:
            assert count(each.t + step) - count(each.t - step) == each.change


def test_counts_over_a_plane_are_those_of_every_column():
    rng = np.random.default_rng(4)
    gains = np.linspace(-3.0, 3.0, 41)
    rows = [sorted(rng.uniform(-4, 4, 7)) for _ in range(5)]
    columns = [Crossings.of((t, 1.0, int(rng.choice([-2, 2]))) for t in row) for row in rows]
    counts = counts_over(gains, columns, 0.3, np.array([0, 1, 2, 3, 4]))
    for n, column in enumerate(columns):
        for gain, found in zip(gains, counts[n], strict=True):
            passed = sum(each.change for each in column if 0.3 < each.t <= gain)
            assert found == n + passed - sum(each.change for each in column if gain < each.t <= 0.3)


def test_intervals_are_where_nothing_is_beyond():
    found = Crossings.of([(1.0, 5.0, 2), (2.0, 6.0, -2), (-1.0, 7.0, -2), (2.0, 0.0, 1), (2.0, 0.1, -1), (9.0, 1.0, 2)])
    assert len(found) == 6
    assert [each.t for each in found.within(0.0, 3.0)] == [1.0, 2.0, 2.0, 2.0]
    assert intervals(found, -3.0, 5.0, 0.0, 0) == [(-1.0, 1.0), (2.0, 5.0)]
    assert intervals(found, -3.0, 5.0, -2.0, 1) == []
    assert intervals(Crossings.of([(np.inf, 1.0, 2)]), -1.0, 1.0, 0.0, 0) == [(-1.0, 1.0)]
    assert join_neighbours([(0.0, 1.0), (1.0, 2.0), (3.0, 4.0)]) == [(0.0, 2.0), (3.0, 4.0)]
    far = Crossings.of([(10.0, 1.0, -2), (11.0, 1.0, 2)])
    assert intervals(far, 0.0, 12.0, 0.0, 2) == [(10.0, 11.0)]


@pytest.mark.parametrize("unit", [1e-6, 1e6])
@pytest.mark.parametrize(
    ("A", "B", "ends", "crossings", "windows"),
    [
        ([1, 3, 3, 1], [1], (-np.inf, np.inf), [(8, 2), (-1, -1)], [(-1, 8)]),  # (s + 1)^3 + g
        ([1, 3, 3, 1], [1], (0, np.inf), [(8, 2), (-1, -1)], [(0, 8)]),
        ([1, 3, 3, 1], [1], (0, 5), [(8, 2), (-1, -1)], [(0, 5)]),
        ([1, 1], [1, 2], (0, np.inf), [], [(0, np.inf)]),  # the root goes from -1 to -2
        ([1, -3], [1, -2], (0, np.inf), [], []),
        ([1, -1], [1], (0, np.inf), [(1, -1)], [(1, np.inf)]),
        ([1, 3, 2, 0.5], [1, 0], (-np.inf, np.inf), [(-11 / 6, -2)], [(-11 / 6, np.inf)]),
        ([1, 3, 2, 0], [1], (-np.inf, np.inf), [(6, 2), (0, -1)], [(0, 6)]),  # Routh: 0 < g < 6
        ([1, 3, 3, 1], [1], (-np.inf, np.inf), [(8, 2), (-1, -1), (3, 1), (3 + 1e-12, -1)], [(-1, 8)]),  # torn
    ],
)
def test_windows_are_those_of_routh_and_hurwitz(A, B, ends, crossings, windows, unit):
    """No count is given: by the roots themselves one gap has none beyond the axis.

    Gains have any unit, and are requested not far beyond the last crossing.
    """
    found = Crossings.of((unit * gain, 1.0, change) for gain, change in crossings)

    def is_stable(gain):
        assert abs(gain) < 16 * unit or not crossings
        return bool((np.roots(np.polyadd(A, gain / unit * np.array(B))).real < 0).all())

    wanted = [pytest.approx((unit * low, unit * high), rel=1e-15, abs=0) for low, high in windows]
    assert confirm_intervals(found, unit * ends[0], unit * ends[1], is_stable) == wanted


def test_zeros_are_found_to_the_last_bit_each_in_its_own_bracket():
    """A line, a root of tiny values, a jump and a pole."""

    hard = (
        (lambda x: x - 2.0),
        (lambda x: 1e-300 * (x**2 - 2.0)),
        (lambda x: np.sign(x - 1.7)),
        (lambda x: 1 / (x - 0.9)),
    )

    def f(places, which):
        return np.array([hard[n](x) for n, x in zip(which, places, strict=True)])

    found = zeros_between(f, np.zeros(4), np.full(4, 3.0))
    np.testing.assert_allclose(found, [2.0, 2.0**0.5, 1.7, 0.9], rtol=0, atol=4 * np.finfo(float).eps)


@pytest.mark.parametrize(
    ("h", "before", "change"),
    [
        ([1.0, 0.0, -1.0], [0], [2]),
        ([-1.0, 0.0, 0.0, 2.0, -1.0], [0, 3], [-2, 2]),
        ([1.0, 0.0, 1.0], [], []),
        ([0.0, 0.0, 1.0, -1.0, 0.0], [2], [2]),
        ([0.0, 0.0], [], []),
    ],
)
def test_a_zero_exactly_at_a_point_is_not_lost(h, before, change):
    (found,), ways = brackets(np.array(h))
    assert found.tolist() == before
    assert ways.tolist() == change
    (rows, columns), both = brackets(np.array([h, h]))
    assert columns.tolist() == 2 * before
    assert rows.tolist() == [0] * len(before) + [1] * len(before)
    assert both.tolist() == 2 * change


def test_a_window_is_found_where_the_counts_are_wrong():
    """Next to z = 1 rounding makes crossings; where the loop is stable nowhere there is none."""
    true = [(-2.0, 0.7, -2), (3.0, 1.1, 2)]
    places = {-1.0: (1e-13, 2), 0.5: (1e-14, 2)} | dict.fromkeys((20.0, 30.0, 40.0, 50.0), (1e-13, -2))
    false = [(gain, *each) for gain, each in places.items()]
    for more in ([], false):
        found = confirm_intervals(Crossings.of(true + more), -math.inf, math.inf, lambda gain: -2 < gain < 3)
        assert found == [(-2.0, 3.0)]
    assert confirm_intervals(Crossings.of(true + false), -math.inf, math.inf, lambda gain: False) == []


def of(h):
    """A and B on a curve along which Im(A conj B) is a function of the place times |B|^2; neither is of size 1."""

    def parts(place):
        B = 1e6 * np.exp((0.1 + 1j) * place)
        return (1.0 + 1j * h(place)) * B, B

    return parts


def found(grid, parts, with_dips=True):
    """Gain, place and change of all crossings, dips searched too."""
    line = Line(np.array([1, 0]), np.array([0, 1]), -np.inf, np.inf)
    (crossed_there,) = crossings(Grid(grid, lambda at: np.array(parts(at))), [line], with_dips=with_dips)
    return np.reshape(sorted(crossed_there, key=lambda each: each.at), (-1, 3)).T


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("middle", [4.4, 4.5])
@pytest.mark.parametrize("half", [0.3, 3e-2, 2e-3])
def test_two_zeros_in_one_dip_are_both_found(half, middle, sign):
    """A parabola with zeros at middle -+ half on a grid of whole numbers, which sees one sign alone."""
    grid, parts = np.arange(8.0), of(lambda x: sign * ((x - middle) ** 2 - half**2) / 20)
    assert locate_crossings(grid, parts)[0].size == 0
    gain, at, change = found(grid, parts)
    np.testing.assert_allclose(at, [middle - half, middle + half], rtol=1e-13)
    np.testing.assert_allclose(gain, -1.0, rtol=1e-13)
    np.testing.assert_array_equal(change, [2 * sign, -2 * sign])


def test_every_dip_between_two_neighbours_is_searched():
    """A wave with its zeros 0.05 from 1.1, 4.1 and 7.1, up and down by turns on nine points."""
    turn = np.pi / 3
    _, at, _ = found(np.arange(9.0), of(lambda x: np.cos(turn * 0.05) ** 2 - np.cos(turn * (x - 4.1)) ** 2))
    np.testing.assert_allclose(at, [each + off for each in (1.1, 4.1, 7.1) for off in (-0.05, 0.05)], rtol=1e-13)


@pytest.mark.parametrize(
    "h",
    [
        lambda x: x - 3.3,  # a change of sign right of the point that is nearest to 0
        lambda x: x - 2.7,  # and left of it
        lambda x: 2.7 - x,
        lambda x: np.abs(x - 3.0) * 1e-2,  # 0 itself: `brackets` sees it
        lambda x: np.abs(x - 3.0) * 1e-2 + 1e-12,  # rounding
        lambda x: 1.0 - (x - 3.0) ** 2 / 10,  # a hill
        lambda x: 0.1 + x / 10,  # lowest at an end
    ],
)
def test_what_is_no_dip_has_no_crossings_of_one(h):
    grid = np.arange(7.0)
    np.testing.assert_array_equal(found(grid, of(h)), found(grid, of(h), with_dips=False))
