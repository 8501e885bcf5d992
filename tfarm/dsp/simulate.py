"""Simulation of the sampled loop: exact between the samples, with any controller, recorded at the samples and between.

A signal among a law's references enters as signal - reference: those of the hub's angle and rate are the slew's, that
of the root moment is the rigid arm's.  A column "reference:hub_angle" is the reference alone.  The encoder's counts
and the strain amplifier's range act on hub angle and root moment; other signals are read without a converter.

A signal is rounded to the nearest step (mid-tread) and clipped to the codes of its bits in two's complement:
-2^(b-1) .. 2^(b-1) - 1 steps of 2 R / 2^b.  An ideal converter has step 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import ANGLE_GAIN, AT_HUB, RATE_GAIN, AnyLaw, Arm, HubFeedback
from tfarm.arm.checks import whole
from tfarm.arm.law import REFERENCE, Law
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.dsp import kernel
from tfarm.dsp.chain import Chain
from tfarm.dsp.discretise import acting_law, with_all_gains
from tfarm.dsp.kernel import DAC, HIGHEST, LOWEST
from tfarm.dsp.plant import RECORDED, USUAL_MODES, sensed_plant
from tfarm.dsp.scenarios import Scenario
from tfarm.errors import ParameterError, must_be_known
from tfarm.exact.outputs import OUTPUTS
from tfarm.records import record

FOLDED_UP = 10.0  # rad: the simulation stops at the root moment EI/L times this, far beyond small deflections
MOST_BETWEEN = 1000  # records between two samples
NO_GAINS = HubFeedback()


def quantisers(chain: Chain) -> Real:
    """Step, lowest and highest value (3, 3) of a chain's encoder, strain amplifier and DAC, as `kernel` numbers them.

    A step of 0 is ideal; the torque's range also respects the motor's limit.
    """
    converters, limit = chain.converters, chain.actuator.torque_limit
    counts = converters.encoder_counts
    rows = np.array([
        [0.0 if counts is None else 2 * math.pi / counts, -math.inf, math.inf],
        _converter(converters.moment_bits, converters.moment_range),
        _converter(converters.torque_bits, converters.torque_range),
    ])  # fmt: skip
    rows[DAC, LOWEST] = max(rows[DAC, LOWEST], -limit)
    rows[DAC, HIGHEST] = min(rows[DAC, HIGHEST], limit)
    return rows


def _converter(bits: int | None, span: float | None) -> list[float]:
    if span is None:
        return [0.0, -math.inf, math.inf]
    if bits is None:
        return [0.0, -span, span]
    step = 2 * span / 2**bits
    return [step, -span, span - step]


class Measurement(NamedTuple):
    """Readings of the sensors, and references, for a controller at sample `k`, time `t` [s].

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
        """Input [N m] of a law by the errors of the hub's angle and rate."""
        angle_off, rate_off = self.angle_reference - self.hub_angle, self.rate_reference - self.hub_rate
        return law[ANGLE_GAIN] * angle_off + law[RATE_GAIN] * rate_off


Controller = Callable[[Measurement], float]


