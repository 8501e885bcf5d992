"""Curves over frequency: exact responses, and the loop function with the places where each margin is read.

An infinite resonance is drawn as one: the curve runs off the picture, broken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MultipleLocator, NullFormatter

from tfarm.arrays import Complex, Real
from tfarm.digits import plain, significant
from tfarm.loop.margins import LoopMargins, Margins, loop_curve
from tfarm.response.frequency import Bode

from .labels import OFFSETS_BESIDE, Label
from .style import BLUE, FAINT, GREEN, GREY, INK, ORANGE, PURPLE, legend_below, page, picture

RAD_PER_CYCLE = 2 * math.pi  # rad/s of 1 Hz
NUMBER_STRIP = 0.085  # height of the strip of mode numbers above the magnitude, as a share of its axes: a line of them
NUMBERS_APART = 0.019  # share of the width below which two mode numbers would touch: two digits of 8 points on 9 inches
MOST_NAMED = 6  # crossings that bear their number; of more the mark alone
BEYOND_MARKED = 1e3  # beyond all that is marked |L| is a pole or a zero on the axis, and leaves the picture
LEAST_REACH = 3.0  # factors of |L| beyond 1 that the picture reaches at least, either way


@picture(
    (Bode, "tfarm.bode returns"), size=(9.0, 6.2), rows=(1.75, 1.0),
    title=lambda data: f"{data.arm.name}: {data.input_label} to {data.label}",
)  # fmt: skip
def bode(data: Bode, *, ax: Sequence[Axes]) -> None:
    """Magnitude over phase of a response (what `tfarm.bode` returns), in two axes, those given or new ones: these axes.

    Magnitudes in the response's SI units, phases in degrees; an infinite resonance is broken, a triangle at its place.
    """
    draw_magnitude(data, ax=ax[0])
    draw_phase(data, ax=ax[1])


def draw_card(data: Bode) -> Figure:
    """The magnitude alone, small, for the index."""
    with page(4.4, 2.5, "") as (figure, ax):
        draw_magnitude(data, ax=ax, is_small=True)
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

    upper = ax.secondary_xaxis(
        height, functions=(partial(np.multiply, 1 / RAD_PER_CYCLE), partial(np.multiply, RAD_PER_CYCLE))
    )
    upper.set_xlabel("frequency [Hz]", labelpad=5.0)
    upper.xaxis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, 3)))
    upper.xaxis.set_minor_formatter(NullFormatter())


def draw_wrapped(x: Real, values: Complex, ax: Axes, **looks: Any) -> None:
    """The angle [deg] between -180 and 180 of a curve over x, with a gap where it passes half a turn."""
    angle = np.degrees(np.angle(values))
    jump = np.flatnonzero(abs(np.diff(angle)) > 180) + 1
    ax.plot(np.insert(x, jump, np.nan), np.insert(angle, jump, np.nan), **looks)
    ax.set(ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180], ylabel="phase [deg]")


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
    for roots, height, marker, label in (
        (data.infinite, 1.0, "^", "infinite: pole on the imaginary axis"),
        (data.vanishing, 0.0, "v", "zero: zero on the imaginary axis"),
    ):
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
    with page(9.0, 5.0, "") as (figure, ax):
        ax.plot(other.omega, abs(other.value), color=ORANGE, lw=1.8, zorder=3, label=labels[1])
        draw_magnitude(main, ax=ax, label=labels[0])
    return figure


def draw_loop(found: Margins, name: str) -> Figure:
    """|L| above the phase from -180 to 180 deg; |L| = 1 and L < 0 marked where they are crossed."""
    omega, L = loop_curve(found)
    title = f"{found.stability.loop.arm.name}: the loop function L(iω) of {name}"
    with page(9.0, 5.8, title, nrows=2, sharex=True, height_ratios=[1.5, 1.0]) as (figure, (upper, lower)):
        upper.set(xscale="log", yscale="log", xlim=(omega[0], omega[-1]), ylabel="|L|")
        upper.plot(omega, abs(L), color=BLUE)
        upper.axhline(1.0, color=GREY, lw=0.9)
        draw_wrapped(omega, L, lower, color=BLUE)
        lower.set_xlabel("angular frequency [rad/s]")
        for edge in (-180, 180):
            lower.axhline(edge, color=GREY, lw=0.9)
        if found.in_band is None:
            upper.set_ylim(*_reach(np.abs(L), []))
        else:
            _mark_margins(found.in_band, omega, np.abs(L), upper, lower)
        hertz_axis(upper, 1.0)
        if upper.get_legend_handles_labels()[0]:
            legend_below(figure)
    return figure


def _reach(size: Real, crossed: Sequence[float]) -> tuple[float, float]:
    """Limits of |L| with all that is marked; infinite resonances leave the picture."""
    low, high = min([1 / LEAST_REACH, *crossed]), max([LEAST_REACH, float(size[0]), *crossed])
    return max(float(size.min()), low / BEYOND_MARKED) / 1.5, min(float(size.max()), high * BEYOND_MARKED) * 1.5


def _mark_margins(margins: LoopMargins, omega: Real, size: Real, upper: Axes, lower: Axes) -> None:
    """At each L < 0 the factor on the whole law that puts a pole there; at each |L| = 1 the phase margin.

    That is green where it is lag, purple where it is lead.
    """
    upper.set_ylim(*_reach(size, [1 / factor for _, factor in margins.phase_crossovers]))
    seen = [each for each in margins.phase_crossovers if omega[0] <= each[0] <= omega[-1]]
    for number, (w, factor) in enumerate(seen):
        label = None if number else "L < 0, and the factor to −1"
        upper.plot([w, w], [1.0, 1 / factor], color=ORANGE, lw=1.0, ls=(0, (2, 1.5)))
        upper.plot([w], [1 / factor], "o", color=ORANGE, ms=4.5, label=label)
        if number < MOST_NAMED:
            upper.add_artist(Label(f"× {significant(factor, 3)}", [(w, 1 / factor)], OFFSETS_BESIDE, fontsize=7.5))
    for kind, colour, sign in (("lag", GREEN, 1), ("lead", PURPLE, -1)):
        found = [each for each in margins.gain_crossovers if (each[1] > 0) == (sign > 0)]
        for w, margin in found:
            lower.plot([w, w], [-180 * sign, margin - 180 * sign], color=colour, lw=1.0, ls=(0, (2, 1.5)))
            lower.plot([w], [margin - 180 * sign], "D", color=colour, ms=4.5, zorder=4)
        if found:
            at = [w for w, _ in found]
            upper.plot(at, [1.0] * len(at), "D", color=colour, ms=4.5, zorder=4, label=f"|L| = 1, {kind} to −1")
    for w, margin in margins.gain_crossovers[:MOST_NAMED]:
        place = (w, margin - 180 if margin > 0 else margin + 180)
        lower.add_artist(Label(f"{significant(margin, 3)}°", [place], OFFSETS_BESIDE, fontsize=7.5))
