"""Peaks and dips: of a measured response, and of an arm, whose poles and zeros near the imaginary axis they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tfarm.arrays import Complex, Real
from tfarm.response.signals import Signals

from .around import NUDGE, Around, drive_behind, under_drive
from .data import Measured
from .resonances import aligned

PEAK_PROMINENCE = 0.35  # of ln |H|: what stands out by a factor of 1.4 is a peak, if the noise is below a quarter
NOISY = 4.0  # deviations of the noise
PEAKS_BEYOND = 1.6  # so far beyond both ends of a band the arm's own peaks are looked for
PEAK_GRID = 600  # points at which they are
BROAD = 0.3  # of its frequency: a zero farther from the axis is no peak
ZERO_STEPS = 6  # of Newton's method from a grid's point
UNMATCHED_PEAK = 0.25  # of ln w: what a peak that is matched with nothing costs


def features_of(data: Measured, sigma: Real) -> tuple[Real, Real]:
    """Dips and peaks [rad/s] of a measured response, ascending: those that stand out of its noise."""
    from scipy.signal import find_peaks  # here, because it takes half a second to load

    level = np.log(np.maximum(abs(data.values), np.finfo(float).tiny))
    noise = np.minimum(sigma / np.maximum(abs(data.values), np.finfo(float).tiny), 10.0)

    def found(curve: Real) -> Real:
        at, how = find_peaks(curve, prominence=PEAK_PROMINENCE)
        near = np.array([np.median(noise[max(0, n - 3) : n + 4]) for n in at])
        return np.asarray(data.omega[at[how["prominences"] > NOISY * near]] if at.size else np.empty(0))

    return found(-level), found(level)


def near_zeros(here: Around, data: Measured) -> list[tuple[Real, Real]]:
    """The arm's own dips and peaks: zeros near the axis of what is over and under, w (k,), and d ln w (free, k).

    From where they are without the links' damping, smallest values on a grid, Newton's method leads to the zeros.
    """
    from scipy.signal import find_peaks

    driven = drive_behind(here.arm, data.input)
    names = tuple(dict.fromkeys(each for each in (data.output, data.input) if each != driven))
    signals = Signals(under_drive(here.arm, driven), names)
    rows = [names.index(each) if each != driven else None for each in (data.output, data.input)]
    grid = np.geomspace(data.omega[0] / PEAKS_BEYOND, data.omega[-1] * PEAKS_BEYOND, PEAK_GRID)
    parts, found = replace(signals, arm=signals.arm.having(damping=0.0)).parts(1j * grid), []
    for row in rows:
        curve = parts.drive if row is None else parts.numerators[row]
        w = grid[find_peaks(-(np.log(abs(curve)) + parts.scale.real))[0]]
        zero = _newton(signals, row, 1j * w)
        found.append(zero[(abs(zero.real) < BROAD * w) & (abs(zero.imag / w - 1) < BROAD)])
    at = np.concatenate(found)
    drive, outputs = here.gradients(driven, names, np.concatenate([at, at * (1 + NUDGE)]))
    answers, first = [], 0
    for row, zero in zip(rows, found, strict=True):
        jet, own = drive if row is None else outputs[row], slice(first, first + zero.size)
        first += zero.size
        by_s = (jet.c[0][at.size :][own] - jet.c[0][own]) / (zero * NUDGE)
        answers.append((np.asarray(zero.imag, dtype=float), np.asarray((-jet.c[1][:, own] / by_s).imag / zero.imag)))
    return answers


def _newton(signals: Signals, row: int | None, s: Complex) -> Complex:
    """The zeros that Newton's method leads to, of a signal's numerator or (None) of the drive."""

    def logarithm(s: Complex) -> Complex:
        parts = signals.parts(s)
        return np.asarray(np.log(parts.drive if row is None else parts.numerators[row]) + parts.scale)

    for _ in range(ZERO_STEPS):
        with np.errstate(all="ignore"):
            ratio = np.exp(logarithm(s * (1 + NUDGE)) - logarithm(s)) - 1
            step = np.where(abs(ratio) > 0, s * NUDGE / ratio, 0.0)
        s = s - np.where(np.isfinite(step), step, 0.0)
    return s


def match(measured: Real, own: Real) -> list[tuple[int, int]]:
    """Pairs of places in two ascending rows, in order, with the least sum of squared gaps.

    To skip one costs UNMATCHED_PEAK^2; of the arm's own, those that nothing was measured at cost nothing.
    """
    gaps = (measured[:, None] - own) ** 2
    return aligned(gaps, UNMATCHED_PEAK**2, np.zeros(own.size))[0]
