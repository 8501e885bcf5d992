"""The tuner drawn: its gain and its guard on the map, and its learning curves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.arm import MOMENT_GAIN
from tfarm.digits import how_many, significant
from tfarm.dsp import GainMap
from tfarm.loop.plane import Plane
from tfarm.tuner import Tuning
from tfarm.tuner.training import QUARTILES, LearningCurves

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


def draw_gain(tuning: Tuning, continuous: Plane, sampled: Sequence[GainMap]) -> Figure:
    """Left the map with the tuner's path and guard, right the gain over time, on the same axis."""
    with style():
        figure = blank(9.0, 4.9)
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1.0, 1.35])
        overlay(continuous, sampled, ax=left)
        left.get_legend().remove()
        left.set_title("", loc="right")
        path(tuning, ax=left)
        gain_over_time(tuning, ax=right)
        left.set_ylim(*K_RANGE)
        right.set_ylabel("")
        figure.legend(handles=right.get_legend_handles_labels()[0], loc="outside lower left", ncols=3)
        headline(figure, f"{tuning.trial.arm.name}: the tuner's gain, and where it is proven stable")
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


def draw_curves(curves: LearningCurves, tuning: Tuning) -> Figure:
    """Learning curves: each seed, median and quartiles, and the baselines; what diverged leaves through the top."""
    trial, seeds = np.arange(1, curves.costs.shape[1] + 1), len(curves.costs)
    top = MOST_COST * tuning.without.cost
    low, middle, high = (np.minimum(curves.quantile(share), 2 * top) for share in QUARTILES)
    with style():
        figure = blank(9.0, 4.4)
        ax = figure.subplots()
        ax.plot(trial, np.minimum(curves.costs, 2 * top).T, color="#b9b9b9", lw=0.6, zorder=1)
        ax.fill_between(trial, low, high, color=BLUE, alpha=0.22, lw=0, zorder=2, label="middle half of the seeds")
        ax.plot(trial, middle, color=BLUE, lw=1.8, zorder=3, label="median")
        for cost, colour, label in (
            (tuning.without.cost, ORANGE, "no moment feedback"),
            (tuning.best_constant.cost, PURPLE, "best constant gain"),
            (tuning.bound.cost, INK, "linear-quadratic optimum: nothing is below"),
        ):
            ax.axhline(cost, color=colour, lw=1.2, ls=(0, (5, 3)), zorder=2.5, label=f"{label}, {significant(cost, 3)}")
        ax.set(xlim=(1, max(2, trial[-1])), xlabel="trial", ylim=(0.0, top), ylabel="cost of a trial")
        figure.legend(handles=ax.get_legend_handles_labels()[0], loc="outside lower left", ncols=3)
        headline(figure, f"{tuning.trial.arm.name}: learning, {how_many(seeds, 'seed')}")
    return figure
