"""The plane of both gains: colours for the exact count, lines for the exact boundary, contours of the least damping."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray
from scipy import ndimage

from tfarm.arm import MOMENT_GAIN, PLANE, Arm, HubFeedback
from tfarm.arrays import Real
from tfarm.crossing import Window, pieces
from tfarm.digits import SUPERSCRIPT, how_many, plain, significant
from tfarm.dsp import GainMap
from tfarm.loop.plane import (
    INFINITE,
    LINEAR_SCALE,
    Axis,
    Plane,
    edge,
    resting_frequencies,
    seen,
    stable_edge,
    static_edges,
)

from .labels import OFFSET_UPON, OFFSETS_AROUND, Label
from .style import BLUE, GREY, INK, ORANGE, PURPLE, picture, safe
from .words import LYAPUNOV, name_axes

STABLE_COLOUR, FEWEST_COLOUR, MOST_COLOUR, BOUNDLESS_COLOUR = "#dcefe6", "#fbeadd", "#eebd95", "#f3d9c6"
CONTOUR_STEPS, MOST_CONTOURS = (1.0, 2.0, 5.0), 7  # of the contours
LEAST_AREA = 0.004  # of the picture: smaller regions are not labelled
PLACES_TRIED = 150  # of a region, from its middle outwards, for the words of its count
RESTING_NAMED = 3  # frequencies of the hub at rest that stand beside their common edge
MOST_MARKED = 7  # frequencies written along the boundary: with more they touch
DIAMOND, STAR = "D", "*"  # of laws
AT_RIGHT = tuple((-6.0, up) for up in (4.0, -4.0, 16.0, -16.0, 28.0))  # points, from where a line ends to its words
NUMBER_HALO: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.75}  # of numbers
TICKS_UP = (-50, -20, -10, -5, -2, -1, 0, 1, 2)  # moment gains on a logarithmic axis, of them those in the picture


def _title(found: Plane) -> str:
    if found.is_of_gains:
        return f"{found.arm.name}: unstable poles over the plane of both gains"
    return f"{found.arm.name}: unstable poles below {significant(found.band, 5)} rad/s under {found.law.name}"


@picture((Plane, "tfarm.map returns"), title=_title, keys=True)
def gain_map(found: Plane, *, ax: Axes) -> None:
    """The plane of both gains, or of two numbers of a law (what `tfarm.map` returns), in the axes given or in new ones.

    Colours for the number of unstable poles; a black line for the exact boundary with frequencies [rad/s] along it, of
    a law dots where a pole is on the axis.  Returns the axes.
    """
    x, y = map(Axis.of, found.axes)
    ground(found, x, y, ax)
    if found.is_of_gains:
        draw_boundary(found, edge(found, x, y), x, y, ax)
        return
    points = np.array([(x, t) for x, each in zip(found.x, found.crossings, strict=False) for t in each.gain])
    if points.size:
        ax.plot(*points.T, ".", color=INK, ms=2.0, label="a pole on the imaginary axis, exact")


def _sampled_title(found: GainMap) -> str:
    ms = significant(1e3 * found.loop.chain.sampling.period, 4)
    return f"{found.loop.plant.arm.name}: unstable poles when sampled every {ms} ms, first {found.modes_used} modes"


@picture((GainMap, "tfarm.dsp.sampled_map returns"), title=_sampled_title, keys=True)
def sampled_map(found: GainMap, *, ax: Axes) -> None:
    """The plane of two numbers of the law of a sampled loop: colours for the count, dots for the exact crossings."""
    counts = found.counts
    image = colours(counts)
    ax.pcolormesh(found.x, found.y, image, shading="nearest", rasterized=True, zorder=0.1)
    for count in np.unique(counts).tolist():
        ax.fill_between([], [], [], color=image[counts == count][0], label=_words(count))
    low, high = found.y[0], found.y[-1]
    points = [(x, t) for x, each in zip(found.x, found.crossings, strict=False) for t in each.within(low, high).gain]
    if points:
        ax.plot(*np.array(points).T, ".", color=INK, ms=2.0, label="a pole on the unit circle, exact")
    ax.grid(False)
    ax.set(xlabel=safe(found.vary[0]), ylabel=safe(found.vary[1]))


def ground(found: Plane, x: Axis, y: Axis, ax: Axes) -> None:
    """Both axes, the colours of the count, and words for it in every region that is large enough."""
    for axis, setter, limits, name in (
        (x, ax.set_xscale, ax.set_xlim, ax.xaxis),
        (y, ax.set_yscale, ax.set_ylim, ax.yaxis),
    ):
        if not axis.is_linear:
            setter("symlog", linthresh=axis.linear, linscale=LINEAR_SCALE)
            name.set_major_formatter(FuncFormatter(_tick))
        limits(axis.low, axis.high)
    if not y.is_linear and found.arm.input_per_torque == 1.0:
        ax.set_yticks([tick for tick in TICKS_UP if y.low <= tick <= y.high])
    ax.grid(False)
    ax.set(xlabel=safe(found.vary[0]), ylabel=safe(found.vary[1]))
    if found.is_of_gains:
        name_axes(found.arm, ax)
    if not x.is_linear and x.low < x.linear:
        ax.set_xlabel(f"{ax.get_xlabel()}; linear up to {plain(x.linear)}, logarithmic beyond")
    grid = seen(found, x, y)
    image = colours(grid.unstable)
    ax.imshow(
        image, extent=(0, 1, 0, 1), transform=ax.transAxes, origin="lower", aspect="auto", interpolation="nearest",
        zorder=0.1,
    )  # fmt: skip
    for count in np.unique(grid.unstable).tolist():
        parts, number = ndimage.label(grid.unstable == count)
        for part in range(1, number + 1):
            cells = np.argwhere(parts == part)
            if len(cells) < LEAST_AREA * parts.size:
                continue
            cells = cells[np.argsort(((cells - cells.mean(axis=0)) ** 2).sum(axis=1), kind="stable")]
            places = [(grid.x[column], grid.y[row]) for row, column in cells[:: 1 + len(cells) // PLACES_TRIED]]
            looks: dict[str, Any] = {
                "fontsize": 9.0,
                "color": INK if count else "#00543f",
                "bbox": {"facecolor": image[tuple(cells[0])], "edgecolor": "none", "pad": 1.5},
            }
            short = str(count).replace("-1", "∞")
            ax.add_artist(Label(_words(count), places, OFFSET_UPON, may_go=True, short=short, **looks))


def _words(count: int) -> str:
    """What a number of unstable poles means."""
    if count == 0:
        return "stable"
    return "every flexible mode unstable" if count == INFINITE else how_many(count, "unstable pole")


def colours(unstable: NDArray[np.int64]) -> Real:
    """Green where stable, orange the stronger the more poles are unstable."""
    share = np.clip((unstable - 1) / max(1, unstable.max() - 1), 0, 1)[..., None]
    low, high = np.array(to_rgb(FEWEST_COLOUR)), np.array(to_rgb(MOST_COLOUR))
    image = low + share * (high - low)
    image[unstable == INFINITE] = to_rgb(BOUNDLESS_COLOUR)
    image[unstable == 0] = to_rgb(STABLE_COLOUR)
    return np.asarray(image)


def _tick(x: float, _: object = None) -> str:
    return plain(x, 3) if abs(x) < 1e4 else f"10{str(round(math.log10(x))).translate(SUPERSCRIPT)}"


def contours(across: Real, up: Real, damping: Real, ax: Axes) -> None:
    """Of the least damping ratio (up, across), where it is a number: inside the stable region."""
    if np.isnan(damping).all():
        return
    levels = nice_levels(float(np.nanmin(damping)), float(np.nanmax(damping)))
    if not levels:
        return
    with np.errstate(invalid="ignore", divide="ignore"):  # by its logarithm, which is straighter
        lines = ax.contour(across, up, np.ma.masked_invalid(np.log(damping)), levels=np.log(levels))
    parts = lines.allsegs
    lines.remove()
    for level, pieces_of_level in zip(levels, parts, strict=True):
        longest = sorted((piece for piece in pieces_of_level if len(piece) > 1), key=len, reverse=True)
        for number, piece in enumerate(longest):
            (line,) = ax.plot(piece[:, 0], piece[:, 1], color=BLUE, lw=0.9, zorder=2.5)
            if not number:
                away = np.arange(len(piece)) - len(piece) // 2  # from its middle, then outwards to both sides
                tried = piece[(len(piece) // 2 + away[np.argsort(abs(away), kind="stable")])[::3]]
                places, text = [(float(x), float(y)) for x, y in tried], f"{plain(100 * level, 3)} %"
                looks: dict[str, Any] = {"fontsize": 8.0, "color": BLUE, "bbox": NUMBER_HALO}
                ax.add_artist(Label(text, places, OFFSET_UPON, own=line, may_go=True, **looks))
    ax.plot([], [], color=BLUE, lw=0.9, label="least damping ratio of the first two modes")


def nice_levels(low: float, high: float) -> list[float]:
    """1, 2 and 5 times powers of ten between two values, the highest few, and one more below the top."""
    if high <= 0:
        return []
    top = math.floor(math.log10(high))
    steps = sorted(step * 10.0**power for power in range(top - 4, top + 1) for step in CONTOUR_STEPS)
    levels = [level for level in steps if max(low, 0.0) < level < high][-MOST_CONTOURS:]
    more = [1.5 * levels[-1]] if levels and 1.5 * levels[-1] < high else []
    return levels + more


def draw_boundary(found: Plane, points: Real, x: Axis, y: Axis, ax: Axes) -> None:
    """The exact edge (n, 3) with its frequencies; without damping an upright line and a level one."""
    if found.arm.loses_at_hub_alone:
        _undamped_boundary(found, x, y, ax)
        return
    ax.plot(points[:, 0], points[:, 1], color=INK, lw=1.6, label="poles on the axis at iω, exact")
    upright, level = static_edges(found)
    if upright is not None and x.low <= upright <= x.high:
        ax.plot([upright, upright], [y.low, y.high], color=INK, lw=1.6)
    if level is not None and y.low <= level <= y.high:
        ax.plot([x.low, x.high], [level, level], color=INK, lw=1.6)
    for across, up, omega in _chosen(stable_edge(found, points, x, y), x, y):
        ax.plot([across], [up], "o", ms=4.0, mfc="white", mec=INK, mew=1.0, zorder=5)
        ax.add_artist(
            Label(significant(omega, 3), [(across, up)], OFFSETS_AROUND, may_go=True, fontsize=8.0, bbox=NUMBER_HALO)
        )
    ax.plot([], [], "o", ms=4.0, mfc="white", mec=INK, mew=1.0, label="with ω in rad/s")


def _undamped_boundary(found: Plane, x: Axis, y: Axis, ax: Axes) -> None:
    """Strong around what is stable, thin where only the number of unstable poles changes.

    That is at the edge of each mode of the locked hub, the first few with their frequency; of a uniform arm all these
    edges are one line.
    """
    label: str | None = "stability boundary, exact"
    _, up = found.axes
    cut = {float(up[0]): y.low, float(up[-1]): y.high}  # an end there is the map's and not the region's
    for low, high in found.stable_intervals[-1]:
        side = [(found.upright, cut.get(end, end)) for end in (low, high)]
        corners = [(x.high, low)] * (low not in cut) + side + [(x.high, high)] * (high not in cut)
        ax.plot(*zip(*corners, strict=True), color=INK, lw=1.8, label=label)
        label = None
    if not found.is_known:
        edges = sorted(found.crossings[-1].within(y.low, y.high), key=lambda each: each.at)
        for number, each in enumerate(edges):
            ax.plot([found.upright, x.high], [each.t, each.t], color=INK, lw=0.5)
            if number < MOST_MARKED:
                text = f"{significant(each.at, 4)} rad/s, the hub at rest"
                ax.add_artist(Label(text, [(x.high, each.t)], AT_RIGHT, may_go=True, fontsize=7.5))
        return
    whole = found.arm.input_per_torque
    if not y.low < whole < y.high:
        return
    ax.plot([found.upright, found.upright], [whole, y.high], color=INK, lw=0.8)
    ax.plot([x.low, found.upright], [whole, whole], color=INK, lw=0.8)
    omega = ", ".join(significant(float(w), 4) for w in resting_frequencies(found, RESTING_NAMED))
    text = f"on this line every mode with the hub at rest: {omega} … rad/s"
    ax.add_artist(Label(text, [(x.high, whole)], AT_RIGHT, fontsize=8.5))


def draw_sampled(plane: GainMap | None, ax: Axes) -> None:
    """Where the sampled loop is stable: hatched, its edge exact.  Nothing where it could not be settled."""
    if plane is None:
        return
    ms = plain(1e3 * plane.loop.chain.sampling.period)
    looks: dict[str, Any] = {"facecolor": "none", "edgecolor": ORANGE, "hatch": "////"}
    parts = draw_region(plane.x, plane.stable_intervals, ORANGE, 1.2, 4.5, ax, alpha=0.45, lw=0, **looks)
    none = "" if parts else ": nowhere in this picture"
    label = f"stable when sampled every {ms} ms (first {plane.modes_used} modes){none}"
    ax.fill_between([], [], [], lw=1.0, label=label, **looks)


def draw_region(
    across: Real, stable: Sequence[Sequence[Window]], edge: str, width: float, zorder: float, ax: Axes, **looks: Any
) -> int:
    """The intervals up at each value across, filled, with edges of that colour; in how many parts.

    Edges are upright where the region itself begins or ends.
    """
    parts = pieces(across, stable)
    for piece in parts:
        x, low, high = np.array(piece.points).T
        ax.fill_between(x, low, high, zorder=1, **looks)
        for line in (low, high):
            ax.plot(x, line, color=edge, lw=width, zorder=zorder)
        for end in np.nonzero([piece.begins and x[0] > across[0], piece.ends])[0]:
            ax.plot([x[-end]] * 2, [low[-end], high[-end]], color=edge, lw=width, zorder=zorder)
    return len(parts)


def _chosen(points: Real, x: Axis, y: Axis) -> Real:
    """A few points of the stable region's edge, far apart as seen."""
    if not points.size:
        return points
    places = np.stack([x.place(points[:, 0]), y.place(points[:, 1])], axis=1)
    (inside,) = np.nonzero((places > 0.02).all(axis=1) & (places < 0.97).all(axis=1))
    if not inside.size:
        return points[:0]
    chosen = [int(inside[0])]
    while len(chosen) < MOST_MARKED:
        apart = np.hypot(*np.moveaxis(places[inside][:, None] - places[chosen], -1, 0)).min(axis=1)
        if apart.max() < 0.07:
            break
        chosen.append(int(inside[np.argmax(apart)]))
    return np.asarray(points[chosen])


