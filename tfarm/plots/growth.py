"""What sampling does to each mode: growth per sample over frequency, by what it comes from."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from tfarm.arm import PLANE
from tfarm.digits import SUPERSCRIPT, plain
from tfarm.dsp import Analysis
from tfarm.dsp.modes import ModeTable
from tfarm.dsp.sampled import Sampled

from .frequency import hertz_axis
from .style import BLUE, GREY, INK, ORANGE, New, blank, headline, must_be, style, window
from .words import gains_words

SHADED_STRIPS = 12  # strips that are shaded one by one; above they are too narrow to tell
SHADE = "#f3e6dc"


def sampled_modes(found: Analysis, *, ax: Axes | None = None) -> Axes:
    """ln|z| per sample of every mode of a sampled loop (what `tfarm.sampled` returns), in the axes given or new; these.

    The closed loop, and to first order what its gains and its own damping add; below 0 a mode decays.
    """
    must_be(Analysis, found, "tfarm.sampled returns")
    with style():
        if ax is None:
            return draw_modes(found.verdict.loop, found.modes, window).axes[0]
        growths(found.verdict.loop, found.modes, ax=ax)
    return ax


def draw_modes(loop: Sampled, table: ModeTable, new: New = blank) -> Figure:
    """ln|z| per sample of every mode: own damping, both gains to first order, and the closed loop."""
    with style():
        figure = new(9.0, 4.6)
        growths(loop, table, ax=figure.subplots())
        ms = plain(1e3 * loop.chain.sampling.period)
        gains = gains_words(loop.gains if loop.is_of_gains else loop.given, 10)
        headline(figure, f"{loop.plant.arm.name}: what each mode gains or loses a sample ({ms} ms, {gains})")
    return figure


def growths(loop: Sampled, table: ModeTable, *, ax: Axes) -> None:
    """The chart; where bands alternate, those shaded in which the rate gain destabilises to first order."""
    w, T = table.natural_frequency, loop.chain.sampling.period
    low, high = 0.7 * float(w[0]), 1.25 * float(w[-1])
    ax.set_xscale("log")
    ax.set_xlim(low, high)
    smallest, down, up = _sizes(table)
    ax.set_yscale("symlog", linthresh=smallest, linscale=0.4)
    ax.set_ylim(-8 * down, 8 * up)
    first = round(math.log10(smallest))
    step = max(2, math.ceil((math.log10(max(down, up)) - first) / 5))  # decades from one tick to the next
    below, above = (range(first + step, math.floor(math.log10(8 * end)) + 1, step) for end in (down, up))
    ax.set_yticks([*(-(10.0**n) for n in reversed(below)), 0.0, *(10.0**n for n in above)])
    if table.rate_alternates:
        for band in range(1, SHADED_STRIPS, 2):
            ax.axvspan(band * math.pi / T, (band + 1) * math.pi / T, color=SHADE, lw=0, zorder=0.1)
        if SHADED_STRIPS * math.pi / T < high:
            ax.axvspan(SHADED_STRIPS * math.pi / T, high, facecolor=SHADE, alpha=0.5, lw=0, zorder=0.1)
    ax.axhline(0.0, color=INK, lw=0.9)
    ax.vlines(w, 0, table.log_radius, color=BLUE, lw=1.2, zorder=2)
    ax.plot(w, table.log_radius, "o", color=BLUE, ms=6, label="closed loop, exact", zorder=4)
    on_rate, on_moment = (f"by {name}, first order" for name in PLANE)
    ax.plot(w, table.by_rate, "^", mfc="none", mec=ORANGE, mew=1.3, ms=7, label=on_rate, zorder=5)
    ax.plot(w, table.by_moment, "s", mfc="none", mec=INK, mew=1.1, ms=6, label=on_moment, zorder=5)
    if table.by_damping.any():
        ax.plot(w, table.by_damping, "_", color=GREY, mew=1.6, ms=13, label="own damping", zorder=3)
    ax.yaxis.set_major_formatter(FuncFormatter(_power))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_ylabel("ln|z| per sample:  decays | grows")
    ax.set_xlabel("natural frequency  [rad/s]")
    hertz_axis(ax, 1.0)
    ax.legend(loc="upper left", bbox_to_anchor=(0.0, -0.17), ncols=4, borderaxespad=0.0)


def _sizes(table: ModeTable) -> tuple[float, float, float]:
    """The smallest power of ten worth showing, and the largest loss and gain."""
    every = np.r_[table.log_radius, table.by_rate, table.by_moment, table.by_damping]
    sizes = abs(every[every != 0])
    if not sizes.size:
        return 1e-12, 1e-11, 1e-11
    smallest = max(10.0 ** math.floor(math.log10(sizes.min())), 1e-13)
    return smallest, max(-float(every.min()), 10 * smallest), max(float(every.max()), 10 * smallest)


def _power(y: float, _: object = None) -> str:
    if y == 0:
        return "0"
    return f"{'−' if y < 0 else '+'}10{str(round(math.log10(abs(y)))).translate(SUPERSCRIPT)}"
