"""Records over time: a column of times and named signals, from CSV, .mat, HDF5, Parquet or UFF files.

Nothing is resampled: what is unevenly sampled is refused, or noted where it is less than 10 % of a period.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from tfarm.arrays import Real
from tfarm.errors import MISSING, ParameterError, did_you_mean, list_within, name_file, require
from tfarm.fitting.columns import read_columns
from tfarm.fitting.signals import TIMES, RecordSignal, known_unit, si_unit, signal_of
from tfarm.records import frozen

# of a signal: the fourth power is a number, as spectra are squared
MOST_SAMPLE = 1e70
# of a record and of a segment
LEAST_SAMPLES = 8


@frozen(slots=True, kw_only=True)
class Recording:
    """Signals (n,) by name in SI units, sampled every `period` [s] from `start` [s] on.

    `jitter` is the largest distance of the times from even ones, as a share of the period.  `sigma` has the standard
    deviations that are known, `unknown` the units of columns that are no SI units and none that is known: as they are.
    `filtering` states the filter of a decimation.
    """

    signals: dict[str, Real]
    start: float
    period: float
    jitter: float
    source: str
    digest: str
    sigma: Mapping[str, float] = field(default_factory=dict)
    unknown: Mapping[str, str] = field(default_factory=dict)
    filtering: str = ""

    @property
    def count(self) -> int:
        """Samples of each signal."""
        return next(iter(self.signals.values())).size

    @property
    def times(self) -> Real:
        """The times [s] of the samples (n,)."""
        return np.asarray(self.start + self.period * np.arange(self.count))

    def signal(self, name: str, key: str) -> Real:
        """Return the signal of that name.

        Raises ParameterError, naming `key`, with the nearest one there is, and for one of an unknown unit.
        """
        require(name in self.signals, key, name, did_you_mean(name, self.signals), self.source)
        if name in self.unknown:
            RecordSignal(name=name, column=name).in_si(self.signals[name], self.unknown[name])
        return self.signals[name]

    @property
    def note(self) -> str:
        """The unevenness of its sampling, and the filter of a decimation; nothing where there is neither."""
        found = [self.filtering] if self.filtering else []
        # times written in few digits are off by less
        if self.jitter > 1e-3:
            found.insert(0, f"sampled unevenly, by up to {100 * self.jitter:.2g} % of the period")
        return "; ".join(found)


def read_recording(
    path: str | os.PathLike[str], signals: Sequence[str | RecordSignal] | None = None
) -> Recording:
    """Return the record of a CSV, .mat, HDF5, Parquet or UFF file with a column t (or time).

    `signals` name columns with units and scales as `signals.signal_of` reads them, "hub_angle=enc[deg]": these alone
    are read then, besides the times.  A matrix with a row a sample is one signal a column: "X.1", "X.2", ...
    Units are those of the file or of `signals`, SI units where neither has one; values are returned in SI units.

    Raises ParameterError, naming the file, where there are no times, no signals, samples that are not even or no
    finite numbers, and for units of a signal that are unknown or of another quantity.
    """
    named = [signal_of(each) if isinstance(each, str) else each for each in signals or ()]
    chosen = [each for each in named if each.name not in TIMES]
    source = os.fspath(path)
    with name_file(source):
        wanted = {*TIMES, *(each.column for each in named)} if chosen else None
        sheet = read_columns(source, wanted)
        own = next((name for name in TIMES if name in sheet.columns), TIMES[0])
        of_times = [each for each in named if each.name in TIMES] or [RecordSignal(name=own, column=own)]
        name = of_times[0].column
        require(len(of_times) == 1, of_times[0].key, name, "is one column of times, and there is another one")
        remedy = (
            f"a record has a column t, in seconds; this one has {list_within(sheet.units, 300) or 'none'}"
        )
        require(name in sheet.columns, name, MISSING, remedy)
        times = sheet.columns[name]
        check_finite(name, times)
        start, period, jitter = even_timing(of_times[0].in_si(times, sheet.units[name]))
        columns = {key: of for key, of in sheet.columns.items() if of.size == times.size}
        others = [key for key in columns if key not in (name, *TIMES)]
        every = chosen or [RecordSignal(name=key, column=key) for key in others]
        require(every, "signals", MISSING, "a column of times and no other")
        found: dict[str, Real] = {}
        unknown: dict[str, str] = {}
        for each in every:
            # with columns that were not read
            known = [key for key in sheet.units if key in columns or key not in sheet.columns]
            require(each.column in columns, each.key, each.column, did_you_mean(each.column, known))
            require(each.name not in found, each.key, each.name, "is given twice; once is enough")
            values = columns[each.column]
            unit = sheet.units[each.column]
            check_finite(each.column, values)
            if chosen or si_unit(each.name) or not unit or known_unit(unit):
                found[each.name] = each.in_si(values, unit)
            else:
                found[each.name] = values
                unknown[each.name] = unit
    return Recording(
        signals=found,
        start=start,
        period=period,
        jitter=jitter,
        source=source,
        digest=sheet.digest,
        sigma={each.name: each.sigma for each in chosen if each.sigma is not None},
        unknown=unknown,
    )


def check_finite(name: str, values: Real) -> None:
    """Raise ParameterError, naming the sample, for what is no number or too large to be one of a rig."""
    for at in np.flatnonzero(~(abs(values) <= MOST_SAMPLE))[:1]:
        remedy = f"no finite number up to {MOST_SAMPLE:g}; cut the record there"
        raise ParameterError(key=f"{name}, sample {at + 1}", value=float(values[at]), remedy=remedy)


def even_timing(times: Real) -> tuple[float, float, float]:
    """Return start and period [s] of even samples, and the largest distance from them as a share of the period.

    Raises ParameterError, naming the sample, where times go back, and where samples are doubled, missing or uneven.
    """
    require(
        times.size >= LEAST_SAMPLES, "samples", times.size, f"a record has {LEAST_SAMPLES} samples at least"
    )
    steps = np.diff(times)
    usual = np.median(steps)

    def require_at(at: int, is_met: bool, remedy: str) -> None:
        require(is_met, f"t of sample {at + 2}", float(times[at + 1]), remedy)

    back = int((steps < 0).argmax())
    remedy = (
        f"is earlier than the sample before, at {times[back]:.9g} s: sort the rows, or cut the record there"
    )
    require_at(back, steps[back] >= 0, remedy)
    double = int((steps == 0).argmax())
    remedy = (
        f"is that of the sample before too, as of {np.count_nonzero(steps == 0)} samples: leave doubled ones out, "
        "or write t with more digits"
    )
    require_at(double, steps[double] > 0, remedy)
    period = float(np.ptp(times) / steps.size)
    require(period > 1 / MOST_SAMPLE, "period of t", period, "times are in seconds")
    gap = int(abs(steps - usual).argmax())
    jitter = float(abs(times - times[0] - period * np.arange(times.size)).max() / period)
    gaps = steps[steps > 1.5 * usual]
    if gaps.size:
        missing = int(np.round(gaps / usual - 1).sum())
        how = f"{missing} samples are missing in {gaps.size} gaps; cut the record there"
    else:
        how = f"samples are off even ones by up to {100 * jitter:.2g} % of the period, of 10 % at most"
    # a sample further off its place has been dropped or doubled, or the sampling is uneven
    remedy = (
        f"{steps[gap]:.6g} s after the one before, where {usual:.6g} s is usual: {how} (nothing is resampled)"
    )
    require_at(gap, jitter <= 0.1, remedy)
    return float(times[0]), period, jitter


def decimated(recording: Recording, by: int, held: str = "") -> Recording:
    """Return every `by`-th sample of a record.

    Without `held`, for estimates of one signal over another and for decays: every signal passes the same symmetric FIR
    filter first (`scipy.signal.firwin`, Kaiser window), without a shift in time.  Its gain is 1 within 1e-4 up to
    0.8 of half the new sampling rate, and below 1e-4 beyond all of it.  Ends of the record that it has no samples for,
    25 new samples each, are left out.

    `held` names the commanded input of a rig whose model is sampled, with an input that is held from each sample to
    the next.  A filtered input is held no longer, and outputs of a filter are no samples of the rig: the model at the
    longer period would answer an input that never was.  So such a record is not filtered.  It is decimated where the
    input is constant over each `by` samples, as under a slow controller: every `by`-th sample, from one at which the
    input changes, is then exactly the record of the slow loop.

    Raises ParameterError for an input that changes in between, and where too few samples are left.
    """
    require(isinstance(by, int) and by >= 1, "decimate", by, "a whole number, 1 or more")
    if by == 1:
        return recording
    rate = 1 / recording.period
    if held:
        remedy = f"needs {held}, by which the samples of the slow loop are known; use every sample"
        require(held in recording.signals, "decimate", by, remedy, recording.source)
        first = held_phase(recording.signals[held], by)
        remedy = (
            f"{held} changes within {by} samples: a filtered input is held no longer, and the model of the rig is "
            "that of a held one; use every sample, or cut the record"
        )
        require(first is not None, "decimate", by, remedy, recording.source)
        signals = {name: values[first::by] for name, values in recording.signals.items()}
        ahead = int(first or 0)
        words = f"one sample of {by}, without a filter: {held} is constant in between"
    else:
        from scipy.signal import firwin, upfirdn

        # taps over `by` of a filter of 80 dB that falls within 0.2 of half the new rate, by Kaiser's formula
        length = 50
        taps = firwin(length * by + 1, 0.9 / by, window=("kaiser", 7.857))
        ahead = length // 2 * by
        last = (recording.count - 1) // by + 1
        signals = {
            name: upfirdn(taps, values, 1, by)[length:last] for name, values in recording.signals.items()
        }
        words = (
            f"one sample of {by}, after a symmetric FIR filter of {taps.size} taps (Kaiser) on every signal: gain 1 "
            f"within 1e-4 up to {0.4 * rate / by:.4g} Hz, below 1e-4 from {0.5 * rate / by:.4g} Hz on"
        )
    count = next(iter(signals.values())).size
    remedy = f"leaves {count} of {recording.count} samples; at least {LEAST_SAMPLES}"
    require(count >= LEAST_SAMPLES, "decimate", by, remedy, recording.source)
    return replace(
        recording,
        signals=signals,
        start=recording.start + ahead * recording.period,
        period=by * recording.period,
        jitter=recording.jitter / by,
        filtering=words,
    )


def held_phase(values: Real, by: int) -> int | None:
    """Return the first sample of the blocks of `by` samples in which a signal is constant; None where it is not."""
    changes = (np.flatnonzero(np.diff(values)) + 1) % by
    if not changes.size:
        return 0
    return int(changes[0]) if (changes == changes[0]).all() else None
