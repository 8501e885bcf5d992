"""What the live page carries of sensors along the arm: at many x what they see of each mode, and their zeros."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np

from tfarm.arm import Arm
from tfarm.errors import TfarmError
from tfarm.loop.positions import Positions, Sensor, positions

PLACES = 16  # pieces of the arm between two positions
MODES = 6
ENDS: dict[str, slice] = {"displacement": slice(1, None), "moment": slice(None, -1)}  # no sensor where all is 0
DIGITS = 6


def sensor_numbers(arm: Arm) -> dict[str, Any] | None:
    """Participation and zeros at every position, by the kind of sensor; None where they cannot be had."""
    x = np.linspace(0.0, arm.length, PLACES + 1)
    try:
        return {kind: _numbers(positions(arm, kind, x[ENDS[kind]], MODES)) for kind in get_args(Sensor)}
    except TfarmError:
        return None


def _numbers(found: Positions) -> dict[str, Any]:
    return {
        "x": [_short(x) for x in found.x],
        "band": found.band,
        "modes": [_short(w) for w in found.natural_frequency],
        "participation": [[_short(each) for each in column] for column in found.participation.T],
        "zeros": [[[_short(s.real), _short(s.imag)] for s in zeros] for zeros in found.zeros],
    }


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
