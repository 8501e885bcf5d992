"""A measured run as the exact sampled plant has it, and what it leaves: computed less measured, over its deviation.

Open loop: the plant under the held input.  Closed loop: the controller under the recorded references has the input, so
that no noise of the record acts on the model.  An output is linear in numbers that are of this run alone,

    y = y(arm) + sum of c_j d_j:    bias of the drive, offsets of sensors, drift and amplitudes of modes at the start,

so these are the least squares of each arm (variable projection, Golub and Pereyra 1973), under a controller as
disturbances d_j of what it reads: y = d + G u(d).  The offset of the hub's angle is where the arm rests at the start.
A bias is integrated twice by a hub that turns freely.

Noise of a sensor e that the controller reads acts on the arm, too: what it leaves is S e.  With the loop L of the same
arm e = (1 + L) S e is white again (`through_loop`), as the errors of a prediction by the recorded signals are.

Where only the input is known under a controller, and the sensors' noise is white, output errors are white and have
no bias: u_k depends on noise up to y_k, and what u_k does is seen from y_{k+1} on.  A torque on the input makes them
neither.  The errors of the stationary Kalman predictor are both, in open loop, too (Ljung 1999, section 13.5).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from tfarm.arm import AT_HUB, Arm
from tfarm.arm.chain import Chain, Sampling
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.dsp import kernel
from tfarm.dsp.discretise import acting_law
from tfarm.dsp.kernel import law_outputs
from tfarm.dsp.plant import Plant
from tfarm.dsp.pulse import PulseTransfer
from tfarm.dsp.results import ideal_chain
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.sensed import sensed_plant
from tfarm.dsp.simulate import LinearLoop, quantisers, references_of
from tfarm.errors import ParameterError, require
from tfarm.fitting.held import modes_at_period
from tfarm.fitting.runs import RigRun, from_rest
from tfarm.records import frozen

DRIVE_DELAY = "drive.delay"
BIAS = "drive.bias"


class RunResponse(NamedTuple):
    """Computed outputs (outputs, n) of a run, and those (own, outputs, n) by a unit of each of its own numbers."""

    outputs: Real
    by_own: Real


class Projection(NamedTuple):
    """Residuals (size,) of a run, orthonormal to `basis` (size, rank), at its `own` numbers (own,).

    Columns of a unit of each own number have the norms `size`, and scaled to 1 the triangular factor `R`.
    """

    residuals: Real
    basis: Real
    own: Real
    R: Real
    size: Real


@dataclass(frozen=True)
class FitRun:
    """A run in a fit: through which `chain`, with `count` modes, and the deviations `sigma` of its outputs.

    `is_known` (outputs,) is whether a deviation was given, or is that of the residuals.  `gains` has the places of
    sensors' gains in the vector of what is searched for, `delay` that of the drive's dead time.  `own` is how many
    numbers it has of its own: with `is_moving` also the hub's drift and amplitudes of the lowest modes at the start.
    `arm` is the number of its arm, where there are several.  `disturbance` has the places of the deviations of a torque
    on the input over those of each output's noise, where errors are those of the Kalman predictor.
    One that `is_ideal` has no steps and limits of its chain.
    """

    run: RigRun
    chain: Chain
    count: int
    sigma: tuple[float, ...]
    is_known: tuple[bool, ...]
    is_moving: bool
    own: int = 0
    through_loop: bool = False
    gains: tuple[tuple[str, int], ...] = ()
    delay: int | None = None
    arm: int = 0
    disturbance: tuple[int, ...] = ()
    is_ideal: bool = True

    @property
    def size(self) -> int:
        """How many residuals it has: one a sample of each output."""
        return self.run.count * len(self.run.names)

    @property
    def has_known_noise(self) -> bool:
        """Whether the size of no output's noise was taken from the residuals."""
        return all(self.is_known)

    @property
    def log_deviation(self) -> float:
        """The sum of ln sigma over all residuals."""
        return self.run.count * math.fsum(map(math.log, self.sigma))

    @property
    def least_deviation(self) -> Real:
        """The deviation (outputs,) of rounding to the steps of the chain's converters, step/sqrt(12)."""
        (encoder, moment, _) = quantisers(self.chain)[:, 0]
        steps = {"hub_angle": encoder, "root_moment": moment}
        return np.array([steps.get(name, 0.0) for name in self.run.names]) / math.sqrt(12)

    @cached_property
    def measured(self) -> Real:
        """The measured outputs (outputs, n)."""
        return np.array([*self.run.outputs.values()])

    @property
    def ratio(self) -> int:
        """Samples of the record in one of the controller.

        Raises ParameterError where that is no whole number.
        """
        if self.run.law is None:
            return 1
        period = self.chain.sampling.period
        ratio = period / self.run.period
        remedy = f"a record has the period of its controller, {period:g} s, or that over a whole number"
        require(abs(ratio - round(ratio)) < 1e-3 and round(ratio) > 0, "period", self.run.period, remedy)
        return round(ratio)

    def until(self, duration: float) -> FitRun:
        """Return its first part of that duration [s], but of 64 samples at least."""
        samples = max(64, math.ceil(duration / self.run.period))
        run = self.run
        kept: dict[str, Any] = {
            "outputs": {name: values[:samples] for name, values in run.outputs.items()},
            "references": {name: values[:samples] for name, values in run.references.items()},
            "input": None if run.input is None else run.input[:samples],
        }
        return replace(self, run=replace(run, **kept))

    def rescaled(self, residuals: Real, share: float) -> FitRun:
        """Return it with each deviation that is not known as its own residuals say, times the root of a share."""
        rows = residuals.reshape(len(self.sigma), -1)
        factors = np.maximum(np.sqrt((rows**2).mean(axis=1) * share), 1e-12)
        sigma = np.maximum(np.array(self.sigma) * factors, self.least_deviation)
        sigma = np.where(self.is_known, self.sigma, sigma)
        # of a deviation: a change that moves no number
        if np.allclose(sigma, self.sigma, rtol=1e-6, atol=0.0):
            return self
        return replace(self, sigma=tuple(sigma.tolist()))

    # ------------------------------------------------------------ outputs

    def respond(self, arm: Arm, value: Callable[[int], float]) -> RunResponse:
        """Return the outputs of an arm; `value` gives the number of a place in what is searched for."""
        pulse = self.pulse(arm, value)
        loop = None if self.run.law is None else self.loop(arm, value)
        rows = self.rows(pulse)
        found = pulse.held_response(self.commands(loop))
        columns = [self.on_torque(pulse, loop, np.ones(self.run.count))]
        for on_signals in self._free(pulse, rows):
            if loop is not None:
                on_hub = np.zeros(self.run.count)
                on_signals = on_signals + pulse.held_response(loop.input(-loop.read(on_signals), on_hub))
            columns.append(on_signals)
        return RunResponse(found[rows], np.array(columns)[:, rows])

    def rows(self, pulse: PulseTransfer) -> list[int]:
        """Return the places of the run's signals among those of its plant."""
        return [pulse.plant.outputs.index(name) for name in self.run.names]

    def commands(self, loop: RunLoop | None, offsets: Real | None = None) -> Real:
        """Return the input (n,): that of the record, or of its controller, whose sensors have offsets (outputs,)."""
        run = self.run
        if loop is None:
            assert run.input is not None
            return run.input if self.is_ideal else converted(run.input, quantisers(self.chain)[kernel.DAC])
        wanted = loop.wanted
        if offsets is not None:
            names = loop.linear.plant.outputs
            off = np.zeros((len(names), run.count))
            off[[names.index(name) for name in run.names]] = offsets[:, None]
            wanted = wanted - loop.read(off)
        return loop.input(wanted, np.zeros(run.count))

    def on_torque(self, pulse: PulseTransfer, loop: RunLoop | None, torque: Real) -> Real:
        """Return the signals (all of the plant, n) of a torque (n,) on the hub, and of a controller's answer to it."""
        if loop is None:
            return pulse.held_response(torque)
        at_once = PulseTransfer(pulse.plant, replace(pulse.sampling, delay_samples=0.0))
        return at_once.held_response(torque) + pulse.held_response(loop.input(0 * loop.wanted, torque))

    def pulse(self, arm: Arm, value: Callable[[int], float]) -> PulseTransfer:
        """Return the plant of the run's signals at the samples of its record, times the gains of sensors.

        Under a controller its first outputs are those `AT_HUB`.
        """
        law = self.run.law
        read = () if law is None else (*AT_HUB, *law.signals)
        names = tuple(dict.fromkeys((*read, *self.run.names)))
        chain = self._chain(value)
        gains = dict.fromkeys(names, 1.0) | {name: value(place) for name, place in self.gains}
        plant = sensed_plant(arm, chain, names, self.count).together
        by_output = np.array([gains[name] for name in names])
        return PulseTransfer(plant.times(by_output), at_period(chain, self.run.period).sampling)

    def loop(self, arm: Arm, value: Callable[[int], float]) -> RunLoop:
        """Return the controller round the plant of the run's signals."""
        assert self.run.law is not None
        pulse = self.pulse(arm, value)
        acting, late = acting_law(Case(arm, self.run.law, self._chain(value)))
        return RunLoop(self.run, self.ratio, LinearLoop(pulse.plant, acting, late))

    def _chain(self, value: Callable[[int], float]) -> Chain:
        """Return the chain without steps and limits, of an open loop at the record's period, with the dead time."""
        chain = ideal_chain(self.chain) if self.is_ideal else self.chain
        if self.run.law is None:
            chain = at_period(chain, self.run.period)
        return replace(chain, sampling=self.dead_time(chain.sampling, value))

    def dead_time(self, sampling: Sampling, value: Callable[[int], float]) -> Sampling:
        """Return the sampling with the drive's dead time where that is free."""
        if self.delay is None:
            return sampling
        return replace(sampling, delay_samples=value(self.delay) / sampling.period)

    def _free(self, pulse: PulseTransfer, rows: Sequence[int]) -> Iterator[Real]:
        """Yield outputs (names, n) by a unit of each offset, of angular momentum and of modes at the start."""
        n = self.run.count
        plant = pulse.plant
        for row in rows:
            yield np.repeat(np.eye(len(plant.outputs))[row][:, None], n, axis=1)
        if not self.is_moving:
            return
        if plant.rigid[:, 0].any():
            yield plant.rigid[:, :1] * self.run.t + plant.rigid[:, 1:]
        for pole in self._moving(plant):
            first, second = pulse.free_responses(pole, n)
            yield first
            if plant.poles[pole].imag > 0:
                yield second

    def _moving(self, plant: Plant) -> Iterator[int]:
        """Yield the poles whose amplitudes at the start are free, one of each pair: up to four, the slowest first."""
        poles = plant.poles
        period = self.run.period
        kept = np.flatnonzero(
            (poles.imag >= 0) & (poles.imag < math.pi / period) & (-poles.real * period < 1)
        )
        yield from kept[np.argsort(abs(poles[kept]), kind="stable")][:4].tolist()

    def own_names(self, arm: Arm) -> list[str]:
        """Return what the run's own numbers are, in the order of `RunResponse.by_own`."""
        found = [BIAS, *(f"offset of {name}" for name in self.run.names)]
        if self.is_moving:
            plant = sensed_plant(arm, self._chain(lambda _: 0.0), self.run.names, self.count).together
            found += ["angular momentum at the start"] * bool(plant.rigid[:, 0].any())
            for pole in self._moving(plant):
                mode = f"mode {plant.mode[pole]}" if plant.mode[pole] else "hub or filter"
                found += [f"{mode} at the start"] * (1 + (plant.poles[pole].imag > 0))
        return found

    def chain_effects(self, arm: Arm, value: Callable[[int], float]) -> Real:
        """Return the largest differences (outputs,) by steps and limits of the chain, over the deviations."""
        ideal, stepped = (
            each.commands(None if self.run.law is None else each.loop(arm, value))
            for each in (self, replace(self, is_ideal=False))
        )
        pulse = self.pulse(arm, value)
        off = pulse.held_response(stepped - ideal)[self.rows(pulse)]
        return np.asarray(abs(off).max(axis=1) / self.sigma)

    def drift(self, arm: Arm, value: Callable[[int], float]) -> float:
        """Return the hub's angle [rad] at the end of an open loop by a unit of a bias; 0 of one that does not drift."""
        if self.run.law is not None:
            return 0.0
        turning = sensed_plant(arm, self._chain(value), ("hub_angle",), self.count).together.rigid[0, 0]
        return float(turning * self.run.t[-1] ** 2 / 2)

    # ------------------------------------------------------------ residuals

    def residuals(self, arm: Arm, value: Callable[[int], float]) -> Real:
        """Return computed less measured over the deviations (size,), the run's own numbers at their least squares."""
        return self.projection(arm, value).residuals

    def residuals_with(self, arm: Arm, value: Callable[[int], float], own: Real) -> Real:
        """Return computed less measured over the deviations (size,), the run's own numbers (own,) given."""
        pulse = self.pulse(arm, value)
        rows = self.rows(pulse)
        bias, *others = own.tolist()
        found = np.zeros((len(pulse.plant.outputs), self.run.count))
        for number, one in zip(others, self._free(pulse, rows), strict=False):
            found += number * one
        steady = np.full(self.run.count, bias)
        if self.run.law is None:
            u = self.commands(None) + steady
        else:
            loop = self.loop(arm, value)
            u = loop.input(loop.wanted - loop.read(found), steady)
            at_once = PulseTransfer(pulse.plant, replace(pulse.sampling, delay_samples=0.0))
            found += at_once.held_response(steady)
        found += pulse.held_response(u)
        parts = (found[rows] - self.measured)[None]
        return self._whitened(arm, value, parts)[0]

    def own_numbers(self, arm: Arm, value: Callable[[int], float]) -> tuple[Real, Real]:
        """Return the run's own numbers and their standard deviations; not a number where they are not determined."""
        found = self.projection(arm, value)
        spread = np.sqrt(np.diag(np.linalg.pinv(found.R.T @ found.R, hermitian=True)))
        size = found.size
        with np.errstate(divide="ignore", invalid="ignore"):
            deviations = np.where(size > 0, spread / size, math.nan)
        return np.where(size > 0, found.own, math.nan), deviations

    def projection(self, arm: Arm, value: Callable[[int], float]) -> Projection:
        """Return the residuals without what the run's own numbers can add, and these numbers."""
        found = self.respond(arm, value)
        parts = np.concatenate([(found.outputs - self.measured)[None], found.by_own])
        off, *columns = self._whitened(arm, value, parts)
        size = np.linalg.norm(columns, axis=1)
        scaled = np.transpose(columns) / np.where(size > 0, size, 1.0)
        Q, R = np.linalg.qr(scaled)
        # a column that others make up adds nothing
        basis = Q[:, abs(np.diag(R)) > 1e-9]
        own = -np.linalg.lstsq(R, Q.T @ off)[0] / np.where(size > 0, size, 1.0)
        return Projection(off - basis @ (basis.T @ off), basis, own, R, size)

    def _whitened(self, arm: Arm, value: Callable[[int], float], parts: Real) -> Real:
        """Return deviations (rows, outputs, n) as errors of the noise model over its deviations, (rows, size)."""
        require(np.isfinite(parts).all(), "run", self.run.source, "the loop of this arm grows without bound")
        if self.through_loop:
            parts = self.innovations(arm, value, parts)
        if self.disturbance:
            parts = self.prediction_errors(arm, value, parts)
        return (parts / np.array(self.sigma)[:, None]).reshape(len(parts), -1)

    def innovations(self, arm: Arm, value: Callable[[int], float], parts: Real) -> Real:
        """Return (1 + L) of deviations (rows, outputs, n): what the noise of sensors was before it went round."""
        pulse = self.pulse(arm, value)
        loop = self.loop(arm, value)
        rows = self.rows(pulse)
        found = []
        for part in parts:
            read = np.zeros((len(pulse.plant.outputs), self.run.count))
            read[rows] = -part
            found.append(part - pulse.held_response(loop.input_alone(loop.read(read)))[rows])
        return np.array(found)

    def prediction_errors(self, arm: Arm, value: Callable[[int], float], parts: Real) -> Real:
        """Return deviations (rows, outputs, n) less what the stationary Kalman predictor has of them from the past.

        x+ = A x + B (u + w), y = C x + v with white w, v: the errors e = y - C x' of x'+ = A x' + B u + K e are white,
        K = A P C' S^-1, S = C P C' + R.  Those of one sample are made independent by a triangular matrix with 1 on its
        diagonal, so that likelihoods compare.
        """
        pulse = self.pulse(arm, value)
        A, _, C = pulse.matrices()
        at_once = PulseTransfer(pulse.plant, replace(pulse.sampling, delay_samples=0.0))
        states = pulse.integrals_at + 2
        by_torque = np.zeros(len(A))
        by_torque[:states] = at_once.matrices()[1][:states]
        rows = self.rows(pulse)
        # outputs over their noise, and a torque of deviation 1
        ratio = np.array([value(place) for place in self.disturbance])
        seen = C[rows] * ratio[:, None]
        unit = np.eye(len(rows))
        try:
            P = solve_discrete_are(A.T, seen.T, np.outer(by_torque, by_torque), unit)
        except np.linalg.LinAlgError:
            remedy = "no stationary predictor of this arm was found"
            raise ParameterError(key="run", value=self.run.source, remedy=remedy) from None
        S = seen @ P @ seen.T + unit
        K = np.linalg.solve(S, seen @ P @ A.T).T * ratio
        L = np.linalg.cholesky(S)
        monic = np.diag(L)[:, None] * np.linalg.inv(L) * ratio / ratio[:, None]
        predictor = np.hstack([A - K @ C[rows], K])
        # of a triangular matrix times [-C, 1]
        tables = [np.vstack([predictor, row]) for row in monic @ np.hstack([-C[rows], unit])]
        return np.array([[law_outputs(table, part.T) for table in tables] for part in parts])

    @property
    def reads_all(self) -> bool:
        """Whether the record has all signals that its controller reads."""
        return self.run.law is not None and set(self.run.law.signals) <= set(self.run.names)


