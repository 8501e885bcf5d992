"""Signals over time for pictures: resolved for the fastest visible mode, or a band from lowest to highest value.

Under a held torque u a mode circles its rest position, a + u/p, and the circle shrinks with Re p.  The largest circle
of every mode in a simulation, times its weight in an output, is its amplitude there.

So a simulation is made twice: first at its samples, to find the modes that ring visibly, then with at least 20 records
in each period of the fastest of them.  Where that is too much for a line on a page, the curve is drawn, and written to
its file, as the band between its smallest and largest value over at least two such periods.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from tfarm.arm import Arm, HubFeedback
from tfarm.arm.chain import TIME_ROUNDING
from tfarm.arrays import Complex, Real, Whole
from tfarm.case import Case
from tfarm.dsp.plant import RECORDED
from tfarm.dsp.scenarios import Scenario
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import Simulation
from tfarm.errors import require
from tfarm.records import frozen
from tfarm.schema import Column
from tfarm.spectrum import modes

# of a curve in each period of the fastest visible mode
POINTS_A_PERIOD = 20
# of the height of a curve: a pixel of a picture
VISIBLE = 1 / 300
# points of a line: at 20 a period still three pixels a period
MOST_LINE = 6000
# frames a second
RATE = 20


def records_between(arm: Arm, run: Simulation) -> int:
    """Return the number of records between two samples that resolve every visible mode in the drawn curves."""
    if run.t.size < 2:
        return 0
    frequency, size = run.rings
    curves = {"root_moment": run.at_samples.root_moment, "tip_displacement": away(arm, run)}
    seen = [size[RECORDED.index(name)] > VISIBLE * np.ptp(curve) for name, curve in curves.items()]
    fastest = frequency[np.any(seen, axis=0)].max(initial=0.0)
    return max(0, math.ceil(POINTS_A_PERIOD * fastest * run.scenario.period / (2 * math.pi)) - 1)


@frozen
class TimeCurve:
    """A signal over time: a line where `low` is `high`, else the band between them from each `t` [s] to the next."""

    t: Real
    low: Real
    high: Real
    is_band: bool

    def at(self, t: Real) -> TimeCurve:
        """Return the same at other times, at or after its own, for a file with one column of time."""
        if self.t.size == t.size:
            return self
        k = np.clip(np.searchsorted(self.t, t * (1 + TIME_ROUNDING), side="right") - 1, 0, self.t.size - 1)
        return TimeCurve(t, self.low[k], self.high[k], self.is_band)

    def columns(self, key: str, unit: str) -> Sequence[Column]:
        """Return the drawn curve, for its file: one column, or both edges of the band."""
        name = f"{key}_{unit.replace(' ', '_')}"
        if not self.is_band:
            return (Column(name, of=self.low),)
        return Column(f"{name}_low", of=self.low), Column(f"{name}_high", of=self.high)


def resolve_simulations(
    simulator: Simulator, arm: Arm, *runs: Callable[[Simulator], Simulation]
) -> list[Simulation]:
    """Return the simulations of one picture, with enough records between their samples for its fastest visible mode."""
    needed = max(records_between(arm, run(simulator)) for run in runs)
    # records between two samples; the most of a long scenario are some 30 MB
    least = 3
    most = max(least, 400_000 // simulator.scenario.t.size)
    finer = simulator.finer(min(max(least, needed), most))
    return [run(finer) for run in runs]


def points_a_period(arm: Arm, run: Simulation) -> tuple[float, int]:
    """Return the points in a period of the fastest visible mode (inf without one), and the number needed for 20.

    That number is of records between two samples.
    """
    needed = records_between(arm, run)
    there = 0 if run.between is None else run.between.t.size // max(1, run.t.size)
    return (POINTS_A_PERIOD * (there + 1) / (needed + 1) if needed else math.inf), needed


def away(arm: Arm, simulation: Simulation) -> Real:
    """Return the tip displacement less that of a rigid arm on its reference [m], at the samples."""
    reference = arm.reach * simulation.scenario.hub_angle[: simulation.t.size]
    return simulation.at_samples.tip_displacement - reference


def curve_of(simulation: Simulation, signal: str) -> TimeCurve:
    """Return a signal over time, "root_moment" [N m] or "tip_displacement" [m]."""
    return curve(*continuous(simulation, signal))


def tip_deviation(arm: Arm, simulation: Simulation) -> TimeCurve:
    """Return the tip displacement less that of a rigid arm on its reference [m]."""
    t, displacement = continuous(simulation, "tip_displacement")
    return curve(t, displacement - arm.reach * reference_angle(simulation.scenario, t))


def reference_angle(task: Scenario, t: Real) -> Real:
    """Return the reference angle [rad] between its samples, where its rate is linear in time."""
    T = task.period
    rate = task.hub_rate
    k = sample_of(t, T, rate.size)
    slope = np.diff(np.r_[rate, rate[-1:]]) / T
    tau = t - k * T
    return task.hub_angle[k] + tau * (rate[k] + slope[k] * tau / 2)


def sample_of(t: Real, period: float, count: int) -> Whole:
    """Return the sample at or before each time t [s], of `count` samples."""
    return np.minimum(np.floor(t / period * (1 + TIME_ROUNDING)).astype(np.int64), count - 1)


def curve(t: Real, y: Real) -> TimeCurve:
    """Return a line where it is short enough for a page, else a band."""
    if t.size <= MOST_LINE:
        return TimeCurve(t, y, y, False)
    # at most 1500 pieces, each of at least two periods of the fastest mode
    step = max(2 * POINTS_A_PERIOD, math.ceil(t.size / 1500))
    starts = np.arange(0, t.size, step)
    return TimeCurve(t[starts], np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts), True)


def continuous(simulation: Simulation, signal: str) -> tuple[Real, Real]:
    """Return a signal at the samples and between them, in order of time."""
    at = simulation.at_samples
    between = simulation.between
    if between is None:
        return at.t, at.signal(signal)
    t = np.r_[at.t, between.t]
    y = np.r_[at.signal(signal), between.signal(signal)]
    order = np.argsort(t, kind="stable")
    return t[order], y[order]


def held_at(simulation: Simulation, values: Real, t: Real) -> Real:
    """Return values held from sample to sample, at the times t [s]."""
    return values[sample_of(t, simulation.scenario.period, values.size)]


# ------------------------------------------------------------ the motion from above, at the frames of a film


class Motion(NamedTuple):
    """The motion of a run at each frame: `t` (n,) [s], and places x + i y [m] with the hub's axis at 0.

    `link` (n, m) are those of the drawn link, whose deflection is `factor` times the arm's, `reference` (n, 2) the ends
    of a line along the reference.  `speed` is that of the film, `still` the frame with the largest deflection.
    """

    arm: Arm
    run: Simulation
    t: Real
    link: Complex
    reference: Complex
    factor: int
    speed: float
    still: int

    def words(self, frame: int) -> str:
        """Return the time and input."""
        u = held_at(self.run, self.run.torque, self.t[frame])
        return f"t = {self.t[frame]:.2f} s,  u = {u:.3g} {self.arm.input_unit}"


def motion_of(arm: Arm, run: Simulation, until: float = math.inf, most: int = 240) -> Motion:
    """Return the motion of a run up to a time [s]: its torques are applied to the arm again, with more outputs.

    At most about `most` frames.
    """
    require(run.t.size > 1, "run", run.t.size, "give a simulation with more than one sample")
    end = min(until, float(run.t[-1]))
    # stations along the link
    x = np.linspace(0.0, arm.length, 15)
    names = [f"deflection@{each!r}" for each in x.tolist()]
    torque = np.pad(run.torque, (0, run.scenario.t.size - run.torque.size))
    # records between two samples, between two of which is a frame
    again = Simulator(Case(arm, HubFeedback(), run.chain), run.scenario, between=4, outputs=names)
    found = again.controller(lambda measured: float(torque[measured.k]))
    # eight frames to a period of the first mode, as far as the film may be that long
    wish = math.ceil(8 * float(modes(arm, 1).natural_frequency_hz[-1]) / RATE)
    slower = min(max(1.0, wish), most / (RATE * end))
    t = np.arange(1 + round(RATE * slower * end)) / (RATE * slower)
    angle, *each = (np.interp(t, *continuous(found, name)) for name in ("hub_angle", *names))
    deflection = np.stack(each, axis=-1)
    radius = arm.hub.radius
    factor = exaggeration(float(abs(deflection).max()) / arm.reach)
    link = np.exp(1j * angle)[:, None] * (radius + x + 1j * factor * deflection)
    wanted = np.exp(1j * reference_angle(run.scenario, t))
    reference = np.outer(wanted, [radius, 1.07 * arm.reach])
    return Motion(arm, run, t, link, reference, factor, 1 / slower, int(np.argmax(abs(deflection[:, -1]))))


def exaggeration(share: float) -> int:
    """Return the factor of a deflection that is this share of the reach: 1 where it is seen, else 2, 5, 10, 20, ...

    A deflection of 2 % of the reach is seen to scale; an exaggerated one is drawn as 10 % at most.
    """
    if not 0 < share < 0.02:
        return 1
    decade = 10 ** math.floor(math.log10(0.1 / share))
    return max((step * decade for step in (1, 2, 5) if step * decade * share <= 0.1), default=decade)
