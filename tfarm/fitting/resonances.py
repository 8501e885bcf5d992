"""Resonances of a measured response: where its peaks are, which of an arm's they are, and each one's pole.

Near a resonance a response is, for any linear system,

    H(s) = r/(s - p) + r*/(s - p*) + c0 + c1 (s/|p|) + ... + c4 (s/|p|)^4,

with the rest of the system in the c.  Pole and residue are fitted by Gaussian least squares to the lines around a
peak, up to the neighbouring dips, so that they need no model of the arm.  In an arm's order peaks are matched with its
poles; where they would match far better 2 pi times lower or higher, the file's frequencies are in another unit.

Peaks: of a measured response, and of an arm, whose poles near the imaginary axis they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError
from tfarm.records import record
from tfarm.response.answers import HERTZ
from tfarm.response.signals import Signals

from .data import Measured, in_parts
from .model import NUDGE, drive_behind, under_drive

PROMINENCE = math.log(2)  # a peak is twice what is around it
CLEAR_OF_NOISE = 5.0  # deviations of the noise that it stands above
UNPAIRED = 0.3  # of ln w: what a peak or a pole in the band costs without a partner; so partners are 1.8 apart at most
WIDEST_PEAK = 0.5  # damping ratio of a pole that is no peak
PARTNERS_BEYOND = 1.8  # so far beyond the band partners are looked for
WIDTHS = 3.0  # half-widths of a peak around it that its pole is fitted to: tuned with the next, for the least bias
BACKGROUND = 5  # coefficients c
CLOSE_IN_UNIT = 0.3  # of ln w, in the mean of the peaks: how well they fit in the other unit before that is said,
ALIKE_IN_UNIT = 0.15  # and how far they may differ in that
PEAK_ALONE = math.log(2.0)  # of ln w: farther from every pole a peak has nothing to do with one
PEAKS_THAT_TELL = 3  # peaks, whose spacing tells one match from another
PEAK_PROMINENCE = 0.35  # of ln |H|: what stands out by a factor of 1.4 is a peak, if the noise is below a quarter
NOISY = 4.0  # deviations of the noise
PEAKS_BEYOND = 1.6  # so far beyond both ends of a band the arm's own peaks are looked for
PEAK_GRID = 600  # points at which they are
BROAD = 0.3  # of its frequency: a pole farther from the axis is no peak
POLE_STEPS = 6  # of Newton's method from a grid's point
UNMATCHED_PEAK = 0.25  # of ln w: what a peak that is matched with nothing costs


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
    """The places (n,) of the peaks that stand out of the noise."""
    from scipy.signal import find_peaks

    size = abs(data.values)
    places, found = find_peaks(np.log(np.maximum(size, np.finfo(float).tiny)), prominence=PROMINENCE)
    rise = size[places] * -np.expm1(-found["prominences"])
    return np.asarray(places[rise > CLEAR_OF_NOISE * sigma[places]])


def matched_peaks(measured: Real, own: Real, band: tuple[float, float]) -> tuple[list[tuple[int, int]], float]:
    """Pairs of places in two ascending rows of frequencies, in order, with the least cost, and that cost.

    The cost of a pair is |ln w/w'|; one of a row that is left alone costs UNPAIRED, but an own one outside of the band.
    """
    alone = np.where((own >= band[0]) & (own <= band[1]), UNPAIRED, 0.0)
    return aligned(abs(np.log(measured)[:, None] - np.log(own)), UNPAIRED, alone)


def aligned(gaps: Real, measured_alone: float, own_alone: Real) -> tuple[list[tuple[int, int]], float]:
    """Pairs of places in both rows, in order, of the least cost in sum, and that cost.

    A pair costs its entry of `gaps` (measured, own); one left alone `measured_alone`, or its own of `own_alone` (own,).
    """
    n, m = gaps.shape
    cost, ways = np.zeros((n + 1, m + 1)), np.zeros((n + 1, m + 1), dtype=int)
    cost[1:, 0], cost[0, 1:] = measured_alone * np.arange(1, n + 1), np.cumsum(own_alone)
    ways[1:, 0], ways[0, 1:] = 1, 2
    for i in range(1, n + 1):
        for j in range(1, m + 1):
            choices = (
                cost[i - 1, j - 1] + gaps[i - 1, j - 1],
                cost[i - 1, j] + measured_alone,
                cost[i, j - 1] + own_alone[j - 1],
            )
            ways[i, j] = int(np.argmin(choices))
            cost[i, j] = choices[ways[i, j]]
    pairs, i, j = [], n, m
    while i or j:
        way = ways[i, j]
        if way == 0:
            pairs.append((i - 1, j - 1))
        i, j = i - (way != 2), j - (way != 1)
    return pairs[::-1], float(cost[-1, -1])


def peaks_among(poles: Complex) -> Real:
    """|s| (n,) [rad/s], ascending, of those poles that make a peak."""
    upper = poles[(poles.imag > 0) & (-poles.real < WIDEST_PEAK * abs(poles))]
    return np.sort(abs(upper))


def must_be_in_unit(data: Measured, sigma: Real, poles: Complex) -> None:
    """Raise ParameterError where the peaks fit the arm's poles 2 pi lower or higher, and do not as they are.

    `poles` are those of the response, complete up to PARTNERS_BEYOND 2 pi times the highest frequency.  They fit as
    they are where no more than two partners are missing; one peak alone decides only where it has no partner.
    """
    peaks, own = data.omega[peaks_of(data, sigma)], peaks_among(poles)
    if not peaks.size or not own.size:
        return
    band = float(data.omega[0]), float(data.omega[-1])
    _, cost = matched_peaks(peaks, own, band)
    lonely = bool((abs(np.log(peaks[:, None] / own)).min(axis=1) > PEAK_ALONE).all())
    for factor, words in ((1 / HERTZ, "are rad/s given as Hz?"), (HERTZ, "are Hz given as rad/s?")):
        there, fitting = matched_peaks(peaks * factor, own, (band[0] * factor, band[1] * factor))
        better = cost - fitting > UNPAIRED if peaks.size >= PEAKS_THAT_TELL else lonely
        away = np.array([math.log(peaks[i] * factor / own[j]) for i, j in there])
        if better and away.size == peaks.size and abs(away.mean()) < CLOSE_IN_UNIT and np.ptp(away) < ALIKE_IN_UNIT:
            found = f"{peaks[0] / HERTZ:.4g} Hz"
            remedy = f"its peaks are {HERTZ if factor < 1 else 1 / HERTZ:.3g} times the arm's frequencies: {words}"
            raise ParameterError(key=f"{data.name} first peak", value=found, remedy=remedy, file=data.source)


def resonance_at(data: Measured, sigma: Real, place: int) -> Resonance | None:
    """The pole and residue of the peak at a place; None where its lines do not tell them."""
    from scipy.optimize import least_squares

    kept = _around(data, place)
    omega, values, weight = data.omega[kept], data.values[kept], 1 / sigma[kept]
    background = min(BACKGROUND, 2 * omega.size - 6)
    if background < 1:
        return None
    s, w = 1j * omega, float(data.omega[place])

    def residuals(x: Real) -> Real:
        return in_parts((_model(x, s, w, background)[0] - values) * weight)

    def slopes(x: Real) -> Real:
        return in_parts(np.array(_model(x, s, w, background)[1]) * weight).T

    half = max(_half_width(data, place), (omega[-1] - omega[0]) / (4 * omega.size))
    x = np.zeros(4 + background)
    x[:2] = half, w
    linear, *_ = np.linalg.lstsq(slopes(x)[:, 2:], in_parts(values * weight), rcond=None)
    x[2:] = linear
    found = least_squares(residuals, x, jac=slopes, method="lm", x_scale="jac")
    sigma_p, w_p = found.x[:2]
    if not found.success or not omega[0] < w_p < omega[-1] or abs(sigma_p) > w_p:
        return None
    freedom = 2 * omega.size - x.size
    J, e = slopes(found.x), residuals(found.x)
    scale = np.sqrt((J**2).sum(axis=0))
    spread = np.linalg.pinv((J / scale).T @ (J / scale)) / np.outer(scale, scale) * max(1.0, float(e @ e) / freedom)
    std = np.sqrt(np.diag(spread)[:2])
    return Resonance(pole=complex(-sigma_p, w_p), residue=complex(found.x[2], found.x[3]), std=std)


def _model(x: Real, s: Complex, w: float, background: int) -> tuple[Complex, list[Complex]]:
    """The formula, and its derivatives by -Re p, Im p, Re r, Im r and the c."""
    p, r = complex(-x[0], x[1]), complex(x[2], x[3])
    up, down = 1 / (s - p), 1 / (s - p.conjugate())
    powers = [(s / w) ** n for n in range(background)]
    value = r * up + r.conjugate() * down + sum(c * each for c, each in zip(x[4:], powers, strict=True))
    by_sigma = -(r * up**2 + r.conjugate() * down**2)
    by_w = 1j * (r * up**2 - r.conjugate() * down**2)
    return value, [by_sigma, by_w, up + down, 1j * (up - down), *powers]


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


def clear_peaks(data: Measured, sigma: Real) -> Real:
    """Peaks [rad/s] of a measured response, ascending: those that stand out of its noise."""
    from scipy.signal import find_peaks  # here, because it takes half a second to load

    size = np.maximum(abs(data.values), np.finfo(float).tiny)
    at, how = find_peaks(np.log(size), prominence=PEAK_PROMINENCE)
    noise = np.minimum(sigma / size, 10.0)
    near = np.array([np.median(noise[max(0, n - 3) : n + 4]) for n in at])
    return np.asarray(data.omega[at[how["prominences"] > NOISY * near]] if at.size else np.empty(0))


def near_poles(arm: Arm, data: Measured) -> Real:
    """Im s [rad/s] of the response's poles near the axis.

    From where they are without the links' damping, smallest values on a grid, Newton's method leads to them.
    """
    from scipy.signal import find_peaks

    driven = drive_behind(arm, data.input)
    is_driven = data.input == driven
    signals = Signals(under_drive(arm, driven), (data.output if is_driven else data.input,))

    def logarithm(own: Signals, s: Complex) -> Complex:
        parts = own.parts(s)
        return np.asarray(np.log(parts.drive if is_driven else parts.numerators[0]) + parts.scale)

    grid = np.geomspace(data.omega[0] / PEAKS_BEYOND, data.omega[-1] * PEAKS_BEYOND, PEAK_GRID)
    undamped = replace(signals, arm=signals.arm.having(damping=0.0))
    w = grid[find_peaks(-logarithm(undamped, 1j * grid).real)[0]]
    s = 1j * w
    for _ in range(POLE_STEPS):
        with np.errstate(all="ignore"):
            ratio = np.exp(logarithm(signals, s * (1 + NUDGE)) - logarithm(signals, s)) - 1
            step = np.where(abs(ratio) > 0, s * NUDGE / ratio, 0.0)
        s = s - np.where(np.isfinite(step), step, 0.0)
    return np.asarray(s.imag[(abs(s.real) < BROAD * w) & (abs(s.imag / w - 1) < BROAD)])


def match(measured: Real, own: Real) -> list[tuple[int, int]]:
    """Pairs of places in two ascending rows, in order, with the least sum of squared gaps.

    To skip one costs UNMATCHED_PEAK^2; of the arm's own, those that nothing was measured at cost nothing.
    """
    gaps = (measured[:, None] - own) ** 2
    return aligned(gaps, UNMATCHED_PEAK**2, np.zeros(own.size))[0]
