"""A strip chart of one loop through a coarse chain: the steps of the ADC, the delay, and where the motor saturates."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tfarm.arm import Arm, HubFeedback
from tfarm.columns import Column, Table
from tfarm.digits import plain, significant
from tfarm.dsp import Measurement, Simulation, Simulator, scenario
from tfarm.dsp.chain import Chain
from tfarm.plots.style import BLUE, FAINT, GREEN, GREY, INK, ORANGE, blank, headline, style
from tfarm.records import record
from tfarm.report.curves import Curve, continuous, held, resolved, root_moment

Real = NDArray[np.float64]

BITS = 6  # of the ADC: few, so that its steps are seen
SHARE = 0.8  # of the torque that the ideal chain takes: what the motor gives at most
ROOM = 1.2  # times the largest moment: the ADC's range
DELAY = 1.0  # samples
LASTING = 2.0  # times the slew
CLOSE = 14  # samples in the close-up
MOST_LEVELS = 60  # of the ADC that are drawn: more would be a grey wall
SATURATED = "#f6d9c2"


@dataclass(frozen=True)
@record
class StripChart:
    """A slew through a coarse chain.

    `read` [N m] is what the ADC hands over at each sample, `asked` [N m] the torque that the controller then wants;
    `simulation.torque` is what the motor gives, `delay_samples` later.
    """

    arm: Arm
    gains: HubFeedback
    simulation: Simulation
    read: Real
    asked: Real

    @property
    def step(self) -> float:
        """One step of the ADC [N m]."""
        c = self.simulation.chain.converters
        assert c.moment_range is not None
        assert c.moment_bits is not None
        return 2 * c.moment_range / 2**c.moment_bits

    @property
    def limit(self) -> float:
        """The most the motor gives [N m]."""
        return self.simulation.chain.actuator.torque_limit

    @property
    def saturated(self) -> NDArray[np.bool_]:
        """At which samples more was asked than the motor gives."""
        return np.asarray(abs(self.asked) > self.limit)


def strip_chart(arm: Arm, gains: HubFeedback, ideal: Simulation, modes: int) -> StripChart:
    """The same slew as that of an ideal chain, with a coarse ADC, a weak motor and one more sample of delay."""
    chain = coarse_chain(ideal)
    task = scenario("slew", arm, chain, LASTING * chain.slew.rise_time)
    read, asked = np.zeros(task.t.size), np.zeros(task.t.size)

    def controller(m: Measurement) -> float:
        u = m.feedforward + gains.K1 * (m.rate_reference - m.hub_rate) - gains.K2 * m.vibration
        read[m.k], asked[m.k] = m.root_moment, u
        return u

    (done,) = resolved(Simulator(arm, chain, task, count=modes), arm, lambda each: each.controller(controller))
    n = done.torque.size
    return StripChart(arm, gains, done, read[:n], asked[:n])


def coarse_chain(ideal: Simulation) -> Chain:
    """A simulation's chain; where that is ideal 6 bits of ADC over a little more than its moment, 80 % of its torque as
    the motor's limit, and one sample of delay."""
    chain, c = ideal.chain, ideal.chain.converters
    if c.moment_bits is None:
        span = c.moment_range or _nice(ROOM * float(abs(ideal.at_samples.root_moment).max()))
        c = replace(c, moment_bits=BITS, moment_range=span)
    limit = min(chain.actuator.torque_limit, c.torque_range or math.inf)
    if math.isinf(limit):
        limit = float(f"{SHARE * float(abs(ideal.torque).max()):.2g}")
    return replace(
        chain,
        sampling=replace(chain.sampling, delay_samples=chain.sampling.delay_samples or DELAY),
        converters=c,
        actuator=replace(chain.actuator, torque_limit=limit),
    )


def example_words(ideal: Chain, coarse: Chain) -> str:
    """What of a coarse chain is an example, and what the arm's own file has."""
    parts = (
        ("ADC", ideal.converters.moment_bits is not None),
        ("delay", ideal.sampling.delay_samples > 0),
        ("motor limit", ideal.actuator.torque_limit == coarse.actuator.torque_limit),
    )
    own = [name for name, is_own in parts if is_own]
    made_up = [name for name, is_own in parts if not is_own]
    if not own:
        return "An example, and nobody's hardware"
    if not made_up:
        return f"The arm's own {', '.join(own)}"
    return f"The arm's own {' and '.join(own)}; {' and '.join(made_up)} an example"


def _nice(x: float) -> float:
    """Rounded up to two digits."""
    power = 10.0 ** (math.floor(math.log10(x)) - 1)
    return float(f"{math.ceil(x / power) * power:.2g}")


