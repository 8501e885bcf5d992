"""The plane of two gains: colours for the exact count of unstable poles, stability regions, contours of least damping.

Each region is a list of intervals of one gain at each value of the other, with exact edges (D-decomposition in `loop`
and in `dsp`); nothing is read off a raster.  Edges are rounded as they are seen in a picture of that plane.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.path import Path
from matplotlib.ticker import LogLocator
from scipy import ndimage

from tfarm.arm import MOMENT_GAIN, PLANE
from tfarm.arrays import Real, Whole
from tfarm.assessment import Comparison
from tfarm.crossing import Window, pieces
from tfarm.digits import how_many, plain, scientific, significant
from tfarm.loop.circle_crossings import GainMap
from tfarm.loop.plane import INFINITE, BoundaryLines, Plane
from tfarm.loop.plane_axes import Axis
from tfarm.plots.frequency import bode
from tfarm.plots.labels import gains_words, law_words, name_axes, period_words
from tfarm.plots.loop_function import draw_loops
from tfarm.plots.style import (
    COLOURS,
    GOOD,
    GREY,
    INK,
    REGIONS,
    STABLE,
    Axes,
    Figure,
    key_area,
    key_line,
    note,
    picture,
    plain_ticks,
    safe,
    zero_line,
)
from tfarm.synthesis.good_region import GoodRegion
from tfarm.synthesis.stability_map import StabilityMap

# proven by the argument of the paper at C = 0
LYAPUNOV = "{} > 0, {} < 1".format(*PLANE)


def _title(found: Plane | GainMap) -> str:
    if isinstance(found, GainMap):
        ms = significant(1e3 * found.loop.chain.sampling.period, 4)
        return f"{found.loop.plant.arm.name}: unstable poles when sampled every {ms} ms, first {found.modes_used} modes"
    if found.is_of_gains:
        return f"{found.arm.name}: unstable poles over the plane of both gains"
    return f"{found.arm.name}: unstable poles below {significant(found.band, 5)} rad/s under {law_words(found.law)}"


@picture((Plane | GainMap, "tfarm.map returns"), title=_title)
def gain_map(found: Plane | GainMap, *, ax: Axes) -> None:
    """Draw the plane of both gains, or of two numbers of a law (from `tfarm.map`), in the axes given or in new ones.

    Colours for the number of unstable poles, hatched where a sampled loop is stable; a black line for the exact
    boundary with frequencies [rad/s] along it, of a law or a sampled loop dots where a pole is on the axis or the unit
    circle.  Returns the axes.
    """
    x, y = map(Axis.of, found.axes)
    if isinstance(found, GainMap):
        _counts(found, found.counts, ax)
        draw_region(found.x, found.stable_intervals, "stable at the samples", ax, hatch="////")
        name_axes(found.vary, found.loop.plant.arm, found.loop.law, ax)
    else:
        ground(found, x, y, ax)
        if found.is_of_gains:
            draw_boundary(found, found.boundary_lines, x, y, ax)
            return
    points: list[tuple[float, float]] = []
    for across, each in zip(found.x, found.crossings, strict=False):
        points += [(across, up) for up in each.within(y.low, y.high).gain]
    if points:
        ax.plot(*np.transpose(points), ".", color=INK, ms=2.0, label="a pole on the stability limit, exact")


def ground(found: Plane, x: Axis, y: Axis, ax: Axes) -> None:
    """Draw both axes, the colours of the count, and the count in every region that is large enough."""
    if not x.is_linear:
        ax.set_xscale("symlog", linthresh=x.linear, linscale=x.linear_scale)
        plain_ticks(ax.xaxis)
    if not y.is_linear:
        ax.set_yscale("symlog", linthresh=y.linear, linscale=y.linear_scale)
        plain_ticks(ax.yaxis)
    _counts(found, found.unstable, ax)
    ax.set(xlim=(x.low, x.high), ylim=(y.low, y.high))
    name_axes(found.vary, found.arm, found.law, ax)
    if not x.is_linear and x.low < x.linear:
        scale = f"linear up to {plain(x.linear)}, logarithmic beyond"
        ax.set_xlabel(f"{ax.get_xlabel()}; {scale}")


def _counts(found: Plane | GainMap, counts: Whole, ax: Axes) -> None:
    """Draw the colours of the counts (rows, columns), and in each unstable region its count where it has most room."""
    image = colours(counts)
    ax.pcolormesh(found.x, found.y, image, shading="nearest", rasterized=True, zorder=0.1)
    ax.grid(False)
    most = len(REGIONS) - 1
    for count in np.unique(counts).tolist():
        inside = counts == count
        if count < most or count == counts.max():
            key_area(_count_words(count, most), ax, color=image[inside][0])
        if count:
            mark = "∞" if count == INFINITE else str(count)
            for row, column in _roomy_places(inside):
                at = (found.x[column], found.y[row])
                ax.text(*at, mark, fontsize=9.0, ha="center", va="center", clip_on=True)


def _count_words(count: int, most: int) -> str:
    """Return a number of unstable poles, of the colour of `most` and more with the largest number."""
    if not count:
        return "stable"
    if count == INFINITE:
        return "infinitely many unstable poles (∞)"
    if count > most:
        return f"{most} and more unstable poles, at most {count}"
    return how_many(count, "unstable pole")


def _roomy_places(inside: Any) -> list[tuple[int, int]]:
    """Return row and column of the middle of each region that has room for a number."""
    regions, last = ndimage.label(inside)
    sizes = np.divide(1, inside.shape)
    room = ndimage.distance_transform_edt(np.pad(inside, 1), sizes)[1:-1, 1:-1]
    middle = room * ndimage.gaussian_filter(room, np.divide(inside.shape, 8))
    places: Any = ndimage.maximum_position(middle, regions, range(1, last + 1))
    # of the picture's width or height
    return [at for at in places if room[at] > 0.028]


def colours(unstable: Whole) -> Real:
    """Return the colour of each count, the darkest from the last of `REGIONS` on."""
    number = np.where(unstable == INFINITE, len(REGIONS), unstable)
    return np.take([to_rgb(colour) for colour in REGIONS], number, axis=0, mode="clip")


def contours(across: Real, up: Real, damping: Real, ax: Axes) -> None:
    """Draw lines of the least damping ratio (up, across), where it is a number: inside the stable region.

    Open lines shorter than a twelfth of the picture are stubs at the edge of the grid, and left out.
    """
    least = np.nanmin(damping, initial=np.inf)
    largest = np.nanmax(damping, initial=0.0)
    levels: Any = LogLocator(subs=(1.0, 2.0, 5.0)).tick_values(least, largest)
    levels = levels[(least < levels) & (levels < largest)]
    if not levels.size:
        return
    # of the logarithm lines are straighter
    logarithm = np.ma.log(np.ma.masked_invalid(damping))
    # no colour of stability
    slate = "#3d5468"
    heights = np.log(levels[-5:])
    draw = partial(ax.contour, colors=slate, linewidths=0.8, linestyles="-", zorder=2.5)
    lines = draw(across, up, logarithm, heights)
    kept = [[part for part in parts if _is_long(part, ax)] for parts in lines.allsegs]
    lines.set_paths([Path.make_compound_path(*map(Path, parts)) for parts in kept])
    for level, parts in zip(lines.levels, kept, strict=True):
        longest = max(parts, key=len, default=())
        if len(longest) > 12:
            _name_contour(f"{plain(100 * np.exp(level), 3)} %", longest, ax)
    key_line("least damping ratio of the first two modes", ax, color=slate, lw=0.8)


def _is_long(line: Real, ax: Axes) -> bool:
    """Whether a line is closed, or longer than a twelfth of the picture."""
    if np.array_equal(line[0], line[-1]):
        return True
    across, up = np.ptp((ax.transData - ax.transAxes).transform(line), axis=0)
    return math.hypot(across, up) > 1 / 12


def _name_contour(name: str, line: Any, ax: Axes) -> None:
    """Write a name at the best place along a line that is free."""
    for share in (0.5, 0.35, 0.65, 0.2, 0.8):
        if note(name, line[int(share * len(line))], ax, ha="center", color=INK, zorder=6):
            return


def draw_boundary(found: Plane, boundary: BoundaryLines, x: Axis, y: Axis, ax: Axes) -> None:
    """Draw the exact boundary with its frequencies; without damping an upright line and a level one."""
    if found.arm.loses_at_hub_alone:
        _undamped_boundary(found, boundary.resting, x, y, ax)
        return
    label = "poles on the axis at iω, exact, with ω in rad/s"
    ax.plot(*boundary.points[:, :2].T, color=INK, lw=1.6, label=label)
    if boundary.upright is not None:
        ax.axvline(boundary.upright, color=INK, lw=1.6)
    if boundary.level is not None:
        ax.axhline(boundary.level, color=INK, lw=1.6)
    across, up, _ = boundary.ends.T
    place = x.place(across)
    first = max(0.0, float(x.place(np.array(0.0))))
    is_across = (first + 0.07 < place) & (place < 0.93)
    inside = is_across & (y.low < up) & (up < y.high)
    for across, up, omega in sorted(boundary.ends[inside].tolist()):
        note(significant(omega, 3), (across, up), ax, (0.14, 1.0), ha="center")


def _undamped_boundary(found: Plane, resting: Real, x: Axis, y: Axis, ax: Axes) -> None:
    """Draw it strong around what is stable, thin where the number of unstable poles changes.

    That is at the edge of each mode of the locked hub, with its frequency at the right; of a uniform arm all these
    edges are one line.
    """
    for low, high in found.stable_intervals[-1]:
        # another end is that of the map
        edges = [end for end in (low, high) if found.y[0] < end < found.y[-1]]
        ax.vlines(found.upright, max(low, y.low), min(high, y.high), color=INK, lw=1.8)
        ax.hlines(edges, found.upright, x.high, color=INK, lw=1.8, label="stability boundary, exact")
    if found.is_known:
        whole = found.arm.input_per_torque
        omega = ", ".join(significant(float(w), 4) for w in resting)
        label = f"every mode with the hub at rest: {omega} … rad/s"
        ax.hlines(whole, x.low, x.high, color=INK, lw=0.8, label=label)
        ax.vlines(found.upright, whole, y.high, color=INK, lw=0.8)
        return
    label = "a mode with the hub at rest, ω in rad/s at the right"
    of_modes = found.crossings[-1].within(y.low, y.high)
    ax.hlines(of_modes.gain, found.upright, x.high, color=INK, lw=0.5, label=label)
    for t, omega in sorted(zip(of_modes.gain.tolist(), of_modes.at.tolist(), strict=True)):
        note(significant(omega, 4), (x.high, t), ax, (1.0, 0.05), xytext=(4, 0), fontsize=7.5)


def draw_region(
    across: Real, stable: Sequence[Sequence[Window]], label: str, ax: Axes, *, hatch: str = "", ls: Any = "-"
) -> None:
    """Draw the intervals up at each value across, filled, or hatched with a dashed edge, as those of a sampled loop.

    Edges are upright where the region itself begins or ends.
    """
    line: dict[str, Any] = {"color": INK, "lw": 1.0, "ls": ls, "zorder": 2.5}
    area: dict[str, Any] = {"facecolor": REGIONS[0], "lw": 0}
    key = area | {"edgecolor": INK, "ls": ls, "lw": 1.0}
    if hatch:
        line = {"color": STABLE, "lw": 1.4, "ls": (0, (5, 2.5)), "zorder": 4.5}
        area = {"facecolor": "none", "hatch": hatch, "edgecolor": (*to_rgb(STABLE), 0.5), "lw": 0}
        key = area
    parts = pieces(across, stable)
    for piece in parts:
        x, low, high = np.array(piece.points).T
        ax.fill_between(x, low, high, zorder=1, **area)
        ax.plot(x, np.transpose([low, high]), **line)
        ends = np.flatnonzero([piece.begins and x[0] > across[0], piece.ends])
        ax.vlines(x[-ends], low[-ends], high[-ends], **line)
    words = safe(label)
    if not parts:
        words += ": nowhere in this picture"
    key_area(words, ax, **key)


def mark_point(point: Sequence[float], mark: str, ax: Axes, ms: float = 7.5, **looks: Any) -> None:
    """Draw a filled mark at a controller."""
    across, up = point
    ax.plot([across], [up], mark, mfc=INK, mec="white", ms=ms, zorder=7, **looks)


# ------------------------------------------------------------ continuous and sampled regions


@picture(
    (Plane, "tfarm.map returns of gains at the hub"),
    (GainMap, "tfarm.dsp.sampled_map returns"),
    size=(9.0, 5.7),
    title=lambda continuous, _: (
        f"{continuous.arm.name}: gains that keep the loop stable, continuous and sampled"
    ),
)
def gain_regions(continuous: Plane, sampled: GainMap | Sequence[GainMap], *, ax: Axes) -> None:
    """Draw both regions of the two gains, in the axes given or in new ones; the axes.

    `continuous` is from `tfarm.map`, `sampled` from `tfarm.dsp.sampled_map`: several, for arms with ever
    less damping, lie on each other.  The point is the controller of the sampled loop.
    """
    planes = sampled if isinstance(sampled, Sequence) else [sampled]
    loop = planes[0].loop
    (low, *_, high), (bottom, *_, top) = continuous.axes
    # so that where intervals are cut no edge is seen
    inside = 0.008 * (top - bottom)
    scale = "log" if low > 0 else "linear"
    ax.set(xscale=scale, xlim=(low, high), ylim=(bottom + inside, top - inside))
    plain_ticks(ax.xaxis)
    ax.grid(False)
    zero_line(ax, 0.7, zorder=3.5)
    name_axes(PLANE, continuous.arm, continuous.law, ax)
    convention = "u = −{} dθ/dt − {} M;  a positive root moment M accelerates the hub".format(*PLANE)
    ax.set_title(convention, loc="right", fontsize=8.5, color=GREY)
    ax.set_facecolor(REGIONS[1])
    draw_region(continuous.x, continuous.stable_intervals, "stable, continuous: every mode", ax)
    key_area("unstable, continuous", ax, color=REGIONS[1])
    # with more damping, with less, with its own
    hatches = ("..", "\\\\\\\\", "////")[-len(planes) :]
    for plane, hatch in zip(planes, hatches, strict=True):
        C = plane.loop.plant.arm.damping
        label = f"stable, sampled {period_words(loop)}"
        if not C:
            label += f", C = 0: the first {plane.modes_used} modes"
        elif continuous.arm.damping != C:
            label += f", if C were {scientific(C, 1)} s"
        draw_region(plane.x, plane.stable_intervals, label, ax, hatch=hatch)
    # of a rig the argument needs more: see `tfarm.loop.theorem`
    if continuous.arm.is_uniform:
        label = f"below it: proven by energy at C = 0 ({LYAPUNOV})"
        ax.axhline(1.0, color=INK, lw=1.1, ls=(0, (5, 3)), zorder=4, label=label)
    across, up = loop.gains.point
    label = gains_words(loop.law)
    ax.plot(across, up, "o", color="white", mec=INK, mew=1.4, ms=7, zorder=6, label=label)


# ------------------------------------------------------------ the map of an arm


class MarkedLaw(NamedTuple):
    """Gains (K1, K2) that are marked in the map, with their label; the best ones by a star."""

    point: tuple[float, float]
    label: str
    is_best: bool


@picture(size=(9.0, 6.2), title=lambda data, *_: f"{data.arm.name}: stability region of both gains")
def draw_stability_map(data: StabilityMap, laws: Sequence[MarkedLaw], *, ax: Axes) -> None:
    """Draw count, boundary, damping, sampled region, that of the grade good, Lyapunov's frame, and laws."""
    arm = data.arm
    x = data.x
    y = data.y
    ground(data.region, x, y, ax)
    contours(*data.coarse.axes, np.where(data.coarse.unstable == 0, data.damping, np.nan), ax)
    draw_boundary(data.region, data.boundary, x, y, ax)
    plane = data.sampled
    if plane is not None:
        label = f"stable when sampled {period_words(plane.loop)} (first {plane.modes_used} modes)"
        draw_region(plane.x, plane.stable_intervals, label, ax, hatch="////")
    if data.good is not None:
        _draw_good(data.good, ax)
    if arm.is_uniform:
        _draw_lyapunov(arm.is_undamped, x, y, ax)
    for point, label, is_best in laws:
        mark = "D"
        size = 8.0
        if is_best:
            mark = "*"
            size = 13.0
        mark_point(point, mark, ax, size, mew=1.0, label=label)


