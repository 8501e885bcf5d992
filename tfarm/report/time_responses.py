"""The slew in time, with and without moment feedback: the paper's Figures 4, 6, 8 and 9 in spirit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback
from tfarm.dsp import Simulation, Simulator, scenario
from tfarm.dsp.chain import Chain
from tfarm.dsp.results import residual_moment_rms, settling_time
from tfarm.records import record
from tfarm.report.digits import plain, significant
from tfarm.report.figures import BLUE, GREY, INK, ORANGE, blank, headline, style
from tfarm.report.tables import Column, Table, data_column

Real = NDArray[np.float64]

BETWEEN = 3  # records between two samples
DURATION = 3.0  # s


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


def slews(arm: Arm, gains: HubFeedback, chain: Chain, modes: int, duration: float = DURATION) -> Slews:
    """The slew of the chain.  Raises ParameterError for an arm that cannot turn."""
    simulator = Simulator(arm, chain, scenario("slew", arm, chain, duration), count=modes, between=BETWEEN)
    return Slews(arm, gains, simulator.linear(HubFeedback(K1=gains.K1, K2=0.0)), simulator.linear(gains))


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
        slew = data.with_moment.chain.slew
        what = f"{plain(slew.travel, 3)} m of tip travel in {plain(slew.rise_time, 3)} s, K1 = {plain(data.gains.K1)}"
        headline(figure, f"{data.arm.name}: {what}")
    return figure


def root_moment(each: Mapping[str, Simulation], *, ax: Axes) -> None:
    """The moment at the root between and at the samples, and the rigid arm's."""
    first = next(iter(each.values()))
    t = first.scenario.t
    T = first.scenario.period
    ax.step(t - T, first.scenario.rigid_moment, where="post", color=GREY, lw=1.0, ls=(0, (4, 3)), label="rigid arm")
    for (name, simulation), colour in zip(each.items(), (ORANGE, BLUE), strict=True):
        ax.plot(*continuous(simulation, "root_moment"), color=colour, lw=1.3, label=name)
    _until(first, ax)
    ax.set_ylabel("root moment  [N m]")


def tip_error(arm: Arm, each: Mapping[str, Simulation], *, ax: Axes) -> None:
    """How far the tip is from where a rigid arm on its reference would have it, at the samples."""
    for simulation, colour in zip(each.values(), (ORANGE, BLUE), strict=True):
        ax.plot(simulation.t, 1e3 * away(arm, simulation), color=colour, lw=1.3)
    _until(next(iter(each.values())), ax)
    ax.set_ylabel("tip − reference  [mm]")


def away(arm: Arm, simulation: Simulation) -> Real:
    """Tip displacement less L times the reference angle [m], at the samples."""
    reference = arm.link.length * simulation.scenario.hub_angle[: simulation.t.size]
    error: Real = simulation.at_samples.tip_displacement - reference
    return error


def motor_torque(each: Mapping[str, Simulation], *, ax: Axes) -> None:
    """The torque that the motor holds from sample to sample; in volts where the chain has a motor constant."""
    first = next(iter(each.values()))
    in_volts = first.volts is not None
    for simulation, colour in zip(each.values(), (ORANGE, BLUE), strict=True):
        values = simulation.volts if simulation.volts is not None else simulation.torque
        ax.step(simulation.t, values, where="post", color=colour, lw=1.3)
    _until(first, ax)
    ax.set_ylabel("motor  [V]" if in_volts else "motor torque  [N m]")


def _until(simulation: Simulation, ax: Axes) -> None:
    ax.axvline(simulation.scenario.busy_until, color=INK, lw=0.8, ls=(0, (1, 2)))
    ax.axhline(0.0, color=GREY, lw=0.6)
    ax.set_xlim(0.0, float(simulation.scenario.t[-1]))


def continuous(simulation: Simulation, signal: str) -> tuple[Real, Real]:
    """A signal at the samples and between them, in order of time."""
    at, between = simulation.at_samples, simulation.between
    if between is None:
        return at.t, getattr(at, signal)
    t, y = np.r_[at.t, between.t], np.r_[getattr(at, signal), getattr(between, signal)]
    order = np.argsort(t, kind="stable")
    return t[order], y[order]


def what_slews_show(data: Slews) -> str:
    """The picture in numbers: what moment feedback does to what is left after the slew."""
    before, after = residual_moment_rms(data.without), residual_moment_rms(data.with_moment)
    if data.without.stopped or data.with_moment.stopped:
        stop = data.with_moment.stopped or data.without.stopped
        assert stop is not None
        return f"The loop runs away: the simulation stopped at {significant(stop.time, 3)} s."
    settled = [_settled(simulation) for simulation in (data.without, data.with_moment)]
    ratio = "" if before == 0 or after == 0 else f", {significant(before / after, 3)} times as much without as with it"
    return (
        f"Root moment left after the slew: {significant(before, 3)} N m rms with K2 = 0, {significant(after, 3)} N m "
        f"with K2 = {plain(data.gains.K2)}{ratio}. The moment stays within 5 % of its largest {settled[0]} without, "
        f"{settled[1]} with moment feedback."
    )


def _settled(simulation: Simulation) -> str:
    time = settling_time(simulation)
    return "not within this record" if math.isinf(time) else f"from {significant(time, 3)} s on"


def slews_table(data: Slews, stem: str) -> Table:
    """The signals at the samples."""
    first = data.without
    n = min(first.t.size, data.with_moment.t.size)
    columns: list[Column] = [data_column("t_s", "time", "s", first.t[:n])]
    columns.append(data_column("rigid_moment_N_m", "rigid arm", "N m", first.scenario.rigid_moment[:n]))
    for key, simulation in (("without", first), ("with", data.with_moment)):
        columns += signal_columns(key, simulation, n)
        columns.append(data_column(f"tip_error_{key}_m", "tip less reference", "m", away(data.arm, simulation)[:n]))
    return Table(stem=stem, title="The slew in time", caption="", is_data=True, columns=tuple(columns))


def signal_columns(key: str, simulation: Simulation, n: int) -> Sequence[Column]:
    """Root moment, tip and torque of one simulation at its first n samples."""
    at = simulation.at_samples
    return (
        data_column(f"root_moment_{key}_N_m", "root moment", "N m", at.root_moment[:n]),
        data_column(f"tip_{key}_m", "tip", "m", at.tip_displacement[:n]),
        data_column(f"torque_{key}_N_m", "torque", "N m", simulation.torque[:n]),
    )
