"""A trial: the slew of an arm under u - K x, for the compiled loop, and its cost.

    E(t) = a x(t)^2/2 + b e(t)^2/2,   e = u - K x   (23);   cost of a trial: T times the sum of E over its samples

x is the root moment, u the control input, K the gain on the moment (K2 of the law (19)).  Their content during the slew
is not defined in the paper; there are two readings:

    vibration   x: the moment less the rigid arm's; torque = J theta_dd_ref + e;
                u = Kp (theta_ref - theta) + K1 (theta_t_ref - theta_t)
    total       x: the whole moment; u has the feedforward J theta_dd_ref too; torque = e

The paper's law has Kp = 0: the angle is then free, and has a steady-state error after the slew.

The trained network is a controller: a gain schedule of `tfarm.dsp.Simulator`, with converters, delay, on any arm.

Its file is JSON: strict, finite, of matching shapes; never pickle.
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import Field

from tfarm.arm import FED_BACK, MOMENT_GAIN, Arm, HubFeedback, must_not_be_algebraic
from tfarm.arm.chain import MomentReading
from tfarm.arm.checks import check_annotated, not_negative, positive
from tfarm.arm.schema import StrictTable, validated_file
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.dsp import Chain, Measurement, Scenario, Simulation, Simulator, scenario
from tfarm.dsp.scenarios import TRIAL_COST, TRIAL_DURATION
from tfarm.dsp.simulate import largest_moment
from tfarm.dsp.stages import admit
from tfarm.errors import must_be_known, name_file, require
from tfarm.files import write_file
from tfarm.loop.sampled import Sampled, sampled_loop
from tfarm.records import frozen
from tfarm.spectrum.gains import default_gains
from tfarm.tuner import kernel
from tfarm.tuner.guard import GuardKind
from tfarm.tuner.kernel import CONSUMER, PAPER_INPUTS, Limits, Network

# flexible modes of a trial, by default
TRIAL_MODES = 6
ANGLE_REMEDY = "the hub angle gain is zero or positive, in N m/rad"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Weighting coefficients `a` [1/(N m)^2 s], of the root moment, and `b`, of the control signal e."""

    a: Annotated[float, not_negative, "the weighting coefficient a is zero or positive"] = TRIAL_COST[0]
    b: Annotated[float, not_negative, "the weighting coefficient b is zero or positive"] = TRIAL_COST[1]

    def __post_init__(self) -> None:
        check_annotated(self, "")
        require(self.a or self.b, "a", self.a, "a and b are both zero: one of them has to be positive")


@frozen
class Record:
    """The signals of a trial at its samples: `x`, `u`, `e` [N m], gain `K`; `stopped`: the sample where it diverged.

    `x` is the input of the controller, through the anti-alias filter and less its reference; `moment` [N m] is the
    arm's own at the root.
    """

    t: Real
    x: Real
    u: Real
    e: Real
    K: Real
    moment: Real
    cost: float
    stopped: int | None


