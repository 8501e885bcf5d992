"""Figures of a simulation: residual vibration, settling time, limit cycles.

The number of flexible modes follows from the signals with twice the modes.  Their largest change, relative to the
largest value of each signal, is the error of half the modes, and mostly more than the error that is left.  It is no
bound: without damping the moment after an impulse converges slowly (of 70 random arms one had nearly twice the change
left).  Instability of high modes is decided by `loop.sampled_verdict`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from tfarm.arm import AnyLaw, Arm
from tfarm.arm.chain import Chain, Converters
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.case import Case, OfCase
from tfarm.dsp.discretise import RULE, rule_in_words
from tfarm.dsp.plant import MODES_USED
from tfarm.dsp.scenarios import TRIAL_DURATION, Scenario, describe_scenario, scenario
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import Simulation, Trace
from tfarm.dsp.traces import resolve_simulations
from tfarm.errors import ConvergenceError
from tfarm.exact.outputs import OUTPUTS
from tfarm.response.signals import ControllerSignals, controller
from tfarm.schema import Column, Quantity, Table


class Enough(NamedTuple):
    """The number of flexible `modes`, and the relative `change` of the signals when it was doubled to that.

    The change is relative to the largest value of each signal; None where the number of modes was given.
    """

    modes: Annotated[int, replace(MODES_USED, key="modes_used")]
    change: Annotated[
        float | None,
        Quantity(
            "change of signals from half of them",
            digits=2,
            key="modes_change",
            help="largest relative change of a signal when the number of modes was doubled",
        ),
    ]

    @property
    def is_converged(self) -> bool:
        """Whether the change is within 1e-4, the digits of a table of a simulation."""
        return self.change is not None and self.change <= 1e-4


def enough_modes(simulate: Callable[[int], Simulation], count: int | None = None) -> Enough:
    """Return the fewest of 20 or 40 modes that change no signal by more than 1e-4, else the most there are; or `count`.

    `simulate` makes the simulation with a number of modes, its converters ideal, as quantisation would hide the modes.
    """
    # flexible modes; 80 would take a heavily damped arm 8 s of CPU time
    mode_counts = (10, 20, 40)
    if count is not None:
        return Enough(count, None)
    before = simulate(mode_counts[0])
    found = Enough(mode_counts[0], np.inf)
    for count in mode_counts[1:]:
        try:
            now = simulate(count)
        except ConvergenceError:
            # two damped modes are not distinguished: the number before is used
            break
        off = change(before.at_samples, now.at_samples)
        before = now
        found = Enough(count, off)
        if found.is_converged:
            break
    return found


def change(before: Trace, after: Trace) -> float:
    """Return the largest change of any signal at the samples of both, relative to that signal's largest value."""
    n = min(before.t.size, after.t.size)
    pairs = [(before.signal(name)[:n], after.signal(name)[:n]) for name in after.names]
    return max(
        float(abs(new - old).max(initial=0.0) / max(abs(new).max(initial=0.0), LEAST_SIZE))
        for old, new in pairs
    )


@dataclass(frozen=True)
class LimitCycle:
    """A sustained vibration: half peak to peak of root moment [N m], hub rate [rad/s] and torque [N m].

    `frequency` [rad/s] of the sampled signal, from the zero crossings of the moment about its mean.  `kept_up_by`:
    "saturation" where a signal is still clipped (an unstable loop within its limits), else "quantisation".
    """

    root_moment: Annotated[
        float,
        Quantity(
            "root moment amplitude",
            "N m",
            4,
            key="root_moment_amplitude",
            help="half of the root moment's range in the last quarter of the record",
        ),
    ]
    hub_rate: Annotated[
        float,
        Quantity(
            "hub rate amplitude",
            "rad/s",
            4,
            key="hub_rate_amplitude",
            help="half of the hub rate's range in the last quarter of the record",
        ),
    ]
    torque: Annotated[
        float,
        Quantity(
            "torque amplitude",
            "N m",
            4,
            key="torque_amplitude",
            help="half of the torque's range in the last quarter of the record",
        ),
    ]
    frequency: Annotated[
        float,
        Quantity(
            "frequency",
            "rad/s",
            4,
            help="frequency of the sampled root moment, from its zero crossings about its mean",
        ),
    ]
    kept_up_by: Annotated[
        Literal["quantisation", "saturation"],
        Quantity(
            "sustained by",
            key="kept_up_by",
            help="saturation of a signal in an unstable loop, or quantisation",
        ),
    ]


