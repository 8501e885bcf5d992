"""Frequencies and damping ratios of decays beside measured responses: eigenvalues of the arm, with derivatives."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.records import record
from tfarm.spectrum import modes

from .parameters import NUDGE, Around

FREQUENCY_KNOWN = 2e-3  # of itself: what a decay says of it, where its deviation is not said
RATIO_KNOWN = 0.1  # of itself, likewise
EIGENVALUE_STEPS = 30  # of Newton's method, at most: from an undamped frequency on a few do
EIGENVALUE_FIRM = 1e-12  # of an eigenvalue: a step that is less ends it
MOST_NUMBER = 100  # number of a mode
MODE_FORM = "N=FREQUENCY,RATIO such as 1=2.52hz,0.006 (hz or rad_s; a deviation after ~: 2.52hz~0.01)"
MODE_PATTERN = re.compile(
    r"\s*(\d+)\s*=\s*([\d.eE+-]+)\s*(hz|rad_s)\s*(?:~\s*([\d.eE+-]+))?\s*(?:,(.*))?", re.IGNORECASE
)


@dataclass(frozen=True, kw_only=True)
@record
class RingMode:
    """A decay in one mode: its `number` among the flexible ones, and `frequency` w = Im s [rad/s], `ratio` -Re s/|s|.

    Each with its standard deviation; a ratio that is None was not measured.
    """

    number: int
    frequency: float
    frequency_deviation: float
    ratio: float | None = None
    ratio_deviation: float = math.inf


def mode_of(text: str) -> RingMode:
    """The decay that the command line means by "1=2.52hz,0.006".  Raises ParameterError for another form."""
    found = MODE_PATTERN.fullmatch(text)
    try:
        if found is None:
            raise ValueError
        number, unit = int(found[1]), 2 * math.pi if found[3].lower() == "hz" else 1.0
        frequency = float(found[2]) * unit
        deviation = float(found[4]) * unit if found[4] else FREQUENCY_KNOWN * frequency
        ratio, spread = None, math.inf
        if found[5] is not None:
            value, _, said = found[5].partition("~")
            ratio = float(value)
            spread = float(said) if said else RATIO_KNOWN * ratio
            if not (0 < ratio < 1 and spread > 0):
                raise ValueError
        sizes_fit = frequency > 0 and deviation > 0 and math.isfinite(frequency * deviation)
        if not (1 <= number <= MOST_NUMBER and sizes_fit):
            raise ValueError
    except ValueError:
        raise ParameterError(key="--mode", value=text, remedy=f"write {MODE_FORM}") from None
    return RingMode(
        number=number, frequency=frequency, frequency_deviation=deviation, ratio=ratio, ratio_deviation=spread
    )


def ring_residuals(here: Around, rings: tuple[RingMode, ...], size: int) -> tuple[Real, Real]:
    """Computed less measured over its deviation (n,), of logarithms of frequencies and of ratios; slopes (n, size)."""
    rows: list[float] = []
    slopes: list[Any] = []
    for each in rings:
        s, ds = eigenvalue(here, each.number)
        pad = np.zeros(size - ds.size)
        share = each.frequency_deviation / each.frequency
        rows.append(math.log(s.imag / each.frequency) / share)
        slopes.append(np.r_[ds.imag / s.imag / share, pad])
        if each.ratio is not None:
            size_of, d_size = abs(s), (s.conjugate() * ds).real / abs(s)
            rows.append((-s.real / size_of - each.ratio) / each.ratio_deviation)
            d_ratio = -ds.real / size_of + s.real * d_size / size_of**2
            slopes.append(np.r_[d_ratio / each.ratio_deviation, pad])
    return np.array(rows), np.array(slopes).reshape(-1, size)


def eigenvalue(here: Around, number: int) -> tuple[complex, NDArray[Any]]:
    """The eigenvalue s [1/s] of a flexible mode and its derivatives (numbers of the arm,), by Newton's method.

    It starts from the undamped natural frequency; ConvergenceError where a damped mode does not ring near that.
    """
    arm = here.arm
    s = 1j * float(modes(arm, number).natural_frequency[-1])
    for _ in range(EIGENVALUE_STEPS):
        drive, _ = here.gradients(arm.input, ("hub_angle",), np.array([s, s * (1 + NUDGE)]))
        f, by_s = drive.c[0][0], (drive.c[0][1] - drive.c[0][0]) / (s * NUDGE)
        step = complex(f / by_s)
        s -= step
        if abs(step) < EIGENVALUE_FIRM * abs(s) or not abs(step) < abs(s):
            break
    if not (abs(step) < 1e-8 * abs(s) and s.imag > 0):
        raise ConvergenceError(f"mode {number} of {arm.name} does not ring near its undamped frequency", s, abs(step))
    return s, np.asarray(-drive.c[1][:, 0] / by_s)
