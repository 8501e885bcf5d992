"""Simulation of the sampled loop: exact between the samples, with any controller, recorded at the samples and between.

A signal among a law's references enters as signal - reference: those of the hub's angle and rate are the slew's, that
of the root moment is the rigid arm's.  A column "reference:hub_angle" is the reference alone.  The encoder's counts
and the strain amplifier's range act on hub angle and root moment; other signals are read without a converter.

A signal is rounded to the nearest step (mid-tread) and clipped to the codes of its bits in two's complement:
-2^(b-1) .. 2^(b-1) - 1 steps of 2 R / 2^b.  An ideal converter has step 0.
"""

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import ANGLE_GAIN, AT_HUB, RATE_GAIN, HubFeedback
from tfarm.arm.chain import TIME_ROUNDING, Chain
from tfarm.arm.checks import whole
from tfarm.arm.law import REFERENCE, Law
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.case import Case
from tfarm.dsp import kernel
from tfarm.dsp.discretise import acting_law, system_matrix
from tfarm.dsp.plant import RECORDED, USUAL_MODES, Plant, sensed_plant, with_held_filter
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.stages import admit
from tfarm.errors import must_be_known, require
from tfarm.exact.outputs import OUTPUTS
from tfarm.records import frozen
from tfarm.schema import Quantity

# rad: the simulation stops at the root moment EI/L times this, far beyond small deflections
FOLDED_UP = 10.0
# records between two samples
MOST_BETWEEN = 1000
RESIDUAL = "residual root moment after the slew"
# of the travel, within which a signal has settled: as in python-control and MATLAB
SETTLING_BAND = 0.02
# a tenth of a record has to follow a settling time
LEFT_OF_RECORD = 10


def quantisers(chain: Chain) -> Real:
    """Step, lowest and highest value (3, 3) of a chain's encoder, strain amplifier and DAC, as `kernel` numbers them.

    A step of 0 is ideal; the torque's range also respects the motor's limit.
    """
    of = chain.converters
    limit = chain.actuator.torque_limit
    encoder = [2 * math.pi / of.encoder_counts if of.encoder_counts else 0.0, -math.inf, math.inf]
    step, low, high = _converter(of.torque_bits, of.torque_range)
    return np.array(
        [encoder, _converter(of.moment_bits, of.moment_range), [step, max(low, -limit), min(high, limit)]]
    )


def final_value(t: Real, y: Real) -> float:
    """Mean of a signal (n,) over the last tenth of its record."""
    return float(y[LEFT_OF_RECORD * t >= (LEFT_OF_RECORD - 1) * t[-1]].mean())


def settling_time(
    t: Real, away: Real, scale: float = 0.0, moves_until: float = 0.0, band: float = SETTLING_BAND
) -> float | None:
    """Time [s] from the end of the motion after which deviations (n,) from the final value stay within a band.

    The band is a share of a scale, of the largest deviation where that is 0.  None where the deviation leaves it in the
    last tenth of the record.
    """
    scale = scale or float(away.max(initial=0.0))
    first = 1 + int(np.flatnonzero(away > band * scale).max(initial=-1))
    if first > 0 and (first >= t.size or LEFT_OF_RECORD * (t[-1] - t[first]) < t[-1] * (1 - TIME_ROUNDING)):
        return None
    return max(0.0, float(t[first]) - moves_until)


def _converter(bits: int | None, span: float | None) -> list[float]:
    high = math.inf if span is None else span
    step = 0.0 if bits is None else 2 * high / 2**bits
    return [step, -high, high - step]


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
        angle_off = self.angle_reference - self.hub_angle
        rate_off = self.rate_reference - self.hub_rate
        return law[ANGLE_GAIN] * angle_off + law[RATE_GAIN] * rate_off


ControlFunction = Callable[[Measurement], float]


@frozen
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
        if name in self.others:
            return self.others[name]
        return cast("Real", getattr(self, name))

    @property
    def by_name(self) -> dict[str, Real]:
        """Time and signals by name."""
        return {"t": self.t} | {name: self.signal(name) for name in self.names}

    @property
    def units(
        self,
    ) -> Annotated[dict[str, str], Quantity(key="outputs", help="SI unit of each further output")]:
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


