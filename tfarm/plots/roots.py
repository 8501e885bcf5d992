"""Root loci: exact branches, those of python-control on a reduced model, and where they cross the axis."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from tfarm.arrays import Complex
from tfarm.digits import kept_digits, plain, significant
from tfarm.errors import one_line
from tfarm.loop.branches import origin_name
from tfarm.loop.loci import POLE_DIGITS, Loci, ReducedLocus, round_branches
from tfarm.loop.locus import BranchCrossing, Locus, frame, view
from tfarm.loop.sampled_modes import DRAWN_RADIUS, RIM, SampledLoci, SampledLocus
from tfarm.plots.labels import gains_words, period_words
from tfarm.plots.loop_function import arrows
from tfarm.plots.style import (
    FAINT,
    FIGURES,
    GREY,
    HALF_WIDTH,
    INK,
    MARGINAL,
    REGIONS,
    STABLE,
    UNSTABLE,
    Axes,
    Figure,
    key_line,
    note,
    picture,
    plot_complex,
)
from tfarm.response.frequency import AXIS_SHARE

GRID: dict[str, Any] = {"color": FAINT, "lw": 0.7, "zorder": 0.6}
VALUE: dict[str, Any] = {"fontsize": 7.0, "color": GREY}


def branches_of_modes(exact: Locus) -> list[int]:
    """Return the branches drawn on their own: the first that swings of each mode."""
    first: dict[int, int] = {}
    for n, (mode, branch) in enumerate(zip(exact.mode.tolist(), exact.branches, strict=True)):
        if (branch.imag > 0).any():
            first.setdefault(mode, n)
    return [first[mode] for mode in sorted(first)][:4]


def _mosaic(figure: Figure, data: Loci) -> Any:
    """Return the panel of all branches and those of single modes, with gaps beyond the last; on a phone one alone."""
    most = 4 if figure.get_figwidth() > HALF_WIDTH else 1
    count = min(len(branches_of_modes(data.exact)), most)
    rows = "AABC;AADE".translate(dict.fromkeys(b"BCDE"[count:], "."))
    return figure.subplot_mosaic(rows, width_ratios=[1.7, 1.7, 1.3, 1.3])


@picture(size=(9.0, 5.8), title=lambda data: _title(data.exact), grid=_mosaic)
def draw_loci(data: Loci, *, ax: Sequence[Axes]) -> None:
    """Draw all branches in one panel, and each mode enlarged in one of its own."""
    exact = data.exact
    whole, *panels = ax
    _panel(exact, data.reduced, range(len(exact.branches)), whole)
    whole.set_title("all branches", fontsize=9.0)
    for n, one in zip(branches_of_modes(exact), panels, strict=False):
        _panel(exact, data.reduced, [n], one)
        one.set_title(origin_name(int(exact.origin[n])), fontsize=9.0)


def _title(exact: Locus, *_: object) -> str:
    first = plain(float(exact.gain[0]), 4)
    last = plain(float(exact.gain[-1]), 4)
    law = gains_words(exact.law, but=exact.vary).partition(", of ")[0]
    values = f"{exact.vary} goes from {first} to {last} {exact.varied.title[1]}".rstrip()
    return f"{exact.arm.name}: closed-loop poles as {values} with {one_line(law, 40)}"


def _panel(exact: Locus, reduced: ReducedLocus | None, numbers: Sequence[int], ax: Axes) -> None:
    """Draw some branches, exact and reduced, with marks at a few values and their crossings."""
    which = list(numbers)
    branches = round_branches(exact.smooth.branches)
    shown = branches[which]
    is_whole = len(which) == len(branches)
    if is_whole:
        left, right, low, high = view(shown, exact.origin)
    else:
        left, right, low, high = frame(shown[shown.imag >= 0])
    # room around the branches, twice as much at the right for names
    wide = 0.12 * (right - left)
    tall = 0.12 * (high - low)
    ax.set(xlim=(left - wide, right + 2 * wide), ylim=(low - tall, high + tall))
    ax.set(xlabel="Re s [1/s]", ylabel="Im s [rad/s]")
    ax.xaxis.set_major_locator(MaxNLocator(4))
    s_grid(ax, is_named=is_whole)
    _draw_branches(shown, ax)
    if reduced is not None:
        _draw_reduced(reduced, which, ax)
    first, last = exact.gain[[0, -1]]
    way = 1 if last > first else -1
    _mark_values(exact, way, which, ax)
    for s in shown:
        arrows(s[::way], ax)
    edge_marks(shown[:, -1], ax)
    of: set[int | None] = {*which}
    if is_whole:
        of.add(None)
        for origin in dict.fromkeys(exact.origin.tolist()):
            own = branches[exact.origin == origin]
            _name_branch(origin_name(origin), own.ravel(), ax)
    _draw_crossings([each for each in exact.crossings if each.branch in of], exact.vary, ax)


def _draw_reduced(reduced: ReducedLocus, which: list[int], ax: Axes) -> None:
    """Draw thin branches of the reduced model."""
    thin: dict[str, Any] = {"color": INK, "lw": 0.9, "ls": (0, (2, 1.5)), "zorder": 3}
    key_line(f"python-control, reduced model of order {reduced.order}", ax, **thin)
    for s in round_branches(reduced.branches[which]):
        # between two values where it meets the real axis: no corner is cut off
        meets = np.flatnonzero(np.diff((s.imag == 0).astype(int))) + 1
        ax.plot(np.insert(s.real, meets, np.nan), np.insert(s.imag, meets, np.nan), **thin)


def _mark_values(exact: Locus, way: int, which: list[int], ax: Axes) -> None:
    """Mark the poles at five values: a cross where a gain is 0, an open circle at another beginning, then dots."""
    first, last = exact.gain[[0, -1]].tolist()
    is_factor = not exact.varied.is_of_arm and exact.vary != "delay"
    begins = first
    if is_factor and min(first, last) <= 0 <= max(first, last):
        begins = 0.0
    values = np.array([float(f"{value:.3g}") for value in np.linspace(begins, last, 5)])
    start, *others = (plain(value, 3) for value in values.tolist())
    branches = round_branches(exact.branches[which])
    at = np.array([np.interp(way * values, way * exact.gain, s) for s in branches])
    draw = partial(plot_complex, ax=ax, ls="none", color=INK, mew=1.3, zorder=4)
    mark = "o" if begins else "x"
    draw(at[:, 0], marker=mark, ms=6, mfc="white", label=f"{exact.vary} = {start}")
    label = f"{exact.vary} = {', '.join(others)}"
    draw(at[:, 1:].ravel(), marker="o", ms=3.2, mfc=INK, label=label)


def _draw_branches(shown: Complex, ax: Axes) -> None:
    """Draw branches, their parts left and right of the axis in the colours of stability, and those on it."""
    left, right = ax.get_xlim()
    ax.axvline(0, color=INK, lw=0.9, zorder=1)
    stable = ax.axvspan(left, 0.0, fc="none")
    unstable = ax.axvspan(0.0, right, fc=REGIONS[1], zorder=0.1)
    for lw, colour, part, name in (2.6, STABLE, stable, "stable"), (2.61, UNSTABLE, unstable, "unstable"):
        for s in shown:
            (line,) = plot_complex(s, ax, lw=lw, color=colour, zorder=2)
            line.set_clip_path(part)
        key_line(f"{name}, exact", ax, lw=2.5, color=colour)
    resting = np.where(abs(shown.real) <= AXIS_SHARE * abs(shown), shown, np.nan).T
    ax.plot(0 * resting.real, resting.imag, lw=2.8, color=MARGINAL, zorder=2.1)


def _draw_crossings(seen: Sequence[BranchCrossing], vary: str, ax: Axes) -> None:
    """Draw a diamond at each, the first six with their values in the legend."""
    for number, each in enumerate(seen):
        label = "further crossings of the axis"
        if number < 6:
            omega = significant(each.omega, 4)
            label = f"crosses the axis at {vary} = {plain(each.gain, 5)}, {omega} rad/s"
        at = kept_digits([each.omega], POLE_DIGITS)
        ax.plot([0], at, "D", ms=6, mfc=MARGINAL, mec="white", mew=0.8, zorder=6, label=label)


def edge_marks(poles: Complex, ax: Axes) -> None:
    """Draw a triangle at the edge for each pole out of view with Im >= 0, with its value where there is room."""
    left, right = ax.get_xlim()
    _, high = ax.get_ylim()
    far: dict[tuple[float, float], list[str]] = {}
    for p in poles[poles.imag >= 0]:
        place = min(max(p.real, left), right), min(p.imag, high)
        if place != (p.real, p.imag):
            value = plain(p.real, 3)
            if p.imag:
                value += f" + {plain(p.imag, 3)}i"
            far.setdefault(place, []).append(value)
    for (x, y), values in far.items():
        mark = "^"
        side = 7
        ha = "left"
        if x == left:
            mark = "<"
        elif x == right:
            mark = ">"
            side = -7
            ha = "right"
        ax.plot(x, y, mark, color=GREY, ms=6.5, mec="white", zorder=5, clip_on=False)
        note(", ".join(values), (x, y), ax, **VALUE, xytext=(side, 4), ha=ha, va="baseline")


def _name_branch(name: str, s: Complex, ax: Axes) -> None:
    """Write the name at the first of three places along a branch, in view and with Im s >= 0, that is free."""
    left, right = ax.get_xlim()
    _, high = ax.get_ylim()
    is_across = (s.real > left) & (s.real < right)
    s = s[is_across & (s.imag >= 0) & (s.imag < high)]
    if not s.size:
        return
    for share in (0.0, 0.5, 0.99):
        at = s[int(share * s.size)]
        if note(name, (at.real, at.imag), ax, (0.15, 0.06), xytext=(6, 5), va="baseline"):
            return


# ------------------------------------------------------------ grids of damping ratio and natural frequency


def s_grid(ax: Axes, *, is_named: bool = True) -> None:
    """Draw faint lines of constant damping ratio, with their values, and of constant natural frequency.

    Of as many ratios as fit the view left of the axis; the frequencies, those of the ticks, have their values at the
    right where they are named.
    """
    ax.grid(False)
    # of a side, from one ratio to the next
    _ratio_lines(ax, 0.17 if is_named else 0.34)
    left, right = ax.get_xlim()
    low, high = ax.get_ylim()
    bottom = max(low, 0.0)
    if left < 0:
        ticks: Any = MaxNLocator(6).tick_values(bottom, high)
        for omega in ticks[(bottom < ticks) & (ticks < high)]:
            angle = np.linspace(0.0, np.arcsin(min(1.0, -left / omega)), 61)
            name = plain(omega, 4) if is_named else ""
            _grid_line(1j * omega * np.exp(1j * angle), name, (right, omega), ax, xytext=(3, 0))
    key_line("damping ratio ζ; natural frequency, at the right [rad/s]", ax, **GRID)


def _slope(ratio: float) -> float:
    """Return -Re s/Im s of a damping ratio."""
    return ratio / math.sqrt(1 - ratio**2)


def _ratio_lines(ax: Axes, apart: float) -> None:
    """Draw lines of constant damping ratio in view, that share of a side apart."""
    left, right = ax.get_xlim()
    low, high = ax.get_ylim()
    if not left < 0 < high:
        return
    bottom = max(low, 0.0)
    height = high - bottom
    decades = np.power(10.0, range(-6, 0))
    for ratio in [*np.outer(decades, (1, 2, 5)).ravel().tolist(), 0.8]:
        slope = _slope(ratio)
        x = max(left, -high * slope)
        y = min(high, -left / slope)
        share = (high - y) / height - x / (right - left)
        if share <= apart or y <= bottom + 0.1 * height:
            continue
        va = "top" if x > left else "center"
        if note(f"ζ {plain(ratio)}", (x, y), ax, (apart, apart), xytext=(3, -3), va=va, **VALUE):
            ax.plot([0.0, x], [0.0, y], **GRID)


def z_grid(ax: Axes, ratios: Sequence[float] = (0.1, 0.3, 0.5, 0.7, 0.9)) -> None:
    """Draw the same at the samples, z = exp(s T): spirals of constant damping ratio, frequencies in parts of π/T."""
    angle = np.linspace(0.0, np.pi, 181)
    for ratio in ratios:
        z = np.exp((1j - _slope(ratio)) * angle)
        name = f"ζ {ratio}" if ratio < 0.8 else ""
        _grid_line(z, name, (z[90].real, z[90].imag), ax, ha="center")
    for tenths in range(1, 10):
        # from the real axis of s to the other
        z = np.exp(np.pi * tenths / 10 * np.exp(1j * (np.pi - angle / 2)))
        name = "" if tenths % 2 else f"0.{tenths}π/T"
        at = 0.9 * z[-1]
        _grid_line(z, name, (at.real, at.imag), ax, ha="center")
    key_line("damping ratio ζ; natural frequency in π/T", ax, **GRID)


def _grid_line(z: Complex, name: str, at: tuple[float, float], ax: Axes, **looks: Any) -> None:
    plot_complex(z, ax, **GRID)
    note(name, at, ax, **VALUE, **looks)


# ------------------------------------------------------------ the pictures


@picture((Locus, "tfarm.locus returns"), size=(7.0, 5.8), title=_title)
def locus(exact: Locus, reduced: ReducedLocus | None = None, *, ax: Axes) -> None:
    """Draw closed-loop poles as one number varies (from `tfarm.locus`), in the axes given or in new ones; the axes.

    Broad lines: the branches [1/s], named after their modes, stable and unstable parts in their colours, with values
    between those of `exact` where they bend; a cross where the gain is 0, an open circle at another beginning, dots at
    equal steps from there to the end, a diamond where one crosses the axis, and arrows in the direction of growing
    values.  The axes are scaled to the modes: a triangle at the edge is a pole beyond, at the last value.  Thin: the
    branches of `reduced` (`tfarm.loop.loci`), which a locus of gains at the hub has.  Faint: lines of constant damping
    ratio and natural frequency.
    """
    _panel(exact, reduced, range(len(exact.branches)), ax)


FIGURES.update({Loci: lambda data: locus.figure(data.exact, data.reduced)})


@picture(
    size=(9.0, 3.6),
    grid=lambda figure, _: figure.subplots(1, 2),
    title=lambda data: f"{data.loop.plant.arm.name}: poles of the loop sampled {period_words(data.loop)}",
)
def draw_sampled_loci(data: SampledLoci, *, ax: Sequence[Axes]) -> None:
    """Draw the z-plane with the locus along each gain."""
    for along, one in zip(data.by.values(), ax, strict=True):
        _z_plane(data, along, one)


def _z_plane(data: SampledLoci, along: SampledLocus, ax: Axes) -> None:
    """Draw one gain's locus in the upper half of the z-plane, marked at its start and at the loop's gains."""
    ax.set(xlim=(-RIM, RIM), xticks=[-1.0, -0.5, 0.0, 0.5, 1.0], xlabel="Re z [−]")
    ax.set(ylim=(0.0, RIM), ylabel="Im z [−]", aspect="equal", facecolor=REGIONS[1])
    circle = ax.add_patch(Circle((0, 0), 1.0, fc="white", ec=INK, lw=0.9, zorder=0.5))
    ax.grid(False)
    z_grid(ax)
    here = int(abs(along.values - data.loop.number(along.gain)).argmin())
    is_seen = (along.z.imag >= -1e-12) & (abs(along.z) < DRAWN_RADIUS)
    z = np.where(is_seen, along.z, np.nan)
    is_mode = along.mode > 0
    is_aliased = np.array([bool(mode) and data.is_aliased(int(mode)) for mode in along.mode])
    for columns, mark, label in (
        (along.mode == 0, "D", "hub, filters, delay"),
        (is_aliased, "s", "mode beyond the Nyquist frequency"),
        (is_mode & ~is_aliased, "o", "mode"),
    ):
        each = z[:, columns]
        plot_complex(each, ax, color=UNSTABLE, lw=1.5, zorder=3)
        for line in plot_complex(each, ax, color=STABLE, lw=1.4, zorder=3.1):
            line.set_clip_path(circle)
        draw = partial(plot_complex, ax=ax, ls="none", marker=mark, mec=INK, ms=4.0, mew=0.9, zorder=4)
        draw(each[0], mfc="white", label="start of the range")
        draw(each[here], mfc=INK, label=f"{label}, gains of the loop")
        for branch in each.T:
            arrows(branch, ax)
    edge_marks(along.z[here], ax)
    key_line("stable", ax, color=STABLE)
    key_line("unstable", ax, color=UNSTABLE)
    span = f"{plain(along.values[0], 2)} to {plain(along.values[-1], 3)}"
    others = gains_words(data.loop.law, 10, but=along.gain)
    ax.set_title(f"z-plane, {along.gain} from {span} ({others})", fontsize=9.5)
