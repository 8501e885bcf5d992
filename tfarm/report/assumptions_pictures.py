"""Natural frequencies over the depth of the section and over the hub inertia, drawn: curves, candidates, the arm."""

from __future__ import annotations

import numpy as np

from tfarm.arrays import Real
from tfarm.audit.assumptions import HubStudy, SectionStudy, hub_study, section_study
from tfarm.audit.candidates import Study
from tfarm.columns import Column, Table
from tfarm.digits import plain, significant
from tfarm.plots.assumptions import CURVE_COLOURS, draw_over
from tfarm.report.sections import Picture

CURVE_POINTS = 49  # of each curve, which bends slowly on two logarithmic axes

SECTION_PICTURE = (
    "First natural frequencies over the depth of a rectangle of this area, exact (C = 0), both axes logarithmic. The "
    "dashed line and the filled dots are this arm{equivalent}. As long as the arm is slender all curves rise in "
    "proportion to the depth; they bend where shear and rotary inertia begin to tell."
)
EQUIVALENT = " (as the rectangle with its area and second moment; shear factor unchanged)"
HUB_PICTURE = (
    "First natural frequencies over the hub inertia, exact (C = 0), both axes logarithmic. The dashed line and the "
    "filled dots are this arm. Bars at the edges are the limits of each mode: a free pin (left), a locked hub (right)."
)
RISING, FALLING = "all rising", "all falling"


def section_picture(study: SectionStudy) -> Picture:
    arm = study.arm
    curve = section_study(arm, _between(study.depth))
    equivalent = "" if arm.link.section.shape == "rectangle" else EQUIVALENT
    words = _ends_in_words(study, study.depth, "m")
    return Picture(
        stem="assumptions-depth",
        title="Natural frequencies over the depth of the section",
        caption=SECTION_PICTURE.format(equivalent=equivalent),
        alt=f"Natural frequencies 1 to {len(CURVE_COLOURS)} over depth, {_way(curve)}; {words}",
        figure=draw_over(curve, curve.depth, study, study.depth, "depth of the rectangle, in the plane of bending [m]"),
        data=_data("assumptions-depth-data", Column("depth_m", "depth", "m", of=curve.depth), curve),
    )


def hub_picture(study: HubStudy) -> Picture:
    curve = hub_study(study.arm, _between(study.hub_inertia))
    inertia = Column("hub_inertia_kg_m2", "hub inertia", "kg m^2", of=curve.hub_inertia)
    words = _ends_in_words(study, study.hub_inertia, "kg m²")
    return Picture(
        stem="assumptions-inertia",
        title="Natural frequencies over the hub inertia",
        caption=HUB_PICTURE,
        alt=f"Natural frequencies 1 to {len(CURVE_COLOURS)} over hub inertia, {_way(curve)}; {words}",
        figure=draw_over(curve, curve.hub_inertia, study, study.hub_inertia, "hub inertia [kg m²]"),
        data=_data("assumptions-inertia-data", inertia, curve),
    )


def _way(curve: Study) -> str:
    """Whether all curves rise, all fall, or neither."""
    steps = np.diff(curve.natural_frequency, axis=0)
    return RISING if (steps > 0).all() else FALLING if (steps < 0).all() else "not all of them one way"


def _between(values: Real) -> list[float]:
    """The range of the candidates, evenly on a logarithmic axis."""
    return [float(x) for x in np.geomspace(values.min(), values.max(), CURVE_POINTS)]


def _ends_in_words(study: Study, values: Real, of: str) -> str:
    low, high = (significant(float(study.natural_frequency[i, 0]), 5) for i in (0, -1))
    least, most = (plain(float(values[i]), 4) for i in (0, -1))
    return f"the first goes from {low} rad/s at {least} {of} to {high} rad/s at {most} {of}."


def _data(stem: str, values: Column, curve: Study) -> Table:
    columns = [
        Column(f"mode_{i}_rad_s", f"mode {i}", "rad/s", of=omega)
        for i, omega in enumerate(curve.natural_frequency.T, 1)
    ]
    return Table(stem=stem, title="Natural frequencies", is_data=True, columns=(values, *columns))
