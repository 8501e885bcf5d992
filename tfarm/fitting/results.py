"""Results of fits, estimates and ring-downs as commands and pages have them."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from tfarm.arm.writing import number_unit, to_toml
from tfarm.columns import Column, Table
from tfarm.digits import general, listed, singly
from tfarm.errors import ConvergenceError
from tfarm.files import write_file
from tfarm.response.frequency import HERTZ
from tfarm.schema import Quantity

from .data import CONFIDENCE, Measured
from .fit import WIDER, Fit, repeats
from .overlay import Ratio
from .recording import Estimate
from .resonances import PARTNERS_BEYOND, matched_peaks, peaks_among, peaks_of
from .ringdown import Ring

PEAK_REACH = 0.1  # of ln w, and the damping ratio: a peak farther from all of the arm's is not one of them
BROADER = 2.0  # times the damping ratio: what a broad peak may lie off its pole
SAME_PEAK = 0.02  # of ln w: peaks of two responses nearer than that are one
SIX, NINE = singly(general, 6), singly(general, 9)  # digits of what was measured, and of the frequencies of its lines


class FittedNumber(NamedTuple):
    """A fitted number with its 95 % interval; an end that the data do not determine is None."""

    key: Annotated[str, Quantity("number")]
    unit: Annotated[str, Quantity("unit")]
    value: Annotated[float, Quantity("value")]
    low: Annotated[float | None, Quantity("95 % interval from")]
    high: Annotated[float | None, Quantity("to")]
    std: Annotated[float | None, Quantity("standard deviation", digits=3)]
    identified: Annotated[bool, Quantity("identified")]
    start: Annotated[float, Quantity()]


class FittedResonance(NamedTuple):
    """A measured peak [Hz] and that of the arm before and after the fit; None where it has none there."""

    before: Annotated[float | None, Quantity("start", "Hz")]
    after: Annotated[float | None, Quantity("fitted", "Hz")]
    measured: Annotated[float, Quantity("measured", "Hz")]


class FittedResponse(NamedTuple):
    """A response of the fit."""

    name: Annotated[str, Quantity("response")]
    source: Annotated[str, Quantity()]
    sha256: Annotated[str, Quantity()]
    frequencies: Annotated[int, Quantity("frequencies")]
    low: Annotated[float, Quantity("from", "Hz", key="from_hz")]
    high: Annotated[float, Quantity("to", "Hz", key="to_hz")]
    noise: Annotated[str, Quantity("noise by")]
    chi_squared: Annotated[float, Quantity("chi-squared", digits=4)]


@dataclass(frozen=True)
class RecordScatter:
    """The scatter between the records of one response, where there are three of them or more."""

    response: Annotated[str, Quantity("response")]
    count: Annotated[int, Quantity("records")]
    each: Annotated[list[dict[str, float]], Quantity()]
    intervals: Annotated[dict[str, list[float]], Quantity("intervals by records")]
    times_wider: Annotated[dict[str, float], Quantity("times wider than by noise")]
    in_words: Annotated[str, Quantity("finding", key="in_words")]


@dataclass(frozen=True)
class FitResult:
    """A fit with the numbers that it comes to."""

    fit: Fit

    @property
    def arm_name(self) -> Annotated[str, Quantity("arm")]:
        """The arm that the fit began with."""
        return self.fit.before.name

    @property
    def in_words(self) -> Annotated[str, Quantity("fit", key="in_words")]:
        """Convergence, identified numbers, and whether the model is rejected."""
        return fit_in_words(self.fit)

    @property
    def verdict(self) -> Annotated[str, Quantity()]:
        """In a word or three."""
        return self.fit.verdict

    @property
    def converged(self) -> Annotated[bool, Quantity("converged")]:
        """Whether the search converged."""
        return self.fit.converged

    @property
    def parameters(self) -> Annotated[list[FittedNumber], Quantity("fitted numbers")]:
        """A row a free number."""
        pairs = zip(self.fit.parameters, self.fit.solution.problem.parameters, strict=True)
        return [
            FittedNumber(one.key, number_unit(one.key), one.value, one.low, one.high, one.deviation, one.identified,
                         free.start)
            for one, free in pairs
        ]  # fmt: skip

    @property
    def interval_by(self) -> Annotated[str, Quantity("intervals by")]:
        """The kind of the intervals."""
        return "profile likelihood" if self.fit.profiled else "covariance"

    @property
    def level(self) -> Annotated[float, Quantity()]:
        """The probability of the intervals."""
        return CONFIDENCE

    @property
    def not_determined(self) -> Annotated[list[str], Quantity("not identifiable")]:
        """Combinations that the data leave open."""
        return list(self.fit.not_determined)

    @cached_property
    def resonances(self) -> Annotated[list[FittedResonance], Quantity("resonances")]:
        """A row a measured peak."""
        return resonances(self.fit)

    @property
    def unexplained(self) -> Annotated[list[float], Quantity("peaks far from every pole of the arm [Hz]",
                                                             key="unexplained_peaks_hz")]:  # fmt: skip
        """Measured peaks that the fitted arm does not have."""
        return [row.measured for row in self.resonances if row.after is None]

    @property
    def rms_log_error(self) -> Annotated[float | None, Quantity("rms of ln(computed/measured)", digits=4)]:
        """Over all values."""
        return self.fit.rms_log_error

    @property
    def chi_squared(self) -> Annotated[float, Quantity("chi-squared", digits=4)]:
        """The weighted sum of squares."""
        return self.fit.chi_squared

    @property
    def freedom(self) -> Annotated[int, Quantity("degrees of freedom")]:
        """Of that."""
        return self.fit.freedom

    @property
    def explained(self) -> Annotated[bool | None, Quantity()]:
        """Whether noise alone is often so large."""
        return self.fit.is_explained

    @property
    def responses(self) -> Annotated[list[FittedResponse], Quantity("responses")]:
        """A row a response."""
        solution = self.fit.solution
        return [
            FittedResponse(
                one.data.name, one.data.source, one.data.digest, int(one.data.omega.size),
                float(one.data.omega[0]) / HERTZ, float(one.data.omega[-1]) / HERTZ, one.noise.road,
                float(residuals @ residuals),
            )
            for one, residuals in zip(solution.problem.responses, solution.parts, strict=True)
        ]  # fmt: skip

    @cached_property
    def records(self) -> Annotated[RecordScatter | None, Quantity("scatter between records")]:
        """The scatter between the records of one response."""
        return _records(self.fit)

    @property
    def starts(self) -> Annotated[int, Quantity()]:
        """How many points the search started from."""
        return self.fit.solution.starts

    @property
    def arm(self) -> Annotated[dict[str, Any], Quantity()]:
        """The fitted arm as its file has it."""
        return tomllib.loads(to_toml(self.fit.arm))


def _records(fit: Fit) -> RecordScatter | None:
    found = repeats(fit)
    if found is None:
        return None
    wider = dict(zip(found.keys, found.times_wider.tolist(), strict=True))
    larger = [f"{key} {times:.3g} times" for key, times in wider.items() if times > WIDER]
    finding = f"larger than the noise explains: {listed(larger)}" if larger else "as the noise explains"
    each = [dict(zip(found.keys, row, strict=True)) for row in found.each.tolist()]
    intervals = dict(zip(found.keys, found.intervals.tolist(), strict=True))
    return RecordScatter(found.response, len(found.each), each, intervals, wider, finding)


def resonances(fit: Fit) -> list[FittedResonance]:
    """Each measured peak [Hz] of all responses, with the arm's own before and after; None where it has none there.

    A peak is a pole of its response: a natural frequency, with the hub held where the response is over the hub's angle.
    Of a response whose poles are not found completely no peak is listed.
    """
    found = {}
    for each in fit.solution.problem.responses:
        data = each.data
        peaks, band = data.omega[peaks_of(data, each.noise.sigma)], (float(data.omega[0]), float(data.omega[-1]))
        try:
            ratios = [Ratio(arm, data.output, data.input) for arm in (fit.before, fit.arm)]
            before, after = (peaks_among(ratio.poles(PARTNERS_BEYOND * band[1]).values) for ratio in ratios)
        except ConvergenceError:
            continue
        w, first = abs(after), abs(before)
        places = dict(matched_peaks(peaks, w, band)[0])
        earlier = dict(matched_peaks(w, first, band)[0])
        for n, peak in enumerate(peaks.tolist()):
            own = places.get(n, int(np.argmin(abs(np.log(w / peak)))) if w.size else None)
            row: list[float | None] = [None, None]
            if own is not None and abs(math.log(w[own] / peak)) < PEAK_REACH + BROADER * -after[own].real / w[own]:
                row = [float(first[earlier[own]]) / HERTZ if own in earlier else None, float(w[own]) / HERTZ]
            found[data.input, round(math.log(peak) / SAME_PEAK)] = FittedResonance(row[0], row[1], peak / HERTZ)
    return sorted(found.values(), key=lambda row: row.measured)


def fit_in_words(fit: Fit) -> str:
    """Whether the search converged, how many numbers are identified, and whether the model is rejected."""
    known = [each.key for each in fit.parameters if each.identified]
    parts = [f"{len(known)} of {len(fit.parameters)} numbers identified"]
    if not fit.converged:
        parts.insert(0, "not converged: these are the best numbers so far")
    share = fit.chi_squared / max(fit.freedom, 1)
    if fit.is_explained is None:
        parts.append("noise estimated from the residuals: the model cannot be tested")
    elif fit.is_explained:
        parts.append(f"model not rejected: reduced chi-squared = {share:.3g}")
    else:
        parts.append(
            f"model rejected: reduced chi-squared = {share:.3g}; the intervals, which rest on the noise alone, are too"
            " narrow"
        )
    return "; ".join(parts)


def fitted_toml(fit: Fit) -> str:
    """The fitted arm as a TOML file, with what was fitted to what among its assumptions."""
    values = listed([f"{each.key} = {each.value:.6g}" for each in fit.parameters if "." in each.key])
    lines = [f"Fitted: {values}, from the arm {fit.before.name}; {fit_in_words(fit)}."]
    lines += [
        f"Fitted to {each.name} of {Path(each.source).name}, SHA-256 {each.digest or 'none'}." for each in fit.responses
    ]
    lines += [f"Of the fit: {words}." for words in fit.not_determined]
    return to_toml(replace(fit.arm, assumptions=(*fit.arm.assumptions, *lines)))


def save_fit(fit: Fit, path: Path) -> None:
    """Write the fitted arm beside, then rename."""
    write_file(path, fitted_toml(fit).encode(), key="--save")


def measured_table(data: Measured) -> Table:
    """A row a frequency, in the columns that `read_measured` reads."""
    columns = [
        Column("hz", "frequency", "Hz", of=data.omega / HERTZ, digits=NINE),
        Column("re", f"Re {data.name}", of=data.values.real, digits=SIX),
        Column("im", f"Im {data.name}", of=data.values.imag, digits=SIX),
    ]
    more = {"sigma": data.sigma, "coherence": data.coherence}
    columns += [Column(name, name, of=values, digits=SIX) for name, values in more.items() if values is not None]
    if data.averages is not None:
        columns.append(Column("averages", "averages", of=[data.averages] * data.omega.size))
    return Table(columns=tuple(columns))


@dataclass(frozen=True)
class EstimateResult:
    """A frequency response estimated from a record."""

    found: Estimate

    @property
    def record(self) -> Annotated[str, Quantity("record")]:
        """The file."""
        return self.found.measured.source

    @property
    def sha256(self) -> Annotated[str, Quantity()]:
        """Of the file."""
        return self.found.measured.digest

    @property
    def output(self) -> Annotated[str, Quantity("output")]:
        """The output."""
        return self.found.measured.output

    @property
    def input(self) -> Annotated[str, Quantity("input")]:
        """The input."""
        return self.found.measured.input

    @property
    def estimate(self) -> Annotated[Estimate, Quantity(flat=True)]:
        """How it was estimated."""
        return self.found

    @property
    def median_coherence(self) -> Annotated[float, Quantity("median coherence", digits=4)]:
        """Over all lines."""
        coherence = self.found.measured.coherence
        return float(np.median(coherence if coherence is not None else [np.nan]))

    @property
    def lines(self) -> Annotated[int, Quantity("lines")]:
        """How many frequencies there are."""
        return int(self.found.measured.omega.size)

    @property
    def response(self) -> Annotated[list[dict[str, Any]], Quantity()]:
        """A row a frequency."""
        return list(measured_table(self.found.measured))

    @property
    def csv_table(self) -> Table:
        """The same, as `read_measured` reads it."""
        return measured_table(self.found.measured)


class DecayMode(NamedTuple):
    """A mode of a decay with its 95 % intervals."""

    mode: Annotated[int, Quantity("mode")]
    frequency: Annotated[float, Quantity("frequency", "Hz", 7)]
    frequency_low: Annotated[float, Quantity("from", "Hz", 7)]
    frequency_high: Annotated[float, Quantity("to", "Hz", 7)]
    frequency_std: Annotated[float, Quantity(unit="Hz")]
    natural_frequency: Annotated[float, Quantity(unit="Hz")]
    damping_ratio: Annotated[float, Quantity("damping ratio", digits=4)]
    damping_ratio_low: Annotated[float, Quantity("from", digits=4)]
    damping_ratio_high: Annotated[float, Quantity("to", digits=4)]
    damping_ratio_std: Annotated[float, Quantity()]
    amplitude: Annotated[float, Quantity("amplitude at the start", digits=4)]
    option: Annotated[str, Quantity("for tfarm fit --mode N=", key="mode_option")]
    first_half: Annotated[float | None, Quantity(key="frequency_first_half_hz")]
    second_half: Annotated[float | None, Quantity(key="frequency_second_half_hz")]


@dataclass(frozen=True)
class RingResult:
    """The modes of a decay."""

    found: Annotated[Ring, Quantity(flat=True)]

    @property
    def level(self) -> Annotated[float, Quantity("probability of the intervals")]:
        """How often an interval holds the true value."""
        return CONFIDENCE

    @property
    def modes(self) -> Annotated[list[DecayMode], Quantity("modes")]:
        """A row a mode, that of most energy first."""
        one = self.found
        f, df, z, dz = one.frequency / HERTZ, one.frequency_std / HERTZ, one.damping_ratio, one.damping_ratio_std
        halves = [[w / HERTZ if ok else None for w, ok in zip(half.tolist(), np.isfinite(one.halves_std), strict=True)]
                  for half in (one.early, one.late)]  # fmt: skip
        columns = (
            f, f - one.reach * df, f + one.reach * df, df, one.natural_frequency / HERTZ, z, z - one.reach * dz,
            z + one.reach * dz, dz, one.amplitude,
        )  # fmt: skip
        rows = zip(*(column.tolist() for column in columns), _options(one), *halves, strict=True)
        return [DecayMode(number, *row) for number, row in enumerate(rows, 1)]


def _options(one: Ring) -> list[str]:
    """The text that `tfarm fit --mode N=` takes of each mode; without a damping ratio that is not positive."""
    found = []
    columns = (one.frequency / HERTZ, one.frequency_std / HERTZ, one.damping_ratio, one.damping_ratio_std)
    for hz, deviation, ratio, spread in zip(*columns, strict=True):
        damping = f",{ratio:.6g}~{spread:.3g}" if 0 < ratio < 1 and spread > 0 else ""
        found.append(f"{hz:.8g}hz~{deviation:.3g}{damping}")
    return found
