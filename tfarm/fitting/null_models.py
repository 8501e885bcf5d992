"""An arm as a run is predicted with, and the models that have to be worse: null models."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tfarm.arm import Arm
from tfarm.arm.chain import Chain
from tfarm.arm.writing import KeyedArms
from tfarm.arrays import Real
from tfarm.digits import join_words
from tfarm.dsp.pulse import PulseTransfer
from tfarm.errors import require
from tfarm.fitting.model import SENSOR_GAIN
from tfarm.fitting.posterior import Posterior
from tfarm.fitting.residual_causes import stiffened
from tfarm.fitting.run_model import DRIVE_DELAY, FitRun, RunLoop, fit_run
from tfarm.fitting.runs import DRIVE_GAIN, GAIN_KEY, RigRun
from tfarm.fitting.solve import FIT_SEED


class RunModel(NamedTuple):
    """An arm with its chain and gains of sensors, as a run is predicted with; `modes` are by default enough ones."""

    name: str
    arm: Arm
    chain: Chain
    gains: Mapping[str, float]
    modes: int | None = None

    def of(self, run: RigRun) -> FitRun:
        """Return a run as this arm has it, from rest."""
        found = fit_run(self.arm, replace(run, initial="rest"), self.chain)
        gains = tuple((name, place) for place, name in enumerate(self.gains))
        count = found.count if self.modes is None else self.modes
        return replace(found, gains=gains, count=count)

    def value(self, place: int) -> float:
        """Return the gain of that place."""
        return [*self.gains.values()][place]

    def parts(self, of: FitRun) -> tuple[PulseTransfer, RunLoop | None]:
        """Return the plant of a run, and its loop where it has one."""
        loop = None if of.run.law is None else of.loop(self.arm, self.value)
        return of.pulse(self.arm, self.value), loop


class ComputedRun(NamedTuple):
    """Outputs (outputs, n) with their offsets (outputs,), and those of the linear loop by a unit of each offset.

    `fitted` are the places of those that are of least squares.
    """

    outputs: Real
    offsets: Real
    by_offset: Real
    fitted: tuple[int, ...]


def computed(model: RunModel, run: RigRun) -> ComputedRun:
    """Return the outputs of a run through the whole chain, its offsets those of least squares in the linear loop.

    A led angle begins where it was first measured, within three deviations of its noise.
    """
    of = model.of(run)
    n = len(run.names)
    offsets: Real = np.zeros(n)
    fitted = list(range(n))
    with np.errstate(over="ignore", invalid="ignore"):
        linear = of.respond(model.arm, model.value)
        by_offset = linear.by_own[1:]
        weights = 1 / np.array(of.sigma)[:, None]
        columns = (by_offset * weights).reshape(n, -1).T
        off = ((of.measured - linear.outputs) * weights).ravel()
        if np.isfinite(columns).all() and np.isfinite(off).all():
            offsets = np.asarray(np.linalg.lstsq(columns, off)[0], dtype=float)
            for place in (run.names.index("hub_angle"),) * run.is_led:
                reach = 3 * noise_of(run, of.measured)[place]
                if abs(offsets[place]) > reach:
                    fitted.remove(place)
                    start = math.copysign(reach, offsets[place])
                    offsets[fitted] = np.linalg.lstsq(columns[:, fitted], off - columns[:, place] * start)[0]
                    offsets[place] = start
        true = replace(of, is_ideal=False)
        pulse, loop = model.parts(true)
        outputs = pulse.held_response(true.commands(loop, offsets))[true.rows(pulse)]
    return ComputedRun(outputs + offsets[:, None], offsets, by_offset, tuple(fitted))


def constant_models(run: RigRun) -> dict[str, Real]:
    """Return each signal as its reference, or at rest, with the constant of least squares."""
    found = []
    for name, y in run.outputs.items():
        reference = (
            run.references.get(name, np.zeros(run.count)) if run.law is not None else np.zeros(run.count)
        )
        found.append(reference + (y - reference).mean())
    return {"at rest" if run.law is None else "reference itself": np.array(found)}


def null_models(
    own: RunModel, before: Arm | None, before_chain: Chain | None, without: Mapping[str, float]
) -> Iterator[RunModel]:
    """Yield the null models that are arms."""
    # times the bending stiffness: deflections of a ten-thousandth, and a model without modes
    rigid = 1e4
    yield own._replace(name="rigid arm", arm=stiffened(own.arm, rigid), modes=0)
    yield own._replace(name="E I 20 % up", arm=stiffened(own.arm, 1.2))
    yield own._replace(name="E I 20 % down", arm=stiffened(own.arm, 0.8))
    if before is not None:
        yield RunModel("before the fit", before, before_chain or own.chain, {})
    if without:
        yield with_numbers(own, without)._replace(name=f"without {join_words([*without])}")


def with_numbers(model: RunModel, numbers: Mapping[str, float]) -> RunModel:
    """Return the model with other numbers of its arm, drive and sensors, by the keys of a fit."""
    of_arm = {GAIN_KEY if key == DRIVE_GAIN else key: value for key, value in numbers.items()}
    delay = of_arm.pop(DRIVE_DELAY, None)
    of_sensors = {key: of_arm.pop(key) for key in [*of_arm] if key.startswith(f"{SENSOR_GAIN}:")}
    gains = {key.partition(":")[2]: value for key, value in of_sensors.items()}
    for name in gains:
        require(name in model.gains, "without", f"{SENSOR_GAIN}:{name}", "is no gain of this prediction")
    chain = model.chain
    if delay is not None:
        sampling = replace(chain.sampling, delay_samples=delay / chain.sampling.period)
        chain = replace(chain, sampling=sampling)
    arm = KeyedArms(model.arm, [*of_arm], "without").at(of_arm) if of_arm else model.arm
    return model._replace(arm=arm, chain=chain, gains={**model.gains, **gains})


def drawn_models(own: RunModel, posterior: Posterior, draws: int) -> Iterator[RunModel]:
    """Yield the model with arms drawn from a posterior.  Raises ParameterError for one of another arm."""
    family = KeyedArms(own.arm, posterior.keys, "posterior")
    normal = np.random.default_rng(FIT_SEED).standard_normal((draws, len(posterior.keys)))
    for values in posterior.with_all_determined.draws({}, normal).tolist():
        yield own._replace(arm=family.at(dict(zip(posterior.keys, values, strict=True))))


def noise_of(run: RigRun, left: Real) -> Real:
    """Return the deviation (outputs,) of each sensor's noise: known, or of second differences of (outputs, n)."""
    # of white noise a second difference has six times the variance
    differences = np.diff(left, 2, axis=1)
    found = np.sqrt((differences**2).mean(axis=1) / 6)
    floors = 1e-12 * np.maximum(abs(left).max(axis=1), np.finfo(float).tiny)
    return np.array(
        [run.sigma.get(name, value) for name, value in zip(run.names, np.maximum(found, floors), strict=True)]
    )
