"""Where curves of zeros want more points: circles, whose turns are known, corners and regions drawn by hand."""

import numpy as np
import pytest

from tfarm.crossing.turning import RegionPiece, loose, loose_columns, pieces


def arc(points, radius=1.0, centre=5j):
    """An eighth of a circle off the real axis: from piece to piece it turns by 45 degrees / (points - 1)."""
    return centre + radius * np.exp(1j * np.linspace(0.1, 0.1 + np.pi / 4, points))[None, :]


@pytest.mark.parametrize(("points", "wanted"), [(15, True), (18, True), (20, False), (40, False)])
def test_a_circle_is_round_where_it_turns_by_less_than_two_and_a_half_degrees(points, wanted):
    """45 / 18 = 2.5: 19 points are the limit.  A first and a last piece have a neighbour on one side only."""
    assert loose(arc(points), 1.0, 1.0).tolist() == [wanted] * (points - 1)


FLAT, STEEP = np.array([1j, 1 + 1j, 2 + 1.02j]), np.array([1j, 2j, 0.02 + 3j])  # both turn by 1.1 degrees
CORNER = np.array([0, 1, 2, 3, 3 + 1j, 3 + 2j, 3 + 3j]) + 5j
SIZES = np.array([[4.0], [1.0]])
LOOSE = [  # curves, width and height of the picture, where a value is wanted: a steep part turns less in a wide one
    ([FLAT], 1.0, 1.0, [0, 0]),
    ([STEEP], 1.0, 1.0, [0, 0]),
    ([FLAT], 4.0, 1.0, [1, 1]),
    ([STEEP], 4.0, 1.0, [0, 0]),
    ([FLAT], 1.0, 4.0, [0, 0]),
    ([STEEP], 1.0, 4.0, [1, 1]),
    ([FLAT, STEEP], SIZES, 1.0, [1, 1]),
    ([STEEP, FLAT], SIZES, 1.0, [0, 0]),
    ([CORNER], 4.0, 4.0, [0, 0, 1, 1, 0, 0]),
    ([CORNER], 501.0, 501.0, [0] * 6),  # each piece is 1/501 of the picture: not visible
    ([CORNER], 499.0, 499.0, [0, 0, 1, 1, 0, 0]),
    ([[5j, 1 + 5j, 1 + 5.001j]], 2.0, 2.0, [1, 0]),
    ([[1.0, 2.0, 1.5, 3.0]], 1.0, 1.0, [0, 0, 0]),  # it turns back on the axis
]


@pytest.mark.parametrize(("curves", "width", "height", "wanted"), LOOSE)
def test_visible_pieces_next_to_a_turn_of_the_picture_are_halved(curves, width, height, wanted):
    assert loose(np.array(curves, complex), width, height).tolist() == [bool(each) for each in wanted]


def test_where_a_curve_ends_nothing_is_wanted():
    assert not loose(np.array([[5j, 1 + 5j, np.nan, 2 + 7j, 1 + 6j]]), 1.0, 1.0)[1:3].any()


def test_only_the_piece_where_two_zeros_leave_the_axis_is_refined():
    """sqrt(gain): real and then a pair, at a right angle; only the piece in which it leaves the axis."""
    gain = np.linspace(1.0, -1.0, 101) + 1e-3
    pair = np.emath.sqrt(gain)[None, :]
    (n,) = np.flatnonzero(np.diff(pair.imag[0] != 0))
    assert pair[0, n].imag == 0 < pair[0, n + 1].imag
    (found,) = np.flatnonzero(loose(pair, 1.0, 1.0))
    assert found == n


def piece(gains, low, high):
    return RegionPiece(tuple(zip(gains, low, high, strict=True)), False, False)


def wanted(part, across, drawn=lambda x, y: (x + 1j * y) / 10):
    return loose_columns(np.array(across), [part], drawn).tolist()


BOX = piece([4.0, 6.0], [2.0, 2.0], [8.0, 8.0])
ROOF = [1.0, 4.0, 9.0]
CORNERS = {  # a part of a region, columns, where more are wanted
    "a roof, its foot at the frame's lower edge": (piece(ROOF, [0.0] * 3, [0.0, 6.0, 0.0]), ROOF, [2.35, 6.25]),
    "two sides that end in one point": (piece([-1.0, 9.0], [-1.0, 3.0], [6.0, 3.0]), [-1.0, 9.0], [3.5]),
    "along one of its sides": (piece([-1.0, 9.0], [-1.0, 3.0], [3.0, 3.0]), [-1.0, 9.0], [3.5]),
    "above the picture": (piece(ROOF, [0.0] * 3, [0.0, 11.0, 0.0]), ROOF, []),
    "left of the picture": (piece([-9.0, -4.0, -1.0], [2.0] * 3, [2.0, 8.0, 2.0]), [-9.0, -4.0, -1.0], []),
    "upright sides, from the columns next to them": (BOX, [1.0, 4.0, 6.0, 9.0], [2.35, 4.9, 7.35]),
    "upright sides alone": (BOX, [4.0, 6.0], [4.9]),
}