@frozen
class Simulation:
    """A simulated loop: `at_samples` just before each update, `between` the records between the samples, if any.

    `torque` [N m] is the output of the DAC at each sample, `gain` that on the root moment there (None of a controller
    without one), `measured` (n, 3) hub angle, hub rate and root moment behind the analog filters.  `saturated_at`
    (n, 3): whether the encoder, the strain amplifier and the torque were clipped at each sample.  `rings` are frequency
    (m,) [rad/s] and largest amplitude in `RECORDED` (4, m) of the modes that ring, with Im p > -Re p.
    `energy_error` is |energy gained - work done| over initial energy and total work, for an arm without damping; None
    with damping.  Moments of the figures are those before the anti-alias filter.
    """

    scenario: Annotated[Scenario, Quantity(flat=True, help="scenario of the run")]
    chain: Chain
    at_samples: Annotated[Trace, Quantity(flat=True, help="signals at the samples")]
    between: Trace | None
    measured: Real
    torque: Real
    gain: Real | None
    saturated_at: NDArray[np.bool_]
    rings: tuple[Real, Real]
    energy_error: Annotated[
        float | None,
        Quantity(help="energy gained less work done, over initial energy and work, without damping"),
    ]
    stopped: Stop | None

    @property
    def residual_moment(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            f"{RESIDUAL} less the rigid arm's",
            "N m rms",
            key="residual_moment_rms",
            help="rms of the vibration from the end of the slew to the end of the record",
        ),
    ]:
        """The residual; None where the run stopped, or its record ends before the slew."""
        return self.scenario.residual_rms(self.at_samples.root_moment)

    @property
    def residual_raw(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            RESIDUAL,
            "N m rms",
            key="residual_raw_moment_rms",
            help="rms of the root moment from the end of the slew to the end of the record",
        ),
    ]:
        """The same of the root moment itself; its first sample is one of the slew's last torque."""
        rigid = replace(self.scenario, rigid_moment=0 * self.scenario.rigid_moment)
        return rigid.residual_rms(self.at_samples.root_moment)

    @property
    def settling_time(
        self,
    ) -> Annotated[
        float | None,
        Quantity(
            "settling time (2 %)",
            "s",
            4,
            help="time from the end of the motion after which the root moment stays within 2 % of its largest "
            "deviation from its final value",
        ),
    ]:
        """None where the simulation stopped, or less than a tenth of the record is left to show it."""
        moment = self.at_samples.root_moment
        if self.stopped or not moment.size:
            return None
        return settling_time(
            self.t, abs(moment - final_value(self.t, moment)), moves_until=self.scenario.busy_until
        )

    @property
    def saturated(
        self,
    ) -> Annotated[
        dict[str, int],
        Quantity(
            "saturated samples",
            key="saturated_samples",
            help="samples at which encoder, strain amplifier and torque were clipped",
        ),
    ]:
        """Numbers of samples at which encoder, strain amplifier and torque were clipped."""
        return dict(zip(("encoder", "moment", "torque"), self.saturated_at.sum(axis=0).tolist(), strict=True))

    @property
    def finding(self) -> str:
        """End of the run, largest root moment, and clipped signals."""
        end = float(self.t.max(initial=0.0))
        moment = float(abs(self.at_samples.root_moment).max(initial=0.0))
        clipped = [f"{name} clipped at {n} samples" for name, n in self.saturated.items() if n]
        if self.stopped is None:
            ran = f"ran to {end:.6g} s"
        else:
            ran = f"unstable, stopped at {self.stopped.time:.6g} s"
        return ", ".join([ran, f"root moment up to {moment:.4g} N m", *clipped])

    @property
    def t(self) -> Real:
        """The times of the samples [s]."""
        return self.at_samples.t

    @property
    def volts(self) -> Real | None:
        """The motor's voltage, where the actuator has a motor constant."""
        constant = self.chain.actuator.motor_constant
        return None if constant is None else self.torque / constant


