"""What the data leave open, drawn: the band of responses, and the share of possible arms on which gains hold."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.arm import unit_of, written_unit
from tfarm.fitting.possible import Possible, response_band, share_stable

from .style import BLUE, New, blank, headline, style

FINE = 800  # points of a band of responses
MESH = 60  # gains of each axis of a map
BLUES = "Blues"


def draw_band(those: Possible, output: str, new: New = blank) -> Figure:
    """Magnitude of a response of the arm that fits best, in the band of all that the data leave possible."""
    omegas = [each.omega for each in those.fit.responses]
    low, high = min(w[0] for w in omegas), max(w[-1] for w in omegas)
    omega = np.geomspace(low, high, FINE)
    least, most, best = response_band(those, output, omega)
    with style():
        figure = new(9.0, 4.6)
        ax = figure.subplots()
        label = f"all of {len(those.arms)} arms that the data leave possible"
        ax.fill_between(omega / 2 / math.pi, least, most, color=BLUE, alpha=0.3, lw=0, label=label)
        ax.plot(omega / 2 / math.pi, best, color=BLUE, lw=1.3, label="the arm that fits best")
        ax.set(xscale="log", yscale="log", xlabel="frequency [Hz]", ylabel=f"|{output.replace('_', ' ')}|, SI")
        ax.legend(loc="best")
        headline(figure, f"{those.fit.before.name}: what the data leave of {output.replace('_', ' ')}")
    return figure


def draw_share(those: Possible, K1: tuple[float, float], K2: tuple[float, float], new: New = blank) -> Figure:
    """The share of the possible arms on which each pair of gains holds, without a clock."""
    grid = np.linspace(*K1, MESH), np.linspace(*K2, MESH)
    with style():
        figure = new(8.0, 5.0)
        share_map(those, *grid, ax=figure.subplots())
        headline(figure, f"{those.fit.before.name}: gains that hold on the arms that the data leave possible")
    return figure


def share_map(those: Possible, K1: np.ndarray, K2: np.ndarray, *, ax: Axes) -> Axes:
    """The same on axes of your own."""
    share = share_stable(those, K1, K2)
    picture = ax.pcolormesh(K1, K2, share, cmap=BLUES, vmin=0.0, vmax=1.0, shading="nearest", rasterized=True)
    bar = ax.figure.colorbar(picture, ax=ax)
    bar.set_label("share of the arms that the gains hold")
    arm = those.fit.arm
    ax.set_xlabel(f"K1, on the hub rate  [{unit_of('K1', arm)}]")
    ax.set_ylabel(f"K2, on the root moment  [{written_unit('K2', arm).strip() or '-'}]")
    ax.grid(False)
    return ax
