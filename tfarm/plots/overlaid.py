"""A measured response over the exact one: magnitude, phase, and how coherent the measurement is."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MultipleLocator, NullFormatter

from tfarm.digits import plain
from tfarm.fitting.overlay import Overlay

from .drawn import drawn
from .frequency import RAD_PER_CYCLE, wrapped_phase
from .style import BLUE, FAINT, GREY, INK, ORANGE, New, blank, headline, must_be, style, taken, window

SPAN = 1.25  # of the decades that are measured: an infinite peak of the exact curve runs off the picture


def measured(data: Overlay, *, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes, Axes]:
    """Magnitude, phase and coherence (what `tfarm.overlay` returns), in three axes, those given or new ones: these.

    Phases lie between -180 and 180 degrees, broken where they wrap: a sign that differs is half a turn.  Where no
    coherence is known the third axes show the noise as a share of the measured value.
    """
    must_be(Overlay, data, "tfarm.overlay returns")
    with style():
        if ax is None:
            upper, middle, lower = draw_measured(data, window).axes
        else:
            upper, middle, lower = taken(ax, 3)
            for each in (upper, middle, lower):
                _frequencies(data, each)
            _magnitude(data, upper)
            one = data.measured
            middle.plot(
                one.omega / RAD_PER_CYCLE, np.degrees(np.angle(one.values)), "o", ms=2.2, color=ORANGE, zorder=3
            )
            middle.plot(*wrapped_phase(data.omega / RAD_PER_CYCLE, data.curve), color=BLUE)
            middle.set_ylim(-190.0, 190.0)
            middle.yaxis.set_major_locator(MultipleLocator(90))
            middle.set_ylabel("phase [deg]")
            _coherence(data, lower)
    return upper, middle, lower


@drawn.register
def draw_measured(data: Overlay, new: New = blank) -> Figure:
    """The three on a figure of their own."""
    with style():
        figure = new(9.0, 7.2)
        axes = figure.subplots(3, 1, sharex=True, height_ratios=[2.2, 1.2, 0.8])
        for each in measured(data, ax=axes)[:2]:
            each.set_xlabel("")
            each.tick_params(labelbottom=False)
        headline(figure, f"{data.arm.name}: {_words(data.measured.output)} over {_words(data.measured.input)}")
    return figure


def _magnitude(data: Overlay, ax: Axes) -> None:
    """Both sizes; grey where the arm has a resonance, orange where that is measured, black where none is near."""
    ax.set_yscale("log")
    one, size = data.measured, abs(data.curve)
    ax.plot(one.omega / RAD_PER_CYCLE, abs(one.values), "o", ms=2.2, color=ORANGE, zorder=3, label="measured")
    ax.plot(data.omega / RAD_PER_CYCLE, size, color=BLUE, label="exact")
    seen = abs(one.values[one.values != 0])
    if seen.size:
        low, high = math.log10(seen.min()), math.log10(seen.max())
        usual = np.log10(np.median(size[size > 0])) if (size > 0).any() else low
        low, high, margin = min(low, usual), max(high, usual), 0.15 + (SPAN - 1) / 2 * (high - low)
        ax.set_ylim(10 ** (low - margin), 10 ** (high + margin))
    for row in data.beside:
        ax.axvline(abs(row.pole) / RAD_PER_CYCLE, color=FAINT, lw=0.8, zorder=0.5)
        if row.frequency_ratio is not None:
            ax.axvline(
                row.frequency_ratio * abs(row.pole) / RAD_PER_CYCLE, color=ORANGE, lw=0.7, ls=(0, (2, 3)), zorder=0.6
            )
    for peak in data.unmatched:
        ax.axvline(peak / RAD_PER_CYCLE, color=INK, lw=0.8, ls=":", zorder=0.6)
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_ylabel(f"magnitude [{data.ratio.unit}]")
    ax.legend(loc="best")


def _coherence(data: Overlay, ax: Axes) -> None:
    """How coherent the measurement is, or the noise as a share of the value."""
    one = data.measured
    if one.coherence is not None:
        ax.plot(one.omega / RAD_PER_CYCLE, one.coherence, color=GREY, lw=1.0)
        ax.set_ylim(-0.05, 1.05)
        ax.set_ylabel("coherence [-]")
        return
    size = abs(one.values)
    told = (size > 0) & np.isfinite(data.noise.sigma)
    ax.plot(one.omega[told] / RAD_PER_CYCLE, data.noise.sigma[told] / size[told], color=GREY, lw=1.0)
    ax.set_yscale("log")
    ax.set_ylabel("noise/value [-]")


def _frequencies(data: Overlay, ax: Axes) -> None:
    low, high = data.measured.omega[0] / RAD_PER_CYCLE, data.measured.omega[-1] / RAD_PER_CYCLE
    if high > 5 * low:
        ax.set_xscale("log")
        ax.xaxis.set_minor_formatter(NullFormatter())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, 4)))
    if low < high:
        ax.set_xlim(float(low), float(high))
    ax.set_xlabel("frequency [Hz]")


def _words(name: str) -> str:
    """A signal as a person says it."""
    plain_name, at, place = name.partition("@")
    return plain_name.replace("_", " ") + (f" at {place} m" if at else "")