class Simulator:
    """A case with `count` modes over a scenario, prepared once; each call simulates it from the start.

    `between` is the number of records in each sample, `outputs` are signals beyond those of `RECORDED`, by name, those
    along the arm with their place [m]: "tip_rotation", "strain@0.05".  Raises ParameterError for a locked hub, for an
    unknown output or signal, one that grows with s without bound, a signal whose reference no scenario has, and as
    `acting_law` does.
    """

    def __init__(
        self,
        case: Case,
        scenario: Scenario,
        *,
        count: int = USUAL_MODES,
        between: int = 0,
        outputs: Sequence[str] = (),
    ) -> None:
        remedy = f"a whole number of records between two samples, 0 to {MOST_BETWEEN}"
        between = whole("between", between, 0, MOST_BETWEEN, remedy)
        arm = case.arm
        chain = case.chain
        admit(kernel.CONSUMER, arm, chain)
        self.case = case
        self.gains = case.gains if case.in_computer.references == AT_HUB else None
        self.law, self.chain = acting_law(case)
        # raises for one that is missing
        references_of(self.law, scenario)
        self.scenario = scenario
        self.between = between
        self.others = tuple(dict.fromkeys(name for name in outputs if name not in RECORDED))
        self.measured = tuple(dict.fromkeys((*AT_HUB, *self.law.signals)))
        sensed = sensed_plant(arm, chain, self.measured, count)
        self.plant = sensed.together
        for names in filter(None, (RECORDED, self.others)):
            self.plant = self.plant.joined(sensed_plant(arm, chain, names, count).unfiltered)
        self._first: Complex = np.zeros(self.plant.poles.size, complex)
        if scenario.tip_offset:
            self._release(sensed.unfiltered, scenario.tip_offset)
        self.kept = np.nonzero(self.plant.poles.imag >= 0)[0]
        self._forcing = kernel.Forcing(scenario.feedforward, scenario.disturbance, float(scenario.impulse))
        c = self.chain.converters
        sampling = self.chain.sampling
        self.electronics = kernel.Electronics(
            quantisers=quantisers(self.chain),
            is_differenced=c.hub_rate == "difference",
            pole=math.exp(-c.rate_filter * sampling.period),
            period=float(sampling.period),
            delay=sampling.whole_delay,
            is_single=c.is_single,
            bound=float(FOLDED_UP * arm.bending_scale),
        )

    def run(self) -> Simulation:
        """Simulate the law over the scenario, from its start."""
        return self._driven(self.law, self.gains)

    def linear(self, gains: HubFeedback) -> Simulation:
        """Simulate u = r + gains . (wanted - measured) instead of the simulator's own law.

        Raises ParameterError for I_h = 0 with moment feedback.
        """
        law, _ = acting_law(self.case.under(gains))
        return self._driven(law, gains)

    def _driven(self, law: Law, gains: HubFeedback | None) -> Simulation:
        """A law in z over the scenario, and its gains at the hub, if it is of these."""
        columns = (*law.signals, *law.wanted)
        kind = np.float32 if self.electronics.is_single else float
        table = system_matrix(law).astype(kind).astype(float)
        sources = np.array([self.measured.index(name) if name in self.measured else -1 for name in columns])
        references = references_of(law, self.scenario)
        state = self._start()
        done = kernel.run_samples(
            self.model, state, self._forcing, self.electronics, table, sources, references
        )
        return self._result(state, int(done), None if gains is None else np.full(state.torque.size, gains.K2))

    def controller(self, controller: ControlFunction) -> Simulation:
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
        vars(other).pop("model", None)
        return other

    # ------------------------------------------------------------ inside

    @cached_property
    def model(self) -> kernel.SampleModel:
        """The plant for the compiled loop, with the records between two samples."""
        row = self.plant.outputs.index("hub_angle", len(self.measured))
        return kernel.model_of(self.plant, self.kept, self.chain.sampling, self.between, row)

    def _stepped(self, rule: Callable[[Measurement], tuple[float, float]], gain: Real | None) -> Simulation:
        """The loop of `kernel.run_samples` in Python."""
        model = self.model
        state = self._start()
        memory = np.zeros(3)
        of = self.electronics
        forcing = self._forcing
        task = self.scenario
        references = np.c_[task.feedforward, task.hub_angle, task.hub_rate, task.moment_reference].tolist()

        def number(value: float) -> float:
            return float(np.float32(value)) if of.is_single else float(value)

        for k in range(state.torque.size):
            if not kernel.before(k, model, state, forcing, of):
                return self._result(state, k, gain)
            angle, rate, moment = kernel.convert_outputs(state.record[k], state.saturated[k], memory, of)
            values = angle, rate, moment, moment - references[k][-1], *references[k]
            u, K = rule(Measurement(k, k * task.period, *map(number, values)))
            require(math.isfinite(u), "controller", u, f"its torque at sample {k} is not finite")
            kernel.after(k, number(u), model, state, forcing, of)
            if gain is not None:
                gain[k] = K
        return self._result(state, state.torque.size, gain)

    def _start(self) -> kernel.State:
        n = self.scenario.feedforward.size
        outputs = len(self.plant.outputs)
        return kernel.State(
            amplitude=self._first[self.kept],
            rigid=np.zeros(2),
            held=np.zeros(self.chain.sampling.whole_delay + 2),
            work=np.zeros(2),
            circle=np.zeros(self.kept.size),
            record=np.zeros((n, outputs)),
            torque=np.zeros(n),
            fine=np.zeros((n, self.between, outputs)),
            saturated=np.zeros((n, 3), np.bool_),
        )

    def _release(self, unfiltered: Plant, offset: float) -> None:
        """Displace the tip in the first mode, at rest: analog filters start from the value that they were held at.

        `unfiltered` are the measured signals ahead of the filters.
        """
        first, amplitude = first_mode(self.plant, offset)
        n = len(self.measured)
        held = np.zeros(len(self.plant.outputs))
        self._first[first] = amplitude
        held[:n] = 2 * ((unfiltered.residues[:, first] - self.plant.residues[:n, first]) * amplitude).real
        if held.any():
            self.plant, self._first = with_held_filter(self.plant, held), np.r_[self._first, 1.0]

    def _energy(self, amplitude: Complex, rate: float) -> float:
        """Energy of an undamped arm [J]: b^2 |a|^2/2 a mode, b^2 twice the residue of the hub rate, and rigid."""
        row = self.plant.outputs.index("hub_rate", len(self.measured))
        rigid = self.plant.rigid[row, 1] * rate**2 / 2
        return float(self.plant.residues[row, self.kept].real @ abs(amplitude) ** 2 + rigid)

    def _result(self, state: kernel.State, done: int, gain: Real | None) -> Simulation:
        """The record of `done` samples."""
        stopped = None
        error = None
        if done < state.torque.size:
            of_root = np.nan_to_num(
                abs(self.plant.residues[kernel.MOMENT, self.kept] * state.amplitude), nan=np.inf
            )
            stopped = Stop(
                done * self.scenario.period, int(self.plant.mode[self.kept][int(np.argmax(of_root))])
            )
        elif self.plant.arm.is_undamped and not self.chain.actuator.hub_damping > 0:
            before = self._energy(self._first[self.kept] + self.scenario.impulse, self.scenario.impulse)
            after = self._energy(state.amplitude, state.rigid[kernel.ONCE])
            work, moved = state.work
            error = float(abs(after - before - work) / max(before + moved, LEAST_SIZE))
        p = self.plant.poles[self.kept]
        weights = self.model.weights[len(self.measured) :][: len(RECORDED)]
        is_ringing = p.imag > -p.real
        size = abs(weights[:, is_ringing]) * np.sqrt(state.circle[is_ringing])
        T = self.scenario.period
        m = self.between
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
            rings=(np.asarray(p.imag[is_ringing]), np.asarray(size)),
            energy_error=error,
            stopped=stopped,
        )

    def _trace(self, t: Real, record: Real) -> Trace:
        """The recorded outputs."""
        angle, rate, moment, tip, *more = np.ascontiguousarray(record[:, len(self.measured) :].T)
        return Trace(t, angle, rate, moment, tip, dict(zip(self.others, more, strict=True)))


