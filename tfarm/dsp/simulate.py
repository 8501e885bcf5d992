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
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from tfarm.arm import ANGLE_GAIN, AT_HUB, RATE_GAIN, Arm, HubFeedback
from tfarm.arm.chain import Chain
from tfarm.arm.checks import whole
from tfarm.arm.law import REFERENCE, Law, of_common_blocks
from tfarm.arrays import LEAST_SIZE, Complex, Real
from tfarm.case import Case
from tfarm.dsp import kernel
from tfarm.dsp.discretise import acting_law, back_calculation, system_matrix
from tfarm.dsp.plant import RECORDED, USUAL_MODES, Plant, with_held_filter
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.sensed import sensed_plant
from tfarm.dsp.simulation import Simulation, Stop, Trace
from tfarm.dsp.stages import admit
from tfarm.errors import must_be_known, require
from tfarm.records import frozen

# records between two samples
MOST_BETWEEN = 1000


def quantisers(chain: Chain) -> Real:
    """Return step, lowest and highest value (3, 3) of a chain's encoder, strain amplifier and DAC, in `kernel`'s rows.

    A step of 0 is ideal; the torque's range also respects the motor's limit.
    """
    of = chain.converters
    limit = chain.actuator.torque_limit
    encoder = [2 * math.pi / of.encoder_counts if of.encoder_counts else 0.0, -math.inf, math.inf]
    step, low, high = _converter(of.torque_bits, of.torque_range)
    return np.array(
        [encoder, _converter(of.moment_bits, of.moment_range), [step, max(low, -limit), min(high, limit)]]
    )


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
        """Return the input [N m] of a law by the errors of the hub's angle and rate."""
        angle_off = self.angle_reference - self.hub_angle
        rate_off = self.rate_reference - self.hub_rate
        return law[ANGLE_GAIN] * angle_off + law[RATE_GAIN] * rate_off


