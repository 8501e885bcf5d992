"""Resonances of a measured response: where its peaks are, which of an arm's they are, and each one's pole.

Near a resonance a response is, for any linear system,

    H(s) = r/(s - p) + r*/(s - p*) + c0 + c1 (s/|p|) + ... + c4 (s/|p|)^4,

with the rest of the system in the c.  Pole and residue are fitted by Gaussian least squares to the lines around a
peak, up to the neighbouring dips, so that they need no model of the arm; for each trial of the pole the others, which
are linear, are those of the least squares.  In an arm's order peaks are matched with its
poles; where they would match far better 2 pi times lower or higher, the file's frequencies are in another unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.records import record
from tfarm.response.frequency import HERTZ

from .data import Measured, in_parts, require

PROMINENCE = math.log(2)  # a peak is twice what is around it
CLEAR_OF_NOISE = 5.0  # deviations of the noise that it exceeds
UNPAIRED = 0.3  # of ln w: what a peak or a pole in the band costs without a partner; so partners are 1.8 apart at most
WIDEST_PEAK = 0.5  # damping ratio of a pole that is no peak
PARTNERS_BEYOND = 1.8  # times the ends of the range: partners are looked for up to there
WIDTHS = 3.0  # half-widths of a peak around it that its pole is fitted to: tuned with the next, for the least bias
BACKGROUND = 5  # coefficients c
CLOSE_IN_UNIT = 0.3  # of ln w, in the mean of the peaks: how well they fit in the other unit before it is named,
ALIKE_IN_UNIT = 0.15  # and how far they may differ in that
PEAK_ALONE = math.log(2.0)  # of ln w: farther from every pole a peak has nothing to do with one
LEAST_PEAKS = 3  # peaks, whose spacing distinguishes one match from another


@dataclass(frozen=True, slots=True, kw_only=True)
@record
class Resonance:
    """A peak of a measured response: its `pole` [1/s] and `residue`; `std` (2,) of -Re and of Im of the pole [1/s]."""

    pole: complex
    residue: complex
    std: Real

    @property
    def damping_ratio(self) -> float:
        """-Re p/|p|."""
        return -self.pole.real / abs(self.pole)


def peaks_of(data: Measured, sigma: Real) -> NDArray[np.intp]:
    """The places (n,) of the peaks above the noise."""
    from scipy.signal import find_peaks

    size = abs(data.values)
    places, found = find_peaks(np.log(np.maximum(size, np.finfo(float).tiny)), prominence=PROMINENCE)
    rise = size[places] * -np.expm1(-found["prominences"])
    return np.asarray(places[rise > CLEAR_OF_NOISE * sigma[places]])


def matched_peaks(
    measured: NDArray[Any], own: NDArray[Any], band: tuple[float, float]
) -> tuple[list[tuple[int, int]], float]:
    """Pairs of places in two ascending rows of frequencies, in order, with the least cost, and that cost.

    The cost of a pair is |ln w/w'|; one of a row that is left alone costs UNPAIRED, but an own one outside of the band.
    Each has a partner of its own to be left alone with; of pairs that cross the same places in order cost no more.
    """
    from scipy.optimize import linear_sum_assignment

    n, m = measured.size, own.size
    cost = np.zeros((n + m, m + n))
    cost[:n, :m] = abs(np.log(measured)[:, None] - np.log(own))
    cost[:n, m:] = UNPAIRED
    cost[n:, :m] = np.where((own >= band[0]) & (own <= band[1]), UNPAIRED, 0.0)
    rows, columns = linear_sum_assignment(cost)
    paired = (rows < n) & (columns < m)
    pairs = zip(rows[paired].tolist(), sorted(columns[paired].tolist()), strict=True)
    return list(pairs), float(cost[rows, columns].sum())


def peaks_among(poles: Complex) -> Complex:
    """Those poles (n,) [1/s] that make a peak, Im s > 0, by |s|."""
    upper = poles[(poles.imag > 0) & (-poles.real < WIDEST_PEAK * abs(poles))]
    return upper[np.argsort(abs(upper))]


def must_be_in_unit(data: Measured, sigma: Real, poles: Complex) -> None:
    """Raise ParameterError where the peaks fit the arm's poles 2 pi lower or higher, and do not as they are.

    `poles` are those of the response, complete up to PARTNERS_BEYOND 2 pi times the highest frequency.  They fit as
    they are where no more than two partners are missing; one peak alone decides only where it has no partner.
    """
    peaks, own = data.omega[peaks_of(data, sigma)], abs(peaks_among(poles))
    if not peaks.size or not own.size:
        return
    _, cost = matched_peaks(peaks, own, data.band)
    lonely = bool((abs(np.log(peaks[:, None] / own)).min(axis=1) > PEAK_ALONE).all())
    for factor, words in ((1 / HERTZ, "are rad/s given as Hz?"), (HERTZ, "are Hz given as rad/s?")):
        there, fitting = matched_peaks(peaks * factor, own, (data.band[0] * factor, data.band[1] * factor))
        better = cost - fitting > UNPAIRED if peaks.size >= LEAST_PEAKS else lonely
        away = np.array([math.log(peaks[i] * factor / own[j]) for i, j in there])
        fits = away.size == peaks.size and abs(away.mean()) < CLOSE_IN_UNIT and np.ptp(away) < ALIKE_IN_UNIT
        remedy = f"its peaks are {1 / factor:.3g} times the arm's frequencies: {words}"
        require(not (better and fits), f"{data.name} first peak", f"{peaks[0] / HERTZ:.4g} Hz", remedy, data.source)


def resonance_at(data: Measured, sigma: Real, place: int) -> Resonance | None:
    """The pole and residue of the peak at a place; None where its lines do not determine them."""
    from scipy.optimize import least_squares

    kept = _around(data, place)
    omega, values, weight = data.omega[kept], data.values[kept], 1 / sigma[kept]
    background = min(BACKGROUND, 2 * omega.size - 6)
    if background < 1:
        return None
    s, w = 1j * omega, float(data.omega[place])
    powers, y = [(s / w) ** n for n in range(background)], in_parts(values * weight)

    def linear(x: Real) -> tuple[Real, Real]:
        """Re r, Im r and the c of the least squares, and the residuals."""
        up, down = 1 / (s + x[0] - 1j * x[1]), 1 / (s + x[0] + 1j * x[1])
        terms: Complex = np.array([up + down, 1j * (up - down), *powers], dtype=np.complex128)
        columns = in_parts(terms * weight).T
        found = np.linalg.lstsq(columns, y, rcond=None)[0]
        return np.asarray(found), np.asarray(columns @ found - y)

    half = max(_half_width(data, place), (omega[-1] - omega[0]) / (4 * omega.size))

    def residuals(x: Real) -> Real:
        return linear(x)[1]

    found = least_squares(residuals, np.array([half, w]), method="lm", x_scale="jac")
    sigma_p, w_p = found.x.tolist()
    if not found.success or not omega[0] < w_p < omega[-1] or abs(sigma_p) > w_p:
        return None
    (re, im, *_), e = linear(found.x)
    J = np.asarray(found.jac, dtype=float)
    spread = np.linalg.pinv(J.T @ J) * max(1.0, float(e @ e) / (2 * omega.size - 4 - background))
    return Resonance(pole=complex(-sigma_p, w_p), residue=complex(re, im), std=np.sqrt(np.diag(spread)))


def _half_width(data: Measured, place: int) -> float:
    """Half the width [rad/s] of a peak where it has lost 3 dB, to the nearer side."""
    size, limit = abs(data.values), abs(data.values[place]) / math.sqrt(2)
    away = abs(data.omega - data.omega[place])
    return float(away[size < limit].min(initial=data.omega[-1] - data.omega[0]))


def _around(data: Measured, place: int) -> slice:
    """The lines from dip to dip around a peak, and no farther than some of its widths, but three to each side."""
    size, away, reach = abs(data.values), abs(data.omega - data.omega[place]), WIDTHS * _half_width(data, place)

    def end(way: int) -> int:
        at, lowest = place, size[place]
        while 0 <= at + way < size.size and size[at + way] < 2 * lowest and (away[at] < reach or abs(at - place) < 3):
            at += way
            lowest = min(lowest, size[at])
        return at

    return slice(end(-1), end(1) + 1)
