"""The answers of `tfarm frf` and `tfarm ring`, and their tables."""

from __future__ import annotations

from typing import Any

import numpy as np

from tfarm.columns import ANSWER, FILES, JSON, Column, Table
from tfarm.digits import general, singly
from tfarm.errors import MISSING
from tfarm.response.answers import HERTZ

from .data import Measured
from .noise import CONFIDENCE
from .ringdown import Ring
from .spectra import Estimate

SIX = singly(general, 6)  # digits of what was measured: more than its noise leaves
NINE = singly(general, 9)  # of the frequencies of its lines


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
