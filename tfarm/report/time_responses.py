"""The slew in time, with and without moment feedback: the paper's Figures 4, 6, 8 and 9 in spirit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback
from tfarm.columns import Column, Table
from tfarm.digits import plain, significant
from tfarm.dsp import Simulation, Simulator, scenario
from tfarm.dsp.chain import Chain
from tfarm.dsp.results import residual_moment_rms, settling_time
from tfarm.plots.style import BLUE, GREY, INK, ORANGE, blank, headline, style
from tfarm.records import record
from tfarm.report import curves
from tfarm.report.curves import resolved

Real = NDArray[np.float64]

LASTING = 3.0  # times the slew: how long a record is
UNTIL = 0.9  # of a record: what has settled after that may ring on


@dataclass(frozen=True)
@record
class Slews:
    """One slew simulated twice: `without` (K2 = 0) and `with_moment` feedback, K1 the same."""

    arm: Arm
    gains: HubFeedback
    without: Simulation
    with_moment: Simulation

    @property
    def each(self) -> Mapping[str, Simulation]:
        """Both, by what they are called; the one without comes first."""
        return {"without moment feedback, K2 = 0": self.without, f"with, K2 = {plain(self.gains.K2)}": self.with_moment}


def slews(arm: Arm, gains: HubFeedback, chain: Chain, modes: int) -> Slews:
    """The slew of the chain, for three times as long as it takes.

    Raises ParameterError for an arm that cannot turn.
    """
    task = scenario("slew", arm, chain, LASTING * chain.slew.rise_time)
    simulator = Simulator(arm, chain, task, count=modes)
    without = HubFeedback(K1=gains.K1, K2=0.0)
    both = resolved(simulator, arm, *(partial(Simulator.linear, gains=law) for law in (without, gains)))
    return Slews(arm, gains, *both)


def draw_slews(data: Slews) -> Figure:
    """Root moment, tip and motor torque over time."""
    with style():
        figure = blank(9.0, 7.0)
        moment, tip, torque = figure.subplots(3, 1, sharex=True, height_ratios=[1.35, 1.0, 1.0])
        root_moment(data.each, ax=moment)
        tip_error(data.arm, data.each, ax=tip)
        motor_torque(data.each, ax=torque)
        figure.legend(loc="outside lower left", ncols=3)
        torque.set_xlabel("time  [s]")
        slew, K1 = data.with_moment.chain.slew, plain(data.gains.K1)
        travel = plain(slew.travel_of(data.arm.length), 3)
        what = f"{travel} m of tip travel in {plain(slew.rise_time, 3)} s, K1 = {K1}"
        headline(figure, f"{data.arm.name}: {what}")
    return figure


def root_moment(each: Mapping[str, Simulation], *, ax: Axes) -> None:
    """The moment at the root between and at the samples, and the rigid arm's."""
    first = next(iter(each.values()))
    t = first.scenario.t
    T = first.scenario.period
    ax.step(t - T, first.scenario.rigid_moment, where="post", color=GREY, lw=1.0, ls=(0, (4, 3)), label="rigid arm")
    for (name, simulation), colour in zip(each.items(), (ORANGE, BLUE), strict=True):
        curves.root_moment(simulation).draw(ax, colour, name)
    _until(first, ax)
    ax.set_ylabel("root moment  [N m]")


def tip_error(arm: Arm, each: Mapping[str, Simulation], *, ax: Axes) -> None:
    """How far the tip is from where a rigid arm on its reference would have it, in mm."""
    for simulation, colour in zip(each.values(), (ORANGE, BLUE), strict=True):
        found = curves.tip_deviation(arm, simulation)
        replace(found, low=1e3 * found.low, high=1e3 * found.high).draw(ax, colour)
    _until(next(iter(each.values())), ax)
    ax.set_ylabel("tip − reference  [mm]")


def motor_torque(each: Mapping[str, Simulation], *, ax: Axes) -> None:
    """The torque that the motor holds from sample to sample; in volts where the chain has a motor constant."""
    first = next(iter(each.values()))
    in_volts = first.volts is not None
    for simulation, colour in zip(each.values(), (ORANGE, BLUE), strict=True):
        values = simulation.volts if simulation.volts is not None else simulation.torque
        held = curves.curve(simulation.t, values)
        if held.is_band:
            held.draw(ax, colour)
        else:
            ax.step(simulation.t, values, where="post", color=colour, lw=1.3)
    _until(first, ax)
    ax.set_ylabel("motor  [V]" if in_volts else "motor torque  [N m]")


