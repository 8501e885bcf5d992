"""A slew through a coarse chain, with all that passes between its parts: what is read, asked and given."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tfarm.arm import MOMENT_GAIN, Arm, HubFeedback
from tfarm.arrays import Real
from tfarm.dsp.chain import Chain
from tfarm.dsp.converters import quantisers
from tfarm.dsp.curves import resolved
from tfarm.dsp.kernel import AMPLIFIER, STEP
from tfarm.dsp.measurement import Measurement
from tfarm.dsp.scenarios import scenario
from tfarm.dsp.simulate import Simulator
from tfarm.dsp.simulation import Simulation
from tfarm.records import record

COARSE_BITS = 6  # of the ADC: few, so that its steps are seen
MOTOR_SHARE = 0.8  # of the torque that the ideal chain takes: what the motor gives at most
RANGE_SHARE = 1.2  # times the largest moment: the ADC's range
CHART_DELAY = 1.0  # samples, where the chain has none
CHART_LENGTH = 2.0  # times the slew


@dataclass(frozen=True)
@record
class StripChart:
    """A slew through a coarse chain.

    `read` [N m] is what the ADC hands over at each sample, `asked` [N m, V or A] what the controller then wants;
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
        return float(quantisers(self.simulation.chain)[AMPLIFIER, STEP])

    @property
    def limit(self) -> float:
        """The most the motor gives [N m, V or A]."""
        return self.simulation.chain.actuator.torque_limit

    @property
    def saturated(self) -> NDArray[np.bool_]:
        """At which samples more was asked than the motor gives."""
        return np.asarray(abs(self.asked) > self.limit)


def strip_chart(arm: Arm, gains: HubFeedback, ideal: Simulation, modes: int) -> StripChart:
    """The same slew as that of an ideal chain, with a coarse ADC, a weak motor and one more sample of delay."""
    chain = coarse_chain(ideal)
    task = scenario("slew", arm, chain, CHART_LENGTH * chain.slew.rise_time)
    read, asked = np.zeros(task.t.size), np.zeros(task.t.size)

    def controller(m: Measurement) -> float:
        u = m.asked(gains, gains[MOMENT_GAIN])
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
        span = RANGE_SHARE * float(abs(ideal.at_samples.root_moment).max())
        unit = 10.0 ** (math.floor(math.log10(span)) - 1)
        span = c.moment_range or float(f"{math.ceil(span / unit) * unit:.2g}")  # rounded up to two digits
        c = replace(c, moment_bits=COARSE_BITS, moment_range=span)
    limit = min(chain.actuator.torque_limit, c.torque_range or math.inf)
    if math.isinf(limit):
        limit = float(f"{MOTOR_SHARE * float(abs(ideal.torque).max()):.2g}")
    return replace(
        chain,
        sampling=replace(chain.sampling, delay_samples=chain.sampling.delay_samples or CHART_DELAY),
        converters=c,
        actuator=replace(chain.actuator, torque_limit=limit),
    )