ControlFunction = Callable[[Measurement], float]


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
        self.law, self.chain = acting_law(case, of_common_blocks(case.in_computer))
        # raises for one that is missing
        references_of(self.law, scenario)
        self.scenario = scenario
        self.between = between
        self.others = tuple(dict.fromkeys(name for name in outputs if name not in RECORDED))
        self.measured = tuple(dict.fromkeys((*AT_HUB, *self.law.signals)))
        sensed = sensed_plant(arm, chain, self.measured, count)
        plant = sensed.together
        for names in filter(None, (RECORDED, self.others)):
            plant = plant.join(sensed_plant(arm, chain, names, count).unfiltered)
        self.plant = plant
        self._first: Complex = np.zeros(plant.poles.size, complex)
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
            bound=largest_moment(arm),
        )

    def run(self) -> Simulation:
        """Simulate the law over the scenario, from its start."""
        return self._run_law(self.law, self.gains)

    def linear(self, gains: HubFeedback) -> Simulation:
        """Simulate u = r + gains . (wanted - measured) instead of the simulator's own law.

        Raises ParameterError for I_h = 0 with moment feedback.
        """
        law, _ = acting_law(self.case.under(gains))
        return self._run_law(law, gains)

    def _run_law(self, law: Law, gains: HubFeedback | None) -> Simulation:
        """Simulate a law in z over the scenario; `gains` are its gains at the hub, if it is of these."""
        columns = (*law.signals, *law.wanted)
        kind = np.float32 if self.electronics.is_single else float
        table = system_matrix(law).astype(kind).astype(float)
        back = back_calculation(law, self.electronics.quantisers[kernel.DAC, 1:]).astype(kind).astype(float)
        sources = np.array([self.measured.index(name) if name in self.measured else -1 for name in columns])
        references = references_of(law, self.scenario)
        state = self._start()
        done = kernel.run_samples(
            self.model, state, self._forcing, self.electronics, table, back, sources, references
        )
        return self._result(state, int(done), None if gains is None else np.full(state.torque.size, gains.K2))

    def controller(self, controller: ControlFunction) -> Simulation:
        """Simulate a callable from a `Measurement` to a torque [N m]; its numbers are float32 if the arithmetic is."""
        return self._run_rule(lambda m: (float(controller(m)), 0.0), None)

    def gain_schedule(self, K1: float, gain: Callable[[Measurement], float], Kp: float = 0.0) -> Simulation:
        """Simulate the law of `linear` with K2 = gain(measurement) at each sample, recorded as `gain`."""
        law = HubFeedback(K1=K1, Kp=Kp)

        def torque(m: Measurement) -> tuple[float, float]:
            K = float(gain(m))
            return m.feedforward + m.servo(law) - K * m.vibration, K

        return self._run_rule(torque, np.zeros(self.scenario.feedforward.size))

    def finer(self, between: int) -> Self:
        """Return the same with `between` records in each sample."""
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

    def _run_rule(self, rule: Callable[[Measurement], tuple[float, float]], gain: Real | None) -> Simulation:
        """Simulate a rule from a measurement to a torque and a gain: the loop of `kernel.run_samples` in Python."""
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
            if not kernel.read_before(k, model, state, forcing, of):
                return self._result(state, k, gain)
            angle, rate, moment = kernel.convert_outputs(state.record[k], state.saturated[k], memory, of)
            values = angle, rate, moment, moment - references[k][-1], *references[k]
            u, K = rule(Measurement(k, k * task.period, *map(number, values)))
            require(math.isfinite(u), "controller", u, f"its torque at sample {k} is not finite")
            kernel.advance_after(k, number(u), model, state, forcing, of)
            if gain is not None:
                gain[k] = K
        return self._result(state, state.torque.size, gain)

    def _start(self) -> kernel.State:
        n = self.scenario.feedforward.size
        state = kernel.rest(self.model, n, self.chain.sampling.whole_delay)
        return state._replace(amplitude=self._first[self.kept])

    def _release(self, unfiltered: Plant, offset: float) -> None:
        """Displace the tip in the first mode, at rest: analog filters start from the value that they were held at.

        `unfiltered` are the measured signals ahead of the filters.
        """
        plant = self.plant
        first, amplitude = first_mode(plant, offset)
        n = len(self.measured)
        held = np.zeros(len(plant.outputs))
        self._first[first] = amplitude
        held[:n] = 2 * ((unfiltered.residues[:, first] - plant.residues[:n, first]) * amplitude).real
        if held.any():
            self.plant = with_held_filter(plant, held)
            self._first = np.r_[self._first, 1.0]

    def _energy(self, amplitude: Complex, rate: float) -> float:
        """Return the energy of an undamped arm [J]: b^2 |a|^2/2 a mode, b^2 twice the hub rate's residue, and rigid."""
        row = self.plant.outputs.index("hub_rate", len(self.measured))
        rigid = self.plant.rigid[row, 1] * rate**2 / 2
        return float(self.plant.residues[row, self.kept].real @ abs(amplitude) ** 2 + rigid)

    def _result(self, state: kernel.State, done: int, gain: Real | None) -> Simulation:
        """Return the record of `done` samples."""
        stopped = None
        error = None
        plant = self.plant
        task = self.scenario
        kept = self.kept
        T = task.period
        if done < state.torque.size:
            shares = abs(plant.residues[kernel.MOMENT, kept] * state.amplitude)
            largest = int(np.argmax(np.nan_to_num(shares, nan=np.inf)))
            stopped = Stop(done * T, int(plant.mode[kept][largest]))
        elif plant.arm.is_undamped and not self.chain.actuator.hub_damping > 0:
            before = self._energy(self._first[kept] + task.impulse, task.impulse)
            after = self._energy(state.amplitude, state.rigid[kernel.Integral.SINGLE])
            work, moved = state.work
            error = float(abs(after - before - work) / max(before + moved, LEAST_SIZE))
        p = plant.poles[kept]
        is_ringing = p.imag > -p.real
        weights = self.model.weights[len(self.measured) :][: len(RECORDED), is_ringing]
        size = abs(weights) * np.sqrt(state.circle[is_ringing])
        between = None
        if m := self.between:
            at = T * (np.arange(done)[:, None] + (np.arange(m) + 1) / (m + 1))
            between = self._trace(at.ravel(), state.fine[:done].reshape(done * m, -1))
        return Simulation(
            scenario=task,
            chain=self.chain,
            at_samples=self._trace(task.t[:done], state.record[:done]),
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
        """Return the recorded outputs."""
        angle, rate, moment, tip, *more = np.ascontiguousarray(record[:, len(self.measured) :].T)
        return Trace(t, angle, rate, moment, tip, dict(zip(self.others, more, strict=True)))


@frozen
class LinearLoop:
    """A law in z round a plant, whose outputs begin with those `AT_HUB`, through the converters of a chain."""

    plant: Plant
    law: Law
    chain: Chain

    @property
    def columns(self) -> tuple[str, ...]:
        """The signals of the law, then its references."""
        return *self.law.signals, *self.law.wanted

    @cached_property
    def _model(self) -> kernel.SampleModel:
        kept = np.nonzero(self.plant.poles.imag >= 0)[0]
        row = self.plant.outputs.index("hub_angle")
        return kernel.model_of(self.plant, kept, self.chain.sampling, 0, row)

    @cached_property
    def _table(self) -> Real:
        return system_matrix(self.law)

    def input(self, references: Real, disturbance: Real) -> Real:
        """Return the input (n,) from rest under references (n, columns), and a disturbance (n,) on the hub."""
        chain = self.chain
        sampling = chain.sampling
        model = self._model
        n = disturbance.size
        outputs = self.plant.outputs
        sources = np.array([outputs.index(name) if name in outputs else -1 for name in self.columns])
        electronics = kernel.Electronics(
            quantisers=quantisers(chain),
            is_differenced=chain.converters.hub_rate == "difference",
            pole=math.exp(-chain.converters.rate_filter * sampling.period),
            period=float(sampling.period),
            delay=sampling.whole_delay,
            is_single=chain.converters.is_single,
            bound=math.inf,
        )
        state = kernel.rest(model, n, sampling.whole_delay)
        kernel.run_samples(
            model,
            state,
            kernel.Forcing(np.zeros(n), disturbance, 0.0),
            electronics,
            self._table,
            back_calculation(self.law, electronics.quantisers[kernel.DAC, 1:]),
            sources,
            references,
        )
        return state.torque

    def input_alone(self, errors: Real) -> Real:
        """Return the input (n,) of the law alone, from rest, of errors (n, columns)."""
        return np.asarray(kernel.law_outputs(self._table, errors))


def largest_moment(arm: Arm) -> float:
    """Return the root moment [N m] at which a simulation stops: EI/L by 10 rad, far beyond small deflections."""
    return float(10.0 * arm.bending_scale)


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
