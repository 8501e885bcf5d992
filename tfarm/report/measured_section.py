"""Measured responses on an arm's page: over the exact ones, mode by mode, and what would explain them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from tfarm.arm import Arm
from tfarm.columns import Table
from tfarm.digits import general, plain
from tfarm.fitting.data import Measured
from tfarm.fitting.overlay import overlay
from tfarm.fitting.overlay_answer import curves_table, overlay_answer, required_table
from tfarm.plots.overlaid import draw_measured
from tfarm.report.sections import PageSection, Picture
from tfarm.report.words import typeset

MODES_CAPTION = (
    "A pole and its residue are fitted to the lines around each measured peak; off: measured against exact frequency; "
    "residue: measured over exact, in dB, and the angle it is turned by, 180 degrees for a sensor of the other sign."
)
REQUIRED_CAPTION = "What each number would have to change by to explain that mode alone, to first order in logarithms."
CURVES_CAPTION = "Points: as measured. Blue: the exact response of the arm as its file has it, nothing fitted."


def measured_section(arm: Arm, measured: Sequence[Measured]) -> PageSection:
    """Each response over the exact one, with what differs."""
    blocks: list[Picture | Table] = []
    words: list[str] = []
    for number, one in enumerate(measured, start=1):
        found = overlay(arm, one)
        answer, name = overlay_answer(found), found.measured.name
        label = f"-{number}" if len(measured) > 1 else ""
        curves = replace(curves_table(found), stem=f"measured{label}-data", title=name)
        blocks.append(Picture(
            stem=f"measured{label}", title=name, caption=CURVES_CAPTION,
            alt=f"Measured and exact response {name}.", figure=draw_measured(found), data=curves,
        ))  # fmt: skip
        if len(answer["modes"]):
            table = replace(answer["modes"], stem=f"measured-modes{label}", title="Mode by mode", caption=MODES_CAPTION)
            blocks.append(table)
        if (required := required_table(answer)) is not None:
            stem = f"measured-required{label}"
            blocks.append(replace(required, stem=stem, title="What would explain it", caption=REQUIRED_CAPTION))
        words.append(typeset(f"{name}: the rms of ln(measured/exact) is {general(found.rms_log_error, 3)}."))
        if peaks := [plain(float(peak) / (2 * math.pi), 5) for peak in found.unmatched]:
            words[-1] += typeset(f" Peaks at {', '.join(peaks)} Hz are none of the arm's.")
    return PageSection(anchor="bode-measured", title="Measured over exact", words=words, blocks=blocks)
