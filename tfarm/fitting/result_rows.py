"""Rows of a fit: its responses, the signals of its runs with noise and whiteness, and the runs' own numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.chain import Chain
from tfarm.arrays import Real
from tfarm.exact.outputs import signal_words
from tfarm.fitting.run_model import BIAS
from tfarm.fitting.solve import Solution
from tfarm.fitting.whiteness import chance_of_white
from tfarm.records import frozen
from tfarm.schema import Quantity


class FittedResponse(NamedTuple):
    """A response of the fit."""

    name: Annotated[str, Quantity(help="output/input as on the command line")]
    label: Annotated[str, Quantity("response", key="response", help="output and input in words")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the response")]
    source: Annotated[str, Quantity(help="file that the response was read from")]
    sha256: Annotated[str, Quantity(help="SHA-256 of that file")]
    frequencies: Annotated[int, Quantity("frequencies", help="number of measured frequencies")]
    low: Annotated[float, Quantity("from", "Hz", key="from_hz", help="first measured frequency")]
    high: Annotated[float, Quantity("to", "Hz", key="to_hz", help="last measured frequency")]
    noise: Annotated[str, Quantity("noise by", help="origin of the standard deviation of its values")]
    chi_squared: Annotated[
        float,
        Quantity(
            "chi-squared", digits=4, help="its share of the sum of squared residuals over their deviations"
        ),
    ]


class RunSignal(NamedTuple):
    """A measured signal of a run in a fit."""

    source: Annotated[str, Quantity("run", help="file of the run")]
    signal: Annotated[str, Quantity("signal", help="measured signal")]
    deviation: Annotated[float, Quantity("noise", digits=4, help="standard deviation of its noise")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the signal and of its noise")]
    noise: Annotated[str, Quantity("noise is", key="noise_is", help="where the noise acts")]
    chance: Annotated[
        float,
        Quantity(
            "chance of white residuals",
            digits=3,
            key="chance_of_white",
            help="probability that white noise is as far from white, by its correlations and its spectrum",
        ),
    ]
    chain: Annotated[
        float,
        Quantity(
            "steps and limits",
            digits=3,
            key="by_chain",
            help="largest difference by steps and limits of the chain, over the noise",
        ),
    ]


class OwnNumber(NamedTuple):
    """A number of a run alone, by least squares at the fitted arm; None where the run does not determine it."""

    source: Annotated[str, Quantity("run", help="file of the run")]
    number: Annotated[str, Quantity("own number", help="bias, offset, or motion at the start of the run")]
    unit: Annotated[str, Quantity("unit", help="SI unit of the number")]
    value: Annotated[float | None, Quantity("value", digits=4, help="best value")]
    deviation: Annotated[
        float | None, Quantity("standard deviation", digits=3, key="std", help="at the fitted arm")
    ]


class RunCurves(NamedTuple):
    """Measured signals (outputs, n) of a run over times `t` [s], and computed ones with the run's own numbers."""

    names: tuple[str, ...]
    t: Real
    measured: Real
    computed: Real


@frozen
class RunResults(Solution):
    """A solution with tables of its runs."""

    @property
    def chain(self) -> Chain | None:
        """The chain of the runs with the fitted dead time, of a controller where there was one; None without runs."""
        chains = [
            replace(each.chain, sampling=each.dead_time(each.chain.sampling, self._value))
            for each in sorted(self.problem.runs, key=lambda each: each.run.law is None)
        ]
        return chains[0] if chains else None

    @property
    def _arm(self) -> Arm:
        return self.problem.arm(self.point)

    def _value(self, place: int) -> float:
        return self.problem.value(self.point, place)

    @cached_property
    def run_signals(
        self,
    ) -> Annotated[
        list[RunSignal], Quantity("runs", key="runs", help="measured signals of the runs with their noise")
    ]:
        """A row a signal."""
        rows = []
        for each, residuals in self.of_runs:
            noise = "of sensors that the controller reads" if each.through_loop else "white at the output"
            if each.disturbance:
                noise = "white at the output, and a torque disturbance"
            effects = each.chain_effects(self._arm, self._value)
            for place, name in enumerate(each.run.names):
                unit = signal_words(name)[1]
                chance = chance_of_white(residuals[place])
                found = (each.sigma[place], unit, noise, chance, float(effects[place]))
                rows.append(RunSignal(each.run.source, name, *found))
        return rows

    @cached_property
    def own_numbers(
        self,
    ) -> Annotated[
        list[OwnNumber],
        Quantity("own numbers", help="bias, offsets and motion at the start of each run, free in every fit"),
    ]:
        """A row a number of each run."""
        rows = []
        arm = self._arm
        for each in self.problem.runs:
            names = each.own_names(arm)
            values, deviations = each.own_numbers(arm, self._value)
            for name, value, deviation in zip(names, values.tolist(), deviations.tolist(), strict=True):
                of_signal = name.removeprefix("offset of ")
                unit = f"{arm.input_unit} s"
                if name == BIAS:
                    unit = arm.input_unit
                elif of_signal != name:
                    unit = signal_words(of_signal)[1]
                found = (None, None) if math.isnan(value) else (value, deviation)
                rows.append(OwnNumber(each.run.source, name, unit, *found))
        return rows

    @property
    def run_notes(
        self,
    ) -> Annotated[
        list[str], Quantity("notes", key="run_notes", help="drift by a bias, and limits of the chain reached")
    ]:
        """The drift of the rigid mode by each bias, and where steps or limits of the chain exceed the noise."""
        notes = []
        biases = [row.value for row in self.own_numbers if row.number == BIAS]
        for each, bias in zip(self.problem.runs, biases, strict=True):
            turned = abs((bias or 0.0) * each.drift(self._arm, self._value))
            if turned:
                notes.append(
                    f"{Path(each.run.source).name}: drift of the rigid mode: the bias, integrated twice, turns the hub "
                    f"by {turned:.3g} rad; it is fitted with the run"
                )
        notes += [
            f"{Path(row.source).name}: {row.signal}: steps or limits of the chain (saturation) change it by up to "
            f"{row.chain:.3g} deviations, which the fit leaves out"
            for row in self.run_signals
            if row.chain > 1
        ]
        return notes

    @property
    def run_curves(self) -> list[RunCurves]:
        """Measured and computed signals of each run."""
        found = []
        for each in self.problem.runs:
            at_output = replace(each, through_loop=False, disturbance=())
            off = at_output.residuals(self._arm, self._value).reshape(len(each.sigma), -1)
            computed = each.measured + off * np.array(each.sigma)[:, None]
            found.append(RunCurves(each.run.names, each.run.t, each.measured, computed))
        return found
