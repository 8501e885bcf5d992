"""Which record to take next: the excitation of a family whose record determines free numbers of an arm best.

The input u of each excitation is held from a sample to the next.  It is less its mean and its trend,

    sum u_k = 0,    sum k u_k = 0,

so that a rigid arm rests in the end where it rested at the start, and it is scaled to the first of the limits: those of
the input, and of signals under it at the samples.

A record has the information F = J^T J, with the Jacobian J that a fit of it has at the arm's own numbers: biases,
offsets and the motion at the start are free there (`run_model`), so they cost what they cost.  The best has the largest

    ln det(1 + F),

D-optimal where each number is known beforehand to a factor of e: one that no record determines does not decide.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np

from tfarm.arm import Arm, must_be_arm, must_have_free_hub
from tfarm.arm.chain import Chain, chain_or_usual
from tfarm.arm.checks import above_zero, positive
from tfarm.arrays import Real
from tfarm.dsp.simulate import quantisers
from tfarm.errors import MISSING, did_you_mean, require
from tfarm.fitting.data import check_signal
from tfarm.fitting.fit import problem_of
from tfarm.fitting.intervals import Fitted, confidence_intervals
from tfarm.fitting.model import Problem
from tfarm.fitting.runs import RigRun
from tfarm.fitting.solve import Solution, principal_axes
from tfarm.records import frozen
from tfarm.schema import Column, Percent, Quantity, Table, table, text
from tfarm.spectrum.table import flexible_frequencies
from tfarm.stopping import Progress

# of a run, among its signals by name
INPUT = "input"


class RankedInput(NamedTuple):
    """An excitation with the information of its record; `intervals` are in the order of the free numbers."""

    excitation: Annotated[str, Quantity("excitation", help="waveform of the held input, the best first")]
    peak: Annotated[float, Quantity("largest input", digits=4, help="in the unit of the arm's input")]
    hub_angle: Annotated[
        float, Quantity("largest hub angle", "rad", 4, "of the arm from rest under it, at the samples")
    ]
    end_angle: Annotated[float, Quantity("last hub angle", "rad", 2, "at the last sample; it began at 0")]
    information: Annotated[
        float,
        Quantity(
            "ln det(1 + F)", digits=4, help="F: Fisher information of the logarithms of the free numbers"
        ),
    ]
    intervals: Annotated[
        Mapping[str, float | None],
        Quantity(
            help="half of each 95 % interval over the number, of drive.delay over a sample; none where it is open"
        ),
    ]


@frozen(kw_only=True)
class Experiment:
    """The record to take next: excitations by their information, and the samples of the best one.

    `numbers` are the free numbers with the intervals that a record of the best is expected to give, `input` (n,) is
    held from each sample to the next, and `outputs` (n,) are the arm's signals under it.
    """

    arm: Arm
    period: Annotated[float, Quantity("sampling period", "s", help="time between two samples of the record")]
    limits: Annotated[
        Mapping[str, float], Quantity("limits", digits=4, help="of the input and of signals, in SI units")
    ]
    noise: Annotated[
        Mapping[str, float],
        Quantity("noise", digits=4, help="standard deviation of each measured signal's noise, in SI units"),
    ]
    best: Annotated[str, Quantity("best excitation", help="excitation of the most information of the family")]
    ranked: Annotated[
        tuple[RankedInput, ...], Quantity(key="excitations", help="all excitations, the best first")
    ]
    numbers: Annotated[
        tuple[Fitted, ...],
        Quantity(
            "numbers to expect", help="free numbers with the intervals of a record of the best excitation"
        ),
    ]
    not_determined: Annotated[
        tuple[str, ...],
        Quantity(
            "not identifiable", help="numbers, or combinations of them, that the best record leaves open"
        ),
    ]
    input: Annotated[Real, Quantity(help="samples of the best excitation, in the unit of the arm's input")]
    outputs: Mapping[str, Real]

    @property
    def arm_name(self) -> Annotated[str, Quantity("arm", help="arm at whose numbers all is computed")]:
        """The arm."""
        return self.arm.name

    @property
    def frequencies(self) -> Real:
        """The arm's natural frequencies [rad/s] below half the sampling rate."""
        return flexible_frequencies(self.arm, math.pi / self.period)

    @property
    def t(self) -> Real:
        """The times of the samples [s]."""
        return np.asarray(self.period * np.arange(self.input.size))

    @property
    def table(self) -> Table:
        """A row an excitation, with a column for the interval of each number."""
        columns = [*table(self.ranked).columns]
        for key in self.ranked[0].intervals:
            shares = [row.intervals[key] for row in self.ranked]
            cells = [text(None if share is None else Percent(share), 3) for share in shares]
            columns.append(Column(key, f"± {key}", of=shares, shown=cells))
        return Table(columns=tuple(columns), title="excitations; 95 % intervals to expect")

    @property
    def csv_table(self) -> Table:
        """The times and the input under its name, a row a sample."""
        of_input = Column(self.arm.input, self.arm.input, self.arm.input_unit, of=self.input)
        return Table(columns=(Column("t", "time", "s", of=self.t), of_input))