def _until(simulation: Simulation, ax: Axes) -> None:
    ax.axvline(simulation.scenario.busy_until, color=INK, lw=0.8, ls=(0, (1, 2)))
    ax.axhline(0.0, color=GREY, lw=0.6)
    ax.set_xlim(0.0, float(simulation.scenario.t[-1]))


def what_slews_show(data: Slews) -> str:
    """The picture in numbers: what moment feedback does to what is left after the slew."""
    gone = [
        f"{name} at {significant(run.stopped.time, 3)} s"
        for name, run in (("without moment feedback", data.without), ("with it", data.with_moment))
        if run.stopped is not None
    ]
    clipped = clipped_words(data.each)
    if gone:
        return f"The loop runs away until the arm is folded up: {' and '.join(gone)}.{clipped}"
    before, after = residual_moment_rms(data.without), residual_moment_rms(data.with_moment)
    settled = [_settled(simulation) for simulation in (data.without, data.with_moment)]
    each = f"Without moment feedback {settled[0]}, with it {settled[1]}"
    both = f"With moment feedback or without it {settled[0]}" if settled[0] == settled[1] else each
    ratio = "" if before == 0 or after == 0 else f", {significant(before / after, 3)} times as much without as with it"
    return (
        f"Root moment left after the slew, less the rigid arm's: {significant(before, 3)} N m rms with K2 = 0, "
        f"{significant(after, 3)} N m with K2 = {plain(data.gains.K2)}{ratio}. "
        f"{both}.{clipped}"
    )


def seen_words(data: Slews) -> str:
    """What the moment feedback sees during the slew."""
    if data.with_moment.chain.slew.reading == "total":
        return "the whole moment"
    return "the moment less the rigid arm's (dashed)"


def _settled(simulation: Simulation) -> str:
    time = settling_time(simulation)
    if time > UNTIL * float(simulation.scenario.t[-1]):  # inf, or so near the end that it tells nothing
        return "the moment does not settle within this record"
    return f"the moment stays within 5 % of its largest from {significant(time, 3)} s on"


def clipped_words(each: Mapping[str, Simulation]) -> str:
    """A sentence for every signal that is clipped anywhere; empty where none is."""
    names = {"encoder": "The encoder", "moment": "The strain amplifier", "torque": "The motor or its converter"}
    told = [
        f" {names[signal]} is clipped at {count} of {run.t.size} samples ({name})."
        for name, run in each.items()
        for signal, count in run.saturated.items()
        if count
    ]
    return "".join(told)


def slews_table(data: Slews, stem: str) -> Table:
    """The curves of the picture."""
    return responses_table(stem, "The slew in time", data.arm, {"without": data.without, "with": data.with_moment})


def responses_table(stem: str, title: str, arm: Arm, each: Mapping[str, Simulation]) -> Table:
    """The curves of some simulations of one scenario as they are drawn: a row a point, or a piece of the bands.

    Torques and gains are those held at that time, the rigid arm's moment that of the sample after it.
    """
    found = [(key, curves.root_moment(run), curves.tip_deviation(arm, run), run) for key, run in each.items()]
    t = min((moment.t for _, moment, _, _ in found), key=len)
    task = found[0][3].scenario
    rigid = curves.held(found[0][3], np.r_[task.rigid_moment[1:], task.rigid_moment[-1:]], t)
    columns: list[Column] = [
        Column("t_s", "time", "s", of=t),
        Column("rigid_moment_N_m", "rigid arm", "N m", of=rigid),
    ]
    for key, moment, tip, run in found:
        columns += moment.at(t).columns(f"root_moment_{key}", "root moment", "N m")
        columns += curves.tip(run).at(t).columns(f"tip_{key}", "tip", "m")
        columns += tip.at(t).columns(f"tip_error_{key}", "tip less reference", "m")
        columns.append(Column(f"torque_{key}_N_m", "torque", "N m", of=curves.held(run, run.torque, t)))
        if run.gain is not None and np.ptp(run.gain):
            columns.append(Column(f"K_{key}", "gain", of=curves.held(run, run.gain, t)))
    return Table(stem=stem, title=title, is_data=True, columns=tuple(columns))