@dataclass(frozen=True)
class Run(OfCase):
    """A simulated scenario: its signals, and figures of these."""

    case: Case
    simulation: Annotated[Simulation, Quantity(flat=True, help="figures of the signals")]
    used: Annotated[Enough, Quantity(flat=True, help="flexible modes of the simulation")]
    scenario_in_words: Annotated[
        str, Quantity("scenario", key="scenario_in_words", help="reference or disturbance with its size")
    ]
    tuner: Annotated[
        dict[str, Any] | None, Quantity("tuner", key="controller", help="that set the moment gain")
    ] = None

    @property
    def controller(
        self,
    ) -> Annotated[ControllerSignals, Quantity(flat=True, help="arm and controller of the loop")]:
        """Names of the arm and the controller."""
        return controller(self.case.feedback, self.arm)

    @property
    def references(self) -> Annotated[list[str], Quantity(help="signals that follow a reference")]:
        """Signals that follow a reference."""
        return list(self.case.feedback.references)

    @property
    def rule(self) -> Annotated[str, RULE]:
        """The discretisation of the law."""
        return rule_in_words(self.case.feedback)

    @property
    def reading(
        self,
    ) -> Annotated[
        str, Quantity(help="moment that is fed back: vibration, without the rigid arm's, or total")
    ]:
        """The moment that is fed back during a slew."""
        return self.simulation.chain.slew.reading

    @property
    def note(
        self,
    ) -> Annotated[
        str | None,
        Quantity(
            "not determined", key="note", help="reason for a residual or a settling time without a value"
        ),
    ]:
        """The reason why there is no residual or no settling time."""
        run = self.simulation
        ends = "the record ends before the slew"
        if run.stopped is not None:
            ends = f"the run stops at {self.stopped_at:.6g} s"
        reasons = {
            f"residual root moment, as {ends}": run.residual_moment,
            f"settling time: not settled within {run.t[-1]:.4g} s": run.settling_time,
        }
        return "; ".join(reason for reason, value in reasons.items() if value is None) or None

    @property
    def stopped_at(
        self,
    ) -> Annotated[
        float | None,
        Quantity(key="stopped_at_s", help="time at which the simulation of an unstable loop was stopped"),
    ]:
        """The time at which an unstable loop was stopped [s]."""
        return None if (stop := self.simulation.stopped) is None else stop.time

    @property
    def growing_mode(
        self,
    ) -> Annotated[
        int | None, Quantity(help="mode with the largest share in the root moment at the stop, 0 for the hub")
    ]:
        """The unstable mode, 0 for the hub."""
        return None if (stop := self.simulation.stopped) is None else stop.mode

    @cached_property
    def limit_cycle(
        self,
    ) -> Annotated[
        LimitCycle | None,
        Quantity(
            "limit cycle",
            help="sustained vibration at the end of the record that ideal converters do not have",
        ),
    ]:
        """The limit cycle, by the same simulation with ideal converters; None under a tuner."""
        run = self.simulation
        if run.chain.is_linear or self.tuner is not None:
            return None
        ideal = self.case.through(ideal_chain(self.case.chain))
        return limit_cycle(run, Simulator(ideal, run.scenario, count=self.used.modes).run())

    @property
    def torque_unit(self) -> Annotated[str, Quantity(help="unit of the input of the arm")]:
        """The unit of the input of the arm."""
        return self.arm.input_unit

    @property
    def signals(
        self,
    ) -> Annotated[dict[str, Real], Quantity(flat=True, help="time and signals at the samples")]:
        """Time and signals at the samples, by name."""
        run = self.simulation
        gain = np.empty(0) if run.gain is None else run.gain
        volts = {} if run.volts is None else {"volts": run.volts}
        return run.at_samples.by_name | {"torque": run.torque, "gain": gain} | volts

    @property
    def between(
        self,
    ) -> Annotated[dict[str, Real] | None, Quantity(help="signals at the records between two samples")]:
        """The same between the samples, of the signals that change there."""
        if (between := self.simulation.between) is None:
            return None
        return between.by_name

    @property
    def csv_table(self) -> Table:
        """The signals in the order of time; those that change at samples only are empty between them."""
        finer = self.between or {"t": np.empty(0)}
        coarse = self.signals
        order = np.argsort(np.r_[coarse["t"], finer["t"]], kind="stable").tolist()
        known = {
            "t": ("time", "s"),
            "torque": ("torque", self.torque_unit),
            "gain": ("gain", "-"),
            "volts": ("volts", "V"),
        }
        empty = [""] * len(finer["t"])
        columns = []
        for name, values in coarse.items():
            if len(values):
                of, _, at = name.partition("@")
                joined = [*values.tolist(), *(finer[name].tolist() if name in finer else empty)]
                title = known.get(name) or (f"{OUTPUTS[of].label}{at and f' = {at} m'}", OUTPUTS[of].unit)
                columns.append(Column(name, *title, of=[joined[row] for row in order]))
        return Table(columns=tuple(columns))


