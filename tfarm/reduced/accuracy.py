"""How far a reduced model is from the exact arm: the worst |dG| / (|G| + |w G'|) over a band.

The norm is finite at zeros and at poles of G.  Between samples the error moves on the scale of the exact poles, of the
zeros of G and of G', and of the model's own poles; so the samples crowd there, and every high local maximum is then
closed in on.  What is printed is the largest value found, and a little more (`FOUND_TO_WORST`, tuned on random arms).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real
from tfarm.records import record
from tfarm.response import TransferFunction, Wanted, transfer
from tfarm.spectrum import modes, modes_below

from .partial_fractions import PartialFractions

FOUND_TO_WORST = 1.02  # times the worst that was found: tuned on random arms
EXACT_ROUNDING = 1e-14  # what the exact values themselves may be off, in the same norm
TERM_ROUNDING = 4 * float(np.finfo(float).eps)  # of a model's terms, which cancel where G is small, in their sum
CLEAR_OF_POLES = 1e-12  # nearer to a pole nothing new happens, and nothing can be evaluated on it
POLE_DISTANCES = 10.0 ** -np.arange(1, 8)  # of samples from a pole, as shares of its frequency
SAMPLES_PER_DECADE = 60  # of the even grid; peaks between are closed in on
LEAST_SAMPLES, EVEN_SAMPLES, BETWEEN_POLES = 200, 400, 24  # beside these, along the band, and between two poles
DIP_POINTS = 8  # around each dip of |G| or |G'|
POLES_BEYOND = 1.5  # times the end of a band: samples keep clear of poles up to there
SLOPE_STEP, ON_A_POLE = 1e-3, 1e-6  # of the distance to a pole, or of w where w is nearer than that: for differences
MOST_PEAKS = 12  # local maxima of the error that are closed in on, the highest first
HIGH_PEAK = 0.2  # of the highest: lower ones between samples do not reach it
PEAK_CLOSINGS, CLOSING_POINTS = 3, 17  # times that such a peak is closed in on, each to an eighth of its width


@dataclass(frozen=True)
@record
class Accuracy:
    """`worst` (outputs,): an upper figure of the error over the band; `at` (outputs,) [rad/s]: where it is worst."""

    worst: Real
    at: Real


class Ruler:
    """The exact outputs over a band [rad/s], sampled once, against which any number of models is held."""

    def __init__(self, arm: Arm, outputs: Wanted, band: tuple[float, float], x: float | None = None) -> None:
        self.G = transfer(arm, transfer(arm, outputs, x=x).rows, x=x)
        self.band = band
        self._poles = frequencies_around(arm, band[1])
        w = self._clear(_samples(*band, self._poles))
        for _ in range(2):
            w = self._clear(np.union1d(w, self._dips(w)))
        self.w, (self._values, self._size) = w, self._exact(w)

    def norm(self, w: Real) -> Real:
        """|G| + |w dG/dw| (outputs, w) of the exact arm at w [rad/s], 1-D, off its natural frequencies."""
        return norm(self.G, w, self.G(1j * w), self._poles)

    def rough(self, model: PartialFractions) -> float:
        """The largest error at the samples: a little less than the worst."""
        return float(_errors(model, self.w, self._values, self._size).max())

    def measure(self, model: PartialFractions) -> Accuracy:
        """The worst error of each output, every high peak between the samples closed in on."""
        errors = _errors(model, self.w, self._values, self._size)
        worst, at = errors.max(axis=1), self.w[errors.argmax(axis=1)]
        for row, error in enumerate(errors):
            low, high = self._brackets(error)
            for _ in range(PEAK_CLOSINGS):
                inner = np.linspace(low, high, CLOSING_POINTS)
                found = self._error_at(model, inner, row)
                top = found.argmax(axis=0)
                columns = np.arange(low.size)
                best = int(found.max(axis=0).argmax())
                if found[top[best], best] > worst[row]:
                    worst[row], at[row] = found[top[best], best], inner[top[best], best]
                low, high = (inner[np.clip(top + way, 0, CLOSING_POINTS - 1), columns] for way in (-1, 1))
        return Accuracy(worst * FOUND_TO_WORST + EXACT_ROUNDING, at)

    def _brackets(self, error: Real) -> tuple[Real, Real]:
        """The samples on either side of each high local maximum."""
        padded = np.r_[-1.0, error, -1.0]
        (peaks,) = np.nonzero((error >= padded[:-2]) & (error >= padded[2:]) & (error >= HIGH_PEAK * error.max()))
        peaks = peaks[np.argsort(-error[peaks])][:MOST_PEAKS]
        return self.w[np.maximum(peaks - 1, 0)], self.w[np.minimum(peaks + 1, self.w.size - 1)]

    def _error_at(self, model: PartialFractions, w: Real, row: int) -> Real:
        """Error of one output at w of any shape; zero next to a pole."""
        flat = w.ravel()
        clear = self._is_clear(flat)
        errors = np.zeros(flat.size)
        if clear.any():
            errors[clear] = _errors(model, flat[clear], *self._exact(flat[clear]))[row]
        return errors.reshape(w.shape)

    def _exact(self, w: Real) -> tuple[Complex, Real]:
        values = self.G(1j * w)
        return values, norm(self.G, w, values, self._poles)

    def _dips(self, w: Real) -> Real:
        """Points around the dips of |G| and |G'|, where the norm is small on one side."""
        slopes = axis_slope(self.G, w, self._poles)
        dips = [
            np.flatnonzero((size[1:-1] < size[:-2]) & (size[1:-1] < size[2:])) + 1
            for size in abs(np.concatenate([self.G(1j * w), slopes]))
        ]
        where = np.unique(np.concatenate(dips))
        return np.linspace(w[where - 1], w[where + 1], DIP_POINTS).ravel()

    def _clear(self, w: Real) -> Real:
        return w[self._is_clear(w)]

    def _is_clear(self, w: Real) -> NDArray[np.bool_]:
        return distance(w, self._poles) > CLEAR_OF_POLES * w


