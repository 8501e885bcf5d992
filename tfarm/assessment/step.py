"""Time responses of the loop with their figures, continuous-time and sampled: reference step, slew, pulse, deflection.

Both loops have the same input.  The sampled one has its converters, delay and filters too, and is exact between the
samples.  An initial deflection is the first mode of the arm without controller, released at rest: the free motion is
one pair of exponentials at any damping, so the response of the loop to it is exact.  (The static shape under a force at
the tip is an equilibrium only where the hub is kept at its angle.)

Figures, as in textbooks (Ogata, Modern Control Engineering, 2010, sec. 5-3): the final value is the mean of the last
tenth of the record; rise time from 10 to 90 % of it; overshoot beyond it, over it.  Settling counts from the end of the
motion, within 2 % of the travel as in python-control and MATLAB.  Of a signal without a reference, and of root moment
and torque, the share is of the largest deviation from the final value: as for `tfarm simulate`, which reads the samples
alone.

A figure is not determined where the bound on the error of the signal leaves 1 % of it open.  A peak is enclosed between
the largest |y| less its bound there and the largest |y| plus bound of the whole record, on both sides of its jumps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from tfarm.arm import AT_HUB, AnyLaw, Arm, Law
from tfarm.arm.chain import PERIOD, TIME_ROUNDING
from tfarm.arm.checks import number
from tfarm.arm.law import REFERENCE
from tfarm.arm.stages import Consumer
from tfarm.arrays import LEAST_SIZE, Real
from tfarm.assessment.card import loop_names
from tfarm.case import Case
from tfarm.digits import general
from tfarm.dsp import Chain, traces
from tfarm.dsp.results import simulate_modes
from tfarm.dsp.scenarios import TRIAL_SLEWS, Scenario, describe_scenario, rest_scenario, scenario
from tfarm.dsp.sensed import sensed_plant
from tfarm.dsp.simulate import MOST_BETWEEN, first_mode
from tfarm.dsp.simulation import SETTLING_BAND, final_value, settling_time
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
    Peak,
    TimeResponse,
    Transform,
    time_response,
    usual_poles,
)
from tfarm.records import frozen
from tfarm.response.signals import ControllerSignals, controller, locate_output
from tfarm.schema import Column, Percent, Quantity, Table, across
from tfarm.schema.html import as_html
from tfarm.spectrum.table import first_frequency

CONSUMER = Consumer(
    "step",
    acts=(
        "reference",
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
# by scenario
SAMPLED_NAMES = {"reference": "reference", "slew": "slew", "pulse": "pulse", "deflection": "decay"}
MOMENT = AT_HUB[-1]
UNSTABLE = "unstable"
# times [s], values, bounds of their errors, and the peak where known
SignalCurve = tuple[Real, Real, Real, Peak | None]
PARTS = ("hub", "tip", "root_moment", "torque")
# of a figure: more than its error may be is not determined
OPEN = 0.01


class Millimetres(float):
    """A length [m] that a person reads in mm."""

    def as_text(self, digits: int) -> str:
        """The number of mm."""
        return general(1e3 * self, digits)


@dataclass(frozen=True, kw_only=True)
class SignalFigures:
    """Figures of one signal over time, in its own unit; None where the signal, or the record, has none."""

    signal: Annotated[str, Quantity(help="output of the arm, or torque for its input")]
    unit: Annotated[str, Quantity(help="SI unit of the values of the signal")]
    peak: Annotated[
        float | None,
        Quantity(
            "peak",
            digits=6,
            unit_of="unit",
            help="largest value in size, with its sign, on both sides of jumps",
        ),
    ]
    peak_time: Annotated[float | None, Quantity("peak time", "s", 4, help="time of the peak")]
    final_value: Annotated[
        float | None,
        Quantity(
            "final value",
            digits=4,
            unit_of="unit",
            help="mean over the last tenth of the record; none where the signal has not settled",
        ),
    ]
    rise_time: Annotated[
        float | None,
        Quantity(
            "rise time (10-90 %)",
            "s",
            4,
            help="time from 10 to 90 % of the final value, of a signal with a reference",
        ),
    ]
    overshoot: Annotated[
        Percent | None,
        Quantity(
            "overshoot", "", 4, help="excess of the largest value over the final one, as a share of that"
        ),
    ]
    settling_time: Annotated[
        float | None,
        Quantity(
            "settling time",
            "s",
            4,
            help="time from the end of the motion after which deviations stay within the settling band of the travel, "
            "or of the largest deviation where there is no reference",
        ),
    ]
    at_rest_after: Annotated[
        float | None, Quantity("at rest after", "s", 4, help="end of the motion plus settling time")
    ]
    steady_state_error: Annotated[
        float | None,
        Quantity("steady-state error", digits=4, unit_of="unit", help="reference less final value"),
    ]
    residual_rms: Annotated[
        float | None,
        Quantity(
            "residual vibration (rms)",
            digits=4,
            unit_of="residual_unit",
            help="rms about the final value once the slew or the pulse is over",
        ),
    ]
    remainder_bound: Annotated[
        float | None,
        Quantity(
            "remainder bound at the peak",
            digits=2,
            unit_of="unit",
            help="of the error at the peak, as measured; at least the rounding of the peak",
        ),
    ]
    note: Annotated[
        str | None, Quantity("not determined", help="figures without a value, with their reason")
    ] = None

    @property
    def residual_unit(self) -> str:
        """Unit of the residual for a person."""
        return "mm" if isinstance(self.residual_rms, Millimetres) else self.unit


@frozen(kw_only=True)
class LoopResponse:
    """Figures of one loop, not defined of an unstable one, and its signals by name, "torque" being the input."""

    stability: Annotated[str, Quantity("stability", help="stable, marginal or unstable")]
    certainty: Annotated[
        str,
        Quantity("certainty", help="by the remainder of the poles or by twice the modes, with their number"),
    ]
    signals: dict[str, Real]
    hub: Annotated[
        SignalFigures | None, Quantity("hub", help="hub angle, or hub rate where that is the reference")
    ] = None
    tip: Annotated[
        SignalFigures | None, Quantity("tip", help="tip displacement, or its velocity under a hub rate")
    ] = None
    root_moment: Annotated[
        SignalFigures | None, Quantity("root moment", help="elastic moment at the root")
    ] = None
    torque: Annotated[
        SignalFigures | None,
        Quantity("torque", help="input of the arm by the motor: torque, voltage or current"),
    ] = None


@dataclass(frozen=True)
class _LoopRecord:
    """Times [s] of the signals of a loop, the names of those of hub and tip, root moment and torque, and references.

    `busy_until` [s] is the end of the input, `band` the share of the travel within which a signal settles.
    """

    arm: Arm
    names: tuple[str, ...]
    busy_until: float
    t: Real
    reference: Mapping[str, Real]
    band: float

    def _of_continuous(self, response: TimeResponse, omitted: str) -> LoopResponse:
        """The continuous-time loop; `omitted` ends its certainty."""
        # of the peak of each signal: bound on its error, everywhere in the record, of a converged response
        converged = 1e-6
        t = np.union1d(self.t, response.near_starts(float(self.t[-1])))
        y = response.at(t)
        t = np.union1d(t, self._crossings(t, dict(zip(response.names, y, strict=True))))
        y = response.at(t)
        bound = response.remainder(t)
        peaks = response.peaks(t)
        curves = {name: (t, y[n], bound[n], peaks[name]) for n, name in enumerate(response.names)}
        is_converged = all(
            (error <= converged * abs(peak.value)).all() and peak.bound <= converged * abs(peak.value)
            for _, _, error, peak in curves.values()
        )
        word = verdict_on(response.poles.loop).word
        count = f"{response.poles.count} poles{omitted}"
        return self._loop(word, is_converged, count, curves)

    def _of_sampled(self, case: Case, task: Scenario, names: Sequence[str]) -> LoopResponse:
        """The sampled loop, with the signals of these names."""
        between = round(task.period / self.t[1]) - 1
        run, used = simulate_modes(case, task, between=between, outputs=names)
        signals = {name: traces.continuous(run, name)[1][: self.t.size] for name in names}
        signals[TORQUE] = traces.held_at(run, run.torque, self.t[: signals[MOMENT].size])
        word = UNSTABLE if run.stopped else sampled_verdict(case).word
        curves = {name: (self.t[: y.size], y, 0 * y, None) for name, y in signals.items()}
        return self._loop(word, used.is_converged, f"{used.modes} modes", curves)

    def _loop(
        self, stability: str, is_converged: bool, count: str, curves: Mapping[str, SignalCurve]
    ) -> LoopResponse:
        """The figures of a loop; of an unstable one those of its signals are left out."""
        names = zip(PARTS, self.names, strict=True) if stability != UNSTABLE else ()
        of = {part: self._figures(name, *curves[name]) for part, name in names}
        signals = {name: y[np.isin(t, self.t)] for name, (t, y, *_) in curves.items()}
        certainty = f"{'converged' if is_converged else 'approximate'}, {count}"
        return LoopResponse(stability=stability, certainty=certainty, signals=signals, **of)

    def _figures(self, name: str, t: Real, y: Real, bound: Real, peak: Peak | None = None) -> SignalFigures:
        """Figures of one signal at times `t` with a bound on its error; its peak is the largest there unless given."""
        # of the largest value of a signal: figures of its values below a hundredth of that are 0
        resolved = 1e-3
        n = int(abs(y).argmax())
        peak = peak or Peak(float(t[n]), float(y[n]), 0.0, abs(float(y[n])))
        size = max(abs(peak.value), LEAST_SIZE)
        step = float(self.t[1])
        known = self._values(name, t, y, 0 * bound)
        below = self._values(name, t, y, -bound)
        above = self._values(name, t, y, bound)
        least = {"overshoot": 0.01, "settling_time": step / OPEN, "rise_time": step / OPEN}
        spread = {
            key: _spread(value, (below[key], above[key]), least.get(key, resolved * size))
            for key, value in known.items()
        }
        spread["peak"] = (peak.most - abs(peak.value) + peak.bound) / size
        if peak.bound > resolved * OPEN * size:
            largest = t[abs(y) + bound >= abs(peak.value) - peak.bound]
        else:
            largest = t[:0]
        late = float(np.ptp(np.r_[peak.time, largest])) - 2 * step
        spread["peak_time"] = late / max(peak.time, self.t[-1] / 10)
        known |= {"peak": peak.value, "peak_time": peak.time}
        words = []
        for key, share in spread.items():
            if share > OPEN:
                known[key] = None
                words.append(f"{key.replace('_', ' ')}: remainder {100 * share:.2g} %")
        if math.isinf(peak.most):
            known |= dict.fromkeys(("peak", "peak_time", "settling_time"))
            words = ["impulse"]
        settled = known["settling_time"]
        return SignalFigures(
            signal=name,
            unit=signal_unit(self.arm, name),
            **known,
            note="; ".join(words) or None,
            at_rest_after=None if settled is None else self.busy_until + settled,
            remainder_bound=peak.bound or None,
        )

    def _values(self, name: str, t: Real, y: Real, more: Real) -> dict[str, Any]:
        """Figures but the peak of a signal, `more` being added to it and to its deviations."""
        final, away, scale = self._deviations(name, t, y)
        settled = settling_time(t, np.maximum(away + more, 0), scale, self.busy_until, self.band)
        after = t >= self.busy_until * (1 - TIME_ROUNDING)
        names = ("final_value", "rise_time", "overshoot", "steady_state_error", "residual_rms")
        values: dict[str, Any] = {**dict.fromkeys(names), "settling_time": settled}
        if self.busy_until and after.sum() > 1:
            unit = Millimetres if name == "tip_displacement" else float
            values["residual_rms"] = unit(
                np.sqrt(np.trapezoid((y - final)[after] ** 2, t[after]) / np.ptp(t[after]))
            )
        if settled is not None:
            final += float(more.mean())
            values["final_value"] = final if name != MOMENT or not self.arm.has_rigid_mode else None
            if final and name in self.reference:
                share = (y + more) / final
                values["rise_time"] = _reached(t, share, 0.9) - _reached(t, share, 0.1)
                values["overshoot"] = Percent(max(0.0, float(share.max()) - 1))
                values["steady_state_error"] = float(self.reference[name][-1]) - final
        return values

    def _deviations(self, name: str, t: Real, y: Real) -> tuple[float, Real, float]:
        """Final value of a signal, deviations from it, and the scale of its settling band."""
        is_even = np.isin(t, self.t)
        final = final_value(t[is_even], y[is_even])
        away = abs(y - final)
        return final, away, abs(final - float(y[0])) if name in self.reference else float(away.max())

    def _crossings(self, t: Real, signals: Mapping[str, Real]) -> Real:
        """Times [s] in the last records in which a signal may cross its settling band, 16 in each."""
        found = []
        for name in self.names:
            _, away, scale = self._deviations(name, t, signals[name])
            bend = np.r_[0.0, abs(np.diff(away, 2)), 0.0]
            reach = abs(np.diff(away)) + np.maximum(bend[:-1], bend[1:])
            places = np.flatnonzero(abs(away - self.band * scale)[:-1] <= reach)[-50:]
            found.append(np.linspace(t[places], t[places + 1], 17).ravel())
        return np.concatenate(found)


@frozen(kw_only=True)
class Step(_LoopRecord):
    """Time responses of an arm under a controller, continuous-time and sampled, at the times `t` [s].

    A law in z has no continuous-time loop; the signals of a sampled loop end where it was stopped.  `names` are the
    signals of hub and tip, root moment and torque, `reference` is that of hub and tip, `response` the continuous-time
    response at any time, `busy_until` [s] the end of the input.
    """

    controller: Annotated[ControllerSignals, Quantity(flat=True, help="arm and controller of the loop")]
    scenario: Annotated[str, Quantity(help="reference, slew, pulse or deflection")]
    scenario_in_words: Annotated[str, Quantity("scenario", help="input with its size")]
    duration: Annotated[float, Quantity("duration", "s", 4, help="length of the record")]
    period: Annotated[float, PERIOD]
    continuous: Annotated[LoopResponse | None, Quantity(help="continuous-time loop; null under a law in z")]
    sampled: Annotated[LoopResponse, Quantity(help="sampled loop")]
    response: TimeResponse | None

    @property
    def loops(self) -> dict[str, LoopResponse]:
        """The loops by name."""
        names = loop_names(self.period)
        return {name: loop for name, loop in zip(names, (self.continuous, self.sampled), strict=True) if loop}

    @property
    def finding(self) -> Annotated[str, Quantity("finding", help="stability of each loop")]:
        """Stability of each loop."""
        grows = " (the response grows, its figures are not defined)"
        return "; ".join(
            f"{name} {each.stability}{'' if each.hub else grows}" for name, each in self.loops.items()
        )

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
        signals = (
            Column(
                prefix + name,
                unit=signal_unit(self.arm, name),
                of=[*y.tolist(), *[""] * (self.t.size - y.size)],
            )
            for prefix, loop in (("", self.continuous), ("sampled_", self.sampled))
            for name, y in (loop.signals.items() if loop else ())
        )
        return Table(columns=(Column("t", "time", "s", of=self.t), *signals))

    def _repr_html_(self) -> str:
        return as_html(self.table)


def signal_unit(arm: Arm, name: str) -> str:
    """SI unit of a signal, or of the input as "torque"."""
    if name == TORQUE:
        return arm.input_unit
    return locate_output(name, arm.length)[0].unit


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
    must_be_known("scenario", scenario_name, SAMPLED_NAMES)
    band = number("settling_band", settling_band, "a share of the travel, such as 0.02")
    require(
        0 < band < 1, "settling_band", settling_band, "a share of the travel between 0 and 1, such as 0.02"
    )
    case = admit_case(CONSUMER, Case(arm, law, chain))
    is_step = scenario_name == "reference"
    hub = AT_HUB[0]
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
        task = scenario(SAMPLED_NAMES[scenario_name], arm, chain, length)
    require(task.t.size > 1, "duration", length, f"at least one sampling period, {task.period:g} s")
    of_angle = hub == AT_HUB[0]
    tip = "tip_displacement" if of_angle else f"velocity@{arm.length!r}"
    names = tuple(dict.fromkeys((hub, tip, MOMENT, *outputs)))
    if task.tip_offset:
        first_mode(
            sensed_plant(arm, Chain(), ("tip_displacement",), 1).unfiltered, task.tip_offset, scenario_name
        )
    response = None
    if poles is not None:
        response = time_response(poles, names, excitation(poles.loop, case, task, names), length)
    t = _times(response, task)
    angle = traces.reference_angle(task, t) if of_angle else np.ones(t.size)
    reference = {hub: angle, tip: arm.reach * angle} if is_step or scenario_name == "slew" else {}
    found = _LoopRecord(arm, (*names[:3], TORQUE), task.busy_until, t, reference, band)
    return Step(
        **vars(found),
        controller=controller(case.law, arm),
        scenario=scenario_name,
        period=task.period,
        duration=min(length, float(t[-1])),
        scenario_in_words=describe_scenario(task, arm, chain),
        response=response,
        sampled=found._of_sampled(case, task, names),
        continuous=None
        if response is None
        else found._of_continuous(response, not_covered(CONTINUOUS, chain)),
    )


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
    """Length [s] of a record: a slew and eight time constants of the dominant pole, to two digits."""
    # of the dominant pole: length of a record after its input, to 3e-4 of the final value
    time_constants = 8.0
    rise = chain.slew.rise_time
    if poles is None:
        return TRIAL_SLEWS * rise
    sizes = abs(poles.moving)
    # a pole farther away than twice the first frequency is not the dominant one
    near = poles.moving[sizes <= 2.0 * max(first_frequency(poles.loop.arm), sizes.min(initial=math.inf))]
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
        return _released(loop, task.tip_offset, names)
    arm = loop.arm
    rise = case.chain.slew.rise_time
    angle, rate, moment = AT_HUB
    if task.name == "pulse":
        size = task.disturbance[0]
        # which is no torque of the motor
        free: dict[str, Transform] = {TORQUE: lambda s: -size / s}
        return Excitation({ACTUATOR: lambda s: size / s}, (0.0, task.busy_until), (1.0, -1.0), free=free)
    if task.name == "reference":
        return Excitation(_through(law, {angle if task.hub_angle[0] else rate: lambda s: 1 / s}))
    a = case.chain.slew.acceleration(arm.reach)
    read = arm.gauged_inertia * float(task.reading == "vibration")
    references: dict[str, Transform] = {
        angle: lambda s: 1 / s**3,
        rate: lambda s: 1 / s**2,
        moment: lambda s: -read / s,
    }
    inputs = {**_through(law, references), ACTUATOR: lambda s: arm.turned_inertia / s + arm.rate_loss / s**2}
    return Excitation(inputs, (0.0, rise / 2, rise), (a, -2 * a, a))


def _through(law: Law, references: Mapping[str, Transform]) -> dict[str, Transform]:
    """References as inputs of a law: of its signals, and with the opposite sign those of its columns."""
    own = {name: X for name, X in references.items() if name in law.references}
    wanted = {REFERENCE + name: X for name, X in references.items() if REFERENCE + name in law.wanted}
    return own | {name: lambda s, X=X: -X(s) for name, X in wanted.items()}


def _released(loop: ContinuousLoop, offset: float, names: Sequence[str]) -> Excitation:
    """The first mode released: the free motion of each signal."""
    signals = tuple(dict.fromkeys(("tip_displacement", *loop.law.signals, *names)))
    plant = sensed_plant(loop.arm, Chain(), signals, 1).unfiltered
    first, amplitude = first_mode(plant, offset, "deflection")
    p = complex(plant.poles[first])
    pairs = zip(signals, plant.residues[:, first] * amplitude, strict=True)
    free = {name: lambda s, r=r: r / (s - p) + r.conjugate() / (s - p.conjugate()) for name, r in pairs}
    return Excitation({}, poles=(p,), free=free)


def _times(response: TimeResponse | None, task: Scenario) -> Real:
    """Times [s] of a record: the samples and times between them, which resolve the fastest mode that shows."""
    T = task.period
    n = task.t.size
    finest = (n - 1) * T / 2000
    if response is not None:
        z, amplitudes = (np.hstack([part.late[n] for part in response.parts]) for n in (0, 1))
        sizes = abs(amplitudes[:-1])
        shows = (sizes > traces.VISIBLE * sizes.max(axis=1, keepdims=True)).any(axis=0)
        fastest = max(z.imag[shows].max(initial=0.0), LEAST_SIZE)
        finest = min(finest, 2 * math.pi / (traces.POINTS_A_PERIOD * fastest))
    steps = int(np.clip(math.ceil(T / finest), 1, min(MOST_BETWEEN, max(1, 20_000 // n))))
    k = np.arange((n - 1) * steps + 1)
    return T * (k // steps + k % steps / steps)


def _spread(value: float | None, others: Sequence[float | None], floor: float) -> float:
    """Largest difference of other values from a value, over its size or a floor; inf where only one of both exists."""
    if value is None or None in others:
        return 0.0 if {value, *others} == {None} else math.inf
    return max(abs((each or 0.0) - value) for each in others) / max(abs(value), floor, LEAST_SIZE)


def _reached(t: Real, share: Real, level: float) -> float:
    """Time [s] at which a signal first reaches a level, by a line between two records."""
    n = int((share >= level).argmax())
    if n:
        return float(np.interp(level, share[n - 1 : n + 1], t[n - 1 : n + 1]))
    return float(t[0])
