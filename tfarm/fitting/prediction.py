"""A run that no fit has used, predicted from its reference or its held input, with the null models that it has to beat.

Closed loop: the controller under the recorded references, round the exact sampled plant, through the steps, limits and
delay of the chain.  Open loop: the plant under the held input.  Nothing of the run is fitted but the offsets of its
sensors, by least squares: no bias of the drive, and no motion at the start.  In a closed loop the hub rests at the
start where it was first measured, within three deviations of that sample's noise.

Null models are predicted in the same way.  A prediction counts for a signal where its rms is below that of each of
them: the rigid arm, the reference itself (0 of a signal without one, in open loop all at rest), both with the constant
of least squares, a bending stiffness 20 % up and down, the arm before the fit, and the arm without the new numbers.

The band is that of 95 % of a normal distribution: of arms drawn from the posterior about the prediction, and of the
noise.  Where the noise of a sensor is not known it is that of second differences of what the prediction leaves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm import AnyLaw, Arm, must_be_arm
from tfarm.arm.chain import Chain, chain_or_usual
from tfarm.arm.law import as_law
from tfarm.arrays import Real
from tfarm.case import Case
from tfarm.digits import general, join_words
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import final_value, settling_time
from tfarm.errors import did_you_mean, require
from tfarm.exact.outputs import OUTPUTS
from tfarm.fitting.data import rms
from tfarm.fitting.decays import nearest_sum, starting_poles
from tfarm.fitting.null_models import (
    RunModel,
    computed,
    constant_models,
    drawn_models,
    noise_of,
    null_models,
)
from tfarm.fitting.posterior import Posterior
from tfarm.fitting.residual_causes import (
    ENOUGH,
    Residual,
    ResidualCause,
    SignalResidual,
    causes_of,
    residual_of,
)
from tfarm.fitting.runs import RigRun, from_rest
from tfarm.records import frozen
from tfarm.response.frequency import HERTZ
from tfarm.schema import Column, Percent, Quantity, Table

PREDICTED = "predicted"
# deviations of a normal distribution: 95 % of it
REACH = 1.96


class SignalRow(NamedTuple):
    """Figures of one signal, as measured, as predicted, or as a null model has it."""

    signal: Annotated[str, Quantity("signal", help="output of the arm")]
    origin: Annotated[str, Quantity("origin", help="measured, predicted, or a null model by its name")]
    rms: Annotated[
        float | None,
        Quantity("rms", digits=4, help="root mean square of the difference from what was measured"),
    ]
    unit: Annotated[str, Quantity("unit", help="SI unit of rms and peak")]
    peak: Annotated[
        float | None, Quantity("peak", digits=4, help="value farthest from that of the predicted start")
    ]
    overshoot: Annotated[
        Percent | None,
        Quantity(
            "overshoot",
            digits=3,
            help="of a signal with a reference, beyond its last value, as a share of the step; below 0: not reached",
        ),
    ] = None
    settling_time: Annotated[
        float | None,
        Quantity(
            "settling time",
            "s",
            4,
            help="from the last change of reference or input until within 2 % of the step, or of the largest deviation",
        ),
    ] = None
    ring: Annotated[
        float | None,
        Quantity("ring", "Hz", 4, "frequency of the oscillation after that change", "ring_hz"),
    ] = None


@frozen(kw_only=True)
class Prediction:
    """A run and its prediction: `measured` and `predicted` (outputs, n), and the half width of the band."""

    run: RigRun
    measured: Real
    predicted: Real
    half_band: Real | None
    arm_name: Annotated[str, Quantity("arm", key="arm", help="arm of the prediction")]
    source: Annotated[str, Quantity("run", key="run", help="file of the record")]
    loop: Annotated[str, Quantity("loop", help="open, or the name of the controller that was running")]
    samples: Annotated[int, Quantity("samples", help="number of samples of each signal")]
    period: Annotated[float, Quantity("period of the record", "s", help="time between two samples")]
    offsets: Annotated[
        dict[str, float],
        Quantity(
            help="offsets of sensors, which alone are fitted to this run; of a led angle, where it rests first"
        ),
    ]
    rows: Annotated[
        tuple[SignalRow, ...],
        Quantity(
            "signals",
            key="signals",
            first=True,
            help="measured, predicted, and null models, each by its figures",
        ),
    ]
    residuals: Annotated[
        tuple[SignalResidual, ...],
        Quantity("residuals", help="what the prediction leaves of each signal: noise, or more"),
    ]
    causes: Annotated[
        tuple[ResidualCause, ...],
        Quantity(
            "causes tried", help="single changes of the model, and how much of the residuals they remove"
        ),
    ]

    @property
    def fitted(
        self,
    ) -> Annotated[str, Quantity("fitted to this run", help="numbers that are not predicted")]:
        """The offsets of sensors, and nothing else."""
        names = [f"{name} {general(value, 3)} {unit_of(name)}" for name, value in self.offsets.items()]
        return f"offsets of {join_words(names)}"

    @property
    def t(self) -> Real:
        """Times of the samples [s]."""
        return self.run.t

    def rms_of(self, origin: str, signal: str) -> float | None:
        """Return the rms of one signal, predicted or of a null model by its name; None where that is not bounded."""
        return next(row.rms for row in self.rows if (row.origin, row.signal) == (origin, signal))

    @property
    def null_models(self) -> tuple[str, ...]:
        """Names of the null models."""
        names = dict.fromkeys(row.origin for row in self.rows)
        return tuple(name for name in names if name not in ("measured", PREDICTED))

    def better_null(self, signal: str) -> str:
        """Return the best null model that the prediction of a signal does not beat; empty where it beats all."""
        own = self.rms_of(PREDICTED, signal)
        assert own is not None
        found = {name: self.rms_of(name, signal) for name in self.null_models}
        better = {name: value for name, value in found.items() if value is not None and value <= own}
        return min(better, key=lambda name: better[name], default="")

    @cached_property
    def counts_for(
        self,
    ) -> Annotated[list[str], Quantity(help="signals whose prediction beats every null model")]:
        """Signals whose prediction beats every null model."""
        return [name for name in self.run.names if not self.better_null(name)]

    @property
    def finding(
        self,
    ) -> Annotated[
        str, Quantity("counts", key="counts", help="where it beats every null model, and where not")
    ]:
        """The signals in which the prediction beats every null model, and those in which it does not."""
        best = {name: self.better_null(name) for name in self.run.names}
        others = [f"{name} ({better} is as good)" for name, better in best.items() if better]
        beaten = (
            f"beats every null model in {join_words(self.counts_for)}"
            if self.counts_for
            else "does not count"
        )
        return f"the prediction {beaten}" + (f", not in {join_words(others)}" if others else "")

    @property
    def cause(
        self,
    ) -> Annotated[
        str,
        Quantity(
            "cause of the residuals", help="the single change that removes most of them, if that is enough"
        ),
    ]:
        """The change that removes most, where that is more than a third; that none does."""
        if not self.causes:
            return "none to look for: the residuals are white"
        best = self.causes[0]
        share = f"{best.in_words} removes {100 * best.removed:.3g} % of them"
        return share if best.removed > ENOUGH else f"none of these: at most, {share}"

    @property
    def csv_table(self) -> Table:
        """A row a sample: measured and predicted, with the band."""
        columns = [Column("t", "time", "s", of=self.t)]
        for name, y, z, half in zip(self.run.names, self.measured, self.predicted, self.halves, strict=True):
            unit = unit_of(name)
            columns.append(Column(name, f"{name}, measured", unit, of=y))
            columns.append(Column(f"{name}_predicted", f"{name}, predicted", unit, of=z))
            if half is not None:
                columns.append(Column(f"{name}_low", f"{name}, lower end of the band", unit, of=z - half))
                columns.append(Column(f"{name}_high", f"{name}, upper end of the band", unit, of=z + half))
        return Table(columns=tuple(columns))

    @property
    def halves(self) -> list[Real | None]:
        """Half width of the band of each signal; None without a posterior."""
        return [None] * len(self.run.names) if self.half_band is None else [*self.half_band]


def unit_of(name: str) -> str:
    """Return the SI unit of a signal."""
    return OUTPUTS[name.partition("@")[0]].unit


def predict(
    arm: Arm,
    run: RigRun,
    chain: Chain | None = None,
    *,
    law: AnyLaw | None = None,
    before: Arm | None = None,
    before_chain: Chain | None = None,
    posterior: Posterior | None = None,
    without: Mapping[str, float] | None = None,
    gains: Mapping[str, float] | None = None,
    draws: int = 20,
) -> Prediction:
    """Return a run and its prediction by an arm, with null models, a band, and what the prediction leaves.

    Parameters
    ----------
    arm, chain
        As a fit to other runs has them; `chain` is by default 10 ms, ideal.
    run
        A run that was not used in that fit.
    law
        The controller that was running, where the run does not have it.
    before, before_chain
        The arm before the fit, a null model; by default through the same chain.
    posterior
        Of the fit, for the band: of `draws` arms.
    without
        Numbers of the fit as they are without it, a null model: {"drive.gain": 1.0, "drive.delay": 0.0}.
    gains
        Gains of sensors by their signals, as a fit has them.

    Raises ParameterError for keys and signals that are none, and for a loop of this arm that grows without bound.
    """
    must_be_arm(arm)
    chain = chain_or_usual(chain)
    if law is not None:
        run = replace(run, law=as_law(law))
    for name in gains or {}:
        require(name in run.names, "gains", name, did_you_mean(name, run.names))
    own = RunModel(PREDICTED, arm, chain, gains or {})
    subject, shift = from_rest(run) if arm.has_rigid_mode else (run, 0.0)
    found = computed(own, subject)
    # a loop that grows further has no deviations from it that are numbers
    is_bounded = bool((abs(found.by_offset) < 1e100).all())
    require(is_bounded, "run", run.source, "the loop of this arm grows without bound")
    of = own.of(subject)
    left = of.measured - found.outputs
    sigma = noise_of(subject, left)
    nulls = {PREDICTED: found.outputs, **constant_models(subject)}
    for each in null_models(own, before, before_chain, without or {}):
        nulls[each.name] = computed(each, subject).outputs
    half = None
    if posterior is not None:
        half = half_band(found.outputs, sigma, drawn_models(own, posterior, draws), subject)
    residual = Residual(own.arm, of, tuple(own.gains.values()), found.by_offset, found.fitted, left, sigma)
    signals = [residual_of(residual, place, half) for place in range(len(run.names))]
    moves = np.array([[shift * (name == "hub_angle")] for name in run.names])
    return Prediction(
        run=run,
        measured=of.measured + moves,
        predicted=found.outputs + moves,
        half_band=half,
        arm_name=arm.name,
        source=run.source,
        loop="open" if run.law is None else run.law.name,
        samples=run.count,
        period=run.period,
        offsets=dict(zip(run.names, (found.offsets + moves[:, 0]).tolist(), strict=True)),
        rows=tuple(signal_rows(subject, of.measured, nulls, moves[:, 0].tolist())),
        residuals=tuple(signals),
        causes=() if all(each.is_noise for each in signals) else tuple(causes_of(residual)),
    )


def half_band(predicted: Real, sigma: Real, drawn: Iterator[RunModel], run: RigRun) -> Real:
    """Return half the width (outputs, n) of the band of arms that are drawn, and of the noise (outputs,).

    Raises ParameterError for an arm whose loop grows without bound.
    """
    spread = np.array([computed(each, run).outputs for each in drawn])
    remedy = "an arm drawn of it has a loop that grows without bound"
    require(np.isfinite(spread).all(), "posterior", run.source, remedy)
    variance = ((spread - predicted) ** 2).mean(axis=0)
    return np.asarray(REACH * np.sqrt(variance + sigma[:, None] ** 2))


# ------------------------------------------------------------ figures


def signal_rows(
    run: RigRun, measured: Real, models: Mapping[str, Real], shifts: Sequence[float]
) -> Iterator[SignalRow]:
    """Yield the figures of each signal: as measured, as predicted, and of each null model."""
    for place, name in enumerate(run.names):
        start = float(models[PREDICTED][place][0])
        y = measured[place]
        yield signal_row(run, name, "measured", y, start, shifts[place])
        for origin, values in models.items():
            z = values[place]
            row = signal_row(run, name, origin, z, start, shifts[place], is_short=origin != PREDICTED)
            yield row._replace(rms=rms(z - y) if np.isfinite(z).all() else None)


def signal_row(
    run: RigRun, name: str, origin: str, y: Real, start: float, shift: float, is_short: bool = False
) -> SignalRow:
    """Return the figures of a signal that is `shift` more; of a null model, in short, the peak alone."""
    at = int(abs(y - start).argmax())
    peak = float(y[at]) + shift
    row = SignalRow(name, origin, None, unit_of(name), peak if math.isfinite(peak) else None)
    if is_short:
        return row
    reference = run.references.get(name)
    t = run.t
    busy = run.busy_until
    over = None
    step = 0.0
    if reference is not None:
        end = float(reference[-1])
        step = float(end - reference[0]) or end - start
        # a reference that goes beyond its own end has no overshoot
        if step and overshoot(reference, step, end) <= 0:
            over = Percent(overshoot(y, step, end))
    settled = settling_time(t, abs(y - final_value(t, y)), abs(step), busy)
    return row._replace(overshoot=over, settling_time=settled, ring=ring_frequency(t[t > busy], y[t > busy]))


def overshoot(angle: Real, step: float, end: float) -> float:
    """Return the overshoot of an angle [rad] beyond the `end` of a step [rad], as a share of it.

    Below 0 where it has none.
    """
    if step:
        return float(np.max((angle - end) * np.sign(step)) / abs(step))
    return 0.0


def ring_frequency(t: Real, y: Real) -> float | None:
    """Return the frequency [Hz] of the oscillation that a signal is; None where it is none, or noise."""
    # samples; a shorter one has no frequency
    least = 40
    if t.size < least or not np.ptp(y):
        return None
    poles = starting_poles(t - t[0], y, 1)
    found: Any = nearest_sum(t - t[0], y, poles) if poles.size else None
    # the share of its variance that it leaves of the signal
    if found is None or found.e.var() > 0.5 * y.var():
        return None
    return float(found.poles[0].imag) / HERTZ


def departures(case: Case, run: RigRun, count: int, longer: float, share: float = 0.05) -> list[float]:
    """Return the times [s] after a measured run at which the computed hub angle is off its end, by a share of the step.

    The reference stays for that much `longer` [s], of 10,000 samples at most; `count` modes are in the loop.
    """
    period = case.chain.sampling.period
    measured = run.references["hub_angle"][:: round(period / run.period)]
    more = np.full(math.ceil(min(longer / period, 10_000)), measured[-1])
    reference = np.append(measured, more) - measured[0]
    none = 0 * reference
    task = Scenario("measured", period, none, reference, none, none, none)
    found = Simulator(case, task, count=count).run().at_samples
    end = float(run.t[-1])
    away = abs(found.hub_angle - found.hub_angle[found.t <= end][-1]) > share * abs(reference[-1])
    return found.t[away & (found.t > end)].tolist()
