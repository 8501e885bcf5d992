"""Nyquist plots of the exact loop function that hide nothing: infinity is on the rim, poles on the axis are arcs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from tfarm.arrays import Complex
from tfarm.digits import plain, significant
from tfarm.loop.nyquist import Nyquist, compressed

from .labels import OFFSET_UPON, OFFSETS_FURTHER, Label
from .style import BLUE, FAINT, GREY, ORANGE, Keys, legend_below, page, picture, safe
from .words import gains_words

RING_SIZES = (0.1, 0.3, 1.0, 3.0, 10.0)  # |L| of the rings
NAME_ANGLES = np.r_[56:360:17, 0:56:17]  # degrees on a ring where its size may stand, in the order of trial
ARC_RADIUS, LAST_RADIUS, RADIUS_STEP = 1.04, 1.2, 0.03  # of the first arc at infinity, of the last, and between two
RIM_NAME, ARC_COUNT = 1.12, 1.16  # radii of words beyond the rim: of its name, and of how many arcs turn alike
ARCS_ALIKE = math.radians(20.0)  # arcs whose ends are as near as that turn alike
ARROWS_AT = np.array([0.12, 0.4, 0.75])  # of the drawn length of the curve, arcs at infinity apart
RING_HALO: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}


def _legend() -> Keys:
    handles = [
        Line2D([], [], color=BLUE, lw=1.3),
        Line2D([], [], color=BLUE, lw=0.6, alpha=0.55),
        Line2D([], [], color=BLUE, lw=0.8, ls=(0, (3, 1.5))),
        Line2D([], [], color=ORANGE, ls="none", marker="+", ms=9, mew=2.0),
    ]
    return handles, ["ω > 0, arrows as it rises", "ω < 0", "past poles on the axis", "the point −1"]


@picture(
    (Nyquist, "tfarm.nyquist returns"), size=(5.0, 5.8), keys=True,
    title=lambda data: f"{data.verdict.loop.arm.name}: the loop function L(iω)",
)  # fmt: skip
def nyquist(data: Nyquist, *, ax: Axes, name: str = "") -> Keys:
    """L on Nyquist's contour (what `tfarm.nyquist` returns), verdict and encirclements above it; the axes.

    A size r of L is drawn as r/(1 + r): the rim is infinity, -1 lies half way.  `name`: what the law is called.
    """
    _disc(ax)
    _curve(data, ax)
    verdict = data.verdict
    led, told = safe(name), safe(gains_words(verdict.loop.law).removeprefix(f"{name}, "))
    ax.set_title(
        f"{led}{': ' * bool(name)}{verdict.verdict.upper()}\n{told}\n"
        f"encirclements of −1: {data.encirclements:d};  unstable poles: {verdict.unstable_roots}",
        fontsize=9.0, loc="center",
    )  # fmt: skip
    return _legend()


def draw_nyquist(title: str, plots: Mapping[str, Nyquist]) -> Figure:
    """One disc a law, of at most two, by the laws' names."""
    band = significant(max(data.verdict.band for data in plots.values()), 5)
    title = f"{title}: the loop function L(iω) up to {band} rad/s"
    with page(9.0 if len(plots) > 1 else 5.6, 5.3, title, ncols=len(plots), squeeze=False) as (figure, axes):
        for ax, (name, data) in zip(axes[0], plots.items(), strict=True):
            nyquist(data, ax=ax, name=name)
        legend_below(figure, _legend())
    return figure


