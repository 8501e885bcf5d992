"""Bode plots of exact responses.  An infinite resonance is drawn as one: the curve runs off the picture, broken."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MultipleLocator, NullFormatter

from tfarm.arrays import Complex, Real
from tfarm.digits import plain
from tfarm.response.frequency import Bode

from .drawn import drawn
from .style import BLUE, FAINT, GREY, INK, ORANGE, New, blank, headline, must_be, style, taken, window

RAD_PER_CYCLE = 2 * math.pi  # rad/s of 1 Hz
NUMBER_STRIP = 0.085  # height of the strip of mode numbers above the magnitude, as a share of its axes: a line of them
NUMBERS_APART = 0.019  # share of the width below which two mode numbers would touch: two digits of 8 points on 9 inches


def bode(data: Bode, *, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes]:
    """Magnitude over phase of a response (what `tfarm.bode` returns), in two axes, those given or new ones: these axes.

    Magnitudes in the response's SI units, phases in degrees; an infinite resonance is broken, a triangle at its place.
    """
    must_be(Bode, data, "tfarm.bode returns")
    with style():
        if ax is None:
            upper, lower = draw_bode(data, window).axes
        else:
            upper, lower = taken(ax, 2)
            draw_magnitude(data, ax=upper)
            draw_phase(data, ax=lower)
    return upper, lower


@drawn.register
def draw_bode(data: Bode, new: New = blank) -> Figure:
    """Magnitude over phase of one response, on a figure of its own."""
    with style():
        figure = new(9.0, 6.2)
        upper, _ = bode(data, ax=figure.subplots(2, 1, sharex=True, height_ratios=[1.75, 1.0]))
        upper.set_xlabel("")
        upper.tick_params(labelbottom=False)
        headline(figure, f"{data.arm.name}: {data.input_label} to {data.label}")
    return figure


def draw_card(data: Bode) -> Figure:
    """The magnitude alone, small, for the index."""
    with style():
        figure = blank(4.4, 2.5)
        draw_magnitude(data, ax=figure.subplots(), is_small=True)
    return figure


def draw_magnitude(data: Bode, *, ax: Axes, is_small: bool = False, label: str = "flexible arm, exact") -> None:
    """|G| on log scales: rad/s below, Hz above; triangles where it is infinite or zero."""
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(*data.band)
    ax.set_ylim(*magnitude_limits(data))
    low, high = ax.get_ylim()
    jumps = np.r_[data.infinite, data.vanishing]
    edges = np.r_[np.full(data.infinite.size, 10 * high), np.full(data.vanishing.size, low / 10)]
    ax.plot(*broken(data.omega, np.abs(data.value), jumps, edges), color=BLUE, label=label)
    if np.any(data.rigid):
        ax.plot(data.omega, abs(data.rigid), color=GREY, lw=1.0, ls=(0, (4, 3)), zorder=1.5, label="rigid arm")
    _mark_roots(data, ax)
    if (
        data.arm.has_cutoff and data.band[0] < data.arm.shear_cutoff < data.band[1]
    ):  # where the second pair of waves begins to travel
        ax.axvline(data.arm.shear_cutoff, color=ORANGE, lw=1.0, ls="-.", label="shear cut-off")
    ax.set_xlabel("angular frequency [rad/s]")
    ax.yaxis.set_minor_formatter(NullFormatter())
    if is_small:
        ax.set_ylabel(f"|{data.label}| [{data.gain_unit}]", fontsize=8.5)
        return
    ax.set_ylabel(f"|{data.label} / {data.input_label}|  [{data.gain_unit}]")
    if data.is_zero:
        ax.text(0.5, 0.5, "zero at every frequency", ha="center", va="center", transform=ax.transAxes)
    _number_modes(data, ax)
    hertz_axis(ax, 1.0 + NUMBER_STRIP)
    starts_low = abs(data.value[0]) < math.sqrt(low * high)
    ax.legend(loc="upper left" if starts_low else "lower left")


def draw_phase(data: Bode, *, ax: Axes) -> None:
    """The phase in degrees; at C = 0 it steps by 180 degrees at every root on the axis."""
    ax.set_xscale("log")
    ax.set_xlim(*data.band)
    for root in data.infinite:
        ax.axvline(root, color=FAINT, lw=0.8, zorder=0.5)
    jumps = np.r_[data.infinite, data.vanishing]
    ax.plot(data.omega, data.phase, color=BLUE, lw=0.7, ls=(0, (1, 1.5)) if jumps.size else "-")
    ax.plot(*broken(data.omega, data.phase, jumps, np.full(jumps.size, np.nan)), color=BLUE)
    span = float(np.ptp(data.phase))
    ax.set_ylim(data.phase.min() - 0.08 * span - 15, data.phase.max() + 0.08 * span + 15)
    ax.yaxis.set_major_locator(MultipleLocator(next((step for step in (90, 180, 360) if span / step <= 5), 720)))
    ax.set_ylabel("phase [deg]")
    ax.set_xlabel("angular frequency [rad/s]")


def hertz_axis(ax: Axes, height: float) -> None:
    """A second frequency axis in Hz, at that height above the axes."""

    def to_hertz(omega: Any) -> Any:
        return omega / RAD_PER_CYCLE

    def from_hertz(frequency: Any) -> Any:
        return frequency * RAD_PER_CYCLE

    upper = ax.secondary_xaxis(height, functions=(to_hertz, from_hertz))
    upper.set_xlabel("frequency [Hz]", labelpad=5.0)
    upper.xaxis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, 3)))
    upper.xaxis.set_minor_formatter(NullFormatter())


def wrapped_phase(x: Real, values: Complex) -> tuple[Real, Real]:
    """The angle [deg] between -180 and 180 of a curve over x, with a gap where it passes half a turn."""
    angle = np.degrees(np.angle(values))
    jump = np.flatnonzero(abs(np.diff(angle)) > 180) + 1
    return np.insert(x, jump, np.nan), np.insert(angle, jump, np.nan)


def broken(x: Real, y: Real, at: Real, limit: Real) -> tuple[Real, Real]:
    """The curve broken at each of the places, where it runs to its `limit` from both sides (nan: it just ends)."""
    order = np.argsort(at)
    at, limit = at[order], limit[order]
    where, gap = np.repeat(np.searchsorted(x, at), 3), np.full(at.size, np.nan)
    return np.insert(x, where, np.c_[at, gap, at].ravel()), np.insert(y, where, np.c_[limit, gap, limit].ravel())


def magnitude_limits(data: Bode) -> tuple[float, float]:
    """Everything finite with a margin; roots on the axis run off the picture."""
    size = abs(data.value)
    roots = np.r_[data.infinite, data.vanishing]
    if roots.size:
        away = abs(data.omega[:, None] / roots - 1).min(axis=1) > 0.004
        size = size[away] if away.any() else size
    if data.is_zero:
        return 0.1, 10.0
    seen = np.r_[size[size > 0], abs(data.rigid[:1][data.rigid[:1] != 0])]
    low, high = math.log10(seen.min()), math.log10(seen.max())
    margin = max(0.25, 0.06 * (high - low))
    return 10 ** (low - margin), 10 ** (high + margin)


def _mark_roots(data: Bode, ax: Axes) -> None:
    """Open triangles: at the top edge where |G| is infinite, at the bottom edge where it is zero."""
    for root in (*data.infinite, *data.vanishing):
        ax.axvline(root, color=FAINT, lw=0.8, zorder=0.5)
    marks: Sequence[tuple[Real, float, str, str]] = (
        (data.infinite, 1.0, "^", "infinite: pole on the imaginary axis"),
        (data.vanishing, 0.0, "v", "zero: zero on the imaginary axis"),
    )
    for roots, height, marker, label in marks:
        if roots.size:
            ax.plot(
                roots, np.full(roots.size, height), marker, transform=ax.get_xaxis_transform(), clip_on=False,
                mfc="white", mec=INK, ms=6.0, mew=1.0, zorder=5, label=label,
            )  # fmt: skip


def _number_modes(data: Bode, ax: Axes) -> None:
    """The number of each resonance above the axes, as many as do not touch."""
    low, high = np.log(data.band)
    last = -1.0
    for number, pole in enumerate(data.resonances, 1):
        place = (math.log(pole.imag) - low) / (high - low)
        if place - last < NUMBERS_APART:
            continue
        last = place
        ax.text(
            pole.imag, 1.0 + 0.38 * NUMBER_STRIP, str(number), transform=ax.get_xaxis_transform(), ha="center",
            va="bottom", fontsize=8.0, color=GREY,
        )  # fmt: skip
        if pole.imag not in data.infinite:
            ax.axvline(pole.imag, color=FAINT, lw=0.8, zorder=0.5)


def draw_compared(main: Bode, other: Bode, labels: tuple[str, str]) -> Figure:
    """Two responses of one output in one magnitude plot; the roots marked are those of the first."""
    with style():
        figure = blank(9.0, 5.0)
        ax = figure.subplots()
        ax.plot(other.omega, abs(other.value), color=ORANGE, lw=1.8, zorder=3, label=labels[1])
        draw_magnitude(main, ax=ax, label=labels[0])
    return figure
