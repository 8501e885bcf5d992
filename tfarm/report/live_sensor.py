"""What the live page carries of sensors along the arm: at many x what they see of each mode, and their zeros."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import Arm
from tfarm.errors import TfarmError
from tfarm.loop.positions import MOST_SENSOR_MISS, Positions, Sensor, positions
from tfarm.spectrum import modes

Real = NDArray[np.float64]

PLACES = 16  # pieces of the arm between two positions
MODES = 6
NOTHING = 1e-9  # of a mode's largest: an end that no mode moves, or bends, by more has no sensor
DIGITS = 6


def sensor_numbers(arm: Arm) -> dict[str, Any]:
    """`sensor`: participation and zeros at every position, by the kind of sensor; None where they cannot be had, and
    then `no_sensor` says why."""
    try:
        found = {kind: _numbers(positions(arm, kind, _places(arm, kind), MODES)) for kind in get_args(Sensor)}
    except TfarmError as error:
        return {"sensor": None, "no_sensor": str(error)}
    return {"sensor": found}


def _places(arm: Arm, kind: Sensor) -> Real:
    """Places along the arm [m], without ends at which there is nothing to sense."""
    x, found = np.linspace(0.0, arm.length, PLACES + 1), modes(arm, MODES)
    size = abs((found.shape if kind == "displacement" else found.moment)(x)[found.index > 0])
    return np.asarray(x[(size > NOTHING * size.max(axis=1, keepdims=True)).any(axis=0)])


def _numbers(found: Positions) -> dict[str, Any]:
    return {
        "x": [_short(x) for x in found.x],
        "band": found.band,
        "modes": [_short(w) for w in found.natural_frequency],
        "participation": [[_short(each) for each in column] for column in found.participation.T],
        "zeros": [[[_part(s.real, s), _part(s.imag, s)] for s in zeros] for zeros in found.zeros],
    }


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _part(part: float, whole: complex) -> float:
    """A part of a zero, 0 where that is all that is known of it."""
    return _short(part) if abs(part) > MOST_SENSOR_MISS * abs(whole) else 0.0