def _draw_good(found: GoodRegion, ax: Axes) -> None:
    """Fill the gains whose margins have the grade good in both loops."""
    words = "grade good in both loops, approximate"
    parts = pieces(found.x, found.stable_intervals)
    if not parts:
        words += ": none found on the grid"
    key_area(words, ax, facecolor=GOOD, alpha=0.55, lw=0)
    for piece in parts:
        x, low, high = np.array(piece.points).T
        ax.fill_between(x, low, high, facecolor=GOOD, alpha=0.55, lw=0, zorder=2.2)


def _draw_lyapunov(is_undamped: bool, x: Axis, y: Axis, ax: Axes) -> None:
    """Draw the frame of Lyapunov's argument; at C > 0 only the line without moment feedback is proven."""
    ls: Any = "-"
    kind = "proven"
    if not is_undamped:
        ls = (0, (1, 1))
        kind = "not a proof here"
    label = f"Lyapunov ({LYAPUNOV}): {kind}"
    ax.plot([0, 0, x.high], [y.low, 1, 1], color=GREY, lw=2.2, ls=ls, label=label)
    if not is_undamped:
        label = f"Lyapunov at C > 0: {MOMENT_GAIN} = 0 proven"
        ax.plot([0, x.high], [0, 0], color=GREY, lw=1.6, label=label)


