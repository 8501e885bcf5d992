"""The arm over time: root moment, tip and motor, as lines or, where these ring too fast for a page, as bands.

Measured runs on a rig, and over each the exact sampled loop under the same reference.
The tuner: its gain and its guard on the map and over time, and its learning curves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.digits import how_many, plain, significant
from tfarm.dsp import GainMap, Simulation, traces
from tfarm.dsp.traces import POINTS_A_PERIOD, TimeCurve
from tfarm.fitting.recording import RunComparison
from tfarm.loop.plane import Plane
from tfarm.tuner import Tuning
from tfarm.tuner.training import QUARTILES, LearningCurves

from .regions import overlay
from .style import BLUE, COLOURS, GREEN, GREY, INK, ORANGE, PURPLE, by_name, page, picture, safe

K_RANGE = (-0.25, 1.25)  # of the moment gain: from 0 to the continuous loop's bound, 1, and a quarter to either side
GUARD = "#bfe3d6"
MOST_COST = 1.25  # of the cost without feedback: higher ones are drawn at the top edge
TIME = "time [s]"
DASHED, DOTTED, LONG_DASHED = (0, (4, 3)), (0, (1, 2)), (0, (5, 3))


def _slew_title(arm: Arm, runs: Simulation | Mapping[str, Simulation], what: str = "") -> str:
    return f"{arm.name}: {what or next(iter(by_name(runs).values())).scenario.name}"


@picture(
    (Arm, "tfarm.load returns"), (Simulation, "tfarm.simulate returns"), size=(9.0, 7.0), rows=(1.35, 1.0, 1.0),
    title=_slew_title,
)  # fmt: skip
def slew(arm: Arm, runs: Simulation | Mapping[str, Simulation], what: str = "", *, ax: Sequence[Axes]) -> None:
    """Simulations of one scenario (from `tfarm.simulate`; several by name) in three axes, given or new; these.

    Root moment [N m], tip less a rigid arm's on its reference [mm], and the torque of the motor [N m], or its input.
    A note above them names records with too few points for the fastest mode that shows.  `what` is their headline.
    """
    each = by_name(runs)
    first = next(iter(each.values()))
    scenario = first.scenario
    moment, tip, motor = ax
    moment.step(
        scenario.t - scenario.period, scenario.rigid_moment, where="post", color=GREY, lw=1.0, ls=DASHED,
        label="rigid arm",
    )  # fmt: skip
    colours = (ORANGE, BLUE, *COLOURS[2:]) if len(each) > 1 else (BLUE,)
    for (name, run), colour in zip(each.items(), cycle(colours), strict=False):
        _draw_curve(traces.curve_of(run, "root_moment"), moment, colour, label=name or None)
        _draw_curve(traces.tip_deviation(arm, run), tip, colour, scale=1e3)
        values = run.torque if run.volts is None else run.volts
        _draw_curve(traces.curve(run.t, values), motor, colour, drawstyle="steps-post")
    torque = "motor torque [N m]" if arm.input_unit == "N m" else f"motor [{arm.input_unit}]"
    labels = ("root moment [N m]", "tip − reference [mm]", torque if first.volts is None else "motor [V]")
    for axes, label in zip(ax, labels, strict=True):
        axes.axvline(scenario.busy_until, color=INK, lw=0.8, ls=DOTTED)
        axes.axhline(0.0, color=GREY, lw=0.6)
        axes.set(xlim=(0.0, float(scenario.t[-1])), xlabel=TIME, ylabel=label)
    points, finer = min(traces.points_a_period(arm, run) for run in each.values())
    coarse = f"{plain(points, 2)} points a period of the fastest mode shown; between={finer} gives {POINTS_A_PERIOD}"
    moment.set_title(coarse if points < POINTS_A_PERIOD else "", loc="right", fontsize=8.0, color=GREY)


def _draw_curve(curve: TimeCurve, ax: Axes, colour: str, *, scale: float = 1.0, **looks: Any) -> None:
    """The line, or the band."""
    low, high = scale * curve.low, scale * curve.high
    if curve.is_band:
        ax.fill_between(curve.t, low, high, color=colour, alpha=0.55, lw=0.8, label=looks.get("label"))
    else:
        ax.plot(curve.t, low, color=colour, lw=1.3, **looks)


def draw_measured_runs(title: str, each: Mapping[str, RunComparison]) -> Figure:
    """A column a controller: hub angle above, root moment below where it was measured."""
    moment = any(found.measured.root_moment.size for found in each.values())
    grid: dict[str, Any] = {"nrows": 1 + moment, "ncols": len(each), "sharex": "col", "sharey": "row", "squeeze": False}
    with page(max(4.7 * len(each), 6.0), 6.0 if moment else 3.6, title, **grid) as (figure, axes):
        for column, (name, found) in zip(axes.T, each.items(), strict=True):
            measured, run = found.measured, found.run
            column[0].plot(measured.t, np.degrees(measured.reference), color=GREY, lw=1.0, ls=DASHED, label="reference")
            column[0].set(title=safe(name), xlim=(0.0, float(measured.t[-1])))
            column[-1].set_xlabel(TIME)
            signals = (
                (np.degrees(measured.hub_angle), np.degrees(found.hub_angle)),
                (measured.root_moment, run.at_samples.root_moment),
            )
            for ax, (seen, computed) in zip(column, signals, strict=False):
                if seen.size:
                    ax.plot(measured.t, seen, color=ORANGE, label="measured")
                ax.plot(run.t, computed, color=BLUE, lw=1.2, label="exact sampled loop")
        for ax, label in zip(axes[:, 0], ("hub angle [deg]", "root moment [N m]"), strict=False):
            ax.set_ylabel(label)
    return figure


@picture(
    (Tuning, "tfarm.tune returns"), size=(7.0, 4.4),
    title=lambda found: f"{found.trial.arm.name}: the tuner's gain, and where it is proven stable",
)  # fmt: skip
def tuned_gain(found: Tuning, *, ax: Axes) -> None:
    """A tuned gain over time (from `tfarm.tune`) in its guard, in the axes given or new ones; the axes."""
    guard, result = found.training.guard, found.training.result
    ax.axhspan(guard.lo, guard.hi, color=GUARD, lw=0, zorder=0.5, label="guard: proven for any K(t) in it")
    ax.step(result.t, result.K, where="post", color=INK, lw=1.4, label="the tuner's gain K(t)")
    best = found.best_constant.gain
    ax.axhline(best, color=PURPLE, lw=1.2, ls=LONG_DASHED, label=f"best constant gain, {significant(best, 3)}")
    ax.axvline(found.trial.task.busy_until, color=INK, lw=0.8, ls=DOTTED)
    ax.axhline(0.0, color=GREY, lw=0.7)
    ax.set(xlim=(0.0, float(result.t[-1])), xlabel=TIME, ylabel=f"gain on the root moment, {MOMENT_GAIN} [−]")


def draw_gain(tuning: Tuning, continuous: Plane, sampled: Sequence[GainMap]) -> Figure:
    """Left the map with the guard as a bar and in it the gains that the tuner takes, right the gain over time."""
    title = f"{tuning.trial.arm.name}: the tuner's gain, and where it is proven stable"
    with page(9.0, 5.2, title, ncols=2, sharey=True, width_ratios=[1.0, 1.35]) as (figure, (left, right)):
        overlay(continuous, sampled, ax=left)
        left.set_title("", loc="right")
        left.lines[-1].remove()  # the mark of one controller: the bar is at its rate gain
        guard, K = tuning.training.guard, tuning.training.result.K
        at, _ = tuning.trial.loop.gains.point
        for (low, high), looks in (
            ((guard.lo, guard.hi), {"color": GREEN, "lw": 9, "alpha": 0.75}),
            ((float(K.min()), float(K.max())), {"color": INK, "lw": 2.4}),
        ):
            left.plot([at, at], [low, high], solid_capstyle="butt", zorder=6, **looks)
        tuned_gain(tuning, ax=right)
        left.set_ylim(*K_RANGE)
        right.set_ylabel("")
    return figure


def draw_curves(curves: LearningCurves, tuning: Tuning) -> Figure:
    """Learning curves: each seed, median and quartiles, and the baselines; diverged ones leave through the top."""
    trial, seeds = np.arange(1, curves.costs.shape[1] + 1), len(curves.costs)
    top = MOST_COST * tuning.without.cost
    low, middle, high = (np.minimum(curves.quantile(share), 2 * top) for share in QUARTILES)
    with page(9.0, 4.4, f"{tuning.trial.arm.name}: learning, {how_many(seeds, 'seed')}") as (figure, ax):
        ax.plot(trial, np.minimum(curves.costs, 2 * top).T, color="#b9b9b9", lw=0.6, zorder=1)
        ax.fill_between(trial, low, high, color=BLUE, alpha=0.22, lw=0, zorder=2, label="middle half of the seeds")
        ax.plot(trial, middle, color=BLUE, lw=1.8, zorder=3, label="median")
        for cost, colour, label in (
            (tuning.without.cost, ORANGE, "no moment feedback"),
            (tuning.best_constant.cost, PURPLE, "best constant gain"),
            (tuning.bound.cost, INK, "linear-quadratic optimum: lower bound"),
        ):
            ax.axhline(cost, color=colour, lw=1.2, ls=LONG_DASHED, zorder=2.5, label=f"{label}, {significant(cost, 3)}")
        ax.set(xlim=(1, max(2, trial[-1])), xlabel="trial number", ylim=(0.0, top), ylabel="cost of a trial [−]")
    return figure
