"""What sampling does to each mode: the chart of growths over frequency, and the table behind it."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from tfarm.columns import Table
from tfarm.digits import SUPERSCRIPT, plain
from tfarm.dsp.law import MODES, ModeTable
from tfarm.dsp.loop import SampledLoop
from tfarm.plots.frequency import hertz_axis
from tfarm.plots.style import BLUE, GREY, INK, ORANGE, blank, headline, style

Real = NDArray[np.float64]

BANDS = 12  # strips that are shaded one by one; above they are too narrow to tell
SHADE = "#f3e6dc"
MODE_TABLE = (
    "ln|z| is what a mode gains (+) or loses (−) per sample: its size is multiplied by |z| every {ms} ms. Own damping "
    "is what the arm does by itself, K1 and K2 what the gains add to first order; the closed loop is the exact pole, "
    "which large gains move further than first order says. Band 0 lies below {half} Hz; from there on the mode is "
    "aliased, and the samples see it at the frequency given. {sign}"
)


def draw_modes(loop: SampledLoop, table: ModeTable) -> Figure:
    """ln|z| per sample of every mode: own damping, both gains to first order, and the closed loop."""
    with style():
        figure = blank(9.0, 4.6)
        growths(loop, table, ax=figure.subplots())
        ms = plain(1e3 * loop.chain.sampling.period)
        gains = f"K1 = {plain(loop.gains.K1)}, K2 = {plain(loop.gains.K2)}"
        headline(figure, f"{loop.plant.arm.name}: what each mode gains or loses a sample ({ms} ms, {gains})")
    return figure


def growths(loop: SampledLoop, table: ModeTable, *, ax: Axes) -> None:
    """The chart; shaded where K1 destabilises to first order."""
    w, T = table.natural_frequency, loop.chain.sampling.period
    low, high = 0.7 * float(w[0]), 1.25 * float(w[-1])
    ax.set_xscale("log")
    ax.set_xlim(low, high)
    smallest, down, up = _sizes(table)
    ax.set_yscale("symlog", linthresh=smallest, linscale=0.4)
    ax.set_ylim(-8 * down, 8 * up)
    ax.set_yticks(_ticks(smallest, down, up))
    if loop.chain.sampling.delay_samples == 0:
        for band in range(1, BANDS, 2):
            ax.axvspan(band * math.pi / T, (band + 1) * math.pi / T, color=SHADE, lw=0, zorder=0.1)
        if BANDS * math.pi / T < high:
            ax.axvspan(BANDS * math.pi / T, high, facecolor=SHADE, alpha=0.5, lw=0, zorder=0.1)
    ax.axhline(0.0, color=INK, lw=0.9)
    ax.vlines(w, 0, table.log_radius, color=BLUE, lw=1.2, zorder=2)
    ax.plot(w, table.log_radius, "o", color=BLUE, ms=6, label="closed loop, exact", zorder=4)
    ax.plot(w, table.by_rate, "^", mfc="none", mec=ORANGE, mew=1.3, ms=7, label="by K1, first order", zorder=5)
    ax.plot(w, table.by_moment, "s", mfc="none", mec=INK, mew=1.1, ms=6, label="by K2, first order", zorder=5)
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


def _ticks(smallest: float, down: float, up: float) -> list[float]:
    """0 and powers of ten to either side, every so many decades."""
    first = round(math.log10(smallest))
    step = max(2, math.ceil((math.log10(max(down, up)) - first) / 5))
    below, above = (range(first + step, math.floor(math.log10(8 * end)) + 1, step) for end in (down, up))
    return sorted([*(-(10.0**n) for n in below), 0.0, *(10.0**n for n in above)])


def _power(y: float, _: object = None) -> str:
    if y == 0:
        return "0"
    return f"{'−' if y < 0 else '+'}10{str(round(math.log10(abs(y)))).translate(SUPERSCRIPT)}"


def mode_rows(loop: SampledLoop, table: ModeTable, stem: str, sign: str) -> Table:
    """A row a mode that outlives a sample."""
    T = loop.chain.sampling.period
    return Table(
        stem=stem,
        title="The sampled loop, mode by mode",
        caption=MODE_TABLE.format(ms=plain(1e3 * T), half=plain(0.5 / T), sign=sign),
        columns=MODES,
        record=table,
    )
