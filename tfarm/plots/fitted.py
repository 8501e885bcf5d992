"""Measured responses under the curves of a fitted arm, and what the data leave open: bands, and gains that hold."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.fitting.fit import Fit
from tfarm.fitting.possible import Possible, response_band, share_stable

from .drawn import drawn
from .regions import LABEL
from .style import BLUE, GREY, ORANGE, blank, headline, style
from .words import name_axes

FITTED_POINTS = 1200  # of a computed curve, beside the measured frequencies: more than a column has pixels
POINTS_OF_BAND = 800  # of a band of responses, about one to a pixel: each is computed for every possible arm
MAP_MESH = 60  # gains of each axis of a map, each pair counted for every possible arm
SHARE_COLOURS = "Blues"  # of matplotlib: the more arms, the darker


@drawn.register
def draw_fit(fit: Fit) -> Figure:
    """Each measured response with the arm's before and after: magnitude over phase, a column a response.

    Phases are broken where they wrap.
    """
    count, problem = max(1, len(fit.responses)), fit.solution.problem
    curves = ((fit.solution.point * 0, GREY, "start", 1.0), (fit.solution.point, BLUE, "fitted, exact", 1.4))
    with style():
        figure = blank(max(7.0, 5.2 * count), 6.0)
        axes = figure.subplots(2, count, sharex="col", height_ratios=[1.75, 1.0], squeeze=False)
        for number, one in enumerate(fit.responses):
            upper, lower = axes[:, number]
            measured, omega = one.omega, np.geomspace(one.omega[0], one.omega[-1], FITTED_POINTS)
            omega = np.unique(np.r_[omega, measured])
            hertz = omega / (2 * math.pi)
            upper.plot(measured / (2 * math.pi), abs(one.values), ".", ms=3.0, color=ORANGE, label="measured", zorder=3)
            phase = np.degrees(np.angle(one.values))
            lower.plot(measured / (2 * math.pi), phase, ".", ms=3.0, color=ORANGE, zorder=3)
            for point, colour, label, width in curves:
                H = problem.at(number, omega).computed(point)[0]
                degrees = np.degrees(np.angle(H))
                degrees[abs(np.diff(degrees, prepend=degrees[:1])) > 180] = np.nan
                upper.plot(hertz, abs(H), color=colour, lw=width, label=label)
                lower.plot(hertz, degrees, color=colour, lw=width)
            upper.set(xscale="log", yscale="log", title=one.name)
            lower.set(xlabel="frequency [Hz]", ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180])
        if fit.responses:
            axes[0, 0].set_ylabel("magnitude, SI")
            axes[1, 0].set_ylabel("phase [deg]")
            axes[0, 0].legend(loc="best")
        headline(figure, f"{fit.before.name}: {fit.verdict}")
    return figure


def draw_band(those: Possible, output: str) -> Figure:
    """Magnitude of a response of the arm that fits best, in the band of all that the data leave possible."""
    omegas = [each.omega for each in those.fit.responses]
    low, high = min(w[0] for w in omegas), max(w[-1] for w in omegas)
    omega = np.geomspace(low, high, POINTS_OF_BAND)
    least, most, best = response_band(those, output, omega)
    with style():
        figure = blank(9.0, 4.6)
        ax = figure.subplots()
        label = f"all of {len(those.arms)} arms that the data leave possible"
        ax.fill_between(omega / 2 / math.pi, least, most, color=BLUE, alpha=0.3, lw=0, label=label)
        ax.plot(omega / 2 / math.pi, best, color=BLUE, lw=1.3, label="the arm that fits best")
        ax.set(xscale="log", yscale="log", xlabel="frequency [Hz]", ylabel=f"|{output.replace('_', ' ')}|, SI")
        ax.legend(loc="best")
        headline(figure, f"{those.fit.before.name}: what the data leave of {output.replace('_', ' ')}")
    return figure


def draw_share(those: Possible, ranges: Sequence[tuple[float, float]]) -> Figure:
    """The share of the possible arms on which each pair of gains holds, without a clock; `ranges` of both gains."""
    grid = [np.linspace(*ends, MAP_MESH) for ends in ranges]
    with style():
        figure = blank(8.0, 5.0)
        share_map(those, *grid, ax=figure.subplots())
        headline(figure, f"{those.fit.before.name}: gains that hold on the arms that the data leave possible")
    return figure


def share_map(those: Possible, across: np.ndarray, up: np.ndarray, *, ax: Axes) -> Axes:
    """The same on axes of your own."""
    share = share_stable(those, across, up)
    picture = ax.pcolormesh(
        across, up, share, cmap=SHARE_COLOURS, vmin=0.0, vmax=1.0, shading="nearest", rasterized=True
    )
    ax.figure.colorbar(picture, ax=ax).set_label("share of the arms that the gains hold")
    name_axes(those.fit.arm, ax, LABEL, "-")
    ax.grid(False)
    return ax