@dataclass(frozen=True)
@record
class Trace:
    """Signals, not filtered, at `t` [s]: hub angle [rad], hub rate [rad/s], root moment [N m], tip displacement [m].

    `others` are further outputs, by name and in SI units.
    """

    t: Real
    hub_angle: Real
    hub_rate: Real
    root_moment: Real
    tip_displacement: Real
    others: dict[str, Real] = field(default_factory=dict)

    def signal(self, name: str) -> Real:
        """Return a signal by its name.  Raises ParameterError for one that was not recorded."""
        must_be_known("output", name, self.names)
        return self.others[name] if name in self.others else cast("Real", getattr(self, name))

    @property
    def units(self) -> dict[str, str]:
        """The SI units of the further outputs."""
        return {name: OUTPUTS[name.partition("@")[0]].unit for name in self.others}

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all signals."""
        return (*RECORDED, *self.others)


@dataclass(frozen=True)
class Stop:
    """Early end of a simulation: at `time` [s] the root moment passed its bound, mostly by `mode` (0: the hub)."""

    time: float
    mode: int


@dataclass(frozen=True)
@record
class Simulation:
    """A simulated loop: `at_samples` just before each update, `between` the records between the samples, if any.

    `torque` [N m] is the output of the DAC at each sample, `gain` that on the root moment there (None of a controller
    without one), `measured` (n, 3) hub angle, hub rate and root moment behind the analog filters.  `saturated_at`
    (n, 3): whether the encoder, the strain amplifier and the torque were clipped at each sample.
    `energy_error` is |energy gained - work done| over initial energy and total work, for an arm without damping; None
    with damping.
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
        """End of the run, largest root moment, and clipped signals."""
        end, moment = float(self.t.max(initial=0.0)), float(abs(self.at_samples.root_moment).max(initial=0.0))
        clipped = [f"{name} clipped at {n} samples" for name, n in self.saturated.items() if n]
        ran = f"ran to {end:.6g} s" if self.stopped is None else f"unstable, stopped at {self.stopped.time:.6g} s"
        return ", ".join([ran, f"root moment up to {moment:.4g} N m", *clipped])

    @property
    def t(self) -> Real:
        """The times of the samples [s]."""
        return self.at_samples.t

    @property
    def saturated(self) -> dict[str, int]:
        """Numbers of samples at which encoder, strain amplifier and torque were clipped."""
        counts = self.saturated_at.sum(axis=0)
        return {name: int(n) for name, n in zip(("encoder", "moment", "torque"), counts, strict=True)}

    @property
    def volts(self) -> Real | None:
        """The motor's voltage, where the actuator has a motor constant."""
        constant = self.chain.actuator.motor_constant
        return None if constant is None else self.torque / constant


