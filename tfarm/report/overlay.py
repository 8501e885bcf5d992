"""The plane of both gains twice on the same axes: where the continuous loop is stable, and where the sampled one is.

Each region is a list of intervals of K2 at each K1, with exact edges (D-decomposition in `loop` and in `dsp`); nothing
is read off a raster.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback
from tfarm.columns import Column, Table
from tfarm.digits import plain, scientific
from tfarm.dsp import gain_map, sampled_verdict, stable_windows
from tfarm.dsp.chain import Chain
from tfarm.dsp.loop import SampledLoop
from tfarm.loop.regions import region
from tfarm.plots.style import BLUE, GREY, INK, ORANGE, blank, headline, style
from tfarm.records import record
from tfarm.report.region_pieces import pieces

Real = NDArray[np.float64]
Window = tuple[float, float]

K2_RANGE = (-1.0, 1.5)
CUT = (-1.02, 1.52)  # where intervals are cut, just outside the picture
COLUMNS = 72  # values of K1, and the exact ends of the stable K1 at these K2
ENDS_AT = (-0.9, 0.3, 0.9)
DAMPINGS = (1e-4, 1e-6)  # s: what is drawn beside C = 0
SAND = "#f6dfcb"
BLUES = ("#c9dcef", "#7fb0da", "#2f7cbc")  # lightest: most damping
CONVENTION = "u = −K1 dθ/dt − K2 M;  a positive root moment M accelerates the hub"
BEYOND = 1.7  # of the largest stable K1: how far the picture goes
SAME = 1e-3  # ends of K1 as close as this are seen as one
BELOW = 15.0  # of the gain itself


@dataclass(frozen=True)
@record
class Layer:
    """A stable region: at each K1 (n,) the open intervals of K2 in which nothing grows, cut to the picture.

    `damping` C [s]; `modes` are the flexible modes that it holds for, None where it holds for all of them.
    """

    damping: float
    K1: Real
    intervals: list[list[Window]]
    modes: int | None


@dataclass(frozen=True)
@record
class Overlay:
    """Both regions of one arm.  `sampled` has the arm's own C; at C = 0 also what a little damping would give."""

    arm: Arm
    gains: HubFeedback
    period: float
    K1_range: Window
    continuous: Layer
    sampled: tuple[Layer, ...]  # most damping first, so that each lies on the one before


def overlay(arm: Arm, gains: HubFeedback, chain: Chain) -> Overlay:
    """The regions around these gains.  Raises ParameterError where the arm has no loop."""
    dampings = (arm.damping,) if arm.damping else (*DAMPINGS, 0.0)
    loops = [sampled_verdict(arm.having(damping=C), gains, chain).loop for C in dampings]
    ends = np.array(sorted({end for loop in loops for end in ends_of_K1(loop)}))
    ends = ends[np.diff(ends, prepend=0.0) > SAME * ends]
    top = _round_up(BEYOND * max([gains.K1, *ends]))
    low = gains.K1 / BELOW
    sides = np.r_[ends * (1 - 1e-9), ends * (1 + 1e-9)]
    K1 = np.unique(np.r_[np.geomspace(low, top, COLUMNS), sides[(sides > low) & (sides < top)]])
    layers = tuple(sampled_layer(loop, K1, CUT) for loop in loops)
    span = (float(K1[0]), float(K1[-1]))
    continuous = Layer(arm.damping, K1, region(arm, K1, np.array(CUT)).stable_intervals, None)
    return Overlay(arm, gains, chain.sampling.period, span, continuous, layers)


def ends_of_K1(loop: SampledLoop) -> list[float]:
    """Where stable intervals of K1 end, at a few K2: there the region has upright edges."""
    found = [window for K2 in ENDS_AT for window in stable_windows(loop.having(K2=K2), "K1")]
    return [end for window in found for end in window if math.isfinite(end) and end > 0]


def _round_up(x: float) -> float:
    """The next of 1, 2, 5, 10, ..."""
    power = 10.0 ** math.floor(math.log10(x))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0, 20.0) if step * power >= x)


