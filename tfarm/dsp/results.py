"""A simulation in a few numbers: residual vibration, settling, limit cycles; and its answer as a dictionary.

How many flexible modes it takes for the digits that are asked for, the signals with twice the modes tell: their largest
change, relative to the largest value of each signal, is what half the modes were off by, and mostly more than what is
left.  It is no bound: without damping the moment after an impulse converges slowly (of 70 random arms one had nearly
twice the change left); a loop whose high modes grow is for `dsp.verdict` to find.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from tfarm.arm import AnyLaw, Arm, tracked
from tfarm.arrays import Real
from tfarm.columns import Column
from tfarm.dsp.chain import Chain, chain_or_usual
from tfarm.dsp.discretise import rule_in_words, with_all_gains
from tfarm.dsp.plant import RECORDED
from tfarm.dsp.scenarios import TRIAL_DURATION, Scenario, described, scenario
from tfarm.dsp.simulate import Simulation, Simulator, Trace
from tfarm.dsp.traces import resolved
from tfarm.errors import ConvergenceError
from tfarm.exact.outputs import OUTPUTS
from tfarm.response.controller import controller
from tfarm.schema import to_dict

MODE_COUNTS = (10, 20, 40)  # flexible modes; 80 would take a heavily damped arm 8 s of CPU time
ENOUGH_CHANGE = 1e-4  # of each signal's largest value: as many as a table of a simulation shows
SETTLED_SHARE = 0.05  # of the largest root moment, within which a slew has settled
LEFT_OF_RECORD = 10  # one part in so many of a record has to follow a settling time
CYCLE_LASTS = 0.7  # a limit cycle keeps at least this much of its amplitude over a quarter of the record
BEYOND_IDEAL = 2.0  # and is this much larger than what an ideal chain leaves at that time
GROWS = 1.02  # in a quarter of the record, of an ideal loop that runs away: less may be how samples fall on its peaks
FEWEST_TURNS = 1.0  # of the moment about its mean in a quarter of the record: fewer are a drift and no vibration
FEWEST_SAMPLES = 40  # samples without which a limit cycle cannot be told


class Enough(NamedTuple):
    """How many flexible `modes`; `change` of the signals, in their largest, when the modes were doubled to these."""

    modes: int
    change: float


def enough_modes(simulate: Callable[[int], Simulation], count: int | None = None) -> Enough:
    """The fewest of 20 or 40 modes that change no signal by more than 1e-4, else the most there are; or `count`.

    `simulate` makes the simulation with so many modes, its converters ideal: steps would hide what modes do.
    """
    if count is not None:
        return Enough(count, math.nan)
    before, found = simulate(MODE_COUNTS[0]), Enough(MODE_COUNTS[0], np.inf)
    for count in MODE_COUNTS[1:]:
        try:
            now = simulate(count)
        except ConvergenceError:  # two damped modes that cannot be told apart: what there is must do
            return found
        found = Enough(count, change(before.at_samples, now.at_samples))
        if found.change <= ENOUGH_CHANGE:
            return found
        before = now
    return found


def change(before: Trace, after: Trace) -> float:
    """The largest change of any signal at the samples that both have, relative to that signal's largest value."""
    n, changes = min(before.t.size, after.t.size), [0.0]
    for name in after.names:
        old, new = before.signal(name)[:n], after.signal(name)[:n]
        largest = abs(new).max(initial=0.0)
        if largest > 0:
            changes.append(float(abs(new - old).max() / largest))
    return max(changes)


def traced_columns(others: Iterable[str]) -> tuple[Column, ...]:
    """The columns of a `Trace`: its times, what is always recorded, and what else was asked for."""
    known = [(name, OUTPUTS[name.partition("@")[0]], name.partition("@")[2]) for name in (*RECORDED, *others)]
    return (
        Column("t", "time", "s"),
        *(Column(name, f"{each.label}{at and f' = {at} m'}", each.unit) for name, each, at in known),
    )


AT_SAMPLES_COLUMNS = (  # of what an answer has at the samples only
    Column("torque", "torque", "N m"),  # or in the unit of another input, `torque_unit` of the answer
    Column("gain", "gain", "-"),
    Column("volts", "volts", "V"),
)


@dataclass(frozen=True)
class LimitCycle:
    """A vibration that does not end: half peak to peak of root moment [N m], hub rate [rad/s] and torque [N m].

    `frequency` [rad/s] as the samples see it, from the zero crossings of the moment about its mean.  `kept_up_by`:
    "saturation" where a signal is still clipped (an unstable loop that its limits hold), else "quantisation".
    """

    root_moment: float
    hub_rate: float
    torque: float
    frequency: float
    kept_up_by: Literal["quantisation", "saturation"]


