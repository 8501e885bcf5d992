"""What the data leave open, drawn: the band of responses, and the share of possible arms on which gains hold."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.fitting.possible import Possible, response_band, share_stable

from .regions import LABEL
from .style import BLUE, blank, headline, style
from .words import name_axes

POINTS_OF_BAND = 800  # of a band of responses, about one to a pixel: each is computed for every possible arm
MAP_MESH = 60  # gains of each axis of a map, each pair counted for every possible arm
SHARE_COLOURS = "Blues"  # of matplotlib: the more arms, the darker


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
    bar = ax.figure.colorbar(picture, ax=ax)
    bar.set_label("share of the arms that the gains hold")
    name_axes(those.fit.arm, ax, LABEL, "-")
    ax.grid(False)
    return ax
