"""Curves in time as they are drawn: fine enough for the fastest mode that is seen, or a band that says so.

A simulation is made twice: first at its samples, to see which modes ring visibly, then with at least 20 records in each
period of the fastest of them.  Where that is more than a page can show as a line, the curve is drawn, and written to
the file beside it, as the band between its smallest and largest value over at least two such periods.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tfarm.arm import Arm
from tfarm.arrays import Real
from tfarm.columns import Column
from tfarm.dsp.chain import TIME_ROUNDING
from tfarm.dsp.ringing import POINTS_A_PERIOD, records_between
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import Simulation
from tfarm.records import record

AnySimulator = TypeVar("AnySimulator", bound=Simulator)

LEAST_BETWEEN = 3  # records between two samples at least
MOST_LINE = 6000  # points of a line: at 20 a period still three pixels a period
PERIODS = 2  # of the fastest mode that each piece of a band holds at least
BAND_PIECES = 1500  # of a band at most
MOST_RECORDS = 400_000  # of a simulation for a picture, some 30 MB


@dataclass(frozen=True)
@record
class TimeCurve:
    """A signal over time: a line where `low` is `high`, else the band between them from each `t` [s] to the next."""

    t: Real
    low: Real
    high: Real
    is_band: bool

    def at(self, t: Real) -> TimeCurve:
        """The same at other times, which its own begin with or hold, for a file with one column of time."""
        if self.t.size == t.size:
            return self
        k = np.clip(np.searchsorted(self.t, t * (1 + TIME_ROUNDING), side="right") - 1, 0, self.t.size - 1)
        return TimeCurve(t, self.low[k], self.high[k], self.is_band)

    def columns(self, key: str, title: str, unit: str) -> Sequence[Column]:
        """What is drawn, for the file: one column, or both edges of the band."""
        name = f"{key}_{unit.replace(' ', '_')}"
        if not self.is_band:
            return (Column(name, title, unit, of=self.low),)
        return (
            Column(f"{name}_low", f"{title}, lowest", unit, of=self.low),
            Column(f"{name}_high", f"{title}, highest", unit, of=self.high),
        )


def resolved(simulator: AnySimulator, arm: Arm, *runs: Callable[[AnySimulator], Simulation]) -> list[Simulation]:
    """The simulations of one picture, with as many records between their samples as its fastest visible mode takes."""
    rough = [run(simulator) for run in runs]
    needed = [records_between(simulator, each, _heights(arm, each)) for each in rough if each.t.size > 1]
    most = max(LEAST_BETWEEN, MOST_RECORDS // simulator.scenario.t.size)
    finer = simulator.finer(min(max(LEAST_BETWEEN, *needed), most) if needed else LEAST_BETWEEN)
    return [run(finer) for run in runs]


def points_a_period(arm: Arm, run: Simulation) -> tuple[float, int]:
    """How many points the records have in a period of the fastest mode that is seen, and how many between two samples
    there would have to be for 20; infinitely many where none is seen."""
    simulator = Simulator(arm, run.chain, run.scenario)
    needed = records_between(simulator, run, _heights(arm, run)) if run.t.size > 1 else 0
    there = 0 if run.between is None else run.between.t.size // max(1, run.t.size)
    return (POINTS_A_PERIOD * (there + 1) / (needed + 1) if needed else math.inf), needed


def _heights(arm: Arm, run: Simulation) -> dict[str, float]:
    """How high the curves are that are drawn, by the signal that they come from."""
    return {"root_moment": float(np.ptp(run.at_samples.root_moment)), "tip_displacement": float(np.ptp(away(arm, run)))}


def away(arm: Arm, simulation: Simulation) -> Real:
    """Tip displacement less where a rigid arm on its reference has it [m], at the samples."""
    reference = arm.reach * simulation.scenario.hub_angle[: simulation.t.size]
    return simulation.at_samples.tip_displacement - reference


def root_moment(simulation: Simulation) -> TimeCurve:
    """The root moment [N m]."""
    return curve(*continuous(simulation, "root_moment"))


def tip(simulation: Simulation) -> TimeCurve:
    """The tip displacement [m]."""
    return curve(*continuous(simulation, "tip_displacement"))


def tip_deviation(arm: Arm, simulation: Simulation) -> TimeCurve:
    """Tip displacement less where a rigid arm on its reference has it [m]."""
    t, displacement = continuous(simulation, "tip_displacement")
    return curve(t, displacement - arm.reach * reference_angle(simulation.scenario, t))


def reference_angle(task: Scenario, t: Real) -> Real:
    """The reference angle [rad] between its samples, where its rate is linear in time."""
    T, n = task.period, task.hub_angle.size
    k = np.minimum(np.floor(t / T * (1 + TIME_ROUNDING)).astype(np.int64), n - 1)
    slope = np.diff(np.r_[task.hub_rate, task.hub_rate[-1:]]) / T
    tau = t - k * T
    return task.hub_angle[k] + tau * (task.hub_rate[k] + slope[k] * tau / 2)


def curve(t: Real, y: Real) -> TimeCurve:
    """A line where a page can show one, else a band."""
    if t.size <= MOST_LINE:
        return TimeCurve(t, y, y, False)
    step = max(PERIODS * POINTS_A_PERIOD, math.ceil(t.size / BAND_PIECES))
    starts = np.arange(0, t.size, step)
    return TimeCurve(t[starts], np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts), True)


def continuous(simulation: Simulation, signal: str) -> tuple[Real, Real]:
    """A signal at the samples and between them, in order of time."""
    at, between = simulation.at_samples, simulation.between
    if between is None:
        return at.t, at.signal(signal)
    t, y = np.r_[at.t, between.t], np.r_[at.signal(signal), between.signal(signal)]
    order = np.argsort(t, kind="stable")
    return t[order], y[order]


def held_at(simulation: Simulation, values: Real, t: Real) -> Real:
    """What is held from sample to sample, at the times t [s]."""
    k = np.floor(t / simulation.scenario.period * (1 + TIME_ROUNDING)).astype(np.int64)
    return values[np.minimum(k, values.size - 1)]
