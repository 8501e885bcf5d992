"""The charts of the live page, by Vega-Lite: what they draw is put into their data sets by the page as the gains move.

Colours in "@..." are set by the page, for a light screen or a dark one.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import altair as alt
import vl_convert

from tfarm.arm import PLANE

PAGE_INK, PAGE_GREY, PAGE_FAINT = "@ink", "@grey", "@faint"
PAGE_BLUE, PAGE_ORANGE, PAGE_GREEN = "@blue", "@orange", "@green"
CHART_WIDTH, ROW_HEIGHT, SLEW_ROW_HEIGHT, SQUARE_SIDE = 620, 170, 100, 300  # pixels, until the page fits them in
NYQUIST_REACH = 2.5  # of the Nyquist plane to either side of 0, before it is zoomed
S_PLANE = {"re": "Re s [1/s]", "im": "Im s [rad/s]"}
Z_REACH = 1.25  # of the z-plane to either side of 0
PHASE_TICKS = [-180, -90, 0, 90, 180]
CROSS_PATH = "M-.7,-.7L.7,.7M-.7,.7L.7,-.7"
ZOOM_SHIFTED = "wheel![event.shiftKey]"  # so that a page can be scrolled over a chart


@cache
def charts() -> dict[str, dict[str, Any]]:
    """The charts by name as Vega, which the runtime draws without Vega-Lite's compiler.

    The axes of "map" and "poles" each page sets to its arm's.
    """
    made = {
        "bode": _bode(),
        "nyquist": _nyquist(),
        "poles": _poles(),
        "zplane": _zplane(),
        "map": _map(),
        "slew": _slew(),
        "sensor": _sensor(),
    }
    words = {"labelColor": PAGE_GREY, "titleColor": PAGE_GREY}
    lines = {"gridColor": PAGE_FAINT, "domainColor": PAGE_GREY, "tickColor": PAGE_GREY}
    compiled = {}
    for name, chart in made.items():
        framed = chart.configure(background="transparent", padding=4).configure_view(stroke=PAGE_FAINT)
        framed = framed.configure_axis(**words, **lines, titleFontWeight="normal")
        framed = framed.configure_legend(**words, orient="top", title=None, symbolType="stroke")
        compiled[name] = dict(vl_convert.vegalite_to_vega(framed.to_dict()))
    return compiled


def _data(name: str) -> Any:
    return alt.NamedData(name=name)


def _bode() -> Any:
    """|L|, its angle above -180 degrees, |S| and |T| over w, their margins as upright lines; zoom is one for all."""
    zoom = alt.selection_interval(name="zoom", bind="scales", encodings=["x"], zoom=ZOOM_SHIFTED)
    ticks, scale = alt.Axis(format=".3~r", tickCount=8), alt.Scale(type="log", nice=False)
    x = alt.X("w:Q", scale=scale, title=None, axis=ticks)
    below = alt.X("w:Q", scale=scale, title="frequency [rad/s]", axis=ticks)
    magnitude = _row(
        "L",
        x,
        [_line("dB", PAGE_BLUE), _zero_line(), _stems("gain", PAGE_ORANGE)],
        alt.Scale(domain=[-80, 60]),
        "|L| [dB]",
    )
    phase = _row(
        "phase",
        x,
        [_line("angle", PAGE_BLUE, detail="branch"), _zero_line(), _stems("phase", PAGE_ORANGE)],
        alt.Scale(domain=[-180, 180], nice=False),
        "angle of −L [deg]",
    )
    sensitivity = _row(
        "S",
        below,
        [_line("S", PAGE_GREEN), _line("T", PAGE_ORANGE), _zero_line(), _stems("peak", PAGE_GREY)],
        alt.Scale(domain=[-60, 30]),
        "|S| and |T| [dB]",
    )
    return alt.vconcat(magnitude.add_params(zoom), phase, sensitivity, spacing=8).resolve_scale(x="shared")


def _row(name: str, x: Any, layers: list[Any], scale: Any, title: str) -> Any:
    """Layers over w, the lines in their order, and the line at the cursor."""
    y = alt.Y("y:Q", scale=scale, title=title, axis=alt.Axis(values=PHASE_TICKS) if name == "phase" else alt.Axis())
    drawn = [layer.encode(x=x, y=y) if layer.mark.type != "rule" else layer for layer in layers]
    at = alt.Chart(_data("cursor_at")).mark_rule(color=PAGE_GREY, strokeDash=[3, 3]).encode(x="w:Q")
    return alt.layer(*drawn, at).properties(width=CHART_WIDTH, height=ROW_HEIGHT, name=name)


def _line(of: str, colour: str, detail: str = "") -> Any:
    chart = (
        alt.Chart(_data("curve"))
        .transform_calculate(y=f"datum.{of}")
        .mark_line(color=colour, clip=True, strokeWidth=1.4)
    )
    return chart.encode(order="w:Q", detail=f"{detail}:N") if detail else chart.encode(order="w:Q")


def _zero_line() -> Any:
    """A line at 0."""
    return alt.Chart(alt.InlineData([{"y": 0}])).mark_rule(color=PAGE_GREY).encode(y="y:Q")


def _stems(kind: str, colour: str) -> Any:
    """Margins as lines from the level that they are counted from."""
    chart = alt.Chart(_data("stems")).transform_filter(f"datum.kind == '{kind}'")
    return chart.mark_rule(color=colour, strokeWidth=2, clip=True).encode(x="w:Q", y="low:Q", y2="high:Q")


def _nyquist() -> Any:
    """L(i w) for w > 0, the unit circle, the disk that the disk margin keeps free, and -1."""
    zoom = alt.selection_interval(name="zoom", bind="scales", zoom=ZOOM_SHIFTED)
    plane = {
        "x": alt.X("x:Q", scale=alt.Scale(domain=[-NYQUIST_REACH, NYQUIST_REACH]), title="Re L"),
        "y": alt.Y("y:Q", scale=alt.Scale(domain=[-NYQUIST_REACH, NYQUIST_REACH]), title="Im L"),
    }
    curve = alt.Chart(_data("curve")).mark_line(color=PAGE_BLUE, clip=True, strokeWidth=1.4)
    rings = alt.Chart(_data("rings")).mark_line(clip=True, strokeWidth=1.2)
    colours = alt.Scale(domain=["unit circle", "disk margin"], range=[PAGE_GREY, PAGE_ORANGE])
    rings = rings.encode(**plane, order="t:Q", detail="ring:N", color=alt.Color("ring:N", scale=colours, title=None))
    critical = alt.Chart(alt.InlineData([{"x": -1, "y": 0}]))
    critical = critical.mark_point(shape="cross", color=PAGE_INK, size=90, filled=True)
    at = alt.Chart(_data("cursor_at")).mark_point(color=PAGE_BLUE, size=60, filled=True, clip=True).encode(**plane)
    layers = curve.encode(**plane, order="w:Q").add_params(zoom), rings, critical.encode(**plane), at
    return alt.layer(*layers).properties(width=SQUARE_SIDE, height=SQUARE_SIDE)


def _poles() -> Any:
    """Closed-loop poles near the axis on the locus of one gain, with lines of equal damping ratio."""
    plain = alt.Axis(format=".6~g")
    x = alt.X("re:Q", title="Re s [1/s]", scale=alt.Scale(nice=False), axis=plain)
    y = alt.Y("im:Q", title="Im s [rad/s]", scale=alt.Scale(nice=False), axis=plain)
    names = (
        alt.Chart(_data("rays"))
        .transform_filter("datum.end")
        .mark_text(color=PAGE_GREY, align="left", dx=3, fontSize=10)
    )
    axis = alt.Chart(alt.InlineData([{"x": 0}])).mark_rule(color=PAGE_GREY).encode(x="x:Q")
    tips = [alt.Tooltip(f"{key}:Q", title=title) for key, title in S_PLANE.items()]
    layers = (
        _grid(x, y),
        names.encode(x=x, y=y, text="ratio:N"),
        axis,
        *_locus(x, y),
        _crosses("datum.re < 0", [*tips, "Hz:N", "damping ratio:N"]).encode(x=x, y=y),
    )
    return alt.layer(*layers).properties(width=SQUARE_SIDE, height=SQUARE_SIDE)


def _zplane() -> Any:
    """The same of the sampled loop: z, with the unit circle."""
    x = alt.X("re:Q", title="Re z", scale=alt.Scale(domain=[-Z_REACH, Z_REACH], nice=False))
    y = alt.Y("im:Q", title="Im z", scale=alt.Scale(domain=[-Z_REACH, Z_REACH], nice=False))
    circle = alt.Chart(_data("circle")).mark_line(color=PAGE_GREY, strokeWidth=1.2).encode(x=x, y=y, order="q:Q")
    tips = [
        alt.Tooltip("re:Q", title="Re z"),
        alt.Tooltip("im:Q", title="Im z"),
        alt.Tooltip("growth:N", title="ln|z|"),
    ]
    layers = (_grid(x, y), circle, *_locus(x, y), _crosses("datum.inside", tips).encode(x=x, y=y))
    return alt.layer(*layers).properties(width=SQUARE_SIDE, height=SQUARE_SIDE)


def _grid(x: Any, y: Any) -> Any:
    """Lines of equal damping ratio."""
    rays = alt.Chart(_data("rays")).mark_line(color=PAGE_FAINT, clip=True, strokeDash=[4, 3])
    return rays.encode(x=x, y=y, detail="ratio:N", order="at:Q")


def _locus(x: Any, y: Any) -> tuple[Any, Any]:
    """Where poles go as one gain goes along its axis, and the place that is pointed at."""
    lines = alt.Chart(_data("locus")).mark_line(color=PAGE_GREEN, clip=True, strokeWidth=1.2)
    at = alt.Chart(_data("pointed")).mark_point(color=PAGE_GREEN, size=60, filled=True, clip=True)
    return lines.encode(x=x, y=y, detail="piece:N", order="gain:Q"), at.encode(x=x, y=y)


def _crosses(good: str, tips: list[Any]) -> Any:
    points = alt.Chart(_data("poles")).mark_point(shape=CROSS_PATH, size=90, strokeWidth=1.8, clip=True)
    return points.encode(color=alt.condition(good, alt.value(PAGE_BLUE), alt.value(PAGE_ORANGE)), tooltip=tips)


def _slew() -> Any:
    """Hub angle with its reference, torque, root moment and tip over time."""
    ticks = alt.Axis(tickCount=8)
    x = alt.X("t:Q", title=None, axis=ticks, scale=alt.Scale(nice=False))
    below = alt.X("t:Q", title="time [s]", axis=ticks, scale=alt.Scale(nice=False))
    reference = alt.Chart(_data("torque")).mark_line(color=PAGE_GREY, strokeDash=[5, 3]).encode(y="reference:Q")
    torque = alt.Chart(_data("torque")).mark_line(color=PAGE_ORANGE, interpolate="step-after", strokeWidth=1.2)
    rows = (
        [_trace("angle", PAGE_BLUE, "hub angle [rad]", x), reference.encode(x=x)],
        [torque.encode(x=x, y=alt.Y("torque:Q", title="@drive"))],
        [_trace("moment", PAGE_BLUE, "root moment [N m]", x)],
        [_trace("tip", PAGE_GREEN, "tip, off a rigid arm [m]", below)],
    )
    drawn = [alt.layer(*layers).properties(width=CHART_WIDTH, height=SLEW_ROW_HEIGHT) for layers in rows]
    return alt.vconcat(*drawn, spacing=8).resolve_scale(x="shared")


def _sensor() -> Any:
    """Zeros over the sensor's position, natural frequencies across, and the position that is looked at."""
    x = alt.X("x:Q", title="sensor at x [m] from the clamp", scale=alt.Scale(nice=False), axis=alt.Axis(tickCount=5))
    y = alt.Y("w:Q", title="frequency [rad/s]", scale=alt.Scale(type="log", nice=False), axis=alt.Axis(format=".3~r"))
    kinds = ["zero on or left of the imaginary axis", "zero right of it"]
    legend = alt.Legend(columns=1, symbolType="circle", labelLimit=260)
    colour = alt.Color(
        "kind:N", scale=alt.Scale(domain=kinds, range=[PAGE_GREEN, PAGE_ORANGE]), legend=legend, title=None
    )
    tips = [alt.Tooltip(f"{key}:Q", title=title) for key, title in (("x", "x [m]"), *S_PLANE.items())]
    zeros = alt.Chart(_data("zeros")).mark_point(shape="circle", size=36, filled=False, strokeWidth=1.6)
    modes = alt.Chart(_data("modes")).mark_rule(color=PAGE_BLUE, strokeDash=[5, 3])
    names = alt.Chart(_data("modes")).mark_text(color=PAGE_BLUE, align="left", dx=4, fontSize=10)
    here = alt.Chart(_data("here")).mark_rule(color=PAGE_GREY)
    layers = (
        modes.encode(y=y),
        names.encode(x=alt.value("width"), y=y, text="name:N"),
        here.encode(x=x),
        zeros.encode(x=x, y=y, color=colour, tooltip=tips),
    )
    return alt.layer(*layers).properties(width=SQUARE_SIDE, height=SQUARE_SIDE)


