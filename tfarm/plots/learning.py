"""The tuner drawn: its gain and its guard on the map, the slew with and without it, learning, and the final cost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from tfarm.arm import MOMENT_GAIN
from tfarm.digits import plain, significant
from tfarm.dsp import GainMap
from tfarm.loop.regions import Region
from tfarm.tuner import Tuning
from tfarm.tuner.overview import CostMap, Curves, TunerStudy

from .regions import overlay
from .style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, blank, headline, must_be, on_own_figure, style, window

K_RANGE = (-0.25, 1.25)  # of the moment gain: from 0 to the continuous loop's bound, 1, and a quarter to either side
GUARD = "#bfe3d6"
MOST_COST = 1.25  # of the cost without feedback: higher ones are drawn at the top edge


def tuned_gain(found: Tuning, *, ax: Axes | None = None) -> Axes:
    """A tuned gain over time (what `tfarm.tune` returns) in its guard, in the axes given or new ones; the axes."""
    must_be(Tuning, found, "tfarm.tune returns")
    if ax is None:
        title = f"{found.trial.arm.name}: the tuner's gain, and where it is proven stable"
        return on_own_figure(lambda own: tuned_gain(found, ax=own), (7.0, 4.4), title, new=window).axes[0]
    with style():
        gain_over_time(found, ax=ax)
        ax.set_ylabel(f"gain on the root moment, {MOMENT_GAIN}  [-]")
    return ax


def draw_gain(data: TunerStudy, continuous: Region, sampled: Sequence[GainMap]) -> Figure:
    """Left the map with the tuner's path and guard, right the gain over time, on the same axis."""
    with style():
        figure = blank(9.0, 4.9)
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1.0, 1.35])
        overlay(continuous, sampled, ax=left)
        left.get_legend().remove()
        left.set_title("", loc="right")
        path(data.tuning, ax=left)
        gain_over_time(data.tuning, ax=right)
        left.set_ylim(*K_RANGE)
        right.set_ylabel("")
        figure.legend(handles=right.get_legend_handles_labels()[0], loc="outside lower left", ncols=3)
        headline(figure, f"{data.arm.name}: the tuner's gain, and where it is proven stable")
    return figure


def path(tuning: Tuning, *, ax: Axes) -> None:
    """The guard as a bar at the loop's rate gain, and in it the gains that the tuner takes."""
    guard, K = tuning.training.guard, tuning.training.result.K
    at, _ = tuning.trial.loop.gains.point
    ax.plot([at, at], [guard.lo, guard.hi], color=GREEN, lw=9, solid_capstyle="butt", alpha=0.75, zorder=6)
    ax.plot([at, at], [float(K.min()), float(K.max())], color=INK, lw=2.4, solid_capstyle="butt", zorder=7)
    for line in ax.lines:
        if line.get_marker() == "o":
            line.remove()


def gain_over_time(tuning: Tuning, *, ax: Axes) -> None:
    """K over time."""
    guard, result, task = tuning.training.guard, tuning.training.result, tuning.trial.task
    ax.axhspan(guard.lo, guard.hi, color=GUARD, lw=0, zorder=0.5, label="guard: proven for any K(t) in it")
    ax.step(result.t, result.K, where="post", color=INK, lw=1.4, label="the tuner's gain K(t)")
    best = tuning.best_constant.gain
    ax.axhline(best, color=PURPLE, lw=1.2, ls=(0, (5, 3)), label=f"best constant gain, {significant(best, 3)}")
    ax.axvline(task.busy_until, color=INK, lw=0.8, ls=(0, (1, 2)))
    ax.axhline(0.0, color=GREY, lw=0.7)
    ax.set_xlim(0.0, float(result.t[-1]))
    ax.set_xlabel("time  [s]")


