"""Peaks: of a measured response, and of an arm, whose poles near the imaginary axis they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Complex, Real
from tfarm.response.signals import Signals

from .around import NUDGE, drive_behind, under_drive
from .data import Measured
from .resonances import aligned

PEAK_PROMINENCE = 0.35  # of ln |H|: what stands out by a factor of 1.4 is a peak, if the noise is below a quarter
NOISY = 4.0  # deviations of the noise
PEAKS_BEYOND = 1.6  # so far beyond both ends of a band the arm's own peaks are looked for
PEAK_GRID = 600  # points at which they are
BROAD = 0.3  # of its frequency: a pole farther from the axis is no peak
POLE_STEPS = 6  # of Newton's method from a grid's point
UNMATCHED_PEAK = 0.25  # of ln w: what a peak that is matched with nothing costs


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
