"""Natural frequencies over the depth of the section and over the hub inertia, drawn: curves, candidates, the arm."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from tfarm.arm import Arm
from tfarm.audit.assumptions import HubStudy, SectionStudy, hub_study, section_study
from tfarm.columns import Column, Table
from tfarm.digits import plain, significant
from tfarm.report.figures import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, Picture, blank, headline, style
from tfarm.response.frequency import Real

Study = SectionStudy | HubStudy

POINTS = 49  # of each curve
COLORS = (BLUE, ORANGE, GREEN, PURPLE)

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
    equivalent = "" if _is_rectangle(arm) else EQUIVALENT
    words = _ends_in_words(study, study.depth, "m")
    return Picture(
        stem="assumptions-depth",
        title="Natural frequencies over the depth of the section",
        caption=SECTION_PICTURE.format(equivalent=equivalent),
        alt=f"Natural frequencies 1 to {len(COLORS)} over depth, {_way(curve)}; {words}",
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
        alt=f"Natural frequencies 1 to {len(COLORS)} over hub inertia, {_way(curve)}; {words}",
        figure=draw_over(curve, curve.hub_inertia, study, study.hub_inertia, "hub inertia [kg m²]"),
        data=_data("assumptions-inertia-data", inertia, curve),
    )


def _way(curve: Study) -> str:
    """Whether all curves rise, all fall, or neither."""
    steps = np.diff(curve.natural_frequency, axis=0)
    return RISING if (steps > 0).all() else FALLING if (steps < 0).all() else "not all of them one way"


def _is_rectangle(arm: Arm) -> bool:
    return arm.link.section.shape == "rectangle"


def _between(values: Real) -> list[float]:
    """The range of the candidates, evenly on a logarithmic axis."""
    return [float(x) for x in np.geomspace(values.min(), values.max(), POINTS)]


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


def draw_over(curve: Study, x: Real, study: Study, candidates: Real, label: str) -> Figure:
    """Frequencies over one assumed parameter: curves, the candidates of the table as rings, the arm itself filled."""
    own = candidates[study.is_own][0]
    with style():
        figure = blank(9.0, 4.6)
        ax = figure.subplots()
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.axvline(own, color=INK, lw=1.0, ls=(0, (4, 3)), zorder=1.5)
        for number, (color, omega) in enumerate(zip(COLORS, curve.natural_frequency.T, strict=True), 1):
            ax.plot(x, omega, color=color)
            _mark(number, color, candidates, study, ax)
        if isinstance(study, HubStudy):
            _mark_limits(study, ax)
        _label_axes(label, ax)
        _leave_room(x, ax)
        headline(figure, f"{study.arm.name}: natural frequencies over the {_parameter(study)}")
    return figure


def _parameter(study: Study) -> str:
    return "hub inertia" if isinstance(study, HubStudy) else "depth of the section, at this area"


def _mark(number: int, color: str, candidates: Real, study: Study, ax: Axes) -> None:
    omega = study.natural_frequency[:, number - 1]
    own = study.is_own
    ax.plot(candidates[~own], omega[~own], "o", ms=4.5, mfc="white", mec=color, mew=1.1)
    ax.plot(candidates[own], omega[own], "o", ms=7.0, mfc=color, mec="white", mew=0.8, zorder=4)
    end = (candidates[-1], omega[-1])
    ax.annotate(
        f"mode {number}", end, textcoords="offset points", xytext=(8, 0), va="center", color=color, fontsize=9.0
    )


def _mark_limits(study: HubStudy, ax: Axes) -> None:
    """Short bars at the left edge for the free pin, at the right edge for the locked hub."""
    for omegas, low, high in ((study.pinned, 0.0, 0.018), (study.locked, 0.982, 1.0)):
        for color, omega in zip(COLORS, omegas, strict=True):
            if omega > 0:  # the first of an arm that its tip holds falls to 0: beyond a logarithmic axis
                ax.axhline(omega, low, high, color=color, lw=2.4)
    for place, text, side in ((0.0, "free pin", "left"), (1.0, "locked hub", "right")):
        ax.text(place, 1.015, text, transform=ax.transAxes, ha=side, fontsize=9.0, color=GREY)


def _label_axes(label: str, ax: Axes) -> None:
    ax.set_xlabel(label)
    ax.set_ylabel("natural frequency [rad/s]")
    ax.margins(y=0.09)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value, 3)))
        axis.set_minor_formatter(NullFormatter())


def _leave_room(x: Real, ax: Axes) -> None:
    """At the left for the bars, at the right for these and the modes' names."""
    span = float(x[-1] / x[0])
    ax.set_xlim(x[0] / span**0.06, x[-1] * span**0.13)
