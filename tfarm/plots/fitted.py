"""Measured responses under the curves of a fitted arm."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from tfarm.fitting.fit import Fit

from .style import BLUE, GREY, ORANGE, blank, headline, style

FITTED_POINTS = 1200  # of a computed curve, beside the measured frequencies: more than a column has pixels


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