def _trace(name: str, colour: str, title: str, x: Any) -> Any:
    lines = alt.Chart(_data(name)).mark_line(color=colour, strokeWidth=1.2)
    return lines.encode(x=x, y=alt.Y("y:Q", title=title, axis=alt.Axis(tickCount=4)), order="i:Q")


def _map() -> Any:
    """The plane of both gains with its regions, the curve of poles on the axis with the third held, and the gains."""
    scale, ticks = alt.Scale(domain=[-1, 1], nice=False), alt.Axis(format=".3~r", grid=False)
    across, up = PLANE
    x, y = (each(f"{name}:Q", scale=scale, title=name, axis=ticks) for name, each in ((across, alt.X), (up, alt.Y)))
    low = alt.Y("low:Q", scale=scale, title=up, axis=ticks)
    keys = ["stable, continuous", "stable, sampled"]
    legend = alt.Legend(symbolType="square", columns=1, labelLimit=260)
    colour = alt.Color(
        "what:N", scale=alt.Scale(domain=keys, range=[PAGE_ORANGE, PAGE_BLUE]), title=None, legend=legend
    )
    areas = alt.Chart(_data("areas")).mark_area(opacity=0.28, clip=True)
    stale = alt.Chart(_data("stale")).mark_area(color=PAGE_GREY, opacity=0.22, clip=True)
    edge = alt.Chart(_data("edge")).mark_line(color=PAGE_ORANGE, strokeWidth=1, clip=True)
    proven = alt.Chart(_data("proven")).mark_line(color=PAGE_GREEN, strokeWidth=1.5, strokeDash=[5, 3], clip=True)
    here = alt.Chart(_data("here"))
    layers = (
        stale.encode(x=x, y=low, y2="high:Q", detail="part:N"),
        areas.encode(x=x, y=low, y2="high:Q", color=colour, detail="part:N"),
        edge.encode(x=x, y=y, order="w:Q", detail="piece:N"),
        proven.encode(x=x, y=y, order="t:Q"),
        here.mark_rule(color=PAGE_GREY).encode(x=x),
        here.mark_rule(color=PAGE_GREY).encode(y=y),
        here.mark_point(color=PAGE_INK, size=110, filled=True).encode(x=x, y=y),
    )
    return alt.layer(*layers).properties(width=SQUARE_SIDE, height=SQUARE_SIDE)
