"""Root loci and maps of any law."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.digits import significant
from tfarm.dsp import GainMap
from tfarm.loop.locus import Locus
from tfarm.loop.plane import Plane
from tfarm.loop.reduced_locus import ReducedLocus

from .drawn import drawn
from .plane import colours, draw_map, gain_counts, words_of_count
from .roots import branches_of, draw_locus
from .style import INK, New, blank, must_be, on_own_figure, safe, style, window

LEAST_NAMED = 0.02  # of the picture: a count that holds in less of it has no name in the legend


def locus(exact: Locus, *, reduced: ReducedLocus | None = None, ax: Axes | None = None) -> Axes:
    """Closed-loop poles as one number varies (what `tfarm.locus` returns), in the axes given or in new ones; the axes.

    Broad lines: the branches [1/s], a colour a mode, with values between those of `exact` where they bend; a cross
    where the gain is 0, an open circle at another beginning, dots at a few values, one of them that which damps the
    first mode best, and a diamond where one crosses the axis.  Thin: those of `reduced` (`tfarm.loop.reduced_locus`),
    which a locus of gains at the hub has.
    """
    must_be(Locus, exact, "tfarm.locus returns")
    if ax is None:
        return draw_locus_of(exact, reduced, window).axes[0]
    with style():
        branches_of(exact, reduced, ax=ax)
    return ax


@drawn.register
def draw_locus_of(exact: Locus, reduced: ReducedLocus | None = None, new: New = blank) -> Figure:
    """The locus on a figure of its own."""
    return draw_locus(exact, reduced, new)


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


def draw_law_map(found: Plane, new: New = blank) -> Figure:
    """The plane of a `Plane`, on a figure of its own."""
    title = f"{found.arm.name}: unstable poles below {significant(found.band, 5)} rad/s under {found.law.name}"
    return on_own_figure(lambda ax: law_counts(found, ax=ax), (7.0, 5.4), title, new=new)


@drawn.register
def draw_sampled_map(found: GainMap, new: New = blank) -> Figure:
    """The plane of two numbers of the law of a sampled loop, on a figure of its own."""
    arm, ms = found.loop.plant.arm.name, 1e3 * found.loop.chain.sampling.period
    title = f"{arm}: unstable poles when sampled every {significant(ms, 4)} ms, first {found.modes_used} modes"
    return on_own_figure(lambda ax: law_counts(found, ax=ax), (7.0, 5.4), title, new=new)


def law_counts(found: Plane | GainMap, *, ax: Axes) -> None:
    """Colours for the number of unstable poles, black dots for the exact crossings along the second number."""
    image = colours(found.counts)
    ax.pcolormesh(found.x, found.y, image, shading="nearest", rasterized=True, zorder=0.1)
    for count in np.unique(found.counts):
        if np.mean(there := found.counts == count) > LEAST_NAMED:
            ax.fill_between([], [], [], color=image[there][0], label=words_of_count(int(count)))
    points = [(x, t) for x, each in zip(found.x, found.crossings, strict=False) for t in each.gain]
    if points:
        x, t = np.array(points).T
        ax.plot(x, t, ".", color=INK, ms=2.0, label=f"a pole on the {found.curve}, exact")
    ax.set_xlim(found.x[0], found.x[-1])
    ax.set_ylim(found.y[0], found.y[-1])
    ax.grid(False)
    ax.set_xlabel(safe(found.vary[0]))
    ax.set_ylabel(safe(found.vary[1]))