def residual_moment_rms(simulation: Simulation) -> float | None:
    """Root mean square of the arm's own root moment less the rigid arm's [N m], from the end of the slew on.

    Whatever the moment feedback reads of it, and ahead of the anti-alias filter.  None where the simulation stopped,
    or its record ends before the slew does.
    """
    return residual_left(simulation.scenario, simulation.at_samples.root_moment)


def residual_raw_moment_rms(simulation: Simulation) -> float | None:
    """The same of the root moment itself, to whose first sample the slew's last torque still belongs."""
    task, moment = simulation.scenario, simulation.at_samples.root_moment
    return _rms(moment[task.is_after]) if moment.size == task.t.size else None


def residual_left(task: Scenario, moment: Real) -> float | None:
    """Root mean square of a root moment (n,) less the rigid arm's [N m] after a slew; None for a shorter record."""
    return _rms(task.residual(moment)) if moment.size == task.t.size else None


def _rms(signal: Real) -> float | None:
    return float(np.sqrt(np.mean(signal**2))) if signal.size else None


def settling_time(simulation: Simulation) -> float:
    """Return the settling time [s]: from there on the root moment stays within 5 % of its largest.

    inf where the simulation stopped, or less than a tenth of the record is left: the moment may exceed 5 % after it.
    """
    moment = abs(simulation.at_samples.root_moment)
    (above,) = np.nonzero(moment > SETTLED_SHARE * moment.max(initial=0.0))
    first = int(above[-1]) + 1 if above.size else 0
    is_late = first > 0 and LEFT_OF_RECORD * (moment.size - 1 - first) < moment.size - 1
    return math.inf if simulation.stopped or is_late else float(simulation.t[first])