@pytest.mark.parametrize("name", CORNERS)
def test_a_visible_corner_of_a_region_halves_the_sides_next_to_it(name):
    part, across, expected = CORNERS[name]
    assert wanted(part, across) == pytest.approx(expected)


def test_an_outline_that_turns_by_less_than_five_degrees_is_round():
    """A parabola turns in its vertex by atan(0.4 h), h from column to column: 5 degrees are h = 0.219."""
    for step, rough in ((0.25, True), (0.2, False)):
        across = np.arange(2.0, 8.0 + step / 2, step)
        part = piece(across, np.full(across.size, -1.0), 6.0 - 0.2 * (across - 5) ** 2)
        halves = [each for each in wanted(part, across) if 4.5 < each < 5.5]
        assert bool(halves) == rough


def test_a_side_too_short_to_be_seen_is_left_alone():
    assert wanted(BOX, [1.0, 4.0, 6.0, 9.0], lambda x, y: x / 10 + 1j * y * 1e-4 + 0.5j) == pytest.approx([4.9])


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_columns_on_both_sides_of_an_edge_stay_distinct_from_it(unit):
    """A side at 4 among columns a billionth of it to either side, after as many rounds as a picture takes.

    The resolution is relative, whatever the unit of the gain.
    """
    across = [1.0 * unit, 4.0 * (1 - 1e-9) * unit, 4.0 * (1 + 1e-9) * unit, 9.0 * unit]
    for _ in range(20):
        inside = [each for each in across if each < 4.0 * unit]
        box = piece(inside, [2.0] * len(inside), [8.0] * len(inside))
        across = sorted({*across, *wanted(box, across, lambda x, y: (x / unit + 1j * y) / 10)})
    assert 1e-13 < abs(np.array(across) / unit / 4.0 - 1.0).min() < 1e-9
    assert np.diff(across).min() > 1e-12 * unit


def area(piece):
    """By trapezes from column to column."""
    at, low, high = np.array(piece.points).T
    return float(np.trapezoid(high - low, at))


def test_an_interval_that_parts_and_joins_again_is_two_pieces_that_meet():
    """A ring: one interval, two, and one; the cut goes through the middle of the hole."""
    columns = [[(0.0, 6.0)], [(0.0, 2.0), (4.0, 6.0)], [(0.0, 2.0), (4.0, 6.0)], [(0.0, 6.0)]]
    parts = pieces(np.arange(4.0), columns)
    assert [piece.points for piece in parts] == [
        [(0.0, 0.0, 3.0), (1.0, 0.0, 2.0), (2.0, 0.0, 2.0), (3.0, 0.0, 3.0)],
        [(0.0, 3.0, 6.0), (1.0, 4.0, 6.0), (2.0, 4.0, 6.0), (3.0, 3.0, 6.0)],
    ]
    assert [(piece.begins, piece.ends) for piece in parts] == [(False, False), (False, False)]


def test_intervals_that_begin_end_and_touch_only_at_a_gain():
    """The second interval of a column begins where the first has its end: they share a value, and nothing else."""
    columns = [[(0.0, 1.0)], [(0.0, 1.0)], [(1.0, 2.0)], [(1.0, 2.0)], []]
    below, above = pieces(np.arange(5.0), columns)
    assert below.points == [(0.0, 0.0, 1.0), (1.0, 0.0, 1.0)]
    assert above.points == [(2.0, 1.0, 2.0), (3.0, 1.0, 2.0)]
    assert [(piece.begins, piece.ends) for piece in (below, above)] == [(True, True), (True, True)]
    above, below = pieces(np.arange(5.0), [[(1.0, 2.0)], [(1.0, 2.0)], [(0.0, 1.0)], [(0.0, 1.0)], []])
    assert (above.points[-1], below.points[0]) == ((1.0, 1.0, 2.0), (2.0, 0.0, 1.0))


@pytest.mark.parametrize("seed", range(6))
def test_random_regions_are_covered_once(seed):
    """Every interval of every column is covered without overlap, whatever parts and joins."""
    rng = np.random.default_rng(seed)
    K1 = np.arange(30.0)
    columns = [[(a, b) for a, b in np.sort(rng.uniform(0, 10, 2 * rng.integers(0, 4))).reshape(-1, 2)] for _ in K1]
    parts = pieces(K1, columns)
    assert all(area(piece) > 0 for piece in parts)
    for at, column in zip(K1[1:-1], columns[1:-1], strict=True):
        covered = sorted({(low, high) for piece in parts for x, low, high in piece.points if x == at})
        for low, high in covered:  # each lies in an interval of the region, or is one
            assert any(a <= low < high <= b for a, b in column)
