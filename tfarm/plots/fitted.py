"""Measured responses under the curves of a fitted arm."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.fitting.fit import Fit

from .style import BLUE, GREY, ORANGE, blank, headline, style

FITTED_POINTS = 1200  # of a computed curve, beside the measured frequencies: more than a column has pixels


def draw_fit(fit: Fit) -> Figure:
    """Each measured response with the arm's before and after: magnitude over phase, a column a response."""
    count = max(1, len(fit.responses))
    with style():
        figure = blank(max(7.0, 5.2 * count), 6.0)
        axes = figure.subplots(2, count, sharex="col", height_ratios=[1.75, 1.0], squeeze=False)
        for number in range(len(fit.responses)):
            _draw_response(fit, number, axes[0, number], axes[1, number])
        headline(figure, f"{fit.before.name}: {fit.verdict}")
    return figure


def _draw_response(fit: Fit, number: int, upper: Axes, lower: Axes) -> None:
    """One of the measured responses, with the curves of the arm before and after; broken where their phase wraps."""
    one = fit.responses[number]
    hertz = one.omega / (2 * math.pi)
    omega = np.unique(np.r_[np.geomspace(one.omega[0], one.omega[-1], FITTED_POINTS), one.omega])
    curves = ((fit.solution.point * 0, GREY, "start", 1.0), (fit.solution.point, BLUE, "fitted, exact", 1.4))
    upper.plot(hertz, abs(one.values), ".", ms=3.0, color=ORANGE, label="measured", zorder=3)
    lower.plot(hertz, np.degrees(np.angle(one.values)), ".", ms=3.0, color=ORANGE, zorder=3)
    for point, colour, label, width in curves:
        H = fit.solution.problem.at(number, omega).computed(point)[0]
        upper.plot(omega / (2 * math.pi), abs(H), color=colour, lw=width, label=label)
        degrees = np.degrees(np.angle(H))
        degrees[abs(np.diff(degrees, prepend=degrees[:1])) > 180] = np.nan
        lower.plot(omega / (2 * math.pi), degrees, color=colour, lw=width)
    upper.set(xscale="log", yscale="log", title=one.name)
    upper.set_ylabel("magnitude, SI" if number == 0 else "")
    lower.set(xlabel="frequency [Hz]", ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180])
    lower.set_ylabel("phase [deg]" if number == 0 else "")
    if number == 0:
        upper.legend(loc="best")