def limit_cycle(simulation: Simulation, ideal: Simulation) -> LimitCycle | None:
    """The limit cycle in the last quarter of the record, if there is one.

    It lasts: a quarter earlier it was not much larger, and, where signals are still clipped, not much smaller either.
    The same loop with ideal converters (`ideal`) has died down further, or where they are clipped it runs away.
    """
    n = simulation.t.size
    if simulation.stopped or simulation.chain.is_linear or n < FEWEST_SAMPLES:
        return None
    last, before = slice(n - n // 4, n), slice(n - n // 2, n - n // 4)
    moment = simulation.at_samples.root_moment
    size, earlier = _half_range(moment[last]), _half_range(moment[before])
    is_clipped = bool(simulation.saturated_at[last].any())
    if size == 0.0 or size < CYCLE_LASTS * earlier or (is_clipped and earlier < CYCLE_LASTS * size):
        return None
    runs_away = ideal.stopped is not None or _left(ideal, last) > GROWS * _left(ideal, before)
    if not (is_clipped and runs_away) and size <= BEYOND_IDEAL * _left(ideal, last):
        return None
    about = moment[last] - moment[last].mean()
    turns = np.count_nonzero(np.diff(np.signbit(about))) / 2
    if is_clipped and turns < FEWEST_TURNS:
        return None
    return LimitCycle(
        root_moment=size,
        hub_rate=_half_range(simulation.at_samples.hub_rate[last]),
        torque=_half_range(simulation.torque[last]),
        frequency=float(2 * np.pi * turns / ((about.size - 1) * simulation.scenario.period)),
        kept_up_by="saturation" if is_clipped else "quantisation",
    )


def _left(ideal: Simulation, part: slice) -> float:
    """What the ideal chain leaves of the moment there, as half of its range; inf where it ran away."""
    return math.inf if ideal.stopped else _half_range(ideal.at_samples.root_moment[part])


def _half_range(signal: Real) -> float:
    return float(np.ptp(signal)) / 2 if signal.size else 0.0


def simulation_answer(
    arm: Arm, law: AnyLaw, simulation: Simulation, cycle: LimitCycle | None, used: Enough
) -> dict[str, Any]:
    """The simulation as a dictionary of plain numbers, texts and lists.

    `modes_change`: by how much the signals changed when the modes were doubled to `modes_used`, relative to the
    largest value of each; null where the number of modes was asked for.
    """
    stopped, settled = simulation.stopped, settling_time(simulation)
    answer: dict[str, Any] = {
        "arm": arm.name,
        **_led_by(arm, law),
        "scenario": simulation.scenario.name,
        "reading": simulation.chain.slew.reading,
        "period_s": simulation.scenario.period,
        "modes_used": used.modes,
        "modes_change": None if math.isnan(used.change) else used.change,
        **_columns(simulation.at_samples),
        "torque": simulation.torque.tolist(),
        "torque_unit": arm.input_unit,
        "outputs": dict(simulation.at_samples.units),
        "gain": [] if simulation.gain is None else simulation.gain.tolist(),
        "residual_moment_rms": residual_moment_rms(simulation),
        "residual_raw_moment_rms": residual_raw_moment_rms(simulation),
        "settling_time_s": settled if math.isfinite(settled) else None,
        "saturated_samples": simulation.saturated,
        "energy_error": simulation.energy_error,
        "stopped_at_s": None if stopped is None else stopped.time,
        "growing_mode": None if stopped is None else stopped.mode,
        "limit_cycle": None if cycle is None else _cycle_answer(cycle),
    }
    if simulation.volts is not None:
        answer["volts"] = simulation.volts.tolist()
    if simulation.between is not None:
        answer["between"] = _columns(simulation.between)
    return answer


def _led_by(arm: Arm, law: AnyLaw) -> dict[str, Any]:
    """The law, what it drives, and its references."""
    given = with_all_gains(arm, law)
    return to_dict(controller(given, arm)) | {"references": list(given.references), "rule": rule_in_words(given)}


def _cycle_answer(cycle: LimitCycle) -> dict[str, Any]:
    return {
        "root_moment_amplitude": cycle.root_moment,
        "hub_rate_amplitude": cycle.hub_rate,
        "torque_amplitude": cycle.torque,
        "frequency_rad_s": cycle.frequency,
        "kept_up_by": cycle.kept_up_by,
    }


def _columns(trace: Trace) -> dict[str, Sequence[float]]:
    return {"t": trace.t.tolist()} | {name: trace.signal(name).tolist() for name in trace.names}


def ideal_chain(chain: Chain) -> Chain:
    """The same clock, filters and rate estimate, with ideal converters: no steps, no ranges, no limit, float64."""
    converters = replace(
        chain.converters,
        encoder_counts=None,
        moment_bits=None,
        moment_range=None,
        torque_bits=None,
        torque_range=None,
        arithmetic="float64",
    )
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
    """The sampled loop in time, exact between the samples: a "slew", "step", "decay" or "impulse" of `duration` [s].

    With `count` flexible modes, or as many as the digits of the signals take, and `between` records between two
    samples; `outputs` are recorded besides, as "tip_rotation" or "strain@0.05".  Raises ParameterError for a locked
    hub, an algebraic loop, an unknown signal, a law in z whose period is not the chain's, and for what `scenario`
    refuses.
    """
    chain = chain_or_usual(chain)
    arm, law = tracked(arm, law)
    return simulated(arm, law, chain, scenario(scenario_name, arm, chain, duration), count, between, outputs)[0]


def drawn(arm: Arm, law: AnyLaw, chain: Chain, scenario_name: str, duration: float) -> Simulation:
    """The same for a picture: with 20 records in each period of the fastest mode that is seen (`traces.resolved`)."""
    arm, law = tracked(arm, law)
    task = scenario(scenario_name, arm, chain, duration)
    used = enough_modes(lambda n: Simulator(arm, ideal_chain(chain), task, law, count=n).run())
    (found,) = resolved(Simulator(arm, chain, task, law, count=used.modes), arm, Simulator.run)
    return found


def simulated(
    arm: Arm,
    law: AnyLaw,
    chain: Chain,
    task: Scenario,
    count: int | None = None,
    between: int = 0,
    outputs: Sequence[str] = (),
) -> tuple[Simulation, Enough]:
    """The simulation with `count` modes, or as many as it takes, and how many these are.

    Gains at the hub follow references in all that they feed back.
    """
    ideal = ideal_chain(chain)
    used = enough_modes(lambda n: Simulator(arm, ideal, task, law, count=n, outputs=outputs).run(), count)
    return Simulator(arm, chain, task, law, count=used.modes, between=between, outputs=outputs).run(), used


def simulated_answer(
    arm: Arm,
    law: AnyLaw,
    chain: Chain,
    name: str,
    duration: float,
    *,
    count: int | None = None,
    between: int = 0,
    outputs: Sequence[str] = (),
) -> dict[str, Any]:
    """Simulate a scenario by its name and say what came of it: with `count` modes, or as many as its digits take.

    Raises ParameterError as `simulate` does.
    """
    arm, law = tracked(arm, law)
    task, cycle = scenario(name, arm, chain, duration), None
    simulation, used = simulated(arm, law, chain, task, count, between, outputs)
    if not chain.is_linear:
        cycle = limit_cycle(simulation, Simulator(arm, ideal_chain(chain), task, law, count=used.modes).run())
    return simulation_answer(arm, law, simulation, cycle, used) | {"scenario_in_words": described(task, arm, chain)}