def first_mode(plant: Plant, offset: float, scenario: str = "decay") -> tuple[int, complex]:
    """Return the pole p of the first mode, by its place, and its amplitude at rest with the tip displaced by `offset`.

    a = i x/(p r), x = offset |p|^2/(2 Im p), r the residue of the tip displacement.  Raises ParameterError where the
    tip is pinned or the mode overdamped.
    """
    tip = plant.residues[plant.outputs.index("tip_displacement")]
    found = np.flatnonzero((plant.mode == 1) & (plant.poles.imag > 0) & (tip != 0))
    remedy = "no free decay: the tip is pinned, or the first mode is overdamped; take another scenario"
    require(found.size, "scenario", scenario, remedy)
    first = int(found[0])
    p = complex(plant.poles[first])
    r = complex(tip[first])
    return first, 1j * offset * abs(p) ** 2 / (2 * p.imag) / (p * r)


def references_of(law: Law, task: Scenario) -> Real:
    """Return the reference of each column of the law at each sample (n, columns), negative of a reference column.

    Raises ParameterError for a signal whose reference a scenario does not have.
    """
    known = dict.fromkeys(law.signals, np.zeros(task.feedforward.size))
    for names, prefix, sign in ((law.references, "", 1.0), (law.wanted, REFERENCE, -1.0)):
        for name in names:
            plain = name.removeprefix(prefix)
            must_be_known("references", plain, task.references)
            known[name] = sign * task.references[plain]
    return np.stack([known[name] for name in (*law.signals, *law.wanted)], axis=1)
