"""How far a measured value may be from the true one: by what the file says, by its coherence, or by its own scatter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.records import record

from .data import Measured

CONFIDENCE = 0.95  # of every interval of a fit: the usual one
LEAST_SHARE = 1e-5  # of |H|: no measured response is better known than that, whatever its coherence says
SCATTER_NEIGHBOURS = 2  # neighbours on each side that a value is compared with
TYPICAL = 1.17741  # the median of |x + i y| of normal x and y of deviation 1: sqrt(2 ln 2)


@dataclass(frozen=True, kw_only=True)
@record
class Noise:
    """The standard deviation `sigma` (n,) of real and imaginary part, each; infinite where nothing was measured.

    `is_known` is whether it is in the units of the values, or only up to a factor that the residuals have to say.
    `road` says where it is from.
    """

    sigma: Real
    is_known: bool
    road: str


def noise_of(data: Measured) -> Noise:
    """The noise of a measured response.

    With coherence g^2 of an estimate from n averages the relative deviation of a part is sqrt((1 - g^2)/(2 n g^2))
    (Bendat and Piersol 2010, (9.90)); without n it is known up to a factor.  With nothing given it is the scatter of
    the values about a parabola through their neighbours.
    """
    size = abs(data.values)
    if data.sigma is not None:
        return Noise(sigma=data.sigma, is_known=True, road="sigma of the file")
    if data.coherence is not None:
        g = data.coherence
        with np.errstate(divide="ignore"):
            share = np.sqrt((1.0 - g) / (2.0 * (data.averages or 1) * g))
        sigma = np.asarray(size * np.maximum(share, LEAST_SHARE), dtype=float)
        sigma[(g == 0) | (size == 0)] = np.inf  # a share of nothing says nothing
        known = data.averages is not None
        road = f"coherence of {data.averages} averages" if known else "coherence, up to a factor"
        return Noise(sigma=sigma, is_known=known, road=road)
    return Noise(sigma=_scatter(data.values), is_known=False, road="scatter of the values")


def _scatter(values: NDArray[Any]) -> Real:
    """The deviation of each value from a parabola through its four neighbours, smoothed.

    It is LEAST_SHARE of the value at least.
    """
    n = values.size
    if n < 2 * SCATTER_NEIGHBOURS + 1:
        return np.maximum(abs(values), LEAST_SHARE * abs(values).max())
    # x_k less the parabola through x_(k-2), x_(k-1), x_(k+1), x_(k+2): weights -1/6, 2/3, 2/3, -1/6 of these
    weights = np.array([1 / 6, -2 / 3, 1.0, -2 / 3, 1 / 6])
    away = np.convolve(values, weights, mode="valid") / np.sqrt((weights**2).sum())
    size, inside = abs(values), abs(values[SCATTER_NEIGHBOURS:-SCATTER_NEIGHBOURS])
    relative = abs(away[inside > 0]) / inside[inside > 0]
    typical = float(np.median(relative)) / TYPICAL if relative.size else 1.0
    least = max(1e-3 * float(np.median(size)), 1e-6 * float(size.max()))  # which a value of 0 is taken for
    return np.maximum(size, least) * max(typical, LEAST_SHARE)
