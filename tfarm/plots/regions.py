"""Where the continuous loop is stable, and where the sampled one is, on the same axes: exact edges, no raster."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, NullFormatter

from tfarm.arm import PLANE
from tfarm.comparing.regions import K2_RANGE, StableRegions
from tfarm.crossing import pieces
from tfarm.digits import plain, scientific
from tfarm.dsp import GainMap
from tfarm.loop.plane import Plane

from .plane import outline
from .style import BLUE, GREY, INK, ORANGE, blank, headline, must_be, style, window
from .words import LYAPUNOV, gains_words, name_axes

SAND = "#f6dfcb"
DAMPING_BLUES = ("#c9dcef", "#7fb0da", "#2f7cbc")  # lightest: most damping
CONVENTION = "u = −{} dθ/dt − {} M;  a positive root moment M accelerates the hub".format(*PLANE)
LABEL = "{name}, on the {output}  [{unit}]"


def overlay(continuous: Plane, sampled: GainMap | Sequence[GainMap], *, ax: Axes | None = None) -> Axes:
    """Both regions of the two gains, in the axes given or in new ones; the axes.

    `continuous` is what `tfarm.map` returns, `sampled` what `tfarm.dsp.sampled_map` does: several, for arms with ever
    less damping, lie on each other.  The point is the law of the sampled loop.
    """
    must_be(Plane, continuous, "tfarm.map returns of gains at the hub")
    planes = list(sampled) if isinstance(sampled, Sequence) else [sampled]
    for plane in planes:
        must_be(GainMap, plane, "tfarm.dsp.sampled_map returns")
    with style():
        if ax is None:
            figure = window(9.0, 5.4)
            ax = overlay(continuous, planes, ax=figure.subplots())
            headline(figure, f"{continuous.arm.name}: gains that keep the loop stable, continuous and sampled")
            return ax
        _scale(continuous, ax)
        keys: list[Artist] = [_fill(ax, continuous, SAND, ORANGE, "stable, continuous: every mode")]
        colours = DAMPING_BLUES[1:2] if len(planes) == 1 else DAMPING_BLUES
        for plane, colour in zip(planes, colours, strict=True):
            keys.append(_fill(ax, plane, colour, BLUE, f"stable, sampled{sampled_label(continuous, plane)}"))
        if continuous.arm.is_uniform:  # of a rig the argument needs more: see `tfarm.loop.theorem`
            (line,) = ax.plot(ax.get_xlim(), (1.0, 1.0), color=INK, lw=1.1, ls=(0, (5, 3)), zorder=4)
            line.set_label(f"below it: proven by energy at C = 0 ({LYAPUNOV})")
            keys.append(line)
        keys.append(Patch(facecolor="white", edgecolor=GREY, linewidth=0.9, label="stable in neither"))
        law = planes[0].loop.gains
        (point,) = ax.plot(*law.point, "o", color="white", mec=INK, mew=1.4, ms=7, zorder=6, ls="none")
        point.set_label(gains_words(law))
        handles = [*keys, point]
        ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.0, -0.13), ncols=2, borderaxespad=0.0)
    return ax


def draw_overlay(data: StableRegions) -> Figure:
    """The picture of this tool: a continuous region and a sampled one on the same axes."""
    with style():
        figure = blank(9.0, 5.4)
        unit = data.continuous.arm.input_per_torque
        overlay(*data, ax=figure.subplots()).set_ylim(*(unit * end for end in K2_RANGE))
        ms = plain(1e3 * data.sampled[0].loop.chain.sampling.period)
        name = data.continuous.arm.name
        headline(figure, f"{name}: gains that keep the loop stable, continuous and sampled every {ms} ms")
    return figure


def _scale(continuous: Plane, ax: Axes) -> None:
    """Logarithmic across where that gain is positive."""
    across, up = continuous.axes
    if across[0] > 0:
        ax.set_xscale("log")
        ax.xaxis.set_minor_formatter(NullFormatter())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, 3)))
    ax.set_xlim(float(across[0]), float(across[-1]))
    ax.set_ylim(float(up[0]), float(up[-1]))
    ax.grid(False)
    ax.axhline(0.0, color=GREY, lw=0.7, zorder=3.5)
    name_axes(continuous.arm, ax, LABEL, "-")
    ax.set_title(CONVENTION, loc="right", fontsize=8.5, color=GREY)


def sampled_label(continuous: Plane, plane: GainMap) -> str:
    """What a sampled region holds for: the modes at C = 0, the damping where it is not the arm's own."""
    C = plane.loop.plant.arm.damping
    if C == 0.0:
        return f", C = 0: the first {plane.modes_used} modes"
    return "" if continuous.arm.damping == C else f", if C were {scientific(C, 1)} s"


def _fill(ax: Axes, region: Plane | GainMap, colour: str, edge: str, label: str) -> Patch:
    for piece in pieces(region.axes[0], region.stable_intervals):
        x, low, high = np.array(piece.points).T
        ax.fill_between(x, low, high, facecolor=colour, edgecolor="none", zorder=2)
        outline(piece, edge, 0.9, 2.5, ax)
    return Patch(facecolor=colour, edgecolor=edge, linewidth=0.9, label=label)
