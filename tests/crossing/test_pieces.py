"""Regions given column by column, cut into parts: drawn by hand, and areas and membership of random ones."""

import numpy as np
import pytest

from tfarm.crossing.turning import pieces


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


def test_two_that_part_while_a_third_goes_on():
    columns = [[(0.0, 2.0), (5.0, 6.0)], [(0.0, 0.5), (1.5, 2.0), (5.0, 6.0)]]
    whole, low, high = sorted(pieces(np.arange(2.0), columns), key=lambda piece: -piece.points[0][1])
    assert whole.points == [(0.0, 5.0, 6.0), (1.0, 5.0, 6.0)]
    assert (low.points, high.points) == (
        [(0.0, 1.0, 2.0), (1.0, 1.5, 2.0)],
        [(0.0, 0.0, 1.0), (1.0, 0.0, 0.5)],
    )
    assert [piece.begins for piece in (whole, low, high)] == [True, False, False]


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
