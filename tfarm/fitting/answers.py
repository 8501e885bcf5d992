"""What `tfarm fit` prints with --json, and the table of it that a terminal and a page show.

The answers of `tfarm frf` and `tfarm ring`, and their tables.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tfarm.arm.writing import to_toml
from tfarm.arrays import Real
from tfarm.columns import ANSWER, FILES, JSON, Column, Table
from tfarm.digits import general, listed, singly
from tfarm.errors import MISSING, ConvergenceError
from tfarm.files import write_file
from tfarm.response.frequency import HERTZ

from .data import CONFIDENCE, Measured
from .fit import WIDER, Fit, repeats
from .model import Response
from .overlay import Ratio
from .recording import Estimate
from .resonances import PARTNERS_BEYOND, matched_peaks, peaks_among, peaks_of
from .ringdown import Ring

PEAK_REACH = 0.1  # of ln w, and the damping ratio: a peak farther from all of the arm's is not one of them
BROADER = 2.0  # times the damping ratio: what a broad peak may lie off its pole
SAME_PEAK = 0.02  # of ln w: peaks of two responses nearer than that are one
NUMBER_UNITS = {  # of a number by the last word of its key, in SI
    "length": "m", "radius": "m", "offset": "m", "x": "m", "width": "m", "depth": "m", "diameter": "m",
    "outer_diameter": "m", "inner_diameter": "m", "area": "m^2", "second_moment": "m^4", "density": "kg/m^3",
    "youngs_modulus": "Pa", "shear_modulus": "Pa", "damping": "s", "inertia": "kg m^2", "rotor_inertia": "kg m^2",
    "mass": "kg", "friction": "N m s/rad", "rotor_friction": "N m s/rad", "rotational_stiffness": "N m/rad",
    "stiffness": "N m/rad", "resistance": "ohm", "inductance": "H", "torque_constant": "N m/A",
    "back_emf_constant": "V s/rad", "delay": "s",
}  # fmt: skip
SIX = singly(general, 6)  # digits of what was measured: more than its noise leaves
NINE = singly(general, 9)  # of the frequencies of its lines


def known(value: float | None, digits: int) -> str:
    """A number's digits, or a dash where there is none."""
    return "-" if value is None else general(value, digits)


PARAMETER_COLUMNS = (
    Column("key", "number", of="key"),
    Column("unit", "unit", of=lambda one: number_unit(one.key)),
    Column("value", "value", of="value", digits=singly(general, 6)),
    Column("low", "from", of="low", digits=singly(known, 6)),
    Column("high", "to", of="high", digits=singly(known, 6)),
    Column("std", "deviation", of="deviation", digits=singly(known, 3)),
    Column("identified", "known from these data", of=lambda one: "yes" if one.identified else "no"),
)


def number_unit(key: str) -> str:
    """The SI unit of a free number; "1" where it has none, or that of its response."""
    words = key.partition(":")[0].split(".")
    if words[-1] == "stiffness" and words[0] == "attachment":
        return "N/m"
    return NUMBER_UNITS.get(words[-1], "1")


def parameters_table(fit: Fit) -> Table:
    """The fitted numbers with their intervals."""
    return Table(columns=PARAMETER_COLUMNS, record=list(fit.parameters), stem="fit", title="Fitted numbers")