def _disc(ax: Axes) -> None:
    """Rings of equal |L|, the axes, the rim at infinity, and -1."""
    turn = np.exp(1j * np.linspace(0, 2 * math.pi, 361))
    for size in (*RING_SIZES, math.inf):
        ring = turn * (1.0 if math.isinf(size) else size / (1 + size))
        ax.plot(ring.real, ring.imag, color=GREY if size in (1.0, math.inf) else FAINT, lw=0.7, zorder=0.6)
        at = [(float(z.real), float(z.imag)) for z in ring[NAME_ANGLES] * (RIM_NAME if math.isinf(size) else 1.0)]
        text = "|L| = ∞" if math.isinf(size) else plain(size)
        ax.add_artist(Label(text, at, OFFSET_UPON, may_go=True, fontsize=7.5, color=GREY, bbox=RING_HALO))
    ax.plot([-1, 1], [0, 0], color=FAINT, lw=0.7, zorder=0.5)
    ax.plot([0, 0], [-1, 1], color=FAINT, lw=0.7, zorder=0.5)
    ax.plot([-0.5], [0], "+", color=ORANGE, ms=11, mew=2.2, zorder=6)
    halo = [withStroke(linewidth=2.0, foreground="white")]
    looks: dict[str, Any] = {"fontsize": 10.0, "color": ORANGE, "weight": "bold", "path_effects": halo}
    ax.add_artist(Label("−1", [(-0.5, 0.0)], OFFSETS_FURTHER, **looks))
    ax.set(aspect="equal", xticks=[], yticks=[], frame_on=False)


def _curve(data: Nyquist, ax: Axes) -> None:
    """Along the axis as a line, past poles as arcs beyond the rim, one for all that turn alike; arrows as w rises."""
    z = compressed(data.L)
    turn = np.flatnonzero(np.diff(data.is_arc.astype(int))) + 1
    alike: dict[tuple[int, int], list[NDArray[np.int64]]] = {}
    for piece in np.split(np.arange(z.size), turn):
        if not data.is_arc[piece[0]]:
            ax.plot(z[piece].real, z[piece].imag, color=BLUE, lw=1.3, zorder=3)
            ax.plot(z[piece].real, -z[piece].imag, color=BLUE, lw=0.6, alpha=0.55, zorder=2)
            continue
        angle = np.unwrap(np.angle(data.L[piece]))
        alike.setdefault((round(angle[0] / ARCS_ALIKE), round(angle[-1] / ARCS_ALIKE)), []).append(piece)
    step = min(RADIUS_STEP, (LAST_RADIUS - ARC_RADIUS) / max(1, len(alike) - 1))
    for number, pieces in enumerate(alike.values()):
        _arc(data, z, pieces, ARC_RADIUS + step * number, ax)
    (along,) = np.nonzero(~data.is_arc)
    length = np.r_[0.0, np.cumsum(abs(np.diff(z[along])))]
    for n in np.searchsorted(length, length[-1] * ARROWS_AT):
        _arrow(z[along[max(0, n - 1) : n + 1]], ax)
    reach = (-LAST_RADIUS - RADIUS_STEP, LAST_RADIUS + RADIUS_STEP)
    ax.set(xlim=reach, ylim=reach)


def _arc(data: Nyquist, z: Complex, pieces: list[NDArray[np.int64]], radius: float, ax: Axes) -> None:
    """The first of some arcs that turn alike, and how many they are."""
    piece = pieces[0]
    angle = np.unwrap(np.angle(data.L[piece]))
    ring = radius * np.exp(1j * np.interp(np.linspace(0, 1, 61), np.linspace(0, 1, angle.size), angle))
    ends = np.r_[z[max(0, piece[0] - 1)], ring, z[min(z.size - 1, piece[-1] + 1)]]
    ends = ends[1:] if piece[0] == 0 else ends
    ax.plot(ends.real, ends.imag, color=BLUE, lw=0.8, ls=(0, (3, 1.5)), zorder=3)
    _arrow(ring, ax)
    if len(pieces) > 1:
        places = [(float(s.real), float(s.imag)) for s in ARC_COUNT * ring[10:-10:5] / radius]
        ax.add_artist(Label(f"{len(pieces)} ×", places, OFFSET_UPON, fontsize=8.0, color=BLUE))


def _arrow(piece: Complex, ax: Axes) -> None:
    half = piece.size // 2 if piece.size > 2 else 1
    start, stop = piece[half - 1], piece[half]
    if start == stop:
        return
    way = (stop - start) / abs(stop - start)
    ax.annotate(
        "", (stop.real + 0.012 * way.real, stop.imag + 0.012 * way.imag), (stop.real, stop.imag), zorder=4,
        arrowprops={"arrowstyle": "-|>", "color": BLUE, "lw": 0.8, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 9},
    )  # fmt: skip
