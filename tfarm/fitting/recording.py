"""Records over time: a column of times and named signals, from CSV or a .mat file.

A run measured on a rig under a controller is compared with the exact sampled loop: [measured] of a law's file.

    [measured]
    file = "step.csv"                    # in the folder of the law's file
    source = "laboratory X, run 7"       # shown with it

The record (a .csv, or a .mat file) has a column `t` [s], one `reference:hub_angle` [rad], the reference of the
controller, and one for each of `hub_angle` [rad] and `root_moment` [N m] that was measured.

A frequency response of a record over time is one of averaged cross-spectra, with coherence and the number of averages.

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

import hashlib
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arm.chain import TIME_ROUNDING
from tfarm.arm.reading import AnyFile, load_tables
from tfarm.arm.schema import StrictTable, validate_table
from tfarm.arrays import Complex, Real
from tfarm.case import Case
from tfarm.dsp.results import simulate_modes
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import Simulation
from tfarm.errors import MISSING, did_you_mean, list_within, must_be_known, name_file, require
from tfarm.files import read_mat
from tfarm.fitting.data import MOST_RECORD_BYTES, Measured, check_signal, read_sheet
from tfarm.records import frozen
from tfarm.schema import Quantity, Table

# of a signal: the fourth power is a number, as spectra are squared
MOST_SAMPLE = 1e70
# of a record and of a segment
LEAST_SAMPLES = 8


@frozen(slots=True, kw_only=True)
class Recording:
    """Signals (n,) by name, sampled every `period` [s] from `start` [s] on.

    `jitter` is the largest distance of the times from even ones, as a share of the period.
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
        """Return the signal of that name.  Raises ParameterError, naming `key`, with the nearest one there is."""
        require(name in self.signals, key, name, did_you_mean(name, self.signals), self.source)
        return self.signals[name]

    @property
    def note(self) -> str:
        """The unevenness of its sampling; nothing where the samples are even."""
        # times written in few digits are off by less
        if self.jitter <= 1e-3:
            return ""
        return f"sampled unevenly, by up to {100 * self.jitter:.2g} % of the period"


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Return the record of a CSV file with a column t [s], or of a .mat file with a vector t (or time).

    A matrix of a .mat file with a row a sample is one signal a column: "X.1", "X.2", ...  Raises ParameterError, naming
    the file, where there are no times, no signals, or samples that are not even.
    """
    name = os.fspath(path)
    if name.lower().endswith(".mat"):
        found, data = read_mat(name, MOST_RECORD_BYTES, key="record")
        held = {}
        for each, value in found.items():
            if value.ndim == 2 and value.dtype.kind in "biuf":
                held[each] = value.astype(float)
        units = dict.fromkeys(held, "")
        digest = hashlib.sha256(data).hexdigest()
    else:
        sheet = read_sheet(name, key="record")
        held = sheet.columns
        units = sheet.units
        digest = sheet.digest
    with name_file(name):
        of_times = next((each for each in ("t", "time") if each in held), "")
        columns = _columns(held, held[of_times].size) if of_times else {}
        remedy = f"a record has a column t, in seconds; this one has {list_within(held, 300) or 'none'}"
        require(of_times in columns, "t", MISSING, remedy)
        require(units[of_times] in ("", "s"), f"unit of {of_times}", units[of_times], "times are in seconds")
        start, period, jitter = even_timing(columns.pop(of_times))
        require(columns, "signals", MISSING, "a column of times and no other")
    return Recording(signals=columns, start=start, period=period, jitter=jitter, source=name, digest=digest)


def _columns(held: dict[str, Real], size: int) -> dict[str, Real]:
    """Return vectors of that size and the columns of matrices that have as many rows."""
    columns: dict[str, Real] = {}
    for name, value in held.items():
        if max(value.shape) == value.size == size:
            columns[name] = value.ravel()
        elif len(value) == size:
            columns |= {f"{name}.{number}": column for number, column in enumerate(value.T, start=1)}
    for name, column in columns.items():
        for at in np.flatnonzero(~(abs(column) <= MOST_SAMPLE))[:1]:
            require(
                False,
                f"{name}, sample {at + 1}",
                float(column[at]),
                f"no finite number up to {MOST_SAMPLE:g}",
            )
    return columns


def even_timing(times: Real) -> tuple[float, float, float]:
    """Return start and period [s] of even samples, and the largest distance from them as a share of the period."""
    require(
        times.size >= LEAST_SAMPLES, "samples", times.size, f"a record has {LEAST_SAMPLES} samples at least"
    )
    steps = np.diff(times)
    usual = np.median(steps)

    def require_at(at: int, is_met: bool, remedy: str) -> None:
        require(is_met, f"t of sample {at + 2}", float(times[at + 1]), remedy)

    back = int((steps <= 0).argmax())
    remedy = "is not later than the sample before; sort the rows, and leave doubled ones out"
    require_at(back, steps[back] > 0, remedy)
    period = float(np.ptp(times) / steps.size)
    require(period > 1 / MOST_SAMPLE, "period of t", period, "times are in seconds")
    gap = int(abs(steps - usual).argmax())
    jitter = float(abs(times - times[0] - period * np.arange(times.size)).max() / period)
    # a sample further off its place has been dropped or doubled, or the sampling is uneven
    remedy = f"{steps[gap]:.6g} s after the one before, where {usual:.6g} s is usual: samples have to be even"
    require_at(gap, jitter <= 0.1, remedy)
    return float(times[0]), period, jitter


class RunTable(StrictTable):
    """[measured]."""

    file: str
    source: str = ""


@frozen
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
        """Return the same task at samples: from rest at the first reference, with the reference relative to that.

        The reference is interpolated linearly between its rows.
        """
        t = period * np.arange(int(self.t[-1] / period * (1 + TIME_ROUNDING)) + 1)
        reference = np.interp(t, self.t, self.reference) - self.reference[0]
        none = np.zeros(t.size)
        until = self.t[self.reference != self.reference[-1]].max(initial=0.0)
        return Scenario("measured", period, none, reference, none, none, none, busy_until=float(until))

    @property
    def step(self) -> float:
        """The change [rad] of the reference from first to last."""
        return float(self.reference[-1] - self.reference[0])


@frozen
class RunComparison:
    """A measured run and that of the exact sampled loop under the same reference; `run` is relative to the start."""

    measured: MeasuredRun
    run: Simulation

    @property
    def hub_angle(self) -> Real:
        """The computed hub angle [rad] at the samples, from the first reference on."""
        return self.run.at_samples.hub_angle + self.measured.reference[0]


def compare_run(case: Case, measured: MeasuredRun) -> RunComparison:
    """Return the sampled loop under the reference of a measured run, with as many modes as its signals take.

    Raises ParameterError as `simulate` does.
    """
    run, _ = simulate_modes(case, measured.scenario(case.chain.sampling.period))
    return RunComparison(measured, run)


def departures(
    case: Case, measured: MeasuredRun, count: int, longer: float, share: float = 0.05
) -> list[float]:
    """Return the times [s] after a measured run at which the computed hub angle is off its end, by a share of the step.

    The reference stays for that much `longer` [s], of 10,000 samples at most; `count` modes are in the loop.
    """
    period = case.chain.sampling.period
    end = float(measured.t[-1])
    t = np.append(measured.t, end + min(longer, 10_000 * period))
    held = replace(measured, t=t, reference=np.append(measured.reference, measured.reference[-1]))
    run = Simulator(case, held.scenario(period), count=count).run().at_samples
    settled = run.hub_angle[run.t <= end][-1]
    away = abs(run.hub_angle - settled) > share * abs(measured.step)
    return run.t[away & (run.t > end)].tolist()


def overshoot(angle: Real, step: float, end: float) -> float:
    """Return the overshoot of an angle [rad] beyond the `end` of a step [rad], as a share of it.

    Below 0 where it has none.
    """
    if step:
        return float(np.max((angle - end) * np.sign(step)) / abs(step))
    return 0.0


def load_run(name_or_path: AnyFile) -> MeasuredRun | None:
    """Return the run of a file's [measured] table, None where it has none.

    Raises ParameterError for an unknown key, and for a record without these signals or that is none, naming the file.
    """
    tables, file = load_tables(name_or_path)
    if "measured" not in tables:
        return None
    with name_file(file):
        table = validate_table(RunTable, tables["measured"], "measured")
        found = read_recording(Path(file).parent / table.file)
        reference = found.signal("reference:hub_angle", "measured.file")
        require(
            {"hub_angle", "root_moment"} & found.signals.keys(),
            "measured.file",
            table.file,
            "has neither hub_angle [rad] nor root_moment [N m] with reference:hub_angle [rad]",
        )
    angle, moment = (found.signals.get(name, np.empty(0)) for name in ("hub_angle", "root_moment"))
    return MeasuredRun(found.times - found.start, reference, angle, moment, table.source)


@frozen(slots=True, kw_only=True)
class Estimate:
    """A response with what it was estimated by: `segments` of `segment` [s], `overlap` as a share of one.

    `independent` averages are in them, `note` is that of the record's sampling.
    """

    measured: Annotated[Measured, Quantity(flat=True, help="estimated response with its coherence")]
    estimator: Annotated[
        str, Quantity("estimator", help="H1 (noise on the output), H2 (on the input) or Hv (between them)")
    ]
    window: Annotated[str, Quantity("window", help="taper of each segment: hann or boxcar")]
    segment: Annotated[float, Quantity("segment", "s", help="length of one segment of the record")]
    segments: Annotated[int, Quantity("segments", help="number of segments that are averaged")]
    overlap: Annotated[
        float, Quantity("overlap", digits=3, help="share of a segment that it has in common with the next")
    ]
    independent: Annotated[
        float,
        Quantity(
            "independent averages",
            digits=4,
            key="independent_averages",
            help="segments that count as independent, by Welch (1967)",
        ),
    ]
    note: Annotated[
        str,
        Quantity(
            "sampling of the record", help="unevenness of the sampling; empty where the samples are even"
        ),
    ]

    @property
    def resolution(
        self,
    ) -> Annotated[
        float,
        Quantity("frequency resolution", "Hz", 4, "distance of the lines: one over the segment's length"),
    ]:
        """The distance of the lines [Hz]: 1/segment."""
        return 1.0 / self.segment

    @property
    def median_coherence(
        self,
    ) -> Annotated[float, Quantity("median coherence", digits=4, help="over all lines, from 0 to 1")]:
        """Over all lines."""
        return float(np.median(self.measured.coherence))  # type: ignore[arg-type]

    @property
    def response(
        self,
    ) -> Annotated[list[dict[str, Any]], Quantity(help="estimate with its coherence, a row a frequency")]:
        """A row a frequency."""
        return list(self.csv_table)

    @property
    def csv_table(self) -> Table:
        """The same, as `read_measured` reads it."""
        return self.measured.csv_table


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
    """Return the response `output`/`input` of a record, from its signals of these names or of those in `columns`.

    `segment` [s] is by default an eighth of the record, `overlap` half of it with a window that tapers, else none.
    Raises ParameterError for signals that are not there, for a segment that leaves no two of them, and for an input
    that does not move.
    """
    from scipy.signal import get_window

    check_signal(output, "--output")
    check_signal(input, "--input")
    must_be_known("--estimator", estimator, ("H1", "H2", "Hv"))
    must_be_known("--window", window, ("hann", "boxcar"))
    names = columns or (output, input)
    y = recording.signal(names[0], "--output")
    x = recording.signal(names[1], "--input")
    if overlap is None:
        overlap = 0.5 * (window == "hann")
    size, step = segment_size(recording, segment, overlap)
    how = {"window": window, "nperseg": size, "noverlap": size - step}
    lines, values, coherence = averaged_response(estimator, x, y, how)
    require(lines.size, "record", names[1], "does not move", recording.source)
    require(coherence.any(), "record", names[0], "does not move", recording.source)
    count = 1 + (recording.count - size) // step
    duration = size * recording.period
    averages = independent_averages(get_window(window, size), step, count)
    measured = Measured(
        output=output,
        input=input,
        omega=np.asarray(2 * np.pi * lines / duration, dtype=float),
        values=values,
        coherence=coherence,
        averages=max(1, math.floor(averages)),
        source=recording.source,
        digest=recording.digest,
    )
    return Estimate(
        measured=measured,
        estimator=estimator,
        window=window,
        segment=duration,
        segments=count,
        overlap=1.0 - step / size,
        independent=averages,
        note=recording.note,
    )


def averaged_response(
    estimator: str, x: Real, y: Real, how: dict[str, Any]
) -> tuple[NDArray[np.intp], Complex, Real]:
    """Return the lines that the input has power in, the response and the coherence there.

    Without the line at 0 and the last one, at half the rate of sampling, which are real.
    """
    from scipy.signal import csd, welch

    _, S_xx = welch(x, **how)
    _, S_xy = csd(x, y, **how)
    _, S_yy = welch(y, **how)
    lines = np.arange(1, S_xx.size - 1)
    # of the largest line of the input: below it there are rounding errors alone
    lines = lines[S_xx[lines] > 1e-24 * S_xx.max()]
    S_xx = S_xx[lines]
    S_yy = S_yy[lines]
    cross = abs(S_xy[lines])
    with np.errstate(divide="ignore", invalid="ignore"):
        if estimator == "H1":
            size = cross / S_xx
        elif estimator == "H2":
            size = np.where(cross == 0, 0.0, S_yy / cross)
        else:
            size = np.sqrt(S_yy / S_xx)
        phase = np.where(cross == 0, 1.0, S_xy[lines] / cross)
        coherence = np.where(S_yy > 0, cross**2 / (S_xx * S_yy), 0.0)
    return lines, size * phase, np.clip(coherence, 0.0, 1.0)


def independent_averages(w: Real, step: int, count: int) -> float:
    """Return the number of independent averages in a number of overlapped segments (Welch 1967)."""
    j = np.arange(1, min(count, math.ceil(w.size / step)))
    rho = np.array([w[: w.size - lag] @ w[lag:] for lag in j * step]) / (w @ w)
    return float(count / (1 + 2 * (1 - j / count) @ rho**2))


def segment_size(recording: Recording, segment: float | None, overlap: float) -> tuple[int, int]:
    """Return samples of a segment, and from one to the next."""
    require(0 <= overlap < 1, "--overlap", overlap, "a share of a segment from 0 to below 1, such as 0.5")
    whole = recording.count * recording.period
    least = LEAST_SAMPLES * recording.period
    # by default 15 segments, half overlapped
    wanted = whole / 8 if segment is None else segment
    remedy = f"seconds between {least:.4g} and {whole / 2:.4g}, half the record: one average has no coherence"
    require(least <= wanted <= whole / 2 * (1 + 1e-9), "--segment", wanted, remedy)
    size = min(round(wanted / recording.period), recording.count // 2)
    return size, max(1, round(size * (1 - overlap)))
