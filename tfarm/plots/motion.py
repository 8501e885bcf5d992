"""The arm over time: root moment, tip and motor, as lines or, where these ring too fast for a page, as bands.

Measured runs on a rig, and over each the exact sampled loop that was led by the same reference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.arm import Arm, must_be_arm
from tfarm.digits import plain
from tfarm.dsp import Simulation, traces
from tfarm.dsp.traces import POINTS_A_PERIOD, TimeCurve
from tfarm.fitting.recording import Beside

from .style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, New, blank, headline, must_be, safe, style, taken, window

RUN_COLOURS = (ORANGE, BLUE, GREEN, PURPLE)  # of several simulations; one alone is blue
Runs = Mapping[str, Simulation]


def slew(arm: Arm, runs: Simulation | Runs, *, ax: Sequence[Axes] | None = None) -> tuple[Axes, Axes, Axes]:
    """Simulations of one scenario (what `tfarm.simulate` returns; several by name) in three axes, given or new; these.

    Root moment [N m], tip less a rigid arm's on its reference [mm], and the torque of the motor [N m], or its input.
    Above them it is said where records are too few for the fastest mode that is seen.
    """
    must_be_arm(arm)
    each = runs if isinstance(runs, Mapping) else {"": runs}
    for run in each.values() or [None]:
        must_be(Simulation, run, "tfarm.simulate returns")
    with style():
        if ax is None:
            moment, tip, torque = draw_responses(arm, each, next(iter(each.values())).scenario.name, window).axes
        else:
            moment, tip, torque = taken(ax, 3)
            moment_over_time(each, ax=moment)
            tip_over_time(arm, each, ax=tip)
            motor_over_time(each, arm.input_unit, ax=torque)
            torque.set_xlabel("time  [s]")
        points, finer = min(traces.points_a_period(arm, run) for run in each.values())
        coarse = f"{plain(points, 2)} points a period of the fastest mode seen; between={finer} gives {POINTS_A_PERIOD}"
        moment.set_title(coarse if points < POINTS_A_PERIOD else "", loc="right", fontsize=8.0, color=GREY)
    return moment, tip, torque


def draw_responses(arm: Arm, each: Runs, what: str, new: New = blank) -> Figure:
    """Root moment, tip and motor above each other, on a figure of its own."""
    with style():
        figure = new(9.0, 7.0)
        slew(arm, each, ax=figure.subplots(3, 1, sharex=True, height_ratios=[1.35, 1.0, 1.0]))
        figure.legend(loc="outside lower left", ncols=3)
        headline(figure, f"{arm.name}: {what}")
    return figure


def draw_curve(curve: TimeCurve, ax: Axes, colour: str, label: str | None = None) -> None:
    """The line, or the band."""
    if curve.is_band:
        ax.fill_between(curve.t, curve.low, curve.high, color=colour, alpha=0.55, lw=0.8, label=label)
    else:
        ax.plot(curve.t, curve.low, color=colour, lw=1.3, label=label)


def moment_over_time(each: Runs, *, ax: Axes) -> None:
    """The moment at the root between and at the samples, and the rigid arm's."""
    first = next(iter(each.values()))
    t = first.scenario.t
    T = first.scenario.period
    ax.step(t - T, first.scenario.rigid_moment, where="post", color=GREY, lw=1.0, ls=(0, (4, 3)), label="rigid arm")
    for (name, simulation), colour in zip(each.items(), _colours(each), strict=True):
        draw_curve(traces.root_moment(simulation), ax, colour, name or None)
    _until(first, ax)
    ax.set_ylabel("root moment  [N m]")


def tip_over_time(arm: Arm, each: Runs, *, ax: Axes) -> None:
    """How far the tip is from where a rigid arm on its reference would have it, in mm."""
    for simulation, colour in zip(each.values(), _colours(each), strict=True):
        found = traces.tip_deviation(arm, simulation)
        draw_curve(replace(found, low=1e3 * found.low, high=1e3 * found.high), ax, colour)
    _until(next(iter(each.values())), ax)
    ax.set_ylabel("tip − reference  [mm]")


def motor_over_time(each: Runs, unit: str, *, ax: Axes) -> None:
    """What the motor holds from sample to sample, in the arm's unit; in volts where the chain has a motor constant."""
    first = next(iter(each.values()))
    in_volts = first.volts is not None
    for simulation, colour in zip(each.values(), _colours(each), strict=True):
        values = simulation.volts if simulation.volts is not None else simulation.torque
        held = traces.curve(simulation.t, values)
        if held.is_band:
            draw_curve(held, ax, colour)
        else:
            ax.step(simulation.t, values, where="post", color=colour, lw=1.3)
    _until(first, ax)
    ax.set_ylabel("motor  [V]" if in_volts else motor_words(unit))


def motor_words(unit: str) -> str:
    """What stands at the axis of what the motor gives."""
    return "motor torque  [N m]" if unit == "N m" else f"motor  [{unit}]"


def _until(simulation: Simulation, ax: Axes) -> None:
    ax.axvline(simulation.scenario.busy_until, color=INK, lw=0.8, ls=(0, (1, 2)))
    ax.axhline(0.0, color=GREY, lw=0.6)
    ax.set_xlim(0.0, float(simulation.scenario.t[-1]))


def _colours(each: Runs) -> list[str]:
    return [BLUE] if len(each) == 1 else [RUN_COLOURS[i % len(RUN_COLOURS)] for i in range(len(each))]


def draw_beside(title: str, each: Mapping[str, Beside]) -> Figure:
    """A column a law: hub angle above, root moment below where it was measured."""
    moment = any(found.measured.root_moment.size for found in each.values())
    with style():
        figure = blank(max(4.7 * len(each), 6.0), 6.0 if moment else 3.6)
        axes = figure.subplots(1 + moment, len(each), sharex="col", sharey="row", squeeze=False)
        for column, (name, found) in enumerate(each.items()):
            measured, ax = found.measured, axes[0, column]
            ax.plot(measured.t, np.degrees(measured.reference), color=GREY, lw=1.0, ls=(0, (4, 3)), label="reference")
            if measured.hub_angle.size:
                ax.plot(measured.t, np.degrees(measured.hub_angle), color=ORANGE, label="measured")
            ax.plot(found.run.t, np.degrees(found.hub_angle), color=BLUE, lw=1.2, label="exact sampled loop")
            ax.set_xlim(0.0, float(measured.t[-1]))
            if moment and measured.root_moment.size:
                axes[1, column].plot(measured.t, measured.root_moment, color=ORANGE)
            if moment:
                axes[1, column].plot(found.run.t, found.run.at_samples.root_moment, color=BLUE, lw=1.2)
                axes[1, column].axhline(0.0, color=GREY, lw=0.6)
            ax.set_title(safe(name), fontsize=9.5)
            axes[-1, column].set_xlabel("time  [s]")
        axes[0, 0].set_ylabel("hub angle  [deg]")
        if moment:
            axes[1, 0].set_ylabel("root moment  [N m]")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
        headline(figure, title)
    return figure
