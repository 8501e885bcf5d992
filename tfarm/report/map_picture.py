"""The map drawn: colours for the exact count, lines for the exact boundary, contours of the least damping."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, SymmetricalLogLocator
from numpy.typing import NDArray
from scipy import ndimage

from tfarm.digits import SUPERSCRIPT, plain, significant
from tfarm.loop.regions import INFINITE
from tfarm.plots.style import BLUE, GREY, INK, ORANGE, PURPLE, blank, headline, style
from tfarm.report.map import GainMap, Real, stable_edge
from tfarm.report.region_pieces import pieces

STABLE, FEWEST, MOST, BOUNDLESS = "#dcefe6", "#fbeadd", "#eebd95", "#f3d9c6"
STEPS, MOST_LEVELS = (1.0, 2.0, 5.0), 7  # of the contours
LEAST_AREA = 0.004  # of the picture: smaller regions are not labelled
LETTER = (2.4, 3.6)  # columns and rows of the grid that a letter takes
MARKS = 7  # frequencies written along the boundary
MARKERS = {"default": "D", "best": "*"}


def draw_map(data: GainMap) -> Figure:
    """K1 across, K2 up."""
    with style():
        figure = blank(9.0, 6.2)
        ax = figure.subplots()
        _scale(data, ax)
        ax.imshow(
            colours(data.region.unstable), extent=(0, 1, 0, 1), transform=ax.transAxes, origin="lower", aspect="auto",
            interpolation="nearest", zorder=0.1,
        )  # fmt: skip
        _contours(data, ax)
        _boundary(data, ax)
        _sampled(data, ax)
        _lyapunov(data, ax)
        _count_labels(data, ax)
        _laws(data, ax)
        figure.legend(loc="outside lower left", ncols=3, fontsize=8.2, handlelength=1.8, columnspacing=1.2)
        headline(figure, f"{data.arm.name}: how high may the gains go?")
    return figure


def colours(unstable: NDArray[np.int64]) -> Real:
    """Green where stable, orange the stronger the more poles are unstable."""
    share = np.clip((unstable - 1) / max(1, unstable.max() - 1), 0, 1)[..., None]
    low, high = np.array(to_rgb(FEWEST)), np.array(to_rgb(MOST))
    image = low + share * (high - low)
    image[unstable == INFINITE] = to_rgb(BOUNDLESS)
    image[unstable == 0] = to_rgb(STABLE)
    return np.asarray(image)


def _scale(data: GainMap, ax: Axes) -> None:
    for axis, setter, limits, name in (
        (data.x, ax.set_xscale, ax.set_xlim, ax.xaxis),
        (data.y, ax.set_yscale, ax.set_ylim, ax.yaxis),
    ):
        if not axis.is_linear:
            setter("symlog", linthresh=axis.linear, linscale=0.5)
            name.set_major_locator(SymmetricalLogLocator(base=10, linthresh=axis.linear))
            name.set_major_formatter(FuncFormatter(_tick))
            name.set_minor_formatter(NullFormatter())
        limits(axis.low, axis.high)
    if not data.y.is_linear:
        ax.set_yticks([y for y in (-50, -20, -10, -5, -2, -1, 0, 1, 2) if y >= data.y.low])
    ax.grid(False)
    ax.set_xlabel(f"K1, gain on the hub rate [N m s/rad]; linear up to {plain(data.x.linear)}, logarithmic beyond")
    ax.set_ylabel("K2, gain on the root moment [−]")


def _tick(x: float, _: object = None) -> str:
    return plain(x, 3) if abs(x) < 1e4 else f"10{str(round(math.log10(x))).translate(SUPERSCRIPT)}"


def _contours(data: GainMap, ax: Axes) -> None:
    """Of the least damping ratio, inside the stable region."""
    shown = np.where(data.counts == 0, data.damping, np.nan)
    if np.isnan(shown).all():
        return
    levels = nice_levels(float(np.nanmin(shown)), float(np.nanmax(shown)))
    if not levels:
        return
    lines = ax.contour(data.K1, data.K2, np.ma.masked_invalid(shown), levels=levels, colors=BLUE, linewidths=0.9)
    ax.clabel(lines, fmt=lambda level: f"{plain(100 * level, 3)} %", fontsize=8.0, inline_spacing=3)
    ax.plot([], [], color=BLUE, lw=0.9, label="least damping ratio of the first two modes")


def nice_levels(low: float, high: float) -> list[float]:
    """1, 2 and 5 times powers of ten between two values, the highest few, and one more below the top."""
    if high <= 0:
        return []
    top = math.floor(math.log10(high))
    steps = sorted(step * 10.0**power for power in range(top - 4, top + 1) for step in STEPS)
    levels = [level for level in steps if max(low, 0.0) < level < high][-MOST_LEVELS:]
    more = [1.5 * levels[-1]] if levels and 1.5 * levels[-1] < high else []
    return levels + more


def _boundary(data: GainMap, ax: Axes) -> None:
    """The exact edge with its frequencies; at C = 0 two lines."""
    if data.is_undamped:
        ax.plot([0, 0, data.x.high], [data.y.low, 1, 1], color=INK, lw=1.8, label="stability boundary, exact")
        ax.plot([0, 0], [1, data.y.high], color=INK, lw=0.8)
        ax.plot([data.x.low, 0], [1, 1], color=INK, lw=0.8)
        held = ", ".join(significant(float(w), 4) for w in data.held)
        text = f"on this line every mode with the hub at rest: {held} … rad/s"
        ax.annotate(text, (data.x.high, 1.0), textcoords="offset points", xytext=(-6, 5), ha="right", fontsize=8.5)
        return
    ax.plot(data.edge[:, 0], data.edge[:, 1], color=INK, lw=1.6, label="poles on the axis at iω, exact")
    ax.plot([0, 0], [data.y.low, data.y.high], color=INK, lw=1.6)
    for K1, K2, omega in _chosen(stable_edge(data), data):
        ax.plot([K1], [K2], "o", ms=4.0, mfc="white", mec=INK, mew=1.0, zorder=5)
        ax.annotate(
            f"{significant(omega, 3)}", (K1, K2), textcoords="offset points", xytext=(0, 5), ha="center",
            fontsize=8.0, zorder=6,
        )  # fmt: skip
    ax.plot([], [], "o", ms=4.0, mfc="white", mec=INK, mew=1.0, label="with ω in rad/s")


def _sampled(data: GainMap, ax: Axes) -> None:
    """Where the sampled loop is stable: hatched, its edge exact."""
    if data.sampled is None:
        return
    layer = data.sampled
    label = f"stable when sampled every {plain(1e3 * data.chain.sampling.period)} ms (first {layer.modes} modes)"
    for piece in pieces(layer.K1, layer.intervals):
        x, low, high = np.array(piece.points).T
        ax.fill_between(x, low, high, facecolor="none", edgecolor=ORANGE, alpha=0.45, hatch="////", lw=0, zorder=1)
        for line in (low, high):
            ax.plot(x, line, color=ORANGE, lw=1.2, zorder=4.5)
        for end in np.nonzero([piece.begins and x[0] > layer.K1[0], piece.ends])[0]:
            ax.plot([x[-end]] * 2, [low[-end], high[-end]], color=ORANGE, lw=1.2, zorder=4.5)
    none = "" if any(layer.intervals) else ": nowhere in this picture"
    ax.fill_between([], [], [], facecolor="none", edgecolor=ORANGE, hatch="////", lw=1.0, label=f"{label}{none}")


def _chosen(points: Real, data: GainMap) -> Real:
    """A few points of the stable region's edge, far apart as seen."""
    if not points.size:
        return points
    places = np.stack([data.x.place(points[:, 0]), data.y.place(points[:, 1])], axis=1)
    (inside,) = np.nonzero((places > 0.02).all(axis=1) & (places < 0.97).all(axis=1))
    if not inside.size:
        return points[:0]
    chosen = [int(inside[0])]
    while len(chosen) < MARKS:
        apart = np.hypot(*np.moveaxis(places[inside][:, None] - places[chosen], -1, 0)).min(axis=1)
        if apart.max() < 0.07:
            break
        chosen.append(int(inside[np.argmax(apart)]))
    return np.asarray(points[chosen])


