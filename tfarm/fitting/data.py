"""A measured frequency response: one signal of a rig over another, at frequencies of a swept sine or of an estimate.

How far a measured value may be from the true one: by what the file says, by its coherence, or by its own scatter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError
from tfarm.records import record

CONFIDENCE = 0.95  # of every interval of a fit: the usual one
LEAST_SHARE = 1e-5  # of |H|: no measured response is better known than that, whatever its coherence says
SCATTER_NEIGHBOURS = 2  # neighbours on each side that a value is compared with
TYPICAL = 1.17741  # the median of |x + i y| of normal x and y of deviation 1: sqrt(2 ln 2)


@dataclass(frozen=True, kw_only=True)
@record
class Measured:
    """A measured response `output`/`input`: complex `values` (n,) in SI units at ascending `omega` (n,) [rad/s].

    Both signals are named as in `response.signals` ("tip_acceleration", "strain@0.05"), `input` also as an arm's input
    is ("hub_torque").  `sigma` (n,) is the standard deviation of the real and of the imaginary part, each; `coherence`
    (n,) between 0 and 1 is that of an estimate from so many independent `averages`.  `source` says where they are from,
    `digest` is the SHA-256 of the file.

    Raises ParameterError for what no measurement can be: shapes that differ, frequencies that are not positive or do
    not ascend, values that are no numbers or 0 everywhere, a coherence out of [0, 1] or 0 everywhere, a sigma that is
    not positive.
    """

    output: str
    input: str
    omega: Real
    values: Complex
    sigma: Real | None = None
    coherence: Real | None = None
    averages: int | None = None
    source: str = "array"
    digest: str = ""

    def __post_init__(self) -> None:
        for name, kind in {"omega": float, "values": complex, "sigma": float, "coherence": float}.items():
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, np.atleast_1d(np.asarray(given, dtype=kind)))
        for name in ("values", "sigma", "coherence"):
            held = getattr(self, name)
            if held is not None and held.shape != self.omega.shape:
                remedy = f"one for each of the {self.omega.size} frequencies"
                raise ParameterError(key=f"{self.name} {name}", value=held.shape, remedy=remedy)
        if not (self.omega > 0).all() or not np.isfinite(self.omega).all():
            bad = float(self.omega[~((self.omega > 0) & np.isfinite(self.omega))][0])
            raise ParameterError(key="frequency", value=bad, remedy="positive and finite; leave other rows out")
        steps = np.diff(self.omega)
        if (steps <= 0).any():
            at = float(self.omega[1:][steps <= 0][0])
            remedy = "repeated or not in ascending order; sort the rows, and average those of one frequency"
            raise ParameterError(key="frequency", value=at, remedy=remedy)
        if not np.isfinite(self.values).all():
            at = float(self.omega[~np.isfinite(self.values)][0])
            raise ParameterError(key=f"value at {at:g} rad/s", value="no number", remedy="leave the row out")
        if not self.values.any():
            raise ParameterError(key=f"{self.name} values", value=0.0, remedy="0 everywhere: nothing was measured")
        if self.sigma is not None and not ((self.sigma > 0) & np.isfinite(self.sigma)).all():
            raise ParameterError(key="sigma", value=float(self.sigma.min()), remedy="a standard deviation is positive")
        if self.coherence is not None:
            if not ((self.coherence >= 0) & (self.coherence <= 1)).all():
                raise ParameterError(key="coherence", value=float(self.coherence.max()), remedy="between 0 and 1")
            if not self.coherence.any():
                remedy = "0 everywhere: nothing was measured; leave it out"
                raise ParameterError(key="coherence", value=0.0, remedy=remedy)

    @property
    def name(self) -> str:
        """What is measured, as the command line has it: tip_acceleration/hub_angle."""
        return f"{self.output}/{self.input}"


def in_parts(values: Complex) -> Real:
    """Real parts, then imaginary ones, along the last axis: (..., n) becomes (..., 2 n)."""
    return np.concatenate([values.real, values.imag], axis=-1)


def must_be_measured(measured: object) -> None:
    """Raise ParameterError where a path or anything else stands in the place of a measured response."""
    if not isinstance(measured, Measured):
        remedy = "is no measured response; give what tfarm.read_measured returns, or a tfarm.Measured"
        raise ParameterError(key="measured", value=measured, remedy=remedy)


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
