"""A run measured on a rig under a law, beside which the exact sampled loop is put: [measured] of a law's file.

    [measured]
    file = "step.csv"                    # beside the law's file
    source = "laboratory X, run 7"       # said wherever it is shown

The .csv has a column `t` [s], one `reference:hub_angle` [rad], which is what the controller was led by, and one for
each of `hub_angle` [rad] and `root_moment` [N m] that was measured; lines that begin with # are remarks.
"""

from __future__ import annotations

import csv
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from tfarm.arm import Arm
from tfarm.arm.driving import AnyLaw, tracked
from tfarm.arm.reading import load_tables
from tfarm.dsp.chain import Chain
from tfarm.dsp.results import modes_for, simulation_of
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulation
from tfarm.errors import MISSING, ParameterError
from tfarm.files import read_file
from tfarm.records import record

Real = NDArray[np.float64]

TIME, REFERENCE, SIGNALS = "t", "reference:hub_angle", ("hub_angle", "root_moment")
MOST_BYTES = 8 * 1024 * 1024  # of a .csv: four columns of 100,000 rows
FEWEST = 2  # rows


class MeasuredTable(BaseModel):
    """[measured]."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    file: str
    source: str = ""


@dataclass(frozen=True)
@record
class Measured:
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
        t = period * np.arange(int(self.t[-1] / period * (1 + 1e-12)) + 1)
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

    measured: Measured
    run: Simulation

    @property
    def hub_angle(self) -> Real:
        """The computed hub angle [rad] at the samples, from the first reference on."""
        found: Real = self.run.at_samples.hub_angle + self.measured.reference[0]
        return found

    @property
    def difference_rms(self) -> float:
        """Root mean square of computed less measured hub angle [rad], at the samples."""
        there = np.interp(self.run.t, self.measured.t, self.measured.hub_angle)
        return float(np.sqrt(np.mean((self.hub_angle - there) ** 2)))


def beside(arm: Arm, law: AnyLaw, chain: Chain, measured: Measured) -> Beside:
    """The sampled loop led as the measured one was, with as many modes as its signals take.

    Raises ParameterError as `simulate` does.
    """
    arm, law = tracked(arm, law)
    task = measured.scenario(chain.sampling.period)
    used = modes_for(None, lambda n: simulation_of(arm, law, chain, task, count=n))
    return Beside(measured, simulation_of(arm, law, chain, task, count=used.modes))


def overshoot(angle: Real, step: float, end: float) -> float:
    """How far an angle [rad] goes beyond the `end` of a step [rad], as a share of it; below 0 where it never does."""
    return float(np.max((angle - end) * np.sign(step)) / abs(step)) if step else 0.0


# ------------------------------------------------------------ reading


def load_measured(name_or_path: str | os.PathLike[str]) -> Measured | None:
    """The run of a file's [measured] table, None where it has none.

    Raises ParameterError for an unknown key, and a .csv without its columns or with what is no number, naming the file.
    """
    tables, file = load_tables(name_or_path)
    if "measured" not in tables:
        return None
    try:
        table = _validated(tables["measured"])
        data = read_file(Path(file).parent / table.file, MOST_BYTES, key="measured.file", what="a .csv file")
        return _run_of(_columns(data, table.file), table)
    except ParameterError as error:
        raise error.in_file(file) from None


def _validated(table: Any) -> MeasuredTable:
    if not isinstance(table, dict):
        raise ParameterError(key="measured", value=table, remedy="give a table, headed [measured]")
    try:
        return MeasuredTable.model_validate(table)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
    key = ".".join(map(str, ("measured", *problem["loc"])))
    value = MISSING if problem["type"] == "missing" else problem["input"]
    raise ParameterError(key=key, value=value, remedy="file (a .csv) and source, both texts")


def _columns(data: bytes, name: str) -> dict[str, Real]:
    """The columns of a .csv by their names."""
    lines = [line for line in data.decode("utf-8-sig", "replace").splitlines() if line and not line.startswith("#")]
    head, *rows = list(csv.reader(lines)) or [[]]
    missing = [each for each in (TIME, REFERENCE) if each not in head]
    if missing or not set(SIGNALS) & set(head):
        remedy = f"has columns t [s], {REFERENCE} [rad], and hub_angle [rad] or root_moment [N m]"
        raise ParameterError(key="measured.file", value=name, remedy=remedy)
    try:
        values = np.array([[float(cell) for cell in row] for row in rows], ndmin=2)
    except ValueError:
        values = np.empty((0, 0))
    if values.shape[1:] != (len(head),) or len(values) < FEWEST or not np.isfinite(values).all():
        remedy = f"has at least {FEWEST} rows of as many finite numbers as there are columns"
        raise ParameterError(key="measured.file", value=name, remedy=remedy)
    return dict(zip(head, values.T, strict=True))


def _run_of(columns: dict[str, Real], table: MeasuredTable) -> Measured:
    t = columns[TIME]
    if t[0] != 0.0 or not (np.diff(t) > 0).all():
        raise ParameterError(key="measured.file", value=table.file, remedy="t begins with 0 and rises")
    angle, moment = (columns.get(name, np.empty(0)) for name in SIGNALS)
    return Measured(t, columns[REFERENCE], angle, moment, table.source)