def limit_cycle(simulation: Simulation, ideal: Simulation) -> LimitCycle | None:
    """Return the limit cycle in the last quarter of the record, if there is one.

    A quarter earlier it was not much larger, and, where signals are still clipped, not much smaller either.  The same
    loop with ideal converters (`ideal`) has decayed further, or is unstable where signals are clipped.
    """
    # a limit cycle keeps at least this much of its amplitude over a quarter of the record
    cycle_lasts = 0.7
    n = simulation.t.size
    # a shorter record shows no limit cycle
    if simulation.stopped or simulation.chain.is_linear or n < 40:
        return None
    last = slice(n - n // 4, n)
    before = slice(n - n // 2, n - n // 4)
    at_samples = simulation.at_samples
    moment = at_samples.root_moment
    size = _half_range(moment[last])
    earlier = _half_range(moment[before])
    about = moment[last] - moment[last].mean()
    turns = np.count_nonzero(np.diff(np.signbit(about))) / 2
    is_clipped = bool(simulation.saturated_at[last].any())
    # fewer turns of the moment about its mean are a drift and no vibration
    is_transient = is_clipped and (earlier < cycle_lasts * size or turns < 1)
    # in a quarter of the record: a smaller change may be one of sampled peaks
    of_ideal = _moment_range(ideal, last)
    is_unstable = ideal.stopped is not None or of_ideal > 1.02 * _moment_range(ideal, before)
    # twice the vibration of an ideal chain at that time
    is_own = (is_clipped and is_unstable) or size > 2 * of_ideal
    if size == 0.0 or size < cycle_lasts * earlier or is_transient or not is_own:
        return None
    return LimitCycle(
        root_moment=size,
        hub_rate=_half_range(at_samples.hub_rate[last]),
        torque=_half_range(simulation.torque[last]),
        frequency=float(2 * np.pi * turns / ((about.size - 1) * simulation.scenario.period)),
        kept_up_by="saturation" if is_clipped else "quantisation",
    )


def _moment_range(ideal: Simulation, part: slice) -> float:
    """Return half the range of the moment of the ideal chain in a part of the record; inf where that was stopped."""
    if ideal.stopped:
        return math.inf
    return _half_range(ideal.at_samples.root_moment[part])


def _half_range(signal: Real) -> float:
    return float(np.ptp(signal)) / 2 if signal.size else 0.0


def ideal_chain(chain: Chain) -> Chain:
    """Return the chain with the same sampling and filters, and ideal converters: no steps, ranges or limit, float64."""
    of = chain.converters
    converters = Converters(hub_rate=of.hub_rate, rate_filter=of.rate_filter)
    return replace(chain, converters=converters, actuator=replace(chain.actuator, torque_limit=math.inf))


def simulate(
    arm: Arm,
    law: AnyLaw,
    chain: Chain | None = None,
    scenario_name: str = "slew",
    duration: float = TRIAL_DURATION,
    *,
    count: int | None = None,
    between: int = 0,
    outputs: Sequence[str] = (),
) -> Simulation:
    """Simulate the sampled loop, exact between the samples: a "slew", "step", "decay" or "impulse" of `duration` [s].

    With `count` flexible modes, or enough for the digits of the signals, and `between` records between two samples;
    `outputs` are recorded in addition, as "tip_rotation" or "strain@0.05".  Raises ParameterError for a locked hub, an
    algebraic loop, an unknown signal, a law in z whose period is not the chain's, and as `scenario` does.
    """
    case = Case(arm, law, chain)
    return simulate_scenario(
        case, scenario_name, duration, count=count, between=between, outputs=outputs
    ).simulation


def simulate_for_picture(case: Case, scenario_name: str, duration: float) -> Simulation:
    """Simulate the same for a picture: 20 records a period of the fastest visible mode (`resolve_simulations`)."""
    task = scenario(scenario_name, case.arm, case.chain, duration, case.law)
    ideal = case.through(ideal_chain(case.chain))
    used = enough_modes(lambda n: Simulator(ideal, task, count=n).run())
    return resolve_simulations(Simulator(case, task, count=used.modes), case.arm, Simulator.run)[0]


def simulate_modes(
    case: Case,
    task: Scenario,
    count: int | None = None,
    between: int = 0,
    outputs: Sequence[str] = (),
    run: Callable[[Simulator], Simulation] = Simulator.run,
) -> tuple[Simulation, Enough]:
    """Simulate with `count` modes, or enough, and return that number too; `run` is what a simulator does.

    Gains at the hub follow the references of all their signals.
    """
    ideal = case.through(ideal_chain(case.chain))
    used = enough_modes(lambda n: run(Simulator(ideal, task, count=n, outputs=outputs)), count)
    return run(Simulator(case, task, count=used.modes, between=between, outputs=outputs)), used


def simulate_scenario(
    case: Case,
    name: str,
    duration: float,
    *,
    count: int | None = None,
    between: int = 0,
    outputs: Sequence[str] = (),
) -> Run:
    """Simulate a scenario by its name: with `count` modes, or enough for its digits.

    Raises ParameterError as `simulate` does.
    """
    task = scenario(name, case.arm, case.chain, duration, case.law)
    return Run(
        case,
        *simulate_modes(case, task, count, between, outputs),
        describe_scenario(task, case.arm, case.chain),
    )