def draw_strip_chart(data: StripChart) -> Figure:
    """The whole slew, and a close-up of the samples around its end."""
    with style():
        figure = blank(9.0, 6.6)
        axes = figure.subplots(2, 2, width_ratios=[1.25, 1.0], sharex="col")
        window = close_up(data)
        for column, span in enumerate(((0.0, float(data.simulation.t[-1])), window)):
            is_close = column == 1
            moment(data, is_close, ax=axes[0, column])
            torque(data, is_close, ax=axes[1, column])
            axes[1, column].set_xlim(*span)
            axes[1, column].set_xlabel("time  [s]")
        _limits(data, window, axes[0, 1], axes[1, 1])
        for ax in axes[:, 0]:
            ax.axvspan(*window, color=GREY, alpha=0.16, lw=0)
        axes[0, 0].set_ylabel("root moment  [N m]")
        axes[1, 0].set_ylabel("motor torque  [N m]")
        axes[0, 1].set_title("close-up of the grey strip", fontsize=9.5)
        figure.legend(loc="outside lower left", ncols=3)
        headline(figure, f"{data.arm.name}: the slew through {_chain_words(data)}")
    return figure


def _chain_words(data: StripChart) -> str:
    c, delay = data.simulation.chain.converters, data.simulation.chain.sampling.delay_samples
    late = f"{plain(delay)} sample{'s' * (delay != 1)} late"
    return f"{c.moment_bits} bits of ADC, {late}, at most {plain(data.limit, 3)} N m"


def close_up(data: StripChart) -> tuple[float, float]:
    """A few samples at the end of the slew, where the torque leaves its limit."""
    T = data.simulation.scenario.period
    end = min(data.simulation.scenario.busy_until, float(data.simulation.t[-1]))
    return end - 5 * T, end + (CLOSE - 5) * T


def moment(data: StripChart, is_close: bool, *, ax: Axes) -> None:
    """What the arm has, and what the ADC makes of it."""
    s, step = data.simulation, significant(data.step, 3)
    hidden = "" if is_close else "_"
    drawn = root_moment(s) if not is_close else Curve(*_twice(*continuous(s, "root_moment")), False)
    drawn.draw(ax, BLUE, hidden + "root moment of the arm")
    ax.step(
        s.t, data.read, where="post", color=ORANGE, lw=1.1,
        marker="o" if is_close else "", ms=4, label=f"{hidden}as the ADC reads it, steps of {step} N m",
    )  # fmt: skip
    ax.axhline(0.0, color=GREY, lw=0.6)


def torque(data: StripChart, is_close: bool, *, ax: Axes) -> None:
    """What the controller asks at a sample, and what the motor gives later, at most its limit."""
    s, late = data.simulation, data.simulation.chain.sampling.delay_samples * data.simulation.scenario.period
    hidden = "" if is_close else "_"
    for first, last in _runs(data.saturated):
        ax.axvspan(s.t[first] + late, s.t[last] + late + s.scenario.period, color=SATURATED, lw=0)
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
        ax.annotate("delay", (s.t[k] + late / 2, s.torque[k]), xytext=(0, 5), textcoords="offset points", ha="center")


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last index of each run of True."""
    edges = np.diff(np.r_[0, flags.astype(int), 0])
    return list(zip(np.nonzero(edges == 1)[0].tolist(), (np.nonzero(edges == -1)[0] - 1).tolist(), strict=True))


def _limits(data: StripChart, window: tuple[float, float], upper: Axes, lower: Axes) -> None:
    """The close-up fitted to what is in it."""
    s = data.simulation
    t, y = continuous(s, "root_moment")
    seen = y[(t >= window[0]) & (t <= window[1])]
    _fit(upper, seen)
    low, high = (math.floor(y / data.step) for y in upper.get_ylim())
    for level in range(low + 1, high + 1) if high - low <= MOST_LEVELS else ():
        upper.axhline(level * data.step, color=FAINT, lw=0.7, zorder=0.8)
    upper.grid(False)
    at = (s.t >= window[0] - 2 * s.scenario.period) & (s.t <= window[1])
    _fit(lower, np.r_[s.torque[at], data.asked[at]])


def _fit(ax: Axes, y: Real) -> None:
    if y.size:
        room = 0.12 * max(float(np.ptp(y)), 1e-12)
        ax.set_ylim(float(y.min()) - room, float(y.max()) + room)


def _twice(t: Real, y: Real) -> tuple[Real, Real, Real]:
    return t, y, y


def strip_table(data: StripChart, stem: str) -> Table:
    """The curve of the moment as it is drawn, and what is held from sample to sample at its times."""
    s, drawn = data.simulation, root_moment(data.simulation)
    columns = (
        Column("t_s", "time", "s", of=drawn.t),
        *drawn.columns("root_moment", "root moment", "N m"),
        Column("read_moment_N_m", "as the ADC reads it", "N m", of=held(s, data.read, drawn.t)),
        Column("torque_asked_N_m", "torque asked", "N m", of=held(s, data.asked, drawn.t)),
        Column("torque_given_N_m", "torque given, after the delay", "N m", of=held(s, s.torque, drawn.t)),
    )
    return Table(stem=stem, title="Strip chart", is_data=True, columns=columns)
