"""Poles of the sampled loop along its gains, in the strips of the s-plane that the samples fold on one, and in z.

Left the s-plane: a mode above half the sample rate (in a shaded strip) is seen, and moved, at its mirror image in the
lowest strip, s = ln(z)/T; the locus is that of one gain alone.  Right the z-plane.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator
from numpy.typing import NDArray

from tfarm.digits import plain
from tfarm.dsp.loci import DRAWN_RADIUS, RIM, SampledLoci, SampledLocus

from .labels import OFFSETS_BESIDE, Label
from .style import BLUE, GREY, INK, ORANGE, blank, headline, style
from .words import gains_words

STRIPS = 2.0  # how many strips are shown at least
ALIASED = "#eef0f3"
NEAR_AXIS = 0.01  # 1/s: the real axis is linear up to here, logarithmic beyond
LINEAR_PART = 0.9 / math.log(10)  # of its linear part: there is no corner where the two meet
TICKS_ACROSS = (-100.0, -10.0, -1.0, -0.1, 0.0, 0.1, 1.0)  # 1/s, of them those within the picture


def draw_folded_loci(data: SampledLoci) -> Figure:
    """The folded s-plane, then the z-plane for either gain."""
    with style():
        figure = blank(9.0, 5.4)
        places = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.25])
        folded(data, ax=figure.add_subplot(places[:, 0]))
        upper, lower = figure.add_subplot(places[0, 1]), figure.add_subplot(places[1, 1])
        for locus, ax in zip(data.by.values(), (upper, lower), strict=True):
            z_plane(data, locus, ax=ax)
        upper.set_xlabel("")
        arm, ms = data.loop.plant.arm.name, plain(1e3 * data.loop.chain.sampling.period)
        headline(figure, f"{arm}: poles of the loop sampled every {ms} ms")
    return figure


def folded(data: SampledLoci, *, ax: Axes) -> None:
    """The s-plane up to the first aliased mode: strips, the arm's poles, their images, and the locus of one gain."""
    half = data.half_rate
    hertz = data.poles.imag / (2 * math.pi)
    above = hertz[hertz > half]
    top = STRIPS * half if not above.size else max(STRIPS * half, 1.12 * float(above.min()))
    shown = hertz < top
    ax.set_xscale("symlog", linthresh=NEAR_AXIS, linscale=LINEAR_PART)
    ax.axhspan(half, top, color=ALIASED, zorder=0)
    for k in range(2, math.ceil(top / half)):
        ax.axhline(k * half, color="white", lw=1.2, zorder=0.5)
    place = ax.get_yaxis_transform()
    ax.text(0.97, half + 0.015 * top, "aliased strips", fontsize=8.5, color=GREY, ha="right", transform=place)
    ends = [*data.poles[shown].real, *_branches(data, data.mode[shown], ax)]
    for pole, mode, f in zip(data.poles[shown], data.mode[shown], hertz[shown], strict=True):
        image, colour = abs(f - 2 * half * round(f / (2 * half))), _colour(data, int(mode))
        if f > half:
            ax.annotate(
                "", (pole.real, image), (pole.real, f), zorder=3,
                arrowprops={"arrowstyle": "->", "color": colour, "lw": 0.9, "linestyle": (0, (4, 3))},
            )  # fmt: skip
        ax.plot(pole.real, f, "o", mfc="white", mec=colour, mew=1.3, ms=6, zorder=5)
        ax.add_artist(Label(f"mode {mode}", [(float(pole.real), float(f))], OFFSETS_BESIDE, fontsize=8.5))
    ax.axvline(0.0, color=INK, lw=0.9)
    ax.set_xlim(3.0 * min(*ends, -1.0), 3.0 * max(*ends, 0.1))
    ax.set_ylim(0.0, top)
    ax.set_xticks([x for x in TICKS_ACROSS if ax.get_xlim()[0] < x < ax.get_xlim()[1]])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: plain(x, 3)))
    ax.set_xlabel("real part  [1/s]: decays | grows")
    ax.set_ylabel("frequency  [Hz]")
    ax.grid(False)
    ax.set_title(f"s = ln(z)/T, {data.alone.gain} alone, up to {plain(data.alone.values[-1], 3)}", fontsize=9.5)


def _branches(data: SampledLoci, modes: NDArray[np.int64], ax: Axes) -> list[float]:
    """The locus of the gain that is alone, of these modes, in the lowest strip; real parts of what was drawn."""
    ends: list[float] = []
    for branch in np.nonzero(np.isin(data.alone.mode, modes))[0]:
        z = data.alone.z[:, branch]
        if z[0].imag < 0:
            continue
        oscillating = z[z.imag > 1e-9]
        s = np.log(oscillating) / data.loop.chain.sampling.period
        colour = _colour(data, int(data.alone.mode[branch]))
        ax.plot(s.real, s.imag / (2 * math.pi), color=colour, lw=1.6, zorder=4)
        ax.plot(s[-1].real, s[-1].imag / (2 * math.pi), "o", color=colour, ms=4.5, zorder=5)
        ends += [float(s.real.min()), float(s.real.max())]
    return ends


def z_plane(data: SampledLoci, locus: SampledLocus, *, ax: Axes) -> None:
    """The upper half of the z-plane with one gain's locus; open circles at its start, dots at the loop's gains."""
    angle = np.linspace(0.0, math.pi, 181)
    ax.fill_between(DRAWN_RADIUS * np.cos(angle), 0, DRAWN_RADIUS * np.sin(angle), color="#f7e9de", zorder=0)
    ax.fill_between(np.cos(angle), 0, np.sin(angle), color="white", zorder=0.2)
    ax.plot(np.cos(angle), np.sin(angle), color=INK, lw=0.9, zorder=1)
    here = int(abs(locus.values - data.loop.number(locus.gain)).argmin())
    for branch in np.argsort(locus.mode):
        z, mode = locus.z[:, branch], int(locus.mode[branch])
        visible = np.where((z.imag >= -1e-12) & (abs(z) < DRAWN_RADIUS), z, np.nan)
        if not np.isfinite(visible).any():
            continue
        colour = _colour(data, mode) if mode else GREY
        ax.plot(visible.real, visible.imag, color=colour, lw=1.4, zorder=3)
        if np.isfinite(visible[0]):
            ax.plot(z[0].real, z[0].imag, "o", mfc="white", mec=colour, mew=1.1, ms=4.5, zorder=4)
        if np.isfinite(visible[here]):
            ax.plot(z[here].real, z[here].imag, "o", color=colour, ms=4.5, zorder=5)
    ax.set_xlim(-RIM, RIM)
    ax.set_xticks([-1.0, -0.5, 0.0, 0.5, 1.0])
    ax.set_ylim(0.0, RIM)
    ax.set_aspect("equal")
    ax.grid(False)
    span = f"{plain(locus.values[0], 2)} to {plain(locus.values[-1], 3)}"
    held = gains_words(data.loop.gains, 10, but=locus.gain)
    ax.set_title(f"z-plane, {locus.gain} from {span} ({held})", fontsize=9.5)
    ax.set_xlabel("Re z")
    ax.set_ylabel("Im z")


def _colour(data: SampledLoci, mode: int) -> str:
    return ORANGE if data.is_aliased(mode) else BLUE