@frozen
class Trial:
    """An arm's loop with `K1` and `Kp`, a chain whose converters are taken as ideal, a slew `task` and a cost.

    The references are in `task` alone, so the slew of one arm may be that of another one's loop.
    """

    loop: Sampled
    task: Scenario
    cost: Cost
    signals: MomentReading

    @property
    def arm(self) -> Arm:
        """The moving arm."""
        return self.loop.plant.arm

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.task.feedforward.size

    @cached_property
    def model(self) -> kernel.TrialModel:
        """The loop from sample to sample, open at the torque, and the rows of the servo and the moment."""
        loop = self.loop
        last = loop.pulse.integrals_at + 2
        A, drive = loop.rig.frame
        # the last state is the torque of the last sample: B is 1 there
        servo = -loop.with_number("K2", 0.0).matrix()[last]
        moment = -loop.times(0.0).with_number("K2", 1.0).matrix()[last]
        own = loop.rig.sensed.own_moment(loop.chain.sampling)
        own = np.pad(own, (0, drive.size - own.size))
        return kernel.TrialModel(
            *(np.ascontiguousarray(each) for each in (A.T, A, drive, servo, moment, own))
        )

    @cached_property
    def reference(self) -> kernel.Reference:
        """The references at each sample."""
        task = self.task
        gains = self.loop.gains
        none = np.zeros(self.n)
        counted, rest = (task.feedforward, none) if self.signals == "total" else (none, task.feedforward)
        wanted = gains.Kp * task.hub_angle + gains.K1 * task.hub_rate
        return kernel.Reference(wanted, counted, rest, task.moment_reference)

    @cached_property
    def numbers(self) -> kernel.Numbers:
        """The cost's weights, the period, the largest moment, and when and how x follows a torque."""
        model = self.model
        sampling = self.loop.chain.sampling
        delay = sampling.whole_delay
        reply = float(model.moment @ np.linalg.matrix_power(model.A, delay) @ model.B)
        return kernel.Numbers(
            self.cost.a, self.cost.b, sampling.period, largest_moment(self.arm), 1 + delay, reply
        )

    def setting(self, network: Network, guard: kernel.Limits) -> kernel.Setting:
        """Return the arguments of the compiled loops, without weights."""
        return kernel.Setting(self.model, self.reference, self.numbers, network.scales, guard)

    @property
    def case(self) -> Case:
        """The arm under its servo with a moment gain of 1, and the chain."""
        return Case(self.arm, self.loop.gains, self.loop.chain)

    def on(self, case: Case) -> Trial:
        """Return the same slew in another case, with the references of this one's arm."""
        return replace(self, loop=sampled_loop(case, count=self.loop.plant.count))

    def simulator(self, chain: Chain | None = None) -> Simulator:
        """Return a simulator of the loop, with the converters of a chain, by default that of the trial."""
        case = self.case if chain is None else self.case.through(chain)
        return Simulator(case, self.task, count=self.loop.plant.count)

    def room(self, network: Network) -> tuple[kernel.TrialSignals, kernel.SampleBuffers]:
        """Return an empty record and buffers of a trial with that network."""
        hidden, inputs = network.W1.shape
        n = self.n
        states = self.model.B.size
        run = kernel.TrialSignals(np.zeros((n, inputs)), np.zeros((n, hidden)), *np.zeros((6, n)))
        return run, kernel.SampleBuffers(np.zeros(states), np.zeros(states), np.zeros(inputs))

    # ------------------------------------------------------------ one trial

    def with_network(self, network: Network, guard: kernel.Limits) -> Record:
        """Return the trial with a fixed network; the cost is inf where it was stopped."""
        run, work = self.room(network)
        done = int(kernel.forward(self.setting(network, guard), network.weights, run, work))
        is_whole = done == self.n
        cost = float(kernel.trial_cost(done, self.numbers, run)) if is_whole else math.inf
        return Record(
            t=self.task.t[:done],
            x=run.x[:done],
            u=run.u[:done],
            e=run.e[:done],
            K=run.K[:done],
            moment=run.moment[:done],
            cost=cost,
            stopped=None if is_whole else done,
        )

    def with_constant(self, K: float) -> Record:
        """Return the trial with a constant gain: a guard of one gain, for any network."""
        silent = Network(np.zeros((1, PAPER_INPUTS)), np.zeros(1), np.ones(PAPER_INPUTS))
        return self.with_network(silent, kernel.Limits(K, K))


def slew_trial(
    arm: Arm,
    chain: Chain | None = None,
    *,
    K1: float | None = None,
    Kp: float = 0.0,
    cost: Cost | None = None,
    signals: MomentReading = "vibration",
    duration: float = TRIAL_DURATION,
    count: int = TRIAL_MODES,
) -> Trial:
    """Return the slew of an arm with `count` flexible modes; a shaper is for the poles without moment feedback.

    `K1` is by default that of `default_gains`, or with a `Kp` that of `usual_rate_gain`.  Raises ParameterError for an
    arm that cannot turn, a hub without inertia, and numbers out of range.
    """
    must_be_known("signals", signals, get_args(MomentReading))
    Kp = not_negative("Kp", Kp, ANGLE_REMEDY)
    arm, chain = admit(CONSUMER, arm, chain)
    gains = HubFeedback(K1=usual_rate_gain(arm, Kp) if K1 is None else K1, K2=1.0, Kp=Kp)
    length = positive("duration", duration, "a trial lasts a positive number of seconds")
    chain = with_signals(chain, signals)
    must_not_be_algebraic(arm, "hub.inertia", 0.0)
    task = scenario("slew", arm, chain, length, gains.with_number(MOMENT_GAIN, 0.0))
    end = task.busy_until
    require(length >= end, "duration", length, f"a trial lasts at least as long as its slew, {end:g} s")
    loop = sampled_loop(Case(arm, gains, chain), count=count)
    return Trial(loop, task, Cost() if cost is None else cost, signals)


def usual_rate_gain(arm: Arm, Kp: float) -> float:
    """Return K1 [N m s/rad] of `default_gains`, or with Kp > 0 that of damping ratio 1/sqrt(2) of the rigid arm.

    J theta_tt + (K1 + losses) theta_t + Kp theta = 0 has that ratio with K1 + losses = sqrt(2 Kp J).  Raises
    ParameterError for a Kp below zero.
    """
    Kp = not_negative("Kp", Kp, ANGLE_REMEDY)
    if Kp == 0.0:
        return default_gains(arm).K1
    return max(0.0, math.sqrt(2 * Kp * arm.turned_inertia) - arm.rate_loss)


def with_signals(chain: Chain, signals: MomentReading) -> Chain:
    """Return the chain with that reading of the moment during the slew."""
    return replace(chain, slew=replace(chain.slew, reading=signals))


def residual_rms(record: Record, task: Scenario) -> float | None:
    """Return the root mean square of the arm's own root moment less the rigid arm's [N m], from the end of the slew on.

    None of an unstable loop.
    """
    return task.residual_rms(record.moment)


