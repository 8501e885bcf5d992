"""Runs that were measured under laws, with the exact sampled loop over them: the picture, and both in numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tfarm.columns import Column, Table
from tfarm.digits import plain, significant, singly
from tfarm.dsp import Chain
from tfarm.fitting.recording import Beside, beside_exact, overshoot
from tfarm.plots.motion import draw_beside
from tfarm.report.given_laws import LawOnArm
from tfarm.report.sections import Picture

MEASURED_CAPTION = (
    "Grey: what the controller was led by. Orange: measured. Blue: the exact sampled loop, led by the same reference "
    "from rest, with the steps and limits of its chain; drawn from the first reference on. {sources} {assumed}"
)
ASSUMED_WORDS = (
    "The exact loop is linear but for that chain: no dry friction, which on a rig holds the hub off its reference at "
    "the end and at the beginning; the controller starts from rest, without what it had gathered before; nothing is "
    "fitted."
)
OVERSHOOT_CAPTION = (
    "Overshoot: how far the hub goes beyond the last reference, as a share of the whole step; below 0 it never gets "
    "there. Off at the end: hub angle less reference at the last sample. Apart: root mean square of computed less "
    "measured."
)


def measured_blocks(named: Sequence[LawOnArm], chain: Chain) -> list[Picture | Table]:
    """Each measured run with the exact loop over it, and both in numbers."""
    found = {
        each.name: beside_exact(each.arm, each.law, chain, each.measured) for each in named if each.measured is not None
    }
    sources = " ".join(f"{name}: {it.measured.source}." for name, it in found.items() if it.measured.source)
    steps = ", ".join(f"{name} by {plain(math.degrees(it.measured.step), 3)} deg" for name, it in found.items())
    picture = Picture(
        stem="sampled-measured",
        title="Measured on the rig, and computed",
        caption=MEASURED_CAPTION.format(sources=sources, assumed=ASSUMED_WORDS),
        alt=f"Hub angle and root moment over time, measured and computed: {steps}.",
        figure=draw_beside("Measured steps, and the exact sampled loop", found),
        data=beside_table({each.key: found[each.name] for each in named if each.name in found}),
    )
    angles = {name: it for name, it in found.items() if it.measured.hub_angle.size}
    return [picture, *([overshoot_table(angles)] if angles else [])]


def overshoot_table(found: Mapping[str, Beside]) -> Table:
    """A row a law: overshoot, where it ends, and the greatest moment, measured and computed."""
    rows: list[dict[str, list[float | str]]] = []
    for it in found.values():
        measured, end, angles = it.measured, float(it.measured.reference[-1]), (it.measured.hub_angle, it.hub_angle)
        moment, computed = measured.root_moment, float(abs(it.run.at_samples.root_moment).max())
        rows.append({
            "overshoot": [100 * overshoot(angle, measured.step, end) for angle in angles],
            "end": [math.degrees(angle[-1] - end) for angle in angles],
            "moment": [float(abs(moment).max()) if moment.size else "", computed],
        })  # fmt: skip
    titles = {"overshoot": ("overshoot", "%"), "end": ("off at the end", "deg"), "moment": ("largest |moment|", "N m")}
    columns = [Column("law", "law", of=list(found)),
               Column("step_deg", "step", "deg", of=[math.degrees(it.measured.step) for it in found.values()],
                      digits=singly(plain, 4))]  # fmt: skip
    for key, (title, unit) in titles.items():
        for place, which in enumerate(("measured", "computed")):
            values = [row[key][place] for row in rows]
            name = f"{key}_{which}_{unit.replace('%', 'percent').replace(' ', '_')}"
            columns.append(Column(name, which, unit, of=values, digits=singly(significant, 3), group=title))
    apart = [math.degrees(it.difference_rms) for it in found.values()]
    columns.append(Column("apart_rms_deg", "apart, rms", "deg", of=apart, digits=singly(significant, 3)))
    title = "Measured and computed, in numbers"
    return Table(stem="sampled-overshoot", title=title, caption=OVERSHOOT_CAPTION, columns=tuple(columns))


def beside_table(found: Mapping[str, Beside]) -> Table:
    """What the picture draws: a row a sample, measured values taken between their rows."""
    t = min((it.run.t for it in found.values()), key=len)
    columns = [Column("t_s", "time", "s", of=t)]
    for key, it in found.items():
        measured = it.measured
        columns.append(
            Column(f"reference_{key}_rad", "reference", "rad", of=np.interp(t, measured.t, measured.reference))
        )
        for name, unit, values, computed in (
            ("hub_angle", "rad", measured.hub_angle, it.hub_angle),
            ("root_moment", "N_m", measured.root_moment, it.run.at_samples.root_moment),
        ):
            if values.size:
                columns.append(Column(f"{name}_measured_{key}_{unit}", name, of=np.interp(t, measured.t, values)))
            columns.append(Column(f"{name}_computed_{key}_{unit}", name, of=computed[: t.size]))
    return Table(stem="sampled-measured-data", title="Measured and computed", columns=tuple(columns))