# ------------------------------------------------------------ two arms, or two laws on one arm


def _grid(figure: Figure, _: Comparison) -> list[Axes]:
    grid = figure.add_gridspec(2, 2, width_ratios=[1.25, 1.0], height_ratios=[1.6, 1.0])
    return [figure.add_subplot(place) for place in (grid[0, 0], grid[1, 0], grid[:, 1])]


@picture((Comparison, "tfarm.compare returns"), size=(12.0, 6.2), grid=_grid, title=lambda data: data.verdict)
def comparison(data: Comparison, *, ax: Sequence[Axes]) -> None:
    """Draw magnitude, phase and map of both (from `tfarm.compare`), in three axes, those given or new ones: these.

    Of two arms the exact responses, of two laws the loop functions L; the map is that of both gains, with exact edges,
    or, where a law is more than these gains, or one in z, of a factor on each controller and its further delay.  With
    a law in z all is of the loops at their samples.
    """
    upper, lower, right = ax
    if data.is_of_arms:
        bode(dict(zip(data.names, data.responses, strict=True)), ax=(upper, lower))
    else:
        loops = [
            (*side.loop_function, {"color": colour, "label": safe(name)})
            for side, name, colour in zip(data.sides, data.names, COLOURS, strict=False)
        ]
        place = "at the samples" if data.is_sampled else "loop opened at the input"
        draw_loops(loops, f"|L|, {place} [dB]", upper, lower)
    upper.set_xlabel("")
    # the frequencies of the phase below
    upper.tick_params(labelbottom=False)
    right.grid(False)
    right.set_facecolor(REGIONS[1])
    # edges of the second one
    styles = ("-", (0, (6, 2, 1, 2)))
    if data.is_sampled or data.regions is None:
        _factors(data, styles, right)
        return
    first, other = data.regions
    for found, side, ls, mark in zip(data.regions, data.sides, styles, "os", strict=True):
        label = "stable" if first == other else f"{side.name}: stable"
        draw_region(found.x, found.stable_intervals, label, right, ls=ls)
        assert side.gains is not None
        mark_point(side.gains.point, mark, right)
    right.set(xlim=(first.x[0], first.x[-1]), ylim=(first.y[0], first.y[-1]))
    name_axes(PLANE, first.arm, first.law, right)


def _factors(data: Comparison, styles: Sequence[Any], ax: Axes) -> None:
    """Draw the factors that keep each loop stable, over the further delay of its controller."""
    delay, reaches = data.reaches
    for stable, side, ls in zip(reaches, data.sides, styles, strict=True):
        draw_region(1e3 * delay, stable, f"{side.name}: stable", ax, ls=ls)
    mark_point((0.0, 1.0), "o", ax, clip_on=False, label="the controllers as they are")
    ax.axhline(1.0, color=INK, lw=0.6)
    _, high = ax.get_ylim()
    ax.set(xlabel="further delay [ms]", xlim=(0.0, 1e3 * delay[-1]))
    ax.set(ylabel="factor on the controller [−]", ylim=(0.0, min(high, 1e3)))
