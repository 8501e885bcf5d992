"""Exact responses of the arms of a study, and their quantiles at each frequency."""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from tfarm.arrays import Real
from tfarm.errors import TfarmError, require
from tfarm.loop.curve import decibels
from tfarm.response import transfer
from tfarm.response.frequency import resonant_band
from tfarm.studies.quantities import QUANTILES
from tfarm.studies.study import Study


class StudyBand(NamedTuple):
    """Magnitudes [dB] of a response at `omega` [rad/s]: `curves` (arms, n), their quantiles, and unit and label."""

    omega: Real
    curves: list[Real]
    low: Real
    median: Real
    high: Real
    label: str
    unit: str


def study_band(found: Study, output: str, points: int = 1200, most: int = 100) -> StudyBand:
    """Return the responses of at most that many arms, even over the rows.

    Raises ParameterError for an unknown output, and where no arm has that response.
    """
    plan, table = found.parts.plan, found.table()
    omega = np.geomspace(*resonant_band(plan.case.arm), points)
    row = transfer(plan.case.arm, output).rows[0]
    curves = []
    for n in range(0, found.done, 1 + (found.done - 1) // most):
        # of an arm that is illegal there is none
        with suppress(TfarmError):
            one = plan.subjects.at([float(table[key][n]) for key in plan.space.keys])
            curves.append(decibels(transfer(one.case.arm, output)(1j * omega)))
    require(curves, "output", output, "no arm of the study has that response")
    low, median, high = np.quantile(curves, [QUANTILES[end] for end in ("low", "median", "high")], axis=0)
    return StudyBand(omega, curves, low, median, high, row.label, row.unit)
