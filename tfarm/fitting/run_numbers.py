"""Free numbers of the chain of runs: the dead time of their drive, gains of sensors, and a torque disturbance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tfarm.errors import require
from tfarm.fitting.model import Parameter, Problem
from tfarm.fitting.run_model import DRIVE_DELAY, FitRun


def with_run_numbers(
    problem: Problem,
    free: Sequence[str],
    start: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    priors: Mapping[str, tuple[float, float]],
    shared: Sequence[str] = (),
) -> Problem:
    """Return the problem with the drive's dead time and gains of sensors free, which an arm's runs have in common.

    Several arms have those that are `shared` in common.  Raises ParameterError for a gain of a signal that no run has.
    """

    def add(key: str, whole: str, runs: Sequence[FitRun]) -> None:
        """Add the number of a key, whose whole key names its arm, to the problem and to its runs."""
        nonlocal problem
        signal = key.partition(":")[2]
        runs = [each for each in runs if not signal or signal in each.run.names]
        remedy = "no run has that signal" if signal else "is of a run: give one, or leave it out"
        require(runs, "free", whole, remedy)
        sampling = runs[0].chain.sampling
        at = 1.0
        low, high = (0.0, math.inf)
        size = 0.0
        if not signal:
            at = sampling.delay_samples * sampling.period
            size = runs[0].run.period
            high = 50 * size
        at = start.get(whole, start.get(key, at))
        low, high = bounds.get(whole, bounds.get(key, (low, high)))
        remedy = f"starts at {at:g}; give bounds low,high around it, or another start"
        require(low <= at <= high and low < high, f"bounds of {whole}", (low, high), remedy)
        place = len(problem.parameters)
        own = Parameter(whole, at, low, high, size, priors.get(whole, priors.get(key)))
        kept = []
        for each in problem.runs:
            if each in runs:
                gains = (*each.gains, (signal, place)) if signal else each.gains
                each = replace(each, gains=gains, delay=each.delay if signal else place)
            kept.append(each)
        problem = replace(problem, parameters=(*problem.parameters, own), runs=tuple(kept))

    for key in free:
        if key != DRIVE_DELAY and ":" not in key:
            continue
        if not problem.others or key in shared:
            add(key, key, problem.runs)
            continue
        for number, family in enumerate((problem.family, *problem.others)):
            add(key, f"{key}:{family.arm.name}", [each for each in problem.runs if each.arm == number])
    return problem


DISTURBANCE = "disturbance"


def with_disturbance(problem: Problem) -> Problem:
    """Return the problem with a torque on the input of its runs that are disturbed, its deviations free.

    One number an arm and signal: the deviation of a white torque, held over a sample, over that of the signal's noise.
    The sizes of the prediction errors, which are not the sensors' noise, follow from the residuals.
    """
    parameters = [*problem.parameters]
    families = (problem.family, *problem.others)
    places: dict[str, int] = {}
    runs = []
    for each in problem.runs:
        if each.run.is_disturbed:
            assert each.run.input is not None
            name = f":{families[each.arm].arm.name}" if problem.others else ""
            keys = [f"{DISTURBANCE}:{signal}{name}" for signal in each.run.names]
            for key, sigma in zip(keys, each.sigma, strict=True):
                if key not in places:
                    places[key] = len(parameters)
                    start = 0.1 * (float(np.std(each.run.input)) or 1.0) / sigma
                    parameters.append(Parameter(key, start, 0.0, math.inf))
            unknown = (False,) * len(keys)
            each = replace(each, disturbance=tuple(places[key] for key in keys), is_known=unknown)
        runs.append(each)
    return replace(problem, parameters=tuple(parameters), runs=tuple(runs))
