"""The answer of `tfarm response --measured`, and its tables."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tfarm.columns import JSON, Column, Table
from tfarm.digits import general, singly
from tfarm.errors import MISSING
from tfarm.response.answers import HERTZ

from .overlay import Counterpart, Overlay

DASH = "-"  # what was not measured, on a terminal


def _or_dash(digits: int) -> Any:
    return lambda values: [DASH if value is MISSING else general(value, digits) for value in values]


def _known(value: Any) -> Any:
    return MISSING if value is None else value


def _of(row: Counterpart, what: str) -> Any:
    """A number of the resonance that was measured, if one was told."""
    one, level = row.measured, row.level
    if one is None or (level is None and what in ("db", "deg")):
        return MISSING
    return {
        "hz": abs(one.pole) / HERTZ,
        "std": one.std[1] / HERTZ,
        "zeta": one.damping_ratio,
        "zeta_std": one.std[0] / abs(one.pole),
        "db": 20 * math.log10(abs(level)) if level else MISSING,
        "deg": math.degrees(np.angle(level)) if level else MISSING,
    }[what]


COUNTERPARTS = (
    Column("mode", "mode", of=lambda row: _known(row.mode), digits=_or_dash(3)),
    Column("exact_hz", "exact", "Hz", of=lambda row: abs(row.pole) / HERTZ, digits=singly(general, 7)),
    Column(
        "measured_hz",
        "measured",
        "Hz",
        of=lambda row: _known(None if row.frequency_ratio is None else row.frequency_ratio * abs(row.pole) / HERTZ),
        digits=_or_dash(7),
    ),
    Column("measured_std_hz", "+-", "Hz", of=lambda row: _of(row, "std"), digits=_or_dash(2)),
    Column(
        "frequency_residual_percent",
        "off",
        "%",
        of=lambda row: _known(None if row.frequency_ratio is None else 100 * (row.frequency_ratio - 1)),
        digits=_or_dash(3),
    ),
    Column("exact_damping_ratio", "damping exact", of="damping_ratio", digits=singly(general, 4)),
    Column("measured_damping_ratio", "measured", of=lambda row: _of(row, "zeta"), digits=_or_dash(4)),
    Column("measured_damping_ratio_std", "+-", of=lambda row: _of(row, "zeta_std"), digits=_or_dash(2)),
    Column("level_db", "residue", "dB", of=lambda row: _of(row, "db"), digits=_or_dash(3)),
    Column("level_degrees", "turned", "deg", of=lambda row: _of(row, "deg"), digits=_or_dash(3)),
    Column("is_peak_only", of=lambda row: row.peak is not None and row.measured is None, on=(JSON,)),
)


def overlay_answer(found: Overlay) -> dict[str, Any]:
    """Mode by mode what differs, poles and zeros of the ratio, and what would explain it."""
    data, roots = found.measured, found.roots
    return {
        "arm": found.arm.name,
        "output": data.output,
        "input": data.input,
        "unit": found.ratio.unit,
        "measured": data.source,
        "sha256": data.digest,
        "points": data.omega.size,
        "band_hz": [float(data.omega[0]) / HERTZ, float(data.omega[-1]) / HERTZ],
        "noise": found.noise.road,
        "rms_log_error": found.rms_log_error,
        "modes": Table(columns=COUNTERPARTS, record=list(found.beside)),
        "unmatched_peaks_hz": (found.unmatched / HERTZ).tolist(),
        "poles": _pairs(roots.poles),
        "zeros": _pairs(roots.zeros),
        "common": _pairs(roots.common),
        "power_at_zero": roots.at_zero,
        "roots_up_to_rad_s": roots.up_to,
        "required_percent": {
            name: {str(mode): 100 * (factor - 1) for mode, factor in factors.items()}
            for name, factors in found.required.items()
        },
    }


def required_table(answer: dict[str, Any]) -> Table | None:
    """A row a number of the arm, a column a mode; None where the poles are no modes, or none was measured."""
    required = answer["required_percent"]
    numbers = sorted({int(mode) for entries in required.values() for mode in entries})
    if not numbers:
        return None
    columns = [Column("parameter", "alone, to be changed by", of=list(required))]
    for mode in numbers:
        cells = [entries.get(str(mode), MISSING) for entries in required.values()]
        columns.append(Column(f"mode_{mode}", f"mode {mode}", "%", of=cells, digits=_or_dash(4)))
    return Table(columns=tuple(columns))


def curves_table(found: Overlay) -> Table:
    """A row a frequency: measured and exact, for a file."""
    data = found.measured
    columns = [
        Column("hz", "", "Hz", of=data.omega / HERTZ),
        Column("re", of=data.values.real),
        Column("im", of=data.values.imag),
        Column("exact_re", of=found.exact.real),
        Column("exact_im", of=found.exact.imag),
    ]
    return Table(columns=tuple(columns))


def _pairs(roots: Any) -> list[list[float]]:
    """[Re, Im] of each with Im >= 0, ascending."""
    upper = sorted((each for each in roots if each.imag >= 0), key=abs)
    return [[float(each.real), float(each.imag)] for each in upper]