def _lyapunov(data: GainMap, ax: Axes) -> None:
    """K1 > 0, K2 < 1: proven at C = 0; at C > 0 only its line K2 = 0 is."""
    inset = 1.0 if not data.is_undamped else 1.0 - 0.008 * (data.y.high - data.y.low)
    corner = 0.0 if not data.is_undamped else 0.04 * data.x.linear
    dashes, label = (
        ("-", "Lyapunov (K1 > 0, K2 < 1): proven")
        if data.is_undamped
        else ((0, (5, 3)), "Lyapunov (K1 > 0, K2 < 1): not a proof here")
    )
    ax.plot([corner, corner, data.x.high], [data.y.low, inset, inset], color=PURPLE, lw=1.6, ls=dashes, label=label)
    if not data.is_undamped:
        ax.plot([0, data.x.high], [0, 0], color=PURPLE, lw=1.6, label="Lyapunov at C > 0: K2 = 0 proven")


def _count_labels(data: GainMap, ax: Axes) -> None:
    """In every region that is large enough, how many poles are unstable there."""
    unstable = data.region.unstable
    for count in np.unique(unstable):
        parts, number = ndimage.label(unstable == count)
        for part in range(1, number + 1):
            inside = np.asarray(parts == part)
            if inside.mean() < LEAST_AREA:
                continue
            row, column, words, turn = _placed(inside, _words(int(count)), str(count).replace("-1", "∞"))
            ax.annotate(
                words, (data.region.K1[column], data.region.K2[row]), ha="center", va="center", rotation=turn, zorder=4,
                fontsize=9.0, color=INK if count else "#00543f",
                bbox={"facecolor": colours(unstable)[row, column], "edgecolor": "none", "pad": 1.5},
            )  # fmt: skip


