"""A run measured on a rig under a law, beside which the exact sampled loop is put: [measured] of a law's file.

    [measured]
    file = "step.csv"                    # beside the law's file
    source = "laboratory X, run 7"       # said wherever it is shown

The record (a .csv, or a .mat file) has a column `t` [s], one `reference:hub_angle` [rad], which is what the controller
was led by, and one for each of `hub_angle` [rad] and `root_moment` [N m] that was measured.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tfarm.arm import AnyLaw, Arm, tracked
from tfarm.arm.declared import StrictTable, validated
from tfarm.arm.reading import load_tables
from tfarm.arrays import Real
from tfarm.dsp.chain import TIME_ROUNDING, Chain
from tfarm.dsp.results import enough_modes
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulation, Simulator
from tfarm.errors import ParameterError, naming
from tfarm.records import record

from .recording import read_recording

LED_BY = "reference:hub_angle"  # columns of the record
ANGLE_COLUMN = "hub_angle"
MOMENT_COLUMN = "root_moment"


class RunTable(StrictTable):
    """[measured]."""

    file: str
    source: str = ""


@dataclass(frozen=True)
@record
class MeasuredRun:
    """A measured run: `t` (n,) [s] from 0 on, the `reference` (n,) [rad] of the hub's angle, and what was read.

    `hub_angle` (n,) [rad] and `root_moment` (n,) [N m] are empty where they were not measured.
    """

    t: Real
    reference: Real
    hub_angle: Real
    root_moment: Real
    source: str = ""

    def scenario(self, period: float) -> Scenario:
        """The same task at samples: from rest at the first reference, led by what the reference is beyond that.

        The reference is taken between its rows along straight lines.
        """
        t = period * np.arange(int(self.t[-1] / period * (1 + TIME_ROUNDING)) + 1)
        led, none = np.interp(t, self.t, self.reference) - self.reference[0], np.zeros(t.size)
        moving = np.flatnonzero(self.reference != self.reference[-1])
        until = float(self.t[moving[-1]]) if moving.size else 0.0
        return Scenario("measured", period, none, led, none, none, none, busy_until=until)

    @property
    def step(self) -> float:
        """By how much [rad] the reference moves in all."""
        return float(self.reference[-1] - self.reference[0])


@dataclass(frozen=True)
@record
class Beside:
    """A measured run and the exact sampled loop that was led the same way: `run` is what moves beyond the start."""

    measured: MeasuredRun
    run: Simulation

    @property
    def hub_angle(self) -> Real:
        """The computed hub angle [rad] at the samples, from the first reference on."""
        return self.run.at_samples.hub_angle + self.measured.reference[0]

    @property
    def difference_rms(self) -> float:
        """Root mean square of computed less measured hub angle [rad], at the samples."""
        there = np.interp(self.run.t, self.measured.t, self.measured.hub_angle)
        return float(np.sqrt(np.mean((self.hub_angle - there) ** 2)))


def beside_exact(arm: Arm, law: AnyLaw, chain: Chain, measured: MeasuredRun) -> Beside:
    """The sampled loop led as the measured one was, with as many modes as its signals take.

    Raises ParameterError as `simulate` does.
    """
    arm, law = tracked(arm, law)
    task = measured.scenario(chain.sampling.period)
    used = enough_modes(lambda n: Simulator(arm, chain, task, law, count=n).run())
    return Beside(measured, Simulator(arm, chain, task, law, count=used.modes).run())


def overshoot(angle: Real, step: float, end: float) -> float:
    """How far an angle [rad] goes beyond the `end` of a step [rad], as a share of it; below 0 where it never does."""
    return float(np.max((angle - end) * np.sign(step)) / abs(step)) if step else 0.0


# ------------------------------------------------------------ reading


def load_run(name_or_path: str | os.PathLike[str]) -> MeasuredRun | None:
    """The run of a file's [measured] table, None where it has none.

    Raises ParameterError for an unknown key, and for a record without these signals or that is none, naming the file.
    """
    tables, file = load_tables(name_or_path)
    if "measured" not in tables:
        return None
    with naming(file):
        table = validated(RunTable, tables["measured"], "measured")
        found = read_recording(Path(file).parent / table.file)
        led = found.signal(LED_BY, "measured.file")
        if not {ANGLE_COLUMN, MOMENT_COLUMN} & set(found.signals):
            remedy = f"has neither {ANGLE_COLUMN} [rad] nor {MOMENT_COLUMN} [N m] beside {LED_BY} [rad]"
            raise ParameterError(key="measured.file", value=table.file, remedy=remedy)
    angle, moment = (found.signals.get(name, np.empty(0)) for name in (ANGLE_COLUMN, MOMENT_COLUMN))
    return MeasuredRun(found.times - found.start, led, angle, moment, table.source)
