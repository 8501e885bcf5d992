"""Bands of responses: the exact curves of many arms of a study, of which a picture has the quantiles."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from tfarm.arrays import Real
from tfarm.case.step import step, unit_of
from tfarm.errors import TfarmError, require
from tfarm.exact.outputs import signal_words, unit_over
from tfarm.loop.curve import decibels
from tfarm.records import record
from tfarm.response.frequency import resonant_band
from tfarm.response.transfer import transfer
from tfarm.schema import Quantity

from .findings import STABLE
from .quantities import SCENARIO
from .space import Subject
from .study import Study

CURVES, SLEWS = 100, 24  # arms at most; a time response takes a second, a frequency response a hundredth
POINTS = 1200  # of a curve


@dataclass(frozen=True, kw_only=True)
@record
class ResponseBand:
    """Exact responses of arms, `curves` (arms, n) at frequencies or times `at` (n,)."""

    arm: Annotated[str, Quantity("arm", help="arm whose numbers are varied")]
    label: Annotated[str, Quantity("response", help="magnitude over frequency, or signal over time, with its unit")]
    abscissa: Annotated[str, Quantity("abscissa", help="angular frequency [rad/s] or time [s]")]
    at: Annotated[Real, Quantity("at", help="frequencies or times", curve=True)]
    curves: Annotated[Real, Quantity(help="a row an arm")]


def frequency_band(study: Study, output: str = "root_moment") -> ResponseBand:
    """Return the magnitude of a response of up to 100 arms, by the exact transfer function from their input.

    Raises ParameterError for an unknown output, and where no arm has that response.
    """
    arm = study.parts.plan.arm
    omega, row = np.geomspace(*resonant_band(arm), POINTS), transfer(arm, output).rows[0]
    curves = _curves(study, CURVES, lambda one: decibels(transfer(one.arm, output)(1j * omega)))
    label = f"{row.label} [dB re 1 {unit_over(row.unit, arm.input_unit)}]"
    return ResponseBand(arm=study.arm, label=label, abscissa="angular frequency [rad/s]", at=omega, curves=curves)


def slew_band(study: Study, signal: str = "root_moment") -> ResponseBand:
    """Return a signal of up to 24 arms during the slew, of those with a stable continuous-time loop.

    Raises ParameterError for an unknown signal, and where no arm has that response.
    """
    plan = study.parts.plan
    t = np.linspace(0.0, step(plan.arm, plan.law, plan.chain, SCENARIO, outputs=(signal,)).duration, POINTS)

    def curve(one: Subject) -> Real:
        found = step(one.arm, one.law, one.chain, SCENARIO, float(t[-1]), outputs=(signal,))
        require(found.continuous and found.continuous.stability == STABLE, "law", one.law, "stable in continuous time")
        return found.response.at(t)[found.response.names.index(signal)]  # type: ignore[union-attr]  # of such a loop

    label = f"{signal_words(signal)[0]} [{unit_of(plan.arm, signal)}]"
    return ResponseBand(arm=study.arm, label=label, abscissa="time [s]", at=t, curves=_curves(study, SLEWS, curve))


def _curves(study: Study, most: int, call: Callable[[Subject], Real]) -> Real:
    """Return the curves of rows even over the study; arms that are illegal or have none are left out."""
    plan, table, found = study.parts.plan, study.table(), list[Real]()
    for n in np.unique(np.linspace(0, study.done - 1, min(most, study.done)).round().astype(int)):
        with suppress(TfarmError):
            found.append(call(plan.subjects.at([float(table[key][n]) for key in plan.space.keys])))
    require(found, "response", study.arm, "no arm of the study has it")
    return np.array(found)
