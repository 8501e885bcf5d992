"""Peaks and dips of a frequency response: local maxima and minima of |G(i omega)|, sought in |G| itself.

A damped pole need not make a peak: where its share of G is small against the others', |G| falls past it.  The mean
slopes of ln |G| over the intervals of a grid show where the slope may vanish: where it changes, from one interval to
the next, by more than its size.  Such intervals are halved until nothing above `LEAST` can hide in them; a parabola
through three points then gives the frequency.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tfarm.arrays import Complex, Real

LEAST = 1e-9  # of |G|: a smaller rise or fall makes no peak; rounding makes smaller ones of a constant
ROUNDING = 1e-14  # relative error of a value, over |s/(s - p)| of the nearest pole or zero p
HALVINGS = 40  # of an interval of the grid, at most: to the spacing of float64 numbers
NARROWEST = 4 * float(np.finfo(float).eps)  # relative width below which no interval is halved

Response = Callable[[Complex], Any]


class Extremum(NamedTuple):
    """A local maximum or minimum of |G(i omega)|: angular frequency [rad/s], and |G| in the response's unit.

    `magnitude` is inf at a pole on the imaginary axis and 0 at a zero on it.
    """

    omega: float
    magnitude: float


def extrema(
    G: Response, omega: Real, value: Complex, roots: Complex, infinite: Real, vanishing: Real
) -> tuple[tuple[Extremum, ...], tuple[Extremum, ...]]:
    """Peaks and dips between the ends of a grid omega [rad/s] (ascending) that resolves poles and zeros.

    `value` is G on the grid, `roots` [1/s] are poles and zeros near it, `infinite` and `vanishing` [rad/s] the places
    of those on the imaginary axis, which the grid does not hold.
    """
    on_axis = np.sort(np.r_[infinite, vanishing])
    between = (on_axis[:-1] + on_axis[1:]) / 2  # two roots may have no point of the grid between them
    at = np.r_[omega, between, infinite, vanishing]
    with np.errstate(divide="ignore"):
        limits = np.repeat([np.inf, -np.inf], [infinite.size, vanishing.size])
        height = np.r_[np.log(abs(value)), _height(G, between), limits]
    order = np.argsort(at)
    at, height = _halved(G, at[order], height[order], roots)
    maxima, minima = _turns(height, _least(at, roots))
    return _refined(G, at, height, maxima), _refined(G, at, height, minima)


def _height(G: Response, omega: Real) -> Real:
    """ln |G(i omega)|."""
    return np.asarray(np.log(abs(G(1j * omega))), float)


def _least(omega: Real, roots: Complex) -> Real:
    """By how much ln |G| must rise and fall to make a peak, at each frequency."""
    distance = abs(1j * omega[:, None] - roots).min(axis=1, initial=np.inf)
    return np.asarray(LEAST + ROUNDING * omega / np.maximum(distance, NARROWEST * omega), float)


def _halved(G: Response, omega: Real, height: Real, roots: Complex) -> tuple[Real, Real]:
    """The grid with more points where the slope of ln |G| may vanish between two of its own."""
    for _ in range(HALVINGS):
        with np.errstate(invalid="ignore"):
            slope = np.diff(height) / np.diff(omega)
            change = abs(np.diff(slope))
        change[~np.isfinite(change)] = 0.0  # next to a root on the axis the slope is steep
        near = np.maximum(np.r_[0.0, change], np.r_[change, 0.0])
        found = np.flatnonzero(abs(slope) <= near)
        left, right = omega[found], omega[found + 1]
        hidden = near[found] * (right - left) > _least(left, roots)
        found = found[hidden & (right - left > NARROWEST * right)]
        if not found.size:
            break
        middle = (omega[found] + omega[found + 1]) / 2
        omega, height = np.insert(omega, found + 1, middle), np.insert(height, found + 1, _height(G, middle))
    return omega, height


def _turns(height: Real, least: Real) -> tuple[list[int], list[int]]:
    """The places of maxima and minima, where the height rises and falls by more than `least`."""
    maxima: list[int] = []
    minima: list[int] = []
    rises, high, low = None, 0, 0
    for i, (here, step) in enumerate(zip(height.tolist(), least.tolist(), strict=True)):
        high, low = (i if here > height[high] else high), (i if here < height[low] else low)
        if rises is not False and here < height[high] - step:
            maxima += [high] if rises else []
            rises, low = False, i
        elif rises is not True and here > height[low] + step:
            minima += [low] if rises is False else []
            rises, high = True, i
    return maxima, minima


def _refined(G: Response, omega: Real, height: Real, places: list[int]) -> tuple[Extremum, ...]:
    """The extrema near these places: at the vertex of the parabola through each and its neighbours, where finite."""
    at = np.array(places, int)
    at = at[np.isfinite(height[at])]
    middle = (omega[1:] + omega[:-1]) / 2
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.diff(height) / np.diff(omega)
        vertex = middle[at - 1] + (middle[at] - middle[at - 1]) * slope[at - 1] / (slope[at - 1] - slope[at])
    vertex = np.where(np.isfinite(vertex), np.clip(vertex, omega[at - 1], omega[at + 1]), omega[at])
    finite = dict(zip(at.tolist(), zip(vertex.tolist(), abs(G(1j * vertex)).tolist(), strict=True), strict=True))
    limit = {np.inf: np.inf, -np.inf: 0.0}
    return tuple(Extremum(*finite.get(i) or (float(omega[i]), limit[float(height[i])])) for i in places)