def norm(G: TransferFunction, w: Real, values: Complex, poles: Real) -> Real:
    """|G| + |w dG/dw| (outputs, w) on the imaginary axis, given G(i w)."""
    return abs(values) + abs(w * axis_slope(G, w, poles))


def axis_slope(G: TransferFunction, w: Real, poles: Real) -> Complex:
    """dG/ds (outputs, w) at i w."""
    return np.atleast_2d(G.derivative(1j * w))


def distance(w: Real, poles: Real) -> Real:
    """From each w to the nearest of the poles (ascending)."""
    edged = np.r_[-np.inf, poles, np.inf]
    above = np.searchsorted(poles, w)
    return np.minimum(w - edged[above], edged[above + 1] - w)


def frequencies_around(arm: Arm, high: float) -> Real:
    """The flexible natural frequencies below `POLES_BEYOND` times `high`, and the next one."""
    table = modes(arm, modes_below(arm, POLES_BEYOND * high) + 1)
    return table.natural_frequency[table.index > 0]


def _samples(low: float, high: float, poles: Real) -> Real:
    """Frequencies even by themselves and in their logarithm, between neighbouring poles, and crowded around each."""
    count = LEAST_SAMPLES + int(SAMPLES_PER_DECADE * np.log10(high / low))
    crowd = np.concatenate([poles[:, None] * (1 - POLE_DISTANCES), poles[:, None] * (1 + POLE_DISTANCES)]).ravel()
    knots = np.r_[low, poles[(poles > low) & (poles < high)], high]
    share = (1 - np.cos(np.linspace(0, np.pi, BETWEEN_POLES + 2)[1:-1])) / 2
    between = (knots[:-1, None] + np.diff(knots)[:, None] * share).ravel()
    w = np.concatenate([np.geomspace(low, high, count), np.linspace(low, high, EVEN_SAMPLES), crowd, between])
    return np.unique(np.clip(w, low, high))


def _errors(model: PartialFractions, w: Real, exact: Complex, size: Real) -> Real:
    """|dG|, and what rounding a state space adds to it, over the norm; none for an output that is zero throughout."""
    gap = abs(model(1j * w) - exact) + TERM_ROUNDING * model.magnitude(1j * w)
    return np.divide(gap, size, out=np.where(gap > 0, np.inf, 0.0), where=size > 0)
