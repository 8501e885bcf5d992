"""Poles fitted to the peaks of a measured response.

Near a resonance a response is, for any linear system,

    H(s) = r/(s - p) + r*/(s - p*) + c0 + c1 (s/|p|) + ... + c4 (s/|p|)^4,

with the rest of the system in the c.  Pole and residue are fitted by Gaussian least squares to the lines around a
peak, up to the neighbouring dips, so that they need no model of the arm.  In an arm's order peaks are matched with its
poles; where they would match far better 2 pi times lower or higher, the file's frequencies are in another unit.

All but the poles is linear: for each trial of the poles the others are those of the least squares (Golub and Pereyra
1973), so that only the poles are searched for.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import require
from tfarm.fitting.data import Measured, in_parts
from tfarm.moved import moved
from tfarm.records import frozen
from tfarm.response.frequency import HERTZ

__getattr__ = moved(
    __name__,
    {
        "DecayMode": "tfarm.fitting.decays",
        "Ring": "tfarm.fitting.decays:RingdownFit",
        "ring": "tfarm.fitting.decays:fit_ringdown",
    },
)

# of ln w: what a peak or a pole in the band costs without a partner; so partners are 1.8 apart at most
UNPAIRED = 0.3
# times the ends of the range: partners are looked for up to there
PARTNERS_BEYOND = 1.8


@frozen(slots=True, kw_only=True)
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
    """Return the places (n,) of the peaks above the noise."""
    from scipy.signal import find_peaks

    size = abs(data.values)
    # a peak is twice what is around it
    places, found = find_peaks(np.log(np.maximum(size, np.finfo(float).tiny)), prominence=math.log(2))
    rise = size[places] * -np.expm1(-found["prominences"])
    # it exceeds the noise by five deviations
    return places[rise > 5.0 * sigma[places]]


def matched_peaks(
    measured: NDArray[Any], own: NDArray[Any], band: tuple[float, float]
) -> tuple[list[tuple[int, int]], float]:
    """Return pairs of places in two ascending rows of frequencies, in order, with the least cost, and that cost.

    The cost of a pair is |ln w/w'|; one of a row that is left alone costs UNPAIRED, but an own one outside of the band.
    Each has a partner of its own to be left alone with; of pairs that cross the same places in order cost no more.
    """
    from scipy.optimize import linear_sum_assignment

    n = measured.size
    m = own.size
    alone = np.broadcast_to(UNPAIRED * ((own >= band[0]) & (own <= band[1])), (m, m))
    pairs = abs(np.log(measured)[:, None] - np.log(own))
    cost = np.block([[pairs, np.full((n, n), UNPAIRED)], [alone, np.zeros((m, n))]])
    rows, columns = linear_sum_assignment(cost)
    paired = (rows < n) & (columns < m)
    found = zip(rows[paired].tolist(), sorted(columns[paired].tolist()), strict=True)
    return list(found), float(cost[rows, columns].sum())


def peaks_among(poles: Complex) -> Complex:
    """Return those poles (n,) [1/s] that make a peak, Im s > 0, by |s|."""
    # a pole of a larger damping ratio is no peak
    upper = poles[(poles.imag > 0) & (-poles.real < 0.5 * abs(poles))]
    return upper[np.argsort(abs(upper))]


def must_be_in_unit(data: Measured, sigma: Real, poles: Complex) -> None:
    """Raise ParameterError where the peaks fit the arm's poles 2 pi lower or higher, and do not as they are.

    `poles` are those of the response, complete up to PARTNERS_BEYOND 2 pi times the highest frequency.  They fit as
    they are where no more than two partners are missing; one peak alone decides only where it has no partner.
    """
    peaks = data.omega[peaks_of(data, sigma)]
    own = abs(peaks_among(poles))
    if not peaks.size or not own.size:
        return
    # three peaks have a spacing that distinguishes one match from another; fewer, farther than that of ln w from every
    # pole, have nothing to do with one
    has_spacing = peaks.size >= 3
    is_lonely = (abs(np.log(peaks[:, None] / own)).min(axis=1) > math.log(2.0)).all()
    _, cost = matched_peaks(peaks, own, data.band)
    for factor, words in ((1 / HERTZ, "are rad/s given as Hz?"), (HERTZ, "are Hz given as rad/s?")):
        low, high = data.band
        there, fitting = matched_peaks(peaks * factor, own, (low * factor, high * factor))
        is_better = cost - fitting > UNPAIRED if has_spacing else is_lonely
        away = np.array([math.log(peaks[i] * factor / own[j]) for i, j in there])
        # of ln w: how well the peaks fit in the other unit, in the mean and in what they differ by
        fits = away.size == peaks.size and abs(away.mean()) < 0.3 and np.ptp(away) < 0.15
        remedy = f"its peaks are {1 / factor:.3g} times the arm's frequencies: {words}"
        require(
            not (is_better and fits),
            f"{data.name} first peak",
            f"{peaks[0] / HERTZ:.4g} Hz",
            remedy,
            data.source,
        )


def project(columns: Real, y: Real) -> tuple[Real, Real]:
    """Return the linear numbers of the least squares, and the residuals."""
    linear = np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0], dtype=float)
    return linear, y - columns @ linear


def least_projected(columns: Callable[[Real], Real], y: Real, start: Real, **how: Any) -> Any:
    """Return the numbers x, next to a start, for which columns(x) leave the least residuals of y."""
    from scipy.optimize import least_squares

    def residuals(x: Real) -> Real:
        return project(columns(x), y)[1]

    return least_squares(residuals, start, method="lm", x_scale="jac", **how)


def resonance_at(data: Measured, sigma: Real, place: int) -> Resonance | None:
    """Return the pole and residue of the peak at a place; None where its lines do not determine them."""
    kept = lines_of_peak(data, place)
    omega = data.omega[kept]
    sigma = sigma[kept]
    # the number of coefficients c
    background = min(5, 2 * omega.size - 6)
    if background < 1:
        return None
    s = 1j * omega
    w = data.omega[place]
    powers = (s / w) ** np.arange(background)[:, None]

    def columns(x: Real) -> Real:
        """Return those of Re r, Im r and the c."""
        up = 1 / (s + x[0] - 1j * x[1])
        down = 1 / (s + x[0] + 1j * x[1])
        return in_parts(np.r_["0,2", up + down, 1j * (up - down), powers] / sigma).T

    y = in_parts(data.values[kept] / sigma)
    half = max(half_width(data, place), np.ptp(omega) / (4 * omega.size))
    found = least_projected(columns, y, np.array([half, w]))
    sigma_p, w_p = found.x.tolist()
    if not found.success or not omega[0] < w_p < omega[-1] or abs(sigma_p) > w_p:
        return None
    (re, im, *_), e = project(columns(found.x), y)
    spread = np.linalg.pinv(found.jac.T @ found.jac) * max(1.0, (e @ e) / (2 * omega.size - 4 - background))
    return Resonance(pole=complex(-sigma_p, w_p), residue=complex(re, im), std=np.sqrt(np.diag(spread)))


def half_width(data: Measured, place: int) -> float:
    """Return half the width [rad/s] of a peak where it has lost 3 dB, to the nearer side."""
    size = abs(data.values)
    away = abs(data.omega - data.omega[place])
    return float(away[size < size[place] / math.sqrt(2)].min(initial=np.ptp(data.omega)))


def lines_of_peak(data: Measured, place: int) -> slice:
    """Return the lines from dip to dip around a peak, no farther than some of its widths, but three to each side."""
    size = abs(data.values)
    away = abs(data.omega - data.omega[place])
    # half-widths of a peak that its pole is fitted to: tuned with `resonance_at`'s background, for the least bias
    reach = 3.0 * half_width(data, place)

    def end(way: int) -> int:
        at = place
        lowest = size[place]
        while 0 <= at + way < size.size and (away[at] < reach or abs(at - place) < 3):
            # the flank of the next peak
            if size[at + way] >= 2 * lowest:
                break
            at += way
            lowest = min(lowest, size[at])
        return at

    return slice(end(-1), end(1) + 1)