def fit_answer(fit: Fit) -> dict[str, Any]:
    """The fitted numbers and arm, what the data leave open, and whether the arm explains them."""
    rows = resonances(fit)
    return {
        "arm_name": fit.before.name,
        "converged": fit.converged,
        "verdict": fit.verdict,
        "parameters": {
            one.key: {
                "value": one.value,
                "low": one.low,
                "high": one.high,
                "std": one.deviation,
                "identified": one.identified,
                "unit": number_unit(one.key),
                "start": free.start,
            }
            for one, free in zip(fit.parameters, fit.solution.problem.parameters, strict=True)
        },
        "level": CONFIDENCE,
        "not_determined": list(fit.not_determined),
        "frequencies_hz": {key: [row[n] for row in rows] for n, key in enumerate(("before", "after", "measured"))},
        "rms_log_error": fit.rms_log_error,
        "chi_squared": fit.chi_squared,
        "freedom": fit.freedom,
        "explained": fit.is_explained,
        "unexplained_peaks_hz": [peak for _, after, peak in rows if after is None],
        "responses": [
            _response(each, rows) for each, rows in zip(fit.solution.problem.responses, fit.solution.parts, strict=True)
        ],
        "records": _records(fit),
        "starts": fit.solution.starts,
        "in_words": fit_in_words(fit),
        "arm": tomllib.loads(to_toml(fit.arm)),
    }


def _response(one: Response, residuals: Real) -> dict[str, Any]:
    return {
        "name": one.data.name,
        "source": one.data.source,
        "sha256": one.data.digest,
        "frequencies": int(one.data.omega.size),
        "from_hz": float(one.data.omega[0]) / (2 * np.pi),
        "to_hz": float(one.data.omega[-1]) / (2 * np.pi),
        "noise": one.noise.road,
        "chi_squared": float(residuals @ residuals),
    }


def _records(fit: Fit) -> dict[str, Any] | None:
    """What the scatter between the records of one response says, where there are three of them or more."""
    found = repeats(fit)
    if found is None:
        return None
    wider = dict(zip(found.keys, found.times_wider.tolist(), strict=True))
    told = [f"{key} {times:.3g} times" for key, times in wider.items() if times > WIDER]
    words = f"drawn anew from {len(found.each)} records of {found.response}, "
    words += (
        f"the numbers scatter more than their noise says: {listed(told)}"
        if told
        else "they scatter as their noise says"
    )
    return {
        "response": found.response,
        "count": len(found.each),
        "each": [dict(zip(found.keys, row, strict=True)) for row in found.each.tolist()],
        "intervals": dict(zip(found.keys, found.intervals.tolist(), strict=True)),
        "times_wider": wider,
        "in_words": words,
    }


def resonances(fit: Fit) -> list[tuple[float | None, float | None, float]]:
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
            found[data.input, round(math.log(peak) / SAME_PEAK)] = (row[0], row[1], peak / HERTZ)
    return sorted(found.values(), key=lambda row: row[2])


def fit_in_words(fit: Fit) -> str:
    """One sentence: whether the search ended, what is known, and whether the arm explains the data."""
    known = [each.key for each in fit.parameters if each.identified]
    parts = [f"{len(known)} of {len(fit.parameters)} numbers are known from these data"]
    if not fit.converged:
        parts.insert(0, "the search did not end: these are the best numbers so far")
    share = fit.chi_squared / max(fit.freedom, 1)
    if fit.is_explained is None:
        parts.append(
            "the size of the noise was taken from the residuals, so that they cannot say whether the arm is right"
        )
    elif fit.is_explained:
        parts.append(f"arm and noise explain them (chi-squared {share:.3g} a degree of freedom)")
    else:
        parts.append(
            f"THE ARM DOES NOT EXPLAIN THEM: chi-squared is {share:.3g} a degree of freedom, and the intervals, which"
            " rest on the noise alone, are too narrow"
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
        Column("hz", "frequency", "Hz", of=lambda one: one.omega / HERTZ, digits=NINE),
        Column("re", f"Re {data.name}", of=lambda one: one.values.real, digits=SIX),
        Column("im", "Im", of=lambda one: one.values.imag, digits=SIX),
    ]
    if data.sigma is not None:
        columns.append(Column("sigma", "sigma", digits=SIX))
    if data.coherence is not None:
        columns.append(Column("coherence", "coherence", digits=SIX))
    if data.averages is not None:
        columns.append(Column("averages", of=lambda one: [one.averages] * one.omega.size, on=(FILES,)))
    return Table(columns=tuple(columns), record=data)


