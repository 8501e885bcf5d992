"""Loci and maps of whatever law; pictures of any linear one: along one of its numbers, and over the plane of two."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.digits import plain, significant
from tfarm.loop.law_locus import LawLocus
from tfarm.loop.law_rounded import rounded_law_locus
from tfarm.loop.loci import held_branches
from tfarm.loop.locus import Locus
from tfarm.loop.plane import Plane
from tfarm.loop.reduced_locus import ReducedLocus

from .drawn import drawn
from .labels import OFFSETS_BESIDE, Label
from .plane import colours, draw_map, gain_counts, words_of_count
from .roots import CIRCLE_AT_FIRST, CROSS_AT_ZERO, draw_locus, gain_branches
from .style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, New, blank, must_be, on_own_figure, safe, style, window

BRANCH_COLOURS = (BLUE, GREEN, PURPLE, "#7a5a00", GREY)  # of branches, in turn
MARKED_VALUES = 5  # values of the range that are marked along each branch
LEAST_NAMED = 0.02  # of the picture: a count that holds in less of it has no name in the legend


def locus(exact: Locus | LawLocus, *, reduced: ReducedLocus | None = None, ax: Axes | None = None) -> Axes:
    """Closed-loop poles as one number varies (what `tfarm.locus` returns), in the axes given or in new ones; the axes.

    Broad lines: the branches [1/s], a colour a mode, with values between those of `exact` where they bend; a cross
    where the gain is 0, an open circle at another beginning, dots at a few values, one of them that which damps the
    first mode best, and a diamond where one crosses the axis.  Thin: those of `reduced` (`tfarm.loop.reduced_locus`),
    which a locus of gains at the hub has; of another law it is not looked at.
    """
    must_be(Locus | LawLocus, exact, "tfarm.locus returns")
    if ax is None:
        return draw_locus_of(exact, reduced, window).axes[0]
    with style():
        if isinstance(exact, Locus):
            gain_branches(exact, reduced, ax=ax)
        else:
            law_branches(exact, ax=ax)
    return ax


@drawn.register
def draw_locus_of(exact: Locus | LawLocus, reduced: ReducedLocus | None = None, new: New = blank) -> Figure:
    """The locus, of gains or of any law, on a figure of its own."""
    return draw_locus(exact, reduced, new) if isinstance(exact, Locus) else draw_law_locus(exact, new)


def gain_map(found: Plane, *, ax: Axes | None = None) -> Axes:
    """The plane of both gains, or of two numbers of a law (what `tfarm.map` returns), in the axes given or in new ones.

    Colours for the number of unstable poles; a black line for the exact boundary with frequencies [rad/s] along it, of
    a law dots where a pole is on the axis.  Returns the axes.
    """
    must_be(Plane, found, "tfarm.map returns")
    if ax is None:
        return draw_map_of(found, window).axes[0]
    with style():
        if found.is_of_gains:
            gain_counts(found, ax=ax)
        else:
            law_counts(found, ax=ax)
    return ax


@drawn.register
def draw_map_of(found: Plane, new: New = blank) -> Figure:
    """The plane, of gains or of two numbers of any law, on a figure of its own."""
    return draw_map(found, new) if found.is_of_gains else draw_law_map(found, new)


def draw_law_locus(found: LawLocus, new: New = blank) -> Figure:
    """The poles of a `LawLocus` with Im s >= 0, on a figure of its own."""
    title = f"{found.arm.name}: closed-loop poles of {found.law.name} along {found.vary}"
    return on_own_figure(lambda ax: law_branches(found, ax=ax), (7.0, 5.6), title, new=new)


def law_branches(found: LawLocus, *, ax: Axes) -> None:
    """Branches [1/s]: a cross at the gain 0, else a circle, where one begins, dots, and diamonds on the axis."""
    begin = CROSS_AT_ZERO if found.vary == "gain" and found.values[0] == 0 else CIRCLE_AT_FIRST
    marked = np.linspace(found.values[0], found.values[-1], MARKED_VALUES)
    found = rounded_law_locus(found)
    first, *rest = (int(abs(found.values - value).argmin()) for value in marked)
    ax.axvline(0.0, color=INK, lw=0.9, zorder=1)
    for number, branch in enumerate(held_branches(found.branches)):
        colour = BRANCH_COLOURS[number % len(BRANCH_COLOURS)]
        ax.plot(branch.real, branch.imag, color=colour, lw=1.4, zorder=2)
        ax.plot(branch.real[first], branch.imag[first], color=colour, zorder=4, **begin)
        ax.plot(branch.real[rest], branch.imag[rest], "o", color=colour, ms=3.2, zorder=4)
    for each in found.crossings:
        ax.plot([0], [each.omega], "D", ms=6, mfc=ORANGE, mec="white", mew=0.8, zorder=6)
        text = f"{plain(each.gain, 5)}, {significant(each.omega, 4)} rad/s"
        ax.add_artist(Label(text, [(0.0, each.omega)], OFFSETS_BESIDE, fontsize=7.5))
    begins, others = plain(float(found.values[first]), 3), [plain(float(found.values[n]), 3) for n in rest]
    ax.plot([], [], color=GREY, label=f"{safe(found.vary)} = {begins}", **begin)
    ax.plot([], [], "o", color=GREY, ms=3.2, label=f"{safe(found.vary)} = {', '.join(others)}")
    if found.crossings:
        ax.plot([], [], "D", color=ORANGE, label=f"crosses the axis, at this {safe(found.vary)}")
    ax.set_xlabel("Re s [1/s]")
    ax.set_ylabel("Im s [rad/s]")


def draw_law_map(found: Plane, new: New = blank) -> Figure:
    """The plane of a `Plane`, on a figure of its own."""
    title = f"{found.arm.name}: unstable poles below {significant(found.band, 5)} rad/s under {found.law.name}"
    return on_own_figure(lambda ax: law_counts(found, ax=ax), (7.0, 5.4), title, new=new)


def law_counts(found: Plane, *, ax: Axes) -> None:
    """Colours for the number of unstable poles, black dots for the exact crossings along the second number."""
    image = colours(found.unstable)
    ax.pcolormesh(found.x, found.y, image, shading="nearest", rasterized=True, zorder=0.1)
    for count in np.unique(found.unstable):
        if np.mean(there := found.unstable == count) > LEAST_NAMED:
            ax.fill_between([], [], [], color=image[there][0], label=words_of_count(int(count)))
    points = [(x, t) for x, each in zip(found.x, found.crossings, strict=False) for t in each.gain]
    if points:
        x, t = np.array(points).T
        ax.plot(x, t, ".", color=INK, ms=2.0, label="a pole on the imaginary axis, exact")
    ax.set_xlim(found.x[0], found.x[-1])
    ax.set_ylim(found.y[0], found.y[-1])
    ax.grid(False)
    ax.set_xlabel(safe(found.vary[0]))
    ax.set_ylabel(safe(found.vary[1]))