class Simulator:
    """An arm with `count` modes, a chain, a scenario and a law, prepared once; each call simulates it from the start.

    `between` is the number of records in each sample, `outputs` are signals beyond those of `RECORDED`, by name, those
    along the arm with their place [m]: "tip_rotation", "strain@0.05".  Raises ParameterError for a locked hub, for an
    unknown output or signal, one that grows with s without bound, a signal whose reference no scenario has, and as
    `acting_law` does.
    """

    def __init__(
        self,
        arm: Arm,
        chain: Chain,
        scenario: Scenario,
        law: AnyLaw = NO_GAINS,
        *,
        count: int = USUAL_MODES,
        between: int = 0,
        outputs: Sequence[str] = (),
    ) -> None:
        remedy = f"a whole number of records between two samples, 0 to {MOST_BETWEEN}"
        between = whole("between", between, 0, MOST_BETWEEN, remedy)
        given = with_all_gains(arm, law)
        self.gains = given.gains if given.references == AT_HUB else None
        self.law, self.chain = acting_law(arm, given, chain)
        references_of(self.law, scenario)  # raises for one that is missing
        self.scenario, self.between, self._wanted = scenario, between, scenario.wanted
        self.others = tuple(dict.fromkeys(name for name in outputs if name not in RECORDED))
        self.measured = tuple(dict.fromkeys((*AT_HUB, *self.law.signals)))
        self.plant = sensed_plant(arm, chain, self.measured, count).together
        for names in filter(None, (RECORDED, self.others)):
            self.plant = self.plant.joined(sensed_plant(arm, chain, names, count).unfiltered)
        self._kept = np.nonzero(self.plant.poles.imag >= 0)[0]
        self._model = self._prepared()
        self._forcing = kernel.Forcing(scenario.feedforward, scenario.disturbance, float(scenario.impulse))
        c, sampling = self.chain.converters, self.chain.sampling
        self._electronics = kernel.Electronics(
            quantisers=quantisers(self.chain),
            is_differenced=c.hub_rate == "difference",
            pole=math.exp(-c.rate_filter * sampling.period),
            period=float(sampling.period),
            delay=sampling.whole_delay,
            is_single=c.arithmetic == "float32",
            bound=float(FOLDED_UP * arm.bending_scale),
        )

    def run(self) -> Simulation:
        """Simulate the law over the scenario, from its start."""
        n, gains = self.scenario.feedforward.size, self.gains
        return self._driven(self.law, None if gains is None else np.full(n, gains.K2))

    def linear(self, gains: HubFeedback, K2: Real | None = None) -> Simulation:
        """Simulate u = r + gains . (wanted - measured) instead of the simulator's own law; `K2` (n,) may vary.

        Raises ParameterError for I_h = 0 with moment feedback, and for gains that are not one finite number a sample.
        """
        n = self.scenario.feedforward.size
        gain = np.full(n, gains.K2) if K2 is None else np.array(K2, dtype=float)
        if gain.shape != (n,) or not np.isfinite(gain).all():
            raise ParameterError(key="K2", value=gain.shape, remedy=f"one finite gain a sample, {n} in all")
        return self._driven(with_all_gains(self.plant.arm, gains), gain)

    def _driven(self, law: Law, gain: Real | None) -> Simulation:
        """A law in z over the scenario; `gain` is that on the root moment, sample by sample."""
        columns = (*law.signals, *law.wanted)
        A, B, C, D = law.matrices(columns)
        if gain is not None:
            D = np.repeat(D, gain.size, axis=0)
            D[:, columns.index("root_moment")] = gain
        matrices = tuple(np.ascontiguousarray(each) for each in (A, B, C, D))
        if self._electronics.is_single:
            matrices = tuple(each.astype(np.float32).astype(float) for each in matrices)
        sources = np.array([self.measured.index(name) if name in self.measured else -1 for name in columns])
        references, state = references_of(law, self.scenario), self._start()
        done = kernel.run(self._model, state, self._forcing, self._electronics, matrices, sources, references)
        return self._result(state, int(done), gain)

    def controller(self, controller: Controller) -> Simulation:
        """Simulate a callable from a `Measurement` to a torque [N m]; its numbers are float32 if the arithmetic is."""
        return self._stepped(lambda m: (float(controller(m)), 0.0), None)

    def gain_schedule(self, K1: float, gain: Callable[[Measurement], float], Kp: float = 0.0) -> Simulation:
        """Simulate the law of `linear` with K2 = gain(measurement) at each sample, recorded as `gain`."""
        law = HubFeedback(K1=K1, Kp=Kp)

        def torque(m: Measurement) -> tuple[float, float]:
            K = float(gain(m))
            return m.feedforward + m.servo(law) - K * m.vibration, K

        return self._stepped(torque, np.zeros(self.scenario.feedforward.size))

    def finer(self, between: int) -> Self:
        """The same with `between` records in each sample."""
        other = copy(self)
        other.between = between
        other._model = other._prepared()
        return other

    def modal(self) -> tuple[Complex, Complex]:
        """Poles (m,) [1/s] with Im p >= 0, and their weights in hub angle, rate, moment and tip (4, m)."""
        return self.plant.poles[self._kept], self._model.weights[len(self.measured) :][: len(RECORDED)]

    def first_amplitudes(self) -> Complex:
        """The modal amplitudes (m,) after the sample at t = 0 and the impulse."""
        return self._at_first() + self.scenario.impulse

    # ------------------------------------------------------------ inside

    def _stepped(self, rule: Callable[[Measurement], tuple[float, float]], gain: Real | None) -> Simulation:
        """The loop of `kernel.run` in Python."""
        state, memory, of, forcing = self._start(), np.zeros(3), self._electronics, self._forcing
        for k in range(state.torque.size):
            if not kernel.before(k, self._model, state, forcing, of):
                return self._result(state, k, gain)
            angle, rate, moment = kernel.converted(state.record[k], state.saturated[k], memory, of)
            *wanted, rigid = self._wanted[k, : len(AT_HUB)].tolist()
            values = [angle, rate, moment, moment - rigid, float(forcing.feedforward[k]), *wanted, rigid]
            if of.is_single:
                values = [float(np.float32(value)) for value in values]
            u, K = rule(Measurement(k, k * self.scenario.period, *values))
            if not math.isfinite(u):
                raise ParameterError(key="controller", value=u, remedy=f"its torque at sample {k} is not finite")
            kernel.after(k, float(np.float32(u)) if of.is_single else u, self._model, state, forcing, of)
            if gain is not None:
                gain[k] = K
        return self._result(state, state.torque.size, gain)

    def _start(self) -> kernel.State:
        n, outputs = self.scenario.feedforward.size, len(self.plant.outputs)
        return kernel.State(
            amplitude=self._at_first(),
            rigid=np.zeros(2),
            held=np.zeros(self.chain.sampling.whole_delay + 2),
            work=np.zeros(2),
            record=np.zeros((n, outputs)),
            torque=np.zeros(n),
            fine=np.zeros((n, self.between, outputs)),
            saturated=np.zeros((n, 3), np.bool_),
        )

    def _at_first(self) -> Complex:
        """The modal amplitudes (m,) at t = 0: 0, or of the first mode at rest with the tip displaced.

        a = i x/(p r), x = offset |p|^2/(2 Im p).
        """
        amplitude: Complex = np.zeros(self._kept.size, complex)
        if offset := self.scenario.tip_offset:
            poles, tip = self.plant.poles[self._kept], self.plant.residues[self.plant.outputs.index("tip_displacement")]
            first = np.flatnonzero((self.plant.mode[self._kept] == 1) & (poles.imag > 0) & (tip[self._kept] != 0))[:1]
            if not first.size:
                remedy = "no free decay: the tip is pinned, or the first mode is overdamped; take another scenario"
                raise ParameterError(key="scenario", value="decay", remedy=remedy)
            p, r = poles[first], tip[self._kept][first]
            amplitude[first] = 1j * offset * abs(p) ** 2 / (2 * p.imag) / (p * r)
        return amplitude

    def _energy(self, amplitude: Complex, rate: float) -> float:
        """Energy of an undamped arm [J]: b^2 |a|^2/2 a mode, b^2 twice the residue of the hub rate, and rigid."""
        row = self.plant.outputs.index("hub_rate", len(self.measured))
        rigid = self.plant.rigid[row, 1] * rate**2 / 2
        return float(self.plant.residues[row, self._kept].real @ abs(amplitude) ** 2 + rigid)

    def _result(self, state: kernel.State, done: int, gain: Real | None) -> Simulation:
        """The record of `done` samples."""
        stopped, error = None, None
        if done < state.torque.size:
            of_root = np.nan_to_num(abs(self.plant.residues[kernel.MOMENT, self._kept] * state.amplitude), nan=np.inf)
            stopped = Stop(done * self.scenario.period, int(self.plant.mode[self._kept][int(np.argmax(of_root))]))
        elif self.plant.arm.is_undamped and not self.chain.actuator.hub_damping > 0:
            before = self._energy(self.first_amplitudes(), self.scenario.impulse)
            after, (work, moved) = self._energy(state.amplitude, state.rigid[kernel.ONCE]), state.work
            error = float(abs(after - before - work) / max(before + moved, LEAST_SIZE))
        T, m = self.scenario.period, self.between
        between = None
        if m:
            at = T * (np.arange(done)[:, None] + (np.arange(m) + 1) / (m + 1))
            between = self._trace(at.ravel(), state.fine[:done].reshape(done * m, -1))
        return Simulation(
            scenario=self.scenario,
            chain=self.chain,
            at_samples=self._trace(self.scenario.t[:done], state.record[:done]),
            between=between,
            measured=state.record[:done, : len(AT_HUB)],
            torque=state.torque[:done],
            gain=None if gain is None else gain[:done],
            saturated_at=state.saturated[:done],
            energy_error=error,
            stopped=stopped,
        )

    def _prepared(self) -> kernel.Model:
        """The plant for the compiled loop, with the records between two samples."""
        row = self.plant.outputs.index("hub_angle", len(self.measured))
        return kernel.model_of(self.plant, self._kept, self.chain.sampling, self.between, row)

    def _trace(self, t: Real, record: Real) -> Trace:
        """The recorded outputs."""
        angle, rate, moment, tip, *more = (np.ascontiguousarray(column) for column in record[:, len(self.measured) :].T)
        return Trace(t, angle, rate, moment, tip, dict(zip(self.others, more, strict=True)))


def references_of(law: Law, task: Scenario) -> Real:
    """Return the reference of each column of the law at each sample (n, columns), negative of a reference column.

    Raises ParameterError for a signal whose reference a scenario does not have.
    """
    known = task.references
    found = np.zeros((task.feedforward.size, len(law.signals) + len(law.wanted)))
    for column, name in enumerate((*law.signals, *law.wanted)):
        plain = name.removeprefix(REFERENCE)
        if name == plain and name not in law.references:
            continue
        must_be_known("references", plain, known)
        found[:, column] = known[plain] if name == plain else -known[plain]
    return found