def experiment(
    arm: Arm,
    free: Sequence[str],
    duration: float,
    *,
    limit: float | None = None,
    angle: float = math.inf,
    rate: float = math.inf,
    outputs: Sequence[str] = ("hub_angle", "root_moment"),
    noise: Mapping[str, float] | None = None,
    chain: Chain | None = None,
    progress: Progress | None = None,
) -> Experiment:
    """Return the excitation in open loop whose record of that `duration` [s] determines the free numbers best.

    `free` are keys as those of `fit` with a run.  `limit` is that of the input, by default the chain's; `angle` [rad]
    and `rate` [rad/s] are those of the hub.  `noise` has standard deviations of `outputs` in SI units; the others are
    those of the converters of the `chain`, step/sqrt(12).  `progress` gets (done, total, what).
    Raises ParameterError for a key that is none, a limit or a noise that is not known, and a record too short or long.
    """
    must_be_arm(arm)
    must_have_free_hub(arm)
    chain = chain_or_usual(chain)
    limits = limits_of(arm, chain, limit, angle, rate)
    deviations = noise_of_sensors(chain, outputs, noise or {})
    shapes = excitations(arm, duration, chain.sampling.period)
    problem = problem_at_rest(arm, free, deviations, chain, next(iter(shapes.values())).size)
    found = []
    for number, (name, shape) in enumerate(shapes.items()):
        if progress is not None:
            progress(number, len(shapes), name)
        signals = scaled_signals(problem, shape, limits)
        solution = solution_under(problem, signals)
        numbers, words = confidence_intervals(solution, profile=False)
        found.append((ranked_input(name, solution, numbers, signals), numbers, words, signals))
    found.sort(key=lambda each: each[0].information, reverse=True)
    best, numbers, words, signals = found[0]
    return Experiment(
        arm=arm,
        period=chain.sampling.period,
        limits={name: value for name, value in limits.items() if value < math.inf},
        noise=deviations,
        best=best.excitation,
        ranked=tuple(row for row, *_ in found),
        numbers=numbers,
        not_determined=words,
        input=signals[INPUT],
        outputs={name: signals[name] for name in deviations},
    )


def limits_of(arm: Arm, chain: Chain, limit: float | None, angle: float, rate: float) -> dict[str, float]:
    """Return the largest sizes of the input and of signals, by name; infinity where there is no limit."""
    _, (_, _, most_moment), (_, low, high) = quantisers(chain).tolist()
    most = min(-low, high)
    if limit is not None:
        most = min(most, positive("--limit", limit, f"a positive number of {arm.input_unit}"))
    remedy = f"give the largest {arm.input} [{arm.input_unit}], or [actuator] torque_limit of the chain"
    require(most < math.inf, "--limit", MISSING, remedy)
    return {
        INPUT: most,
        "hub_angle": above_zero("--angle", angle, "a positive number of rad"),
        "hub_rate": above_zero("--rate", rate, "a positive number of rad/s"),
        "root_moment": most_moment,
    }


def noise_of_sensors(chain: Chain, outputs: Sequence[str], given: Mapping[str, float]) -> dict[str, float]:
    """Return the deviation of each signal's noise: as given, else that of rounding to the steps of its converter."""
    encoder, moment, _ = quantisers(chain)[:, 0].tolist()
    steps = {"hub_angle": encoder, "root_moment": moment}
    require(outputs, "--outputs", MISSING, "name what is measured, such as hub_angle,root_moment")
    for name in given:
        require(name in outputs, "--noise", name, f"is not measured; {did_you_mean(name, outputs)}")
    found = {}
    for name in outputs:
        check_signal(name, "--outputs")
        remedy = f"give its standard deviation, --noise {name}=NUMBER: the chain has no steps for it"
        require(name in given or steps.get(name), f"noise of {name}", MISSING, remedy)
        sigma = given.get(name, steps.get(name, 0.0) / math.sqrt(12))
        found[name] = positive(f"noise of {name}", sigma, "a standard deviation above 0, in SI units")
    return found