def estimate_answer(found: Estimate) -> dict[str, Any]:
    """The response with what it was estimated by."""
    data = found.measured
    assert data.coherence is not None  # of an estimate it is known
    return {
        "record": data.source,
        "sha256": data.digest,
        "output": data.output,
        "input": data.input,
        "estimator": found.estimator,
        "window": found.window,
        "segment_s": found.segment,
        "segments": found.segments,
        "overlap": found.overlap,
        "independent_averages": found.independent,
        "resolution_hz": found.resolution,
        "median_coherence": float(np.median(data.coherence)),
        "note": found.clock,
        "response": measured_table(data),
    }


RING_COLUMNS = (
    Column("mode", of=lambda one: range(1, one.poles.size + 1)),
    Column("frequency_hz", "frequency", "Hz", of=lambda one: one.frequency / HERTZ, digits=singly(general, 7)),
    Column("frequency_low_hz", "from", "Hz", of=lambda one: _reaches(one)[0], digits=singly(general, 7)),
    Column("frequency_high_hz", "to", "Hz", of=lambda one: _reaches(one)[1], digits=singly(general, 7)),
    Column("frequency_std_hz", of=lambda one: one.frequency_std / HERTZ, on=(JSON,)),
    Column("natural_frequency_hz", of=lambda one: one.natural_frequency / HERTZ, on=(JSON,)),
    Column("damping_ratio", "damping ratio", digits=singly(general, 4)),
    Column("damping_ratio_low", "from", of=lambda one: _reaches(one)[2], digits=singly(general, 4)),
    Column("damping_ratio_high", "to", of=lambda one: _reaches(one)[3], digits=singly(general, 4)),
    Column("damping_ratio_std", on=(JSON,)),
    Column("amplitude", "amplitude at the start", digits=singly(general, 4), on=ANSWER),
    Column("mode_option", of=lambda one: _options(one), on=(JSON,)),
    Column("frequency_first_half_hz", of=lambda one: _told(one, one.early), on=(JSON,)),
    Column("frequency_second_half_hz", of=lambda one: _told(one, one.late), on=(JSON,)),
)


def _reaches(one: Ring) -> tuple[Any, ...]:
    """Ends of the intervals: of the frequency [Hz], of the damping ratio."""
    f, df = one.frequency / HERTZ, one.reach * one.frequency_std / HERTZ
    z, dz = one.damping_ratio, one.reach * one.damping_ratio_std
    return f - df, f + df, z - dz, z + dz


def _options(one: Ring) -> list[str]:
    """What `tfarm fit --mode N=` takes of each mode, with deviations; without a ratio that is not positive."""
    found = []
    columns = (one.frequency / HERTZ, one.frequency_std / HERTZ, one.damping_ratio, one.damping_ratio_std)
    for hz, deviation, ratio, spread in zip(*columns, strict=True):
        damping = f",{ratio:.6g}~{spread:.3g}" if 0 < ratio < 1 and spread > 0 else ""
        found.append(f"{hz:.8g}hz~{deviation:.3g}{damping}")
    return found


def _told(one: Ring, w: Any) -> list[Any]:
    told = np.isfinite(one.halves_std)
    return [each / HERTZ if known else MISSING for each, known in zip(w.tolist(), told.tolist(), strict=True)]


def ring_answer(found: Ring) -> dict[str, Any]:
    """The modes of a decay with their intervals, and what is to be said of these."""
    return {
        "record": found.source,
        "signal": found.signal,
        "from_s": found.start,
        "to_s": found.stop,
        "samples": found.samples,
        "level": CONFIDENCE,
        "modes": Table(columns=RING_COLUMNS, record=found),
        "residual_rms": found.residual,
        "residuals_white": found.is_white,
        "whiteness_probability": found.white,
        "notes": list(found.notes),
    }
