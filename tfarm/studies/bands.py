"""Bands of responses: quantiles, at each frequency or time, of the exact curves of many arms of a study."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np

from tfarm.arrays import Real
from tfarm.case.step import step, unit_of, usual_duration
from tfarm.errors import TfarmError, require
from tfarm.exact.outputs import signal_words, unit_over
from tfarm.loop.curve import decibels
from tfarm.loop.loop import Loop
from tfarm.loop.time_response import usual_poles
from tfarm.processes import shared
from tfarm.records import record
from tfarm.response.frequency import resonant_band
from tfarm.response.transfer import transfer
from tfarm.schema import Quantity

from .findings import QUANTILES, STABLE
from .quantities import SCENARIO
from .running import Plan
from .space import Subject
from .study import Study

FREQUENCY_ARMS, TIME_ARMS = 100, 24  # curves of a band; a time response takes a second
FREQUENCIES, TIMES = 1200, 600  # points of a curve
ENDS = ("low", "median", "high")  # quantiles of a band


@dataclass(frozen=True, kw_only=True)
@record
class ResponseBand:
    """Quantiles of exact responses, of `curves` (arms, points) at frequencies [rad/s] or times [s]."""

    arm: Annotated[str, Quantity("arm", help="arm whose numbers are varied")]
    response: Annotated[str, Quantity("response", help="magnitude over frequency, or signal over time")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the response")]
    abscissa: Annotated[str, Quantity(help="angular frequency [rad/s] or time [s]")]
    rows: Annotated[tuple[int, ...], Quantity(help="rows of the study with these curves")]
    without: Annotated[int, Quantity("arms without a response", help="illegal or not stable, of those computed")]
    at: Annotated[Real, Quantity("at", help="frequencies or times", curve=True)]
    curves: Real

    @property
    def arms(self) -> Annotated[int, Quantity("arms", help="number of curves")]:
        """Number of curves."""
        return len(self.rows)

    def quantile(self, end: str) -> Real:
        """Return a quantile of the curves at each point: "low" (5 %), "median" or "high" (95 %)."""
        return np.quantile(self.curves, QUANTILES[end], axis=0)


def frequency_band(study: Study, output: str = "root_moment", arms: int = FREQUENCY_ARMS) -> ResponseBand:
    """Return the band of the magnitude of a response to the input of the arm, by the exact transfer function.

    Raises ParameterError for an unknown output, and where no arm has that response.
    """
    plan = study.parts.plan
    omega = np.geomspace(*resonant_band(plan.arm), FREQUENCIES)
    name, unit = signal_words(output)
    call = partial(_magnitude, output=output, omega=omega)
    words = name, f"dB re 1 {unit_over(unit, plan.arm.input_unit)}", "angular frequency [rad/s]"
    return _band(study, arms, words, omega, call, 1)


def step_band(study: Study, signal: str = "root_moment", arms: int = TIME_ARMS, workers: int = 1) -> ResponseBand:
    """Return the band of a signal of the continuous-time loop during the slew, of the stable arms.

    Raises ParameterError for a controller in z, an unknown signal, and where no arm has that response.
    """
    plan = study.parts.plan
    duration = usual_duration(usual_poles(Loop(plan.arm, plan.law)), plan.chain)
    t = np.linspace(0.0, duration, TIMES)
    words = signal_words(signal)[0], unit_of(plan.arm, signal), "time [s]"
    return _band(study, arms, words, t, partial(_over_time, signal=signal, t=t), workers)


def _magnitude(one: Subject, output: str, omega: Real) -> Real:
    return decibels(transfer(one.arm, output)(1j * omega))


def _over_time(one: Subject, signal: str, t: Real) -> Real | None:
    found = step(one.arm, one.law, one.chain, SCENARIO, float(t[-1]))
    if found.response is None or found.continuous is None or found.continuous.stability != STABLE:
        return None
    return found.response.at(t)[found.response.names.index(signal)]


def _curve(plan: Plan, row: list[float], call: Callable[[Subject], Any]) -> Real | None:
    """Return the curve of a row; None of an arm that is illegal or has none."""
    try:
        return call(plan.subjects.at(row))
    except TfarmError:
        return None


def _band(
    study: Study, arms: int, words: tuple[str, str, str], at: Real, call: Callable[[Subject], Any], workers: int
) -> ResponseBand:
    plan, table = study.parts.plan, study.table()
    chosen = np.unique(np.linspace(0, study.done - 1, min(arms, study.done)).round().astype(int)).tolist()
    rows = [[float(table[key][n]) for key in plan.space.keys] for n in chosen]
    tasks = ((n, partial(_curve, plan, row, call)) for n, row in zip(chosen, rows, strict=True))
    found = {n: curve for n, curve in shared(tasks, workers) if curve is not None}
    require(found, "response", words[0], "no arm of the study has it")
    ready = sorted(found)
    return ResponseBand(
        arm=study.arm, response=words[0], unit=words[1], abscissa=words[2], at=at, without=len(chosen) - len(ready),
        rows=tuple(int(table["row"][n]) for n in ready), curves=np.array([found[n] for n in ready]),
    )  # fmt: skip
