"""What the assumptions do: natural frequencies over the sections and the hub inertias that could be chosen."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from tfarm.arm import Arm
from tfarm.audit.assumptions import (
    HubStudy,
    SectionStudy,
    has_hub_inertia,
    hub_study,
    loop_verdicts,
    section_study,
)
from tfarm.report.digits import fixed, plain, significant
from tfarm.report.figures import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, Picture, blank, headline, style
from tfarm.report.paper import is_from_paper
from tfarm.report.sections import Section
from tfarm.report.tables import Column, Real, Table, data_column, number_column
from tfarm.spectrum.scales import default_gains

Study = SectionStudy | HubStudy

POINTS = 49  # of each curve
COLORS = (BLUE, ORANGE, GREEN, PURPLE)
OWN = "#eaf1f8"  # behind the row of the arm itself

FROM_PAPER = (
    "The paper prints the area of the section, but neither its second moment I nor the hub inertia I_h. Every "
    "frequency in rad/s on this page rests on the two values assumed for them: here is what other values would do."
)
NOT_FROM_PAPER = (
    "What would another section of the same area do, and another hub? Everything else is as this arm has it."
)
SECTION_WORDS = (
    "Rectangles of {area} m² with a depth of {least} to {most} m in the plane of bending: the first natural frequency "
    "runs from {low} to {high} rad/s; here, at {own} m, it is {here} rad/s, and one per cent more depth changes it by "
    "{slope} %."
)
HUB_WORDS = (
    "Hub inertias of {least} to {most} kg m^2: the first natural frequency runs from {low} to {high} rad/s; here, at "
    "{own} kg m^2, it is {here} rad/s, and one per cent more inertia changes it by {slope} %. No hub, however light or "
    "heavy, takes it outside {locked} to {pinned} rad/s."
)
NO_HUB = "The hub of this arm is {what}, so there is no inertia to choose."
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
SECTION_TABLE = (
    "The shaded row is this arm. Sensitivity: per cent of natural frequency for one per cent more of I, with the area, "
    "the shear factor and all else held, exact. As I = A depth²/12, one per cent of depth counts twice. A slender arm "
    "has 0.5 throughout."
)
HUB_TABLE = (
    "The shaded row is this arm. Sensitivity: per cent of natural frequency for one per cent more of I_h, all else "
    "held, exact. The closer to zero, the less that frequency depends on the hub."
)


def assumptions_section(arm: Arm) -> Section:
    """Frequencies over depth and over hub inertia, with sensitivities, each as a picture and as a table."""
    section = section_study(arm)
    words = [FROM_PAPER if is_from_paper(arm) else NOT_FROM_PAPER, _section_words(section)]
    blocks: list[Picture | Table] = [_section_picture(section), section_table(section)]
    if has_hub_inertia(arm):
        hub = hub_study(arm)
        words.append(_hub_words(hub))
        blocks += [_hub_picture(hub), hub_table(hub)]
    else:
        words.append(NO_HUB.format(what="locked" if arm.is_locked else "a free pin"))
    return Section(anchor="assumptions", title="What the assumptions do", words=words, blocks=blocks)


# ------------------------------------------------------------ words


def _section_words(study: SectionStudy) -> str:
    slope = fixed(2 * study.sensitivity[study.is_own][0, :1], 3)[0]
    area = plain(study.arm.link.section.area, 4)
    return SECTION_WORDS.format(area=area, slope=slope, **_ends(study.depth, study))


def _hub_words(study: HubStudy) -> str:
    slope = fixed(study.sensitivity[study.is_own][0, :1], 3)[0]
    limits = {"locked": significant(float(study.locked[0]), 5), "pinned": significant(float(study.pinned[0]), 5)}
    return HUB_WORDS.format(slope=slope, **limits, **_ends(study.hub_inertia, study))


def _ends(values: Real, study: Study) -> dict[str, str]:
    """The range of the candidates, that of the first frequency, and where the arm itself is."""
    first = study.natural_frequency[:, 0]
    own = int(np.flatnonzero(study.is_own)[0])
    texts = {"least": values.min(), "most": values.max(), "own": values[own]}
    frequencies = {"low": first.min(), "high": first.max(), "here": first[own]}
    return {name: plain(float(x), 4) for name, x in texts.items()} | {
        name: significant(float(x), 5) for name, x in frequencies.items()
    }


# ------------------------------------------------------------ tables


def section_table(study: SectionStudy) -> Table:
    """A row a candidate section."""
    size = (
        _value("depth_m", "depth", "m", study.depth, study),
        _value("width_m", "width", "m", study.width, study),
        _value("second_moment_m4", "I", "m⁴", study.second_moment, study),
    )
    return Table(
        stem="assumptions-section",
        title="Candidate sections: rectangles of this area",
        caption=SECTION_TABLE,
        columns=(_which(study), *size, *_modes(study), *_loop(study)),
    )


def hub_table(study: HubStudy) -> Table:
    """A row a hub inertia."""
    return Table(
        stem="assumptions-hub",
        title="Candidate hub inertias",
        caption=HUB_TABLE,
        columns=(
            _which(study),
            _value("hub_inertia_kg_m2", "I_h", "kg m²", study.hub_inertia, study),
            *_modes(study),
            *_loop(study),
        ),
    )


def _which(study: Study) -> Column:
    """Says in words what the shade says."""
    texts = ["this arm" if own else "" for own in study.is_own]
    return Column(key="is", title="", values=texts, cells=texts, tint=_tint(study))


def _value(key: str, title: str, of: str, values: Real, study: Study) -> Column:
    return number_column(key, title, of, values, [plain(float(x), 4) for x in values], tint=_tint(study))


def _modes(study: Study) -> Iterator[Column]:
    for i, omega in enumerate(study.natural_frequency.T, 1):
        cells = [significant(float(w), 6) for w in omega]
        yield number_column(
            f"mode_{i}_rad_s", f"mode {i}", "rad/s", omega, cells, group="natural frequency", tint=_tint(study)
        )
    for i, slope in enumerate(study.sensitivity.T, 1):
        yield number_column(
            f"mode_{i}_sensitivity", f"mode {i}", "%/%", slope, fixed(slope, 4), group="sensitivity", tint=_tint(study)
        )


def _loop(study: Study) -> Iterator[Column]:
    """The verdict on the default loop, and up to which K2 it stays stable; nothing where there is no loop."""
    verdicts = loop_verdicts(study)
    if verdicts is None:
        return
    words = [each.verdict for each in verdicts]
    edges = ["-" if each.K2_below is None else significant(each.K2_below, 6) for each in verdicts]
    law = default_gains(study.arm)
    group = f"loop at K1 = {law.K1:g}, K2 = {law.K2:g}"
    yield Column(key="verdict", title="verdict", values=words, cells=words, group=group, tint=_tint(study))
    values = ["" if each.K2_below is None else each.K2_below for each in verdicts]
    yield Column(key="K2_below", title="stable below K2", values=values, cells=edges, group=group, tint=_tint(study))


def _tint(study: Study) -> list[str]:
    return [OWN if own else "" for own in study.is_own]


# ------------------------------------------------------------ pictures


def _section_picture(study: SectionStudy) -> Picture:
    arm = study.arm
    curve = section_study(arm, _between(study.depth))
    equivalent = "" if _is_rectangle(arm) else EQUIVALENT
    return Picture(
        stem="assumptions-depth",
        title="Natural frequencies over the depth of the section",
        caption=SECTION_PICTURE.format(equivalent=equivalent),
        alt=f"Natural frequencies 1 to {len(COLORS)} over depth, all rising; {_ends_in_words(study, study.depth, 'm')}",
        figure=draw_over(curve, curve.depth, study, study.depth, "depth of the rectangle, in the plane of bending [m]"),
        data=_data("assumptions-depth-data", data_column("depth_m", "depth", "m", curve.depth), curve),
    )


def _hub_picture(study: HubStudy) -> Picture:
    curve = hub_study(study.arm, _between(study.hub_inertia))
    inertia = data_column("hub_inertia_kg_m2", "hub inertia", "kg m^2", curve.hub_inertia)
    words = _ends_in_words(study, study.hub_inertia, "kg m²")
    return Picture(
        stem="assumptions-inertia",
        title="Natural frequencies over the hub inertia",
        caption=HUB_PICTURE,
        alt=f"Natural frequencies 1 to {len(COLORS)} over hub inertia, all falling; {words}",
        figure=draw_over(curve, curve.hub_inertia, study, study.hub_inertia, "hub inertia [kg m²]"),
        data=_data("assumptions-inertia-data", inertia, curve),
    )


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
        data_column(f"mode_{i}_rad_s", f"mode {i}", "rad/s", omega)
        for i, omega in enumerate(curve.natural_frequency.T, 1)
    ]
    return Table(stem=stem, title="Natural frequencies", caption="", is_data=True, columns=(values, *columns))


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