def draw_proven(arm: Arm, x: Axis, y: Axis, ax: Axes) -> None:
    """The quarter of the plane that is proven at C = 0; at C > 0 only the line without moment feedback is."""
    inset = 1.0 if not arm.is_undamped else 1.0 - 0.008 * (y.high - y.low)
    corner = 0.0 if not arm.is_undamped else 0.04 * x.linear
    dashes, label = (
        ("-", f"Lyapunov ({LYAPUNOV}): proven")
        if arm.is_undamped
        else ((0, (5, 3)), f"Lyapunov ({LYAPUNOV}): not a proof here")
    )
    ax.plot([corner, corner, x.high], [y.low, inset, inset], color=PURPLE, lw=1.6, ls=dashes, label=label)
    if not arm.is_undamped:
        ax.plot([0, x.high], [0, 0], color=PURPLE, lw=1.6, label=f"Lyapunov at C > 0: {MOMENT_GAIN} = 0 proven")


def law_mark(law: HubFeedback, marker: str, label: str, ax: Axes) -> None:
    """One law, as a point."""
    ax.plot(
        *law.point, marker, ms=13.0 if marker == STAR else 8.0, mfc=ORANGE, mec="white", mew=1.0, zorder=7,
        ls="none", label=label,
    )  # fmt: skip


def search_frame(bounds: Mapping[str, tuple[float, float]], ax: Axes) -> None:
    """Where a design looked for the best gains."""
    (a, b), (c, d) = (bounds[name] for name in PLANE)
    ax.plot([a, b, b, a, a], [c, c, d, d, c], color=GREY, lw=0.8, ls=(0, (1, 2)), label="bounds of its search")
