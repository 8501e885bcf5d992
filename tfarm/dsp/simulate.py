"""The sampled loop in time: exact between the samples, with any controller, recorded at the samples and between."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import AT_HUB, FED_BACK, MOMENT_GAIN, Arm, HubFeedback, many_laws
from tfarm.arm.checks import whole
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.dsp import kernel
from tfarm.dsp.chain import Chain
from tfarm.dsp.converters import quantisers
from tfarm.dsp.loop import check_loop
from tfarm.dsp.plant import RECORDED, USUAL_MODES, Plant, filtered, undelayed_plant
from tfarm.dsp.sampling import held_amplitude
from tfarm.dsp.scenarios import Scenario
from tfarm.errors import ParameterError
from tfarm.records import record

FOLDED_UP = 10.0  # rad: an arm bent by the moment EI/L times this is no arm any more, and the simulation stops
SHOWN = slice(len(FED_BACK), len(FED_BACK) + len(RECORDED))  # of the outputs those recorded, after the measured ones
MOST_BETWEEN = 1000  # records between two samples


class Measurement(NamedTuple):
    """What a controller gets at sample `k`, time `t` [s]: what the sensors read, and what is wanted.

    `vibration` is the root moment less `rigid_moment` (the paper's x under either reading of it); `feedforward` is r.
    """

    k: int
    t: float
    hub_angle: float
    hub_rate: float
    root_moment: float
    vibration: float
    feedforward: float
    angle_reference: float
    rate_reference: float
    rigid_moment: float

    def servo(self, law: HubFeedback) -> float:
        """What a law asks of the input [N m] for the hub's angle and rate, as they are off what is wanted.

        Raises ParameterError for a law with a gain on what is not measured here.
        """
        if not law.is_at_hub:
            name = law.elsewhere[0].name
            remedy = "a controller of samples has hub angle, hub rate and root moment alone; set it to 0"
            raise ParameterError(key=name, value=law[name], remedy=remedy)
        return law.Kp * (self.angle_reference - self.hub_angle) + law.K1 * (self.rate_reference - self.hub_rate)

    def asked(self, law: HubFeedback, moment_gain: float) -> float:
        """u = r + Kp (theta_ref - theta) + K1 (theta_t_ref - theta_t) - K2 x, K2 being `moment_gain` at this sample."""
        return self.feedforward + self.servo(law) - moment_gain * self.vibration


Controller = Callable[[Measurement], float]


@dataclass(frozen=True)
@record
class Trace:
    """Signals, not filtered, at `t` [s]: hub angle [rad], hub rate [rad/s], root moment [N m], tip displacement [m]."""

    t: Real
    hub_angle: Real
    hub_rate: Real
    root_moment: Real
    tip_displacement: Real


@dataclass(frozen=True)
class Stop:
    """Why a simulation ended early: at `time` [s] the arm was folded up, by `mode` above all (0: the hub)."""

    time: float
    mode: int


@dataclass(frozen=True)
@record
class Simulation:
    """A simulated loop: `at_samples` just before each update, `between` the records asked for between the samples.

    `torque` [N m] is what leaves the DAC at each sample, `gain` the K2 used there (None where a controller does not
    say), `measured` (n, 3) what the analog filters pass of hub angle, hub rate and root moment.  `saturated_at` (n, 3)
    says at which samples the encoder, the strain amplifier and the torque were clipped.  `energy_error` is |energy
    gained - work done| over the energy that went to and fro, for an arm without damping; None with damping.
    """

    scenario: Scenario
    chain: Chain
    at_samples: Trace
    between: Trace | None
    measured: Real
    torque: Real
    gain: Real | None
    saturated_at: NDArray[np.bool_]
    energy_error: float | None
    stopped: Stop | None

    @property
    def finding(self) -> str:
        """How far it ran, the largest root moment on the way, and what was clipped, in words."""
        end, moment = float(self.t.max(initial=0.0)), float(abs(self.at_samples.root_moment).max(initial=0.0))
        clipped = [f"{name} clipped at {n} samples" for name, n in self.saturated.items() if n]
        ran = f"ran to {end:.6g} s" if self.stopped is None else f"ran away, stopped at {self.stopped.time:.6g} s"
        return ", ".join([ran, f"root moment up to {moment:.4g} N m", *clipped])

    @property
    def t(self) -> Real:
        """The times of the samples [s]."""
        return self.at_samples.t

    @property
    def saturated(self) -> dict[str, int]:
        """At how many samples encoder, strain amplifier and torque were clipped."""
        counts = self.saturated_at.sum(axis=0)
        return {name: int(n) for name, n in zip(("encoder", "moment", "torque"), counts, strict=True)}

    @property
    def volts(self) -> Real | None:
        """The motor's voltage, where the actuator has a motor constant."""
        constant = self.chain.actuator.motor_constant
        return None if constant is None else self.torque / constant


class Simulator:
    """An arm with `count` modes, a chain and a scenario, prepared once; each call simulates it from the start.

    `between` asks for so many records in each sample.  Raises ParameterError for a locked hub.
    """

    def __init__(
        self, arm: Arm, chain: Chain, scenario: Scenario, *, count: int = USUAL_MODES, between: int = 0
    ) -> None:
        remedy = f"a whole number of records between two samples, 0 to {MOST_BETWEEN}"
        between = whole("between", between, 0, MOST_BETWEEN, remedy)
        self.chain, self.scenario, self.between = chain, scenario, between
        self.plant = self.plant_of(arm, count)
        self._kept = np.nonzero(self.plant.poles.imag >= 0)[0]
        self._tables = _tables(self.plant, self._kept, chain, between)
        self._rows = quantisers(chain).rows
        self._wanted = scenario.wanted
        self._bound = FOLDED_UP * arm.bending_scale

    def plant_of(self, arm: Arm, count: int) -> Plant:
        """What is measured, through its filters, and then what is recorded."""
        plant = undelayed_plant(arm, self.chain, (*FED_BACK, *RECORDED), count)
        return filtered(plant, self.chain)

    def linear(self, gains: HubFeedback, K2: Real | None = None) -> Simulation:
        """The law u = r + gains . (wanted - measured), compiled; `K2` (n,) may vary.  Nothing is wanted off the hub.

        Raises ParameterError for I_h = 0 with moment feedback, and for gains that are not one finite number a sample.
        """
        check_loop(self.plant.arm, gains)
        n = self.scenario.feedforward.size
        gain = np.full(n, gains.K2) if K2 is None else np.array(K2, dtype=float)
        if gain.shape != (n,) or not np.isfinite(gain).all():
            raise ParameterError(key="K2", value=gain.shape, remedy=f"one finite gain a sample, {n} in all")
        state, c = self._start(), self.chain.converters
        rows = np.ascontiguousarray(many_laws(gains, **{MOMENT_GAIN: gain}).T)
        done = kernel.run_gains(
            self._tables, state.amplitude, state.rigid, state.held, self.chain.sampling.whole_delay,
            rows, self._wanted, self.scenario.feedforward, self.scenario.disturbance, self.scenario.impulse,
            self._rows, self._filter, c.arithmetic == "float32", self._bound, state.record, state.torque, state.fine,
            state.saturated, state.work,
        )  # fmt: skip
        return self._result(state, int(done), gain)

    def controller(self, controller: Controller) -> Simulation:
        """Any callable from a `Measurement` to a torque [N m]; its numbers are float32 if the arithmetic is."""
        return self._stepped(lambda m: (float(controller(m)), 0.0), None)

    def gain_schedule(self, K1: float, gain: Callable[[Measurement], float], Kp: float = 0.0) -> Simulation:
        """The law of `linear` with K2 = gain(measurement) at each sample, recorded as `gain`."""
        law = HubFeedback(K1=K1, Kp=Kp)

        def torque(m: Measurement) -> tuple[float, float]:
            K = float(gain(m))
            return m.asked(law, K), K

        return self._stepped(torque, np.zeros(self.scenario.feedforward.size))

    def finer(self, between: int) -> Self:
        """The same with so many records in each sample."""
        other = copy(self)
        other.between = between
        other._tables = _tables(self.plant, self._kept, self.chain, between)
        return other

    def modal(self) -> tuple[Complex, Complex]:
        """Poles (m,) [1/s] with Im p >= 0, and what each amplitude adds to hub angle, rate, moment and tip (4, m)."""
        return self.plant.poles[self._kept], self._tables[3][SHOWN]

    def first_amplitudes(self) -> Complex:
        """The modal amplitudes (m,) after the sample at t = 0, once the hub was struck."""
        return self._start().amplitude + self.scenario.impulse

    # ------------------------------------------------------------ inside

    def _stepped(self, rule: Callable[[Measurement], tuple[float, float]], gain: Real | None) -> Simulation:
        """The loop of `kernel.run_gains` in Python."""
        state, memory = self._start(), np.zeros(3)
        d, ring, disturbance = self.chain.sampling.whole_delay, state.held.size, self.scenario.disturbance
        single = self.chain.converters.arithmetic == "float32"
        weights, rates, static = self._tables[3:6]
        for k in range(state.torque.size):
            acting = state.held[(k - d - 1) % ring]
            extra = disturbance[k - 1] if k else 0.0
            kernel.read_outputs(weights, rates, static, state.amplitude, state.rigid, acting + extra, state.record[k])
            if not abs(state.record[k, 2]) <= self._bound:
                return self._result(state, k, gain)
            u, K = rule(self._measurement(k, state, memory, single))
            if not math.isfinite(u):
                raise ParameterError(key="controller", value=u, remedy=f"its torque at sample {k} is not finite")
            u = float(np.float32(u)) if single else u
            u = kernel.quantise(u, self._rows[kernel.DAC], state.saturated[k], kernel.DAC)
            state.held[k % ring] = state.torque[k] = u
            if gain is not None:
                gain[k] = K
            now = state.held[(k - d) % ring]
            if k == 0:
                kernel.strike(state.amplitude, state.rigid, self.scenario.impulse)
            kernel.advance(
                self._tables, state.amplitude, state.rigid, acting, now, disturbance[k], state.fine[k], state.work
            )
        return self._result(state, state.torque.size, gain)

    def _measurement(self, k: int, state: _State, memory: Real, single: bool) -> Measurement:
        angle = kernel.quantise(state.record[k, 0], self._rows[kernel.ENCODER], state.saturated[k], kernel.ENCODER)
        moment = kernel.quantise(state.record[k, 2], self._rows[kernel.AMPLIFIER], state.saturated[k], kernel.AMPLIFIER)
        rate = kernel.estimate(angle, state.record[k, 1], memory, self._filter)
        forward = float(self.scenario.feedforward[k])
        angle_wanted, rate_wanted, rigid = (float(value) for value in self._wanted[k, : len(AT_HUB)])
        values = [angle, rate, moment, moment - rigid, forward, angle_wanted, rate_wanted, rigid]
        if single:
            values = [float(np.float32(value)) for value in values]
        return Measurement(k, k * self.scenario.period, *values)

    @property
    def _filter(self) -> Real:
        c, T = self.chain.converters, self.chain.sampling.period
        return np.array([float(c.hub_rate == "difference"), math.exp(-c.rate_filter * T), T])

    def _start(self) -> _State:
        n, outputs = self.scenario.feedforward.size, len(self.plant.outputs)
        amplitude: Complex = np.zeros(self._kept.size, complex)
        if self.scenario.tip_offset:
            i, value = _released(self.plant, self._kept, self.scenario.tip_offset)
            amplitude[i] += value
        return _State(
            amplitude=amplitude,
            rigid=np.zeros(2),
            held=np.zeros(self.chain.sampling.whole_delay + 2),
            record=np.zeros((n, outputs)),
            torque=np.zeros(n),
            fine=np.zeros((n, self.between, outputs)),
            saturated=np.zeros((n, 3), np.bool_),
            work=np.zeros(2),
            energy=self._energy(amplitude + complex(self.scenario.impulse), self.scenario.impulse),
        )

    def _energy(self, amplitude: Complex, rate: float) -> float:
        """Of an undamped arm [J]: b^2 |a|^2/2 a mode, b^2 twice the residue of the hub rate, and the rigid arm's."""
        row = self.plant.outputs.index("hub_rate", SHOWN.start)
        rigid = self.plant.rigid[row, 1] * rate**2 / 2
        return float(self.plant.residues[row, self._kept].real @ abs(amplitude) ** 2 + rigid)

    def _energy_error(self, state: _State) -> float | None:
        if not self.plant.arm.is_undamped or self.chain.actuator.hub_damping > 0:
            return None
        after, (work, moved) = self._energy(state.amplitude, state.rigid[1]), state.work
        return float(abs(after - state.energy - work) / max(state.energy + moved, LEAST_SIZE))

    def _result(self, state: _State, done: int, gain: Real | None) -> Simulation:
        stopped = None
        if done < state.torque.size:
            of_root = np.nan_to_num(abs(self.plant.residues[2, self._kept] * state.amplitude), nan=np.inf)
            stopped = Stop(done * self.scenario.period, int(self.plant.mode[self._kept][int(np.argmax(of_root))]))
        T, m = self.scenario.period, self.between
        between = None
        if m:
            at = T * (np.arange(done)[:, None] + (np.arange(m) + 1) / (m + 1))
            between = _trace(at.ravel(), state.fine[:done].reshape(done * m, -1))
        return Simulation(
            scenario=self.scenario,
            chain=self.chain,
            at_samples=_trace(self.scenario.t[:done], state.record[:done]),
            between=between,
            measured=state.record[:done, : len(AT_HUB)],
            torque=state.torque[:done],
            gain=None if gain is None else gain[:done],
            saturated_at=state.saturated[:done],
            energy_error=None if stopped else self._energy_error(state),
            stopped=stopped,
        )


@dataclass(frozen=True)
class _State:
    """What changes while a simulation runs."""

    amplitude: Complex
    rigid: Real
    held: Real
    record: Real
    torque: Real
    fine: Real
    saturated: NDArray[np.bool_]
    work: Real
    energy: float


def _tables(plant: Plant, kept: NDArray[np.int64], chain: Chain, between: int) -> tuple[Any, ...]:
    """The arrays of `kernel` (see there)."""
    p, weight = plant.poles[kept], np.where(plant.poles[kept].imag > 0, 2.0, 1.0)
    T, f = chain.sampling.period, chain.sampling.fraction
    records = T * (np.arange(between) + 1) / (between + 1)
    ends = np.unique(np.r_[records, [f * T] if f else [], T])
    starts = np.r_[0.0, ends[:-1]]
    piece = np.c_[ends - starts, starts >= f * T, np.isin(ends, records)].astype(float)
    turn = np.exp(p * piece[:, :1])
    push = np.array([held_amplitude(p, float(duration)) for duration in piece[:, 0]])
    weights = np.ascontiguousarray(plant.residues[:, kept] * weight)
    row = plant.outputs.index("hub_angle", SHOWN.start)
    hub = np.r_[plant.rigid[row], weights[row]].astype(complex)
    return turn, push, piece, weights, plant.rigid, plant.static, hub


def _released(plant: Plant, kept: NDArray[np.int64], offset: float) -> tuple[int, complex]:
    """The amplitude of the first mode at rest with the tip displaced: a = i x/(p r), x = offset |p|^2/(2 Im p)."""
    row = plant.outputs.index("tip_displacement")
    first = np.nonzero((plant.mode[kept] == 1) & (plant.poles[kept].imag > 0))[0]
    if not first.size or plant.residues[row, kept[first[0]]] == 0:
        remedy = "the tip cannot be released: it is pinned, or the first mode is overdamped; take another scenario"
        raise ParameterError(key="scenario", value="decay", remedy=remedy)
    i = int(first[0])
    p, r = plant.poles[kept[i]], plant.residues[row, kept[i]]
    return i, complex(1j * offset * abs(p) ** 2 / (2 * p.imag) / (p * r))


def _trace(t: Real, record: Real) -> Trace:
    """The recorded outputs."""
    return Trace(t, *(np.ascontiguousarray(column) for column in record[:, SHOWN].T))