def excitations(arm: Arm, duration: float, period: float) -> dict[str, Real]:
    """Return the family, held inputs (n,) by name, each less its mean and its trend.

    These are binary sequences, multisines with the phases of Schroeder (1970), and linear sweeps, for each of the first
    three modes below 0.9 of half the sampling rate, and double steps of half its period or of the whole record.
    """
    from scipy.signal import chirp, detrend, max_len_seq

    # of one signal: more are decimated first
    most = 100_000
    fastest = 0.45 / period
    # of the first modes, or of some oscillation where none is slow enough
    tops = flexible_frequencies(arm, 2 * math.pi * fastest)[:3].tolist() or [0.4 * math.pi / period]
    count = round(positive("--duration", duration, "a positive number of seconds") / period)
    least = math.ceil(max(64.0, 4 * math.pi / (tops[0] * period)))
    remedy = f"{least * period:.4g} to {most * period:g} s: two periods of mode 1, 64 to {most} samples"
    require(least <= count <= most, "--duration", duration, remedy)
    t = period * np.arange(count)
    lines = np.fft.rfftfreq(count, period)
    found = {}
    for top in np.divide(tops, 2 * math.pi).tolist():
        # samples of half a period
        half = max(1, round(0.5 / (top * period)))
        bits = math.ceil(count / half)
        sequence, _ = max_len_seq(max(2, bits.bit_length()), length=bits)
        found[f"PRBS, bits of {half * period:.3g} s"] = np.repeat(2.0 * sequence - 1, half)[:count]
        for width in (half, count // 4):
            pulses = np.repeat([1.0, -1.0, -1.0, 1.0], width)[:count]
            found[f"double step, {width * period:.3g} s each way"] = np.pad(pulses, (0, count - pulses.size))
        for low in (float(lines[1]), top / 1.5):
            high = min(1.5 * top, fastest)
            band = f"{low:.3g} to {high:.3g} Hz"
            kept = np.flatnonzero((lines >= low) & (lines <= high))
            k = np.arange(kept.size)
            spectrum = np.zeros(lines.size, complex)
            spectrum[kept] = np.exp(-1j * math.pi * k * (k - 1) / k.size)
            found[f"multisine, {band}"] = np.fft.irfft(spectrum, count)
            found[f"sweep, {band}"] = chirp(t, low, t[-1], high, phi=-90)
    return {name: detrend(shape) for name, shape in found.items()}


def problem_at_rest(
    arm: Arm, free: Sequence[str], noise: Mapping[str, float], chain: Chain, count: int
) -> Problem:
    """Return the fit of the free numbers to a record of signals with that noise, without motion yet."""
    rest = np.zeros(count)
    period = chain.sampling.period
    run = RigRun(period=period, outputs=dict.fromkeys(noise, rest), input=rest, sigma=noise)
    return problem_of(arm, [], free, runs=[run], chain=chain)


def scaled_signals(problem: Problem, shape: Real, limits: Mapping[str, float]) -> dict[str, Real]:
    """Return an input of that shape and the signals under it by name, as large as the limits allow."""
    (of,) = problem.runs
    names = tuple(dict.fromkeys((*limits, *of.run.names)))[1:]
    whole = replace(of, run=replace(of.run, outputs=dict.fromkeys(names, shape), sigma={}))
    start = problem.start
    pulse = whole.pulse(problem.arm(start), partial(problem.value, start))
    signals = {INPUT: shape} | dict(zip(names, pulse.held_response(shape), strict=True))
    # at rest no limit is reached
    scale = min(most / max(largest(signals[name]), 1e-300) for name, most in limits.items())
    return {name: scale * values for name, values in signals.items()}


def largest(values: Real) -> float:
    """Return the largest size of values."""
    return float(abs(values).max())


def solution_under(problem: Problem, signals: Mapping[str, Real]) -> Solution:
    """Return the fit of a record without noise that has these signals, at the arm's own numbers."""
    (of,) = problem.runs
    outputs = {name: signals[name] for name in of.run.names}
    problem = replace(
        problem, runs=(replace(of, run=replace(of.run, input=signals[INPUT], outputs=outputs)),)
    )
    start = problem.start
    return Solution(problem, start, problem.residuals(start), problem.jacobian(start), True, 1)


def ranked_input(
    name: str, found: Solution, numbers: Sequence[Fitted], signals: Mapping[str, Real]
) -> RankedInput:
    """Return the row of an excitation: the fit that its record is taken for, its numbers, and what moves."""
    sizes, _ = principal_axes(found.jacobian)
    intervals: dict[str, float | None] = {}
    for each, of in zip(numbers, found.problem.parameters, strict=True):
        scale = found.quantile / (of.size or abs(each.value))
        intervals[each.key] = None if each.deviation is None else scale * each.deviation
    return RankedInput(
        excitation=name,
        peak=largest(signals[INPUT]),
        hub_angle=largest(signals["hub_angle"]),
        end_angle=float(signals["hub_angle"][-1]),
        information=float(np.log1p(sizes**2).sum()),
        intervals=intervals,
    )