def _placed(inside: NDArray[np.bool_], words: str, short: str) -> tuple[int, int, str, int]:
    """Row, column, words and rotation: across if that fits, else upright, else the bare number."""
    depth = ndimage.distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
    deep = np.argwhere(depth > 0.8 * depth.max())
    centre = np.argwhere(inside).mean(axis=0)
    row, column = (int(i) for i in deep[np.argmin(((deep - centre) ** 2).sum(axis=1))])
    left, right = _run(inside[row], column)
    low, high = _run(inside[:, column], row)
    if right - left > LETTER[0] * len(words):
        return row, (left + right) // 2, words, 0
    if high - low > LETTER[1] * len(words):
        return (low + high) // 2, column, words, 90
    return row, column, short, 0


def _run(inside: NDArray[np.bool_], at: int) -> tuple[int, int]:
    """First and last place of the run of trues around one of them."""
    outside = np.r_[-1, np.nonzero(~inside)[0], inside.size]
    n = int(np.searchsorted(outside, at))
    return int(outside[n - 1]) + 1, int(outside[n]) - 1


def _words(count: int) -> str:
    if count == 0:
        return "stable"
    return "every flexible mode unstable" if count == INFINITE else f"{count} unstable pole{'s' * (count > 1)}"


def _laws(data: GainMap, ax: Axes) -> None:
    for law, brief in zip(data.laws, data.briefs, strict=True):
        ax.plot(
            [law.law.K1], [law.law.K2], MARKERS[law.key], ms=8.0 if law.key == "default" else 13.0, mfc=ORANGE,
            mec="white", mew=1.0, zorder=7, ls="none", label=f"{law.name}: {law.gains};\n{brief.short}",
        )  # fmt: skip
    if data.design is not None:
        (a, b), (c, d) = data.design.bounds["K1"], data.design.bounds["K2"]
        ax.plot([a, b, b, a, a], [c, c, d, d, c], color=GREY, lw=0.8, ls=(0, (1, 2)), label="bounds of its search")