Finite = Annotated[float, Field(allow_inf_nan=False)]


@dataclass
class TunedGain:
    """K for each measurement, from u, e, x and K of the last two samples, reset at sample 0.

    `servo` is the law without moment feedback.
    """

    network: Network
    guard: Limits
    servo: HubFeedback
    signals: MomentReading
    _past: tuple[float, ...] = field(default=(), init=False)

    def run(self, simulator: Simulator) -> Simulation:
        """Simulate the servo and this gain."""
        return simulator.gain_schedule(self.servo.K1, self, Kp=self.servo.Kp)

    def __call__(self, m: Measurement) -> float:
        """Return the gain at this sample."""
        if m.k == 0:
            self._past = (0.0,) * 5
        u1, e1, x1, K1, e2 = self._past
        x = m.vibration
        u = m.servo(self.servo) + (m.feedforward if self.signals == "total" else 0.0)
        row = np.array([u, u1, e1, e2, x, x1, K1][: self.network.scales.size])
        K = self.network.gain(row, self.guard)
        self._past = u, u - K * x, x, K, e1
        return K


def record_of_simulation(simulation: Simulation, cost: Cost, signals: MomentReading) -> Record:
    """Return a simulation as a record of a trial: x before the converters, e from the torque after them.

    So x has passed the anti-alias filter where there is one, but no quantisation.
    """
    task = simulation.scenario
    done = simulation.torque.size
    is_whole = simulation.stopped is None
    x = simulation.measured[:, FED_BACK.index("root_moment")] - task.moment_reference[:done]
    e = simulation.torque - (signals != "total") * task.feedforward[:done]
    K = np.zeros(done) if simulation.gain is None else simulation.gain
    total = float(task.period * np.sum(cost.a * x**2 + cost.b * e**2) / 2) if is_whole else math.inf
    moment = simulation.at_samples.root_moment
    return Record(simulation.t, x, e + K * x, e, K, moment, total, None if is_whole else done)


def tip_off(simulation: Simulation, trial: Trial) -> float | None:
    """Return the distance of the tip from its target [m] at the end of a simulated slew; None of an unstable loop."""
    if simulation.stopped is not None:
        return None
    travel = trial.loop.chain.slew.travel_of(trial.arm.reach)
    return float(simulation.at_samples.tip_displacement[-1] - travel)


class SavedTuner(StrictTable):
    """A tuner, as in its file: K1 and Kp of the servo, weights of the network, arm and period of the training.

    `guard` is the interval of its gain, None without one; `a` and `b` weigh moments and torques in units of the first
    of the `scales` [N m].
    """

    format: Literal["tfarm tuner 1"]
    arm: Annotated[str, Field(max_length=80)]
    period: Annotated[Finite, Field(gt=0)]
    K1: Finite
    # absent in files of tuners without a servo
    Kp: Annotated[Finite, Field(ge=0)] = 0.0
    signals: MomentReading
    a: Finite
    b: Finite
    guard_kind: GuardKind
    guard: tuple[Finite, Finite] | None
    scales: list[Finite]
    W1: list[list[Finite]]
    w2: list[Finite]

    @property
    def network(self) -> Network:
        """The network.  Raises ParameterError where its parts do not match."""
        widths = {len(row) for row in self.W1}
        inputs = len(self.scales)
        require(widths == {inputs}, "W1", sorted(widths), f"rows of {inputs}, one weight an input")
        return Network(np.array(self.W1), np.array(self.w2), np.array(self.scales))

    def gain(self) -> TunedGain:
        """Return the controller.  Raises ParameterError where the parts of the tuner do not match."""
        is_free = self.guard_kind == "none"
        require(
            (self.guard is None) == is_free, "guard", self.guard, "two ends, or null with guard_kind none"
        )
        limits = Limits(*(self.guard or (0.0, math.inf)))
        require(0 <= limits.lo < limits.hi, "guard", self.guard, "its lower end, from 0 on, comes first")
        return TunedGain(self.network, limits, HubFeedback(K1=self.K1, Kp=self.Kp), self.signals)


def to_text(tuner: SavedTuner) -> str:
    """Return the text of a tuner's file; equal tuners give equal text, and it loads to the same bits."""
    numbers = tuner.model_dump(exclude_defaults=True)
    return json.dumps(numbers, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def save_tuner(tuner: SavedTuner, path: Path) -> None:
    """Write a tuner's file, atomically."""
    write_file(path, to_text(tuner).encode(), key="--save")


def load_tuner(path: str | os.PathLike[str], key: str = "controller") -> SavedTuner:
    """Read the tuner of a file.  Raises ParameterError, in one line, for the first problem of the file."""
    # more bytes than a network of the most neurons takes
    most = 4_000_000
    found = validated_file(
        SavedTuner, path, most, key=key, what="a tuner's file of tfarm tune ARM --save FILE.json"
    )
    with name_file(path):
        # refuses parts that do not match
        found.gain()
        Cost(a=found.a, b=found.b)
    return found