def draw_curves(data: TunerStudy) -> Figure:
    """Learning curves, a panel a rule: each seed, median and quartiles, and what there is to beat."""
    with style():
        figure = blank(9.0, 4.4)
        axes = figure.subplots(1, len(data.curves), sharey=True)
        for curves, ax in zip(data.curves, axes, strict=True):
            learning(curves, ax=ax)
            yardsticks(data.tuning, ax=ax)
            ax.set_title(curves.title, fontsize=9.5)
        axes[0].set_ylabel("cost of a trial")
        axes[0].set_ylim(0.0, MOST_COST * data.tuning.without.cost)
        figure.legend(handles=axes[0].get_legend_handles_labels()[0], loc="outside lower left", ncols=3)
        headline(figure, f"{data.arm.name}: learning, {len(data.curves[0].finished)} seeds")
    return figure


def learning(curves: Curves, *, ax: Axes) -> None:
    """Each seed thin, the quartiles as a band, the median bold; what diverged leaves through the top."""
    trial = np.arange(1, curves.costs.shape[1] + 1)
    far = 1e6
    costs = np.minimum(curves.costs, far)
    ax.plot(trial, costs.T, color="#b9b9b9", lw=0.6, zorder=1)
    low, middle, high = (np.minimum(curves.quantile(q), far) for q in (0.25, 0.5, 0.75))
    ax.fill_between(trial, low, high, color=BLUE, alpha=0.22, lw=0, zorder=2, label="middle half of the seeds")
    ax.plot(trial, middle, color=BLUE, lw=1.8, zorder=3, label="median")
    ax.set_xlim(1, trial[-1])
    ax.set_xlabel("trial")


def yardsticks(tuning: Tuning, *, ax: Axes) -> None:
    """What the tuner has to beat, and what nothing beats."""
    for cost, colour, label in (
        (tuning.without.cost, ORANGE, "no moment feedback"),
        (tuning.best_constant.cost, PURPLE, "best constant gain"),
        (tuning.bound.cost, INK, "linear-quadratic optimum: nothing is below"),
    ):
        ax.axhline(cost, color=colour, lw=1.2, ls=(0, (5, 3)), zorder=2.5, label=f"{label}, {significant(cost, 3)}")


def draw_cost_map(data: TunerStudy) -> Figure:
    """Median final cost over (alpha_c, eta_c), the paper's pair framed."""
    with style():
        figure = blank(9.0, 4.4)
        cost_map(data.cost_map, ax=figure.subplots())
        headline(figure, f"{data.arm.name}: final cost over momentum and learning rate")
    return figure


def cost_map(data: CostMap, *, ax: Axes) -> None:
    """A cell a pair, its number written in it."""
    finite = data.median[np.isfinite(data.median)]
    low, high = float(finite.min()), float(np.quantile(finite, 0.9))
    shown = np.where(np.isfinite(data.median), data.median, 1e9)
    ax.pcolormesh(shown, cmap="Blues_r", vmin=low - 0.25 * (high - low), vmax=high, edgecolors="white", linewidth=1.0)
    for i, row in enumerate(data.median):
        for j, cost in enumerate(row):
            colour = "white" if cost < low + 0.35 * (high - low) else INK
            ax.text(j + 0.5, i + 0.5, significant(cost, 3), ha="center", va="center", fontsize=9, color=colour)
    for (i, j), colour, label in (
        (data.papers, ORANGE, "the paper's best, (0.6, 0.8)"),
        (data.best, GREEN, "the lowest here"),
    ):
        ax.plot([j, j + 1, j + 1, j, j], [i, i, i + 1, i + 1, i], color=colour, lw=2.6, zorder=5, label=label)
    ax.set_xticks(np.arange(data.etas.size) + 0.5, [plain(x) for x in data.etas])
    ax.set_yticks(np.arange(data.alphas.size) + 0.5, [plain(x) for x in data.alphas])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.tick_params(length=0)
    ax.grid(False)
    ax.set_xlabel(r"learning rate $\eta_c$")
    ax.set_ylabel(r"momentum $\alpha_c$")
    ax.legend(loc="upper left", bbox_to_anchor=(0.0, -0.16), ncols=2, borderaxespad=0.0)
