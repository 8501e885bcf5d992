"""The arm over time: root moment, tip and motor, as lines or, where these ring too fast for a page, as bands.

Measured runs on a rig, and over each the exact sampled loop that was led by the same reference.
The tuner: its gain and its guard on the map and over time, and its learning curves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.arm import MOMENT_GAIN, Arm
from tfarm.digits import how_many, plain, significant
from tfarm.dsp import GainMap, Simulation, traces
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.traces import POINTS_A_PERIOD, TimeCurve
from tfarm.fitting.recording import RunComparison
from tfarm.loop.plane import Plane
from tfarm.tuner import Tuning
from tfarm.tuner.training import QUARTILES, LearningCurves

from .regions import overlay
from .style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, legend_below, page, picture, safe

RUN_COLOURS = (ORANGE, BLUE, GREEN, PURPLE)  # of several simulations; one alone is blue
K_RANGE = (-0.25, 1.25)  # of the moment gain: from 0 to the continuous loop's bound, 1, and a quarter to either side
GUARD = "#bfe3d6"
MOST_COST = 1.25  # of the cost without feedback: higher ones are drawn at the top edge
Runs = Mapping[str, Simulation]


@picture(
    (Arm, "tfarm.load returns"), (Simulation | Mapping, "tfarm.simulate returns"), size=(9.0, 7.0),
    rows=(1.35, 1.0, 1.0), keys=True, title=lambda arm, runs, what="": f"{arm.name}: {what or _scenario(runs).name}",
)  # fmt: skip
def slew(arm: Arm, runs: Simulation | Runs, what: str = "", *, ax: Sequence[Axes]) -> None:
    """Simulations of one scenario (what `tfarm.simulate` returns; several by name) in three axes, given or new; these.

    Root moment [N m], tip less a rigid arm's on its reference [mm], and the torque of the motor [N m], or its input.
    Above them it is said where records are too few for the fastest mode that is seen.  `what` is their headline.
    """
    each, scenario = _by_name(runs), _scenario(runs)
    moment, tip, motor = ax
    moment.step(
        scenario.t - scenario.period, scenario.rigid_moment, where="post", color=GREY, lw=1.0, ls=(0, (4, 3)),
        label="rigid arm",
    )  # fmt: skip
    colours = RUN_COLOURS if len(each) > 1 else (BLUE,)
    for (name, run), colour in zip(each.items(), cycle(colours), strict=False):
        _draw_curve(traces.root_moment(run), moment, colour, name or None)
        deviation = traces.tip_deviation(arm, run)
        _draw_curve(replace(deviation, low=1e3 * deviation.low, high=1e3 * deviation.high), tip, colour)
        values = run.torque if run.volts is None else run.volts
        held = traces.curve(run.t, values)
        if held.is_band:
            _draw_curve(held, motor, colour)
        else:
            motor.step(run.t, values, where="post", color=colour, lw=1.3)
    for axes in ax:
        axes.axvline(scenario.busy_until, color=INK, lw=0.8, ls=(0, (1, 2)))
        axes.axhline(0.0, color=GREY, lw=0.6)
        axes.set_xlim(0.0, float(scenario.t[-1]))
    moment.set_ylabel("root moment  [N m]")
    tip.set_ylabel("tip − reference  [mm]")
    in_volts = next(iter(each.values())).volts is not None
    torque = "motor torque  [N m]" if arm.input_unit == "N m" else f"motor  [{arm.input_unit}]"
    motor.set(xlabel="time  [s]", ylabel="motor  [V]" if in_volts else torque)
    points, finer = min(traces.points_a_period(arm, run) for run in each.values())
    coarse = f"{plain(points, 2)} points a period of the fastest mode seen; between={finer} gives {POINTS_A_PERIOD}"
    moment.set_title(coarse if points < POINTS_A_PERIOD else "", loc="right", fontsize=8.0, color=GREY)


def _by_name(runs: Simulation | Runs) -> Runs:
    return runs if isinstance(runs, Mapping) else {"": runs}


def _scenario(runs: Simulation | Runs) -> Scenario:
    return next(iter(_by_name(runs).values())).scenario


def _draw_curve(curve: TimeCurve, ax: Axes, colour: str, label: str | None = None) -> None:
    """The line, or the band."""
    if curve.is_band:
        ax.fill_between(curve.t, curve.low, curve.high, color=colour, alpha=0.55, lw=0.8, label=label)
    else:
        ax.plot(curve.t, curve.low, color=colour, lw=1.3, label=label)


def draw_beside(title: str, each: Mapping[str, RunComparison]) -> Figure:
    """A column a law: hub angle above, root moment below where it was measured."""
    moment = any(found.measured.root_moment.size for found in each.values())
    grid = {"nrows": 1 + moment, "ncols": len(each), "sharex": "col", "sharey": "row", "squeeze": False}
    with page(max(4.7 * len(each), 6.0), 6.0 if moment else 3.6, title, **grid) as (figure, axes):
        for column, (name, found) in enumerate(each.items()):
            measured, ax = found.measured, axes[0, column]
            ax.plot(measured.t, np.degrees(measured.reference), color=GREY, lw=1.0, ls=(0, (4, 3)), label="reference")
            if measured.hub_angle.size:
                ax.plot(measured.t, np.degrees(measured.hub_angle), color=ORANGE, label="measured")
            ax.plot(found.run.t, np.degrees(found.hub_angle), color=BLUE, lw=1.2, label="exact sampled loop")
            ax.set(xlim=(0.0, float(measured.t[-1])))
            ax.set_title(safe(name), fontsize=9.5)
            if moment and measured.root_moment.size:
                axes[1, column].plot(measured.t, measured.root_moment, color=ORANGE)
            if moment:
                axes[1, column].plot(found.run.t, found.run.at_samples.root_moment, color=BLUE, lw=1.2)
                axes[1, column].axhline(0.0, color=GREY, lw=0.6)
            axes[-1, column].set_xlabel("time  [s]")
        for ax, label in zip(axes[:, 0], ("hub angle  [deg]", "root moment  [N m]"), strict=False):
            ax.set_ylabel(label)
        legend_below(figure, axes[0, 0].get_legend_handles_labels())
    return figure


@picture(
    (Tuning, "tfarm.tune returns"), size=(7.0, 4.4), keys=True,
    title=lambda found: f"{found.trial.arm.name}: the tuner's gain, and where it is proven stable",
)  # fmt: skip
def tuned_gain(found: Tuning, *, ax: Axes) -> None:
    """A tuned gain over time (what `tfarm.tune` returns) in its guard, in the axes given or new ones; the axes."""
    guard, result = found.training.guard, found.training.result
    ax.axhspan(guard.lo, guard.hi, color=GUARD, lw=0, zorder=0.5, label="guard: proven for any K(t) in it")
    ax.step(result.t, result.K, where="post", color=INK, lw=1.4, label="the tuner's gain K(t)")
    best = found.best_constant.gain
    ax.axhline(best, color=PURPLE, lw=1.2, ls=(0, (5, 3)), label=f"best constant gain, {significant(best, 3)}")
    ax.axvline(found.trial.task.busy_until, color=INK, lw=0.8, ls=(0, (1, 2)))
    ax.axhline(0.0, color=GREY, lw=0.7)
    ax.set(xlim=(0.0, float(result.t[-1])), xlabel="time  [s]", ylabel=f"gain on the root moment, {MOMENT_GAIN}  [-]")


def draw_gain(tuning: Tuning, continuous: Plane, sampled: Sequence[GainMap]) -> Figure:
    """Left the map with the guard as a bar and in it the gains that the tuner takes, right the gain over time."""
    title = f"{tuning.trial.arm.name}: the tuner's gain, and where it is proven stable"
    with page(9.0, 4.9, title, ncols=2, sharey=True, width_ratios=[1.0, 1.35]) as (figure, (left, right)):
        overlay(continuous, sampled, ax=left)
        left.get_legend().remove()
        left.set_title("", loc="right")
        left.lines[-1].remove()  # the mark of one law: the bar is at its rate gain
        guard, K = tuning.training.guard, tuning.training.result.K
        at, _ = tuning.trial.loop.gains.point
        left.plot([at, at], [guard.lo, guard.hi], color=GREEN, lw=9, solid_capstyle="butt", alpha=0.75, zorder=6)
        left.plot([at, at], [float(K.min()), float(K.max())], color=INK, lw=2.4, solid_capstyle="butt", zorder=7)
        tuned_gain(tuning, ax=right)
        left.set_ylim(*K_RANGE)
        right.set_ylabel("")
        legend_below(figure, right.get_legend_handles_labels())
    return figure


def draw_curves(curves: LearningCurves, tuning: Tuning) -> Figure:
    """Learning curves: each seed, median and quartiles, and the baselines; what diverged leaves through the top."""
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
            (tuning.bound.cost, INK, "linear-quadratic optimum: nothing is below"),
        ):
            ax.axhline(cost, color=colour, lw=1.2, ls=(0, (5, 3)), zorder=2.5, label=f"{label}, {significant(cost, 3)}")
        ax.set(xlim=(1, max(2, trial[-1])), xlabel="trial", ylim=(0.0, top), ylabel="cost of a trial")
        legend_below(figure)
    return figure
