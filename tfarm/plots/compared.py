"""Two arms, or two laws on one arm, in one Bode plot and one map."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.arrays import Real
from tfarm.comparing import Comparison
from tfarm.crossing import Window
from tfarm.loop.plane import Plane

from .frequency import draw_wrapped, hertz_axis, magnitude_limits
from .plane import draw_region
from .style import BLUE, GREEN, GREY, INK, ORANGE, picture, safe
from .words import name_axes

SIDE_COLOURS = (BLUE, ORANGE)  # of the first side, and of the second
LEAST_DRAWN, MOST_DRAWN = 1e-4, 1e3  # sizes of L, and factors on a law, that are drawn: so that what is near 1 shows


def _grid(figure: Figure, _: Comparison) -> None:
    grid = figure.add_gridspec(2, 2, width_ratios=[1.25, 1.0], height_ratios=[1.6, 1.0])
    upper = figure.add_subplot(grid[0, 0])
    figure.add_subplot(grid[1, 0], sharex=upper)
    figure.add_subplot(grid[:, 1])


@picture((Comparison, "tfarm.compare returns"), size=(12.0, 6.2), grid=_grid, title=lambda data: data.verdict)
def comparison(data: Comparison, *, ax: Sequence[Axes]) -> None:
    """Magnitude, phase and map of both (what `tfarm.compare` returns), in three axes, those given or new ones: these.

    Of two arms the exact responses, of two laws the loop functions L; the map is that of both gains, with exact edges,
    or, where a law is more than these gains, or one in z, of a factor on each law and its further delay.  With a law
    in z all is of the loops at their samples.
    """
    upper, lower, right = ax
    low, high = _responses(data, upper, lower) if data.is_of_arms else _loops(data, upper, lower)
    upper.set(xscale="log", yscale="log", xlim=(low, high))
    lower.set(xscale="log", xlim=(low, high), xlabel="angular frequency [rad/s]", ylabel="phase [deg]")
    hertz_axis(upper, 1.0)
    upper.legend(loc="best")
    right.grid(False)
    if data.is_sampled or data.regions is None:
        _reaches(data, right)
    else:
        _regions(data, data.regions, right)
    right.legend(loc="upper left", bbox_to_anchor=(0.0, -0.1), borderaxespad=0.0)


def _responses(data: Comparison, upper: Axes, lower: Axes) -> tuple[float, float]:
    """The exact responses of both arms; roots on the axis run off the picture."""
    limits = np.array([magnitude_limits(each) for each in data.responses])
    for each, side, colour in zip(data.responses, data.sides, SIDE_COLOURS, strict=True):
        upper.plot(each.omega, abs(each.value), color=colour, label=safe(side.name))
        lower.plot(each.omega, each.phase, color=colour, lw=1.0)
    first = data.responses[0]
    upper.set_ylim(float(limits[:, 0].min()), float(limits[:, 1].max()))
    upper.set_ylabel(f"|{first.label} / {first.input_label}|  [{first.gain_unit}]")
    return first.band


def _loops(data: Comparison, upper: Axes, lower: Axes) -> tuple[float, float]:
    """|L| with the line 1, and its angle from -180 to 180 degrees, broken where it goes round."""
    ends = []
    for side, colour in zip(data.sides, SIDE_COLOURS, strict=True):
        omega, L = side.loop_function
        upper.plot(omega, abs(L), color=colour, label=safe(side.name))
        draw_wrapped(omega, L, lower, color=colour, lw=1.0)
        ends.append((omega[0], omega[-1], max(abs(L).min(), LEAST_DRAWN), min(abs(L).max(), MOST_DRAWN)))
    low, high, least, most = zip(*ends, strict=True)
    upper.axhline(1.0, color=GREY, lw=0.9)
    upper.set_ylim(min(least) / 1.5, 1.5 * max(most))
    upper.set_ylabel("|L| at the samples" if data.is_sampled else "|L|, loop opened at the input")
    return min(low), max(high)


def _regions(data: Comparison, planes: tuple[Plane, Plane], ax: Axes) -> None:
    """Where each pair of gains keeps a loop stable; one region where both are the same."""
    first, other = planes
    sides = list(zip(planes, data.sides, SIDE_COLOURS, strict=True))
    if first == other:
        _region(first.x, first.stable_intervals, GREEN, "stable", ax)
    for found, side, colour in sides:
        if first != other:
            _region(found.x, found.stable_intervals, colour, f"{side.name}: stable", ax)
        assert side.gains is not None
        ax.plot(*side.gains.point, "o", mfc=colour, mec="white", ms=7.5, zorder=7)
    ax.set(xlim=(first.x[0], first.x[-1]), ylim=(first.y[0], first.y[-1]))
    name_axes(data.one.arm, ax)


def _region(across: Real, stable: Sequence[Sequence[Window]], colour: str, label: str, ax: Axes) -> None:
    """Where a loop is stable: an interval upwards, or several, at each value across."""
    draw_region(across, stable, colour, 1.4, 3.0, ax, facecolor=colour, alpha=0.22, lw=0)
    ax.fill_between([], [], [], facecolor=colour, alpha=0.4, label=safe(label))


def _reaches(data: Comparison, ax: Axes) -> None:
    """Which factors keep each loop stable, as its law acts later and later."""
    highest = 1.0
    for found, side, colour in zip(data.reaches, data.sides, SIDE_COLOURS, strict=True):
        ends = [end for column in found.stable_intervals for window in column for end in window if math.isfinite(end)]
        highest = max([highest, *ends])
        _region(1e3 * found.delay, found.stable_intervals, colour, f"{side.name}: stable", ax)
    ax.plot([0.0], [1.0], "o", mfc=INK, mec="white", ms=7.5, zorder=7, clip_on=False, label="the laws as they are")
    ax.axhline(1.0, color=INK, lw=0.6)
    ax.set(xlim=(0.0, 1e3 * data.reaches[0].delay[-1]), ylim=(0.0, min(1.15 * highest, MOST_DRAWN)))
    ax.set(xlabel="further delay [ms]", ylabel="factor on the law")
