"""What the live page carries of sensors along the arm: at many x what they see of each mode, and their zeros."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np

from tfarm.arm import Arm
from tfarm.digits import kept_digits
from tfarm.errors import TfarmError
from tfarm.loop.positions import MOST_SENSOR_MISS, Positions, Sensor, positions
from tfarm.spectrum import modes

SENSOR_PIECES = 16  # pieces of the arm between two positions
SENSED_MODES = 6  # whose frequencies and zeros the chart of sensors has
NOT_SENSED = 1e-9  # of a mode's largest: an end that no mode moves, or bends, by more has no sensor
SENSOR_DIGITS = 6  # of what that chart draws and tells: far more than a screen has


def sensor_numbers(arm: Arm) -> dict[str, Any]:
    """`sensor`: participation and zeros at every position, by the kind of sensor, without ends that sense nothing.

    None where they cannot be had, and then `no_sensor` says why.
    """
    x, sensors = np.linspace(0.0, arm.length, SENSOR_PIECES + 1), {}
    try:
        found = modes(arm, SENSED_MODES)
        for kind in get_args(Sensor):
            size = abs((found.shape if kind == "displacement" else found.moment)(x)[found.index > 0])
            places = x[(size > NOT_SENSED * size.max(axis=1, keepdims=True)).any(axis=0)]
            sensors[kind] = _numbers(positions(arm, kind, places, SENSED_MODES))
    except TfarmError as error:
        return {"sensor": None, "no_sensor": str(error)}
    return {"sensor": sensors}


def _numbers(found: Positions) -> dict[str, Any]:
    """The positions in a few digits; a part of a zero is 0 where that is all that is known of it."""
    known = [
        [[part if abs(part) > MOST_SENSOR_MISS * abs(s) else 0.0 for part in (s.real, s.imag)] for s in zeros]
        for zeros in found.zeros
    ]
    return {
        "x": kept_digits(found.x, SENSOR_DIGITS),
        "band": found.band,
        "modes": kept_digits(found.natural_frequency, SENSOR_DIGITS),
        "participation": [kept_digits(column, SENSOR_DIGITS) for column in found.participation.T],
        "zeros": [[kept_digits(zero, SENSOR_DIGITS) for zero in zeros] for zeros in known],
    }
