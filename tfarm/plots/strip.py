"""A strip chart of one loop through a coarse chain: the steps of the ADC, the delay, and where the motor saturates."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tfarm.arrays import Real
from tfarm.digits import how_many, plain, significant
from tfarm.dsp.traces import StripChart, TimeCurve, continuous, root_moment

from .labels import OFFSETS_FURTHER, Label
from .motion import draw_curve, motor_words
from .style import BLUE, FAINT, GREEN, GREY, INK, ORANGE, blank, headline, style

CLOSE_UP_SAMPLES = 14  # in which single steps of the ADC and the delay are seen
MOST_ADC_LEVELS = 60  # of the ADC that are drawn: more would be a grey wall
SATURATED = "#f6d9c2"


def draw_strip_chart(data: StripChart) -> Figure:
    """The whole slew, and a close-up of the samples around its end."""
    with style():
        figure = blank(9.0, 6.6)
        axes = figure.subplots(2, 2, width_ratios=[1.25, 1.0], sharex="col")
        window = close_up(data)
        for column, span in enumerate(((0.0, float(data.simulation.t[-1])), window)):
            is_close = column == 1
            moment_strip(data, is_close, ax=axes[0, column])
            torque_strip(data, is_close, ax=axes[1, column])
            axes[1, column].set_xlim(*span)
            axes[1, column].set_xlabel("time  [s]")
        _limits(data, window, axes[0, 1], axes[1, 1])
        for ax in axes[:, 0]:
            ax.axvspan(*window, color=GREY, alpha=0.16, lw=0)
        axes[0, 0].set_ylabel("root moment  [N m]")
        axes[1, 0].set_ylabel(motor_words(data.arm.input_unit))
        axes[0, 1].set_title("close-up of the grey strip", fontsize=9.5)
        figure.legend(loc="outside lower left", ncols=3)
        bits, late = data.simulation.chain.converters.moment_bits, data.simulation.chain.sampling.delay_samples
        most = f"{plain(data.limit, 3)} {data.arm.input_unit}"
        chain = f"{bits} bits of ADC, {how_many(late, 'sample')} late, at most {most}"
        headline(figure, f"{data.arm.name}: the slew through {chain}")
    return figure


def close_up(data: StripChart) -> tuple[float, float]:
    """A few samples at the end of the slew, where the torque leaves its limit."""
    T = data.simulation.scenario.period
    end = min(data.simulation.scenario.busy_until, float(data.simulation.t[-1]))
    return end - 5 * T, end + (CLOSE_UP_SAMPLES - 5) * T


def moment_strip(data: StripChart, is_close: bool, *, ax: Axes) -> None:
    """What the arm has, and what the ADC makes of it."""
    s, step = data.simulation, significant(data.step, 3)
    hidden = "" if is_close else "_"
    t, y = continuous(s, "root_moment")
    drawn = TimeCurve(t, y, y, False) if is_close else root_moment(s)
    draw_curve(drawn, ax, BLUE, hidden + "root moment of the arm")
    ax.step(
        s.t, data.read, where="post", color=ORANGE, lw=1.1,
        marker="o" if is_close else "", ms=4, label=f"{hidden}as the ADC reads it, steps of {step} N m",
    )  # fmt: skip
    ax.axhline(0.0, color=GREY, lw=0.6)


def torque_strip(data: StripChart, is_close: bool, *, ax: Axes) -> None:
    """What the controller asks at a sample, and what the motor gives later, at most its limit."""
    s, late = data.simulation, data.simulation.chain.sampling.delay_samples * data.simulation.scenario.period
    hidden = "" if is_close else "_"
    turns = np.diff(np.r_[0, data.saturated.astype(int), 0])  # 1 where the motor comes to its limit, -1 after
    for first, stop in zip(np.flatnonzero(turns == 1), np.flatnonzero(turns == -1), strict=True):
        ax.axvspan(s.t[first] + late, s.t[stop - 1] + late + s.scenario.period, color=SATURATED, lw=0)
    ax.fill_between([], [], color=SATURATED, label=hidden + "saturated")
    ax.step(
        s.t, data.asked, where="post", color=GREY, lw=1.0, ls=(0, (4, 2)) if not is_close else "none",
        marker="o" if is_close else "", mfc="white", ms=4.5, label=hidden + "torque asked at the sample",
    )  # fmt: skip
    ax.step(s.t + late, s.torque, where="post", color=GREEN, lw=1.4, label=hidden + "torque given, after the delay")
    for sign in (-1, 1):
        label = hidden + "motor limit" if sign > 0 else None
        ax.axhline(sign * data.limit, color=INK, lw=0.9, ls=(0, (1, 2)), label=label)
    k = int(np.searchsorted(s.t, close_up(data)[0])) + 8
    if is_close and late and k < s.torque.size:
        ax.annotate(
            "", (s.t[k] + late, s.torque[k]), (s.t[k], s.torque[k]), zorder=6,
            arrowprops={"arrowstyle": "->", "color": INK, "lw": 1.2, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        ax.add_artist(Label("delay", [(s.t[k] + late / 2, float(s.torque[k]))], OFFSETS_FURTHER, fontsize=10.0))


def _limits(data: StripChart, window: tuple[float, float], upper: Axes, lower: Axes) -> None:
    """The close-up fitted to what is in it."""
    s = data.simulation
    t, y = continuous(s, "root_moment")
    seen = y[(t >= window[0]) & (t <= window[1])]
    _fit(upper, seen)
    low, high = (math.floor(y / data.step) for y in upper.get_ylim())
    for level in range(low + 1, high + 1) if high - low <= MOST_ADC_LEVELS else ():
        upper.axhline(level * data.step, color=FAINT, lw=0.7, zorder=0.8)
    upper.grid(False)
    at = (s.t >= window[0] - 2 * s.scenario.period) & (s.t <= window[1])
    _fit(lower, np.r_[s.torque[at], data.asked[at]])


def _fit(ax: Axes, y: Real) -> None:
    if y.size:
        room = 0.12 * max(float(np.ptp(y)), 1e-12)
        ax.set_ylim(float(y.min()) - room, float(y.max()) + room)
