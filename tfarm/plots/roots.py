"""Root loci: exact branches, those of python-control on a reduced model beside them, and where they cross the axis."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from tfarm.digits import held, plain, significant
from tfarm.loop.loci import GAPS_HELD, HELD, Loci, shown
from tfarm.loop.locus import Locus
from tfarm.loop.reduced_locus import ReducedLocus
from tfarm.spectrum import modes

from .style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, Keys, New, alone, blank, headline, style, window
from .words import gains_words

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

ZOOMED = 4  # modes drawn on their own
COLORS = (INK, BLUE, GREEN, PURPLE, "#7a5a00", GREY)  # by mode
ROOM = 0.12  # around a branch, as a share of its extent
MARKED = 5  # values marked along each branch


def locus(exact: Locus, *, reduced: ReducedLocus | None = None, ax: Axes | None = None) -> Axes:
    """Closed-loop poles as one number varies (what `tfarm.locus` returns), in the axes given or in new ones; the axes.

    Broad lines: the branches [1/s], a colour a mode, a cross at their beginning, dots at every fourth of the range,
    and a diamond where one crosses the axis.  Thin: those of `reduced` (`tfarm.loop.reduced_locus`), if given.
    """
    if ax is None:
        return draw_locus(exact, reduced, window).axes[0]
    with style():
        every = range(len(exact.branches))
        _panel(exact, reduced, every, ax, named=[*every, None])
        _frame(shown(exact.branches), ax)
        ax.set_xlabel("Re s [1/s]")
        ax.set_ylabel("Im s [rad/s]")
    return ax


def draw_locus(exact: Locus, reduced: ReducedLocus | None = None, new: New = blank) -> Figure:
    """All branches in one panel, on a figure of its own."""
    title = f"{exact.arm.name}: closed-loop poles as {_range(exact)}"
    draw = partial(locus, exact, reduced=reduced)
    return alone(lambda own: draw(ax=own), (7.0, 5.6), title, _legend(exact, reduced), new)


def zoomed(exact: Locus) -> list[int]:
    """The branches drawn on their own: the first that swings of each mode."""
    imag, mode = exact.branches.imag, exact.mode
    first = {int(mode[n]): n for n in reversed(range(mode.size)) if (imag[n] > 0).any()}
    return [first[number] for number in sorted(first)][:ZOOMED]


def color_of(exact: Locus, branch: int) -> str:
    """One colour a mode."""
    return COLORS[int(exact.mode[branch]) % len(COLORS)]


def draw_loci(data: Loci) -> Figure:
    """All branches in one panel, and each mode enlarged beside it."""
    exact = data.exact
    with style():
        figure = blank(9.0, 5.6)
        grid = figure.add_gridspec(2, 4, width_ratios=[1.7, 1.7, 1.3, 1.3])
        whole = figure.add_subplot(grid[:, :2])
        numbers = range(len(exact.branches))
        _panel(exact, data.reduced, numbers, whole, named=sorted(set(numbers) - set(zoomed(exact))))
        _frame(shown(exact.branches), whole)
        whole.set_title("all of them", fontsize=9.0)
        whole.set_xlabel("Re s [1/s]")
        whole.set_ylabel("Im s [rad/s]")
        for place, n in enumerate(zoomed(exact)):
            ax = figure.add_subplot(grid[place // 2, 2 + place % 2])
            _panel(exact, data.reduced, [n], ax, named=[n])
            ax.xaxis.set_major_locator(MaxNLocator(3))
            branch = shown(exact.branches[n])
            _frame(branch[branch.imag >= 0], ax)
            name = f"mode {exact.mode[n]}" if exact.mode[n] else "rigid body"
            ax.set_title(name, fontsize=9.0, color=color_of(exact, n))
            ax.tick_params(labelsize=7.5)
        figure.legend(*_legend(exact, data.reduced), loc="outside lower left", ncols=5, fontsize=8.2, columnspacing=1.2)
        headline(figure, f"{exact.arm.name}: closed-loop poles as {_range(exact)}")
    return figure


def _range(exact: Locus) -> str:
    first, last = (plain(float(exact.gain[i]), 4) for i in (0, -1))
    return f"{exact.vary} goes from {first} to {last}, {gains_words(exact.law, but=exact.vary)} held"


def _marked(exact: Locus) -> Real:
    """The values that are marked along each branch."""
    return np.linspace(exact.gain[0], exact.gain[-1], MARKED)


def _panel(
    exact: Locus, reduced: ReducedLocus | None, numbers: Sequence[int], ax: Axes, named: Sequence[int | None]
) -> None:
    """Some branches, exact and reduced, with their crossings; gain and frequency beside those of the named ones.

    None names crossings that lie on no branch that is drawn.
    """
    branches = shown(exact.branches)
    ax.axvline(0, color=INK, lw=0.9, zorder=1)
    at = [int(np.argmin(abs(exact.gain - value))) for value in _marked(exact)]
    for n in numbers:
        color, s = color_of(exact, n), branches[n]
        ax.plot(s.real, s.imag, color=color, lw=2.6, alpha=0.4, zorder=2, solid_capstyle="round")
        if reduced is not None:
            _reduced_branch(exact, reduced, n, color, ax)
        ax.plot(s[0].real, s[0].imag, "x", color=color, ms=6, mew=1.4, zorder=4)
        ax.plot(s[at[1:]].real, s[at[1:]].imag, "o", color=color, ms=3.2, zorder=4)
    everything = len(numbers) == len(branches)
    for each in exact.crossings:
        if each.branch in numbers or (each.branch is None and everything):
            omega = held([each.omega], HELD)[0]
            ax.plot([0], [omega], "D", ms=6, mfc=ORANGE, mec="white", mew=0.8, zorder=6)
            if each.branch not in named:
                continue
            text = f"{exact.vary} = {plain(each.gain, 5)}\n{significant(each.omega, 4)} rad/s"
            ax.annotate(
                text, (0, omega), textcoords="offset points", xytext=(7, 0), fontsize=7.5, va="center", zorder=6,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.8},
            )  # fmt: skip


def _reduced_branch(exact: Locus, reduced: ReducedLocus, n: int, color: str, ax: Axes) -> None:
    """A branch of the reduced model, and the strip around it that its printed gap allows."""
    lives = ~np.isnan(reduced.branches[n])
    if lives.sum() < 2:
        return
    curve, first = shown(reduced.branches[n][lives]), float(modes(exact.arm, 1).natural_frequency[-1])
    there = abs(exact.gain - reduced.gain[lives, None]).argmin(axis=1)  # the reduced one may have fewer values
    size = abs(shown(exact.branches[n, there]))
    width = held(reduced.gap, GAPS_HELD)[n] * np.maximum(size, first)
    along = np.gradient(curve)
    normal = 1j * along / np.where(along == 0, 1, abs(along))
    edge = np.r_[curve + width * normal, (curve - width * normal)[::-1]]
    ax.fill(edge.real, edge.imag, facecolor=color, alpha=0.15, lw=0, zorder=1.5)
    ax.plot(curve.real, curve.imag, color=color, lw=0.9, ls=(0, (2, 1.5)), zorder=3)


def _frame(points: Complex, ax: Axes) -> None:
    """Limits with all of the branch, the axis and some room: nothing is cut off."""
    points = points[~np.isnan(points)]
    real, imag = points.real, points.imag
    left, right = min(float(real.min()), 0.0), max(float(real.max()), 0.0)
    low, high = float(imag.min()), float(imag.max())
    wide = max(right - left, 1e-12 * abs(points).max()) or 1.0  # where no pole moves from 0
    tall = max(high - low, 1e-9 * high) or wide  # where none of them swings
    ax.set_xlim(left - ROOM * wide, right + 2 * ROOM * wide)
    ax.set_ylim(low - ROOM * tall, high + ROOM * tall)


def _legend(exact: Locus, reduced: ReducedLocus | None) -> Keys:
    start, *others = (plain(float(value), 3) for value in _marked(exact))
    keys = {"exact": Line2D([], [], color=GREY, lw=2.6, alpha=0.4)}
    if reduced is not None:
        keys[f"python-control, order {reduced.order}"] = Line2D([], [], color=GREY, lw=0.9, ls=(0, (2, 1.5)))
    keys[f"{exact.vary} = {start}"] = Line2D([], [], color=GREY, ls="none", marker="x")
    keys[f"{exact.vary} = {', '.join(others)}"] = Line2D([], [], color=GREY, ls="none", marker="o", ms=3.2)
    if exact.crossings:
        keys["crosses the axis"] = Line2D([], [], color=ORANGE, ls="none", marker="D")
    return list(keys.values()), list(keys)