@frozen
class RunLoop:
    """The controller of a run round its plant, a sample of it at every `ratio` of the record."""

    run: RigRun
    ratio: int
    linear: LinearLoop

    @property
    def wanted(self) -> Real:
        """The references (steps, columns) of the controller."""
        given = {name: values[:: self.ratio] for name, values in self.run.references.items()}
        zero = np.zeros(-(-self.run.count // self.ratio))
        angle, rate, moment = (given.get(name, zero) for name in AT_HUB)
        task = Scenario("measured", self.run.period, zero, angle, rate, moment, zero)
        return references_of(self.linear.law, task)

    def read(self, signals: Real) -> Real:
        """Return what the controller reads (steps, columns) of signals (outputs, n) of the plant."""
        outputs = self.linear.plant.outputs
        sampled = signals[:, :: self.ratio]
        found = np.zeros((sampled.shape[1], len(self.linear.columns)))
        for column, name in enumerate(self.linear.columns):
            if name in outputs:
                found[:, column] = sampled[outputs.index(name)]
        return found

    def input(self, references: Real, on_hub: Real) -> Real:
        """Return the input (n,) under references (steps, columns) and a torque (n,) on the hub."""
        return self._held(self.linear.input(references, on_hub[:: self.ratio]))

    def input_alone(self, errors: Real) -> Real:
        """Return the input (n,) of the controller alone of errors (steps, columns)."""
        return self._held(self.linear.input_alone(errors))

    def _held(self, u: Real) -> Real:
        return np.repeat(u, self.ratio)[: self.run.count]


def fit_run(arm: Arm, run: RigRun, chain: Chain) -> FitRun:
    """Return a run as a fit begins with it: deviations that are not known a tenth of their signal's.

    Under a controller with a reference of the hub's angle that is about its first measured value: an observer of the
    controller had come to rest there.
    """
    if arm.has_rigid_mode:
        run, _ = from_rest(run)
    sigma = []
    for name, values in run.outputs.items():
        usual = 0.1 * float(np.std(values)) or 1.0
        sigma.append(run.sigma.get(name, usual))
    known = tuple(name in run.sigma for name in run.names)
    if run.law is not None and run.law.period is not None:
        chain = replace(chain, sampling=replace(chain.sampling, period=run.law.period))
    is_moving = run.initial != "rest"
    found = FitRun(run, chain, modes_at_period(arm, run.period), tuple(sigma), known, is_moving)
    # raises for a period that is no part of the controller's
    assert found.ratio
    return replace(found, own=len(found.own_names(arm)))


def converted(values: Real, row: Real) -> Real:
    """Return values on the steps and in the range of a converter, a row of `quantisers`."""
    step, low, high = row
    if step:
        values = np.rint(values / step) * step
    return np.clip(values, low, high)


def at_period(chain: Chain, period: float) -> Chain:
    """Return the chain at another sampling period, with the same dead time."""
    sampling = chain.sampling
    delay = sampling.delay_samples * sampling.period / period
    return replace(chain, sampling=replace(sampling, period=period, delay_samples=delay))
