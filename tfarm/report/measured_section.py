"""Measured responses on an arm's page: over the exact ones, mode by mode, and what would explain them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from tfarm.arm import Arm
from tfarm.columns import Table
from tfarm.digits import general, plain
from tfarm.fitting.data import Measured
from tfarm.fitting.overlay import Overlay, overlay
from tfarm.fitting.overlay_answer import curves_table, overlay_answer, required_table
from tfarm.plots.overlaid import draw_measured
from tfarm.report.sections import Picture, Section
from tfarm.report.words import typeset

MODES = (
    "A pole and its residue are fitted to the lines around each measured peak; off: measured against exact frequency; "
    "residue: measured over exact, in dB, and the angle it is turned by, 180 degrees for a sensor of the other sign."
)
REQUIRED = "What each number would have to change by to explain that mode alone, to first order in logarithms."


def measured_section(arm: Arm, measured: Sequence[Measured]) -> Section:
    """Each response over the exact one, with what differs."""
    blocks: list[Picture | Table] = []
    words: list[str] = []
    for number, one in enumerate(measured, start=1):
        found = overlay(arm, one)
        answer = overlay_answer(found)
        label = f"-{number}" if len(measured) > 1 else ""
        blocks.append(_picture(found, f"measured{label}"))
        if len(answer["modes"]):
            blocks.append(replace(answer["modes"], stem=f"measured-modes{label}", title="Mode by mode", caption=MODES))
        if (required := required_table(answer)) is not None:
            blocks.append(
                replace(required, stem=f"measured-required{label}", title="What would explain it", caption=REQUIRED)
            )
        words.append(typeset(_in_words(found)))
    return Section(anchor="bode-measured", title="Measured over exact", words=words, blocks=blocks)


def _picture(found: Overlay, stem: str) -> Picture:
    name = found.measured.name
    return Picture(
        stem=stem,
        title=name,
        caption="Points: as measured. Blue: the exact response of the arm as its file has it, nothing fitted.",
        alt=f"Measured and exact response {name}.",
        figure=draw_measured(found),
        data=replace(curves_table(found), stem=f"{stem}-data", title=name, is_data=True),
    )


def _in_words(found: Overlay) -> str:
    away = general(found.rms_log_error, 3)
    words = f"{found.measured.name}: the rms of ln(measured/exact) is {away}."
    peaks = [plain(float(peak) / (2 * math.pi), 5) for peak in found.unmatched]
    return f"{words} Peaks at {', '.join(peaks)} Hz are none of the arm's." if peaks else words
