"""The loop function over frequency: its size and phase, and where each margin is read."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tfarm.arrays import Real
from tfarm.digits import significant
from tfarm.loop.margins import Margins, loop_curve

from .frequency import hertz_axis, wrapped_phase
from .labels import OFFSETS_BESIDE, Label
from .style import BLUE, GREEN, GREY, ORANGE, PURPLE, blank, headline, style

MOST_NAMED = 6  # crossings that bear their number; of more the mark alone
BEYOND_MARKED = 1e3  # beyond all that is marked |L| is a pole or a zero on the axis, and leaves the picture
LEAST_REACH = 3.0  # factors of |L| beyond 1 that the picture reaches at least, either way


def draw_loop(found: Margins, name: str) -> Figure:
    """|L| above the phase from -180 to 180 deg; |L| = 1 and L < 0 marked where they are crossed."""
    omega, L = loop_curve(found)
    with style():
        figure = blank(9.0, 5.8)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.5, 1.0])
        for ax in (upper, lower):
            ax.set_xscale("log")
            ax.set_xlim(omega[0], omega[-1])
        _size(omega, L, found, upper)
        _phase(omega, L, found, lower)
        hertz_axis(upper, 1.0)
        if upper.get_legend_handles_labels()[0]:
            figure.legend(loc="outside lower left", ncols=4, fontsize=8.5)
        headline(figure, f"{found.stability.loop.arm.name}: the loop function L(iω) of {name}")
    return figure


def _size(omega: Real, L: NDArray[np.complex128], found: Margins, ax: Axes) -> None:
    """|L| with the line 1, and at each L < 0 the way to it: the factor on the whole law that puts a pole there."""
    ax.set_yscale("log")
    size = abs(L)
    ax.plot(omega, size, color=BLUE)
    ax.axhline(1.0, color=GREY, lw=0.9)
    margins = found.in_band
    crossed = [] if margins is None else [1 / factor for _, factor in margins.phase_crossovers]
    low, high = min([1 / LEAST_REACH, *crossed]), max([LEAST_REACH, size[0], *crossed])
    ax.set_ylim(max(size.min(), low / BEYOND_MARKED) / 1.5, min(size.max(), high * BEYOND_MARKED) * 1.5)
    ax.set_ylabel("|L|")
    if margins is None:
        return
    for number, (w, factor) in enumerate(margins.phase_crossovers):
        if not omega[0] <= w <= omega[-1]:
            continue
        ax.plot([w, w], [1.0, 1 / factor], color=ORANGE, lw=1.0, ls=(0, (2, 1.5)))
        ax.plot(
            [w], [1 / factor], "o", color=ORANGE, ms=4.5, label="L < 0, and the factor to −1" if not number else None
        )
        if number < MOST_NAMED:
            _named(f"× {significant(factor, 3)}", w, 1 / factor, ax)
    _crossed(margins.gain_crossovers, [1.0] * len(margins.gain_crossovers), "|L| = 1", ax)


def _phase(omega: Real, L: NDArray[np.complex128], found: Margins, ax: Axes) -> None:
    """The angle of L in degrees, broken where it passes 180; at each |L| = 1 the phase margin with its sign."""
    ax.plot(*wrapped_phase(omega, L), color=BLUE)
    ax.set_ylim(-190, 190)
    ax.set_yticks([-180, -90, 0, 90, 180])
    for edge in (-180, 180):
        ax.axhline(edge, color=GREY, lw=0.9)
    ax.set_ylabel("phase [deg]")
    ax.set_xlabel("angular frequency [rad/s]")
    margins = found.in_band
    if margins is None:
        return
    at = [margin - 180 if margin > 0 else margin + 180 for _, margin in margins.gain_crossovers]
    for (w, margin), place in zip(margins.gain_crossovers, at, strict=True):
        colour = GREEN if margin > 0 else PURPLE
        ax.plot([w, w], [-180 if margin > 0 else 180, place], color=colour, lw=1.0, ls=(0, (2, 1.5)))
    for number, ((w, margin), place) in enumerate(zip(margins.gain_crossovers, at, strict=True)):
        if number < MOST_NAMED:
            _named(f"{significant(margin, 3)}°", w, place, ax)
    _crossed(margins.gain_crossovers, at, "", ax)


def _crossed(crossings: tuple[tuple[float, float], ...], heights: list[float], label: str, ax: Axes) -> None:
    """Marks at |L| = 1, green where the phase margin is lag, purple where it is lead."""
    told: set[str] = set()
    for (w, margin), height in zip(crossings, heights, strict=True):
        what = f"{label}, {'lag' if margin > 0 else 'lead'} to −1" if label else ""
        colour = GREEN if margin > 0 else PURPLE
        ax.plot([w], [height], "D", color=colour, ms=4.5, label=what if what not in told and what else None, zorder=4)
        told.add(what)


def _named(text: str, w: float, height: float, ax: Axes) -> None:
    ax.add_artist(Label(text, [(w, height)], OFFSETS_BESIDE, fontsize=7.5))
