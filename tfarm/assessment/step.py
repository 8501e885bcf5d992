"""Time responses of the loop with their figures, continuous-time and sampled: reference step, slew, pulse, deflection.

Both loops have the same input.  The sampled one has its converters, delay and filters too, and is exact between the
samples.  An initial deflection is the first mode of the arm without controller, released at rest: the free motion is
one pair of exponentials at any damping, so the response of the loop to it is exact.  (The static shape under a force at
the tip is an equilibrium only where the hub is kept at its angle.)

The figures are those of `tfarm.assessment.signal_figures`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np

from tfarm.arm import AT_HUB, AnyLaw, Arm, Law
from tfarm.arm.chain import PERIOD
from tfarm.arm.checks import number
from tfarm.arm.law import REFERENCE
from tfarm.arm.stages import Consumer
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.assessment.card import loops_by_name
from tfarm.assessment.signal_figures import LoopRecord, LoopResponse, SignalCurve, signal_unit
from tfarm.case import Case
from tfarm.dsp import Chain, traces
from tfarm.dsp.profiles import ACCELERATION_STEPS, JERK_STEPS
from tfarm.dsp.results import simulate_modes
from tfarm.dsp.scenarios import TRIAL_SLEWS, Scenario, describe_scenario, rest_scenario, scenario
from tfarm.dsp.sensed import sensed_plant
from tfarm.dsp.shaping import impulses_of
from tfarm.dsp.simulate import MOST_BETWEEN, first_mode
from tfarm.dsp.simulation import SETTLING_BAND
from tfarm.dsp.stages import admit_case, not_covered
from tfarm.errors import must_be_known, require
from tfarm.loop.continuous import ContinuousLoop
from tfarm.loop.poles import Poles
from tfarm.loop.sampled_verdict import sampled_verdict
from tfarm.loop.stability import CONTINUOUS, verdict_on
from tfarm.loop.time_response import (
    ACTUATOR,
    TORQUE,
    Excitation,
    TimeResponse,
    Transform,
    time_response,
    usual_poles,
)
from tfarm.records import frozen
from tfarm.response.signals import ControllerSignals, controller
from tfarm.schema import Column, Percent, Quantity, Table, across
from tfarm.schema.html import as_html
from tfarm.spectrum.table import first_frequency

CONSUMER = Consumer(
    "step",
    acts=(
        "reference",
        "shaper",
        "anti-alias filter",
        "encoder",
        "hub rate",
        "amplifier steps",
        "amplifier range",
        "law",
        "arithmetic",
        "DAC steps",
        "DAC range",
        "torque limit",
        "hold",
        "delay",
        "hub damping",
        "plant",
    ),
    none=("volts",),
)

# order of the derivative of the angle that has steps, shares of the rise time where it has them, and their sizes
STEPS_OF_PROFILE = {"bang-bang": (2, *ACCELERATION_STEPS), "s-curve": (3, *JERK_STEPS)}


@frozen(kw_only=True)
class Step(LoopRecord):
    """Time responses of an arm under a controller, continuous-time and sampled, at the times `t` [s].

    A law in z has no continuous-time loop, and a slew of a polynomial or a file no response of it; the signals of a
    sampled loop end where it was stopped.  `names` are the signals of hub and tip, root moment and torque, `reference`
    is that of hub and tip, `response` the continuous-time response at any time, `busy_until` [s] the end of the input.
    """

    controller: Annotated[ControllerSignals, Quantity(flat=True, help="arm and controller of the loop")]
    scenario: Annotated[str, Quantity(help="reference, slew, pulse or deflection")]
    scenario_in_words: Annotated[str, Quantity("scenario", help="input with its size")]
    duration: Annotated[float, Quantity("duration", "s", 4, help="length of the record")]
    period: Annotated[float, PERIOD]
    continuous: Annotated[
        LoopResponse | None,
        Quantity(help="continuous-time loop; null under a law in z and of a slew without steps"),
    ]
    sampled: Annotated[LoopResponse, Quantity(help="sampled loop")]
    response: TimeResponse | None

    @property
    def loops(self) -> dict[str, LoopResponse]:
        """The loops by name."""
        return loops_by_name(self.period, self.continuous, self.sampled)

    @property
    def finding(self) -> Annotated[str, Quantity("finding", help="stability of each loop")]:
        """Stability of each loop."""
        words = []
        for name, loop in self.loops.items():
            remark = "" if loop.hub else " (the response grows, its figures are not defined)"
            words.append(f"{name} {loop.stability}{remark}")
        return "; ".join(words)

    @property
    def settling_band(
        self,
    ) -> Annotated[
        Percent,
        Quantity("settling band", digits=3, help="share of the travel within which a signal has settled"),
    ]:
        """Share of the travel within which a signal has settled."""
        return Percent(self.band)

    @property
    def table(self) -> Table:
        """A row a figure, a column a loop."""
        return across(self.loops, title="time response")

    @property
    def csv_table(self) -> Table:
        """The signals of both loops at the same times, empty where a run was stopped."""
        columns = [Column("t", "time", "s", of=self.t)]
        for prefix, loop in zip(("", "sampled_"), (self.continuous, self.sampled), strict=True):
            signals = loop.signals if loop else {}
            for name, y in signals.items():
                cells = [*y.tolist(), *[""] * (self.t.size - y.size)]
                columns.append(Column(prefix + name, unit=signal_unit(self.arm, name), of=cells))
        return Table(columns=tuple(columns))

    def _repr_html_(self) -> str:
        return as_html(self.table)


def step(
    arm: Arm,
    law: AnyLaw,
    chain: Chain | None = None,
    scenario_name: str = "reference",
    duration: float | None = None,
    *,
    outputs: Sequence[str] = (),
    settling_band: float = SETTLING_BAND,
) -> Step:
    """Return the time responses of the continuous-time and of the sampled loop, with their figures.

    Parameters
    ----------
    arm, law, chain
        The loop; a chain of 10 ms with ideal converters unless given.
    scenario_name
        "reference": unit step of the reference of the hub angle where the law feeds that back, else of the hub rate.
        "slew": that of the chain.  "pulse": a torque at the hub for a tenth of the slew.  "deflection": the first mode
        released with the tip displaced by 0.01 L.
    duration
        Length of the record [s]; by default that of a slew and eight time constants of the dominant pole, at most 20
        slews more.
    outputs
        Further signals, such as "strain@0.05".
    settling_band
        Share of the travel within which a signal has settled.

    Raises
    ------
    ParameterError
        For a locked hub, an unknown scenario or output, a loop without a reference of the hub, and as `simulate` does.
    ConvergenceError
        Where the poles of the loop are not complete.
    """
    # names of the sampled loop
    scenarios = {"reference": "reference", "slew": "slew", "pulse": "pulse", "deflection": "decay"}
    must_be_known("scenario", scenario_name, scenarios)
    band = number("settling_band", settling_band, "a share of the travel, such as 0.02")
    remedy = "a share of the travel between 0 and 1, such as 0.02"
    require(0 < band < 1, "settling_band", settling_band, remedy)
    case = admit_case(CONSUMER, Case(arm, law, chain))
    is_step = scenario_name == "reference"
    hub, _, root_moment = AT_HUB
    if is_step:
        hub, own = step_reference(case.law)
        case = case.under(own)
    arm = case.arm
    chain = case.chain
    poles = None if case.law.is_discrete else usual_poles(ContinuousLoop(case))
    length = usual_duration(poles, chain) if duration is None else duration
    if is_step:
        task = rest_scenario("reference", arm, chain, length, hub)
    else:
        task = scenario(scenarios[scenario_name], arm, chain, length, case.law)
    require(task.t.size > 1, "duration", length, f"at least one sampling period, {task.period:g} s")
    tip = "tip_displacement" if hub == AT_HUB[0] else f"velocity@{arm.length!r}"
    names = tuple(dict.fromkeys((hub, tip, root_moment, *outputs)))
    if task.tip_offset:
        first_mode(
            sensed_plant(arm, Chain(), ("tip_displacement",), 1).unfiltered, task.tip_offset, scenario_name
        )
    response = None
    reference_of = chain.reference
    has_steps = reference_of.profile in STEPS_OF_PROFILE and reference_of.feedforward == "rigid"
    if poles is not None and (task.name != "slew" or has_steps):
        response = time_response(poles, names, excitation(poles.loop, case, task, names), length)
    t = _times(response, task)
    reference = _references(task, t, hub, tip, arm.reach)
    record = LoopRecord(arm, (hub, tip, root_moment, TORQUE), task.busy_until, t, reference, band)
    sampled = sampled_response(record, case, task, names)
    continuous = None
    if response is not None:
        continuous = continuous_response(record, response, not_covered(CONTINUOUS, chain))
    return Step(
        **vars(record),
        controller=controller(case.law, arm),
        scenario=scenario_name,
        period=task.period,
        duration=min(length, float(t[-1])),
        scenario_in_words=describe_scenario(task, arm, chain),
        response=response,
        sampled=sampled,
        continuous=continuous,
    )


def _references(task: Scenario, t: Real, hub: str, tip: str, reach: float) -> dict[str, Real]:
    """Return the references of hub and tip at times t [s]; a pulse and a deflection have none."""
    if task.name not in ("reference", "slew"):
        return {}
    angle = traces.reference_angle(task, t) if hub == AT_HUB[0] else np.ones(t.size)
    return {hub: angle, tip: reach * angle}


def continuous_response(record: LoopRecord, response: TimeResponse, omitted: str) -> LoopResponse:
    """Return the response of the continuous-time loop at the times of a record; `omitted` ends its certainty."""
    t = np.union1d(record.t, response.near_starts(float(record.t[-1])))
    t = np.union1d(t, _band_crossings(record, t, dict(zip(response.names, response.at(t), strict=True))))
    peaks = response.peaks(t)
    curves = {
        name: SignalCurve(t, y, bound, peaks[name])
        for name, y, bound in zip(response.names, response.at(t), response.remainder(t), strict=True)
    }
    is_converged = all(curve.is_converged for curve in curves.values())
    word = verdict_on(response.poles.loop).word
    return record.of_loop(word, is_converged, f"{response.poles.count} poles{omitted}", curves)


def sampled_response(record: LoopRecord, case: Case, task: Scenario, names: Sequence[str]) -> LoopResponse:
    """Return the response of the sampled loop at the times of a record, with the signals of these names."""
    between = round(task.period / record.t[1]) - 1
    run, used = simulate_modes(case, task, between=between, outputs=names)
    signals = {name: traces.continuous(run, name)[1][: record.t.size] for name in names}
    t = record.t[: signals[names[0]].size]
    signals[TORQUE] = traces.held_at(run, run.torque, t)
    curves = {name: SignalCurve(t, y, 0 * y) for name, y in signals.items()}
    word = "unstable" if run.stopped else sampled_verdict(case).word
    return record.of_loop(word, used.is_converged, f"{used.modes} modes", curves)


def _band_crossings(record: LoopRecord, t: Real, signals: Mapping[str, Real]) -> Real:
    """Return times [s] in the last records in which a signal may cross its settling band, 16 in each."""
    found = []
    for name in record.names:
        _, away, scale = record.deviations(name, t, signals[name])
        bend = np.r_[0.0, abs(np.diff(away, 2)), 0.0]
        reach = abs(np.diff(away)) + np.maximum(bend[:-1], bend[1:])
        places = np.flatnonzero(abs(away - record.band * scale)[:-1] <= reach)[-50:]
        found.append(np.linspace(t[places], t[places + 1], 17).ravel())
    return np.concatenate(found)


def step_reference(law: Law) -> tuple[str, Law]:
    """Return the signal of the hub whose reference steps, and the law with that reference.

    Raises ParameterError for a law that feeds back neither hub angle nor hub rate.
    """
    known = {*law.references, *(name.removeprefix(REFERENCE) for name in law.wanted)}
    hub = next((name for name in AT_HUB[:2] if name in known.union(law.signals)), "")
    remedy = "the controller feeds back neither hub angle nor hub rate; choose slew, pulse or deflection"
    require(hub, "scenario", "reference", remedy)
    return hub, law if hub in known else replace(law, references=(*law.references, hub))


def usual_duration(poles: Poles | None, chain: Chain) -> float:
    """Return the length [s] of a record: a slew and eight time constants of the dominant pole, to two digits."""
    # of the dominant pole: length of a record after its input, to 3e-4 of the final value
    time_constants = 8.0
    rise = chain.slew.rise_time
    if poles is None:
        return TRIAL_SLEWS * rise
    sizes = abs(poles.nonzero)
    # a pole farther away than twice the first frequency is not the dominant one
    near = poles.nonzero[sizes <= 2.0 * max(first_frequency(poles.loop.arm), sizes.min(initial=math.inf))]
    # at most 20 slews
    decay = max(abs(near.real).min(initial=math.inf), time_constants / (20.0 * rise))
    return float(f"{rise + time_constants / decay:.2g}")


def excitation(loop: ContinuousLoop, case: Case, task: Scenario, names: Sequence[str]) -> Excitation:
    """Return the input of a scenario of the sampled loop in continuous time; the case's law names its own references.

    Raises ParameterError for a reference that no scenario has.
    """
    law = case.law
    for name in (*law.references, *law.wanted):
        must_be_known("references", name.removeprefix(REFERENCE), AT_HUB)
    if task.tip_offset:
        return _free_motion(loop, task.tip_offset, names)
    arm = loop.arm
    rise = case.chain.slew.rise_time
    angle, rate, moment = AT_HUB
    if task.name == "pulse":
        size = task.disturbance[0]
        # which is no torque of the motor
        free: dict[str, Transform] = {TORQUE: lambda s: -size / s}
        return Excitation({ACTUATOR: lambda s: size / s}, (0.0, task.busy_until), (1.0, -1.0), free=free)
    if task.name == "reference":
        hub = angle if task.hub_angle[0] else rate
        return Excitation(_inputs(law, {hub: lambda s: 1 / s}))
    # of the acceleration in steps, or of the jerk, once for each impulse of the shaper
    order, shares, sizes = STEPS_OF_PROFILE[case.chain.reference.profile]
    read = arm.gauged_inertia * float(task.reading == "vibration")
    references: dict[str, Transform] = {
        angle: lambda s: 1 / s ** (order + 1),
        rate: lambda s: 1 / s**order,
        moment: lambda s: -read / s ** (order - 1),
    }
    feedforward = {
        ACTUATOR: lambda s: arm.turned_inertia / s ** (order - 1) + arm.rate_loss / s**order,
    }
    turn = case.chain.slew.travel_of(arm.reach) / arm.reach
    impulses = impulses_of(arm, case.chain, law)
    (samples,) = np.nonzero(impulses)
    weights = np.outer(impulses[samples], sizes) * turn / rise**order
    times = np.add.outer(samples * task.period, np.array(shares) * rise)
    return Excitation(
        {**_inputs(law, references), **feedforward}, tuple(times.ravel()), tuple(weights.ravel())
    )


def _inputs(law: Law, references: Mapping[str, Transform]) -> dict[str, Transform]:
    """Return references as inputs of a law: of its signals, and with the opposite sign those of its columns."""
    own = {name: X for name, X in references.items() if name in law.references}
    columns = {REFERENCE + name: X for name, X in references.items() if REFERENCE + name in law.wanted}
    return own | {name: lambda s, X=X: -X(s) for name, X in columns.items()}


def _free_motion(loop: ContinuousLoop, offset: float, names: Sequence[str]) -> Excitation:
    """Return the motion of each signal as the first mode is released, with this offset of the tip."""
    signals = tuple(dict.fromkeys(("tip_displacement", *loop.law.signals, *names)))
    plant = sensed_plant(loop.arm, Chain(), signals, 1).unfiltered
    first, amplitude = first_mode(plant, offset, "deflection")
    p = complex(plant.poles[first])
    q = p.conjugate()
    pairs = zip(signals, plant.residues[:, first] * amplitude, strict=True)
    free = {name: lambda s, r=r: r / (s - p) + r.conjugate() / (s - q) for name, r in pairs}
    return Excitation({}, poles=(p,), free=free)


def _times(response: TimeResponse | None, task: Scenario) -> Real:
    """Return the times [s] of a record: samples, and times between them that resolve the fastest mode that shows."""
    T = task.period
    n = task.t.size
    finest = (n - 1) * T / 2000
    if response is not None:
        z = np.hstack([part.late[0] for part in response.parts])
        sizes = abs(np.hstack([part.late[1] for part in response.parts])[:-1])
        shows = (sizes > traces.VISIBLE * sizes.max(axis=1, keepdims=True)).any(axis=0)
        fastest = max(z.imag[shows].max(initial=0.0), LEAST_SIZE)
        finest = min(finest, 2 * math.pi / (traces.POINTS_A_PERIOD * fastest))
    # of a record: at most 20,000 times, if that many samples are left
    most = min(MOST_BETWEEN, max(1, 20_000 // n))
    steps = min(max(math.ceil(T / finest), 1), most)
    k = np.arange((n - 1) * steps + 1)
    return T * (k // steps + k % steps / steps)
