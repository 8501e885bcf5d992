"""Two crossings between neighbours of a grid: found where h dips through 0, and nothing asked where it does not."""

import numpy as np
import pytest

from tfarm.crossing import Family, crossed, crossings


def of(h):
    """A and B on a curve along which Im(A conj B) is a function of the place times |B|^2; neither is of size 1."""

    def parts(place):
        B = 1e6 * np.exp((0.1 + 1j) * place)
        return (1.0 + 1j * h(place)) * B, B

    return parts


def found(grid, parts, with_dips=True):
    """Gain, place and change of all crossings, dips searched too."""
    family = Family(lambda w: tuple(each[None] for each in parts(w)), lambda _, w: parts(w))
    (line,) = crossings(family, grid, with_dips=with_dips)
    return np.array(sorted(line, key=lambda each: each.at)).T


def counted(h):
    """The same, and a list of how many places were asked for at a time."""
    asked, parts = [], of(h)

    def told(place):
        asked.append(place.size)
        return parts(place)

    return told, asked


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("middle", [4.4, 4.5])
@pytest.mark.parametrize("half", [0.3, 3e-2, 2e-3])
def test_two_zeros_in_one_dip_are_both_found(half, middle, sign):
    """A parabola with zeros at middle -+ half on a grid of whole numbers, which sees one sign alone."""
    grid, parts = np.arange(8.0), of(lambda x: sign * ((x - middle) ** 2 - half**2) / 20)
    assert crossed(grid, parts)[0].size == 0
    gain, at, change = found(grid, parts)
    np.testing.assert_allclose(at, [middle - half, middle + half], rtol=1e-13)
    np.testing.assert_allclose(gain, -1.0, rtol=1e-13)
    np.testing.assert_array_equal(change, [2 * sign, -2 * sign])


def test_dips_are_searched_together_the_first_and_the_last_that_have_two_neighbours_among_them():
    """A wave with its zeros 0.05 beside 1.1, 4.1 and 7.1, up and down by turns on nine points."""
    places, turn = np.arange(9.0), np.pi / 3

    def h(x):
        return np.cos(turn * (x - 4.1)) ** 2 - np.cos(turn * 0.05) ** 2

    parts, asked = counted(lambda x: -h(x))
    _, at, _ = found(places, parts)
    zeros = [each + off for each in (1.1, 4.1, 7.1) for off in (-0.05, 0.05)]
    np.testing.assert_allclose(at, zeros, rtol=1e-13)
    assert set(asked[1:15]) == {6}  # two places of each dip a step


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
def test_what_is_no_dip_is_not_searched(h):
    grid, (parts, asked) = np.arange(7.0), counted(h)
    found(grid, parts, with_dips=False)
    without = list(asked)
    found(grid, parts)
    assert asked[len(without) :] == without


def test_a_dip_that_stays_off_0_adds_nothing():
    grid, parts = np.arange(7.0), of(lambda x: (x - 3.2) ** 2 / 10 + 1e-6)
    assert found(grid, parts).size == 0
