"""Records over time: a column of times and named signals, from CSV or a .mat file.

A run measured on a rig under a law, beside which the exact sampled loop is put: [measured] of a law's file.

    [measured]
    file = "step.csv"                    # beside the law's file
    source = "laboratory X, run 7"       # said wherever it is shown

The record (a .csv, or a .mat file) has a column `t` [s], one `reference:hub_angle` [rad], which is what the controller
was led by, and one for each of `hub_angle` [rad] and `root_moment` [N m] that was measured.

A frequency response from a record over time: averaged cross-spectra, with coherence and what it is an average of.

The record is cut into K segments of n samples, each begun S samples after the one before, less its mean, times a window
w; their transforms X, Y give  S_xx = mean |X|^2,  S_xy = mean conj(X) Y,  S_yy = mean |Y|^2  (Welch 1967), and

    H1 = S_xy/S_xx,    H2 = S_yy/conj(S_xy),    coherence  g^2 = |S_xy|^2/(S_xx S_yy).

H1 is right where the noise is on the output, H2 where it is on the input; Hv, from the largest eigenvector of the
matrix of the spectra, each scaled to the same noise, lies between them: |Hv|^2 = |H1| |H2|.  H1 is low by the factor
1/(1 + N_xx/S_xx) where the input has noise N_xx.  Real and imaginary part each scatter by |H| sqrt((1 - g^2)/(2 N g^2))
(Bendat and Piersol 2010, section 9.2), where N counts independent averages.  Overlapped segments are not: by Welch

    N = K/(1 + 2 sum_j (1 - j/K) rho(j)),    rho(j) = (sum_i w_i w_{i + j S})^2/(sum_i w_i^2)^2.

Random excitation wants a window that tapers ("hann"); a sine that is swept again and again wants segments as long as
its sweep, "boxcar" and no overlap, and no window leaks.  A resonance narrower than 1/T of the segment is flattened.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import AnyLaw, Arm, tracked
from tfarm.arm.reading import load_tables
from tfarm.arm.schema import StrictTable, validated
from tfarm.arrays import Complex, Real
from tfarm.dsp.chain import TIME_ROUNDING, Chain
from tfarm.dsp.results import enough_modes
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulation, Simulator
from tfarm.errors import MISSING, ParameterError, did_you_mean, must_be_known, naming
from tfarm.files import read_mat
from tfarm.records import record
from tfarm.schema import Quantity

from .data import MOST_RECORD_BYTES, Measured, check_signal, digest_of, read_sheet

TIMES = ("t", "time")  # what the column of times is called
JITTER = 0.1  # of the period: a sample further off its place has been dropped or doubled, or the clock is uneven
SAID = 1e-3  # of the period: what a time written in few digits is off; more is said
LED_BY = "reference:hub_angle"  # columns of the record
ANGLE_COLUMN = "hub_angle"
MOMENT_COLUMN = "root_moment"


@dataclass(frozen=True, slots=True, kw_only=True)
@record
class Recording:
    """Signals (n,) by name, sampled every `period` [s] from `start` [s] on.

    `jitter` is how far the times are from even ones, as a share of the period.
    """

    signals: dict[str, Real]
    start: float
    period: float
    jitter: float
    source: str
    digest: str

    @property
    def count(self) -> int:
        """Samples of each signal."""
        return next(iter(self.signals.values())).size

    @property
    def times(self) -> Real:
        """The times [s] of the samples (n,)."""
        return np.asarray(self.start + self.period * np.arange(self.count))

    def signal(self, name: str, key: str) -> Real:
        """The signal of that name.  Raises ParameterError, naming `key`, with the nearest one there is."""
        if name not in self.signals:
            raise ParameterError(key=key, value=name, remedy=did_you_mean(name, self.signals), file=self.source)
        return self.signals[name]

    @property
    def said(self) -> str:
        """What is to be said of its clock; nothing where the samples are even."""
        return f"sampled unevenly, by up to {100 * self.jitter:.2g} % of the period" if self.jitter > SAID else ""


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """The record of a CSV file with a column t [s], or of a .mat file with a vector t (or time).

    A matrix of a .mat file with a row a sample is one signal a column: "X.1", "X.2", ...  Raises ParameterError, naming
    the file, where there are no times, no signals, or samples that are not even.
    """
    name = os.fspath(path)
    units: dict[str, str] = {}
    if name.lower().endswith(".mat"):
        held, data = read_mat(name, MOST_RECORD_BYTES, key="record")
        digest = digest_of(data)
    else:
        sheet = read_sheet(name, key="record")
        held, units, digest = dict(sheet.columns), sheet.units, sheet.digest
    with naming(name):
        for each in TIMES:
            if units.get(each, "") not in ("", "s"):
                raise ParameterError(key=f"unit of {each}", value=units[each], remedy="times are in seconds")
        columns = held if units else _columns(held)
        given = [each for each in TIMES if each in columns]
        if not given:
            remedy = f"a record has a column t, in seconds; this one has {', '.join(columns) or 'none'}"
            raise ParameterError(key="t", value=MISSING, remedy=remedy)
        start, period, jitter = _clock(columns.pop(given[0]))
        if not columns:
            raise ParameterError(key="signals", value=MISSING, remedy="a column of times and nothing beside it")
    return Recording(signals=columns, start=start, period=period, jitter=jitter, source=name, digest=digest)


def _columns(found: dict[str, Any]) -> dict[str, Real]:
    """Vectors and the columns of matrices that have as many entries as there are times."""
    real = {
        name: np.asarray(value, dtype=float)
        for name, value in found.items()
        if getattr(value, "ndim", 0) == 2 and value.dtype.kind in "biuf"
    }
    times = next((real[each] for each in TIMES if each in real), None)
    if times is None:
        return dict.fromkeys(real, np.empty(0))
    columns: dict[str, Real] = {}
    for name, value in real.items():
        if 1 in value.shape and value.size == times.size:
            columns[name] = value.ravel()
        elif value.shape[0] == times.size:
            columns |= {f"{name}.{number}": column for number, column in enumerate(value.T, start=1)}
    for name, column in columns.items():
        if not np.isfinite(column).all():
            at = int(np.flatnonzero(~np.isfinite(column))[0])
            raise ParameterError(key=f"{name}, sample {at + 1}", value=float(column[at]), remedy="no finite number")
    return columns


def _clock(times: Real) -> tuple[float, float, float]:
    """Start and period [s] of even samples, and the largest distance from them as a share of the period."""
    if times.size < 8:
        raise ParameterError(key="samples", value=times.size, remedy="a record has 8 samples at least")
    steps = np.diff(times)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        at = int(back[0]) + 1
        remedy = "is not later than the sample before; sort the rows, and leave doubled ones out"
        raise ParameterError(key=f"t of sample {at + 1}", value=float(times[at]), remedy=remedy)
    period = float((times[-1] - times[0]) / (times.size - 1))
    usual = float(np.median(steps))
    gap = int(np.argmax(abs(steps - usual)))
    jitter = float(abs(times - times[0] - period * np.arange(times.size)).max() / period)
    if jitter > JITTER:
        remedy = f"{steps[gap]:.6g} s after the one before, where {usual:.6g} s is usual: samples have to be even"
        raise ParameterError(key=f"t of sample {gap + 2}", value=float(times[gap + 1]), remedy=remedy)
    return float(times[0]), period, jitter


class RunTable(StrictTable):
    """[measured]."""

    file: str
    source: str = ""


@dataclass(frozen=True)
@record
class MeasuredRun:
    """A measured run: `t` (n,) [s] from 0 on, the `reference` (n,) [rad] of the hub's angle, and what was read.

    `hub_angle` (n,) [rad] and `root_moment` (n,) [N m] are empty where they were not measured.
    """

    t: Real
    reference: Real
    hub_angle: Real
    root_moment: Real
    source: str = ""

    def scenario(self, period: float) -> Scenario:
        """The same task at samples: from rest at the first reference, led by what the reference is beyond that.

        The reference is taken between its rows along straight lines.
        """
        t = period * np.arange(int(self.t[-1] / period * (1 + TIME_ROUNDING)) + 1)
        led, none = np.interp(t, self.t, self.reference) - self.reference[0], np.zeros(t.size)
        moving = np.flatnonzero(self.reference != self.reference[-1])
        until = float(self.t[moving[-1]]) if moving.size else 0.0
        return Scenario("measured", period, none, led, none, none, none, busy_until=until)

    @property
    def step(self) -> float:
        """By how much [rad] the reference moves in all."""
        return float(self.reference[-1] - self.reference[0])


@dataclass(frozen=True)
@record
class Beside:
    """A measured run and the exact sampled loop that was led the same way: `run` is what moves beyond the start."""

    measured: MeasuredRun
    run: Simulation

    @property
    def hub_angle(self) -> Real:
        """The computed hub angle [rad] at the samples, from the first reference on."""
        return self.run.at_samples.hub_angle + self.measured.reference[0]

    @property
    def difference_rms(self) -> float:
        """Root mean square of computed less measured hub angle [rad], at the samples."""
        there = np.interp(self.run.t, self.measured.t, self.measured.hub_angle)
        return float(np.sqrt(np.mean((self.hub_angle - there) ** 2)))


def beside_exact(arm: Arm, law: AnyLaw, chain: Chain, measured: MeasuredRun) -> Beside:
    """The sampled loop led as the measured one was, with as many modes as its signals take.

    Raises ParameterError as `simulate` does.
    """
    arm, law = tracked(arm, law)
    task = measured.scenario(chain.sampling.period)
    used = enough_modes(lambda n: Simulator(arm, chain, task, law, count=n).run())
    return Beside(measured, Simulator(arm, chain, task, law, count=used.modes).run())


def overshoot(angle: Real, step: float, end: float) -> float:
    """How far an angle [rad] goes beyond the `end` of a step [rad], as a share of it; below 0 where it never does."""
    return float(np.max((angle - end) * np.sign(step)) / abs(step)) if step else 0.0


# ------------------------------------------------------------ reading
def load_run(name_or_path: str | os.PathLike[str]) -> MeasuredRun | None:
    """The run of a file's [measured] table, None where it has none.

    Raises ParameterError for an unknown key, and for a record without these signals or that is none, naming the file.
    """
    tables, file = load_tables(name_or_path)
    if "measured" not in tables:
        return None
    with naming(file):
        table = validated(RunTable, tables["measured"], "measured")
        found = read_recording(Path(file).parent / table.file)
        led = found.signal(LED_BY, "measured.file")
        if not {ANGLE_COLUMN, MOMENT_COLUMN} & set(found.signals):
            remedy = f"has neither {ANGLE_COLUMN} [rad] nor {MOMENT_COLUMN} [N m] beside {LED_BY} [rad]"
            raise ParameterError(key="measured.file", value=table.file, remedy=remedy)
    angle, moment = (found.signals.get(name, np.empty(0)) for name in (ANGLE_COLUMN, MOMENT_COLUMN))
    return MeasuredRun(found.times - found.start, led, angle, moment, table.source)


Estimator = Literal["H1", "H2", "Hv"]
Taper = Literal["hann", "boxcar"]

USUAL_SEGMENTS = 15  # of a record whose segments are not given: 8 lengths, half overlapped
LEAST_POWER = 1e-24  # of the largest line of the input: below it there are rounding errors alone


@dataclass(frozen=True, slots=True, kw_only=True)
@record
class Estimate:
    """A response with what it was estimated by: `segment` [s] each, `segments` of them, `overlap` as a share of one.

    `independent` averages are in them, `resolution` [Hz] is 1/segment, `clock` says what is wrong with the times.
    """

    measured: Measured
    estimator: Annotated[Estimator, Quantity("estimator")]
    window: Annotated[Taper, Quantity("window")]
    segment: Annotated[float, Quantity("segment", "s")]
    segments: Annotated[int, Quantity("segments")]
    overlap: Annotated[float, Quantity("overlap", digits=3)]
    independent: Annotated[float, Quantity("independent averages", digits=4, key="independent_averages")]
    clock: Annotated[str, Quantity("sampling of the record", key="note")]

    @property
    def resolution(self) -> Annotated[float, Quantity("frequency resolution", "Hz", 4)]:
        """The distance of the lines [Hz]."""
        return 1.0 / self.segment


def frequency_response(
    recording: Recording,
    output: str,
    input: str,
    *,
    columns: tuple[str, str] | None = None,
    estimator: str = "H1",
    window: str = "hann",
    segment: float | None = None,
    overlap: float | None = None,
) -> Estimate:
    """The response `output`/`input` of a record, from its signals of these names or of those in `columns`.

    `segment` [s] is by default an eighth of the record, `overlap` half of it with a window that tapers, else none.
    Raises ParameterError for signals that are not there, for a segment that leaves no two of them, and for an input
    that does not move.
    """
    check_signal(output, "--output")
    check_signal(input, "--input")
    from scipy.signal import csd, get_window, welch

    names = columns or (output, input)
    y, x = recording.signal(names[0], "--output"), recording.signal(names[1], "--input")
    kind, taper = _one_of("--estimator", estimator, Estimator), _one_of("--window", window, Taper)
    size, step = _cut(recording, segment, (0.5 if taper == "hann" else 0.0) if overlap is None else overlap)
    how = {"window": taper, "nperseg": size, "noverlap": size - step}
    spectra = welch(x, **how)[1], csd(x, y, **how)[1], welch(y, **how)[1]
    kept, values, coherence = _estimated(kind, spectra, names, recording)
    count = 1 + (recording.count - size) // step
    averages = independent_averages(get_window(taper, size), step, count)
    measured = Measured(
        output=output,
        input=input,
        omega=np.asarray(2 * np.pi * kept / (size * recording.period), dtype=float),
        values=values,
        coherence=coherence,
        averages=max(1, math.floor(averages)),
        source=recording.source,
        digest=recording.digest,
    )
    return Estimate(
        measured=measured,
        estimator=kind,
        window=taper,
        segment=size * recording.period,
        segments=count,
        overlap=1.0 - step / size,
        independent=averages,
        clock=recording.said,
    )


def _estimated(
    kind: Estimator, spectra: tuple[Real, Complex, Real], names: tuple[str, str], recording: Recording
) -> tuple[NDArray[np.intp], Complex, Real]:
    """The lines that the input has power in, the response and the coherence there; refused where a signal has none.

    Without the line at 0 and the last one, at half the rate of sampling, which are real.
    """
    lines = np.arange(1, spectra[0].size - 1)
    kept = lines[spectra[0][lines] > LEAST_POWER * spectra[0].max()]
    if not kept.size or not spectra[2].any():
        still = names[1] if not kept.size else names[0]
        raise ParameterError(key="record", value=still, remedy="does not move", file=recording.source)
    Sxx, Sxy, Syy = spectra[0][kept], spectra[1][kept], spectra[2][kept]
    with np.errstate(divide="ignore", invalid="ignore"):
        phase = np.where(Sxy == 0, 1.0, Sxy / abs(Sxy))
        sizes = {"H1": abs(Sxy) / Sxx, "H2": np.where(Sxy == 0, 0.0, Syy / abs(Sxy)), "Hv": np.sqrt(Syy / Sxx)}
        coherence = np.where(Syy > 0, abs(Sxy) ** 2 / (Sxx * Syy), 0.0)
    return kept, np.asarray(sizes[kind] * phase, dtype=complex), np.clip(coherence, 0.0, 1.0)


def independent_averages(w: Real, step: int, count: int) -> float:
    """How many independent averages so many overlapped segments are worth (Welch 1967)."""
    power = float(w @ w)
    shared = 0.0
    for j in range(1, min(count, math.ceil(w.size / step))):
        rho = (float(w[: w.size - j * step] @ w[j * step :]) / power) ** 2
        shared += 2 * (1 - j / count) * rho
    return count / (1 + shared)


def _cut(recording: Recording, segment: float | None, overlap: float) -> tuple[int, int]:
    """Samples of a segment, and from one to the next."""
    if not 0 <= overlap < 1:
        raise ParameterError(
            key="--overlap", value=overlap, remedy="a share of a segment from 0 to below 1, such as 0.5"
        )
    whole = recording.count * recording.period
    wanted = 2 * whole / (USUAL_SEGMENTS + 1) if segment is None else segment
    if not 8 * recording.period <= wanted <= whole / 2 * (1 + 1e-9):
        remedy = (
            f"seconds between {8 * recording.period:.4g} and {whole / 2:.4g}, half the record: one average says nothing"
        )
        raise ParameterError(key="--segment", value=wanted, remedy=remedy)
    size = min(round(wanted / recording.period), recording.count // 2)
    return size, max(1, round(size * (1 - overlap)))


def _one_of(key: str, word: str, kind: Any) -> Any:
    must_be_known(key, word, get_args(kind))
    return word
