"""Natural frequencies over the depth of the section or over the hub inertia: curves, candidates, the arm itself."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from tfarm.arrays import Real
from tfarm.audit.assumptions import HubStudy, Study
from tfarm.digits import plain

from .style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, blank, headline, style

CURVE_COLOURS = (BLUE, ORANGE, GREEN, PURPLE)  # of the modes, from the first on


def draw_over(curve: Study, x: Real, study: Study, candidates: Real, label: str) -> Figure:
    """Frequencies over one assumed parameter: curves, the candidates of the table as rings, the arm itself filled."""
    is_own = study.is_own
    with style():
        figure = blank(9.0, 4.6)
        ax = figure.subplots()
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.axvline(candidates[is_own][0], color=INK, lw=1.0, ls=(0, (4, 3)), zorder=1.5)
        for number, (color, omega) in enumerate(zip(CURVE_COLOURS, curve.natural_frequency.T, strict=True), 1):
            ax.plot(x, omega, color=color)
            marked = study.natural_frequency[:, number - 1]
            ax.plot(candidates[~is_own], marked[~is_own], "o", ms=4.5, mfc="white", mec=color, mew=1.1)
            ax.plot(candidates[is_own], marked[is_own], "o", ms=7.0, mfc=color, mec="white", mew=0.8, zorder=4)
            ax.annotate(
                f"mode {number}", (candidates[-1], marked[-1]), textcoords="offset points", xytext=(8, 0), va="center",
                color=color, fontsize=9.0,
            )  # fmt: skip
        if isinstance(study, HubStudy):
            _mark_limits(study, ax)
        ax.set_xlabel(label)
        ax.set_ylabel("natural frequency [rad/s]")
        ax.margins(y=0.09)
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value, 3)))
            axis.set_minor_formatter(NullFormatter())
        span = float(x[-1] / x[0])
        ax.set_xlim(x[0] / span**0.06, x[-1] * span**0.13)  # room for the bars, and for these and the modes' names
        parameter = "hub inertia" if isinstance(study, HubStudy) else "depth of the section, at this area"
        headline(figure, f"{study.arm.name}: natural frequencies over the {parameter}")
    return figure


def _mark_limits(study: HubStudy, ax: Axes) -> None:
    """Short bars at the left edge for the free pin, at the right edge for the locked hub."""
    for omegas, low, high in ((study.pinned, 0.0, 0.018), (study.locked, 0.982, 1.0)):
        for color, omega in zip(CURVE_COLOURS, omegas, strict=True):
            if omega > 0:  # the first of an arm that its tip holds falls to 0: beyond a logarithmic axis
                ax.axhline(omega, low, high, color=color, lw=2.4)
    for place, text, side in ((0.0, "free pin", "left"), (1.0, "locked hub", "right")):
        ax.text(place, 1.015, text, transform=ax.transAxes, ha=side, fontsize=9.0, color=GREY)