def sampled_layer(loop: SampledLoop, K1: Real, cut: Window) -> Layer:
    """Where the sampled loop is stable: at each K1 (ascending) its intervals of K2, cut to a range."""
    plane = gain_map(loop, K1, np.linspace(*cut, 3))
    return Layer(loop.plant.arm.damping, K1, plane.stable_intervals, plane.modes_used)


# ------------------------------------------------------------ the picture


def draw_overlay(data: Overlay) -> Figure:
    """The picture of this tool: a continuous region and a sampled one on the same axes."""
    with style():
        figure = blank(9.0, 5.4)
        ax = figure.subplots()
        regions(data, ax=ax)
        ms = plain(1e3 * data.period)
        headline(figure, f"{data.arm.name}: gains that keep the loop stable, continuous and sampled every {ms} ms")
    return figure


def regions(data: Overlay, *, ax: Axes) -> None:
    """Both regions, the line that the energy argument proves, and the gains."""
    ax.set_xscale("log")
    ax.set_xlim(*data.K1_range)
    ax.set_ylim(*K2_RANGE)
    ax.grid(False)
    keys = [_fill(ax, data.continuous, SAND, ORANGE, "stable, continuous: every mode")]
    colours = BLUES[1:2] if len(data.sampled) == 1 else BLUES
    for layer, colour in zip(data.sampled, colours, strict=True):
        keys.append(_fill(ax, layer, colour, BLUE, f"stable, sampled{sampled_label(data.arm, layer)}"))
    (line,) = ax.plot(data.K1_range, (1.0, 1.0), color=INK, lw=1.1, ls=(0, (5, 3)), zorder=4)
    line.set_label("below it: proven by energy at C = 0 (K1 > 0, K2 < 1)")
    (point,) = ax.plot(data.gains.K1, data.gains.K2, "o", color="white", mec=INK, mew=1.4, ms=7, zorder=6, ls="none")
    point.set_label(f"K1 = {plain(data.gains.K1)}, K2 = {plain(data.gains.K2)}")
    ax.axhline(0.0, color=GREY, lw=0.7, zorder=3.5)
    ax.set_xlabel("K1, on the hub rate  [N m s/rad]")
    ax.set_ylabel("K2, on the root moment  [-]")
    ax.set_title(CONVENTION, loc="right", fontsize=8.5, color=GREY)
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, 3)))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.legend(handles=[*keys, line, point], loc="upper left", bbox_to_anchor=(0.0, -0.13), ncols=2, borderaxespad=0.0)


def sampled_label(arm: Arm, layer: Layer) -> str:
    """What a sampled layer holds for: the modes at C = 0, the damping where it is not the arm's own."""
    if layer.damping == 0.0:
        return f", C = 0: the first {layer.modes} modes"
    return "" if layer.damping == arm.damping else f", if C were {scientific(layer.damping, 1)} s"


def _fill(ax: Axes, layer: Layer, colour: str, edge: str, label: str) -> Patch:
    for piece in pieces(layer.K1, layer.intervals):
        x, low, high = np.array(piece.points).T
        ax.fill_between(x, low, high, facecolor=colour, edgecolor="none", zorder=2)
        for line in (low, high):
            ax.plot(x, line, color=edge, lw=0.9, zorder=2.5)
        for end in np.nonzero([piece.begins, piece.ends])[0]:
            ax.plot([x[-end]] * 2, [low[-end], high[-end]], color=edge, lw=0.9, zorder=2.5)
    return Patch(facecolor=colour, edgecolor=edge, linewidth=0.9, label=label)


def overlay_table(data: Overlay, stem: str) -> Table:
    """The numbers of the picture: at each K1 the ends of the stable intervals of K2."""
    columns = [Column("K1", "K1", "N m s/rad", of=data.continuous.K1)]
    columns.append(_ends("continuous_K2_intervals", data.continuous))
    for layer in data.sampled:
        own = layer.damping == data.arm.damping
        columns.append(_ends("sampled_K2_intervals" if own else f"sampled_at_C_{layer.damping:g}_s", layer))
    title = "Stable intervals of K2, continuous and sampled"
    return Table(stem=stem, title=title, is_data=True, columns=tuple(columns))


def _ends(key: str, layer: Layer) -> Column:
    ends = [tuple(float(end) for window in column for end in window) for column in layer.intervals]
    return Column(key, key, of=ends)
