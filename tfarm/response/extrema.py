"""Peaks and dips of a frequency response: local maxima and minima of |G(i omega)|, between the points of a grid too.

A damped pole with a small residue may have no peak.  The
slope of ln |G| may vanish where it changes, from one interval to the next, by more than its size.  Such intervals are
halved until no extremum above rounding fits in them.  A parabola through three points then gives the frequency.
"""

import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arrays import MACHINE_EPS, Complex, Real, Whole
from tfarm.schema import Quantity

ResponseFunction = Callable[[Complex], Any]


class Extremum(NamedTuple):
    """A local maximum or minimum of |G(i omega)|: angular frequency [rad/s], and |G| in the response's unit.

    `magnitude` is inf at a pole on the imaginary axis and 0 at a zero on it.
    """

    omega: Annotated[float, Quantity("angular frequency", "rad/s", 7, "frequency of the extremum")]
    magnitude: Annotated[
        float, Quantity("magnitude", help="|G|; inf or 0 at a root on the axis", unit_of="gain_unit")
    ]

    @property
    def frequency(self) -> Annotated[float, Quantity("frequency", "Hz", 7, "angular frequency over 2 pi")]:
        """In Hz."""
        return self.omega / (2 * math.pi)


def extrema(
    G: ResponseFunction, omega: Real, value: Complex, roots: Complex, infinite: Real, vanishing: Real
) -> tuple[tuple[Extremum, ...], tuple[Extremum, ...]]:
    """Return peaks and dips between the ends of a grid omega [rad/s] (ascending) that resolves poles and zeros.

    `value` is G on the grid, `roots` [1/s] are poles and zeros near it, `infinite` and `vanishing` [rad/s] the
    frequencies of those on the imaginary axis, which are not in the grid.
    """
    # half a second to import
    from scipy.signal import find_peaks

    on_axis = np.sort(np.r_[infinite, vanishing])
    # two roots may have no point of the grid between them
    between = (on_axis[:-1] + on_axis[1:]) / 2
    at = np.r_[omega, between, infinite, vanishing]
    with np.errstate(divide="ignore"):
        limits = np.repeat([np.inf, -np.inf], [infinite.size, vanishing.size])
        height = np.r_[np.log(abs(value)), _height(G, between), limits]
    order = np.argsort(at)
    at, height = _resolve(G, at[order], height[order], roots)
    least = _least_rise(at, roots)
    maxima, minima = (find_peaks(sign * height, prominence=least)[0] for sign in (1, -1))
    return _at_vertices(G, at, height, maxima), _at_vertices(G, at, height, minima)


def _height(G: ResponseFunction, omega: Real) -> Real:
    """Return ln |G(i omega)|."""
    return np.log(abs(G(1j * omega)))


def _narrowest(omega: Real) -> Real:
    """Return the width [rad/s] of an interval at each frequency below which none is halved."""
    return 4 * MACHINE_EPS * omega


def _least_rise(omega: Real, roots: Complex) -> Real:
    """Return the least rise and fall of ln |G| at a peak, at each frequency."""
    distance = abs(1j * omega[:, None] - roots).min(axis=1, initial=np.inf)
    # of |G|: 1e-9 above rounding, and its own error, 1e-14 over |s/(s - p)| of the nearest pole or zero p
    return 1e-9 + 1e-14 * omega / np.maximum(distance, _narrowest(omega))


def _resolve(G: ResponseFunction, omega: Real, height: Real, roots: Complex) -> tuple[Real, Real]:
    """Return the grid with more points where the slope of ln |G| may vanish between two of its points."""
    # 40 halvings of an interval: to the spacing of float64 numbers
    for _ in range(40):
        with np.errstate(invalid="ignore"):
            slope = np.diff(height) / np.diff(omega)
            change = abs(np.diff(slope))
        # next to a root on the axis the slope is steep
        change[~np.isfinite(change)] = 0.0
        near = np.maximum(np.r_[0.0, change], np.r_[change, 0.0])
        found = np.flatnonzero(abs(slope) <= near)
        left = omega[found]
        right = omega[found + 1]
        width = right - left
        is_hidden = near[found] * width > _least_rise(left, roots)
        is_wide = width > _narrowest(right)
        new = is_hidden & is_wide
        if not new.any():
            break
        middle = ((left + right) / 2)[new]
        found = found[new]
        omega = np.insert(omega, found + 1, middle)
        height = np.insert(height, found + 1, _height(G, middle))
    return omega, height


def _at_vertices(G: ResponseFunction, omega: Real, height: Real, places: Whole) -> tuple[Extremum, ...]:
    """Return the extrema near these indices, finite ones at the vertex of a parabola through three points."""
    is_finite = np.isfinite(height[places])
    at = places[is_finite]
    middle = (omega[1:] + omega[:-1]) / 2
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.diff(height) / np.diff(omega)
        before = slope[at - 1]
        width = middle[at] - middle[at - 1]
        vertex = middle[at - 1] + width * before / (before - slope[at])
    vertex = np.where(np.isfinite(vertex), np.clip(vertex, omega[at - 1], omega[at + 1]), omega[at])
    # of a root on the axis
    frequency = omega[places]
    magnitude = np.where(height[places] > 0, np.inf, 0.0)
    frequency[is_finite] = vertex
    magnitude[is_finite] = abs(G(1j * vertex))
    return tuple(map(Extremum, frequency.tolist(), magnitude.tolist()))
