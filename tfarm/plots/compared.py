"""Two arms, or two laws on one arm, in one Bode plot and one map."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from tfarm.arm import HubFeedback
from tfarm.arrays import Real
from tfarm.comparing import Comparison
from tfarm.crossing import Window, pieces
from tfarm.digits import plain

from .drawn import drawn
from .frequency import hertz_axis, magnitude_limits, wrapped_phase
from .plane import outline
from .style import BLUE, GREEN, GREY, INK, ORANGE, New, blank, headline, must_be, safe, style, taken, window
from .words import name_axes

SIDE_COLOURS = (BLUE, ORANGE)  # of the first side, and of the second
LEAST_DRAWN, MOST_DRAWN = 1e-4, 1e3  # sizes of L, and factors on a law, that are drawn: so that what is near 1 shows


def comparison(data: Comparison, *, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes, Axes]:
    """Magnitude, phase and map of both (what `tfarm.compare` returns), in three axes, those given or new ones: these.

    Of two arms the exact responses, of two laws the loop functions L; the map is that of both gains, with exact edges,
    or, where a law is more than these gains, of a factor on each law and its delay, counted on a grid.  With a law in z
    all is of the loops at their samples, and the map has the exact factors over further delays.
    """
    must_be(Comparison, data, "tfarm.compare returns")
    with style():
        if ax is None:
            upper, right, lower = draw_comparison(data, window).axes
            return upper, lower, right
        upper, lower, right = taken(ax, 3)
        if data.is_of_arms:
            _responses(data, upper, lower)
        else:
            _loops(data, upper, lower)
        _map(data, right)
    return upper, lower, right


@drawn.register
def draw_comparison(data: Comparison, new: New = blank) -> Figure:
    """The three on a figure of their own."""
    with style():
        figure = new(12.0, 6.2)
        grid = figure.add_gridspec(2, 2, width_ratios=[1.25, 1.0], height_ratios=[1.6, 1.0])
        upper, right = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[:, 1])
        comparison(data, ax=(upper, figure.add_subplot(grid[1, 0], sharex=upper), right))
        headline(figure, data.verdict)
    return figure


def _responses(data: Comparison, upper: Axes, lower: Axes) -> None:
    """The exact responses of both arms; roots on the axis run off the picture."""
    limits = np.array([magnitude_limits(each) for each in data.responses])
    for each, side, colour in zip(data.responses, data.sides, SIDE_COLOURS, strict=True):
        upper.plot(each.omega, abs(each.value), color=colour, label=safe(side.name))
        lower.plot(each.omega, each.phase, color=colour, lw=1.0)
    first = data.responses[0]
    upper.set_ylim(float(limits[:, 0].min()), float(limits[:, 1].max()))
    upper.set_ylabel(f"|{first.label} / {first.input_label}|  [{first.gain_unit}]")
    _finished(first.band, upper, lower)


def _loops(data: Comparison, upper: Axes, lower: Axes) -> None:
    """|L| with the line 1, and its angle from -180 to 180 degrees, broken where it goes round."""
    ends = []
    for side, colour in zip(data.sides, SIDE_COLOURS, strict=True):
        omega, L = side.loop_function
        upper.plot(omega, abs(L), color=colour, label=safe(side.name))
        lower.plot(*wrapped_phase(omega, L), color=colour, lw=1.0)
        ends.append((omega[0], omega[-1], max(abs(L).min(), LEAST_DRAWN), min(abs(L).max(), MOST_DRAWN)))
    low, high, least, most = zip(*ends, strict=True)
    upper.axhline(1.0, color=GREY, lw=0.9)
    upper.set_ylim(min(least) / 1.5, 1.5 * max(most))
    upper.set_ylabel("|L| at the samples" if data.is_clocked else "|L|, loop opened at the input")
    lower.set_ylim(-190, 190)
    lower.set_yticks([-180, -90, 0, 90, 180])
    _finished((min(low), max(high)), upper, lower)


def _finished(band: tuple[float, float], upper: Axes, lower: Axes) -> None:
    upper.set_xscale("log")
    upper.set_yscale("log")
    lower.set_xscale("log")
    for ax in (upper, lower):
        ax.set_xlim(*band)
    hertz_axis(upper, 1.0)
    upper.legend(loc="best")
    lower.set_ylabel("phase [deg]")
    lower.set_xlabel("angular frequency [rad/s]")


def _map(data: Comparison, ax: Axes) -> None:
    """Where each is stable: the plane of both gains, or that of a factor and a delay."""
    ax.grid(False)
    if data.is_clocked:
        _reaches(data, ax)
        return
    if data.regions is None:
        _delays(data, ax)
        return
    first, other = data.regions
    if first == other:
        _region(first.axes[0], first.stable_intervals, GREEN, "stable", ax)
    else:
        for found, side, colour in zip(data.regions, data.sides, SIDE_COLOURS, strict=True):
            _region(found.axes[0], found.stable_intervals, colour, f"{side.name}: stable", ax)
    for side, colour in zip(data.sides, SIDE_COLOURS, strict=True):
        if isinstance(side.law, HubFeedback):
            ax.plot(*side.law.point, "o", mfc=colour, mec="white", ms=7.5, zorder=7)
    across, up = first.axes
    ax.set(xlim=(across[0], across[-1]), ylim=(up[0], up[-1]))
    name_axes(data.one.arm, ax)
    ax.legend(loc="upper left", bbox_to_anchor=(0.0, -0.1), borderaxespad=0.0)


def _region(across: Real, stable: Sequence[Sequence[Window]], colour: str, label: str, ax: Axes) -> None:
    """Where a loop is stable: an interval upwards, or several, at each value across."""
    for piece in pieces(across, stable):
        x, low, high = np.array(piece.points).T
        ax.fill_between(x, low, high, facecolor=colour, alpha=0.22, lw=0, zorder=1)
        outline(piece, colour, 1.4, 3.0, ax)
    ax.fill_between([], [], [], facecolor=colour, alpha=0.4, label=safe(label))


def _reaches(data: Comparison, ax: Axes) -> None:
    """Which factors keep each loop stable, as its law acts later and later."""
    highest = 1.0
    for found, side, colour in zip(data.reaches, data.sides, SIDE_COLOURS, strict=True):
        ends = [end for column in found.stable_intervals for window in column for end in window if math.isfinite(end)]
        highest = max([highest, *ends])
        _region(1e3 * found.delay, found.stable_intervals, colour, f"{side.name}: stable", ax)
    ax.plot([0.0], [1.0], "o", mfc=INK, mec="white", ms=7.5, zorder=7, clip_on=False, label="the laws as they are")
    ax.set_xlim(0.0, 1e3 * data.reaches[0].delay[-1])
    ax.set_ylim(0.0, min(1.15 * highest, MOST_DRAWN))
    ax.axhline(1.0, color=INK, lw=0.6)
    ax.set_xlabel("further delay [ms]")
    ax.set_ylabel("factor on the law")
    ax.legend(loc="upper left", bbox_to_anchor=(0.0, -0.1), borderaxespad=0.0)


def _delays(data: Comparison, ax: Axes) -> None:
    for found, side, colour in zip(data.delays, data.sides, SIDE_COLOURS, strict=True):
        image = np.zeros((*found.stable.shape, 4))
        image[found.stable] = to_rgba(colour, 0.3)
        ax.pcolormesh(found.x, found.y, image, shading="nearest", rasterized=True)
        ax.fill_between([], [], [], facecolor=colour, alpha=0.4, label=safe(f"{side.name}: stable"))
        ax.plot([1.0], [found.law.delay], "o", mfc=colour, mec="white", ms=7.5, zorder=7, clip_on=False)
    ax.set_xlabel("factor on the law")
    ax.set_ylabel("delay of the law [ms]")
    ax.yaxis.set_major_formatter(FuncFormatter(lambda seconds, _: plain(1e3 * seconds, 3)))
    ax.axvline(1.0, color=INK, lw=0.6)
    ax.legend(loc="upper left", bbox_to_anchor=(0.0, -0.1), borderaxespad=0.0)
